"""What joints do to points at a tick, all at once: velocities, ellipsoids of velocity, effective masses.

As distances are (`seerob.distance.least.Surveyor`): what one criterion asks of a point is often what others
ask, and a call takes longer to reach than the figures of another point take to compute.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.chain import KINEMATICS, Kinematics
from seerob.kernels.moving import MOVING_POINTS, MovingPoints, move_points
from seerob.model.model import Frame, Mechanism
from seerob.twin.attachments import Columns, moving_dofs


class Point(NamedTuple):
    """A point of a frame, and whose joints move it."""

    frame: Frame
    mechanism: Mechanism
    offset: tuple[float, float, float]
    """The point in the frame [m]."""
    weighed: bool = False
    """Whether what somebody feels of it is asked, too."""


class Moved(NamedTuple):
    """What joints do to p points at a tick; valid until the next one, but for the first."""

    velocity: Array
    """Linear before angular [m/s, rad/s], shape (p, 6)."""
    sigma: list[list[float]]
    """Singular values of the linear rows of each Jacobian, largest first, and their axes as a quaternion."""
    inverse: Array
    """Inverse of the effective mass matrix [1/kg], shape (p, 3, 3), as next of points that are weighed."""
    masses: list[list[float]]
    """Principal masses, smallest first [kg], and their axes as a quaternion."""


class PointSurvey:
    """Points of which all is asked together.

    Args:
        mj: The `mujoco.MjModel`.
        data: Where everybody is.
        columns: By robot or person, where its joints are among all; each joint is commanded itself.
    """

    def __init__(self, mj: mujoco.MjModel, data: mujoco.MjData, columns: dict[str, Columns]) -> None:
        self._mj, self._data, self._columns = mj, data, columns
        self._rows: dict[tuple[int, str, tuple[float, float, float]], int] = {}
        self._points: list[Point] = []
        self._asked: dict[int, tuple[tuple[Point, ...], list[int]]] = {}
        """By the identity of points that were asked for, these and their rows."""
        self._bound: MovingPoints | None = None
        self._now: Moved | None = None
        self.weighed = False
        """Whether one of all points is: then MuJoCo's mass matrix must be that of now."""

    def forget(self) -> None:
        """Work everything out again: everybody has moved."""
        self._now = None

    def at(self, points: tuple[Point, ...]) -> tuple[Moved, list[int]]:
        """What joints do to all points now, and which of them those are that are asked for.

        Raises:
            numpy.linalg.LinAlgError: A mass matrix that is not positive definite.
        """
        kept = self._asked.get(id(points))
        if kept is None:
            kept = self._asked[id(points)] = points, [self._row(point) for point in points]
        now = self._now
        if now is None:
            now = self._now = self._moved()
        return now, kept[1]

    def _row(self, point: Point) -> int:
        key = id(point.frame), point.mechanism.name, point.offset
        row = self._rows.get(key)
        if row is None:
            row = self._rows[key] = len(self._points)
            self._points.append(point)
            self._bound = self._now = None
        elif point.weighed and not self._points[row].weighed:
            self._points[row] = point
            self._bound = self._now = None
        return row

    def _moved(self) -> Moved:
        bound = self._bound
        if bound is None:
            bound = self._bound = self._bind()
            self._table = np.concatenate([kinematics_table(self._data), MOVING_POINTS.rows(bound)])
        if move_points(self._table) >= 0:
            raise np.linalg.LinAlgError("M, a mass matrix, is not positive definite")
        return Moved(bound.velocity.copy(), bound.sigma.tolist(), bound.inverse, bound.masses.tolist())

    def _bind(self) -> MovingPoints:
        mj, data, p = self._mj, self._data, len(self._points)
        every = np.arange(mj.nv)
        columns = [self._columns[point.mechanism.name] for point in self._points]
        dofs = [every[each.all_v] for each in columns]
        bodies = [point.frame.mj for point in self._points]
        moves = [moving_dofs(mj, body)[own] for body, own in zip(bodies, dofs, strict=True)]
        entries = [
            each.entries.ravel() if point.weighed else each.entries.ravel()[:0]
            for each, point in zip(columns, self._points, strict=True)
        ]
        return MovingPoints(
            data.M, np.array(bodies, np.int64), mj.body_rootid[bodies].astype(np.int64),
            np.array([place_of(point.frame, np.array(point.offset)) for point in self._points]),
            np.cumsum([0, *map(len, dofs)]), np.concatenate(dofs), np.concatenate(moves),
            np.cumsum([0, *map(len, entries)]), np.concatenate(entries),
            np.zeros((p, 6)), np.zeros((p, 7)), np.zeros((p, 3, 3)), np.zeros((p, 7)),
        )  # fmt: skip


def kinematics_table(data: mujoco.MjData) -> NDArray[np.int64]:
    """Table of `seerob.kernels.chain.KINEMATICS`; good as long as the data are."""
    return KINEMATICS.rows(Kinematics(data.xmat, data.xpos, data.cdof, data.subtree_com, data.qvel))


def commanded(mechanism: Mechanism) -> bool:
    """Whether each of its joints is commanded itself and none follows another, as a survey has it."""
    return np.array_equal(mechanism.coupling, np.eye(len(mechanism.v_address)))


def place_of(frame: Frame, offset: Array | None) -> Array:
    """Where a point of a frame, or its origin, is in the body that the frame is on [m], shape (3,)."""
    local = frame.body_from_frame[:3, 3]
    return np.ascontiguousarray(local if offset is None else local + frame.body_from_frame[:3, :3] @ offset)
