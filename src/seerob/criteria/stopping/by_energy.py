r"""What a simulated stop needs at most, whenever in a span of time it begins, of whatever mass: by energy.

How a stop goes hangs on everything that it begins with. But brakes take energy out with every angle that a
joint turns, gravity can give back no more than the masses allow, and so whatever the posture both way and
time are bounded by the energy that there is when they set in.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from seerob.core.transforms import Array
from seerob.criteria.stopping.by_table import InSpan, known_in_span
from seerob.criteria.stopping.onset import LARGEST_WINDOW
from seerob.criteria.stopping.simulated import STEP
from seerob.criteria.stopping.terms import Course
from seerob.model.model import Gap, Mechanism, Model
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.spans import ROUNDING, Points, Span
from seerob.twin.state import State


class _Levers:
    """How far a robot's parts and masses can be from its joints, in whatever posture."""

    def __init__(self, model: Model, robot: Mechanism, gap: Gap, points: Points) -> None:
        mj, self._points, self._robot = model.mj, points, robot
        masses = MassTolerances(model, robot)
        heavy = [int(b) for b in robot.mj_bodies if mj.body_mass[b] > 0]
        more = np.array([masses.heaviest(body) for body in heavy]).reshape(-1, 2)
        self._masses = more[:, 0] * mj.body_mass[heavy]
        radii = np.sqrt(mj.body_inertia[heavy].sum(axis=1) / 2 / mj.body_mass[heavy]) + more[:, 1]
        self._heavy = [points.add(b, mj.body_ipos[b], r) for b, r in zip(heavy, radii.tolist(), strict=True)]
        self._parts = gap.b
        self._rotors = mj.dof_armature[robot.v_address] @ robot.coupling**2
        self._gravity = np.asarray(mj.opt.gravity, float)
        self._data = mujoco.MjData(mj)
        mujoco.mj_kinematics(mj, self._data)
        kinds = mj.jnt_type[mj.dof_jntid[robot.v_address]]
        self._slides = kinds != mujoco.mjtJoint.mjJNT_HINGE
        self._all: tuple[Array, Array, Array] | None = None

    def _rows(self, point: int, out: Array) -> tuple[Array, Array]:
        """Farthest that a point can be from each joint [m], 1 of one that slides, and its load by gravity.

        The latter as a share of the point's weight, times the former; shape (j,) each.
        """
        dofs, turns, lengths = self._points.chain(point)
        rows, robot = {int(dof): k for k, dof in enumerate(self._robot.v_address)}, self._robot
        far, loaded = np.zeros((2, len(robot.v_address)))
        if not all(dof in rows for dof in dofs.tolist()):
            return np.full(len(robot.joints), np.inf), far[: len(robot.joints)]
        own = np.array([rows[dof] for dof in dofs.tolist()], np.int64)
        reach = np.cumsum((lengths + np.where(turns, 0.0, out[own]))[::-1])[::-1]
        for k, (row, arm) in enumerate(zip(own.tolist(), np.where(turns, reach, 1.0).tolist(), strict=True)):
            share = 1.0
            if k == 0:  # nothing turns its axis
                axis = self._data.xaxis[int(self._points.model.mj.dof_jntid[int(dofs[0])])]
                g = float(np.linalg.norm(self._gravity))
                along = np.cross(axis, self._gravity) if turns[0] else axis @ self._gravity
                share = float(np.linalg.norm(along)) / g if g else 0.0
            far[row], loaded[row] = arm, arm * share
        coupling = np.abs(robot.coupling)
        return far @ coupling, loaded @ coupling

    def at_all(self, out: Array) -> tuple[Array, Array, Array]:
        """Of the parts [m], shape (n, j), of all that has a mass [√kg m], and torques of gravity, (j,).

        Args:
            out: How far each joint that slides is from the model's pose at most [m], of all the robot's.
        """
        if self._all is None or self._slides.any():
            parts = np.array([self._rows(row, out)[0] for row in self._parts])
            heavy = [self._rows(row, out) for row in self._heavy]
            far, loaded = (np.array([each[k] for each in heavy]) for k in (0, 1))
            weight = self._masses * float(np.linalg.norm(self._gravity))
            self._all = parts, np.sqrt(self._masses @ far**2 + self._rotors), weight @ loaded
        return self._all

    def braked(self, brakes: Array, u: Array, out: Array, T_r: float) -> Course | None:
        """What bounds a stop; None where nothing does.

        Args:
            brakes: Torque of each joint's brake [N·m or N], shape (j,).
            u: Largest speeds of the joints until it begins [rad/s or m/s], shape (j,).
            out: As of `at_all`, when the brakes set in.
            T_r: Reaction time [s].
        """
        _, r, G = self.at_all(out)
        root = float(r @ u)
        if not (np.isfinite(root) and (brakes > G).all()):
            return None
        # No slide goes on by more than the energy can move it.
        R, r, G = self.at_all(out + np.abs(self._robot.coupling) @ (root**2 / 2 / (brakes - G)))
        left = brakes - G
        if not (np.isfinite(R).all() and np.isfinite(r).all() and (left > 0).all()):
            return None
        v = R @ u
        # A simulation counts the faster end of every step.
        way = root**2 / 2 * (R / left).max(axis=1) + 2 * STEP * v
        return Course(v, v * T_r + ROUNDING, way, root * float((r / left).max()) + 2 * STEP)


def bind_braked_in_span(
    model: Model, robot: Mechanism, gap: Gap, brakes: Array, *, T_r: float, held: bool
) -> InSpan | None:
    r"""Resolve what bounds simulated stops of a robot that begin within a span, by energy.

    With :math:`R_{ij}` the farthest that part i can be from the axis of joint j, in whatever posture, and
    :math:`\rho_{bj}` that of mass b with its radius of gyration, speeds of at most u have no more energy than
    :math:`E \le \tfrac12 (\sum_j u_j r_j)^2`, :math:`r_j^2 = \sum_b m_b \rho_{bj}^2` and its rotors, by
    Minkowski's inequality. Gravity loads a joint by at most :math:`G_j = g \sum_b m_b \rho_{bj}`, and with
    :math:`b_j = B_j - G_j > 0`

    .. math::
        \dot E \le -\sum_j b_j |\dot q_j|, \qquad \frac{d}{dt}\sqrt{2E}
        \le -\frac{\sum_j b_j |\dot q_j|}{\sum_j r_j |\dot q_j|} \le -\min_j \frac{b_j}{r_j}.

    A joint that slides has R and :math:`\rho` of 1, and lengthens those of joints before it by how far it is
    from the model's pose: by no more than at the onset and :math:`E_0 / b_j`, E_0 the energy then, as E never
    falls below 0 and its own :math:`b_j` does not hang on the posture.

    All stand after :math:`T_s \le \sqrt{2E} \max_j r_j / b_j`, and no point of a part has gone farther than
    :math:`\sum_j R_{ij} \int |\dot q_j|\,dt \le E \max_j R_{ij} / b_j`.

    Args:
        model: The workstation.
        robot: Who stops.
        gap: Its second set are the moving parts.
        brakes: Torque of each joint's brake [N·m or N], shape (j,).
        T_r: Reaction time [s].
        held: Whether nothing gets faster during that time.

    Returns:
        None where others move with it, its parts change hands, or a joint both turns and slides something.
    """
    if T_r > LARGEST_WINDOW or not _by_itself(model, robot, gap):
        return None
    own_v, period = robot.v_address[robot.own], model.workstation.engine.tick
    moving = np.abs(robot.coupling)

    def bind(points: Points) -> Callable[[Span], Course | None]:
        levers = _Levers(model, robot, gap, points)

        def at_most(span: Span) -> Course | None:
            u = span.qd[own_v] + span.joint_noise[own_v]
            if not held:
                known = known_in_span(span, robot.name, T_r, period, own_v)
                if known is None:
                    return None
                u = np.maximum(u, known[0] + span.joint_noise[own_v])
            return levers.braked(brakes, u, span.away[robot.v_address] + moving @ u * T_r, T_r)

        return at_most

    return bind


def bind_braked(
    model: Model, robot: Mechanism, gap: Gap, brakes: Array, *, T_r: float
) -> Callable[[State, Array], Course | None] | None:
    """Resolve what bounds a simulated stop that begins now, of whatever masses tolerances allow.

    Args:
        model: The workstation.
        robot: Who stops.
        gap: Its second set are the moving parts.
        brakes: Torque of each joint's brake [N·m or N], shape (j,).
        T_r: Reaction time [s].

    Returns:
        From a state and the largest speeds of the joints until the brakes act, shape (j,), to the bound, None
        where brakes do not hold what gravity may load them with; None where `bind_braked_in_span` has none.
    """
    if not _by_itself(model, robot, gap):
        return None
    points = Points(model)
    levers = _Levers(model, robot, gap, points)
    moving, rest = np.abs(robot.coupling), model.mj.qpos0[robot.q_address]

    def at_most(state: State, u: Array) -> Course | None:
        points.chains(np.zeros(0, np.int64), state.attachments.ids, model.mj)
        away = np.abs(robot.coupling @ state.q(robot) + robot.offset - rest)
        return levers.braked(brakes, u, away + moving @ u * T_r, T_r)

    return at_most


def _by_itself(model: Model, robot: Mechanism, gap: Gap) -> bool:
    """Whether nobody moves with it, its parts do not change hands, and no joint both turns and slides."""
    carries = robot.on or robot.riders or any(model.bodies[i].holder for i in gap.b)
    turns = model.mj.jnt_type[model.mj.dof_jntid[robot.v_address]] == mujoco.mjtJoint.mjJNT_HINGE
    moves = robot.coupling != 0
    return not (carries or (moves[turns].any(axis=0) & moves[~turns].any(axis=0)).any())
