r"""Whether a robot keeps a distance from everything while others move: proven at every instant, not sampled.

Robot and others move along cubics from knot to knot. On a span of time whose middle is m and whose half is h
no joint j gets farther from where it is at m than :math:`h\, v_j`, with v its largest speed there
(`seerob.kernels.spans`), so no distance changes by more than :math:`h \sum_j v_j w_j` over the joints that
move one body and those that move the other. What is not clear by that is halved.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels import ways
from seerob.kernels.pairs import BODY
from seerob.kernels.spans import joint_bounds
from seerob.model.model import Model
from seerob.session.permissible.moving_joints import chains_of
from seerob.session.planning.clearance import RESOLUTION, Clearance, Nearest
from seerob.session.planning.others import Course
from seerob.session.planning.timed_moves import Rows

STEP = 0.02
"""Between two instants that are looked at where nothing is proven yet [s]."""
SPAN = 0.1
"""Spans that are looked at first [s]."""
ROUNDING = 1e-7
"""Added to what distances need [m]: the error of poses and of rows that are read back is far below."""


class ClearanceInTime:
    """A robot among others who move.

    Args:
        model: The compiled workstation.
        clearance: With everybody in it, wherever they stand.
        course: Where the others are.
        latest: Until when it is looked at [s].
    """

    def __init__(self, model: Model, clearance: Clearance, course: Course, latest: float) -> None:
        self._clearance, self._course = clearance, course
        self._mj, self._data = model.mj, mujoco.MjData(model.mj)
        self._ids = np.array([body.mj for body in model.bodies])
        robot = clearance.robot
        own = np.zeros(model.mj.nv, bool)
        own[robot.v_address] = True
        self._dofs = np.flatnonzero(~own & ((np.ptp(course.q, axis=0) > 0) | (course.v != 0).any(axis=0)))
        bounds, home = np.empty((4, model.mj.nv)), np.asarray(model.mj.qpos0, float)
        joint_bounds(course.t, course.q, course.v, course.t[0], course.t[-1], home, bounds)
        away = bounds[3]
        which = model.shapes.arrays().which
        sides = which[clearance.apart.pair, BODY]
        mine = np.isin(sides, robot.moving)
        other = np.where(mine[:, 0], sides[:, 1], sides[:, 0])
        bodies = np.unique(other[~mine.all(axis=1)])
        chains = chains_of(model, bodies.tolist(), away)
        weight = np.zeros((len(model.bodies), len(self._dofs)))
        for body, chain in zip(bodies.tolist(), chains, strict=True):
            each = np.zeros(model.mj.nv)
            each[chain.dofs] = chain.weight
            weight[body] = each[self._dofs]
        weight[robot.moving, :] = 0.0
        self._weight = np.concatenate([clearance.apart.weight, weight[other]], axis=1)
        self._bodies = bodies[weight[bodies].any(axis=1)].astype(np.int64)
        used = np.unique(clearance.apart.pair)
        self._used = used[np.isin(which[used, BODY], self._bodies)]
        self.t: Array = STEP * np.arange(int(latest / STEP + 1e-9) + 1, dtype=float)
        """Instants that are looked at [s]."""
        placed = [self._placed(q) for q in _cubics(course.t, course.q, course.v, self.t)[0]]
        self._R, self._x = (np.array([each[i] for each in placed]) for i in (0, 1))
        self.asked = 0
        """Instants that were looked at."""

    def stand(self, k: int) -> None:
        """Put the others where they are at one of the instants."""
        ways.stand(self._R[k], self._x[k], self._bodies, self._used, self._clearance.table)

    def clear(self, q: Array, first: int, need: Array, *, stop: bool) -> NDArray[np.bool_]:
        """At which instants postures keep what they need; no proof of what is between.

        Args:
            q: Joint positions at instants that follow one another, shape (k, n).
            first: Which of the instants is the first.
            need: Of each pair [m], as of `Clearance.needs`.
            stop: Whether it is enough to know the first that is not.
        """
        found = np.ones(len(q), bool)
        part = slice(first, first + len(q))
        self.asked += ways.clear_at(
            np.ascontiguousarray(q), self._R[part], self._x[part], self._bodies, self._used, need, found,
            stop, self._clearance.table,
        )  # fmt: skip
        return found

    def fault(self, rows: Rows, margin: float) -> float | None:
        """When a motion is not proven to keep a margin [s]; None when it is at every instant.

        Args:
            rows: The robot's, from and to instants at which the others are known.
            margin: To others [m].
        """
        n, course, need = rows.q.shape[1], self._course, self._clearance.needs(margin) + ROUNDING
        begin, end = float(rows.t[0]), float(rows.t[-1])
        if begin < course.t[0] or end > course.end:
            return end
        inside = course.t[(course.t > begin) & (course.t < end)]
        apart = np.abs(inside[:, None] - rows.t).min(axis=1) if len(inside) else inside
        t = np.sort(np.concatenate([rows.t, inside[apart > 1e-9]]))
        other, speed = _cubics(course.t, course.q, course.v, t)
        q, qd = _cubics(rows.t, rows.q, rows.qd, t)
        q = np.ascontiguousarray(np.concatenate([q, other[:, self._dofs]], axis=1))
        v = np.ascontiguousarray(np.concatenate([qd, speed[:, self._dofs]], axis=1))
        bounds, home = np.empty((4, q.shape[1])), np.zeros(q.shape[1])
        every, qpos = np.arange(len(need)), course.q[0].copy()
        cuts = np.linspace(begin, end, max(2, int(np.ceil((end - begin) / SPAN)) + 1))
        spans = [(a, b, every) for a, b in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True)][::-1]
        while spans:
            a, b, pairs = spans.pop()
            middle, half = (a + b) / 2, (b - a) / 2
            k, m = int(np.searchsorted(t, a, "right")) - 1, int(np.searchsorted(t, b)) + 1
            joint_bounds(t[k:m], q[k:m], v[k:m], a, b, home, bounds)
            beyond = self._weight[pairs] @ (half * bounds[0])
            at = _cubics(t[k:m], q[k:m], v[k:m], np.array([middle]))[0][0]
            qpos[self._dofs] = at[n:]
            found = np.empty(len(pairs), np.int8)
            ways.judged(
                at[:n].copy(), *self._placed(qpos), self._bodies, self._used, pairs, need[pairs], beyond,
                found, self._clearance.table,
            )  # fmt: skip
            self.asked += 1
            left = found == ways.OPEN
            if (found == ways.NEAR).any() or (left & (beyond < RESOLUTION)).any():
                return float(middle)
            if left.any():
                spans += [(middle, b, pairs[left]), (a, middle, pairs[left])]
        return None

    def nearest(self, rows: Rows) -> tuple[float, Nearest | None]:
        """Where others are nearest at the instants that are looked at, and when [s]."""
        t = self.t[(self.t >= rows.t[0]) & (self.t <= rows.t[-1])]
        q, _ = _cubics(rows.t, rows.q, rows.qd, t)
        other, _ = _cubics(self._course.t, self._course.q, self._course.v, t)
        met: tuple[float, Nearest | None] = (float(rows.t[0]), None)
        for when, own, qpos in zip(t.tolist(), q, other, strict=True):
            self._clearance.place_others(qpos)
            found = self._clearance.nearest(own)
            if found is not None and (met[1] is None or found.distance < met[1].distance):
                met = when, found
        return met

    def _placed(self, qpos: Array) -> tuple[Array, Array]:
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._mj, self._data)
        return self._data.xmat[self._ids].reshape(-1, 3, 3), self._data.xpos[self._ids]


def _cubics(t: Array, q: Array, v: Array, when: Array) -> tuple[Array, Array]:
    """Positions and velocities on cubics from knot to knot, at instants inside [s], shape (m, n) each."""
    k = np.clip(np.searchsorted(t, when, "right") - 1, 0, len(t) - 2)
    T = (t[k + 1] - t[k])[:, None]
    x = (when - t[k])[:, None] / T
    a, b, c = T * v[k], T * v[k + 1], q[k + 1] - q[k]
    two, three = 3 * c - 2 * a - b, a + b - 2 * c
    return q[k] + x * (a + x * (two + x * three)), (a + x * (2 * two + x * 3 * three)) / T
