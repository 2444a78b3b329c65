r"""What the joints of a robot must hold or spend on itself: the terms of its equation of motion.

.. math:: M(q)\,\ddot q + c(q, \dot q) + g(q) = \tau - J^T f

with :math:`f` the force and moment that the robot exerts on its surroundings.
"""

from __future__ import annotations

import mujoco
import numpy as np

from seerob.errors import Undecided
from seerob.model import Mechanism
from seerob.state import State
from seerob.transforms import Array


def gravity(state: State, mechanism: Mechanism) -> Array:
    r"""Torques that hold a robot with tools and workpieces still, :math:`g_i = \partial U / \partial q_i`.

    The weight of all that a joint moves acts at its common centre of mass.

    Returns:
        Shape (n,) [N·m or N].

    Raises:
        Undecided: Not heard, or a mass that nobody gave.
    """
    _need_masses(state, mechanism)
    mj, data = state.model.mj, state.data
    joints = mj.dof_jntid[mechanism.v_address]
    bodies = mj.jnt_bodyid[joints]
    gravity = mj.opt.gravity
    gx, gy, gz = gravity.tolist()
    x, y, z = (data.subtree_com[bodies] - data.xanchor[joints]).T
    turns = mj.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE
    # (axis × arm) · g is axis · (arm × g) of a joint that turns; one that slides falls along its axis.
    moments = np.stack([y * gz - z * gy, z * gx - x * gz, x * gy - y * gx], axis=1)
    falls = (data.xaxis[joints] * np.where(turns[:, None], moments, gravity)).sum(axis=1)
    return np.asarray(mechanism.coupling.T @ -(mj.body_subtreemass[bodies] * falls))


def bias(state: State, mechanism: Mechanism) -> Array:
    r"""Torques of gravity and of the velocity products, :math:`c(q, \dot q) + g(q)`.

    Returns:
        Shape (n,) [N·m or N].

    Raises:
        Undecided: Not heard, or a mass that nobody gave.
    """
    _need_masses(state, mechanism)
    every = np.zeros(state.model.mj.nv)
    mujoco.mj_rne(state.model.mj, state.data, 0, every)
    return np.asarray(mechanism.coupling.T @ every[mechanism.v_address])


def _need_masses(state: State, mechanism: Mechanism) -> None:
    state.require(mechanism.name)
    if mechanism.unknown_masses:
        raise Undecided("; ".join(mechanism.unknown_masses))
