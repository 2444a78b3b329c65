r"""What a simulated stop needs at most, whenever it begins within a span of time: by its energy.

How a stop goes hangs on everything that it begins with. But brakes take energy out with every angle that a
joint turns, gravity can give back no more than the masses allow, and so whatever the posture both way and
time are bounded by the energy that there is when they set in.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from seerob.core.transforms import Array
from seerob.criteria.stopping.in_span import InSpan, known_in_span
from seerob.criteria.stopping.onset import LARGEST_WINDOW
from seerob.criteria.stopping.simulated import STEP
from seerob.criteria.stopping.terms import Course
from seerob.model.model import Gap, Mechanism, Model
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.spans import ROUNDING, Points, Span


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
        self._all: tuple[Array, Array, Array] | None = None

    def _rows(self, point: int) -> tuple[Array, Array]:
        """Farthest that a point can be from each joint [m], and how much of that gravity can load, (j,)."""
        dofs, turns, lengths = self._points.chain(point)
        rows, robot = {int(dof): k for k, dof in enumerate(self._robot.v_address)}, self._robot
        far, loaded = np.zeros((2, len(robot.v_address)))
        if not turns.all():
            return np.full(len(robot.joints), np.inf), far[: len(robot.joints)]
        reach = np.cumsum(lengths[::-1])[::-1]
        for k, (dof, arm) in enumerate(zip(dofs.tolist(), reach.tolist(), strict=True)):
            if dof not in rows:
                return np.full(len(robot.joints), np.inf), far[: len(robot.joints)]
            share = 1.0
            if k == 0:  # nothing turns its axis
                axis = self._data.xaxis[int(self._points.model.mj.dof_jntid[dof])]
                g = float(np.linalg.norm(self._gravity))
                share = float(np.linalg.norm(np.cross(axis, self._gravity))) / g if g else 0.0
            far[rows[dof]], loaded[rows[dof]] = arm, arm * share
        coupling = np.abs(robot.coupling)
        return far @ coupling, loaded @ coupling

    def at_all(self) -> tuple[Array, Array, Array]:
        """Of the parts [m], shape (n, j), of all that has a mass [√kg m], and torques of gravity, (j,)."""
        if self._all is None:
            parts = np.array([self._rows(row)[0] for row in self._parts])
            heavy = [self._rows(row) for row in self._heavy]
            far, loaded = (np.array([each[k] for each in heavy]) for k in (0, 1))
            weight = self._masses * float(np.linalg.norm(self._gravity))
            self._all = parts, np.sqrt(self._masses @ far**2 + self._rotors), weight @ loaded
        return self._all


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
        None where others move with it, or its parts change hands, or a joint of it slides.
    """
    turns = model.mj.jnt_type[model.mj.dof_jntid[robot.v_address]] == mujoco.mjtJoint.mjJNT_HINGE
    carries = robot.on or robot.riders or any(model.bodies[i].holder for i in gap.b)
    if carries or T_r > LARGEST_WINDOW or not turns.all():
        return None
    own_v, period = robot.v_address[robot.own], model.workstation.engine.tick

    def bind(points: Points) -> Callable[[Span], Course | None]:
        levers = _Levers(model, robot, gap, points)

        def at_most(span: Span) -> Course | None:
            u = span.qd[own_v] + span.joint_noise[own_v]
            if not held:
                known = known_in_span(span, robot.name, T_r, period, own_v)
                if known is None:
                    return None
                u = np.maximum(u, known[0] + span.joint_noise[own_v])
            R, r, G = levers.at_all()
            left = brakes - G
            if not (
                np.isfinite(u).all() and np.isfinite(R).all() and np.isfinite(r).all() and (left > 0).all()
            ):
                return None
            root = float(r @ u)
            v = R @ u
            # A simulation counts the faster end of every step.
            way = root**2 / 2 * (R / left).max(axis=1) + 2 * STEP * v
            return Course(v, v * T_r + ROUNDING, way, root * float((r / left).max()) + 2 * STEP)

        return at_most

    return bind
