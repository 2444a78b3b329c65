r"""What the joints of a robot must hold or spend on itself: the terms of its equation of motion.

.. math:: M(q)\,\ddot q + c(q, \dot q) + g(q) = \tau - J^T f

with :math:`f` the force and moment that the robot exerts on its surroundings.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from seerob.core.errors import Undecided
from seerob.core.transforms import Array
from seerob.kernels.chain import held
from seerob.model.model import Mechanism, Model
from seerob.twin.spans import Points, Span, coupling_of, joints_of, rows_of
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
    _weigh(state, mechanism)
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
    _weigh(state, mechanism)
    every = np.zeros(state.model.mj.nv)
    mujoco.mj_rne(state.model.mj, state.data_of(mechanism.name), 0, every)
    return np.asarray(mechanism.coupling.T @ every[mechanism.v_address])


def _weigh(state: State, mechanism: Mechanism) -> None:
    """Raise `Undecided` unless masses are known well enough for a torque that is told without an interval."""
    state.weigh(mechanism)
    if why := mechanism.roughly_weighed:
        raise Undecided(why)


def bind_needed_in_span(
    model: Model, mechanism: Mechanism, points: Points
) -> Callable[[State, Span], tuple[Array, Array]]:
    """Resolve what bounds the torques that a motion needs at any instant of a span, given one end of it.

    The mathematics is told by `seerob.criteria.safety.joint_torque.JointTorque.lowest`.

    Returns:
        Torques [N·m or N], shape (k, n), and by how much others there may differ from means of these, shape
        (n,); infinity where nothing bounds them.
    """
    mj, coupling, own = model.mj, coupling_of(model, mechanism), mechanism.v_address[mechanism.own]
    heavy = [int(body) for body in mechanism.mj_bodies if mj.body_mass[body] > 0]
    masses = mj.body_mass[heavy]
    radii = np.sqrt(mj.body_inertia[heavy].sum(axis=1) / 2 / masses)
    rows = rows_of(points.add(b, mj.body_ipos[b], r) for b, r in zip(heavy, radii.tolist(), strict=True))
    chains = [mj.jnt_dofadr[joints_of(mj, body)] for body in heavy]
    moved = np.array([coupling.shares[chain].any(axis=0) for chain in chains]).reshape(-1, len(own))
    g, stepped = float(np.linalg.norm(mj.opt.gravity)), model.workstation.engine.physics

    def needed(state: State, span: Span) -> tuple[Array, Array]:
        M, now = state.mass_matrix(mechanism), bias(state, mechanism)
        qdd = span.path.accelerations(span.begin, span.end, own, stepped=stepped)
        changes = np.array([points.column_changes(row, span, coupling) for row in rows.tolist()])
        changes = changes.reshape(-1, len(own)) * span.T
        # Accelerations from speeds that were derived from noisy positions are anybody's guess.
        if not np.isfinite(changes).all() or span.joint_noise[own].any():
            return qdd @ M + now, np.full(len(own), np.inf)
        at_speed, varies = (each[rows] for each in points.at_constant_speeds(span))
        D, root = np.sqrt(masses @ changes**2), np.sqrt(np.diagonal(M))
        of_M = np.outer(D, root) + np.outer(root, D) + np.outer(D, D)
        of_bias = (masses * (at_speed + g)) @ changes + root * np.sqrt((masses * varies**2) @ moved)
        return qdd @ M + now, np.asarray(of_M @ np.abs(qdd).max(axis=0) + of_bias)

    return needed


class Needed:
    r"""What the joints must spend on the motion: :math:`M \ddot q + c + g`.

    Accelerated since the last call; where that was no instant before, and its motion is known ahead, until
    the next tick.

    Args:
        mechanism: The robot.
        ahead: How far its motion is asked then [s], see `seerob.criteria.criterion.Criterion.looks_ahead`.
    """

    def __init__(self, mechanism: Mechanism, ahead: float) -> None:
        self._robot, self._ahead = mechanism, ahead
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
        if last is not None and 0 < state.t - last[0] <= LONGEST:
            qdd = (speeds - last[1]) / (state.t - last[0])
        else:
            qdd = self._coming(state)
        return np.asarray(state.mass_matrix(robot) @ qdd + bias(state, robot))

    def _coming(self, state: State) -> Array:
        """Mean acceleration until the next tick, of a motion that is known ahead, shape (n,).

        Raises:
            Undecided: It is not.
        """
        coming = state.foresee(self._robot.name, state.t + np.array([0.0, self._ahead]))
        if coming is None:
            raise Undecided(
                f"{self._robot.name}: an acceleration needs two evaluations within {LONGEST:g} s; "
                "leave 'every' away or let the source send external torques"
            )
        _, speeds, unknown = coming
        if unknown:
            raise Undecided(f"{self._robot.name}: its acceleration is not known: {unknown}")
        return np.asarray((speeds[1] - speeds[0]) / self._ahead)

    def forget(self) -> None:
        """Forget the instant before: this one is undecided for another reason, and nothing bridges it."""
        self._before = None
