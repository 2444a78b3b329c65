"""The end of a report: what everything weighs, what was assumed, what is not covered, what was evaluated."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence

from seerob.core.figures import figure
from seerob.core.snapshot import LinkMass, MechanismInfo, Origin, Scene, Verdict
from seerob.description.humans.skeleton import BONES
from seerob.outputs.html import Html, joined, table, tag, whole
from seerob.outputs.report.report import UNKNOWN, WHO, Report, Setup
from seerob.outputs.sentences import grouped, number
from seerob.outputs.words import said, told, word
from seerob.recording.bone_errors import BoneErrors


def assumed(report: Report) -> Html:
    """What was found while the model was built."""
    if not report.findings:
        return tag("p", said("Nothing was assumed, repaired or found odd."))
    marks = {"note": "", "assumed": "! ", "warning": "! "}
    rows = [
        [f.subject, whole(marks.get(f.level, "") + said(f.level)), told(f.text)]
        for f in grouped(report.findings)
    ]
    return table([said("about"), said("kind"), said("what was found while the model was built")], rows)


def not_covered(report: Report) -> Html:
    """What no twin can tell, what these criteria leave out, and what stayed undecided."""
    whose: dict[str, list[str]] = {}
    for name, basis in report.bases.items():
        for item in basis.not_modelled:
            whose.setdefault(item, []).append(name)
    left_out: dict[str, list[str]] = {}
    for item, names in whose.items():
        left_out.setdefault(", ".join(names), []).append(item)
    silent = [s.name for s in report.log.values() if s.verdict is Verdict.UNDECIDED]
    return joined(
        [
            tag(
                "p",
                said(
                    "A twin shows the motion that it was given. Another program, another person, a failing "
                    "part or a control system that reacts differently are other runs. Stopping times and "
                    "distances, contact forces and pressures, and the response of protective devices are "
                    "properties of the real machine: measure them there."
                ),
            ),
            tag(
                "p",
                said("Still to be decided by other means: {names}.", names=", ".join(silent)),
                class_="doubt",
            )
            if silent
            else None,
            table(
                [said("criterion"), said("leaves out")],
                [[names, "; ".join(map(told, items))] for names, items in left_out.items()],
            )
            if left_out
            else None,
        ]
    )


_ROLES = {"human": word("human")}
"""Roles that nothing else names."""


def evaluated(report: Report) -> Html:
    """Rates, sources, versions, hashes and bodies."""
    scene, log, how = report.scene, report.log, report.setup
    span = said(
        "{start} to {end}, {n} ticks, period {period} s",
        start=figure(log.start, "s"), end=figure(log.end, "s"), n=log.ticks, period=f"{scene.period:g}",
    )  # fmt: skip
    facts: list[list[str | Html]] = [
        [said("workstation"), scene.title],
        [said("editions of the figures"), told(scene.edition)],
        [said("run time"), span],
        *([what, value] for what, value in how.engine),
        *(
            [
                said("largest tracking error, {name}", name=e.name),
                f"{number(e.error)} {said('rad or m')}, {e.t:.2f} s",
            ]
            for e in log.tracking
        ),
    ]
    written: list[list[str | Html]] = [
        [said("written"), report.date],
        [said("by"), tag("code", report.command)],
        [said("hash of all inputs (SHA-256)"), tag("code", scene.workstation_hash)],
        *([said("version of {name}", name=name), version] for name, version in report.versions.items()),
    ]
    files = [
        [name, said("{n} bytes", n=len(data)), tag("code", hashlib.sha256(data).hexdigest())]
        for name, data in sorted(report.files.items())
    ]
    alike: dict[tuple[str, Origin, str], list[str]] = {}
    for node in scene.nodes:
        mass = f" {number(node.mass, 'kg')}" if node.mass is not None else ""
        alike.setdefault((node.role, node.mass_origin, node.note), []).append(f"{node.name}{mass}")
    bodies = [
        ["; ".join(names), said(_ROLES.get(role, role)), said(WHO[origin]), told(note) or "–"]
        for (role, origin, note), names in alike.items()
    ]
    heads = [
        said(one) for one in ("source", word("drives"), word("from"), word("what it is"), word("time-out"))
    ] + [said("at its end")]
    return joined(
        [
            table(["", ""], facts),
            bone_errors(log.bones),
            tag("h3", said("Sources"), class_="minor"),
            _sources(heads, how),
            tag("h3", said("With what"), class_="minor"),
            table(["", ""], written),
            tag("h3", said("Input files"), class_="minor") if files else None,
            table([said("file"), said("size"), "SHA-256"], files) if files else None,
            tag("h3", said("Bodies of the twin"), class_="minor"),
            table([said("bodies and masses"), said("role"), said("mass is"), said("geometry")], bodies),
            masses(scene),
        ]
    )


def _sources(heads: list[str], how: Setup) -> Html:
    if how.sources:
        text = said(
            "What is older than its time-out no longer counts: every verdict that needs it is undecided "
            "from then on."
        )
        return joined([table(heads, how.sources), tag("p", text, class_="lead")])
    return tag("p", said("No source: everything stands still.") if how.readable else said(UNKNOWN))


Cell = str | float | int | None
BONE_HEAD: list[Cell] = ["person", "bone", "what", "unit", "median", "P95", "largest", "at [s]", "ticks"]


def bone_rows(people: Mapping[str, BoneErrors]) -> Iterator[list[Cell]]:
    """A row for all bones of a person together, then one per bone, positions before angles."""
    for name, errors in people.items():
        for e in (*errors.all(), *errors.bones()):
            yield [name, e.bone or "all", e.what, e.unit, e.median, e.p95, e.largest, e.t, e.ticks]


def bone_errors(people: Mapping[str, BoneErrors]) -> Html | None:
    """The report's table; nothing when no device saw a person."""
    # What no device saw has no error, which is no praise.
    seen = {name: len({e.bone for e in errors.bones()}) for name, errors in people.items()}
    rows = [
        [
            str(name),
            said("of the bones seen: {n} of {all}", n=seen[str(name)], all=len(BONES))
            if bone == "all"
            else str(bone),
            told(str(what)),
            *(number(float(value), str(unit)) for value in (median, p95, largest) if value is not None),
            f"{float(t or 0.0):.2f} s",
        ]
        for name, bone, what, unit, median, p95, largest, t, _ in bone_rows(people)
    ]
    if not rows:
        return None
    titles = (word("person"), word("bone"), word("what is missing"), word("median"), "P95", "largest", "at")
    head = [said(title) for title in titles]
    text = said(
        "How far the twin's bones are from where the devices see them: fit of the person's lengths, "
        "the controllers, and contacts together. Percentiles are good to half a per cent of themselves."
    )
    return joined(
        [
            tag("h3", said("Tracking of bones"), class_="minor"),
            table(head, rows),
            tag("p", text, class_="lead"),
        ]
    )


HEAD = (
    word("link or thing"),
    word("mass"),
    word("mass is"),
    word("moves"),
    word("moves as one with"),
    word("from, or why"),
)


def total(rows: Sequence[LinkMass]) -> str:
    """``33.1 kg, of which 29.1 kg move``; what is not known is named."""
    known = [row for row in rows if row.mass is not None]
    whole_of_it = sum(row.mass or 0.0 for row in known)
    moving = sum(row.mass or 0.0 for row in known if row.moves)
    unknown = [row.name for row in rows if row.mass is None]
    if unknown and not whole_of_it:
        return said("unknown")
    both = {"all": number(whole_of_it, "kg"), "moving": number(moving, "kg")}
    if not unknown:
        return said("{all}, of which {moving} move", **both)
    return said("at least {all}, of which {moving} move; unknown: {names}", **both, names=", ".join(unknown))


def cells(row: LinkMass) -> list[str]:
    """One row of the table, in the order of `HEAD`."""
    mass = said("unknown") if row.mass is None else number(row.mass, "kg")
    why = "; ".join(filter(None, (row.note, row.source)))
    moves = word("yes") if row.moves else word("no")
    return [row.name, mass, WHO[row.origin], moves, row.merged or "–", why or "–"]


def _shown(rows: Sequence[LinkMass]) -> list[list[str | Html]]:
    """Rows of the table, those that differ by their name only as one."""
    alike: dict[tuple[str, ...], list[str]] = {}
    for row in rows:
        name, *rest = cells(row)
        alike.setdefault(tuple(rest), []).append(name)
    return [
        ["; ".join(names), whole(mass), said(origin), said(moves), merged, told(why)]
        for (mass, origin, moves, merged, why), names in alike.items()
    ]


def weighed(scene: Scene) -> tuple[MechanismInfo, ...]:
    """Robots and machines that have a mass table."""
    return tuple(mechanism for mechanism in scene.mechanisms if mechanism.masses)


def masses(scene: Scene) -> Html | None:
    """The tables of all of them."""
    if not weighed(scene):
        return None
    return joined(
        [
            joined(
                [
                    tag(
                        "h3",
                        said("Masses of {name}: {total}", name=mechanism.name, total=total(mechanism.masses)),
                        class_="minor",
                    ),
                    table([said(title) for title in HEAD], _shown(mechanism.masses)),
                ]
            )
            for mechanism in weighed(scene)
        ]
    )
