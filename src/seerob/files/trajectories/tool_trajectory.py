r"""A path of the tool read from a file: poses over time in SI units, checked once, then sampled.

Nothing is resampled: every sample is a row of the file. Speeds are chords,
:math:`|\Delta p| / \Delta t` and :math:`\theta / \Delta t` with
:math:`\theta = 2 \arctan(|\operatorname{vec}(\bar a b)| / |a \cdot b|)` between two orientations: by the
mean value theorem the tool was at least that fast somewhere in between.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.samples import PoseSample
from seerob.core.transforms import Array, apply, wxyz_from_rotation
from seerob.files.trajectories.trajectory import Timed

UNIT_TOLERANCE = 1e-3
"""A quaternion whose length is off by more is not rounded, but wrong."""
MAX_SPEED = 10.0
"""A tool that is faster is a wrong unit: the fastest robots of any size reach about this [m/s]."""
MAX_TURN = 20.0
"""A tool that turns faster is a wrong unit [rad/s]: three wrist joints of a quick robot in line reach about
this."""
SMALLEST_JUMP = 0.2
"""A smaller step is noise of closely spaced rows, not a jump [rad]."""
LARGEST_STEP = 0.75 * np.pi
"""Of orientation between two rows; beyond it nothing tells which way round the tool turned [rad]."""


@dataclass(frozen=True, eq=False, repr=False)
class ToolTrajectory(Timed):
    """Poses over time, one row per sample of the file.

    Quaternions come out normalised, each with the sign that makes it continue the one before.

    Raises:
        InputError: Values that are not finite or too large, time that does not strictly increase,
            quaternions that are not of unit length, shapes that do not fit, fewer than two samples;
            every kind of mistake once, with its first place.
    """

    file: str
    """The file, as the user named it; for messages."""
    t: Array
    """Instants on the file's own clock [s], shape (n,), strictly increasing."""
    position: Array
    """[m], shape (n, 3)."""
    wxyz: Array
    """Orientation, unit quaternions, shape (n, 4)."""
    rows: NDArray[np.int64] | None = None
    """Row numbers in the file, from 1, shape (n,); for messages."""
    sheet: str = ""
    """Sheet of a workbook; for messages."""

    def __post_init__(self) -> None:
        super().__post_init__()
        unit = self.wxyz / np.linalg.norm(self.wxyz, axis=1, keepdims=True)
        # q and -q are the same orientation: a change of sign between rows is no motion.
        flips = np.where(np.sum(unit[1:] * unit[:-1], axis=1) < 0, -1.0, 1.0)
        object.__setattr__(self, "wxyz", unit * np.cumprod(np.concatenate([[1.0], flips]))[:, None])

    def __repr__(self) -> str:
        return f"ToolTrajectory({self.file!r}, {len(self.t)} poses, {self.duration:g} s)"

    def seen_from(self, a_from_b: ArrayLike) -> ToolTrajectory:
        """Express the motion in frame ``a``, given a rigid transform (4, 4) from the frame ``b`` it is in."""
        matrix = np.asarray(a_from_b, float)
        w, x, y, z = wxyz_from_rotation(matrix[:3, :3])
        # Hamilton product from the left, as a matrix.
        left = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
        return ToolTrajectory(
            file=self.file,
            t=self.t,
            position=apply(matrix, self.position),
            wxyz=self.wxyz @ left.T,
            rows=self.rows,
            sheet=self.sheet,
        )

    def speeds(self) -> Array:
        """Speed of each interval [m/s], shape (n - 1,)."""
        return np.asarray(np.linalg.norm(np.diff(self.position, axis=0), axis=1) / np.diff(self.t))

    def turns(self) -> Array:
        """Angle between the orientations of neighbouring rows [rad], in 0…π, shape (n - 1,)."""
        a, b = self.wxyz[:-1], self.wxyz[1:]
        along = np.abs(np.sum(a * b, axis=1))
        # A chord does not lose small angles as an arc cosine does.
        across = np.linalg.norm(b - np.sum(a * b, axis=1, keepdims=True) * a, axis=1)
        return np.asarray(2 * np.arctan2(across, along))

    def _shape_problems(self) -> Iterator[Problem]:
        if self.t.ndim != 1:
            yield Problem(self.file, "", f"time of shape {self.t.shape} is not a column")
            return
        yield from self._count_problems()
        yield from self._width_problems({"position": 3, "wxyz": 4})

    def _value_problems(self) -> Iterator[Problem]:
        yield from self._time_problems()
        wrong_numbers = list(self._number_problems(("position", "wxyz")))
        yield from wrong_numbers
        if wrong_numbers:
            return
        off = np.abs(np.linalg.norm(self.wxyz, axis=1) - 1)
        wrong = np.flatnonzero(off > UNIT_TOLERANCE)
        if wrong.size:
            i = int(wrong[0])
            length = float(np.linalg.norm(self.wxyz[i]))
            what = f"quaternion of length {length:.6g}, not 1 ({wrong.size} such rows)"
            yield Problem(self.file, self.place(i), what, "name the columns w, x, y, z of a unit quaternion")


def plausible(trajectory: ToolTrajectory) -> None:
    """InputError where the tool would move or turn as no robot's does, with the first such rows."""
    problems = []
    with np.errstate(over="ignore"):  # instants may be as near as floats can be: infinitely fast
        speeds, turns = trajectory.speeds(), trajectory.turns()
        rates = turns / np.diff(trajectory.t)
    fast = np.flatnonzero(speeds > MAX_SPEED)
    if fast.size:
        i = int(fast[0])
        what = (
            f"the tool moves at {speeds[i]:.4g} m/s, from {_point(trajectory.position[i])} to "
            f"{_point(trajectory.position[i + 1])} m in {trajectory.t[i + 1] - trajectory.t[i]:.4g} s: more "
            f"than {MAX_SPEED:g} m/s ({fast.size} such rows)"
        )
        remedy = "correct tcp_position_unit or time_unit, or the row"
        problems.append(Problem(trajectory.file, trajectory.place(i + 1), what, remedy))
    jumps = np.flatnonzero(((turns > SMALLEST_JUMP) & (rates > MAX_TURN)) | (turns > LARGEST_STEP))
    if jumps.size:
        i = int(jumps[0])
        what = (
            f"the orientation jumps by {np.degrees(turns[i]):.4g} deg in "
            f"{trajectory.t[i + 1] - trajectory.t[i]:.4g} s ({jumps.size} such rows)"
        )
        remedy = "correct tcp_convention or tcp_orientation_unit, or give more rows in between"
        problems.append(Problem(trajectory.file, trajectory.place(i + 1), what, remedy))
    if problems:
        raise InputError(problems)


@dataclass(frozen=True, eq=False)
class PoseSamples:
    """The rows of a path as samples, ``t`` from 0; can be iterated again and again."""

    trajectory: ToolTrajectory
    """In the world."""
    source: str
    target: str
    """Full name of the frame, or the robot's."""

    def __len__(self) -> int:
        return len(self.trajectory.t)

    def __iter__(self) -> Iterator[PoseSample]:
        motion = self.trajectory
        start = float(motion.t[0])
        for i, t in enumerate(motion.t.tolist()):
            x, y, z = motion.position[i].tolist()
            qw, qx, qy, qz = motion.wxyz[i].tolist()
            yield PoseSample(
                source=self.source,
                target=self.target,
                seq=i,
                t=t - start,
                t_device=t,
                position=(x, y, z),
                wxyz=(qw, qx, qy, qz),
            )


def _point(position: Array) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in position.tolist()) + ")"
