r"""Pieces of a path: tables of joint positions over the way, with exact tangents, between which cubics run.

A joint move is a straight line in joint space. A linear or circular one is solved at close points from the
one before, so that it stays on its branch, with tangents :math:`dq/ds = J^+ \, (dp/ds, \omega)`. Where a
path is rounded off it is the quintic in joint space that has position, tangent and curvature of both sides:
accelerations of the joints do not jump there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from seerob.errors import InputError
from seerob.transforms import Array, rotation_from_axis_angle
from seerob.waypoints.arm import Arm
from seerob.waypoints.branches import factors, is_classic
from seerob.waypoints.inverse import follow, rotation_vectors

STEP, TURN = 0.005, 0.02
"""Largest distance [m] and angle [rad] between two solved points."""
FEWEST, MOST = 8, 20_000
REACHED = 1e-7
"""Error of a solved point [m, rad]."""
SINGULAR = 0.02
"""A least singular value of the Jacobian (m and rad alike) below it is a passage by a singularity."""
ROUNDING_POINTS = 65
LEAVING = 1.6
"""Slope of a rounding at its ends, per length cut off: of 1 to 2.5 the one that is passed fastest."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece of the path."""

    s: Array
    """Way from its begin, shape (k,): of the tool point [m], or in joint space [rad or m]."""
    q: Array
    """Joint positions, shape (k, n) [rad or m]."""
    dq: Array
    """Tangents dq/ds, shape (k, n)."""
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
        """Of the way."""
        return float(self.s[-1] - self.s[0])

    def at(self, s: Array) -> tuple[Array, Array]:
        """Joint positions and tangents at places of the way, counted from its begin, shape (m, n) each."""
        s = np.clip(np.asarray(s, float) + self.s[0], self.s[0], self.s[-1])
        k = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        h = (self.s[k + 1] - self.s[k])[:, None]
        x = (s - self.s[k])[:, None] / h
        a, b, c, d = self.q[k], self.q[k + 1], h * self.dq[k], h * self.dq[k + 1]
        c2, c3 = 3 * (b - a) - 2 * c - d, c + d - 2 * (b - a)
        return a + x * (c + x * (c2 + x * c3)), (c + x * (2 * c2 + 3 * x * c3)) / h

    def part(self, start: float, end: float) -> Piece:
        """The piece from one place of the way to another."""
        inside = (self.s - self.s[0] > start + 1e-12) & (self.s - self.s[0] < end - 1e-12)
        ends, tangents = self.at(np.array([start, end]))
        return replace(
            self,
            s=np.concatenate([[start], (self.s - self.s[0])[inside], [end]]),
            q=np.vstack([ends[:1], self.q[inside], ends[1:]]),
            dq=np.vstack([tangents[:1], self.dq[inside], tangents[1:]]),
        )


def joint_line(a: Array, b: Array) -> Piece | None:
    """A joint move; None where nothing moves."""
    length = float(np.linalg.norm(b - a))
    if length < 1e-9:
        return None
    tangent = (b - a) / length
    q = np.vstack([a, b])
    return Piece(np.array([0.0, length]), q, np.vstack([tangent] * 2), False, float(np.abs(tangent).max()))


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
            what = (
                f"the tool cannot follow the way there beyond {100 * u[k - 1]:.0f} % of it (out of reach, or "
                "through a singularity)"
            )
            raise InputError.at(file, place, what, "move by joints there, or choose another branch")
    posture = arm.posture(q)
    J = posture.jacobian()
    sigma = np.linalg.svd(J, compute_uv=False)[:, -1]
    _one_branch(arm, factors(posture) if is_classic(arm) else None, u, file, place)
    twist = np.concatenate([way.slopes(u), np.broadcast_to(angle * axis, (count, 3))], axis=1)
    dq = (np.linalg.pinv(J, rcond=1e-9) @ twist[..., None])[..., 0] / length
    worst = int(np.argmin(sigma))
    return Piece(
        u * length,
        q,
        dq,
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

    def slopes(self, u: Array) -> Array:
        return np.broadcast_to(self._d, (len(u), 3))


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

    def slopes(self, u: Array) -> Array:
        w = (u * self.angle)[:, None]
        return np.asarray(self.angle * (-np.sin(w) * self._x + np.cos(w) * self._y))


def rounding(before: Piece, after: Piece, cut_before: float, cut_after: float) -> Piece:
    """The quintic that leaves a piece and enters the next one.

    Args:
        before: The piece that ends in the waypoint.
        after: The one that begins there.
        cut_before: Place of ``before`` where it is left.
        cut_after: Place of ``after`` where it is entered.
    """
    A, tA, kA, lA = _end(before, cut_before, before.length - cut_before)
    B, tB, kB, lB = _end(after, cut_after, cut_after)
    vA, vB, wA, wB = LEAVING * lA * tA, LEAVING * lB * tB, (LEAVING * lA) ** 2 * kA, (LEAVING * lB) ** 2 * kB
    c = np.array([A, A + vA / 5, A + 2 * vA / 5 + wA / 20, B - 2 * vB / 5 + wB / 20, B - vB / 5, B])
    u = np.linspace(0.0, 1.0, 16 * (ROUNDING_POINTS - 1) + 1)
    q, slope = _bezier(c, u), 5 * _bezier(np.diff(c, axis=0), u)
    speed = np.linalg.norm(slope, axis=1)
    s = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(u))])
    keep = slice(None, None, 16)
    return Piece(s[keep], q[keep], (slope / speed[:, None])[keep], False)


def _bezier(c: Array, u: Array) -> Array:
    degree = len(c) - 1
    powers = [math.comb(degree, i) * u**i * (1 - u) ** (degree - i) for i in range(degree + 1)]
    return np.stack(powers, axis=1) @ c


def _end(piece: Piece, s: float, remaining: float) -> tuple[Array, Array, Array, float]:
    """Position, unit tangent, curvature (per length in joint space) and what is cut off, in joint space."""
    h = max(1e-4 * piece.length, 1e-9)
    places = np.clip(np.array([s - h, s, s + h]), 0.0, piece.length)
    q, dq = piece.at(places)
    size = np.linalg.norm(dq, axis=1)
    unit = dq / size[:, None]
    bend = (unit[2] - unit[0]) / ((places[2] - places[0]) * size[1])
    return q[1], unit[1], bend, remaining * float(size[1])
