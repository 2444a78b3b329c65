r"""Pieces of a path: joint positions as curves over the way, twice continuously differentiable.

A joint move is a straight line in joint space. A linear or circular one is solved at close points from the
one before, so that it stays on its branch, and a cubic spline runs through them. Where a path is rounded
off it is the quintic in joint space that has position, velocity and acceleration of both sides: at the
joins of pieces no acceleration of a joint jumps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.transforms import Array, rotation_from_axis_angle
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.inverse import factors, follow, is_classic, rotation_vectors, solutions, why_not

STEP, TURN = 0.005, 0.02
"""Largest distance [m] and angle [rad] between two solved points."""
FEWEST, MOST = 8, 20_000
REACHED = 1e-7
"""Error of a solved point [m, rad]."""
SINGULAR = 0.02
"""A least singular value of the Jacobian (m and rad alike) below it is a passage by a singularity."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece of the path."""

    curve: Any
    """Joint positions over the way, a `scipy.interpolate` polynomial: ``curve(s, order)``, shape (…, n)."""
    start: float
    """Place of its begin on the curve: way of the tool point [m], or in joint space [rad or m]."""
    end: float
    tool: bool
    """Whether the way is that of the tool point."""
    leading: float = 1.0
    """Largest of ``|dq/ds|`` of any joint, of a straight joint move."""
    least: float = math.inf
    """Least singular value of the Jacobian on it; infinite where it does not matter."""
    least_at: float = 0.0
    """Where, as a share of the way."""
    turn: float = 0.0
    """Angle that the tool turns per way [rad/m, or 1 where it only turns]."""
    turning: bool = False
    """Whether the tool only turns, and the way is an angle [rad]."""

    @property
    def length(self) -> float:
        """Length of the way."""
        return self.end - self.start

    @property
    def last(self) -> Array:
        """Joint positions at its end, shape (n,)."""
        return self.derivative(self.length, 0)

    def derivative(self, s: ArrayLike, order: int) -> Array:
        """Derivatives of the joint positions by the way, at places counted from its begin, shape (…, n)."""
        place = np.clip(np.asarray(s, float) + self.start, self.start, self.end)
        return np.asarray(self.curve(place, order))

    def places(self, between: int) -> Array:
        """Places from its begin: both ends, every knot of the curve, some between two knots, shape (m,)."""
        inside = self.curve.x[(self.curve.x > self.start) & (self.curve.x < self.end)]
        knots = np.array([self.start, *inside, self.end]) - self.start
        share = np.arange(between) / between
        return np.append((knots[:-1, None] + np.diff(knots)[:, None] * share).ravel(), knots[-1])

    def fastest(self) -> Array:
        """Largest speed of each joint per speed along the way, shape (n,)."""
        inside = self.curve.x[(self.curve.x > self.start) & (self.curve.x < self.end)]
        return np.asarray(np.abs(self.curve(np.array([self.start, *inside, self.end]), 1)).max(axis=0))

    def part(self, start: float, end: float) -> Piece:
        """The piece from one place of the way to another."""
        return replace(self, start=self.start + start, end=self.start + end)


@dataclass(frozen=True, eq=False)
class Rounding:
    """A piece that rounds a corner off, passed at a steady rate of its parameter."""

    piece: Piece
    enter: float
    """Speed along the piece before the rounding, per rate of its parameter."""
    leave: float
    """Speed along the piece after the rounding, per rate of its parameter."""


def joint_line(a: Array, b: Array) -> Piece | None:
    """A joint move; None where nothing moves."""
    length = float(np.linalg.norm(b - a))
    if length < 1e-9:
        return None
    curve = _curve(np.array([0.0, length]), np.vstack([a, b]))
    return Piece(curve, 0.0, length, False, float(np.abs(b - a).max()) / length)


def _curve(s: Array, q: Array) -> object:
    need("scipy")
    from scipy.interpolate import CubicSpline

    return CubicSpline(s, q)


def tool_way(
    arm: Arm,
    start: Array,
    rotation: Array,
    position: Array,
    *,
    via: Array | None,
    file: str,
    place: str,
) -> Piece | None:
    """A linear move, or a circular one through a point.

    Args:
        arm: The arm.
        start: Joint positions at the begin, shape (n,).
        rotation: Base from tool at the end, shape (3, 3).
        position: Of the tool point at the end [m], shape (3,).
        via: A point of the arc [m]; None for a straight line.
        file: For messages.
        place: For messages.

    Returns:
        The piece; None where nothing moves.

    Raises:
        InputError: The tool cannot get there, or the three points are no arc.
    """
    at = arm.posture(start)
    turn = rotation_vectors(rotation @ at.rotation.T)
    angle = float(np.linalg.norm(turn))
    way: _Straight | _Arc = _Straight(at.position, position)
    if via is not None:
        way = _Arc(at.position, via, position, file, place)
    turning = way.length < 1e-6
    length = angle if turning else way.length
    if length < 1e-9:
        return None
    count = max(FEWEST, math.ceil(way.length / STEP), math.ceil(angle / TURN), way.fewest) + 1
    if count > MOST:
        raise InputError.at(
            file, place, f"a way of {way.length:.3g} m", "is the unit right? poses are in metres"
        )
    u = np.linspace(0.0, 1.0, count)
    axis = turn / angle if angle > 1e-12 else np.array([0.0, 0.0, 1.0])
    q = np.empty((count, arm.n))
    q[0] = start
    for k in range(1, count):
        wanted = rotation_from_axis_angle(axis, angle * u[k]) @ at.rotation
        guess = q[k - 1] if k < 2 else 2 * q[k - 1] - q[k - 2]
        q[k], error = follow(arm, wanted, way.point(u[k]), guess)
        if error > REACHED or np.abs(q[k] - q[k - 1]).max() > 0.5:
            why = "only joint positions of another branch reach on"
            # The end says more than the place where it begins to fail.
            for pose in ((rotation, position), (wanted, way.point(u[k]))):
                if not solutions(arm, *pose, q[k - 1]):
                    why = why_not(arm, *pose, q[k - 1])
                    break
            what = f"the tool cannot follow the way there beyond {100 * u[k - 1]:.0f} % of it: {why}"
            raise InputError.at(file, place, what, "move by joints there, or choose another branch")
    posture = arm.posture(q)
    J = posture.jacobian()
    sigma = np.linalg.svd(J, compute_uv=False)[:, -1]
    _one_branch(arm, factors(posture) if is_classic(arm) else None, u, file, place)
    worst = int(np.argmin(sigma))
    return Piece(
        _curve(u * length, q),
        0.0,
        length,
        True,
        least=float(sigma[worst]),
        least_at=float(u[worst]),
        turn=angle / length,
        turning=turning,
    )


def _one_branch(arm: Arm, signs: Array | None, u: Array, file: str, place: str) -> None:
    if signs is None:
        return
    for i, cause in enumerate(("shoulder", "elbow", "wrist")):
        changes = np.flatnonzero(np.diff(np.sign(signs[:, i])))
        # At the begin and the end a factor may be 0 without being passed.
        inner = [k for k in changes if 0 < k < len(u) - 2]
        if inner:
            what = f"passes a {cause} singularity at {100 * u[inner[0]]:.0f} % of the way"
            raise InputError.at(file, place, what, "a controller stops there: move by joints, or around it")


class _Straight:
    fewest = 0

    def __init__(self, a: Array, b: Array) -> None:
        self._a, self._d = a, b - a
        self.length = float(np.linalg.norm(self._d))

    def point(self, u: float) -> Array:
        return np.asarray(self._a + u * self._d)


class _Arc:
    fewest = 32

    def __init__(self, a: Array, via: Array, b: Array, file: str, place: str) -> None:
        p, r = via - a, b - a
        n = np.cross(p, r)
        square = float(n @ n)
        if square < 1e-12 * max(float(p @ p) * float(r @ r), 1e-12) or square < 1e-16:
            raise InputError.at(file, place, "via and the two ends lie on one line", "give points of an arc")
        # Centre of the circle through three points, from its perpendicular bisectors.
        center = (np.cross(n, p) * (r @ r) + np.cross(r, n) * (p @ p)) / (2 * square)
        self._center, self._x = a + center, -center
        self._radius = float(np.linalg.norm(center))
        z = n / math.sqrt(square)
        self._y = np.cross(z, self._x)
        end = b - self._center
        self.angle = math.atan2(float(end @ self._y), float(end @ self._x)) % (2 * math.pi)
        self.length = self._radius * self.angle

    def point(self, u: float) -> Array:
        w = u * self.angle
        return np.asarray(self._center + math.cos(w) * self._x + math.sin(w) * self._y)


def rounding(before: Piece, after: Piece, cut_before: float, cut_after: float, slope: float) -> Rounding:
    """The quintic that leaves a piece and enters the next one, over 0…1.

    Args:
        before: The piece that ends in the waypoint.
        after: The one that begins there.
        cut_before: Place of ``before`` where it is left.
        cut_after: Place of ``after`` where it is entered.
        slope: Of it at its ends, per way that is cut off.
    """
    need("scipy")
    from scipy.interpolate import BPoly

    enter, leave = slope * (before.length - cut_before), slope * cut_after
    ends = [
        [piece.derivative(s, order) * rate**order for order in range(3)]
        for piece, s, rate in ((before, cut_before, enter), (after, cut_after, leave))
    ]
    return Rounding(Piece(BPoly.from_derivatives([0.0, 1.0], ends), 0.0, 1.0, False), enter, leave)
