"""How strongly the twin is pulled: gains and torque limits of its actuators; see `seerob.twin.engine`.

A person pulled bone by bone instead of joint by joint (`follow = "task"`); see `seerob.kernels.task_pull`.

Only the stiffness is the bones': the damping stays that of the joints, which MuJoCo's actuators integrate
implicitly. With explicit damping of the bones, hands that a table stopped spun at over 100 rad/s. The torques
go through the actuators, whose limits therefore hold here too.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.task_pull import BONES, Bones, torques
from seerob.model.model import Mechanism
from seerob.workstation.workstation import Engine as Options


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
        bodies = np.sort(mechanism.mj_bodies).astype(np.int64)
        row = {int(body): k for k, body in enumerate(bodies)}
        up = np.array([row.get(int(mj.body_parentid[b]), -1) for b in bodies], np.int64)
        dof = mechanism.v_address.astype(np.int64)
        joint = mj.dof_jntid[dof].astype(np.int64)
        at = np.array([row[int(b)] for b in mj.jnt_bodyid[joint]], np.int64)
        turns = mj.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        mass, inertia = mj.body_mass[bodies].copy(), mj.body_inertia[bodies].copy()
        self._bones = Bones(bodies, up, mass, inertia, dof, at, joint, turns)
        """Keeps the arrays of its table."""
        self._table = BONES.rows(self._bones)
        driven = mj.jnt_dofadr[mj.actuator_trnid[:, 0]]
        self._actuators = np.flatnonzero(np.isin(driven, dof))
        self._driven = driven[self._actuators]
        self._places = mj.jnt_qposadr[mj.actuator_trnid[self._actuators, 0]]
        mj.actuator_biasprm[self._actuators, 1] = 0.0
        self._torques = np.zeros(mj.nv)

    def command(self, mj: mujoco.MjModel, data: mujoco.MjData, wanted: mujoco.MjData, kp: Array) -> None:
        """Turn the commands of its joints into those of its bones.

        Args:
            mj: The `mujoco.MjModel`.
            data: The twin, with the joints' commands; where its bones are is computed anew.
            wanted: Where every bone is to be.
            kp: What the actuators multiply commands by, shape (nv,).
        """
        mujoco.mj_kinematics(mj, data)
        torques(
            self._table, data.xipos, data.ximat, wanted.xipos, wanted.ximat, data.xanchor, data.xaxis,
            self._omega, self._torques,
        )  # fmt: skip
        rows = self._driven
        data.ctrl[self._actuators] += self._torques[rows] / kp[rows] - wanted.qpos[self._places]


Indices = NDArray[np.int64]

POSES_FOR_GAINS = 16
REGULAR = 0.05
"""Share of its own inertia that a person's joint gets on top. Where two of the shoulder's three axes fall
together the mass matrix is singular, and a torque at its limit turns both against each other as fast as
nothing hinders it. The feed-forward contains the share, so that free motion does not know it."""


def set_gains(
    mj: mujoco.MjModel,
    data: mujoco.MjData,
    mechanisms: Sequence[Mechanism],
    options: Options,
    dof: Indices,
    *,
    controllers: bool,
) -> tuple[Array, Array]:
    """Proportional and derivative gain per degree of freedom; also written into the actuators.

    Args:
        mj: The `mujoco.MjModel`; changed.
        data: Scratch `mujoco.MjData`.
        mechanisms: All robots and humans.
        options: Of the workstation file.
        dof: Degree of freedom of each actuator.
        controllers: Whether the actuators pull at all.
    """
    largest = np.zeros(mj.nv)
    matrix = np.zeros((mj.nv, mj.nv))
    random = np.random.default_rng(0)
    for pose in range(POSES_FOR_GAINS):
        for m in mechanisms:
            low = np.clip(m.lower, -np.pi, np.pi)
            high = np.clip(m.upper, -np.pi, np.pi)
            q = m.home if pose == 0 or m.role == "human" else random.uniform(low, high)
            data.qpos[m.q_address] = m.coupling @ q + m.offset
        mujoco.mj_kinematics(mj, data)
        mujoco.mj_comPos(mj, data)
        mujoco.mj_makeM(mj, data)
        mujoco.mj_fullM(mj, data, matrix)
        largest = np.maximum(largest, np.diag(matrix))
    omega = np.full(mj.nv, 2 * np.pi * options.bandwidth)
    for m in mechanisms:
        if m.role == "human":
            omega[m.v_address] = 2 * np.pi * options.human_bandwidth
            turning = m.v_address[[unit == "rad" for unit in m.units]]
            mj.dof_armature[turning] += (REGULAR if controllers else 0.0) * largest[turning]
    kp, kd = omega**2 * largest, 2 * omega * largest
    if controllers:
        mj.actuator_gainprm[:, 0] = kp[dof]
        mj.actuator_biasprm[:, 1] = -kp[dof]
        mj.actuator_biasprm[:, 2] = -kd[dof]
    else:
        mj.actuator_gainprm[:] = 0.0
        mj.actuator_biasprm[:] = 0.0
    return kp, kd


def set_torque_limits(mj: mujoco.MjModel, mechanisms: Sequence[Mechanism], dof: Indices) -> Array:
    """Largest torque per degree of freedom, infinity where unknown; also written into the actuators."""
    limits = np.full(mj.nv, np.inf)
    for m in mechanisms:
        for column, limit in enumerate(m.effort_limits):
            if limit is not None and limit.value > 0:
                own = m.v_address[m.coupling[:, column] != 0]
                limits[own] = limit.value
    ranges = limits[dof]
    limited = np.isfinite(ranges)
    mj.actuator_forcelimited[:] = limited
    mj.actuator_forcerange[limited] = np.column_stack([-ranges[limited], ranges[limited]])
    return limits
