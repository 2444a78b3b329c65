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
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from msgspec import Struct
from msgspec.structs import replace
from numpy.typing import NDArray

from seerob.core.domains import agree, number
from seerob.core.transforms import Array
from seerob.kernels import ahead as kernel
from seerob.kernels.ahead import joint_speeds, kept, part_speeds
from seerob.kernels.speed import by_coordinate, fastest_of
from seerob.model.model import Body, Gap, Mechanism, Model
from seerob.twin.spans import ROUNDING, Chains, Knots, Points, rows_of
from seerob.twin.speed_noise import levers as levers_of
from seerob.twin.state import State
from seerob.twin.validity.hearing import SLACK

BEYOND = 0.05
"""Share by which a joint may be faster than its limit without refuting it: noise. Own choice."""
LARGEST_WINDOW = 2.0
"""A motion is looked at so far ahead at most [s]."""
MOST, ENDS = 0, 1
"""Of bounds from instant to instant: the largest, and the larger of both instants."""

Indices = NDArray[np.int64]


class Onset(Struct, frozen=True, eq=False):
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


def by_speed(T_r: float, a: float) -> Callable[[Array], Onset]:
    """`accelerated`, of the speeds of parts [m/s] (n,) alone; arguments as there."""
    none = np.zeros(0)
    gained, faster = accelerated(none, T_r, a, none), a * T_r
    if a == 0.0:
        return lambda v: Onset(v, v * T_r, v, gained.ways, gained.speeds)
    way = a * T_r**2 / 2
    return lambda v: Onset(v, v * T_r + way, v + faster, None, None)


def constant(robot: Mechanism, gap: Gap, T_r: float, a: float, unbounded_reason: str = "") -> Reaction:
    """Every part accelerates by a given figure [m/s²]."""

    def at(state: State) -> At:
        v, qd = state.fastest_speeds(gap.b), state.qd(robot)
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
    others do that carry it or that it carries is not known ahead: they go on as they do. What was found of a
    tick is kept as long as the motion there stays what it was.
    """

    def __init__(self, model: Model, robot: Mechanism, gap: Gap, T_r: float, *, joints: bool) -> None:
        """Bind.

        Args:
            model: The workstation.
            robot: Who moves.
            gap: Its second set are the moving parts.
            T_r: Reaction time [s].
            joints: Whether what the joints do is asked for, too.
        """
        number("T_r", T_r, 0.0, unit="s")
        self._robot, self._gap, self._T_r, self._joints_asked = robot, gap, T_r, joints
        self._period = model.workstation.engine.tick
        self._with = (robot.name, *robot.riders, *model.carriers_of(robot.name))
        self._data = data = mujoco.MjData(model.mj)
        # To ask the data for them takes longer than to use them.
        self._views = data.qpos, data.qvel, data.xmat, data.xpos, data.cvel, data.subtree_com
        bodies = [model.bodies[i] for i in gap.b]
        self._corners = by_coordinate([body.corners for body in bodies])
        self._reach = np.array([body.radius + body.deviation for body in bodies])
        self._points, self._parts, self._joints = Points(model), rows_of(gap.b), _Joints()
        self._run: Callable[[], State | None] = lambda: None
        self._window: _Window | None = None

    def at(self, state: State) -> At | None:
        """None where nobody knows what it will do."""
        period, T_r, name, t = self._period, min(self._T_r, LARGEST_WINDOW), self._robot.name, state.t
        k = math.floor(t / period + 1e-6)
        # The same instants whenever they are asked for.
        last = math.ceil((t + T_r + period) / period - 1e-6)
        instants, rows = with_knots(state.knots, name, t, k, last, period)
        foreseen = state.foresee(name, instants)
        if foreseen is None:
            return None
        q, qd, unbounded_reason = foreseen
        if self._T_r > LARGEST_WINDOW:
            unbounded_reason = unbounded_reason or f"a motion is looked at {LARGEST_WINDOW:g} s ahead at most"
        known = self._known(state, k, rows, instants, q, qd)
        v_now = state.fastest_speeds(self._gap.b)
        # Of a motion that may be another one, or jumps, nothing is known between instants.
        side = ENDS if unbounded_reason else MOST
        # A twin that does not stand exactly where the motion has it may be faster now.
        stretch = t, T_r + period
        S_r, v_s = _farthest(instants, stretch, known.parts[:, side], v_now, self._T_r, period)
        if not self._joints_asked:
            points = Onset(v_now, S_r, v_s, None, None, unbounded_reason=unbounded_reason)
            return lambda scale: (
                points
                if scale == 1.0
                else replace(points, v_r=scale * v_now, S_r=scale * S_r, v_s=scale * v_s)
            )
        qd_now = np.abs(state.qd(self._robot))
        ways, speeds = _farthest(instants, stretch, known.joints[:, side], qd_now, self._T_r, period)
        # A simulated stop goes by the ticks.
        later = rows[1 : 1 + math.ceil(T_r / period - 1e-6)]
        now = Onset(v_now, S_r, v_s, ways, speeds, q[later], qd[later], unbounded_reason)

        def at(scale: float) -> Onset:
            if scale == 1.0:
                return now
            return Onset(
                scale * v_now, scale * S_r, scale * v_s, scale * ways, scale * speeds,
                unbounded_reason=unbounded_reason,
            )  # fmt: skip

        return at

    def _known(self, state: State, k: int, rows: Indices, t: Array, q: Array, qd: Array) -> _Window:
        """Bounds of all ticks from tick k on, as they were found where the motion is still the same.

        Args:
            state: The twin.
            k: Number of the first tick.
            rows: Which instants are ticks, shape (s + 1,).
            t: Ticks, and the knots between them [s], shape (m,).
            q: Positions of the robot's joints there [rad or m], shape (m, j).
            qd: Velocities there, shape (m, j).
        """
        now = _Window.of(k, rows, np.ascontiguousarray(q), np.ascontiguousarray(qd), len(self._parts))
        before = self._window
        if before is None or self._run() is not state or k < before.first:
            missing = list(range(len(now.last)))
        else:
            shift = k - before.first
            now.behind = before.end(shift - 1) if shift else before.behind
            same = np.empty(len(now.last), bool)
            found = kept(shift, *before.arrays, *now.arrays, same) == 0
            missing = [] if found else [i for i, known in enumerate(same.tolist()) if not known]
        if missing:
            data = state.data_of(*self._with)
            self._joints.follow(self._points, self._parts, self._robot, state)
            for i in missing:
                self._find(state, data, now, i, t)
        if self._run() is not state:
            self._run = weakref.ref(state)
        self._window = now
        return now

    def _find(self, state: State, now: mujoco.MjData, window: _Window, i: int, t: Array) -> None:
        """Bound the speeds from a tick to the next, with all others as they are or go on.

        Args:
            state: The twin.
            now: Where all are.
            window: All that comes before is known.
            i: Which tick.
            t: All instants of the window [s], shape (m,).
        """
        a, b = int(window.rows[i]), int(window.rows[i + 1])
        t, q, qd = t[a : b + 1], window.q[a : b + 1], window.qd[a : b + 1]
        joints, chains = self._joints, self._joints.chains
        speeds = np.empty((len(t), len(self._parts)))
        before, first = window.end(i - 1) if i else window.behind, 0
        if before is not None and _bits(before.q, before.qd) == _bits(q[0], qd[0]):
            speeds[0], first = before.speeds, 1
        for row in range(first, len(t)):
            self._speeds(state, now, q[row], qd[row], speeds[row])
        all_q, all_v = joints.motion(self._robot, now, t, q, qd)
        part_speeds(
            t, all_q, all_v, speeds, joints.home,
            chains.start, chains.joints, chains.turns, chains.lengths, ROUNDING, window.parts[a:b],
        )  # fmt: skip
        if self._joints_asked:
            joint_speeds(t, q, qd, window.joints[a:b])
        window.last[i] = speeds[-1]

    def _speeds(self, state: State, now: mujoco.MjData, q: Array, qd: Array, speeds: Array) -> None:
        """Of the parts [m/s], into the last argument (n,), with the robot elsewhere and all others as now."""
        mj, data, robot, joints = state.model.mj, self._data, self._robot, self._joints
        qpos, qvel, xmat, xpos, cvel, com = self._views
        if not joints.alone:
            qpos[:], qvel[:] = now.qpos, now.qvel
        if joints.direct:
            qpos[robot.q_address], qvel[robot.v_address] = q, qd
        else:
            qpos[robot.q_address] = robot.coupling @ q + robot.offset
            qvel[robot.v_address] = robot.coupling @ qd
        mujoco.mj_kinematics(mj, data)
        mujoco.mj_comPos(mj, data)
        mujoco.mj_comVel(mj, data)
        fastest_of(xmat, xpos, cvel, com, joints.ids, joints.roots, *self._corners, self._reach, speeds)


class _End(NamedTuple):
    """Where a tick of a window ends."""

    q: Array
    qd: Array
    speeds: Array
    """Of the parts [m/s], shape (n,)."""


@dataclass(eq=False)
class _Window:
    """What is known of a motion from a tick on; s ticks, m instants, n parts, j joints."""

    first: int
    """Number of the first tick."""
    rows: Indices
    """Which instants are ticks, shape (s + 1,)."""
    q: Array
    """Positions of the joints [rad or m], shape (m, j)."""
    qd: Array
    """Their velocities [rad/s or m/s], likewise."""
    parts: Array
    """Largest speed of each part from instant to instant, and the larger of both instants [m/s], shape
    (m - 1, 2, n)."""
    joints: Array
    """Those of each joint, likewise [rad/s or m/s], shape (m - 1, 2, j)."""
    last: Array
    """Speed of each part at the end of each tick [m/s], shape (s, n)."""
    behind: _End | None = None
    """Of the tick before the first, when that is known."""

    @classmethod
    def of(cls, first: int, rows: Indices, q: Array, qd: Array, n: int) -> _Window:
        """With nothing known yet."""
        m, j = q.shape
        bounds = np.empty((m - 1, 2, n)), np.empty((m - 1, 2, j))
        return cls(first, rows, q, qd, *bounds, np.empty((len(rows) - 1, n)))

    @property
    def arrays(self) -> tuple[Indices, Array, Array, Array, Array, Array]:
        """All of them, as `seerob.kernels.ahead.kept` takes them."""
        return self.rows, self.q, self.qd, self.parts, self.joints, self.last

    def end(self, i: int) -> _End | None:
        """Of a tick; None where there is none."""
        if not 0 <= i < len(self.last):
            return None
        row = self.rows[i + 1]
        return _End(self.q[row], self.qd[row], self.last[i])


class _Joints:
    """All joints that move some parts of a robot, its own and those of whom it rides on.

    Attributes:
        chains: Of the parts.
        home: Positions of the joints in the model as compiled, shape (d,).
        ids: MuJoCo's body of each part, shape (n,).
        roots: The first body of its tree, likewise.
        direct: Whether each joint of the robot is commanded itself.
        alone: Whether nothing but such joints of the robot moves the parts.
    """

    chains: Chains
    home: Array
    ids: Indices
    roots: Indices
    direct: bool
    alone: bool

    def __init__(self) -> None:
        self._attached = b""

    def follow(self, points: Points, parts: Indices, robot: Mechanism, state: State) -> None:
        """Resolve who moves whom now, where that is not as it was."""
        ids = state.attachments.ids
        attached = ids.tobytes()
        if self._attached == attached:
            return
        self._attached = attached
        self.ids, self.roots = ids[parts], state.attachments.roots[parts]
        self.chains = points.chains(parts, ids, state.model.mj)
        self.home = state.model.mj.qpos0[self.chains.dofs]
        dofs = self.chains.dofs.tolist()
        own = {dof: column for column, dof in enumerate(robot.v_address.tolist())}
        others = (m for m in state.model.mechanisms.values() if m is not robot)
        going = {dof for other in others for dof in other.v_address.tolist()}
        self.direct = (
            np.array_equal(robot.coupling, np.eye(len(robot.v_address))) and not np.any(robot.offset)
        )  # fmt: skip
        self.alone = self.direct and dofs == robot.v_address.tolist()
        self._own = np.array([i for i, dof in enumerate(dofs) if dof in own], np.int64)
        self._columns = np.array([own[dof] for dof in dofs if dof in own], np.int64)
        self._going = np.array([i for i, dof in enumerate(dofs) if dof in going - own.keys()], np.int64)

    def motion(
        self, robot: Mechanism, now: mujoco.MjData, t: Array, q: Array, qd: Array
    ) -> tuple[Array, Array]:
        """Positions and velocities of all at instants, shape (m, d) each.

        Args:
            robot: Whose own are known.
            now: Where all are at the first instant, but for the robot's.
            t: Instants [s], shape (m,).
            q: Positions of the robot's there [rad or m], shape (m, j).
            qd: Velocities there, shape (m, j).
        """
        if self.alone:
            return q, qd
        dofs = self.chains.dofs
        every_q, every_v = (np.tile(each[dofs], (len(t), 1)) for each in (now.qpos, now.qvel))
        if len(self._going):
            # Who goes on as they do is where that brings them: all of their joints turn or slide.
            every_q[:, self._going] += (t - t[0])[:, None] * every_v[0, self._going]
        every_q[:, self._own] = (q @ robot.coupling.T + robot.offset)[:, self._columns]
        every_v[:, self._own] = (qd @ robot.coupling.T)[:, self._columns]
        return every_q, every_v


def _bits(q: Array, qd: Array) -> bytes:
    return bytes(q.tobytes() + qd.tobytes())


def with_knots(
    knots: Knots, name: str, begin: float, k: int, last: int, period: float
) -> tuple[Array, Indices]:
    """Ticks, and the knots between them of what a robot is known to do [s], increasing; where ticks are.

    Args:
        knots: Tells them.
        name: Of the robot.
        begin: The first tick [s].
        k: Number of the clock's tick that this is, or that is before it.
        last: Number of the last one.
        period: Of the clock [s].
    """
    own = np.asarray(knots(name, begin, float(period * last)), float)
    rows = np.empty(1 + last - k, np.int64)
    found = np.empty(len(rows) + len(own))
    return found[: kernel.instants(begin, k, period, own, SLACK, found, rows)], rows


def largest_between(t: Array, q: Array, qd: Array) -> Array:
    """Largest speed of joints on each cubic from instant to instant [rad/s or m/s], shape (k - 1, j).

    Args:
        t: Instants, increasing [s], shape (k,).
        q: Positions there [rad or m], shape (k, j).
        qd: Velocities there, shape (k, j).
    """
    agree(k=(len(t), len(q), len(qd)), j=(q.shape[1], qd.shape[1]))
    bounds = np.empty((len(t) - 1, 2, q.shape[1]))
    joint_speeds(t, np.ascontiguousarray(q), np.ascontiguousarray(qd), bounds)
    return bounds[:, MOST]


def farthest(t: Array, most: Array, now: Array, T_r: float, lead: float) -> tuple[Array, Array]:
    """Bound the way in any stretch of T_r that begins within ``lead``, and the speed until then.

    Args:
        t: Instants from now to ``T_r + lead`` [s], shape (k,).
        most: Largest speeds from instant to instant, shape (k - 1, n).
        now: Speeds now, which may be larger, shape (n,).
        T_r: [s]
        lead: [s]

    Returns:
        [m or rad, and m/s or rad/s], shape (n,) each.
    """
    number("T_r", T_r, 0.0, unit="s")
    number("lead", lead, 0.0, unit="s")
    agree(k=(len(t), len(most) + 1), n=(most.shape[1], len(now)))
    return _farthest(np.asarray(t, float), (0.0, np.inf), most, now, T_r, lead)


def _farthest(
    t: Array, stretch: tuple[float, float], most: Array, now: Array, T_r: float, lead: float
) -> tuple[Array, Array]:
    """Way and top speed by `farthest`, of instants that count since, and as long as, the stretch says [s]."""
    way, top = np.empty((2, len(now)))
    kernel.farthest(t, *stretch, most, now, T_r, lead, SLACK, way, top)
    return way, top


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
        rows = [chain_of(model, robot, model.bodies[i]) for i in gap.b]
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


def chain_of(model: Model, robot: Mechanism, body: Body) -> NDArray[np.int64]:
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
    qdd: Array | None,
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
        qdd: Largest accelerations, shape (j,); None where a joint may be at its largest speed at once.
        largest: Largest speeds, inf where there is no limit, shape (j,).
        coupling: All joints from these, shape (m, j).
        chains: Of each part.
        lead: [s].
    """
    now = np.abs(qd)
    T, gained = T_r + lead, T_r**2 / 2 + lead * T_r
    # A limit that the joint is beyond is none.
    most = np.where(now > (1 + BEYOND) * largest, np.inf, np.maximum(largest, now))
    at_once = np.maximum(largest, now)
    u = at_once if qdd is None else np.minimum(now + qdd * T, most)
    ways = u * T_r if qdd is None else np.minimum(now * T_r + qdd * gained, u * T_r)
    every_u, every_way, every_a = (
        np.abs(coupling) @ each for each in (u, ways, 0 * u if qdd is None else qdd)
    )
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
        A = math.inf if qdd is None else A
        v_s[i] = max(min(v[i] + A * T, float((uj * weight).sum())), v[i])
        S_r[i] = max(min(v[i] * T_r + A * gained, way), v[i] * T_r)
    return Onset(v, S_r, v_s, ways, u, linear=False)
