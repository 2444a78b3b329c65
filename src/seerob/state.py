"""The twin at this tick, and what follows from it. Valid until the next tick.

What two criteria share has its one home here and is computed once per tick. Accessors raise
`Undecided` when the robot or human they speak of was not heard lately, does not follow what was
heard, or has a mass that nobody gave: a stale or guessed number can never be green.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from seerob.distance import Closest, Closests
from seerob.errors import Undecided
from seerob.kernels.speed import fastest, stacked
from seerob.model import Frame, Gap, Mechanism, Model
from seerob.transforms import Array

SLACK = 1e-9
"""Instants that differ by less are the same [s]: a source's clock and the run's are sums of decimals."""


@dataclass
class Hearing:
    """What is known of where a robot or human really is."""

    given: bool
    """It stands where the workstation file puts it; no source drives it."""
    driven: bool
    """A source drives it."""
    timeout: float = 0.2
    """[s]"""
    heard: list[tuple[float, str]] = field(default_factory=list)
    """Instant [s] of the newest samples and why one may not be relied on (empty: it may), oldest first;
    some may lie ahead of the tick."""
    torques: list[Array | None] = field(default_factory=list)
    """Measured joint torques of the same samples [N·m or N], each (n,); None where there were none."""
    error: float = 0.0
    """Largest joint error between twin and reference [rad or m]."""
    lost: float = -np.inf
    """When the physics last lost it, so that it was put back [s]."""
    saturated: bool = False
    """A joint's torque limit was reached: the twin cannot do what was heard."""

    def forget(self, t: float) -> None:
        """Drop what is older than the last sample at or before ``t`` [s]."""
        while len(self.heard) > 1 and self.heard[1][0] <= t:
            del self.heard[0]
            del self.torques[:1]

    def doubt(self, t: float) -> str:
        """Why what was heard does not tell where it is at ``t`` [s]; empty when it does.

        A sample ahead of the tick does not make up for silence before it: what happened between two
        samples that are further apart than the time-out is a guess.
        """
        if not self.driven:
            return "" if self.given else "no source drives it and the file gives no position (q)"
        k = sum(1 for instant, _ in self.heard if instant <= t + SLACK)
        if k == 0:
            return "nothing heard yet"
        age = t - self.heard[k - 1][0]
        if age > self.timeout + SLACK:
            return f"not heard for {age:.2f} s (time-out {self.timeout:g} s)"
        return next((reason for _, reason in self.heard[k - 1 : k + 1] if reason), "")


class State:
    """A view of the engine's `mujoco.MjData`; never keep one beyond its tick."""

    def __init__(self, model: Model, data: Any, hearings: dict[str, Hearing]) -> None:
        self.model = model
        self.data = data
        self.t = 0.0
        """Run time [s]."""
        self.hearings = hearings
        self.asked: set[str] = set()
        """Robots and humans that answers have depended on since the set was last cleared."""
        self._mj_ids = np.array([body.mj for body in model.bodies], np.int64)
        n = len(model.bodies)
        self.rotations = np.zeros((n, 3, 3))
        """World from body, in the order of `Model.bodies`."""
        self.positions = np.zeros((n, 3))
        """World position of the bodies' origins [m]."""
        self.quaternions = np.zeros((n, 4))
        self._period = model.workstation.engine.tick
        self._tracking_limit = model.workstation.engine.tracking_limit
        self._full_mass_matrix = np.zeros((model.mj.nv, model.mj.nv))
        self._cache: dict[Any, Any] = {}
        self._jacp, self._jacr = np.zeros((3, model.mj.nv)), np.zeros((3, model.mj.nv))
        self._mj_roots = model.mj.body_rootid[self._mj_ids]
        self._corners = stacked([body.corners for body in model.bodies])
        self._reach = np.array([body.radius + body.deviation for body in model.bodies])

    def refresh(self, t: float) -> None:
        """Take the engine's new positions and velocities; called once per tick by the engine."""
        mj, data = self.model.mj, self.data
        # mj_step leaves what follows from positions one step behind.
        mujoco.mj_kinematics(mj, data)
        mujoco.mj_comPos(mj, data)
        mujoco.mj_comVel(mj, data)
        self.t = t
        self.rotations[:] = data.xmat[self._mj_ids].reshape(-1, 3, 3)
        self.positions[:] = data.xpos[self._mj_ids]
        self.quaternions[:] = data.xquat[self._mj_ids]
        self._cache.clear()

    def poses(self) -> bytes:
        """Little-endian float32, seven per body: position [m], quaternion w first."""
        return np.hstack([self.positions, self.quaternions]).astype("<f4").tobytes()

    # -- what may be relied on --------------------------------------------------------------

    def require(self, *names: str) -> None:
        """Raise `Undecided` unless each robot or human is where the twin shows it."""
        self.asked.update(names)
        for name in names:
            key = ("doubt", name)
            reason = self._cache.get(key)
            if reason is None:
                reason = self._cache[key] = self.doubt(name)
            if reason:
                raise Undecided(reason)

    def doubt(self, name: str) -> str:
        """Why a twin may not be where the real one is; empty when it may be relied on."""
        hearing = self.hearings[name]
        reason = hearing.doubt(self.t)
        if reason:
            return f"{name}: {reason}"
        if hearing.lost > self.t - 2 * self._period:
            return f"{name}: the physics could not follow what was heard"
        if hearing.error > self._tracking_limit:
            why = " (a torque limit is reached)" if hearing.saturated else ""
            return (
                f"{name}: the twin is off by {hearing.error:.3g} rad or m, "
                f"more than {self._tracking_limit:g}{why}"
            )
        return ""

    # -- joints -----------------------------------------------------------------------------

    def q(self, mechanism: Mechanism) -> Array:
        """Joint positions of the twin [rad or m], shape (n,)."""
        self.require(mechanism.name)
        return self.joint_positions(mechanism)

    def joint_positions(self, mechanism: Mechanism) -> Array:
        """The same without asking whether it was heard: for the picture, never for a verdict."""
        return np.asarray(self.data.qpos[mechanism.q_address[mechanism.own]])

    def qd(self, mechanism: Mechanism) -> Array:
        """Joint velocities of the twin [rad/s or m/s], shape (n,)."""
        self.require(mechanism.name)
        return np.asarray(self.data.qvel[mechanism.v_address[mechanism.own]])

    def measured_torques(self, mechanism: Mechanism) -> Array:
        """Joint torques that its source measured, between samples as positions are [N·m or N], shape (n,).

        Raises:
            Undecided: Not heard, or heard without torques.
        """
        self.require(mechanism.name)
        hearing = self.hearings[mechanism.name]
        k = sum(1 for instant, _ in hearing.heard if instant <= self.t + SLACK)
        times = [instant for instant, _ in hearing.heard[max(k - 1, 0) : k + 1]]
        around = [torques for torques in hearing.torques[max(k - 1, 0) : k + 1] if torques is not None]
        if not around or len(around) < len(times):
            raise Undecided(f"{mechanism.name}: its source measures no joint torques")
        # Outside its range np.interp holds the last value, as the reference does.
        return np.array([np.interp(self.t, times, joint) for joint in np.transpose(around)])

    # -- dynamics ---------------------------------------------------------------------------

    def mass_matrix(self, mechanism: Mechanism) -> Array:
        """Joint-space mass matrix M(q) with tools and workpieces [kg·m², kg·m or kg], shape (n, n).

        Raises:
            Undecided: A mass that nobody gave.
        """
        self.require(mechanism.name)
        if mechanism.unknown_masses:
            raise Undecided("; ".join(mechanism.unknown_masses))
        key = ("M", mechanism.name)
        if key not in self._cache:
            if "M" not in self._cache:
                mujoco.mj_makeM(self.model.mj, self.data)
                mujoco.mj_fullM(self.model.mj, self.data, self._full_mass_matrix)
                self._cache["M"] = self._full_mass_matrix
            block = self._full_mass_matrix[np.ix_(mechanism.v_address, mechanism.v_address)]
            self._cache[key] = mechanism.coupling.T @ block @ mechanism.coupling
        return np.asarray(self._cache[key])

    # -- kinematics -------------------------------------------------------------------------

    def pose(self, frame: Frame) -> tuple[Array, Array]:
        """World rotation (3, 3) and position (3,) [m] of a frame."""
        rotation = self.data.xmat[frame.mj].reshape(3, 3)
        position = self.data.xpos[frame.mj] + rotation @ frame.body_from_frame[:3, 3]
        return rotation @ frame.body_from_frame[:3, :3], position

    def jacobian(self, frame: Frame, mechanism: Mechanism, offset: Array | None = None) -> Array:
        """Jacobian of a point of a frame, linear rows first, world axes, shape (6, n).

        Args:
            frame: The frame.
            mechanism: Whose joints the columns are.
            offset: The point in the frame [m], shape (3,); its origin when not given.
        """
        self.require(mechanism.name)
        # Not its name: a tool's working point is called like the tool.
        key = ("J", id(frame), mechanism.name, None if offset is None else offset.tobytes())
        if key not in self._cache:
            rotation, position = self.pose(frame)
            if offset is not None:
                position = position + rotation @ offset
            mujoco.mj_jac(self.model.mj, self.data, self._jacp, self._jacr, position, frame.mj)
            every = np.vstack([self._jacp, self._jacr])[:, mechanism.v_address]
            self._cache[key] = every @ mechanism.coupling
        return np.asarray(self._cache[key])

    def body_velocity(self, index: int) -> tuple[Array, Array]:
        """Linear velocity at its origin [m/s] and angular velocity [rad/s] of a body, world axes."""
        self._require_carrier(index)
        linear, angular = self._velocities()
        return linear[index], angular[index]

    def _require_carrier(self, index: int) -> None:
        carrier = self.model.bodies[index].carrier
        if carrier:
            self.require(carrier)

    def _velocities(self) -> tuple[Array, Array]:
        """Linear and angular velocities of all bodies at their origins, shape (n, 3) each."""
        if "v" not in self._cache:
            twist = self.data.cvel[self._mj_ids]
            # MuJoCo's twists are rotation first, and at the centre of mass of the whole tree.
            arm = self.positions - self.data.subtree_com[self._mj_roots]
            angular = np.ascontiguousarray(twist[:, :3])
            self._cache["v"] = twist[:, 3:] + np.cross(angular, arm), angular
        linear, angular = self._cache["v"]
        return linear, angular

    def fastest_point(self, index: int) -> tuple[float, Array, Array]:
        """Bound on the speed of any point of a body, and the point where it is largest.

        Its real surface may lie `Body.deviation` outside its shape; that is in the bound.

        Returns:
            Speed [m/s], the corner in the world [m] (3,), its velocity [m/s] (3,).
        """
        self._require_carrier(index)
        if "fastest" not in self._cache:
            n = len(self.positions)
            speed, point, velocity = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3))
            corners, start = self._corners
            fastest(
                self.rotations, self.positions, *self._velocities(), corners, start, self._reach,
                speed, point, velocity,
            )  # fmt: skip
            self._cache["fastest"] = speed, point, velocity
        speed, point, velocity = self._cache["fastest"]
        return float(speed[index]), point[index], velocity[index]

    # -- distances --------------------------------------------------------------------------

    def closest(self, gap: Gap) -> Closest:
        """Where two sets are nearest."""
        self.require(*gap.carriers)
        key = ("closest", id(gap))
        if key not in self._cache:
            self._cache[key] = gap.query.minimum(self.rotations, self.positions)
        found: Closest = self._cache[key]
        return found

    def closest_per_body(self, gap: Gap) -> Closests:
        """Where each body of ``gap.b`` is nearest to ``gap.a``, in the order of ``gap.b``."""
        self.require(*gap.carriers)
        key = ("closest per body", id(gap))
        if key not in self._cache:
            self._cache[key] = gap.query.per_body(self.rotations, self.positions)
        found: Closests = self._cache[key]
        return found
