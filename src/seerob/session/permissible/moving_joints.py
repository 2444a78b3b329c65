r"""How fast a body may get, and how quickly that changes, while joints move within known speeds.

Every point of a body stays within :math:`R_j` of a point of each joint's axis, whatever the joints do: the
sum of the distances from anchor to anchor and on to its farthest corner. With a weight :math:`w_j = R_j` of
a joint that turns and 1 of one that slides, its speed and its change are at most

.. math::
    |\dot p| \le \sum_j |\dot q_j| w_j, \qquad
    |\ddot p| \le \sum_j |\ddot q_j| w_j
    + \sum_j |\dot q_j| \big(2 \Omega_{<j} w_j + \sum_{i \ge j} |\dot q_i| w_i\big)

where :math:`\Omega_{<j}` is the sum of the speeds of the turning joints before j.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.model.model import Model
from seerob.model.volumes.moving import Joints, chain_of
from seerob.session.permissible.path import GivenMotion, largest_on


@dataclass(frozen=True, eq=False)
class KinematicChain:
    """The joints that move one body, from base to tip; k of them."""

    dofs: NDArray[np.int64]
    """In ``MjData.qvel``, shape (k,)."""
    turns: NDArray[np.bool_]
    weight: Array
    """w [m, or 1 for a joint that slides], shape (k,)."""

    def agility(self, qd: Array, qdd: Array) -> Array:
        r"""Bound on the acceleration of any of its points [m/s²], shape (n,).

        Args:
            qd: Bounds on the absolute speeds of all joints, shape (n, nv).
            qdd: Likewise of their accelerations.
        """
        v, a, w = qd[:, self.dofs], qdd[:, self.dofs], self.weight
        spin = np.where(self.turns, v, 0.0)
        before = np.cumsum(spin, axis=1) - spin
        onward = np.cumsum((v * w)[:, ::-1], axis=1)[:, ::-1]
        # A joint that slides turns with those before it, and nothing more.
        turned = np.where(self.turns, 2 * before * w + onward, 2 * before)
        return np.asarray((a * w + v * turned).sum(axis=1))


def chains_of(model: Model, bodies: Sequence[int], slid: Array) -> list[KinematicChain]:
    """The chains of bodies.

    Args:
        model: The compiled workstation.
        bodies: Indices in `Model.bodies`.
        slid: How far each joint ever is from where it stands in the model as compiled, shape (nv,); only
            that of joints that slide counts [m].
    """
    joints, data = Joints.of(model.mj), mujoco.MjData(model.mj)
    mujoco.mj_kinematics(model.mj, data)
    found = []
    for index in bodies:
        body, chain = model.bodies[index], list(chain_of(model, index))
        dofs = joints.v_address[chain]
        turns = ~joints.slides[chain]
        corners = body.corners @ data.xmat[body.mj].reshape(3, 3).T + data.xpos[body.mj]
        weight = np.ones(len(chain))
        length = body.radius + body.deviation
        if chain and len(corners):
            length += float(np.linalg.norm(corners - data.xanchor[chain[-1]], axis=1).max())
        for k in range(len(chain) - 1, -1, -1):
            if k < len(chain) - 1:
                length += float(np.linalg.norm(data.xanchor[chain[k + 1]] - data.xanchor[chain[k]]))
            if turns[k]:
                weight[k] = length
            else:
                length += float(slid[dofs[k]])
        found.append(KinematicChain(dofs, turns, weight))
    return found


class MovingJoints:
    """All joints of a workstation, of which some follow given motions and the others stand."""

    def __init__(self, model: Model, motions: Mapping[str, GivenMotion]) -> None:
        """From motions by the name of the robot or human."""
        self.model, self.motions = model, motions
        self._powers = {name: motion.powers() for name, motion in motions.items()}
        self._home = np.array(model.mj.qpos0, float)
        for name, m in model.mechanisms.items():
            if name not in motions:
                self._home[m.q_address] = m.coupling @ m.home + m.offset

    def breaks(self, start: float, end: float) -> Array:
        """Instants of all samples from ``start`` to ``end``, both included [s]."""
        times = [m.t[(m.t > start) & (m.t < end)] for m in self.motions.values()]
        return np.unique(np.concatenate([[start, end], *times]))

    def at(self, t: float) -> tuple[Array, Array]:
        """``qpos`` and ``qvel`` of the whole workstation at an instant [s]."""
        qpos, qvel = self._home.copy(), np.zeros(self.model.mj.nv)
        for name, motion in self.motions.items():
            m = self.model.mechanisms[name]
            q, qd = motion.at(np.array([t]))
            qpos[m.q_address] = m.coupling @ q[0] + m.offset
            qvel[m.v_address] = m.coupling @ qd[0]
        return qpos, qvel

    def slid(self) -> Array:
        """How far each joint ever is from where it stands in the model as compiled, shape (nv,)."""
        found = np.zeros(self.model.mj.nv)
        for name in self.motions:
            m, p = self.model.mechanisms[name], self._powers[name]
            # Whatever happens between two samples, it is no farther than the parts of the cubic add up to.
            far = np.abs(p).sum(axis=0).max(axis=0)
            home = np.abs(m.offset) + np.abs(self.model.mj.qpos0[m.q_address])
            found[m.v_address] = np.abs(m.coupling) @ far + home
        still = [m for name, m in self.model.mechanisms.items() if name not in self.motions]
        for m in still:
            found[m.v_address] = np.abs(self._home[m.q_address] - self.model.mj.qpos0[m.q_address])
        return found

    def largest(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Bounds on absolute speeds and accelerations of all joints on spans of time, shape (n, nv) each.

        Args:
            low: Beginnings [s], shape (n,); no sample lies inside a span.
            high: Ends [s].
        """
        qd = np.zeros((len(low), self.model.mj.nv))
        qdd = np.zeros_like(qd)
        for name, motion in self.motions.items():
            m = self.model.mechanisms[name]
            k = motion.interval((low + high) / 2)
            T = np.diff(motion.t)[k][:, None]
            a, b = ((end - motion.t[k])[:, None] / T for end in (low, high))
            _, p1, p2, p3 = self._powers[name][:, k]
            v = largest_on(p1, 2 * p2, 3 * p3, a, b) / T
            w = np.maximum(np.abs(2 * p2 + 6 * p3 * a), np.abs(2 * p2 + 6 * p3 * b)) / T**2
            moving = ((high > motion.t[0]) & (low < motion.t[-1]))[:, None]
            share = np.abs(m.coupling).T
            qd[:, m.v_address], qdd[:, m.v_address] = (
                np.where(moving, v, 0) @ share,
                np.where(moving, w, 0) @ share,
            )
        return qd, qdd
