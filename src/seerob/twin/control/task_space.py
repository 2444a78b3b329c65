"""A person pulled bone by bone instead of joint by joint (`follow = "task"`); see `seerob.kernels.task_pull`.

Only the stiffness is the bones': the damping stays that of the joints, which MuJoCo's actuators integrate
implicitly. With explicit damping of the bones, hands that a table stopped spun at over 100 rad/s. The torques
go through the actuators, whose limits therefore hold here too.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from seerob.core.transforms import Array
from seerob.kernels.task_pull import torques
from seerob.model.model import Mechanism


class TaskPull:
    """One person, bound once."""

    def __init__(self, mj: mujoco.MjModel, mechanism: Mechanism, bandwidth: float) -> None:
        """Take the joints' own stiffness away from its actuators.

        Args:
            mj: The `mujoco.MjModel`; the actuators' feedback is changed.
            mechanism: The person.
            bandwidth: Of every bone [Hz].
        """
        self._omega = 2 * np.pi * bandwidth
        self._bodies = np.sort(mechanism.mj_bodies).astype(np.int64)
        row = {int(body): k for k, body in enumerate(self._bodies)}
        self._up = np.array([row.get(int(mj.body_parentid[b]), -1) for b in self._bodies], np.int64)
        self._mass = mj.body_mass[self._bodies].copy()
        self._inertia = mj.body_inertia[self._bodies].copy()
        self._dof = mechanism.v_address.astype(np.int64)
        self._joint = mj.dof_jntid[self._dof].astype(np.int64)
        self._at = np.array([row[int(b)] for b in mj.jnt_bodyid[self._joint]], np.int64)
        self._turns = mj.jnt_type[self._joint] == mujoco.mjtJoint.mjJNT_HINGE
        driven = mj.jnt_dofadr[mj.actuator_trnid[:, 0]]
        self._actuators = np.flatnonzero(np.isin(driven, self._dof))
        self._driven = driven[self._actuators]
        self._places = mj.jnt_qposadr[mj.actuator_trnid[self._actuators, 0]]
        mj.actuator_biasprm[self._actuators, 1] = 0.0
        self._torques = np.zeros(mj.nv)

    def command(self, mj: mujoco.MjModel, data: mujoco.MjData, wanted: Any, kp: Array) -> None:
        """Turn the commands of its joints into those of its bones.

        Args:
            mj: The `mujoco.MjModel`.
            data: The twin, with the joints' commands; where its bones are is computed anew.
            wanted: Where every bone is to be.
            kp: What the actuators multiply commands by, shape (nv,).
        """
        mujoco.mj_kinematics(mj, data)
        torques(
            self._bodies, self._up, self._mass, self._inertia, data.xipos, data.ximat, wanted.xipos,
            wanted.ximat, self._dof, self._at, self._joint, self._turns, data.xanchor, data.xaxis,
            self._omega, self._torques,
        )  # fmt: skip
        rows = self._driven
        data.ctrl[self._actuators] += self._torques[rows] / kp[rows] - wanted.qpos[self._places]
