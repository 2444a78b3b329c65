"""The motion that is given: a cubic from sample to sample, as the twin's reference has it.

A path of the tool is solved into joint positions: inverse kinematics from pose to pose, as the twin solves
it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.samples import LARGEST_SPEED, JointSample, PoseSample, Quality
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.files.trajectories.trajectory import derive_velocities
from seerob.kernels.pull import SLACK
from seerob.model.model import Mechanism, Model
from seerob.twin.control.inverse_kinematics import solve_pose
from seerob.twin.engine import POSE_TOLERANCE


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
