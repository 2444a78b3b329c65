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
from typing import NamedTuple

import mujoco
import numpy as np
from msgspec import Struct
from msgspec.structs import replace
from numpy.typing import NDArray

from seerob.core.domains import agree, number
from seerob.core.transforms import Array
from seerob.kernels import ahead as kernel
from seerob.kernels.ahead import PARTS, WINDOW, braking_along, joint_speeds, moved_on, until_braking
from seerob.kernels.pull import instants as instants_of
from seerob.kernels.speed import by_coordinate
from seerob.model.model import Body, Gap, Mechanism, Model
from seerob.twin.moving_base import RESTS
from seerob.twin.mujoco_addresses import POSES, addresses
from seerob.twin.partial_model import partial_model
from seerob.twin.spans import ROUNDING, Knots, Points, rows_of
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
    tick is kept as long as the motion there stays what it was, and so does what they do.
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
        self._ahead = min(T_r, LARGEST_WINDOW)
        self._period = model.workstation.engine.tick
        self._with = (robot.name, *robot.riders, *model.carriers_of(robot.name))
        bodies = [model.bodies[i] for i in gap.b]
        reach = np.array([body.radius + body.deviation for body in bodies])
        self._parts = _Parts(
            model, robot, rows_of(gap.b), (*by_coordinate([b.corners for b in bodies]), reach)
        )
        self._run: Callable[[], State | None] = lambda: None
        self._first = 0
        """Number of the first tick that was asked for last."""
        self._window = _Window(0, 0, len(bodies), len(robot.joints))
        self._no_joints = np.empty((3, 0))

    def at(self, state: State) -> At | None:
        """None where nobody knows what it will do."""
        period, T_r, name, t = self._period, self._ahead, self._robot.name, state.t
        k = math.floor(t / period + 1e-6)
        # The same instants whenever they are asked for.
        last = math.ceil((t + T_r + period) / period - 1e-6)
        beyond = self._T_r > T_r and f"a motion is looked at {LARGEST_WINDOW:g} s ahead at most"
        samples = None if self._joints_asked else state.samples_ahead(name, period * last)
        same: bool | None = None
        if samples is not None:
            table, unbounded_reason = samples
            same = self._others_same(state)
            found = self._along(state, (k, last), table, unbounded_reason or beyond or "", same=same)
            if found is not None:
                return found
        instants, rows = with_knots(state.knots, name, t, k, last, period)
        foreseen = state.foresee(name, instants)
        if foreseen is None:
            return None
        q, qd, unbounded_reason = foreseen
        unbounded_reason = unbounded_reason or beyond or ""
        q, qd = np.ascontiguousarray(q), np.ascontiguousarray(qd)
        same = self._others_same(state) if same is None else same
        self._keep(state, k, rows, q, qd, same=same)
        # A twin that does not stand exactly where the motion has it may be faster now.
        v_now = state.fastest_speeds(self._gap.b)
        points, joints, later = np.empty((3, len(v_now))), self._no_joints, rows[:0]
        points[0] = v_now
        if self._joints_asked:
            qd_now = state.qd(self._robot)
            joints = np.empty((3, len(qd_now)))
            joints[0] = np.abs(qd_now)
            # A simulated stop goes by the ticks.
            later = rows[1 : 1 + math.ceil(T_r / period - 1e-6)]
        # Of a motion that may be another one, or jumps, nothing is known between instants.
        side = ENDS if unbounded_reason else MOST
        until_braking(
            self._parts.table, self._window.table, k, rows, instants, side, self._reaction(t), ROUNDING,
            points, joints,
        )  # fmt: skip

        def onset(scale: float) -> Onset:
            own = points if scale == 1.0 else scale * points
            if joints is self._no_joints:
                return Onset(own[0], own[1], own[2], None, None, unbounded_reason=unbounded_reason)
            each, known = joints, scale == 1.0
            if not known:
                each = scale * joints
            return Onset(
                own[0], own[1], own[2], each[1], each[2],
                q[later] if known else None, qd[later] if known else None, unbounded_reason,
            )  # fmt: skip

        now = onset(1.0)
        return lambda scale: now if scale == 1.0 else onset(scale)

    def _along(
        self, state: State, ticks: tuple[int, int], samples: Indices, unbounded_reason: str, *, same: bool
    ) -> At | None:
        """Do what `at` does of parts alone in one call; None where there is no room for so many instants.

        Args:
            state: The twin.
            ticks: Numbers of the first tick and of the last.
            samples: Those that the motion goes through, a table of `seerob.kernels.pull.KNOTS`.
            unbounded_reason: Why it may be another motion.
            same: As of `_keep`.
        """
        (k, last), run = ticks, self._run() is state
        kept = same and run and k >= self._first
        v_now = state.fastest_speeds(self._gap.b)
        points = np.empty((3, len(v_now)))
        missing = braking_along(
            self._parts.table, self._window.table, samples, kept, k, last, ENDS if unbounded_reason else MOST,
            self._reaction(state.t), ROUNDING, v_now, points,
        )  # fmt: skip
        if missing < 0:
            return None
        if not run:
            self._run = weakref.ref(state)
        self._first = k

        def onset(scale: float) -> Onset:
            v_r, S_r, v_s = points if scale == 1.0 else scale * points
            return Onset(v_r, S_r, v_s, None, None, unbounded_reason=unbounded_reason)

        now = onset(1.0)
        return lambda scale: now if scale == 1.0 else onset(scale)

    def _reaction(self, t: float) -> kernel.Reaction:
        """One that begins until the tick after an instant [s]."""
        return kernel.Reaction(t, self._ahead + self._period, self._T_r, self._period, SLACK)

    def _others_same(self, state: State) -> bool:
        """Whether what others do with its parts is as before, where they are put now."""
        same = self._parts.follow(state)
        if not self._parts.alone:
            same = self._parts.put_others(state.data_of(*self._with)) and same
        return same

    def _keep(self, state: State, k: int, rows: Indices, q: Array, qd: Array, *, same: bool) -> None:
        """Keep what is known of ticks from tick k on, but where the motion is another one.

        Args:
            state: The twin.
            k: Number of the first tick.
            rows: Which instants are ticks, shape (s + 1,).
            q: Positions of the robot's joints at instants [rad or m], shape (m, j).
            qd: Velocities there, shape (m, j).
            same: Whether what others do with its parts is as before, and it moves the same ones: what was
                picked up did not move with it.
        """
        again = self._run() is state
        kept = again and same and k >= self._first
        if moved_on(self._window.table, kept, k, rows, q, qd) < 0:
            instants = int(np.diff(rows).max(initial=1)) + 1
            self._window = _Window(len(rows), instants, len(self._gap.b), q.shape[1])
            moved_on(self._window.table, False, k, rows, q, qd)
        if not again:
            self._run = weakref.ref(state)
        self._first = k


class _Window:
    """A `seerob.kernels.ahead.Window`, bound."""

    def __init__(self, ticks: int, instants: int, parts: int, joints: int) -> None:
        self._arrays = kernel.window(ticks, instants, parts, joints)
        self.table = WINDOW.rows(self._arrays)


class _Parts:
    """Parts of a robot, and all joints that move them, its own and those of whom it rides on.

    Attributes:
        table: Of `seerob.kernels.ahead.Parts`.
        alone: Whether joints of the robot alone move its parts.
    """

    table: Indices
    alone: bool

    def __init__(
        self,
        model: Model,
        robot: Mechanism,
        parts: Indices,
        shapes: tuple[Array, Indices, Array],
    ) -> None:
        """Bind.

        Args:
            model: The workstation.
            robot: Who moves.
            parts: Of all bodies.
            shapes: Corners of the parts, where those of each start, and how far it lies outside, as
                `seerob.kernels.speed.fastest_of` takes them.
        """
        self._robot, self._points, self._rows, self._shapes = robot, Points(model), parts, shapes
        self._mj = model.mj
        self._coupled = np.ascontiguousarray(robot.coupling, float), np.ascontiguousarray(robot.offset, float)
        self._roots = frozenset[int]()
        self._attached = b""

    def _place(self, roots: frozenset[int]) -> None:
        """Have the trees that begin with some of MuJoCo's bodies, and the robot's own, by themselves."""
        robot, mj = self._robot, self._mj
        self._roots = roots | {*mj.body_rootid[mj.dof_bodyid[robot.v_address]].tolist()}
        self._partial = partial = partial_model(mj, np.array(sorted(self._roots)))
        self._data = data = mujoco.MjData(partial.mj)
        for name in POSES:
            getattr(mujoco, name)(partial.mj, data)
        self._moved = data.qpos, data.qvel
        self._own_rows = (
            np.searchsorted(partial.q, robot.q_address),
            np.searchsorted(partial.v, robot.v_address),
        )
        self._others = tuple(
            np.setdiff1d(np.arange(len(every)), own)
            for every, own in zip(self._moved, self._own_rows, strict=True)
        )

    def follow(self, state: State) -> bool:
        """Resolve who moves whom now, where that is not as it was; whether it is."""
        ids, mj, robot = state.attachments.ids, self._mj, self._robot
        attached = ids.tobytes()
        if self._attached == attached:
            return True
        self._attached = attached
        roots = frozenset(mj.body_rootid[ids[self._rows]].tolist())
        if not roots or not roots <= self._roots:
            self._place(roots)
        data, partial = self._data, self._partial
        dofs, chains = self._points.chains(self._rows, ids, mj)
        own = {dof: row for row, dof in enumerate(robot.v_address.tolist())}
        rows = np.array([own.get(dof, -1) for dof in dofs.tolist()], np.int64)
        others = [m.v_address for m in state.model.mechanisms.values() if m is not robot]
        self._bound = kernel.Parts(
            addresses(partial.mj, data, *POSES), data.xmat, data.xpos, data.cvel, data.subtree_com,
            np.searchsorted(partial.bodies, ids[self._rows]),
            np.searchsorted(partial.bodies, state.attachments.roots[self._rows]),
            *self._shapes, mj.qpos0[dofs], chains.start, chains.joints, chains.turns,
            chains.lengths, np.searchsorted(partial.v, dofs), rows,
            np.isin(dofs, np.concatenate([dofs[:0], *others])) & (rows < 0),
            *self._moved, *self._own_rows, *self._coupled,
        )  # fmt: skip
        self.table = PARTS.rows(self._bound)
        direct = np.array_equal(robot.coupling, np.eye(len(robot.v_address))) and not np.any(robot.offset)
        self.alone = direct and dofs.tolist() == robot.v_address.tolist()
        self._beside = np.searchsorted(partial.v, dofs[rows < 0])
        return False

    def put_others(self, now: mujoco.MjData) -> bool:
        """Put all but the robot where they are now; whether those that move its parts go on as before."""
        now_there = now.qpos[self._partial.q], now.qvel[self._partial.v]
        every = tuple(zip(self._moved, now_there, strict=True))
        beside = self._beside
        if all((np.abs(there[beside] - put[beside]) <= RESTS).all() for put, there in every):
            return True
        for (put, there), others in zip(every, self._others, strict=True):
            put[others] = there[others]
        return False


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
    return found[: instants_of(begin, k, period, own, SLACK, found, rows)], rows


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
    way, top = np.empty((2, len(now)))
    reaction = kernel.Reaction(0.0, math.inf, T_r, lead, SLACK)
    kernel.farthest(np.asarray(t, float), reaction, most, now, way, top)
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
