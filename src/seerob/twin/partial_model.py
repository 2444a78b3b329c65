"""A model of some kinematic trees of a cell alone, for whoever asks for their kinematics many times.

MuJoCo places all bodies of a model at each call; a person has 53 joints that no robot's parts depend on.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]


class PartialModel(NamedTuple):
    """Some trees of a model."""

    mj: mujoco.MjModel
    """Of these alone; their kinematics are those of the whole model bit for bit."""
    bodies: Indices
    """Their bodies in the whole model, the world first, increasing, shape (m,)."""
    q: Indices
    """Where their positions are there, shape (nq,)."""
    v: Indices
    """Where their velocities are, shape (nv,)."""


def partial_model(mj: mujoco.MjModel, roots: Indices) -> PartialModel:
    """Make a model of the trees that begin with some bodies.

    Args:
        mj: The whole model.
        roots: By index (``body_rootid``).
    """
    bodies = np.flatnonzero(np.isin(mj.body_rootid, [0, *roots]))
    joints = np.flatnonzero(np.isin(mj.jnt_bodyid, bodies))
    dofs = np.flatnonzero(np.isin(mj.dof_bodyid, bodies))
    positions = np.flatnonzero(np.isin(_joint_of_positions(mj), joints))
    spec = mujoco.MjSpec()
    made = {0: spec.worldbody}
    for i in bodies[1:].tolist():
        made[i] = body = made[int(mj.body_parentid[i])].add_body(name=str(i))
        body.mass, body.inertia, body.explicitinertial = 1.0, np.ones(3), True
        for j in joints[mj.jnt_bodyid[joints] == i].tolist():
            body.add_joint(type=mujoco.mjtJoint(int(mj.jnt_type[j])), armature=1.0)
    found = spec.compile()
    assert [found.body(i).name for i in range(1, found.nbody)] == [*map(str, bodies[1:])]
    # What was compiled may be normalised once more, and not be the same to the last bit.
    rows = {"body_": bodies, "jnt_": joints, "dof_": dofs, "qpos": positions}
    for name in dir(mj):
        own = next((rows[prefix] for prefix in rows if name.startswith(prefix)), None)
        if own is None or not isinstance(every := getattr(mj, name), np.ndarray):
            continue
        if every.dtype.kind == "f" or name == "body_sameframe":
            getattr(found, name)[:] = every[own]
    return PartialModel(found, bodies, positions, dofs)


def _joint_of_positions(mj: mujoco.MjModel) -> Indices:
    """The joint that each of ``qpos`` is of, shape (nq,)."""
    return np.repeat(np.arange(len(mj.jnt_qposadr)), np.diff([*mj.jnt_qposadr, mj.nq]))
