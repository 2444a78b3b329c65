"""The end of a report: what was assumed, what is not covered, and what exactly was evaluated."""

from __future__ import annotations

import hashlib

from seerob.core.figures import figure
from seerob.core.snapshot import Verdict
from seerob.outputs.html import Html, joined, table, tag, whole
from seerob.outputs.report.masses import bones_told, masses
from seerob.outputs.report.report import DOUBTFUL, WHO, Report, input_row
from seerob.outputs.report.setup import UNKNOWN, Setup
from seerob.outputs.sentences import number


def assumed(report: Report) -> Html:
    """Findings, and inputs that nobody measured or stated."""
    rows: list[list[str | Html]] = []
    for finding in report.findings:
        mark = {"note": "note", "assumed": "! assumed", "warning": "! warning"}.get(
            finding.level, finding.level
        )
        rows.append([finding.subject, whole(mark), finding.text])
    doubts: list[list[str | Html]] = []
    for name, basis in report.bases.items():
        for item in basis.inputs:
            if item.origin in DOUBTFUL:
                doubts.append([name, *input_row(item)])
    return joined(
        [
            tag("h2", "What was assumed, and by whom"),
            tag("p", "Nothing was assumed, repaired or found odd.") if not rows and not doubts else None,
            table(["about", "kind", "what was found while the model was built"], rows) if rows else None,
            joined(
                [
                    tag("h4", "Figures that nobody measured or stated"),
                    table(["criterion", "input", "value", "origin", "source"], doubts),
                ]
            )
            if doubts
            else None,
        ]
    )


def not_covered(report: Report) -> Html:
    """What no twin can tell, what these criteria leave out, and what stayed undecided."""
    left_out: dict[str, list[str]] = {}
    for name, basis in report.bases.items():
        for item in basis.not_modelled:
            left_out.setdefault(item, []).append(name)
    silent = [s.name for s in report.log.values() if s.verdict is Verdict.UNDECIDED]
    return joined(
        [
            tag("h2", "What is not covered and must be measured"),
            tag(
                "p",
                "A twin shows the motion that it was given. Another program, another person, a failing part "
                "or a control system that reacts differently are other runs. Stopping times and distances, "
                "contact forces and pressures, and the response of protective devices are properties of the "
                "real machine: measure them there.",
            ),
            tag("p", f"Still to be decided by other means: {', '.join(silent)}.", class_="doubt")
            if silent
            else None,
            table(["left out", "by"], [[item, ", ".join(names)] for item, names in left_out.items()])
            if left_out
            else None,
        ]
    )


def evaluated(report: Report) -> Html:
    """Rates, sources, versions, hashes and bodies."""
    scene, log, how = report.scene, report.log, report.setup
    span = f"{figure(log.start, 's')} to {figure(log.end, 's')}, {log.ticks} ticks, period {scene.period:g} s"
    facts: list[list[str | Html]] = [
        ["workstation", scene.title],
        ["editions of the figures", scene.edition],
        ["run time", span],
        *([what, value] for what, value in how.engine),
        *(
            [f"largest tracking error, {e.name}", f"{number(e.error)} rad or m at {e.t:.2f} s"]
            for e in log.tracking
        ),
    ]
    written: list[list[str | Html]] = [
        ["written", report.date],
        ["by", tag("code", report.command)],
        ["hash of all inputs (SHA-256)", tag("code", scene.workstation_hash)],
        *([f"version of {name}", version] for name, version in report.versions.items()),
    ]
    files = [
        [name, f"{len(data)} bytes", tag("code", hashlib.sha256(data).hexdigest())]
        for name, data in sorted(report.files.items())
    ]
    bodies = [
        [node.name, whole(node.role), whole(number(node.mass, "kg")), WHO[node.mass_origin], node.note or "–"]
        for node in scene.nodes
    ]
    heads = ["source", "drives", "from", "what it is", "time-out", "at its end"]
    return joined(
        [
            tag("h2", "What was evaluated"),
            table(["", ""], facts),
            bones_told(log.bones),
            tag("h4", "Sources"),
            _sources(heads, how),
            tag("h4", "With what"),
            table(["", ""], written),
            tag("h4", "Input files") if files else None,
            table(["file", "size", "SHA-256"], files) if files else None,
            tag("h4", "Bodies of the twin"),
            table(["body", "role", "mass", "mass is", "geometry"], bodies),
            masses(scene),
        ]
    )


def _sources(heads: list[str], how: Setup) -> Html:
    if how.sources:
        text = (
            "What is older than its time-out no longer counts: every verdict that needs it is undecided "
            "from then on."
        )
        return joined([table(heads, how.sources), tag("p", text, class_="lead")])
    return tag("p", "No source: everything stands still." if how.readable else UNKNOWN)
