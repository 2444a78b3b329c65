"""Where the joints of a robot or human are among all of the workstation's."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.model.model import Mechanism

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Columns:
    """Where the joints of a mechanism are among all of the workstation, bound once."""

    own_q: Indices
    """Columns of the commanded joints in ``MjData.qpos``."""
    own_v: Indices
    """Columns of the commanded joints in ``MjData.qvel``."""
    all_v: Indices | slice
    coupling: Array | None
    """None where every joint is commanded itself."""
    joints: Indices
    """MuJoCo's, in the order of ``all_v``."""
    bodies: Indices
    """MuJoCo's body of each."""
    turns: NDArray[np.bool_]
    """Whether each turns; otherwise it slides."""
    masses: Array
    """What each carries [kg]."""

    @classmethod
    def of(cls, mechanism: Mechanism, mj: mujoco.MjModel) -> Columns:
        """Bind to a `mujoco.MjModel`."""
        v, n = mechanism.v_address, len(mechanism.v_address)
        in_turn = n > 0 and np.array_equal(v, v[0] + np.arange(n))
        return cls(
            mechanism.q_address[mechanism.own],
            v[mechanism.own],
            slice(int(v[0]), int(v[0]) + n) if in_turn else v,
            None if np.array_equal(mechanism.coupling, np.eye(n)) else mechanism.coupling,
            joints := mj.dof_jntid[v].astype(np.int64),
            bodies := mj.jnt_bodyid[joints].astype(np.int64),
            mj.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE,
            mj.body_subtreemass[bodies],
        )

    def of_rows(self, every: Array) -> Array:
        """Columns of the commanded joints, (..., nv) to (..., n)."""
        own = every[..., self.all_v]
        return own.copy() if self.coupling is None else own @ self.coupling

    def of_matrix(self, every: Array) -> Array:
        """Block of the commanded joints, (nv, nv) to (n, n)."""
        own = every[self.all_v][:, self.all_v]
        return own.copy() if self.coupling is None else self.coupling.T @ own @ self.coupling


def moving_dofs(mj: mujoco.MjModel, body: int) -> NDArray[np.bool_]:
    """Which degrees of freedom move one of MuJoCo's bodies, shape (nv,)."""
    found = np.zeros(mj.nv, bool)
    while body > 0:
        first = mj.body_dofadr[body]
        found[first : first + mj.body_dofnum[body]] = True
        body = mj.body_parentid[body]
    return found
