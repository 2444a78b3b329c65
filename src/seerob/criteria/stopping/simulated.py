r"""A robot brakes until it stands: all joints, gravity, tools and workpieces.

.. math:: M(q)\,\ddot q + c(q, \dot q) + g(q) = \tau, \qquad |\tau_j| \le B_j \text{ against } \dot q_j

First it goes on at its joint velocities for the reaction time, then every joint is braked with the
torque :math:`B_j`, until all stand. Joint friction, damping and mechanical stops would only help and are
left out. Midpoint rule with `seerob.kernels.braking` in each step: of second order, and a joint that
its brake holds stands exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from seerob.core.errors import Undecided
from seerob.core.tolerances import Shifts
from seerob.core.transforms import Array
from seerob.criteria.stopping.terms import Course
from seerob.kernels.braking import braked
from seerob.model.model import Mechanism, Model
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.state import State

STEP = 2e-3
"""Time step of braking [s]."""
COASTING_STEP = 1e-2
"""Time step of the reaction time [s]."""
MOST_WEIGHED = 32
"""Models with other masses that are kept: as many as a gripper with something in it and without asks for."""
LONGEST = 5.0
"""A stop that takes longer is none [s]."""


@dataclass(frozen=True, eq=False)
class Stopped:
    """A simulated stop; K instants, from now to standstill, n bodies."""

    t: Array
    """[s] from now, shape (K,)."""
    q: Array
    """Joint positions [rad or m], shape (K, joints)."""
    qd: Array
    """Joint velocities [rad/s or m/s], shape (K, joints)."""
    braking: int
    """Instant at which the brakes act: the first ``braking`` intervals are the reaction time."""
    rotations: Array
    """World from body, shape (K, n, 3, 3)."""
    positions: Array
    """[m], shape (K, n, 3)."""
    speeds: Array
    """Speed of each body's fastest point [m/s], shape (K, n)."""

    @property
    def T_s(self) -> float:
        """From the onset of braking to standstill [s]."""
        return float(self.t[-1] - self.t[self.braking])

    @property
    def ways(self) -> Array:
        """Bound on the path of any point of each body in each interval [m], shape (K - 1, n).

        The larger of the speeds at its ends all along.
        """
        return np.diff(self.t)[:, None] * np.maximum(self.speeds[:-1], self.speeds[1:])

    def course(self) -> Course:
        """Paths of the bodies, whatever their direction."""
        ways = self.ways
        return Course(
            self.speeds[0], ways[: self.braking].sum(axis=0), ways[self.braking :].sum(axis=0), self.T_s
        )


class StopSimulation:
    """Stops of one robot; holds its own `mujoco.MjData`, never touches the twin's."""

    def __init__(self, model: Model, robot: Mechanism, brakes: Array, bodies: Sequence[int]) -> None:
        """Bind.

        Args:
            model: The workstation.
            robot: Who stops.
            brakes: Torque of each joint's brake [N·m or N], shape (n,).
            bodies: Whose ways are wanted, by index.
        """
        self.robot = robot
        self.masses = MassTolerances(model, robot)
        self._weighed: dict[tuple[Shifts, bytes], mujoco.MjModel] = {}
        self.bodies = [model.bodies[i] for i in bodies]
        self.brakes = np.ascontiguousarray(brakes, float)
        self._model = model
        self._mj = model.mj
        self._data = mujoco.MjData(model.mj)
        self._ids = np.array([body.mj for body in self.bodies], np.int64)
        self._roots = model.mj.body_rootid[self._ids]
        self._block = np.ix_(robot.v_address, robot.v_address)
        self._M, self._b = np.zeros((model.mj.nv, model.mj.nv)), np.zeros(model.mj.nv)

    def stop(
        self,
        state: State,
        reaction: float,
        scale: float = 1.0,
        known: tuple[Array, Array] | None = None,
        shifts: Shifts = (),
    ) -> Stopped:
        """Stop from where the robot is.

        Args:
            state: The twin now; everything but the robot stands still where it is.
            reaction: Time until the brakes act [s].
            scale: Factor on the joint velocities.
            known: Where its joints are and how fast at even instants of that time, the last at its end;
                at their present velocities throughout when not given, shape (m, j) each.
            shifts: Of the tolerances of ``masses``; as given without.

        Raises:
            Undecided: Not heard, a mass that nobody gave, or brakes that do not bring it to a stand.
        """
        state.weigh(self.robot)
        # What a gripper holds is where it was taken, and weighs while it is held.
        self._mj = self._at_masses(state.model.mj, shifts)
        self._data.qpos[:] = state.data_of(self.robot.name).qpos
        self._data.qvel[:] = 0.0
        trace = _Trace(self)
        q, v = state.q(self.robot).astype(float), scale * state.qd(self.robot)
        steps = int(np.ceil(reaction / COASTING_STEP - 1e-9)) if known is None else len(known[0])
        for k in range(steps):
            at, speed = q + k * reaction / steps * v, v
            if known is not None and k:
                at, speed = known[0][k - 1], known[1][k - 1]
            self._place(at, speed)
            trace.add(k * reaction / steps, at, speed)
        t, q = reaction, q + reaction * v
        if known is not None:
            q, v = known[0][-1].astype(float), known[1][-1].astype(float)
        while True:
            self._place(q, v)
            trace.add(t, q, v)
            if not np.any(v) and not np.any(self._braked(v)):
                return trace.stopped(steps)
            if t - reaction > LONGEST:
                raise Undecided(
                    f"{self.robot.name}: the brakes do not bring it to a stand within {LONGEST:g} s"
                )
            first = self._braked(v)
            self._place(q + STEP / 4 * (v + first), (v + first) / 2)
            after = self._braked(v)
            q, v, t = q + STEP / 2 * (v + after), after, t + STEP

    def _at_masses(self, mj: mujoco.MjModel, shifts: Shifts) -> mujoco.MjModel:
        if not any(shifts):
            return mj
        key = shifts, mj.body_mass.tobytes()
        if key not in self._weighed:
            if len(self._weighed) == MOST_WEIGHED:
                self._weighed.clear()
            self._weighed[key] = self.masses.weighed(mj, shifts)
        return self._weighed[key]

    def _place(self, q: Array, v: Array) -> None:
        robot, data = self.robot, self._data
        data.qpos[robot.q_address] = robot.coupling @ q + robot.offset
        data.qvel[robot.v_address] = robot.coupling @ v
        mujoco.mj_kinematics(self._mj, data)
        mujoco.mj_comPos(self._mj, data)
        mujoco.mj_comVel(self._mj, data)

    def _braked(self, v: Array) -> Array:
        """Velocities one step after ``v`` with the dynamics of where it was placed."""
        robot = self.robot
        mujoco.mj_makeM(self._mj, self._data)
        mujoco.mj_fullM(self._mj, self._data, self._M)
        mujoco.mj_rne(self._mj, self._data, 0, self._b)
        address, coupling = robot.v_address, robot.coupling
        M = coupling.T @ self._M[self._block] @ coupling
        after = np.empty(len(v))
        b = coupling.T @ self._b[address]
        if not braked(np.ascontiguousarray(M), b, np.ascontiguousarray(v), self.brakes, STEP, after):
            raise Undecided(f"{self.robot.name}: the stop could not be simulated")
        return after

    def speeds(self, twists: Array, turned: Array, arms: Array) -> Array:
        """Bound on the speed of any point of each body at K instants [m/s], shape (K, n).

        Args:
            twists: MuJoCo's ``cvel`` of each body, of the point at the centre of mass of its whole tree:
                angular [rad/s], then linear [m/s], shape (K, n, 6).
            turned: World from body, shape (K, n, 3, 3).
            arms: From that point to the origin of each body [m], world axes, shape (K, n, 3).
        """
        found = np.empty(arms.shape[:2])
        for k, body in enumerate(self.bodies):
            (w0, w1, w2), (v0, v1, v2) = twists[:, k, :3].T[..., None], twists[:, k, 3:].T[..., None]
            x, y, z = np.moveaxis(body.corners @ np.swapaxes(turned[:, k], 1, 2) + arms[:, k, None], 2, 0)
            x, y, z = v0 + (w1 * z - w2 * y), v1 + (w2 * x - w0 * z), v2 + (w0 * y - w1 * x)
            fastest = (x * x + y * y + z * z).max(axis=1)
            reach = (body.radius + body.deviation) * np.linalg.norm(twists[:, k, :3], axis=1)
            found[:, k] = np.sqrt(fastest) + reach
        return found


class _Trace:
    """Instants of a stop while it is simulated."""

    def __init__(self, simulation: StopSimulation) -> None:
        self._simulation = simulation
        self._rows: list[tuple[float, Array, Array, Array, Array, Array, Array]] = []

    def add(self, t: float, q: Array, v: Array) -> None:
        s = self._simulation
        data, ids = s._data, s._ids
        positions = data.xpos[ids]
        arms = positions - data.subtree_com[s._roots]
        turned = data.xmat[ids].reshape(-1, 3, 3)
        self._rows.append((t, q.copy(), v.copy(), turned, positions, data.cvel[ids], arms))

    def stopped(self, braking: int) -> Stopped:
        t, q, v, rotations, positions, twists, arms = map(np.array, zip(*self._rows, strict=True))
        speeds = self._simulation.speeds(twists, rotations, arms)
        return Stopped(t, q, v, braking, rotations, positions, speeds)
