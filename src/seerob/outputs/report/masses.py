"""The mass table of every robot: what each link and each thing on it weighs, and what nobody knows.

How far the bones of people were from where devices saw them, over the run: rows and the report's table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from seerob.core.snapshot import LinkMass, MechanismInfo, Scene
from seerob.description.humans.skeleton import BONES
from seerob.outputs.html import Html, joined, table, tag, whole
from seerob.outputs.report.report import WHO
from seerob.outputs.sentences import number
from seerob.recording.bone_errors import BoneErrors

Cell = str | float | int | None
BONE_HEAD: list[Cell] = ["person", "bone", "what", "unit", "median", "P95", "largest", "at [s]", "ticks"]


def bone_rows(people: Mapping[str, BoneErrors]) -> Iterator[list[Cell]]:
    """A row for all bones of a person together, then one per bone, positions before angles."""
    for name, errors in people.items():
        for e in (*errors.all(), *errors.bones()):
            yield [name, e.bone or "all", e.what, e.unit, e.median, e.p95, e.largest, e.t, e.ticks]


def bones_told(people: Mapping[str, BoneErrors]) -> Html | None:
    """The report's table; nothing when no device saw a person."""
    # What no device saw has no error, which is no praise.
    seen = {name: len({e.bone for e in errors.bones()}) for name, errors in people.items()}
    rows = [
        [
            str(name),
            f"of the bones seen: {seen[str(name)]} of {len(BONES)}" if bone == "all" else str(bone),
            str(what),
            *(number(float(value), str(unit)) for value in (median, p95, largest) if value is not None),
            f"{float(t or 0.0):.2f} s",
        ]
        for name, bone, what, unit, median, p95, largest, t, _ in bone_rows(people)
    ]
    if not rows:
        return None
    head = ["person", "bone", "what is missing", "median", "P95", "largest", "at"]
    text = (
        "How far the twin's bones are from where the devices see them: fit of the person's lengths, "
        "the controllers, and contacts together. Percentiles are good to half a per cent of themselves."
    )
    return joined([tag("h4", "Tracking of bones"), table(head, rows), tag("p", text, class_="lead")])


HEAD = ("link or thing", "mass", "mass is", "moves", "moves as one with", "from, or why")


def total(rows: Sequence[LinkMass]) -> str:
    """``33.1 kg, of which 29.1 kg move``; what is not known is named."""
    known = [row for row in rows if row.mass is not None]
    whole_of_it = sum(row.mass or 0.0 for row in known)
    moving = sum(row.mass or 0.0 for row in known if row.moves)
    unknown = [row.name for row in rows if row.mass is None]
    if unknown and not whole_of_it:
        return "unknown"
    text = f"{number(whole_of_it, 'kg')}, of which {number(moving, 'kg')} move"
    return f"at least {text}; unknown: {', '.join(unknown)}" if unknown else text


def cells(row: LinkMass) -> list[str]:
    """One row of the table, in the order of `HEAD`."""
    mass = "unknown" if row.mass is None else number(row.mass, "kg")
    why = "; ".join(filter(None, (row.note, row.source)))
    return [row.name, mass, WHO[row.origin], "yes" if row.moves else "no", row.merged or "–", why or "–"]


def _shown(row: LinkMass) -> list[str | Html]:
    name, mass, *rest = cells(row)
    return [name, whole(mass), *rest]


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
                    tag("h4", f"Masses of {mechanism.name}: {total(mechanism.masses)}"),
                    table(HEAD, map(_shown, mechanism.masses)),
                ]
            )
            for mechanism in weighed(scene)
        ]
    )
