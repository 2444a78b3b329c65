r"""How far speeds of points may be off, of joints whose speeds were derived from noisy positions.

Errors :math:`\delta_j` of joints are independent: each is that of its own encoder. A point at the distance
:math:`w_j` from the axis of a joint that turns, 1 for one that slides, is off by at most

.. math:: \delta = \sqrt{\sum_j w_j^2 \delta_j^2}

and so is the speed of the fastest point of a body, with the largest :math:`w_j` of any of its points. A
joint that others follow (a mimic, a gripper) moves points by the sum of what each of them does.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.model.model import Body, Model
from seerob.twin.spans import joints_of

Indices = NDArray[np.int64]


def levers(data: mujoco.MjData, joints: NDArray[np.signedinteger], body: Body, R: Array, x: Array) -> Array:
    """Largest distance of a body from axes [m], shape (k,).

    Args:
        data: With MuJoCo's kinematics.
        joints: MuJoCo's.
        body: The body.
        R: World from body, shape (3, 3).
        x: Of its origin in the world [m], shape (3,).
    """
    corners = x + body.corners @ R.T
    arms = corners[None] - data.xanchor[joints][:, None]
    along = np.einsum("kci,ki->kc", arms, data.xaxis[joints])
    squares = np.einsum("kci,kci->kc", arms, arms) - along**2
    return np.asarray(np.sqrt(np.maximum(squares, 0.0).max(axis=1)) + body.radius + body.deviation)


class _KinematicChain(NamedTuple):
    """The joints of one robot, machine or person that move a body; k of them."""

    name: str
    joints: Indices
    """MuJoCo's, shape (k,)."""
    turns: NDArray[np.bool_]
    coupling: Array
    """Share of each commanded joint, not negative, shape (k, n)."""


class SpeedNoise:
    """Of the bodies of a workstation.

    Args:
        model: The compiled workstation.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._chains: dict[tuple[int, int], list[_KinematicChain]] = {}

    def of_bodies(
        self,
        data: mujoco.MjData,
        ids: Indices,
        rotations: Array,
        positions: Array,
        bodies: Indices,
        errors: Mapping[str, Array],
    ) -> Array:
        """How far the speed of any point of bodies may be off [m/s], shape (b,).

        Args:
            data: With MuJoCo's kinematics.
            ids: MuJoCo's body that moves each body.
            rotations: World from body, shape (n, 3, 3).
            positions: Origins in the world [m], shape (n, 3).
            bodies: By index, shape (b,).
            errors: Of joints by name of who has them [rad/s or m/s], shape (joints,) each.
        """
        found = np.zeros(len(bodies))
        for k, i in enumerate(bodies.tolist()):
            for chain in self._of(i, int(ids[i])):
                error = errors.get(chain.name)
                if error is None:
                    continue
                arms = levers(data, chain.joints, self._model.bodies[i], rotations[i], positions[i])
                each = np.where(chain.turns, arms, 1.0) @ chain.coupling
                found[k] += float(((each * error) ** 2).sum())
        return np.sqrt(found)

    def _of(self, index: int, moved_by: int) -> list[_KinematicChain]:
        key = index, moved_by
        if key not in self._chains:
            mj = self._model.mj
            joints = set(joints_of(mj, moved_by))
            self._chains[key] = found = []
            for mechanism in self._model.mechanisms.values():
                own = mj.dof_jntid[mechanism.v_address]
                rows = [row for row, joint in enumerate(own.tolist()) if joint in joints]
                if rows:
                    of = own[rows].astype(np.int64)
                    turns = mj.jnt_type[of] == mujoco.mjtJoint.mjJNT_HINGE
                    found.append(_KinematicChain(mechanism.name, of, turns, np.abs(mechanism.coupling[rows])))
        return self._chains[key]
