r"""Waypoints into one continuous motion: which joint positions they are, pieces between them, their timing.

Joint positions of a waypoint are those given, or those of its pose on a branch that is named.

Moves that do not stop are joined by a rounding: a quintic :math:`q(u)`, :math:`u = \rho t`, of which speeds
grow with the rate :math:`\rho`, accelerations with its square and jerks with its cube. It is passed at the
largest rate at which none of the three is exceeded that either of its moves has, nor what a joint may do;
where a move is too short to get to that speed or to brake from it, it is passed slower. Of slopes that a
rounding may have at its ends the one that is passed in the shortest time is taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.transforms import Array, rotation_from_wxyz, transform
from seerob.files.trajectories.trajectory import MAX_SAMPLES, Trajectory
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.inverse import Branch, Solution, branch, is_classic, solutions, why_not
from seerob.files.waypoints.pieces import SINGULAR, Piece, Rounding, joint_line, rounding, tool_way
from seerob.files.waypoints.timing import JointLimits, Limits, Profile, profile, reachable
from seerob.files.waypoints.waypoint import Configuration, Program, Waypoint
from seerob.workstation.source import Target

SLOPES = (1.2, 1.4, 1.6, 1.8, 2.0, 2.2)
"""Of a rounding at its ends, per way that is cut off; up to 2.5 it stays within the corner's triangle."""
FINE = 64
"""Places at which a rounding is looked at."""
SHARE = 0.99
"""Share of the limits that is used at those places; the rest is for what lies between them."""


@dataclass(eq=False)
class Leg:
    """One piece on the way to its timing."""

    piece: Piece
    limits: Limits
    place: str
    duration: float | None = None
    """Time that it is to take [s]."""
    pause: float = 0.0
    """Time that the robot stands at its end [s]."""
    v0: float = 0.0
    """Speed along it at its begin."""
    v1: float = 0.0
    blend: bool = False
    """Whether it does not stop at its end."""
    rounding: Rounding | None = None
    """What it is, when it is a rounding; its speeds are rates then."""
    arm: Arm | None = None
    """The arm with the tool point of this move."""
    radius: float = 0.0
    """Of the blend at its end [m]."""
    share: float = 0.0
    """Instead of a radius: share of half of the shorter move."""


def rounded(legs: list[Leg], given: Arm, joints: JointLimits, deviations: list[str]) -> list[Leg]:
    """The legs with roundings between those that do not stop.

    Args:
        legs: Moves; cut where they are rounded off.
        given: The robot.
        joints: What they may do.
        deviations: What is done otherwise than asked is added.
    """
    for k, leg in enumerate(legs):
        if leg.blend and (k + 1 == len(legs) or leg.pause > 0):
            leg.blend = False
        elif leg.blend and (leg.duration is not None or legs[k + 1].duration is not None):
            deviations.append(f"{leg.place}: a blend beside a given duration is not modelled: it stops there")
            leg.blend = False
    cuts = [[0.0, leg.piece.length] for leg in legs]
    for k, leg in enumerate(legs[:-1]):
        if not leg.blend:
            continue
        r = leg.radius
        arm = leg.arm or given
        if math.isinf(r) or leg.share:
            half = (leg.share or 1.0) * min(leg.piece.length, legs[k + 1].piece.length) / 2
            cuts[k][1], cuts[k + 1][0] = leg.piece.length - half, half
            continue
        corner = arm.posture(leg.piece.last).position
        first, found_before = _distance_cut(arm, leg.piece, corner, r, from_end=True)
        second, found_after = _distance_cut(arm, legs[k + 1].piece, corner, r, from_end=False)
        if not (found_before and found_after):
            deviations.append(f"{leg.place}: blend of {r:g} m is cut to half of a move that is shorter")
        cuts[k][1], cuts[k + 1][0] = first, second
    found: list[Leg] = []
    for k, leg in enumerate(legs):
        whole = leg.piece
        leg.piece = whole.part(*cuts[k])
        found.append(leg)
        if leg.blend:
            nxt = legs[k + 1]
            each = [rounding(whole, nxt.piece, cuts[k][1], cuts[k + 1][0], slope) for slope in SLOPES]
            rates = [_rate(leg.arm or given, curve, leg, nxt, joints) for curve in each]
            best = int(np.argmax(rates))
            curve, v = each[best], rates[best]
            found.append(Leg(curve.piece, leg.limits, leg.place, v0=v, v1=v, rounding=curve))
    return found


def _distance_cut(arm: Arm, piece: Piece, corner: Array, r: float, *, from_end: bool) -> tuple[float, bool]:
    """Place of a piece that is ``r`` from the corner, at most half way; and whether it was found."""
    share = np.linspace(0.0, 0.5, 201) * piece.length
    s = piece.length - share if from_end else share
    away = np.linalg.norm(arm.posture(piece.derivative(s, 0)).position - corner, axis=1)
    far = np.flatnonzero(away >= r)
    if not far.size:
        return float(s[-1]), False
    k = int(far[0])
    x = (r - away[k - 1]) / (away[k] - away[k - 1]) if k else 0.0
    return float(s[k - 1] + x * (s[k] - s[k - 1]) if k else s[0]), True


def _rate(arm: Arm, curve: Rounding, before: Leg, after: Leg, joints: JointLimits) -> float:
    """Largest rate of a rounding, within the limits of both sides and of the joints."""
    u = np.linspace(0.0, 1.0, FINE + 1)
    moved = [np.abs(curve.piece.derivative(u, order)).max(axis=0) for order in (1, 2, 3)]
    options = [joints.rate(moved)]
    for leg in (before, after):
        limits, tool = leg.limits, leg.piece.tool and not leg.piece.turning
        scale = 1.0 if leg.piece.tool else leg.piece.leading
        sizes = _of_tool(arm, curve.piece) if tool else [float(each.max()) for each in moved]
        for size, limit, order in zip(
            sizes, (limits.speed, limits.acceleration, limits.jerk), (1, 2, 3), strict=True
        ):
            options.append((limit * scale / max(size, 1e-12)) ** (1 / order))
    return SHARE * min(options)


def _of_tool(arm: Arm, piece: Piece) -> list[float]:
    """Largest derivatives of the tool point by the parameter of a rounding, first to third [m]."""
    h = 1.0 / FINE
    u = np.arange(-2, FINE + 3) * h  # a little beyond its ends, where the quintic goes on
    p = arm.posture(piece.curve(u)).position
    differences = ((p[2:] - p[:-2]) / (2 * h), np.diff(p, 2, axis=0) / h**2, np.diff(p, 3, axis=0) / h**3)
    return [float(np.linalg.norm(d, axis=1).max()) for d in differences]


def meet(legs: list[Leg]) -> None:
    """Speeds where legs meet: those of the roundings, less where a leg is too short to get there."""
    curves = {k: leg.rounding for k, leg in enumerate(legs) if leg.rounding is not None}
    rate = {k: legs[k].v0 for k in curves}
    for k, curve in curves.items():
        rate[k] = min(rate[k], legs[k - 1].limits.speed / curve.enter, legs[k + 1].limits.speed / curve.leave)
    for k, curve in curves.items():  # what the leg before allows from its begin
        before = legs[k - 1]
        begin = rate[k - 2] * curves[k - 2].leave if k - 2 in curves else 0.0
        end = reachable(begin, rate[k] * curve.enter, before.piece.length, before.limits)
        rate[k] = min(rate[k], end / curve.enter)
    for k, curve in reversed(curves.items()):  # and the leg after it to its end
        after = legs[k + 1]
        end = rate[k + 2] * curves[k + 2].enter if k + 2 in curves else 0.0
        begin = reachable(end, rate[k] * curve.leave, after.piece.length, after.limits)
        rate[k] = min(rate[k], begin / curve.leave)
    for k, curve in curves.items():
        legs[k].v0 = legs[k].v1 = rate[k]
        legs[k - 1].v1 = rate[k] * curve.enter
        legs[k + 1].v0 = rate[k] * curve.leave


class Goals:
    """Goes through the waypoints in order.

    Args:
        program: Waypoints, poses in the arm's base.
        arm: The robot.
        start: Where it stands before the first one [rad or m].
        branch: Of poses that joint moves go to; nearest to where the robot is when not given.

    Raises:
        InputError: No start, or another number of joints than the robot has.
    """

    def __init__(
        self, program: Program, arm: Arm, *, start: tuple[float, ...] | None, branch: Branch | None
    ) -> None:
        self._program, self._arm, self._wanted = program, arm, branch
        self.remarks: list[str] = []
        self.deviations: list[str] = []
        self.unsure: list[str] = []
        """Waypoints that another branch than the program's may have been taken for."""
        self.found: list[Array] = []
        """Joint positions of each waypoint that was gone to."""
        head = program.waypoints[0]
        if start is None and head.q is None and (head.near is None or head.move.of_tool):
            what = (
                f"the first waypoint ({head.shown}) is a pose: its branch depends on where the robot stands"
            )
            raise InputError.at(program.file, "start", what, "give start, the joint positions [rad or m]")
        given = ((w.shown, q) for w in program.waypoints for q in (w.q, w.near, w.via_q))
        for where, q in (("start", start), *given):
            if q is not None and len(q) != arm.n:
                what = f"{len(q)} joint positions, the robot has {arm.n} joints"
                raise InputError.at(program.file, where, what, f"give {arm.n}")
        self._classic = is_classic(arm)
        stands = start or head.q or head.near
        self._here = np.array(stands, float)
        if start is None:
            if head.q is None:
                self._here = self._solved(head)
                self.remarks.clear()  # it is gone to again, as the first of the waypoints
                self.unsure.clear()
            self.remarks.append(f"the motion begins in its first waypoint, {head.shown}")
        self.first: Array = self._here
        if arm.n > 6 and any(w.pose is not None or w.move.of_tool for w in program.waypoints):
            self.deviations.append(
                f"{arm.n} joints for a pose of 6: the joint positions are not determined; those nearest to "
                "where the robot is are taken, a controller may choose others"
            )

    def steps(self) -> Iterator[tuple[Array, Waypoint, Array]]:
        """Where the robot is, the next waypoint, and its joint positions (of a linear move its start's)."""
        for waypoint in self._program.waypoints:
            if waypoint.q is not None:
                q = np.array(waypoint.q, float)
            elif waypoint.move.of_tool:
                q = self._here
            else:
                q = self._solved(waypoint)
            before, self._here = self._here, q
            yield before, waypoint, q
            self.found.append(self._here)

    def reached(self, q: Array) -> None:
        """Where the way to the waypoint ended."""
        waypoint = self._program.waypoints[len(self.found)]
        if waypoint.move.of_tool and waypoint.q is not None and np.abs(q - self._here).max() > 1e-3:
            self.deviations.append(
                f"{waypoint.shown}: the straight way ends in other joint positions than it has "
                f"(off by {np.abs(q - self._here).max():.3g} rad or m): the tool is there, on another branch"
            )
        if waypoint.move.of_tool and waypoint.pose is not None:
            self._name(waypoint, q)
        self._here = q

    def _solved(self, waypoint: Waypoint) -> Array:
        pose = waypoint.pose
        assert pose is not None
        rotation, position = rotation_from_wxyz(pose.wxyz), np.array(pose.position)
        near = self._here if waypoint.near is None else np.array(waypoint.near, float)
        arm = carrying(self._arm, waypoint)
        ways = solutions(arm, rotation, position, near)
        if not ways:
            what = why_not(arm, rotation, position, near)
            remedy = "is the base or the tool point another one?"
            raise InputError.at(self._program.file, waypoint.shown, what, remedy)
        fitting = [w for w in ways if self._wanted in (None, w.branch)]
        if not fitting:
            there = "; ".join(str(w.branch) for w in ways)
            what = f"the pose is not reached on the branch {self._wanted}"
            raise InputError.at(self._program.file, waypoint.shown, what, f"it is on: {there}")
        if self._wanted is None and waypoint.configuration is not None:
            return self._configured(arm, waypoint, ways, near)
        chosen = fitting[0]
        others = f", one of {len(ways)} found" if self._arm.n == 6 else ""
        nearest = "nearest to " + ("where the robot is" if waypoint.near is None else "qnear")
        if chosen.branch is not None:
            why = nearest if self._wanted is None else "as the source says"
            self.remarks.append(f"{waypoint.shown}: branch {chosen.branch} ({why}{others})")
        elif self._arm.n <= 6:
            self.remarks.append(f"{waypoint.shown}: solution {nearest}{others}")
        return chosen.q

    def _configured(self, arm: Arm, waypoint: Waypoint, ways: Sequence[Solution], near: Array) -> Array:
        """The way of reaching a pose that the program's configuration means."""
        meant = waypoint.configuration
        assert meant is not None
        fitting = [q for way in ways if (q := _within(arm, meant, way, near, self._classic)) is not None]
        told = bool(meant.ranges or (meant.like and self._classic))
        if fitting and told and len(fitting) == 1:
            self.remarks.append(f"{waypoint.shown}: the one of {len(ways)} solutions with {meant.text}")
            return fitting[0]
        if len(ways) > 1 or not fitting:
            many = f"{len(fitting)} of {len(ways)} solutions may be meant by {meant.text}"
            why = many if fitting else f"none of {len(ways)} solutions has {meant.text}"
            self.unsure.append(
                f"{waypoint.shown}: {why}; the one nearest to where the robot is was taken (give branch)"
            )
        return fitting[0] if fitting else ways[0].q

    def _name(self, waypoint: Waypoint, q: Array) -> None:
        if self._classic:
            self.remarks.append(f"{waypoint.shown}: branch {branch(self._arm.posture(q))} (kept on the way)")


def carrying(arm: Arm, waypoint: Waypoint) -> Arm:
    """The arm with the tool point of a waypoint."""
    if waypoint.tool is None:
        return arm
    tool = waypoint.tool
    return arm.carrying(transform(rotation_from_wxyz(tool.wxyz), tool.position))


AT_EDGE = 1e-4
"""A joint that is beyond the edge of a configuration by less is on it [rad]."""


def _within(arm: Arm, meant: Configuration, way: Solution, near: Array, classic: bool) -> Array | None:
    """Joint positions of a way in the ranges of a configuration, whole turns aside, if there are any."""
    if meant.like and classic and len(meant.like) == arm.n:
        sides = branch(arm.posture(np.array(meant.like, float)))
        own = branch(arm.posture(way.q))
        pairs = ((own.shoulder == sides.shoulder), (own.elbow == sides.elbow))
        if any(said is not None and said != same for said, same in zip(meant.sides, pairs, strict=True)):
            return None
    q = np.array(way.q, float)
    for i, span in enumerate(meant.ranges[: arm.n]):
        if span is None or arm.slides[i]:
            continue
        turned = q[i] + 2 * np.pi * np.arange(-2, 3)
        low, high = max(span[0], arm.lower[i]), min(span[1], arm.upper[i])
        there = turned[(turned >= low - AT_EDGE) & (turned <= high + AT_EDGE)]
        if not there.size:
            return None
        q[i] = there[np.argmin(np.abs(there - near[i]))]
    return q


NO_BLEND = 1e-6
FAST_TURN = 1.0
"""A tool that turns faster on a way of its own is pointed out [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What the program does not say itself; None where nobody said it."""

    joint_speed: float | None = None
    """Speed of the leading joint [rad/s or m/s]."""
    joint_acceleration: float | None = None
    joint_jerk: float | None = None
    tool_speed: float | None = None
    """[m/s]"""
    tool_acceleration: float | None = None
    tool_jerk: float | None = None
    tool_turn: float | None = None
    """Largest turning speed of the tool on its own ways [rad/s]; not limited when not given."""
    period: float = 0.008
    """Period of the samples [s]."""
    start: tuple[float, ...] | None = None
    """Where the robot stands before the first waypoint [rad or m]."""
    branch: Branch | None = None
    """Branch of poses that a joint move goes to; the one nearest to where the robot is when not given."""


@dataclass(frozen=True, eq=False)
class Continuous:
    """A motion through waypoints."""

    trajectory: Trajectory
    at: tuple[Array, ...]
    """Joint positions of each waypoint [rad or m]."""
    remarks: tuple[str, ...] = ()
    deviations: tuple[str, ...] = field(default=())
    """What may differ on a controller, or was changed."""
    unsure: tuple[str, ...] = ()
    """Waypoints that may be on another branch in the program: of that robot nothing is within."""


def continuous(program: Program, arm: Arm, wish: Wish, *, limits: JointLimits) -> Continuous:
    """A continuous motion through all waypoints.

    Args:
        program: Waypoints, poses in the arm's base.
        arm: The robot.
        wish: Speeds and the like that the program does not give.
        limits: What the joints may do. Moves that need more are slowed as a whole, and said.

    Raises:
        InputError: With every limit that nobody gave, or the first waypoint that cannot be reached.
    """
    _complete(program, wish)
    goals = Goals(program, arm, start=wish.start, branch=wish.branch)
    legs: list[Leg] = []
    deviations: list[str] = []
    remarks: list[str] = []
    rests = 0.0
    for k, (before, waypoint, q) in enumerate(goals.steps()):
        own = carrying(arm, waypoint)
        piece = _piece(program, own, before, waypoint, q)
        if piece is None:
            if legs:
                legs[-1].pause += waypoint.pause
            else:
                rests += waypoint.pause
            continue
        goals.reached(piece.last)
        most = _limits(program, waypoint, wish, piece, limits, own)
        leg = Leg(piece, most, waypoint.shown, waypoint.duration, waypoint.pause, arm=own)
        tool_turn = wish.tool_turn if waypoint.turn is None else waypoint.turn
        _slowed(leg, limits, tool_turn, own, deviations)
        if piece.least < SINGULAR:
            deviations.append(
                f"{waypoint.shown}: near a singularity at {100 * piece.least_at:.0f} % of the way (least "
                f"singular value {piece.least:.2g}): joints turn fast there, and controllers differ"
            )
        if piece.turning:
            if waypoint.turn is None:
                remarks.append(f"{waypoint.shown}: the tool only turns; its speed is taken as rad/s")
        elif tool_turn is None and (rate := piece.turn * leg.limits.speed) > FAST_TURN:
            deviations.append(
                f"{waypoint.shown}: the tool turns at up to {rate:.2g} rad/s on this way (give tool_turn): "
                "how fast a controller lets it turn is not modelled"
            )
        legs.append(leg)
        leg.radius, leg.share = waypoint.blend, waypoint.blend_share
        leg.blend = max(waypoint.blend, leg.share) > NO_BLEND and k + 1 < len(program.waypoints)
    legs = rounded(legs, arm, limits, deviations)
    meet(legs)
    trajectory = _sampled(legs, program.file, wish.period, goals.first, rests)
    if any(leg.piece.tool for leg in legs):
        remarks.append(_of_joints(trajectory, arm, limits))
    remarks += goals.remarks
    said = (*goals.deviations, *deviations)
    return Continuous(trajectory, tuple(goals.found), tuple(remarks), said, tuple(goals.unsure))


def _complete(program: Program, wish: Wish) -> None:
    """InputError with everything that nobody gave."""
    wanted: dict[str, str] = {}
    for w in program.waypoints:
        kind = "tool" if w.move.of_tool else "joint"
        unit = "m" if w.move.of_tool else "rad"
        wanted.setdefault(f"{kind}_jerk", f"{unit}/s³")
        if w.speed is None and w.share is None and w.along is None and w.turn is None:
            wanted.setdefault(f"{kind}_speed", f"{unit}/s")
        if w.acceleration is None:
            wanted.setdefault(f"{kind}_acceleration", f"{unit}/s²")
    missing = [
        Problem(program.file, key, "nobody gave it", f"give {key} [{unit}] in the source (none is assumed)")
        for key, unit in wanted.items()
        if getattr(wish, key) is None
    ]
    if not program.waypoints:
        missing.append(Problem(program.file, "", "no waypoints", "give at least one"))
    if missing:
        raise InputError(missing)


def _limits(
    program: Program, waypoint: Waypoint, wish: Wish, piece: Piece, limits: JointLimits, arm: Arm
) -> Limits:
    kind = "tool" if waypoint.move.of_tool else "joint"
    given = {"acceleration": waypoint.acceleration, "jerk": None}
    acceleration, jerk = (
        own if own is not None else float(getattr(wish, f"{kind}_{key}")) for key, own in given.items()
    )
    if waypoint.acceleration is None:
        acceleration *= waypoint.acceleration_share
    scale = 1.0 if piece.tool else piece.leading
    speed = _speed(program, waypoint, wish, piece, limits, arm)
    return Limits(speed, acceleration / scale, jerk / scale)


def _speed(
    program: Program, waypoint: Waypoint, wish: Wish, piece: Piece, limits: JointLimits, arm: Arm
) -> float:
    """Along a piece."""
    if piece.tool:
        if piece.turning and waypoint.turn is not None:
            return waypoint.turn
        if waypoint.speed is None and waypoint.turn is not None:
            return waypoint.turn / max(piece.turn, 1e-6)
        return float(waypoint.speed if waypoint.speed is not None else wish.tool_speed or 0.0)
    if waypoint.share is None and waypoint.along is None:
        return (
            float(waypoint.speed if waypoint.speed is not None else wish.joint_speed or 0.0) / piece.leading
        )
    # Of its own largest speeds, the user's where the description has none.
    most = float(np.min(limits.speed / np.maximum(piece.fastest(), 1e-12)))
    if not math.isfinite(most):
        if wish.joint_speed is None:
            what = f"{waypoint.shown}: a share of the joints' largest speeds, which nobody gave"
            raise InputError.at(program.file, "joint_speed", what, "give joint_speed or velocity_limits")
        most = wish.joint_speed / piece.leading
    if waypoint.share is not None:
        return waypoint.share * most
    places = arm.posture(piece.derivative(np.linspace(0.0, piece.length, FINE + 1), 0)).position
    way = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    return min(most, float(waypoint.along or 0.0) * piece.length / max(way, 1e-9))


def _piece(program: Program, arm: Arm, before: Array, waypoint: Waypoint, q: Array) -> Piece | None:
    if not waypoint.move.of_tool:
        return joint_line(before, q)
    if waypoint.pose is not None:
        rotation, position = rotation_from_wxyz(waypoint.pose.wxyz), np.array(waypoint.pose.position)
    else:
        at = arm.posture(q)
        rotation, position = at.rotation, at.position
    via = None if waypoint.via is None else np.array(waypoint.via.position)
    if waypoint.via_q is not None:
        via = arm.posture(np.array(waypoint.via_q, float)).position
    return tool_way(arm, before, rotation, position, via=via, file=program.file, place=waypoint.shown)


def _slowed(leg: Leg, limits: JointLimits, tool_turn: float | None, arm: Arm, deviations: list[str]) -> None:
    """A move in which a joint or the tool would do more than it may is slowed as a whole."""
    possible = float(np.min(limits.speed / np.maximum(leg.piece.fastest(), 1e-12)))
    if tool_turn is not None and leg.piece.turn > 0:
        possible = min(possible, tool_turn / leg.piece.turn)
    unit = "m/s" if leg.piece.tool else "rad/s of the leading joint"
    scale = 1.0 if leg.piece.tool else leg.piece.leading
    if possible < leg.limits.speed:
        deviations.append(
            f"{leg.place}: slowed from {leg.limits.speed * scale:.3g} to {possible * scale:.3g} {unit}, "
            "which the speed limits of the joints or tool_turn allow; a controller may do otherwise"
        )
        leg.limits = Limits(possible, leg.limits.acceleration, leg.limits.jerk)
    k, what, joint = limits.stretch(leg.piece, leg.limits)
    if k > 1:
        was = leg.limits
        leg.limits = Limits(was.speed / k, was.acceleration / k**2, was.jerk / k**3)
        deviations.append(
            f"{leg.place}: slowed by {k:.3g} (to {leg.limits.speed * scale:.3g} {unit} at most), so that "
            f"{arm.joints[joint].name} keeps its limit of {what}; a controller may do otherwise"
        )


def _of_joints(motion: Trajectory, arm: Arm, limits: JointLimits) -> str:
    """What the joints do on linear and circular moves, by differences over the period."""
    period = float(motion.t[1] - motion.t[0])
    said = []
    for order, what in ((2, "acceleration"), (3, "jerk")):
        # The last sample is no whole period after the one before.
        size = np.abs(np.diff(motion.q[:-1], order, axis=0)).max(axis=0, initial=0.0) / period**order
        i = int(np.argmax(size))
        unit = f"{'m' if arm.slides[i] else 'rad'}/s{'²' if order == 2 else '³'}"
        said.append(f"{what} of {size[i]:.3g} {unit} ({arm.joints[i].name})")
    named = {"acceleration": limits.acceleration, "jerk": limits.jerk}
    open_ = [f"{name}_limits" for name, given in named.items() if np.isinf(given).any()]
    rest = f": tool moves do not limit them without {' and '.join(open_)} of the robot" if open_ else ""
    return f"joints reach, over {period:g} s, at most an {' and a '.join(said)}{rest}"


def _timing(leg: Leg, file: str) -> Profile:
    if leg.rounding is None:
        return profile(
            leg.piece.length, leg.v0, leg.v1, leg.limits, duration=leg.duration, file=file, place=leg.place
        )
    v = leg.v0
    return Profile(leg.piece.length / v, lambda t: (v * t, v))


def _sampled(legs: list[Leg], file: str, period: float, first: Array, rests: float) -> Trajectory:
    timed: list[tuple[float, Profile, Leg]] = []
    t = rests
    for leg in legs:
        timing = _timing(leg, file)
        timed.append((t, timing, leg))
        t += timing.duration + leg.pause
    if t / period > MAX_SAMPLES:
        raise InputError.at(file, "", f"{t:.0f} s at {period:g} s: too many samples", "give a longer period")
    if t < 1e-6:
        raise InputError.at(file, "", "nothing moves", "give waypoints that differ from the start")
    # Whole periods, and the end.
    times = np.append(np.arange(np.ceil(t / period - 1e-6)) * period, t)
    q = np.tile(first, (len(times), 1))
    qd = np.zeros_like(q)
    for begin, timing, leg in timed:
        inside = np.flatnonzero((times >= begin) & (times <= begin + timing.duration))
        if inside.size:
            states = np.array([timing.at(x) for x in (times[inside] - begin).tolist()])
            q[inside] = leg.piece.derivative(states[:, 0], 0)
            qd[inside] = leg.piece.derivative(states[:, 0], 1) * states[:, 1:]
        later = times > begin + timing.duration
        q[later], qd[later] = leg.piece.last, 0.0
    return Trajectory(file=file, t=times, q=q, qd=qd)


# -- for those who draw waypoints and do not know the source --------------------------------------


@runtime_checkable
class Programmed(Protocol):
    """A source whose motion goes through waypoints; see `seerob.devices.sources.waypoints`."""

    robot: str
    file: str

    def program(self, path: Path) -> Program:
        """The waypoints."""

    def arm(self, program: Program, target: Target) -> tuple[Arm, tuple[str, ...]]:
        """The robot up to its tool point, and what is assumed of both."""

    def motion(self, program: Program, arm: Arm, limits: JointLimits) -> Continuous:
        """The continuous motion."""
