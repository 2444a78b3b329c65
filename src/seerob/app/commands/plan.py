"""``seerob plan``: a path of a robot that keeps a distance from everything, as a file of waypoints.

Those who move beside the planned robot are still, are where they are at an instant, are all that they
sweep, or move as their sources say: then the plan is a motion, as a table.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.commands.permissible import per_joint
from seerob.app.console.loading import compiled
from seerob.app.console.progress import compile_loops, spinner
from seerob.app.console.terminal import Exit, add_workstation, allowed, cache_folder, describe, line, seconds
from seerob.core.errors import InputError
from seerob.core.figures import rounded_down, rounded_up

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from seerob.core.transforms import Array
    from seerob.session.planning.plan import Plan
    from seerob.session.station import Station


STILL, SWEPT, MOVING = "still", "swept", "moving"
OTHERS = (
    "where robots, people and machines that sources move are taken to be: still (where the file puts them), "
    "swept (everywhere that their recorded motion takes them), moving (where that motion has them at each "
    "instant, which plans a motion) or an instant of that motion [s] "
    "(default: still, and the answer is undecided where somebody moves)"
)


@dataclass(frozen=True, eq=False)
class Around:
    """What a path is planned in."""

    station: Station
    keep_out: tuple[str, ...]
    places: dict[str, Array] = field(default_factory=dict)
    """Joint positions of others by name [rad or m], (n,) each."""
    swept: tuple[str, ...] = ()
    """Others that an area stands for."""
    off: float = 0.0
    """How far others may be from there [m]."""


def others(text: str) -> str | float:
    """``still``, ``swept``, ``moving``, or an instant [s]."""
    if text in (STILL, SWEPT, MOVING):
        return text
    try:
        return instant(text)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not still, swept, moving or a number of seconds"
        ) from None


def around(
    station: Station,
    robot: str,
    how: str | float,
    keep_out: Sequence[str],
    *,
    voxel: float,
    stopped: Callable[[], bool],
    say: Callable[[str], None],
) -> Around:
    """The others of a workstation.

    Args:
        station: As compiled.
        robot: Whose path is planned.
        how: As `others` gives it.
        keep_out: Areas to keep away from.
        voxel: Of what is swept [m].
        stopped: Whether to stop.
        say: Told what is done.

    Raises:
        InputError: Live sources, an instant after the end, or a motion that is not known throughout.
        Stopped: ``stopped`` said so.
    """
    from seerob.session.planning.others import PoseRecorder, alone, made_for, movers, with_sweeps
    from seerob.session.planning.plan import Stopped
    from seerob.session.station import Station

    def tell(text: str) -> None:
        if stopped():
            raise Stopped("stopped before anything was planned")
        say(text)

    who = movers(station.workstation, robot)
    if how == STILL or not who:
        return Around(station, tuple(keep_out))
    instant = None if how == SWEPT else float(how)
    carrier = next((r.on for r in station.workstation.robots if r.name == robot and r.on is not None), "")
    if instant is None and carrier.partition("/")[0] in who:
        what = f"{robot} stands on {carrier}, which moves: where it plans from would move too"
        raise InputError.at("plan", "--others", what, "give an instant [s]")
    bare = Station(alone(station.workstation, robot, who, keep_out), cache=cache_folder(), progress=tell)
    witness = PoseRecorder(instant)
    tell("following the others")
    bare.run(writers=[witness], stop=lambda: stopped() or witness.done)
    tell("following the others")
    witness.require()
    if instant is not None:
        places = {name: witness.places[name] for name in who}
        return Around(station, tuple(keep_out), places, off=witness.off)
    whole = Station(with_sweeps(bare.workstation, who, voxel), cache=cache_folder(), progress=tell)
    return Around(whole, (*keep_out, *made_for(who)), swept=who)


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


def instant(text: str) -> float:
    """A time of 0 s or more."""
    return 0.0 if text.strip() in ("0", "0.0") else seconds(text)


def distance(text: str) -> float:
    """A length of 0 or more [m]."""
    (value, *more) = posture(text)
    if more or value < 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no length of 0 m or more")
    return value


def edge(text: str) -> float:
    """Edge of a voxel [m]."""
    value = distance(text)
    if not 0.005 <= value <= 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no edge of 0.005 m to 1 m")
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
    sub.add_argument(
        "--keep-out", action="append", default=[], metavar="AREA", help="area to keep away from, repeatable"
    )
    sub.add_argument("--others", type=others, metavar="HOW", help=OTHERS)
    sub.add_argument(
        "--voxel", type=edge, default=0.05, help="of what others sweep [m] (default: 0.05; at most 1)"
    )
    sub.add_argument(
        "--begin",
        type=instant,
        default=0.0,
        help="of moving others: when it may begin to move [s] (default: 0)",
    )
    sub.add_argument(
        "--within",
        type=seconds,
        default=30.0,
        help="of moving others: when it arrives at the latest [s] (default: 30)",
    )
    for name, unit in (("velocity", "rad/s"), ("acceleration", "rad/s²"), ("jerk", "rad/s³")):
        own = "instead of the robot's" if name == "velocity" else f"instead of the file's {name}_limits"
        text = f"of moving others: limit of the joints [{unit}], one for all or one each with commas, {own}"
        sub.add_argument(f"--{name}", type=per_joint, help=text)
    sub.add_argument("--seed", type=int, default=1, help="the same seed gives the same path (default: 1)")
    sub.add_argument("--seconds", type=seconds, default=60.0, help="longest time per posture (default: 60)")
    sub.add_argument(
        "-o",
        "--output",
        type=Path,
        help="file to write (default: planned.toml, waypoints; beside moving others planned.csv, a motion)",
    )


def run(options: argparse.Namespace) -> int:
    """Plan, write the waypoints, say what is proven.

    Raises:
        InputError: A posture that cannot be, or a file that exists already.
    """
    from seerob.kernels._beforehand import PLANNING, PLANNING_IN_TIME

    timed = options.others == MOVING
    if options.output is None:
        options.output = Path("planned.csv" if timed else "planned.toml")
    _refuse_existing(options.output)
    if not options.output.parent.is_dir():
        raise InputError.at(options.output, "", "its folder does not exist", "make it, or give another place")
    if timed and options.output.suffix != ".csv":
        raise InputError.at(options.output, "", "is no .csv", "a motion beside moving others is a table")
    station = compiled(options.workstation, allowed(options), sources=False)
    compile_loops([*PLANNING, *(PLANNING_IN_TIME if timed else ())])
    from seerob.app.console.interruption import Stopped as Asked
    from seerob.outputs.sinks.dossier import write_whole
    from seerob.session.planning.others import movers
    from seerob.session.planning.plan import NoPath, Stopped, plan

    names = [robot.name for robot in station.workstation.robots]
    if options.robot is None and len(names) != 1:
        what = f"there are {len(names)} robots"
        raise InputError.at(options.workstation, "--robot", what, f"name one of {', '.join(names) or 'none'}")
    robot = options.robot or names[0]
    asked = Asked()
    describe(station)
    goals: list[ArrayLike] = [*options.to, *([math.radians(x) for x in goal] for goal in options.to_deg)]
    given = None
    if options.waypoints is not None:
        given = _Given(station, robot, options.waypoints)
        goals += given.goals(options.start)
    if timed:
        return _in_time(options, station, robot, goals, asked)
    try:
        with spinner() as show:
            place = around(
                station,
                robot,
                STILL if options.others is None else options.others,
                options.keep_out,
                voxel=options.voxel,
                stopped=asked,
                say=show,
            )

            def say(tried: int) -> bool:
                show(f"planning: {tried} postures tried")
                return asked()

            found = plan(
                place.station.model,
                robot,
                goals,
                start=options.start,
                margin=options.margin,
                seed=options.seed,
                seconds=options.seconds,
                keep_out=place.keep_out,
                places=place.places,
                swept=place.swept,
                off=place.off,
                say=say,
            )
    except (NoPath, Stopped) as error:
        line("no path", str(error), "yellow")
        return Exit.UNDECIDED
    _refuse_existing(options.output)
    write_whole(options.output, found.toml().encode())
    text = (
        f"{len(found.q)} postures; between them nothing comes nearer than "
        f"{rounded_down(found.least, 'm')} to {found.robot} "
        f"(margin {found.margin:g} m, {found.asked} postures looked at)"
    )
    line("planned", text)
    if given is not None:
        given.tell(found, first=1 + len(options.to) + len(options.to_deg))
    if found.nearest:
        line("nearest", found.nearest)
    for pair in found.left_out:
        line("assumed", f"{pair} touch at the start and are not watched", "yellow")
    for text in found.around:
        line("others", text)
    open_ = [*found.open]
    if options.others is None and (moving := movers(station.workstation, robot)):
        who = ", ".join(moving)
        open_.append(
            f"{who}: moved by sources, and taken to stand still; say with --others how that is meant"
        )
    for text in open_:
        line("undecided", text, "yellow")
    line("note", "preliminary: planned, and executed by nobody")
    line("wrote", str(options.output))
    line(
        "next",
        f'kind = "waypoints", robot = "{found.robot}", file = "{options.output.name}" with joint_speed …',
    )
    return Exit.UNDECIDED if open_ else Exit.WITHIN


def _in_time(
    options: argparse.Namespace,
    station: Station,
    robot: str,
    goals: list[ArrayLike],
    stopped: Callable[[], bool],
) -> int:
    """Plan beside others who move, and write the motion as a table."""
    from seerob.files.trajectories.trajectory import Trajectory
    from seerob.outputs.sinks.dossier import write_whole
    from seerob.session.permissible import tables
    from seerob.session.permissible.joint_limits import limits_of
    from seerob.session.planning.in_time import plan_in_time
    from seerob.session.planning.others import alone, course, movers
    from seerob.session.planning.plan import NoPath, Stopped
    from seerob.session.station import Station

    who = movers(station.workstation, robot)
    if not who:
        what = "no source moves anybody else"
        raise InputError.at("plan", "--others", what, "plan without it: a path is enough")
    wanted = {name: getattr(options, name) for name in ("velocity", "acceleration", "jerk")}
    given = {name: v[0] if v and len(v) == 1 else v for name, v in wanted.items()}
    limits = limits_of(station.model, station.model.robot(robot), **given)
    try:
        with spinner() as show:
            show("following the others")
            around = alone(station.workstation, robot, who, options.keep_out)
            bare = Station(around, cache=cache_folder(), progress=show)

            def say(tried: int) -> bool:
                show(f"planning: {tried} instants looked at")
                return stopped()

            found = plan_in_time(
                bare.model,
                robot,
                goals,
                course=course(bare, who, stopped),
                begin=options.begin,
                who=who,
                limits=limits,
                start=options.start,
                margin=options.margin,
                seed=options.seed,
                seconds=options.seconds,
                within=options.within,
                keep_out=options.keep_out,
                say=say,
            )
    except (NoPath, Stopped) as error:
        line("no path", str(error), "yellow")
        return Exit.UNDECIDED
    _refuse_existing(options.output)
    rows = found.rows
    motion = Trajectory(str(options.output), rows.t, rows.q, rows.qd)
    head = tables.trajectory_head(motion, limits.units)
    write_whole(options.output, tables.csv_bytes(head, tables.trajectory_rows(motion)))
    end = float(rows.t[-1])
    line(
        "planned",
        f"a motion that arrives at {end:.2f} s and that nothing comes nearer to than {found.margin:g} m at "
        f"any instant, {found.waits:.2f} s of it waiting ({found.asked} instants looked at)",
    )
    if found.nearest is not None:
        near = rounded_down(found.nearest.distance, "m")
        line("nearest", f"{found.nearest.what}, {near} at {found.at:.2f} s, of the instants looked at")
    line("stays", f"where it arrives it keeps that until {found.stays:.2f} s; {found.until}")
    if found.off > 0:
        line("others", f"may be {rounded_up(found.off, 'm')} from where they were seen, which is kept too")
    for pair in found.left_out:
        line("assumed", f"{pair} touch at the start and are not watched", "yellow")
    for name in who:
        line("others", f"{name}: moves as its source says; another time it may move otherwise")
    for text in found.open:
        line("undecided", text, "yellow")
    line("note", "preliminary: planned, and executed by nobody")
    line("wrote", str(options.output))
    line("next", f'kind = "csv", robot = "{robot}", file = "{options.output.name}", origin = "planned"')
    return Exit.UNDECIDED if found.open else Exit.WITHIN


def _refuse_existing(path: Path) -> None:
    if path.exists():
        raise InputError.at(path, "", "exists already", "give another file with -o")


class _Given:
    """Waypoints of a file as goals, and which way of reaching each was taken."""

    def __init__(self, station: Station, robot: str, path: Path) -> None:
        from seerob.devices.sources.waypoints import Waypoints
        from seerob.workstation.source import Target

        self._mechanism = station.model.robot(robot)
        self._path = path
        source = Waypoints(robot=robot, file=str(path))
        self._program = source.program(path)
        if self._program.left_out:
            remedy = "give what it needs, or the goals in a table"
            raise InputError.at(path, "", f"its motion is not known: {self._program.left_out[0]}", remedy)
        target = Target(name=robot, description=self._mechanism.description)
        self._arm, said = source.arm(self._program, target)
        for text in said:
            line("assumed", text, "yellow")
        self._ways: dict[int, int] = {}

    def goals(self, start: list[float] | None) -> list[ArrayLike]:
        """Joint positions; of a pose every way of reaching it that was found, the nearest first."""
        import numpy as np

        from seerob.core.transforms import rotation_from_wxyz
        from seerob.files.waypoints.continuous import carrying
        from seerob.files.waypoints.inverse import solutions, why_not

        near = self._mechanism.home if start is None else np.array(start)
        goals: list[ArrayLike] = []
        for k, waypoint in enumerate(self._program.waypoints):
            if waypoint.move.of_tool:
                what = f"{waypoint.shown} is reached by a {waypoint.move} move"
                raise InputError.at(self._path, waypoint.place, what, "only joint moves are planned")
            if waypoint.pose is None:
                goals.append(waypoint.q or ())
                continue
            pose = rotation_from_wxyz(waypoint.pose.wxyz), np.array(waypoint.pose.position)
            arm = carrying(self._arm, waypoint)
            ways = solutions(arm, *pose, near)
            if not ways:
                what = why_not(arm, *pose, near)
                remedy = "is the base or the tool point another one?"
                raise InputError.at(self._path, waypoint.shown, what, remedy)
            self._ways[k] = len(ways)
            goals.append(np.array([way.q for way in ways]))
        return goals

    def tell(self, plan: Plan, *, first: int) -> None:
        """Say of every pose which way of reaching it the plan took; ``first`` is where goals begin."""
        from seerob.files.waypoints.inverse import branch, is_classic

        classic, n = is_classic(self._arm), self._arm.n
        for k, count in self._ways.items():
            q = plan.q[plan.at[first + k]]
            shown = self._program.waypoints[k].shown
            if classic:
                which = f"branch {branch(self._arm.posture(q))}, the first of {count} that is clear"
            elif n > 6:
                which = f"{n} joints for a pose of 6: of infinitely many ways the one nearest to the start"
            else:
                which = f"the first of {count} ways found that is clear"
            line("reached", f"{shown}: {which}")
