"""What commands say of permissible speeds: lines, JSON, sections of a report, a bar."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.console.progress import lines
from seerob.app.console.terminal import STATUS, WORDS, line, tell, tell_results
from seerob.core.errors import InputError

if TYPE_CHECKING:
    from seerob.outputs.sink import Writer
    from seerob.session.permissible.between_samples import Bound
    from seerob.session.permissible.evaluation import PermissibleSpeed, Sources
    from seerob.session.permissible.speed_map import PathSegment
    from seerob.session.station import Station

CHOICES = ("all", "ssm", "pfl", "both", "either")
BY = (
    "by speed and separation monitoring, power and force limiting, the lesser of both (both must be there), "
    "whichever permits more at each place, or all that there is; limits of the file on speed and energy "
    "count always"
)
SHOWN = 20
"""Segments that are printed; all of them are in the files."""


def add_permissible(sub: argparse.ArgumentParser) -> None:
    """The option of commands that write a report of something else."""
    text = f"also how fast each robot may go along its path, with a rescaled motion, {BY}"
    sub.add_argument("--permissible", nargs="?", const="all", choices=CHOICES, help=text)


def permissible_found(
    station: Station, by: str, say: Callable[[str, float], None], sources: Sources | None = None
) -> list[tuple[PermissibleSpeed, tuple[PathSegment, ...]]]:
    """What is found for each robot that moves, with its segments.

    Args:
        station: The workstation.
        by: One of `CHOICES`.
        say: Told what is done and which share of it.
        sources: Opened, instead of its own.

    Raises:
        InputError: As of `Station.permissible_speed`; or no robot moves.
    """
    from seerob.session.permissible.ceilings import By
    from seerob.session.permissible.evaluation import Wish
    from seerob.session.permissible.speed_map import segments

    driven = {source.target() for source in station.workstation.sources}
    robots = [robot.name for robot in station.workstation.robots if robot.name in driven]
    if not robots:
        raise InputError.at("--permissible", "sources", "no source drives a robot", "give its motion")
    every = []
    for name in robots:
        found = station.permissible_speed(name, wish=Wish(by=By(by)), sources=sources, say=say)
        every.append((found, segments(found.map)))
    return every


def add_sections(
    writers: Sequence[Writer],
    station: Station,
    found: PermissibleSpeed,
    cut: Sequence[PathSegment],
) -> None:
    """Add what was found to the reports among the writers."""
    from seerob.outputs.sinks.dossier import DossierWriter
    from seerob.session.permissible.summary import ReportPlace, sections

    place = ReportPlace(station.scene(with_sources=False), station.model.meshes, tuple(cut))
    for writer in writers:
        if isinstance(writer, DossierWriter):
            writer.sections += sections(found, place)
            writer.findings += found.findings


def tell_permissible(found: PermissibleSpeed, cut: Sequence[PathSegment], bounds: Sequence[Bound]) -> None:
    """Print what was found, and the verdicts of the run of the rescaled motion."""
    from seerob.session.permissible.ceilings import By

    tell_plan(found, cut)
    for bound in bounds:
        line("bound", bound.sentence())
    word, style = WORDS[found.verdict]
    if found.after is None:
        line(word, found.refused, style)
        return
    tell_results(found.after)
    if found.map.by is By.EITHER:
        line(word, "either method at every instant that was looked at, and all other criteria", style)


def tell_plan(found: PermissibleSpeed, cut: Sequence[PathSegment]) -> None:
    """Print the map by segment, what the rescaled motion costs, and what to know of it."""
    from seerob.session.permissible.summary import segment_words, sentences

    for text in sentences(found):
        line("permissible", text)
    for one in cut[:SHOWN]:
        line("segment", segment_words(one))
    if len(cut) > SHOWN:
        line("segment", f"and {len(cut) - SHOWN} more")
    for spent in found.spent[:6]:
        line("time", f"{spent.time:7.3f} s  {spent.what}")
    tell(found.findings)


def permissible_json(
    found: PermissibleSpeed, cut: Sequence[PathSegment], bounds: Sequence[Bound], folder: Path
) -> dict[str, object]:
    """What was found, for machines; not a number and infinite become null."""
    from seerob.session.permissible.tables import SEGMENT_HEAD, segment_rows

    motion, after, verified = found.rescaled, found.after, found.verified
    return {
        "robot": found.map.robot,
        "asked": list(found.map.asked),
        "before": found.motion.duration,
        "after": None if motion is None else motion.duration,
        "refused": found.refused,
        "by": found.map.by.value,
        "verdict": found.verdict,
        "verified": None
        if verified is None
        else {
            "period": verified.period,
            "instants": verified.asked,
            "largest use": verified.use if math.isfinite(verified.use) else None,
            "undecided": verified.undecided,
        },
        "segments": [dict(zip(SEGMENT_HEAD, row, strict=True)) for row in segment_rows(cut)],
        "criteria": {} if after is None else {name: series.verdict for name, series in after.results.items()},
        "time": {spent.what: spent.time for spent in found.spent},
        "bounds": [bound.figures() for bound in bounds],
        "findings": [{"level": f.level, "subject": f.subject, "text": f.text} for f in found.findings],
        "folder": str(folder),
    }


@contextmanager
def work_progress(*, quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """A bar on a terminal that says which part of the work is done; elsewhere `lines`."""
    if quiet or not STATUS.is_terminal:
        say = (lambda _: None) if quiet else lines()
        yield lambda what, share: say(f"{what}: {share:.0%}")
        return
    from rich.progress import BarColumn, Progress, TextColumn

    with Progress(BarColumn(), TextColumn("{task.description}"), console=STATUS, transient=True) as bars:
        task = bars.add_task("", total=1.0)
        yield lambda what, share: bars.update(task, description=what, completed=share)
