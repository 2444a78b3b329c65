r"""What the moving parts of a robot do during the reaction time, before it begins to brake.

Nothing says that the robot keeps its speed until then, so ISO/TS 15066:2016 5.5.4.2.3 has integrals:

.. math:: S_r = \int_{t_0}^{t_0 + T_r} v_r \, dt, \qquad v_s = \max_{t_0 \le t \le t_0 + T_r} v_r(t)

with v_s the speed at which braking begins, at whatever instant up to T_r that is. What v_r does is known of
a motion that is known ahead; else it is bounded by an acceleration a of the parts, as
:math:`v_r + a t`, or by accelerations :math:`\ddot q_j` of the joints. Neither S_r nor v_s is ever less than
with the present speed held, :math:`v_r T_r` and :math:`v_r`.

With joints at speeds up to :math:`u_j` the speed of a point changes by at most (see
`seerob.session.permissible.moving_joints`)

.. math:: A = \sum_j \ddot q_j w_j + \sum_j u_j \big(2 \Omega_{<j} w_j + \sum_{i \ge j} u_i w_i\big)

in each second, and is at most :math:`\sum_j u_j w_j`.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.domains import at_least, number
from seerob.core.errors import Undecided
from seerob.core.transforms import Array
from seerob.kernels.speed import fastest, placed, stacked, velocities
from seerob.model.model import Body, Gap, Mechanism, Model
from seerob.twin.attachments import Attachments
from seerob.twin.spans import ROUNDING, Knots, Path, Points, rows_of
from seerob.twin.speed_noise import levers as levers_of
from seerob.twin.state import State
from seerob.twin.validity.hearing import SLACK

BEYOND = 0.05
"""Share by which a joint may be faster than its limit without refuting it: noise. Own choice."""
LARGEST_WINDOW = 2.0
"""A motion is looked at so far ahead at most [s]."""


@dataclass(frozen=True, eq=False)
class Onset:
    """From now to the beginning of braking; n parts, j joints of the robot."""

    v_r: Array
    """Speed now [m/s], shape (n,)."""
    S_r: Array
    """Way until then [m], shape (n,)."""
    v_s: Array
    """Largest speed until then [m/s], shape (n,)."""
    ways: Array | None
    """How far each joint turns or slides until then [rad or m], shape (j,); None where nobody knows."""
    speeds: Array | None
    """Its largest speed until then [rad/s or m/s], shape (j,)."""
    q: Array | None = None
    """Where the joints are at the ticks until then, of a motion that is known [rad or m], shape (m, j)."""
    qd: Array | None = None
    """How fast they are there [rad/s or m/s], likewise."""
    unbounded_reason: str = ""
    """Why it may be more than this."""
    linear: bool = True
    """Whether way and speed grow linearly with the factor on the present speeds."""


def shaken(onset: Onset, v: Array, qd: Array, T_r: float) -> Onset:
    """Widen an onset by how far speeds may be off that were derived from noisy positions.

    Args:
        onset: Of the speeds as they were derived.
        v: How far those of the parts may be off, all the time until braking [m/s], shape (n,).
        qd: Likewise of the joints [rad/s or m/s], shape (j,).
        T_r: Reaction time [s].
    """
    ways = None if onset.ways is None else onset.ways + qd * T_r
    speeds = None if onset.speeds is None else onset.speeds + qd
    return replace(onset, S_r=onset.S_r + v * T_r, v_s=onset.v_s + v, ways=ways, speeds=speeds)


At = Callable[[float], Onset]
"""With all present speeds multiplied by a factor."""
Reaction = Callable[[State], At]
"""May raise `Undecided`: who it speaks of was not heard."""


def held(v: Array, T_r: float, qd: Array, unbounded_reason: str = "") -> Onset:
    """At the present speeds.

    Args:
        v: Of the parts [m/s], shape (n,).
        T_r: Reaction time [s].
        qd: Of the joints [rad/s or m/s], shape (j,).
        unbounded_reason: Why it may be more.
    """
    speeds = np.abs(qd)
    return Onset(v, v * T_r, v, speeds * T_r, speeds, unbounded_reason=unbounded_reason)


def accelerated(v: Array, T_r: float, a: float, qd: Array) -> Onset:
    """With a constant acceleration of every part; arguments as of `held`, and a [m/s²]."""
    number("a", a, 0.0, unit="m/s²")
    number("T_r", T_r, 0.0, unit="s")
    if a == 0.0:
        return held(v, T_r, qd)
    return Onset(v, v * T_r + a * T_r**2 / 2, v + a * T_r, None, None)


def constant(robot: Mechanism, gap: Gap, T_r: float, a: float, unbounded_reason: str = "") -> Reaction:
    """Every part accelerates by a given figure [m/s²]."""

    def at(state: State) -> At:
        v, qd = state.fastest_points(gap.b)[0], state.qd(robot)
        if unbounded_reason:
            return lambda scale: held(scale * v, T_r, scale * qd, unbounded_reason)
        return lambda scale: accelerated(scale * v, T_r, a, scale * qd)

    return at


# -- a motion that is known ahead ---------------------------------------------------------------


class Foreseen:
    """Speeds of the parts along the motion that a robot is known to make, bounded from tick to tick.

    Between two instants, ticks and knots of its interpolation, it moves along a cubic, on which the largest
    speed of a joint is known and that of a point is bounded (`seerob.kernels.spans`). A reaction that begins
    until the next tick counts like one that begins now, so that S_p of a tick holds until the next. What
    others do that carry it or that it carries is not known ahead: they go on as they do.
    """

    def __init__(self, model: Model, robot: Mechanism, gap: Gap, T_r: float) -> None:
        """Bind.

        Args:
            model: The workstation.
            robot: Who moves.
            gap: Its second set are the moving parts.
            T_r: Reaction time [s].
        """
        self._model, self._robot, self._gap, self._T_r = model, robot, gap, T_r
        self._period = model.workstation.engine.tick
        self._with = (robot.name, *robot.riders, *model.carriers_of(robot.name))
        self._data = mujoco.MjData(model.mj)
        self._bodies = [model.bodies[i] for i in gap.b]
        self._corners = stacked([body.corners for body in self._bodies])
        self._reach = np.array([body.radius + body.deviation for body in self._bodies])
        self._run: Callable[[], State | None] = lambda: None
        self._known: dict[int, _Stretch] = {}
        self._last = -1
        self._points, self._parts = Points(model), rows_of(gap.b)

    def at(self, state: State) -> At | None:
        """None where nobody knows what it will do."""
        period, T_r = self._period, min(self._T_r, LARGEST_WINDOW)
        k, end = math.floor(state.t / period + 1e-6), state.t + T_r + period
        last = math.ceil(end / period - 1e-6)
        # The same instants whenever they are asked for.
        ticks = np.concatenate([[state.t], period * np.arange(k + 1, last + 1)])
        instants = with_knots(state.knots, self._robot.name, ticks)
        foreseen = state.foresee(self._robot.name, instants)
        if foreseen is None:
            return None
        q, qd, unbounded_reason = foreseen
        if self._T_r > LARGEST_WINDOW:
            unbounded_reason = unbounded_reason or f"a motion is looked at {LARGEST_WINDOW:g} s ahead at most"
        if self._run() is not state or k < self._last:
            self._run, self._known = weakref.ref(state), {}
        self._last = k
        for old in [i for i in self._known if i < k - 1]:
            del self._known[old]
        v_now, qd_now = state.fastest_points(self._gap.b)[0], np.abs(state.qd(self._robot))
        rows = np.searchsorted(instants, ticks)
        told: list[Array] = []
        turning: list[Array] = []
        for i, (a, b) in enumerate(pairwise(rows.tolist())):
            t, at_q, at_qd = (each[a : b + 1] for each in (instants, q, qd))
            known = self._known.get(k + i)
            if known is None or not known.same(at_q, at_qd):
                before = self._known.get(k + i - 1)
                known = self._known[k + i] = self._stretch(state, t, at_q, at_qd, before)
            # Of a motion that may be another one, or jumps, nothing is known between instants.
            told.append(known.ends if unbounded_reason else known.most)
            turning.append(known.joint_ends if unbounded_reason else known.joints)
        v, joints = np.concatenate(told), np.concatenate(turning)
        # A twin that does not stand exactly where the motion has it may be faster now.
        v[0], joints[0] = np.maximum(v[0], v_now), np.maximum(joints[0], qd_now)
        left = np.minimum(instants - state.t, T_r + period)
        S_r, ways = (
            np.maximum(farthest(left, each, self._T_r, period), now * self._T_r)
            for each, now in ((v, v_now), (joints, qd_now))
        )
        v_s, speeds = v.max(axis=0), joints.max(axis=0)
        # A simulated stop goes by the ticks.
        m = math.ceil(T_r / period - 1e-6)
        q, qd = q[rows[1:]], qd[rows[1:]]

        def at(scale: float) -> Onset:
            return Onset(
                scale * v_now,
                scale * S_r,
                scale * v_s,
                scale * ways,
                scale * speeds,
                q[:m] if scale == 1.0 else None,
                qd[:m] if scale == 1.0 else None,
                unbounded_reason,
            )

        return at

    def _stretch(self, state: State, t: Array, q: Array, qd: Array, before: _Stretch | None) -> _Stretch:
        """What bounds it from tick to tick, with the robot elsewhere than now and all others as they are.

        Args:
            state: The twin.
            t: Both ticks and the knots between them [s], shape (m,).
            q: Positions of its joints there [rad or m], shape (m, j).
            qd: Velocities there, shape (m, j).
            before: What bounds it until then, when that is known.
        """
        first = before is not None and before.same(q[:1], qd[:1], last=True)
        speeds = [before.last if before is not None and first else self._speeds(state, q[0], qd[0])]
        speeds += [self._speeds(state, *each) for each in zip(q[1:], qd[1:], strict=True)]
        robot, now = self._robot, state.data_of(*self._with)
        every_v = np.tile(now.qvel, (len(t), 1))
        every_q = np.tile(now.qpos, (len(t), 1))
        for mechanism in state.model.mechanisms.values():
            # Who goes on as they do is where that brings them: all of their joints turn or slide.
            at = mechanism.q_address
            every_q[:, at] = now.qpos[at] + (t - t[0])[:, None] * now.qvel[mechanism.v_address]
        every_q[:, robot.q_address] = q @ robot.coupling.T + robot.offset
        every_v[:, robot.v_address] = qd @ robot.coupling.T
        ends = np.maximum(speeds[:-1], speeds[1:])
        path, most = Path(t, every_q, every_v), []
        for i, (a, b) in enumerate(pairwise(t.tolist())):
            span = self._points.span(path, a, b, state.attachments.ids, state.model.mj)
            # Along the straight line between two velocities no speed is larger than at both ends.
            bound = np.minimum(span.fast[self._parts], ends[i] + span.bend[self._parts]) + ROUNDING
            most.append(np.maximum(bound, ends[i]))
        joint_ends = np.maximum(np.abs(qd[:-1]), np.abs(qd[1:]))
        return _Stretch(
            q, qd, np.array(most), ends, speeds[-1], largest_between(t, q, qd), joint_ends, _bits(q, qd)
        )

    def _speeds(self, state: State, q: Array, qd: Array) -> Array:
        """Of the parts [m/s], shape (n,), with the robot elsewhere than now and all others as they are."""
        mj, data, robot = state.model.mj, self._data, self._robot
        now = state.data_of(*self._with)
        data.qpos[:], data.qvel[:] = now.qpos, now.qvel
        data.qpos[robot.q_address] = robot.coupling @ q + robot.offset
        data.qvel[robot.v_address] = robot.coupling @ qd
        mujoco.mj_kinematics(mj, data)
        mujoco.mj_comPos(mj, data)
        mujoco.mj_comVel(mj, data)
        return speeds_of(data, state.attachments, self._gap.b, self._corners, self._reach)


@dataclass(frozen=True, eq=False)
class _Stretch:
    """From tick to tick of a motion that is known; m instants, n parts, j joints."""

    q: Array
    """Shape (m, j)."""
    qd: Array
    most: Array
    """Largest speed of each part from instant to instant [m/s], shape (m - 1, n)."""
    ends: Array
    """The larger of its speeds at both [m/s], shape (m - 1, n)."""
    last: Array
    """Speed of each part at the last instant [m/s], shape (n,)."""
    joints: Array
    """Largest speed of each joint from instant to instant [rad/s or m/s], shape (m - 1, j)."""
    joint_ends: Array
    """The larger of its speeds at both, likewise."""
    bits: bytes
    """Of ``q`` and ``qd``."""

    def same(self, q: Array, qd: Array, *, last: bool = False) -> bool:
        """Whether it is of these joint positions and velocities; its ``last`` alone when so asked."""
        own = _bits(self.q[-1:], self.qd[-1:]) if last else self.bits
        return own == _bits(q, qd)


def _bits(q: Array, qd: Array) -> bytes:
    return bytes(q.tobytes() + qd.tobytes())


def with_knots(knots: Knots, name: str, ticks: Array) -> Array:
    """Ticks, and the knots between them of what a robot is known to do [s], increasing."""
    between = np.array([*knots(name, float(ticks[0]), float(ticks[-1]))], float)
    own = np.abs(between[:, None] - ticks).min(axis=1) > SLACK
    return np.unique(np.concatenate([ticks, between[own]]))


def largest_between(t: Array, q: Array, qd: Array) -> Array:
    """Largest speed of joints on each cubic from instant to instant [rad/s or m/s], shape (k - 1, j).

    Args:
        t: Instants, increasing [s], shape (k,).
        q: Positions there [rad or m], shape (k, j).
        qd: Velocities there, shape (k, j).
    """
    T, chord = np.diff(t)[:, None], np.diff(q, axis=0)
    c_1, last = T * qd[:-1], T * qd[1:]
    c_2, c_3 = 3 * chord - 2 * c_1 - last, c_1 + last - 2 * chord
    x = np.clip(-c_2 / np.where(c_3 == 0.0, np.inf, 3 * c_3), 0.0, 1.0)
    peak = np.abs(c_1 + x * (2 * c_2 + x * 3 * c_3)) / T
    return np.asarray(np.maximum(peak, np.maximum(np.abs(qd[:-1]), np.abs(qd[1:]))))


def farthest(t: Array, most: Array, T_r: float, lead: float) -> Array:
    """Bound on the way in any stretch of T_r that begins within ``lead`` [m or rad], shape (...).

    Args:
        t: Instants from now to ``T_r + lead`` [s], shape (k,).
        most: Largest speeds from instant to instant, shape (k - 1, ...).
        T_r: [s]
        lead: [s]
    """
    number("T_r", T_r, 0.0, unit="s")
    number("lead", lead, 0.0, unit="s")
    steps = np.diff(t)
    # What lies outside of the stretch is at its ends.
    ends = most[(t[:-1] < lead - SLACK) | (t[1:] > T_r + SLACK)].min(axis=0)
    return np.asarray(np.maximum(steps @ most - lead * ends, 0.0), float)


def speeds_of(
    data: mujoco.MjData,
    attachments: Attachments,
    bodies: Sequence[int],
    corners: tuple[Array, NDArray[np.int64]],
    reach: Array,
) -> Array:
    """Speed of the fastest point of bodies [m/s], shape (n,).

    Args:
        data: Where everybody is, with MuJoCo's velocities.
        attachments: Who moves whom.
        bodies: By index.
        corners: Of the bodies, `seerob.kernels.speed.stacked`.
        reach: How far their surfaces are outside the hull of these [m], shape (n,).
    """
    n = len(bodies)
    rows = np.array(bodies, np.int64)
    ids, roots = attachments.ids[rows], attachments.roots[rows]
    rotations, positions, quaternions = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 4))
    placed(data.xmat, data.xpos, data.xquat, ids, rotations, positions, quaternions)
    linear, angular = np.empty((2, n, 3))
    velocities(data.cvel, data.subtree_com, positions, ids, roots, linear, angular)
    speed, point, velocity = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3))
    fastest(rotations, positions, linear, angular, *corners, reach, speed, point, velocity)
    return speed


# -- accelerations of the joints ----------------------------------------------------------------


class KinematicChain(NamedTuple):
    """The k joints of a robot that move a part, from the base outward."""

    turns: NDArray[np.bool_]
    """Which turn; the others slide."""
    rows: NDArray[np.int64]
    """Of the robot's coupling."""
    levers: Array
    """Largest distance of the part from each axis now [m]; of no meaning for joints that slide."""


class Levers:
    """How far the parts of a robot reach from the joints that move them.

    Args:
        model: The workstation.
        robot: The robot.
        gap: Its second set are the moving parts.
    """

    def __init__(self, model: Model, robot: Mechanism, gap: Gap) -> None:
        kinds = model.mj.jnt_type[model.mj.dof_jntid[robot.v_address]]
        turns = kinds == mujoco.mjtJoint.mjJNT_HINGE
        rows = [_chain(model, robot, model.bodies[i]) for i in gap.b]
        self._chains = [(index, turns[row], row) for index, row in zip(gap.b, rows, strict=True)]
        self._robot, self._model = robot, model

    def at(self, state: State) -> list[KinematicChain]:
        """Of every part, now."""
        return [KinematicChain(t, rows, _levers(state, self._robot, rows, i)) for i, t, rows in self._chains]

    def placed(self, data: mujoco.MjData) -> list[KinematicChain]:
        """Of every part, where data with kinematics have it; of those that nobody picks up."""
        found = []
        for i, turns, rows in self._chains:
            body = self._model.bodies[i]
            R, x = data.xmat[body.mj].reshape(3, 3), data.xpos[body.mj]
            joints = self._model.mj.dof_jntid[self._robot.v_address[rows]]
            found.append(KinematicChain(turns, rows, levers_of(data, joints, body, R, x)))
        return found


def _chain(model: Model, robot: Mechanism, body: Body) -> NDArray[np.int64]:
    """Joints of a robot that move a body, from the base outward, as rows of its coupling, shape (k,)."""
    found: list[int] = []
    at = body.mj
    while at:
        here = [row for row, dof in enumerate(robot.v_address) if model.mj.dof_bodyid[dof] == at]
        found = here + found
        at = int(model.mj.body_parentid[at])
    return np.array(found, np.int64)


def _levers(state: State, robot: Mechanism, chain: NDArray[np.int64], index: int) -> Array:
    """Largest distance of a body from each axis of its chain [m], shape (k,)."""
    body = state.model.bodies[index]
    if index in state.attachments.away:
        return np.zeros(len(chain))
    joints = state.model.mj.dof_jntid[robot.v_address[chain]]
    R, x = state.placed((index,))
    return levers_of(state.data_of(robot.name), joints, body, R[index], x[index])


def by_joints(
    v: Array,
    T_r: float,
    qd: Array,
    qdd: Array,
    largest: Array,
    coupling: Array,
    chains: Sequence[KinematicChain],
    lead: float = 0.0,
) -> Onset:
    """Bound with joints that accelerate, for a reaction that begins within ``lead`` [s].

    Args:
        v: Speeds of the parts [m/s], shape (n,).
        T_r: Reaction time [s].
        qd: Speeds of the joints [rad/s or m/s], shape (j,).
        qdd: Largest accelerations, shape (j,).
        largest: Largest speeds, inf where there is no limit, shape (j,).
        coupling: All joints from these, shape (m, j).
        chains: Of each part.
        lead: [s].
    """
    now = np.abs(qd)
    T, gained = T_r + lead, T_r**2 / 2 + lead * T_r
    # A limit that the joint is beyond is none.
    most = np.where(now > (1 + BEYOND) * largest, np.inf, np.maximum(largest, now))
    u = np.minimum(now + qdd * T, most)
    ways = np.minimum(now * T_r + qdd * gained, u * T_r)
    every_u, every_way, every_a = (np.abs(coupling) @ each for each in (u, ways, qdd))
    S_r, v_s = np.empty_like(v), np.empty_like(v)
    for i, (turns, rows, levers) in enumerate(chains):
        uj, wj, aj = every_u[rows], every_way[rows], every_a[rows]
        weight, outward, way = np.ones(len(rows)), 0.0, 0.0
        for k in range(len(rows) - 1, -1, -1):
            if turns[k]:
                weight[k] = levers[k] + outward
            # How far it is carried until the end of the last such reaction, and within one.
            outward += float(min(uj[k] * T, wj[k] + uj[k] * lead) * weight[k])
            way += float(wj[k] * weight[k])
        spin = np.where(turns, uj, 0.0)
        before = np.cumsum(spin) - spin
        onward = np.cumsum((uj * weight)[::-1])[::-1]
        A = float((aj * weight + uj * np.where(turns, 2 * before * weight + onward, 2 * before)).sum())
        v_s[i] = max(min(v[i] + A * T, float((uj * weight).sum())), v[i])
        S_r[i] = max(min(v[i] * T_r + A * gained, way), v[i] * T_r)
    return Onset(v, S_r, v_s, ways, u, linear=False)


def from_torques(M: Array, bias: Array, torques: Array) -> Array:
    r"""Largest accelerations of joints with limited torques, :math:`|M^{-1}| (\tau + |c + g|)`.

    Args:
        M: Mass matrix, shape (j, j).
        bias: Torques of gravity and of the motion, shape (j,) [N·m or N].
        torques: Limits, shape (j,).
    """
    torques = at_least("torques", torques, unit="N·m or N")
    try:
        return np.asarray(np.abs(np.linalg.inv(M)) @ (torques + np.abs(bias)))
    except np.linalg.LinAlgError as error:
        raise Undecided("the mass matrix is singular") from error
