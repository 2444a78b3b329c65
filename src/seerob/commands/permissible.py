"""``seerob permissible``: the permissible-speed map of a motion, a motion that keeps to it, and its cost."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seerob.commands import (
    OUT,
    STATUS,
    WORDS,
    Exit,
    add_output,
    add_workstation,
    compiled,
    describe,
    exit_code,
    line,
    run_folder,
    seconds,
    tell,
    tell_results,
)
from seerob.commands.sinks import refuse_existing
from seerob.errors import InputError
from seerob.snapshot import Verdict

if TYPE_CHECKING:
    from seerob.permissible.between_samples import Bound
    from seerob.permissible.evaluation import PermissibleSpeed
    from seerob.sinks.dossier import DossierWriter
    from seerob.station import Station

HELP = "how fast a robot may go along its path: map, rescaled motion, cycle time, CSV, Excel, URScript"
EXAMPLE = "seerob permissible my_cell --acceleration 5 --jerk 50"
FILES = ("map.csv", "map_by_region.csv", "rescaled.csv", "permissible.xlsx", "rescaled.script", "report.html")


def share(text: str) -> float:
    """A share on the command line: 0 or more, less than 1."""
    value = _number(text)
    if not 0 <= value < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a share: give 0 or more, less than 1")
    return value


def above_zero(text: str) -> float:
    """A number above 0 on the command line, and finite."""
    value = _number(text)
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")
    return value


def per_joint(text: str) -> list[float]:
    """One number for all joints, or one for each with commas between them; all above 0."""
    return [above_zero(part) for part in text.split(",")]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)
    sub.add_argument("--robot", help="whose motion (default: the only robot)")
    sub.add_argument(
        "--permit",
        choices=("all", "separation", "contact"),
        default="all",
        help="whose limits count: separation monitoring, contact (power and force), or every criterion",
    )
    for name, unit in (("velocity", "rad/s"), ("acceleration", "rad/s²"), ("jerk", "rad/s³")):
        own = "instead of the robot's" if name == "velocity" else f"instead of the file's {name}_limits"
        text = f"limit of the joints [{unit}], one for all or one each with commas, {own}"
        sub.add_argument(f"--{name}", type=per_joint, help=text)
    sub.add_argument("--not-faster", action="store_true", help="nowhere faster than the given motion")
    sub.add_argument("--margin", type=share, default=0.02, help="share of the map that is not used")
    sub.add_argument("--tolerance", type=above_zero, default=5e-4, help="of the path, per joint [rad or m]")
    sub.add_argument("--spacing", type=above_zero, default=0.02, help="of the map, in joint space [rad or m]")
    sub.add_argument("--period", type=seconds, default=0.008, help="of the rescaled motion [s]")
    sub.add_argument(
        "--bound", type=above_zero, default=1e-3, help="tolerance of bounds between samples [m, m/s]"
    )
    add_output(sub)


def run(options: argparse.Namespace) -> int:
    """Map, rescale, evaluate again, write, and return the exit code of the second evaluation."""
    station = compiled(options.workstation, quiet=options.json)
    from seerob.permissible.evaluation import Wish
    from seerob.permissible.speed_map import Permit
    from seerob.permissible.summary import bounds_section, section
    from seerob.sinks.dossier import Dossier, DossierWriter

    folder = run_folder(station.model.folder, options.output)
    refuse_existing([Dossier()], folder)
    for name in FILES:
        if (folder / name).exists():
            raise InputError.at(folder / name, "", "exists already", "give another folder with -o")
    if not options.json:
        describe(station)
        tell(station.scene().findings)
    wish = Wish(
        permit=Permit(options.permit),
        tolerance=options.tolerance,
        spacing=options.spacing,
        margin=options.margin,
        not_faster=options.not_faster,
        period=options.period,
    )
    writers: list[DossierWriter] = []
    bounds: list[Bound] = []
    with _progress(quiet=options.json) as say:

        def ready(found: PermissibleSpeed) -> None:
            say("bounds between samples", 0.0)
            bounds.extend(_bounds(station, found, options.bound))
            if found.rescaled is None:
                return
            (writer,) = station.open_sinks([Dossier()], folder, station.scene())
            assert isinstance(writer, DossierWriter)
            writer.sections += [section(found), bounds_section(bounds)]
            writer.findings += found.findings
            writers.append(writer)

        found = station.permissible_speed(
            options.robot,
            wish=wish,
            velocity=_each(options.velocity),
            acceleration=_each(options.acceleration),
            jerk=_each(options.jerk),
            writers=writers,
            ready=ready,
            say=say,
        )
    written = _write(station, found, folder, options.period)
    code = _code(found)
    if options.json:
        OUT.print(json.dumps(_json(found, bounds, folder), ensure_ascii=False, indent=1), markup=False)
        return code
    _tell(found, bounds)
    for name in written:
        line("wrote", str(folder / name))
    return code


def _each(values: list[float] | None) -> list[float] | float | None:
    return values[0] if values is not None and len(values) == 1 else values


def _code(found: PermissibleSpeed) -> Exit:
    if found.after is not None:
        return exit_code(found.after.verdict)
    return Exit.UNDECIDED if found.map.undecided else Exit.EXCEEDED


def _bounds(station: Station, found: PermissibleSpeed, tolerance: float) -> list[Bound]:
    """Distances that the criteria ask about, and the robot's speed, over the motion that is judged."""
    from seerob.permissible.bounds import MOST, motions_of, wanted_bounds

    motions = motions_of(station.sources, found)
    return wanted_bounds(station.model, motions, tolerance=tolerance, most=MOST)


def _write(station: Station, found: PermissibleSpeed, folder: Path, period: float) -> list[str]:
    """The tables, each whole or not at all; nothing before all of them could be made."""
    from seerob.permissible import tables
    from seerob.permissible.urscript import PERIODS, refusal, urscript
    from seerob.permissible.workbook import workbook
    from seerob.sinks.dossier import write_whole

    scene = station.scene()
    files = {
        "map.csv": tables.csv_bytes(tables.MAP_HEAD, tables.map_rows(found.map)),
        "map_by_region.csv": tables.csv_bytes(tables.REGION_HEAD, tables.region_rows(found.map)),
        "permissible.xlsx": workbook(found, scene, period=period),
    }
    robot = station.model.robot(found.map.robot)
    if found.rescaled is not None:
        trajectory = found.rescaled.trajectory(period)
        head = tables.trajectory_head(trajectory, found.map.limits.units)
        files["rescaled.csv"] = tables.csv_bytes(head, tables.trajectory_rows(trajectory))
        if not refusal(robot) and period in PERIODS:
            program = urscript(
                found.rescaled,
                robot,
                period=period,
                title=scene.title,
                version=scene.version,
                digest=scene.workstation_hash,
            )
            files["rescaled.script"] = program.encode()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        what = f"cannot be made: {error.strerror}"
        raise InputError.at(folder, "", what, "give a folder that may be written") from error
    for name, data in files.items():
        write_whole(folder / name, data)
    return [name for name in FILES if (folder / name).exists()]


def _tell(found: PermissibleSpeed, bounds: list[Bound]) -> None:
    from seerob.permissible.summary import sentences

    for text in sentences(found):
        line("permissible", text)
    for spent in found.spent[:6]:
        line("time", f"{spent.time:7.3f} s  {spent.what}")
    tell(found.findings)
    for bound in bounds:
        line("bound", bound.sentence())
    if found.after is None:
        word, style = WORDS[Verdict.UNDECIDED if found.map.undecided else Verdict.EXCEEDED]
        line(word, found.refused, style)
        return
    tell_results(found.after)


def _json(found: PermissibleSpeed, bounds: list[Bound], folder: Path) -> dict[str, Any]:
    motion, after = found.rescaled, found.after
    return {
        "robot": found.map.robot,
        "asked": list(found.map.asked),
        "before": found.motion.duration,
        "after": None if motion is None else motion.duration,
        "refused": found.refused,
        "verdict": None if after is None else after.verdict,
        "criteria": {} if after is None else {name: series.verdict for name, series in after.results.items()},
        "time": {spent.what: spent.time for spent in found.spent},
        "bounds": [bound.figures() for bound in bounds],
        "findings": [{"level": f.level, "subject": f.subject, "text": f.text} for f in found.findings],
        "folder": str(folder),
    }


@contextmanager
def _progress(*, quiet: bool) -> Iterator[Any]:
    """A bar on a terminal that says which part of the work is done; silence elsewhere."""
    if quiet or not STATUS.is_terminal:
        yield lambda what, share: None
        return
    from rich.progress import BarColumn, Progress, TextColumn

    with Progress(BarColumn(), TextColumn("{task.description}"), console=STATUS, transient=True) as bars:
        task = bars.add_task("", total=1.0)
        yield lambda what, share: bars.update(task, description=what, completed=share)
