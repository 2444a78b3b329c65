r"""What the joints of a robot must hold or spend on itself: the terms of its equation of motion.

.. math:: M(q)\,\ddot q + c(q, \dot q) + g(q) = \tau - J^T f

with :math:`f` the force and moment that the robot exerts on its surroundings.
"""

from __future__ import annotations

import mujoco
import numpy as np

from seerob.core.errors import Undecided
from seerob.core.transforms import Array
from seerob.kernels.chain import held
from seerob.model.model import Mechanism
from seerob.twin.state import State

LONGEST = 0.05
"""Between two evaluations; over a longer time a mean acceleration says nothing [s]."""


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


class Needed:
    r"""What the joints must spend on the motion: :math:`M \ddot q + c + g`, accelerated since the last call.

    Args:
        mechanism: The robot.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._robot = mechanism
        self._before: tuple[float, Array] | None = None

    def __call__(self, state: State) -> Array:
        """Shape (n,) [N·m or N].

        Raises:
            Undecided: Not heard, a mass that nobody gave, moved by or moving others, or asked too seldom.
        """
        # Forgotten first: after a tick that is undecided a difference of speeds would bridge the gap.
        last, self._before = self._before, None
        robot = self._robot
        if not robot.alone:
            why = "what that accelerates is in the measured torques too"
            raise Undecided(f"{robot.name} is moved, or moves others: {why}")
        speeds = state.qd(robot).copy()
        self._before = (state.t, speeds)
        elapsed = np.nan if last is None else state.t - last[0]
        if last is None or not 0 < elapsed <= LONGEST:
            raise Undecided(
                f"{robot.name}: an acceleration needs two evaluations within {LONGEST:g} s; "
                "leave 'every' away or let the source send external torques"
            )
        qdd = (speeds - last[1]) / elapsed
        return np.asarray(state.mass_matrix(robot) @ qdd + bias(state, robot))

    def forget(self) -> None:
        """Forget the instant before: this one is undecided for another reason, and nothing bridges it."""
        self._before = None
