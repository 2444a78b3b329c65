"""What a report is made from, and the words and cells that all of its sections share.

A section that a command adds to the report: sentences and tables, in plain data.
"""

from __future__ import annotations

from dataclasses import dataclass

from seerob.core.snapshot import Basis, Finding, Input, Origin, Scene, Verdict
from seerob.outputs.html import Html, tag, whole
from seerob.outputs.palette import MARK, WORD
from seerob.outputs.report.setup import Setup
from seerob.outputs.sentences import number
from seerob.recording.result_log import ResultLog


@dataclass(frozen=True)
class ReportTable:
    """A table of words and figures that are already written out."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


@dataclass(frozen=True)
class ReportSection:
    """What stands under one heading."""

    title: str
    sentences: tuple[str, ...] = ()
    tables: tuple[ReportTable, ...] = ()
    picture: bytes | None = None
    """PNG."""
    caption: str = ""
    """Caption of the picture."""


DOUBTFUL = (Origin.ASSUMED, Origin.MISSING, Origin.ESTIMATED)
WHO = {
    Origin.MEASURED: "measured",
    Origin.STATED: "stated by its source",
    Origin.GIVEN: "given by the user",
    Origin.COMPUTED: "computed",
    Origin.ESTIMATED: "estimated",
    Origin.CHOICE: "a choice of the method, by seerob",
    Origin.ASSUMED: "assumed, nobody gave it",
    Origin.MISSING: "missing",
}


@dataclass(frozen=True)
class Report:
    """Everything the page says."""

    scene: Scene
    log: ResultLog
    files: dict[str, bytes]
    bases: dict[str, Basis]
    """Per criterion, the one that its worst instant rests on."""
    pictures: dict[str, bytes]
    """PNG of the worst instant per criterion."""
    versions: dict[str, str]
    date: str
    """When the report was written."""
    findings: tuple[Finding, ...]
    """Findings of the model and of the run."""
    setup: Setup
    """Engine and sources."""
    command: str
    """What wrote the report."""
    sections: tuple[ReportSection, ...] = ()
    """Added by a command."""


def badge(verdict: Verdict | None) -> Html:
    """Mark and word; colour comes third."""
    name = "none" if verdict is None else verdict.value
    return tag("span", f"{MARK[verdict]} {WORD[verdict]}", class_=f"badge {name}")


def input_row(item: Input) -> list[str | Html]:
    """Cells of one input of a basis: its name, value, origin and source."""
    value: str | Html = item.value if isinstance(item.value, str) else whole(number(item.value, item.unit))
    origin = (
        tag("span", f"! {WHO[item.origin]}", class_="doubt whole")
        if item.origin in DOUBTFUL
        else WHO[item.origin]
    )
    return [item.name, value, origin, item.source or "–"]
