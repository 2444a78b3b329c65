r"""The geometric path of a motion: joint positions over a path coordinate, without time.

Between two places where the robot stands or turns back it is a smooth piece: the natural cubic spline
(:math:`C^2`) over the joint-space length s of the given motion, through as few of its points as keep all
the others within a tolerance. At its ends the robot stands.

How far the piece is from the motion that was given is the largest distance in any joint between points
with the same coordinate: an upper bound of the distance between the two curves. Between two neighbouring
points it is exact, the largest value of a cubic.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.session.permissible.given_motion import GivenMotion, largest_hermite, largest_on

STEP = 0.02
"""Largest way in any joint between two points that the spline is compared at [rad or m]."""
SAME = 1e-9
"""Points that are nearer are the same [rad or m]."""
PAUSE = 0.05
"""A stand of at least this long is kept [s]."""
CORNER = np.cos(np.radians(45))
"""A change of direction in joint space that is larger is a corner: the robot stops in it."""
MOST_POINTS = 500_000
ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Piece:
    """A smooth stretch of the path between two stands."""

    spline: Any
    """`scipy.interpolate.CubicSpline` over s."""
    s: Array
    """Coordinate of the given motion's points, from 0 to `length`, shape (m,) [rad or m]."""
    t: Array
    """When the given motion was there [s], shape (m,)."""
    speed: Array
    """ds/dt of the given motion there, shape (m,)."""
    deviation: Array
    """Largest distance from the given motion per joint [rad or m], shape (d,)."""

    @property
    def length(self) -> float:
        """In joint space [rad or m]."""
        return float(self.s[-1])

    def at(self, s: Array) -> tuple[Array, Array, Array, Array]:
        """Joint positions and their first three derivatives by s, shape (k, d) each."""
        first, second, third = (np.asarray(self.spline(s, order)) for order in (1, 2, 3))
        return np.asarray(self.spline(s)), first, second, third

    def when(self, s: Array) -> Array:
        """When the given motion was at each coordinate [s]."""
        return np.asarray(np.interp(s, self.s, self.t))


@dataclass(frozen=True, eq=False)
class Path:
    """Pieces with stands between them."""

    target: str
    pieces: tuple[Piece, ...]
    stands: Array
    """How long the given motion stands before, between and after the pieces [s], shape (pieces + 1,)."""
    tolerance: float
    """[rad or m]"""
    first: Array
    """Where it begins, shape (d,) [rad or m]."""

    @property
    def deviation(self) -> Array:
        """Largest distance from the given motion per joint [rad or m], shape (d,)."""
        return np.asarray(np.max([piece.deviation for piece in self.pieces], axis=0))


def path_of(motion: GivenMotion, *, tolerance: float) -> Path:
    """The path of a motion.

    Args:
        motion: The motion.
        tolerance: Of the path, in any joint [rad or m]; more than 0.

    Raises:
        InputError: It never moves, or is too long.
    """
    if not 0 < tolerance < np.inf:
        raise InputError.at("path", "tolerance", f"{tolerance} rad or m", "give more than 0")
    t, q, qd = _dense(motion)
    pieces, stands, at = [], [], float(t[0])
    for a, b in _stretches(t, q, tolerance):
        stands.append(float(t[a]) - at)
        part = slice(a, b + 1)
        pieces.append(_piece(t[part], q[part], qd[part], tolerance))
        at = float(t[b])
    if not pieces:
        what = f"never moves by more than {tolerance:g} rad or m"
        raise InputError.at("path", motion.target, what, "give a motion to scale")
    stands.append(float(t[-1]) - at)
    return Path(motion.target, tuple(pieces), np.array(stands), tolerance, q[0].copy())


def _dense(motion: GivenMotion) -> tuple[Array, Array, Array]:
    """Instants, positions, velocities: all samples, and between them so many that no step exceeds `STEP`."""
    powers = motion.powers()
    ways = largest_on(powers[1], 2 * powers[2], 3 * powers[3], 0.0, 1.0).max(axis=1)
    parts = np.maximum(np.ceil(ways / STEP), 1).astype(int)
    if parts.sum() > MOST_POINTS:
        what = f"{int(parts.sum())} points"
        raise InputError.at("path", motion.target, what, f"give a shorter motion: at most {MOST_POINTS}")
    width = np.diff(motion.t)
    times = [t0 + w * np.arange(n) / n for t0, w, n in zip(motion.t, width, parts, strict=False)]
    t = np.concatenate([*times, motion.t[-1:]])
    return t, *motion.at(t)


def _stretches(t: Array, q: Array, tolerance: float) -> Iterator[tuple[int, int]]:
    """First and last index of every smooth stretch in which it moves."""
    still = _stands(t, q, tolerance)
    a = 0
    for begin, end in [*still, (len(t) - 1, len(t) - 1)]:
        if begin > a:
            yield from _smooth(q, a, begin)
        a = end


def _stands(t: Array, q: Array, tolerance: float) -> list[tuple[int, int]]:
    """Stretches of at least `PAUSE` in which no joint leaves a tenth of the tolerance."""
    found, a, n = [], 0, len(t)
    near = tolerance / 10
    while a < n - 1:
        b = a
        low = high = q[a]
        while b + 1 < n:
            low_b, high_b = np.minimum(low, q[b + 1]), np.maximum(high, q[b + 1])
            if (high_b - low_b).max() > near:
                break
            low, high, b = low_b, high_b, b + 1
        if t[b] - t[a] >= PAUSE:
            found.append((a, b))
        a = max(b, a + 1)
    return found


def _smooth(q: Array, a: int, b: int) -> Iterator[tuple[int, int]]:
    """A stretch, cut where the direction changes at once."""
    # Chords shorter than this are noise, and noise has every direction.
    keep = [a]
    for i in range(a + 1, b + 1):
        if np.abs(q[i] - q[keep[-1]]).max() > STEP / 10:
            keep.append(i)
    if keep[-1] != b:
        if len(keep) > 1:
            keep[-1] = b
        else:
            keep.append(b)
    chords = np.diff(q[keep], axis=0)
    lengths = np.linalg.norm(chords, axis=1)
    if not (lengths > SAME).all():
        return
    cosines = (chords[1:] * chords[:-1]).sum(axis=1) / (lengths[1:] * lengths[:-1])
    ends = [a, *(keep[i + 1] for i in np.flatnonzero(cosines < CORNER)), b]
    yield from pairwise(ends)


def _piece(t: Array, q: Array, qd: Array, tolerance: float) -> Piece:
    from scipy.interpolate import CubicSpline

    steps = np.linalg.norm(np.diff(q, axis=0), axis=1)
    keep = np.concatenate([[True], steps > SAME])
    keep[-1] = True
    t, q, qd = t[keep], q[keep], qd[keep]
    s = np.concatenate([[0.0], np.cumsum(np.maximum(np.linalg.norm(np.diff(q, axis=0), axis=1), SAME))])
    chosen: NDArray[np.bool_] = np.zeros(len(s), bool)
    chosen[[0, -1]] = True
    for _ in range(ROUNDS):
        knots = np.flatnonzero(chosen)
        spline = CubicSpline(s[knots], q[knots], bc_type="natural")
        # Between two points both are cubics in the share of the way; so is their difference.
        off, slope = spline(s) - q, np.asarray(spline(s, 1))
        T, S = np.diff(t)[:, None], np.diff(s)[:, None]
        between = largest_hermite(off[:-1], off[1:], slope[:-1] * S - qd[:-1] * T, slope[1:] * S - qd[1:] * T)
        worst = between.max(axis=1)
        if worst.max() <= tolerance:
            break
        for a, b in pairwise(knots.tolist()):
            if worst[a:b].max() > tolerance and b - a > 1:
                chosen[(a + b) // 2] = True
    speed = np.gradient(s, t)
    return Piece(spline, s, t, np.asarray(speed), between.max(axis=0))
