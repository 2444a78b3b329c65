"""``seerob plan``: a path of a robot that keeps a distance from everything, as a file of waypoints."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.commands import Exit, add_workstation, compiled, describe, line, seconds
from seerob.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from seerob.station import Station

HELP = "plan a robot's path through postures that keeps a distance from everything"
EXAMPLE = "seerob plan my_cell --to-deg 60,-70,80,-100,-90,0 --margin 0.05 -o planned.toml"


def posture(text: str) -> list[float]:
    """Numbers with commas between them."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = [math.nan]
    if not all(map(math.isfinite, values)):
        raise argparse.ArgumentTypeError(f"{text!r} are no numbers with commas between them")
    return values


def distance(text: str) -> float:
    """A length of 0 or more [m]."""
    (value, *more) = posture(text)
    if more or value < 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no length of 0 m or more")
    return value


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)
    sub.add_argument("--robot", help="who moves (default: the only robot)")
    sub.add_argument(
        "--to", type=posture, action="append", default=[], help="posture to go to [rad or m], repeatable"
    )
    sub.add_argument(
        "--to-deg", type=posture, action="append", default=[], help="likewise in degrees, after --to"
    )
    sub.add_argument(
        "--waypoints",
        type=Path,
        help="file of waypoints reached by joint moves to go through, after --to-deg",
    )
    sub.add_argument(
        "--from", dest="start", type=posture, help="posture to begin in (default: q of the file)"
    )
    sub.add_argument(
        "--margin", type=distance, default=0.02, help="least distance to anything [m] (default: 0.02)"
    )
    sub.add_argument("--seed", type=int, default=1, help="the same seed gives the same path (default: 1)")
    sub.add_argument("--seconds", type=seconds, default=60.0, help="longest time per posture (default: 60)")
    sub.add_argument(
        "-o", "--output", type=Path, default=Path("planned.toml"), help="file of waypoints to write"
    )


def run(options: argparse.Namespace) -> int:
    """Plan, write the waypoints, say what is proven.

    Raises:
        InputError: A posture that cannot be, or a file that exists already.
    """
    if options.output.exists():
        raise InputError.at(options.output, "", "exists already", "give another file with -o")
    if not options.output.parent.is_dir():
        raise InputError.at(options.output, "", "its folder does not exist", "make it, or give another place")
    station = compiled(options.workstation, sources=False)
    from seerob.commands.run import Stopped as Asked
    from seerob.planning.plan import plan
    from seerob.planning.search import NoPath, Stopped

    names = [robot.name for robot in station.workstation.robots]
    if options.robot is None and len(names) != 1:
        what = f"there are {len(names)} robots"
        raise InputError.at(options.workstation, "--robot", what, f"name one of {', '.join(names) or 'none'}")
    describe(station)
    goals: list[ArrayLike] = [*options.to, *([math.radians(x) for x in goal] for goal in options.to_deg)]
    if options.waypoints is not None:
        goals += _goals(station, options.robot or names[0], options.waypoints, options.start)
    asked = Asked()
    try:
        found = plan(
            station.model,
            options.robot or names[0],
            goals,
            start=options.start,
            margin=options.margin,
            seed=options.seed,
            seconds=options.seconds,
            say=lambda tried: asked(),
        )
    except (NoPath, Stopped) as error:
        line("no path", str(error), "yellow")
        return Exit.UNDECIDED
    options.output.write_text(found.toml(), encoding="utf-8")
    text = (
        f"{len(found.q)} postures; between them, with nobody else moving, nothing comes nearer than "
        f"{found.least:.3f} m to {found.robot} (margin {found.margin:g} m, {found.asked} postures looked at)"
    )
    line("planned", text)
    if found.nearest:
        line("nearest", found.nearest)
    for pair in found.left_out:
        line("assumed", f"{pair} touch at the start and are not watched", "yellow")
    line("note", "areas, moving people and machines are not looked at; preliminary: nobody executed it")
    line("wrote", str(options.output))
    line(
        "next",
        f'kind = "waypoints", robot = "{found.robot}", file = "{options.output.name}" with joint_speed …',
    )
    return Exit.WITHIN


def _goals(station: Station, robot: str, path: Path, start: list[float] | None) -> list[ArrayLike]:
    """Joint positions of the waypoints of a file; of a pose every way of reaching it, the nearest first."""
    import numpy as np

    from seerob.source import Target
    from seerob.sources.waypoints import Waypoints
    from seerob.transforms import rotation_from_wxyz
    from seerob.waypoints.inverse import solutions

    mechanism = station.model.robot(robot)
    source = Waypoints(robot=robot, file=str(path))
    program = source.program(path)
    arm, said = source.arm(program, Target(name=robot, description=mechanism.description))
    for text in said:
        line("assumed", text, "yellow")
    near = mechanism.home if start is None else np.array(start)
    goals: list[ArrayLike] = []
    for waypoint in program.waypoints:
        if waypoint.move.of_tool:
            what = f"{waypoint.shown} is reached by a {waypoint.move} move"
            raise InputError.at(path, waypoint.place, what, "only joint moves are planned")
        if waypoint.pose is None:
            goals.append(waypoint.q or ())
            continue
        ways = solutions(arm, rotation_from_wxyz(waypoint.pose.wxyz), np.array(waypoint.pose.position), near)
        if not ways:
            what = "no joint positions within the limits bring the tool there"
            raise InputError.at(path, waypoint.shown, what, "is the base or the tool point another one?")
        goals.append(np.array([way.q for way in ways]))
    return goals
