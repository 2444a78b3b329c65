r"""What the joints of a robot must hold or spend on itself: the terms of its equation of motion.

.. math:: M(q)\,\ddot q + c(q, \dot q) + g(q) = \tau - J^T f

with :math:`f` the force and moment that the robot exerts on its surroundings.
"""

from __future__ import annotations

import mujoco
import numpy as np

from seerob.kernels.chain import held
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
    state.weigh(mechanism)
    data, columns = state.data_of(mechanism.name), state.columns[mechanism.name]
    found = np.empty(len(columns.joints))
    held(
        data.subtree_com, data.xanchor, data.xaxis, columns.bodies, columns.joints, columns.turns,
        columns.masses, state.model.mj.opt.gravity, found,
    )  # fmt: skip
    return found if columns.coupling is None else np.asarray(columns.coupling.T @ found)


def bias(state: State, mechanism: Mechanism) -> Array:
    r"""Torques of gravity and of the velocity products, :math:`c(q, \dot q) + g(q)`.

    Returns:
        Shape (n,) [N·m or N].

    Raises:
        Undecided: Not heard, or a mass that nobody gave.
    """
    state.weigh(mechanism)
    every = np.zeros(state.model.mj.nv)
    mujoco.mj_rne(state.model.mj, state.data_of(mechanism.name), 0, every)
    return np.asarray(mechanism.coupling.T @ every[mechanism.v_address])
