"""``seerob permissible``: the permissible-speed map of a motion, a motion that keeps to it, and its cost."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.commands.permissible_result import (
    BY,
    CHOICES,
    add_sections,
    permissible_json,
    tell_permissible,
    work_progress,
)
from seerob.app.console.loading import compiled
from seerob.app.console.sinks import refuse_existing
from seerob.app.console.terminal import (
    OUT,
    add_output,
    add_verbose,
    add_workstation,
    allowed,
    describe,
    exit_code,
    line,
    run_folder,
    seconds,
    tell,
)
from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.files.whole_file import whole_folder
from seerob.core.same_names import by_name

if TYPE_CHECKING:
    from seerob.outputs.sink import Writer
    from seerob.session.permissible.between_samples import Bound
    from seerob.session.permissible.evaluation import PermissibleSpeed
    from seerob.session.permissible.speed_map import PathSegment
    from seerob.session.station import Station

HELP = "how fast a robot may go along its path: map, rescaled motion, cycle time, CSV, Excel, URScript"
EXAMPLE = "seerob permissible my_cell --acceleration 5 --jerk 50"
FILES = (
    "segments.csv",
    "map.csv",
    "map_by_region.csv",
    "rescaled.csv",
    "permissible.xlsx",
    "rescaled.script",
    "report.html",
)


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
    sub.add_argument("--by", choices=CHOICES, default="all", help=BY)
    for name, unit in (("velocity", "rad/s"), ("acceleration", "rad/s²"), ("jerk", "rad/s³")):
        own = "instead of the robot's" if name == "velocity" else f"instead of the file's {name}_limits"
        text = f"limit of the joints [{unit}], one for all or one each with commas, {own}"
        sub.add_argument(f"--{name}", type=per_joint, help=text)
    sub.add_argument("--not-faster", action="store_true", help="nowhere faster than the given motion")
    for name, type_, default, text in (
        ("margin", share, 0.02, "share of the map that is not used"),
        ("tolerance", above_zero, 5e-4, "of the path, per joint [rad or m]"),
        ("spacing", above_zero, 0.02, "of the map, in joint space [rad or m]"),
        ("segment", above_zero, 0.25, "longest way of the tool point in a segment [m]"),
        ("verify", seconds, 1e-3, "period at which the criteria are asked of the plan [s]"),
        ("period", seconds, 8e-3, "of the rescaled motion [s]"),
        ("bound", above_zero, 1e-3, "tolerance of bounds between samples [m, m/s]"),
    ):
        sub.add_argument(f"--{name}", type=type_, default=default, help=f"{text} (default: {default:g})")
    add_output(sub)
    add_verbose(sub)


def run(options: argparse.Namespace) -> int:
    """Map, rescale, evaluate again, write, and return the exit code of the second evaluation."""
    need("toppra", "matplotlib")
    station = compiled(options.workstation, allowed(options), quiet=options.json)
    from seerob.outputs.sinks.dossier import Dossier
    from seerob.session.permissible.ceilings import By
    from seerob.session.permissible.evaluation import Wish
    from seerob.session.permissible.speed_map import segments

    folder = run_folder(station.model.folder, options.output)
    refuse_existing([Dossier()], folder)
    for name in FILES:
        if (folder / name).exists():
            raise InputError.at(folder / name, "", "exists already", "give another folder with -o")
    if not options.json:
        describe(station)
        tell(station.scene().findings, verbose=options.verbose)
    wish = by_name(Wish, options, by=By(options.by))
    bounds: list[Bound] = []
    cut: list[PathSegment] = []
    with whole_folder(folder) as working, work_progress(quiet=options.json) as say:
        writers: list[Writer] = []

        def ready(found: PermissibleSpeed) -> None:
            cut.extend(segments(found.map, length=options.segment))
            say("bounds between samples", 0.0)
            bounds.extend(_bounds(station, found, options.bound))
            say("the report", 0.0)
            if found.rescaled is not None:
                writers.extend(_report(station, found, cut, bounds, working))

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
        if found.rescaled is None:
            # The report is then that of the given motion, with the map that forbids another.
            station.run(writers=_report(station, found, cut, bounds, working), scene=station.scene())
        say("the files", 0.0)
        _write(station, found, cut, working, options.period)
    code = exit_code(found.verdict)
    if options.json:
        report = permissible_json(found, cut, bounds, folder)
        OUT.print(json.dumps(report, ensure_ascii=False, indent=1), markup=False)
        return code
    tell_permissible(found, cut, bounds)
    for name in FILES:
        if (folder / name).exists():
            line("wrote", str(folder / name))
    watch = f'kind = "path_speed", robot = "{found.map.robot}", map = "map.csv"'
    line("next", f"watch a run against the map, copied beside the workstation file: [[safety]] {watch}")
    return code


def _report(
    station: Station,
    found: PermissibleSpeed,
    cut: Sequence[PathSegment],
    bounds: Sequence[Bound],
    folder: Path,
) -> list[Writer]:
    """The report of a run, with what was found before it."""
    from seerob.app.commands.assess import add_section
    from seerob.outputs.sinks.dossier import Dossier

    writers = station.open_sinks([Dossier()], folder, station.scene())
    add_sections(writers, station, found, cut)
    add_section(writers, bounds)
    return writers


def _each(values: list[float] | None) -> list[float] | float | None:
    return values[0] if values is not None and len(values) == 1 else values


def _bounds(station: Station, found: PermissibleSpeed, tolerance: float) -> list[Bound]:
    """Distances that the criteria ask about, and the robot's speed, over the motion that is judged."""
    from seerob.session.permissible.between_samples import MOST, motions_of, wanted_bounds

    motions = motions_of(station.sources, found)
    return wanted_bounds(station.model, motions, tolerance=tolerance, most=MOST)


def _write(
    station: Station, found: PermissibleSpeed, cut: Sequence[PathSegment], folder: Path, period: float
) -> None:
    """The tables."""
    from seerob.outputs.sinks.dossier import write_whole
    from seerob.session.permissible import tables
    from seerob.session.permissible.tables import PERIODS, refusal, urscript, workbook

    scene = station.scene()
    files = {
        "segments.csv": tables.csv_bytes(tables.SEGMENT_HEAD, tables.segment_rows(cut)),
        "map.csv": tables.csv_bytes(tables.map_head(found.map), tables.map_rows(found.map)),
        "map_by_region.csv": tables.csv_bytes(tables.REGION_HEAD, tables.region_rows(found.map)),
        "permissible.xlsx": workbook(found, cut, scene, period=period),
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
    for name, data in files.items():
        write_whole(folder / name, data)
