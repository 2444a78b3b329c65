r"""The motion that is given, and its geometric path: joint positions over a path coordinate, without time.

The motion is a cubic from sample to sample, as the twin's reference has it; a path of the tool is solved into
joint positions: inverse kinematics from pose to pose, as the twin solves it.

Between two places where the robot stands or turns back it is a smooth piece: the natural cubic spline
(:math:`C^2`) over the joint-space length s of the given motion, through as few of its points as keep all
the others within a tolerance. At its ends the robot stands.

How far the piece is from the motion that was given is the largest distance in any joint between points
with the same coordinate: an upper bound of the distance between the two curves. Between two neighbouring
points it is exact, the largest value of a cubic. Every piece begins where the one before it ended; how far
the given motion strays from there while it stands, until the next piece begins, counts as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.samples import LARGEST_SPEED, JointSample, PoseSample, Quality
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.files.trajectories.trajectory import derive_velocities
from seerob.kernels.pull import SLACK
from seerob.model.model import Mechanism, Model
from seerob.twin.control.inverse_kinematics import solve_pose
from seerob.twin.engine import POSE_TOLERANCE

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
    stray: Array
    """Largest distance of the given motion, while it stands, from where it came to stand, per joint
    [rad or m], shape (d,)."""

    @property
    def deviation(self) -> Array:
        """Largest distance from the given motion per joint [rad or m], shape (d,)."""
        return np.asarray(np.max([self.stray, *(piece.deviation for piece in self.pieces)], axis=0))


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
    near = tolerance / 10
    pieces, stands, stray, at, place = [], [], np.zeros(q.shape[1]), 0, q[0]

    def stood(until: int) -> None:
        part = slice(at, until + 1)
        stands.append(float(t[until] - t[at]))
        np.maximum(stray, _stray(t[part], q[part], qd[part], place), out=stray)

    for begin, end in _stretches(t, q, near):
        if np.abs(q[begin : end + 1] - place).max() <= near:
            continue
        for a, b in _smooth(q, begin, end):
            stood(a)
            part = slice(a, b + 1)
            pieces.append(_piece(t[part], q[part], qd[part], place, tolerance))
            at, place = b, q[b]
    if not pieces:
        what = f"never moves by more than {tolerance:g} rad or m"
        raise InputError.at("path", motion.target, what, "give a motion to scale")
    stood(len(t) - 1)
    return Path(motion.target, tuple(pieces), np.array(stands), tolerance, q[0].copy(), stray)


def _stray(t: Array, q: Array, qd: Array, place: Array) -> Array:
    """Largest distance from a place per joint, shape (d,)."""
    T = np.diff(t)[:, None]
    off = largest_hermite(q[:-1] - place, q[1:] - place, qd[:-1] * T, qd[1:] * T)
    return np.asarray(off.max(axis=0, initial=0.0))


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


def _stretches(t: Array, q: Array, near: float) -> Iterator[tuple[int, int]]:
    """First and last index of every stretch between two stands."""
    a = 0
    for begin, end in [*_stands(t, q, near), (len(t) - 1, len(t) - 1)]:
        if begin > a:
            yield a, begin
        a = end


def _stands(t: Array, q: Array, near: float) -> list[tuple[int, int]]:
    """Stretches of at least `PAUSE` in which no joint leaves a width."""
    found, a, n = [], 0, len(t)
    while a < n - 1:
        b = a
        low = high = q[a]
        while b + 1 < n:
            low_b, high_b = np.minimum(low, q[b + 1]), np.maximum(high, q[b + 1])
            if (high_b - low_b).max() > near:
                break
            low, high, b = low_b, high_b, b + 1
        stands = t[b] - t[a] >= PAUSE
        if stands:
            found.append((a, b))
        # Between two stands there is a way: of whoever creeps from one to the next none is lost.
        a = b + 1 if stands else max(b, a + 1)
    return found


def _smooth(q: Array, a: int, b: int) -> Iterator[tuple[int, int]]:
    """A stretch, cut where the direction changes at once."""
    # Chords shorter than this are noise, and noise has every direction.
    keep = [a]
    for i in range(a + 1, b + 1):
        if np.abs(q[i] - q[keep[-1]]).max() > STEP / 10:
            keep.append(i)
    chords = np.diff(q[keep], axis=0)
    lengths = np.linalg.norm(chords, axis=1)
    cosines = (chords[1:] * chords[:-1]).sum(axis=1) / (lengths[1:] * lengths[:-1])
    ends = [a, *(keep[i + 1] for i in np.flatnonzero(cosines < CORNER)), b]
    yield from pairwise(ends)


def _piece(t: Array, q: Array, qd: Array, place: Array, tolerance: float) -> Piece:
    """From where the one before it ended, which is near the first of the positions."""
    need("toppra")  # which brings it
    from scipy.interpolate import CubicSpline

    begun, q = np.abs(q[0] - place), np.concatenate([place[None], q[1:]])
    way, T = np.diff(q, axis=0), np.diff(t)[:, None]
    moves = np.linalg.norm(way, axis=1) > SAME
    moves[-1] = True
    before, after = qd[:-1] * T, qd[1:] * T
    # Between two samples in one place it may go there and back: that adds to what the next ones are off.
    there_and_back = np.where(moves[:, None], 0.0, largest_hermite(np.zeros_like(way), way, before, after))
    before, after = before[moves], after[moves]
    keep = np.concatenate([[0], np.flatnonzero(moves) + 1])
    strays = np.add.reduceat(there_and_back, keep[:-1])
    strays[0] += begun
    t, q = t[keep], q[keep]
    s = np.concatenate([[0.0], np.cumsum(np.maximum(np.linalg.norm(np.diff(q, axis=0), axis=1), SAME))])
    chosen: NDArray[np.bool_] = np.zeros(len(s), bool)
    chosen[[0, -1]] = True
    for _ in range(ROUNDS):
        knots = np.flatnonzero(chosen)
        spline = CubicSpline(s[knots], q[knots], bc_type="natural")
        # Between two points both are cubics in the share of the way; so is their difference.
        off, slope = spline(s) - q, np.asarray(spline(s, 1))
        S = np.diff(s)[:, None]
        between = largest_hermite(off[:-1], off[1:], slope[:-1] * S - before, slope[1:] * S - after)
        between += strays
        worst = between.max(axis=1)
        if worst.max() <= tolerance:
            break
        for a, b in pairwise(knots.tolist()):
            if worst[a:b].max() > tolerance and b - a > 1:
                chosen[(a + b) // 2] = True
    speed = np.gradient(s, t)
    return Piece(spline, s, t, np.asarray(speed), between.max(axis=0))


@dataclass(frozen=True, eq=False)
class GivenMotion:
    r"""Joint positions over time, :math:`C^1`: Hermite cubics between samples.

    .. math:: q(x) = q_0 + a x + (3c - 2a - b) x^2 + (a + b - 2c) x^3,\quad x = (t - t_0)/T

    with :math:`a = T \dot q_0`, :math:`b = T \dot q_1`, :math:`c = q_1 - q_0`.
    """

    target: str
    """The robot or human that it moves."""
    t: Array
    """Instants of the samples [s], shape (n,), strictly increasing."""
    q: Array
    """[rad or m], shape (n, d)."""
    qd: Array
    """[rad/s or m/s], shape (n, d)."""
    good: NDArray[np.bool_]
    """Whether the source vouches for each sample, shape (n,)."""
    derived: bool = False
    """Velocities are not the source's own."""

    def __post_init__(self) -> None:
        shape = self.q.shape
        if (
            len(self.t) < 2
            or shape != self.qd.shape
            or len(self.t) != shape[0]
            or shape != (*self.good.shape, shape[1])
        ):
            raise ValueError(
                f"shapes {self.t.shape}, {shape}, {self.qd.shape}, {self.good.shape} are no motion"
            )

    @classmethod
    def of(cls, samples: Sequence[JointSample]) -> GivenMotion:
        """The motion through the samples of one robot or human.

        Raises:
            InputError: Fewer than two samples, or time that does not increase.
        """
        name = samples[0].target if samples else ""
        t = np.array([s.t for s in samples], float)
        if len(t) < 2 or (np.diff(t) <= 0).any():
            what = f"{len(t)} samples" if len(t) < 2 else "time that does not increase"
            raise InputError.at("motion", name, what, "give two samples or more, in the order of time")
        q = np.array([s.q for s in samples], float)
        derived = any(s.qd is None for s in samples)
        known = np.array([s.quality is not Quality.INVALID for s in samples])
        qd = (
            derive_velocities(t, q, largest=max(LARGEST_SPEED.values()), known=known).qd
            if derived
            else np.array([s.qd for s in samples], float)
        )
        if not (np.isfinite(q).all() and np.isfinite(qd).all() and np.isfinite(t).all()):
            raise InputError.at("motion", name, "a value that is not finite", "correct the source")
        good = np.array([s.quality is Quality.GOOD for s in samples])
        return cls(name, t, q, qd, good, derived)

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return float(self.t[-1] - self.t[0])

    def powers(self) -> Array:
        """Coefficients of each interval's cubic in x, from 0 to 1; shape (4, n - 1, d) [rad or m]."""
        T = np.diff(self.t)[:, None]
        a, b, c = T * self.qd[:-1], T * self.qd[1:], np.diff(self.q, axis=0)
        return np.stack([self.q[:-1], a, 3 * c - 2 * a - b, a + b - 2 * c])

    def interval(self, t: Array | float) -> NDArray[np.int64]:
        """Index of the interval that each instant [s] lies in; the first and last reach beyond the ends."""
        return np.asarray(np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2))

    def at(self, t: Array) -> tuple[Array, Array]:
        """Positions and velocities at instants [s], shape (m,); outside it rests where it begins or ends.

        Returns:
            Shape (m, d) each [rad or m], [rad/s or m/s].
        """
        t = np.asarray(t, float)
        k = self.interval(t)
        T = np.diff(self.t)[k][:, None]
        inside = (t >= self.t[0] - SLACK) & (t <= self.t[-1] + SLACK)
        x = np.clip((t[:, None] - self.t[k][:, None]) / T, 0.0, 1.0)
        p0, p1, p2, p3 = self.powers()[:, k]
        q = p0 + x * (p1 + x * (p2 + x * p3))
        qd = (p1 + x * (2 * p2 + x * 3 * p3)) / T
        return q, np.where(inside[:, None], qd, 0.0)


def largest_on(c0: Array, c1: Array, c2: Array, low: Array | float, high: Array | float) -> Array:
    r"""Largest :math:`|c_0 + c_1 x + c_2 x^2|` for x from ``low`` to ``high``, exact but for rounding.

    Args:
        c0: Shape (...); ``c1`` and ``c2`` likewise.
        c1: See ``c0``.
        c2: See ``c0``.
        low: Ends of the range, broadcast.
        high: See ``low``.
    """

    def value(x: Array | float) -> Array:
        return np.asarray(np.abs(c0 + x * (c1 + x * c2)))

    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.where(c2 != 0, -c1 / (2 * c2), low)
    return np.maximum(np.maximum(value(low), value(high)), value(np.clip(turn, low, high)))


def largest_hermite(d0: Array, d1: Array, e0: Array, e1: Array) -> Array:
    """Largest absolute value of the cubic on 0…1 with values ``d0``, ``d1`` and slopes ``e0``, ``e1``."""
    c2, c3 = 3 * (d1 - d0) - 2 * e0 - e1, e0 + e1 - 2 * (d1 - d0)
    best = np.maximum(np.abs(d0), np.abs(d1))
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(c2 * c2 - 3 * c3 * e0, 0.0))
        # Both roots of the derivative without a difference that cancels.
        k = -(c2 + np.copysign(root, c2))
        turns = (k / (3 * c3), e0 / k)
    for x in turns:
        inside = np.clip(np.nan_to_num(x, nan=0.0, posinf=0.0, neginf=0.0), 0.0, 1.0)
        best = np.maximum(best, np.abs(d0 + inside * (e0 + inside * (c2 + inside * c3))))
    return np.asarray(best)


def solved(model: Model, robot: Mechanism, samples: Sequence[PoseSample]) -> list[JointSample]:
    """Joint positions for poses, each from those before it; the branch is the nearest, as in the engine.

    Args:
        model: The compiled workstation.
        robot: Who is to bring the tool there.
        samples: In the order of time.

    Raises:
        InputError: A pose that is not finite, or out of reach.
    """
    data = mujoco.MjData(model.mj)
    q = robot.home
    out: list[JointSample] = []
    for sample in samples:
        position, wxyz = np.array(sample.position), np.array(sample.wxyz)
        if not (np.isfinite(position).all() and np.isfinite(wxyz).all()):
            what = f"a pose that is not finite at {sample.t:.3f} s"
            raise InputError.at("permissible speed", robot.name, what, "correct the source")
        frame = model.frame(sample.target)
        q, miss = solve_pose(
            model.mj, data, robot, frame, rotation_from_wxyz(wxyz), position, start=q
        )  # fmt: skip
        good = sample.quality is Quality.GOOD
        if miss.larger > POSE_TOLERANCE and good:
            what = f"the pose at {sample.t:.3f} s is out of reach: the nearest that was found is {miss}"
            raise InputError.at("permissible speed", robot.name, what, "move the path or the robot")
        out.append(
            JointSample(
                source=sample.source,
                target=robot.name,
                seq=sample.seq,
                t=sample.t,
                quality=sample.quality,
                q=tuple(q.tolist()),
            )
        )
    return out
