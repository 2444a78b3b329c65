"""Programmed waypoints made into a continuous motion: a first look, before a controller has run it.

Logs of motions are programs of waypoints, too: RoboDK's joint lists and KUKA's DataRecorder. A log is
reduced to waypoints between which lines are near enough to it: between places where the robot stood, rows are
taken by the algorithm of [Douglas1973]_, with the largest difference of any joint as the distance.
"""

from __future__ import annotations

import math
import re
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta, field

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.motion_origin import MotionOrigin
from seerob.core.plugin import load
from seerob.core.quantities import Pose, Radians, unit
from seerob.core.same_names import by_name
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, rotation_from_rpy, rotation_from_wxyz, transform
from seerob.description.description import Description
from seerob.devices.motion_files import TrajectoryFile, notes
from seerob.files.trajectories.trajectory import Trajectory
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.continuous import Continuous, Wish, continuous
from seerob.files.waypoints.inverse import parse
from seerob.files.waypoints.reading import Point, read_program
from seerob.files.waypoints.timing import JointLimits
from seerob.files.waypoints.waypoint import MAX_WAYPOINTS, Program, Waypoint
from seerob.workstation.source import Target, WaypointTarget

HEAD = 16 << 10
"""Of a file in which its header is looked for [bytes]."""


def log_kind(path: Path) -> str | None:
    """The kind of source that plays a file, told by its header; None for what is no log."""
    if path.suffix.lower() not in (".log", ".csv", ".tsv", ".txt") or not path.is_file():
        return None
    with path.open("rb") as file:
        head = file.read(HEAD).decode("latin-1")
    if "ZeitInSec" in head:
        return "kuka_log"
    lines = (set(re.split(r"[^A-Z0-9_]+", line.upper())) for line in head.splitlines()[:20])
    return "robodk" if any({"J1", "ERROR"} <= words for words in lines) else None


def logged_program(kind: str, path: Path, file: str, robot: str, tolerance: float | None) -> Program:
    """The waypoints that a log is reduced to.

    Args:
        kind: What `log_kind` says.
        path: The file.
        file: Its name, for messages.
        robot: The robot that it is to drive.
        tolerance: See `reduced`.

    Raises:
        InputError: The log is wrong, or nobody gave a tolerance.
    """
    if tolerance is None:
        what = "is a log of a motion: how far waypoints may leave it, nobody said"
        remedy = f'give tolerance [rad or m], or play it as it is with kind = "{kind}"'
        raise InputError.at(file, "tolerance", what, remedy)
    log = load("sources", kind, TrajectoryFile)
    motion, findings = log(robot=robot, file=file).read(path, Target(name=robot))
    program = reduced(motion, tolerance)
    return Program(file, program.waypoints, (*(f.text for f in findings), *program.remarks))


Above = Annotated[float, Meta(gt=0, le=1e6)]
IN_TABLE = "points"


class Waypoints(TrajectoryFile, frozen=True, kw_only=True):
    """A robot's motion through waypoints, timed here: URScript, .urp, tables, TOML, YAML, logs, by hand."""

    file: str = ""
    """Path, from the folder of the workstation file; its ending says what it is. Without it ``points``."""
    tolerance: Annotated[Annotated[float, Meta(gt=0, le=1)] | None, unit("rad")] = None
    """How far in any joint the moves between waypoints of a log (RoboDK, KUKA) may be from what was logged
    [rad or m]; needed with a log."""
    points: tuple[Point, ...] = ()
    """Waypoints by hand instead of a file; their keys are below."""
    values: dict[str, float | bool | str] = field(default_factory=dict)
    """What a program needs and does not give, by its name there: ``pick = "p[0.4, 0, 0.3, 0, 3.14, 0]"``; a
    text is in the program's language, with its units."""
    origin: MotionOrigin = MotionOrigin.PLANNED
    """What the motion is a motion of: the timing is made here, so it is preliminary."""
    joint_speed: Annotated[Above | None, unit("rad/s")] = None
    """Speed of the leading joint [rad/s or m/s], where a joint move does not say one."""
    joint_acceleration: Annotated[Above | None, unit("rad/s²")] = None
    """Acceleration of the leading joint [rad/s² or m/s²], where a joint move does not say one."""
    joint_jerk: Annotated[Above | None, unit("rad/s³")] = None
    """Jerk of joint moves [rad/s³ or m/s³]; no program says it, and none is assumed."""
    tool_speed: Annotated[Above | None, unit("m/s")] = None
    """Speed of the tool point [m/s], where a linear or circular move does not say one."""
    tool_acceleration: Annotated[Above | None, unit("m/s²")] = None
    """Acceleration of the tool point [m/s²], where a linear or circular move does not say one."""
    tool_jerk: Annotated[Above | None, unit("m/s³")] = None
    """Jerk of the tool point in linear and circular moves [m/s³]."""
    tool_turn: Annotated[Above | None, unit("rad/s")] = None
    """Largest turning speed of the tool on linear and circular moves [rad/s]; when not given only the
    joints' speed limits hold, and what it reaches is said."""
    start: Radians | None = None
    """Joint positions before the first waypoint [rad or m]; when not given, that waypoint, if it has any."""
    branch: str | None = None
    """Signs of shoulder, elbow and wrist, such as ``"+-+"``, for poses that joint moves go to; the branch
    nearest to where the robot is when not given."""
    at: str | None = None
    """Link that carries the tool point (``tool0``); the description's tip when not given."""
    tcp: Pose | None = None
    """Tool point in that link's frame; what the program says (``set_tcp``), else the link's origin."""
    base: str | None = None
    """Link that poses are given in; a controller's own file means the link ``base`` where there is one."""
    period: Annotated[float, unit("s", ge=0.001, le=0.1)] = 0.008
    """Period of the samples [s]."""

    def __post_init__(self) -> None:
        if bool(self.file) == bool(self.points):
            raise ValueError("give either file or points")
        if self.branch is not None:
            parse(self.branch)

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """Read the waypoints, solve the poses, time the way."""
        program = self.program(path)
        arm, said = self.arm(program, target)
        found = self.motion(program, arm, _limits(target, arm))
        where = program.file
        text = (
            f"the motion between the {len(program.waypoints)} waypoints of {where} is timed by seerob with "
            f"limited jerk, {found.trajectory.duration:.3f} s in all: a controller's own timing, blends and "
            "branches may differ"
        )
        return found.trajectory, (
            *notes((text, *said), target.name, level="assumed"),
            *notes(tuple(f"{where}: {r}" for r in (*program.remarks, *found.remarks)), target.name),
            *notes(tuple(f"{where}: {d}" for d in found.deviations), target.name, level="warning"),
            *(
                Finding(level="warning", subject=target.name, text=f"{where}: {said}", holds=(target.name,))
                for said in (*program.left_out, *found.unsure)
            ),
        )

    def motion(self, program: Program, arm: Arm, limits: JointLimits) -> Continuous:
        """The continuous motion.

        Args:
            program: Of `program`.
            arm: Of `arm`.
            limits: What its joints may do.

        Raises:
            InputError: What nobody gave, or a waypoint that cannot be reached.
        """
        wish = by_name(Wish, self, branch=None if self.branch is None else parse(self.branch))
        return continuous(program, arm, wish, limits=limits)

    def program(self, path: Path) -> Program:
        """The waypoints of the file, or those by hand.

        Raises:
            InputError: The file is wrong.
        """
        if self.file and (kind := log_kind(path)) is not None:
            return logged_program(kind, path, self.file, self.robot, self.tolerance)
        if self.file:
            found = read_program(path, self.file, self.values)
            if self.tcp is not None and any(w.tool is not None for w in found.waypoints):
                what = "the program goes with several tool points, tcp is one"
                raise InputError.at(self.file, "tcp", what, "leave it out")
            return found
        return Program(IN_TABLE, tuple(p.waypoint(f"points[{i}]") for i, p in enumerate(self.points)))

    def arm(self, program: Program, target: Target) -> tuple[Arm, tuple[str, ...]]:
        """The robot up to its tool point, and what is assumed of both.

        Raises:
            InputError: No description, or a link that is not there.
        """
        where = self.file or IN_TABLE
        if target.description is None:
            raise InputError.at(where, "robot", f"nobody describes {target.name}", "name a robot")
        links = [link.name for link in target.description.links]
        problems = [
            Problem(where, key, f"no link {name!r} of {target.name}", suggestion(name, links))
            for key, name in (("at", self.at), ("base", self.base))
            if name is not None and name not in links
        ]
        if problems:
            raise InputError(problems)
        base = self.base
        if base is None and program.controller and "base" in links:
            base = "base"
        poses = any(w.pose is not None for w in program.waypoints)
        tip = self.at or target.description.tip
        tcp, whose = self._tcp(program)
        said = (
            ()
            if not poses
            else (
                f"poses are of the point {whose} of {tip}, in the frame of {base or links[0]}: a controller "
                "may have another tool point or base",
            )
        )
        return Arm(target.description, link=tip, link_from_tcp=tcp, base=base), said

    def waypoint_target(self, description: Description) -> WaypointTarget | None:
        """What ``points`` are of; None where a file has the waypoints."""
        if self.file:
            return None
        tool, _ = self._tcp(Program(IN_TABLE, ()))
        base = self.base or description.links[0].name
        return WaypointTarget(self.at or description.tip, tool, base, len(self.points))

    def _tcp(self, program: Program) -> tuple[Array, str]:
        if self.tcp is not None:
            turn = np.eye(3)
            if self.tcp.wxyz is not None:
                turn = rotation_from_wxyz(self.tcp.wxyz)
            elif self.tcp.rpy is not None:
                turn = rotation_from_rpy(self.tcp.rpy)
            return transform(turn, self.tcp.position), "that tcp says"
        if program.tcp is not None:
            return transform(
                rotation_from_wxyz(program.tcp.wxyz), program.tcp.position
            ), "that the program says"
        if any(w.tool is not None for w in program.waypoints):
            return np.eye(4), "that the program says for each move"
        return np.eye(4), "at the origin"


def _limits(target: Target, arm: Arm) -> JointLimits:
    return JointLimits.of(arm.n, speed=target.velocity, acceleration=target.acceleration, jerk=target.jerk)


STANDS = 2e-3
"""A joint that is slower stands [rad/s or m/s]."""
SHORTEST_STAND = 0.1
"""Standing for less is a passage or a turning point [s]."""


def reduced(motion: Trajectory, tolerance: float) -> Program:
    """Waypoints whose joint moves are nowhere farther from a motion than a tolerance.

    Where the robot stood it stops and stands as long; through the others it passes, rounding them off.

    Args:
        motion: The log.
        tolerance: Largest difference of any joint [rad or m].

    Raises:
        InputError: It never moves, or too many waypoints would be needed.
    """
    # Half for leaving rows out, half for standing at the begin of a stand until its end.
    half = tolerance / 2
    stands = _stands(motion, half)
    ends = sorted({0, len(motion.t) - 1, *(k for pair in stands for k in pair)})
    kept = set(ends)
    for a, b in pairwise(ends):
        if (a, b) not in stands:
            kept |= _kept(motion.q[a : b + 1], half, a)
        if len(kept) > MAX_WAYPOINTS:
            what = f"needs more than {MAX_WAYPOINTS} waypoints for a tolerance of {tolerance:g} rad or m"
            raise InputError.at(motion.file, "tolerance", what, "give a larger one")
    pause = {a: float(motion.t[b] - motion.t[a]) for a, b in stands}
    # Of a stand its begin is the waypoint.
    rows = [k for k in sorted(kept) if k not in {b for _, b in stands} or k in pause]
    if len(rows) < 2:
        raise InputError.at(motion.file, "", "nothing moves", "give a log of a motion")
    waypoints = tuple(
        Waypoint(
            place=f"row {k + 1 if motion.rows is None else int(motion.rows[k])}",
            q=tuple(motion.q[k].tolist()),
            blend=0.0 if k in pause or k == rows[-1] else math.inf,
            pause=pause.get(k, 0.0),
        )
        for k in rows
    )
    said = (
        f"{len(waypoints)} waypoints of {len(motion.t)} rows: joint moves between them are within "
        f"{tolerance:g} rad or m of the log in every joint, but for roundings; speeds are not the log's",
        f"stops where all joints were slower than {STANDS:g} rad/s or m/s for {SHORTEST_STAND:g} s: "
        f"{len(pause)}",
    )
    return Program(motion.file, waypoints, said)


def _stands(motion: Trajectory, tolerance: float) -> set[tuple[int, int]]:
    """First and last row of every stand, on which nothing moved by more than a tolerance."""
    t, q = motion.t, motion.q
    rows = np.arange(len(t))
    # Over a while, not from row to row, where noise looks like speed.
    later = np.searchsorted(t, t + SHORTEST_STAND)
    rows = rows[later < len(t)]
    later = later[rows]
    slow = np.abs(q[later] - q[rows]).max(axis=1) < STANDS * (t[later] - t[rows])
    change = np.zeros(len(t) + 1, int)
    np.add.at(change, rows[slow], 1)
    np.add.at(change, later[slow], -1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.cumsum(change) > 0])))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return {(a, b) for a, b in pairs if np.abs(q[a : b + 1] - q[a]).max() <= tolerance}


def _kept(q: Array, tolerance: float, first: int) -> set[int]:
    """Rows between the ends that have to be kept, counted from ``first``."""
    kept: set[int] = set()
    spans = [(0, len(q) - 1)]
    while spans and len(kept) <= MAX_WAYPOINTS:
        a, b = spans.pop()
        if b - a < 2:
            continue
        along = q[b] - q[a]
        inside = q[a + 1 : b] - q[a]
        share = np.clip(inside @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
        off = np.abs(inside - share[:, None] * along).max(axis=1)
        k = int(np.argmax(off))
        if off[k] > tolerance:
            middle = a + 1 + k
            kept.add(first + middle)
            spans += [(a, middle), (middle, b)]
    return kept
