"""What a report is made from, how the run was driven, and the words and cells that all sections share.

A recording is reported on where its sources are not: of the workstation file only the text is used, and what
it leaves out is what each kind says of itself. What cannot be read is said to be unknown.
"""

from __future__ import annotations

import shlex
import sys
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from msgspec import Struct

from seerob.core import plugin
from seerob.core.errors import SeerobError, UnknownName
from seerob.core.snapshot import Basis, Finding, Input, Origin, Scene, Verdict
from seerob.outputs.html import Html, tag
from seerob.outputs.palette import MARK, WORD
from seerob.outputs.sentences import number
from seerob.outputs.words import said, speaking, told, word
from seerob.recording.result_log import ResultLog
from seerob.workstation.conversion import convert
from seerob.workstation.source import Source
from seerob.workstation.workstation import Engine, ReportCover


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
    Origin.MEASURED: word("measured"),
    Origin.STATED: word("stated by its source"),
    Origin.GIVEN: word("given by the user"),
    Origin.COMPUTED: word("computed"),
    Origin.ESTIMATED: word("estimated"),
    Origin.CHOICE: word("a choice of the method, by seerob"),
    Origin.ASSUMED: word("assumed, nobody gave it"),
    Origin.MISSING: word("missing"),
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
    return tag("span", f"{MARK[verdict]} {said(WORD[verdict])}", class_=f"badge {name}")


def _named(item: Input) -> str:
    """What an input is called, and its value; a word may be called otherwise beside its name than alone."""
    # No input is called by a name of the file alone, so that a single word can be told.
    name = found if (found := said(item.name)) != item.name else told(item.name)
    if isinstance(item.value, str):
        pair = f"{item.name}: {item.value}"
        both = said(pair)
        return both if both != pair else ": ".join(filter(None, (name, told(item.value))))
    figure = number(item.value, item.unit)
    return name if figure == "–" else f"{name}: {figure}"


def grouped_inputs(items: Iterable[tuple[str, Input]]) -> list[list[str | Html]]:
    """Inputs with the names of their criteria: those of one origin, source and criteria are one row."""
    rows: dict[tuple[Origin, str], dict[str, dict[str, None]]] = {}
    for name, item in items:
        text = _named(item)
        rows.setdefault((item.origin, item.source), {}).setdefault(text, {})[name] = None
    found: list[list[str | Html]] = []
    for (origin, source), texts in rows.items():
        by: dict[str, list[str]] = {}
        for text, names in texts.items():
            by.setdefault(", ".join(names), []).append(text)
        whose = said(WHO[origin])
        who = tag("span", f"! {whose}", class_="doubt") if origin in DOUBTFUL else whose
        found += [["; ".join(each), criteria, who, told(source) or "–"] for criteria, each in by.items()]
    return found


_Table = TypeVar("_Table", bound=Struct)
UNKNOWN = word("unknown: the workstation file is not at hand or cannot be read")
ORIGINS = {
    "controller": word("measured: the real robot's controller"),
    "vendor_emulator": word("the maker's own controller software, without the robot: preliminary"),
    "simulator": word("a generic simulator: preliminary until it is confirmed on the controller"),
    "planned": word(
        "a planned path that nobody has executed: preliminary until it is confirmed on the controller"
    ),
    "recording": word("one of our recordings; what fed it is written there"),
    "live": word("measured: a person captured as they move"),
    "file": word("a captured person, as the file has it"),
}
_ADDRESSES = ("file", "host", "url", "port", "address", "stream")


@dataclass(frozen=True)
class Setup:
    """Lines for the report."""

    engine: tuple[tuple[str, str], ...]
    """What and how much."""
    sources: tuple[tuple[str, ...], ...]
    """Name, what it drives, where it comes from, class of origin, time-out, at the end."""
    readable: bool
    """Whether the workstation file was there."""
    cover: ReportCover = field(default_factory=ReportCover)
    """What the first page says besides."""


def setup(files: dict[str, bytes]) -> Setup:
    """What the workstation file, the first of ``files``, says of engine and sources."""
    try:
        table = tomllib.loads(next(iter(files.values())).decode()) if files else None
    except (ValueError, RecursionError):
        table = None
    if table is None:
        return Setup(((said("physics"), said(UNKNOWN)),), (), readable=False)
    entries = table.get("sources", [])
    cover = _read(table.get("report", {}), ReportCover) or ReportCover()
    with speaking(cover.language):
        found = [_source(e) for e in entries if isinstance(e, dict)] if isinstance(entries, list) else []
        return Setup(_engine(table.get("engine", {})), tuple(found), readable=True, cover=cover)


def command() -> str:
    """The command line that is running now, when it is ours."""
    program = Path(sys.argv[0]).stem if sys.argv and sys.argv[0] else ""
    if program in ("seerob", "cli", "__main__"):
        return shlex.join(["seerob", *sys.argv[1:]])
    return "a Python program that uses seerob"


def _read(table: object, wanted: type[_Table]) -> _Table | None:
    """A table as the workstation reads it, keys with a unit too; None where it has a mistake."""
    if not isinstance(table, dict):
        return None
    return convert(table, wanted, file="", key="", problems=[])


def _engine(table: object) -> tuple[tuple[str, str], ...]:
    e = _read(table, Engine)
    if e is None:
        return ((said("engine as the file has it"), str(table)),)
    return (
        (
            said("ticks"),
            said("every {period} ({rate})", period=number(e.tick, "s"), rate=number(1 / e.tick, "Hz")),
        ),
        (
            said("physics"),
            said(
                "steps of {period} ({rate}), MuJoCo",
                period=number(e.timestep, "s"),
                rate=number(1 / e.timestep, "Hz"),
            ),
        ),
        (
            said("controllers"),
            said(
                "critically damped; bandwidth {robots} for robots, {people} for people",
                robots=number(e.bandwidth, "Hz"),
                people=number(e.human_bandwidth, "Hz"),
            ),
        ),
        (
            said("largest tracking error that is still judged"),
            f"{number(e.tracking_limit)} {said('rad or m')}",
        ),
        (said("the same of people"), f"{number(e.human_tracking_limit)} {said('rad or m')}"),
        (said("gravity"), ", ".join(number(x) for x in e.gravity) + " m/s²"),
    )


def _source(entry: dict[str, object]) -> tuple[str, ...]:
    kind = str(entry.get("kind", ""))
    rest = {key: value for key, value in entry.items() if key != "kind"}
    source: Source | None
    try:
        # A report must not import a module because a recording names it.
        if kind not in plugin.kinds("sources"):
            raise UnknownName("kind", kind, ())
        source = _read(rest, plugin.load("sources", kind, Source))
    except (SeerobError, ImportError):
        source = None
    drives = str(rest.get("robot") or rest.get("human") or "") if source is None else source.target()
    name = str(rest.get("name") or f"{kind} {drives}".strip())
    places = [str(rest[key]) for key in _ADDRESSES if key in rest]
    captured = "" if source is None else source.captured
    origin = getattr(source, "origin", None) or rest.get("origin") or captured or None
    says = word("this kind does not say: see what was assumed") if origin is None else str(origin)
    if source is None:
        timeout, end = str(rest.get("timeout", said("unknown"))), said("unknown")
    else:
        timeout = number(source.timeout, "s")
        end = (
            said("starts again after {pause}", pause=number(source.loop_pause, "s"))
            if source.loop
            else said("stops")
        )
    return (
        name,
        drives or "–",
        " ".join([kind, *places]),
        said(ORIGINS.get(says, says)),
        timeout,
        end,
    )
