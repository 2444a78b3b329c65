"""What the engine does at every tick and step, compiled: where the twin is to be, and the pull there.

Two samples are joined by the cubic of `seerob.twin.control.reference`; the commands are those of
`seerob.twin.engine`. Everybody's motion and the physics are bound once (`seerob.kernels.bound`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import Layout
from seerob.kernels.mujoco_calls import newton_euler, updated

Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

SLACK = 1e-9
"""Instants that differ by less are the same [s]: a source's clock and the run's are sums of decimals."""


class Knots(NamedTuple):
    """Samples of one robot, machine or person, k of which are kept, in rooms of R >= k rows."""

    instants: Array
    """Increasing [s], shape (R,)."""
    points: Array
    """Positions there [rad or m], shape (R, n)."""
    speeds: Array
    """Velocities there, shape (R, n)."""
    jumps: Flags
    """Whether nothing but a jump leads to each of them, shape (R,)."""
    said: Flags
    """Whether each says its velocities, shape (R,)."""
    kept: Indices
    """Rows from the first to before the last that is kept, shape (2,)."""
    coast: Array
    """How long it goes on at its speed after the last one [s], shape (1,)."""
    largest: Array
    """Above it a motion is a jump [rad/s or m/s], shape (n,)."""
    leaves_at: Array
    """Largest speed of a joint at the newest sample [rad/s or m/s], shape (1,)."""


class Joints(NamedTuple):
    """Joints of one robot, machine or person among all: n that are led, and d that follow them."""

    q_places: Indices
    """Where their positions are among all, shape (d,)."""
    v_places: Indices
    """Where their velocities are, shape (d,)."""
    own: Indices
    """Where the velocities of those that are led are, shape (n,)."""
    coupling: Array
    """How they follow, shape (d, n); of no rows where each is led itself."""
    offset: Array
    """Their positions where those that are led are at 0, shape (d,)."""
    q: Array
    """Positions of those that are led, at the steps of a tick and at its end [rad or m], shape (s + 1, n)."""
    v: Array
    """Velocities, shape (s + 1, n)."""
    a: Array
    """Accelerations, shape (s + 1, n)."""
    off: Array
    """How far velocities are from those that are said, shape (n,)."""
    led_q: Array
    """Where they are pulled to at the end of a tick, shape (d,)."""
    led_v: Array
    """Their velocities then, shape (d,)."""


class Physics(NamedTuple):
    """The twin of r robots, machines and people: nq positions, nv velocities, m actuators, s steps a tick."""

    calls: Indices
    """Addresses: the `mujoco.MjModel`, its data in which the motion itself is worked out, ``mj_rne``, and
    what is called before."""
    step: Indices
    """Addresses: the `mujoco.MjModel`, the twin's data, and what a step is made of where nothing but joints
    and actuators takes part (`STEP`); else none."""
    qpos: Array
    qvel: Array
    before: Array
    """Velocities before the last step, shape (nv,)."""
    ctrl: Array
    force: Array
    """Of each actuator [N·m or N], shape (m,)."""
    shown_q: Array
    """Positions at the last tick, shape (nq,)."""
    shown_v: Array
    wanted_q: Array
    """In those data, as the next three."""
    wanted_v: Array
    wanted_a: Array
    passive: Array
    bias: Array
    """In the twin's data, as the next four: forces of joints [N·m or N], shape (nv,)."""
    own_passive: Array
    applied: Array
    actuated: Array
    smooth: Array
    """Receives their sum."""
    armature: Array
    """Rotor inertia, shape (nv,) [kg·m² or kg]."""
    damping: Array
    """Of the joints, shape (nv,)."""
    kp: Array
    """Proportional gains, shape (nv,)."""
    kd: Array
    """Derivative gains, shape (nv,)."""
    almost: Array
    """From which torque on a joint's limit is reached, shape (nv,)."""
    dof: Indices
    """Joint of each actuator, shape (m,)."""
    t: Array
    """When each step begins, and when the tick ends [s], shape (s + 1,)."""
    q: Array
    """Where every joint is to be then [rad or m], shape (s + 1, nq)."""
    v: Array
    """Its velocity half a step earlier, as `mujoco.mj_step` counts, shape (s + 1, nv)."""
    a: Array
    """Its acceleration, shape (s + 1, nv)."""
    torques: Array
    """Work: what the motion itself needs, shape (nv,)."""
    efforts: Array
    """Work: of the actuators, shape (nv,)."""
    now: Array
    """Work: an instant [s], shape (1,)."""
    steering: Array
    """What actuators are told at each step, shape (s, m)."""
    q_way: Array
    """Where every joint was at each step, shape (s + 1, nq)."""
    v_way: Array
    error: Array
    """Largest error of a joint of each who is pulled [rad or m], shape (r,)."""
    person: Flags
    """Whether each is a person, whom something may hold elsewhere, shape (r,)."""
    saturated: Flags
    """Whether a torque limit of each is reached, shape (r,)."""
    unlike: Array
    """How far velocities of each are from those that are said; not a number where none are, shape (r,)."""


STEP = (
    "mj_kinematics", "mj_comPos", "mj_makeM", "mj_transmission", "mj_fwdVelocity", "mj_fwdActuation",
    "mj_implicit",
)  # fmt: skip
"""What of ``mj_step`` moves joints that actuators alone act on: no contact, no limit and no equality, which
ask for accelerations, too."""

_FLOAT, _WHOLE, _FLAG = np.float64, np.int64, np.bool_
KNOTS = Layout(
    Knots,
    [(_FLOAT, 1), (_FLOAT, 2), (_FLOAT, 2), (_FLAG, 1), (_FLAG, 1), (_WHOLE, 1), *[(_FLOAT, 1)] * 3],
)
JOINTS = Layout(
    Joints, [*[(_WHOLE, 1)] * 3, (_FLOAT, 2), (_FLOAT, 1), *[(_FLOAT, 2)] * 3, *[(_FLOAT, 1)] * 3]
)
PHYSICS = Layout(
    Physics,
    [
        *[(_WHOLE, 1)] * 2, *[(_FLOAT, 1)] * 21, (_WHOLE, 1), (_FLOAT, 1), *[(_FLOAT, 2)] * 3,
        *[(_FLOAT, 1)] * 3, *[(_FLOAT, 2)] * 3, (_FLOAT, 1), (_FLAG, 1), (_FLAG, 1), (_FLOAT, 1),
    ],
)  # fmt: skip
KNOT_ROWS = len(KNOTS.arrays)
MOTION_ROWS = KNOT_ROWS + len(JOINTS.arrays)
"""Of a table of motions, of each who is pulled: first those of `KNOTS`, then those of `JOINTS`."""
_knots_in, _joints_in, _physics_in = (layout.read for layout in (KNOTS, JOINTS, PHYSICS))

_ROW, _ROWS, _TABLE = "f8[::1]", "f8[:,::1]", "i8[:,::1]"


@njit(
    f"void({_ROW}, {_ROWS}, {_ROWS}, b1[::1], f8, {_ROW}, {_ROWS}, {_ROWS}, {_ROWS})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def along(
    instants: Array,
    points: Array,
    speeds: Array,
    jumps: Flags,
    coast: float,
    t: Array,
    q: Array,
    v: Array,
    a: Array,
) -> None:
    """Position, velocity and acceleration of a motion through samples; writes into the last three.

    Args:
        instants: Of the samples, increasing [s], shape (k,), k >= 1.
        points: Positions there [rad or m], shape (k, n).
        speeds: Velocities there, shape (k, n).
        jumps: Whether nothing but a jump leads to each of them, shape (k,).
        coast: How long it goes on at its speed after the last one [s].
        t: When it is asked for [s], shape (m,).
        q: Positions then, shape (m, n).
        v: Velocities then, shape (m, n).
        a: Accelerations then, shape (m, n).
    """
    last = len(instants) - 1
    n = points.shape[1]
    k = -1
    for row in range(len(t)):
        if row and t[row] < t[row - 1]:
            k = -1
        while k < last and instants[k + 1] <= t[row] + SLACK:
            k += 1
        if k < 0 or (k < last and jumps[k + 1]):
            for i in range(n):
                q[row, i], v[row, i], a[row, i] = points[max(k, 0), i], 0.0, 0.0
            continue
        after = t[row] - instants[k]
        if k == last:
            moving = after <= coast + SLACK
            for i in range(n):
                q[row, i] = points[k, i] + min(after, coast) * speeds[k, i]
                v[row, i] = speeds[k, i] if moving else 0.0
                a[row, i] = 0.0
            continue
        T = instants[k + 1] - instants[k]
        s = after / T
        for i in range(n):
            # The cubic in powers of s about the earlier point.
            chord = points[k + 1, i] - points[k, i]
            c1, end = T * speeds[k, i], T * speeds[k + 1, i]
            c2, c3 = 3 * chord - 2 * c1 - end, c1 + end - 2 * chord
            q[row, i] = points[k, i] + s * (c1 + s * (c2 + s * c3))
            v[row, i] = (c1 + s * (2 * c2 + s * 3 * c3)) / T
            a[row, i] = (2 * c2 + 6 * s * c3) / (T * T)


@njit(cache=True, nogil=True, error_model="numpy")
def _along(knots: Knots, t: Array, q: Array, v: Array, a: Array) -> None:
    first, end = knots.kept[0], knots.kept[1]
    along(
        knots.instants[first:end], knots.points[first:end], knots.speeds[first:end], knots.jumps[first:end],
        knots.coast[0], t, q, v, a,
    )  # fmt: skip


@njit(f"i8(f8, i8, f8, f8[:], f8, {_ROW}, i8[::1])", cache=True, nogil=True)
def instants(
    begin: float, first: int, period: float, knots: Array, slack: float, found: Array, rows: Indices
) -> int:
    """Put ticks, and the knots that are none of them, in one order; writes into the last two arguments.

    Args:
        begin: The first tick, between two of the clock [s].
        first: Number of the clock's tick before it.
        period: Of the clock [s].
        knots: Not decreasing [s], shape (k,).
        slack: A knot that is nearer to a tick is that tick [s].
        found: Shape (s + k,).
        rows: Where each tick is, shape (s,).

    Returns:
        How many there are.
    """
    count, i, tick, before = 0, 0, begin, -np.inf
    for t in knots:
        while i < len(rows) and tick < t:
            found[count], rows[i], before = tick, count, tick
            count, i, tick = count + 1, i + 1, period * (first + i + 1)
        near = (i < len(rows) and abs(t - tick) <= slack) or (i > 0 and abs(t - before) <= slack)
        if not near and (count == 0 or found[count - 1] < t):
            found[count] = t
            count += 1
    while i < len(rows):
        found[count], rows[i] = tick, count
        count, i, tick = count + 1, i + 1, period * (first + i + 1)
    return count


@njit(f"UniTuple(i8, 2)({_TABLE})", cache=True, nogil=True)
def size_of(table: Indices) -> tuple[int, int]:
    """How many samples are kept in a table of `KNOTS`, and of how many joints they are."""
    knots = _knots_in(table, 0)
    return knots.kept[1] - knots.kept[0], knots.points.shape[1]


@njit(
    f"i8({_TABLE}, f8, i8, f8, {_ROW}, i8[::1], {_ROWS}, {_ROWS}, {_ROWS})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def ticks_ahead(
    table: Indices,
    begin: float,
    first: int,
    period: float,
    t: Array,
    rows: Indices,
    q: Array,
    v: Array,
    a: Array,
) -> int:
    """Work out where somebody will be at ticks to come, and at the samples between them.

    Args:
        table: Of `KNOTS`.
        begin: The first tick, between two of the clock [s].
        first: Number of the clock's tick before it.
        period: Of the clock [s].
        t: Written: ticks and samples, in the order of time [s], shape (m,), with room for all.
        rows: Written: where each tick is among them, shape (s,).
        q: Written: positions then [rad or m], shape (m, n).
        v: Written: velocities then, shape (m, n).
        a: Written: accelerations then, shape (m, n).

    Returns:
        How many there are.
    """
    knots, end = _knots_in(table, 0), period * (first + len(rows) - 1) - SLACK
    own, count = np.empty(knots.kept[1] - knots.kept[0] + 1), 0
    for row in range(knots.kept[0], knots.kept[1]):
        if begin + SLACK < knots.instants[row] < end:
            own[count], count = knots.instants[row], count + 1
    rests = knots.instants[knots.kept[1] - 1] + knots.coast[0]
    if knots.coast[0] != 0.0 and begin + SLACK < rests < end:
        own[count], count = rests, count + 1
    found = instants(begin, first, period, own[:count], SLACK, t, rows)
    _along(knots, t[:found], q, v, a)
    return found


@njit(f"void({_TABLE}, {_TABLE}, f8)", cache=True, nogil=True, error_model="numpy")
def follow(motions: Indices, physics: Indices, t: float) -> None:
    """Put everybody who was heard on his motion at an instant.

    Args:
        motions: Table of everybody; ``q``, ``v`` and ``a`` of `Joints` are where it works.
        physics: Table of `PHYSICS`; ``qpos``, ``qvel`` and ``before`` are written.
        t: When [s].
    """
    all_ = _physics_in(physics, 0)
    all_.now[0] = t
    for r in range(0, len(motions), MOTION_ROWS):
        knots, joints = _knots_in(motions, r), _joints_in(motions, r + KNOT_ROWS)
        if knots.instants[knots.kept[0]] == np.inf:
            continue
        q, v = joints.q[0], joints.v[0]
        _along(knots, all_.now, joints.q[:1], joints.v[:1], joints.a[:1])
        for i in range(len(joints.v_places)):
            x, speed = 0.0, 0.0
            if len(joints.coupling) == 0:
                x, speed = q[i], v[i]
            else:
                for j in range(len(q)):
                    x += joints.coupling[i, j] * q[j]
                    speed += joints.coupling[i, j] * v[j]
                x += joints.offset[i]
            # A negative zero is as good, and would be written differently.
            all_.qpos[joints.q_places[i]] = x + 0.0
            all_.qvel[joints.v_places[i]] = all_.before[joints.v_places[i]] = speed + 0.0


@njit(f"b1({_ROW}, f8)", cache=True, nogil=True)
def tame(v: Array, wild: float) -> bool:
    """Whether every velocity is below ``wild``; what is not a number is not."""
    for speed in v:
        if not abs(speed) < wild:
            return False
    return True


@njit(f"f8({_ROW})", cache=True, nogil=True)
def greatest(v: Array) -> float:
    """Largest absolute value, 0 of none; not a number where one is not."""
    most = 0.0
    for one in v:
        if not abs(one) <= most and not np.isnan(most):
            most = abs(one)
    return most


@njit(cache=True, nogil=True, error_model="numpy")
def _jumps(knots: Knots, row: int, bends: bool) -> bool:
    """Whether nothing but a jump joins a sample to the one before; else writes velocities nobody said.

    Those are of the parabola through both and, where it bends, through the one before.
    """
    instants, points, speeds, largest = knots.instants, knots.points, knots.speeds, knots.largest
    T, n, last = instants[row] - instants[row - 1], points.shape[1], row - 1
    jump = beyond = False
    for i in range(n):
        chord = (points[row, i] - points[last, i]) / T
        beyond = beyond or abs(speeds[row, i]) > largest[i]
        jump = jump or abs(chord) > largest[i] or abs(speeds[last, i]) > largest[i]
    if jump or beyond:
        if beyond:
            speeds[row] = 0.0
        return True
    for i in range(n):
        before = after = chord = (points[row, i] - points[last, i]) / T
        if bends:
            T0 = instants[last] - instants[last - 1]
            bend = (chord - (points[last, i] - points[last - 1, i]) / T0) / (T + T0)
            before, after = chord - T * bend, chord + T * bend
        if not knots.said[last]:
            speeds[last, i] = before
        if not knots.said[row]:
            speeds[row, i] = after
    return False


@njit(f"b1({_TABLE}, i8, i8, f8, {_ROW}, {_ROW}, b1)", cache=True, nogil=True, error_model="numpy")
def take(table: Indices, first: int, row: int, t: float, q: Array, qd: Array, said: bool) -> bool:
    """Make a sample the newest one; whether nothing but a jump joins it to the one before.

    Args:
        table: Of `KNOTS`.
        first: Row of the oldest sample that is kept.
        row: That of this one.
        t: Its instant [s].
        q: Position [rad or m], shape (n,).
        qd: Velocity, or 0 where nobody says it, shape (n,).
        said: Whether somebody does.
    """
    knots = _knots_in(table, 0)
    knots.kept[0], knots.kept[1] = first, row + 1
    knots.instants[row], knots.said[row] = t, said
    for i in range(len(q)):
        knots.points[row, i], knots.speeds[row, i] = q[i], qd[i]
    bends = row - 1 > first and not knots.jumps[row - 1]
    jumps = row > first and _jumps(knots, row, bends)
    knots.jumps[row], knots.leaves_at[0] = jumps, greatest(knots.speeds[row])
    return jumps


@njit(f"void({_TABLE}, i8, i8, f8)", cache=True, nogil=True, error_model="numpy")
def steer(physics: Indices, first: int, end: int, dt: float) -> None:
    """Work out what actuators are told from one step of a tick to before another.

    Args:
        physics: Table of `PHYSICS`; ``steering`` is written, and what MuJoCo works out where ``calls`` says.
        first: The former.
        end: The latter.
        dt: Timestep [s].
    """
    all_ = _physics_in(physics, 0)
    model, data, rne = all_.calls[0], all_.calls[1], all_.calls[2]
    for s in range(first, end):
        for i in range(len(all_.wanted_q)):
            all_.wanted_q[i] = all_.q[s, i]
        for i in range(len(all_.wanted_v)):
            all_.wanted_v[i], all_.wanted_a[i] = all_.v[s, i], all_.a[s, i]
        for function in all_.calls[3:]:
            updated(function, model, data)
        newton_euler(rne, model, data, all_.torques)
        for k in range(len(all_.dof)):
            i = all_.dof[k]
            # Newton–Euler knows neither rotor inertia nor passive forces. All damping is implicit: it acts
            # on the velocity at the end of the step.
            v, a = all_.v[s, i], all_.a[s, i]
            after = v + dt * a
            torque = all_.torques[i] + all_.armature[i] * a - all_.passive[i] + all_.damping[i] * (after - v)
            all_.steering[s, k] = all_.q[s, i] + (all_.kd[i] * after + torque) / all_.kp[i]


@njit(f"void({_TABLE}, i8)", cache=True, nogil=True)
def begin(physics: Indices, step: int) -> None:
    """Begin a step: tell the actuators, and note where it begins from.

    Args:
        physics: Table of `PHYSICS`; ``ctrl``, ``before`` and, by the first step, its row of ``q_way`` and of
            ``v_way`` are written.
        step: Which of the tick.
    """
    all_ = _physics_in(physics, 0)
    for k in range(len(all_.ctrl)):
        all_.ctrl[k] = all_.steering[step, k]
    for i in range(len(all_.qvel)):
        all_.before[i] = all_.qvel[i]
    if step == 0:
        for i in range(len(all_.qpos)):
            all_.q_way[0, i] = all_.shown_q[i]
        for i in range(len(all_.qvel)):
            all_.v_way[0, i] = all_.shown_v[i]


@njit(f"void({_TABLE}, {_TABLE}, f8, f8, f8, b1)", cache=True, nogil=True, error_model="numpy")
def aim(motions: Indices, physics: Indices, start: float, end: float, dt: float, steers: bool) -> None:
    """Work out where everybody is to be at the steps of a tick, and at its end, and begin the first.

    Args:
        motions: Table of everybody, as `MOTION_ROWS` says; their `Joints` are written.
        physics: Table of `PHYSICS`; ``t``, ``q``, ``v`` and ``a`` are written, and what `begin` writes.
        start: When the tick begins [s].
        end: When it ends [s].
        dt: Timestep [s].
        steers: Whether also what actuators are told is worked out now, of all steps (`steer`).
    """
    all_ = _physics_in(physics, 0)
    last, half = len(all_.t) - 1, 0.5 * dt
    for row in range(last):
        all_.t[row] = start + row * dt
    all_.t[last] = end
    for r in range(0, len(motions), MOTION_ROWS):
        knots, joints = _knots_in(motions, r), _joints_in(motions, r + KNOT_ROWS)
        _along(knots, all_.t, joints.q, joints.v, joints.a)
        led = len(joints.coupling) == 0
        for row in range(last + 1):
            q, v, a = joints.q[row], joints.v[row], joints.a[row]
            for i in range(len(joints.v_places)):
                at, to = joints.q_places[i], joints.v_places[i]
                if led:
                    all_.q[row, at], all_.v[row, to], all_.a[row, to] = q[i], v[i] - half * a[i], a[i]
                    continue
                x, speed, change = 0.0, 0.0, 0.0
                for j in range(len(q)):
                    share = joints.coupling[i, j]
                    x += share * q[j]
                    speed += share * (v[j] - half * a[j])
                    change += share * a[j]
                all_.q[row, at], all_.v[row, to], all_.a[row, to] = x + joints.offset[i], speed, change
    if steers:
        steer(physics, 0, len(all_.steering), dt)
    begin(physics, 0)


@njit(cache=True, nogil=True)
def _shown(v: float, before: float, centred: bool) -> float:
    return v + 0.5 * (v - before) if centred else v


@njit(f"b1({_TABLE}, i8, b1, f8)", cache=True, nogil=True)
def end(physics: Indices, step: int, centred: bool, wild: float) -> bool:
    """Note where a step led to; whether every velocity is below ``wild`` [rad/s or m/s], and the next begins.

    Args:
        physics: Table of `PHYSICS`; the next row of ``q_way`` and ``v_way`` is written.
        step: Which of the tick.
        centred: Whether velocities belong half a step earlier than positions.
        wild: What is not a number is not below it.
    """
    all_ = _physics_in(physics, 0)
    for i in range(len(all_.qpos)):
        all_.q_way[step + 1, i] = all_.qpos[i]
    for i in range(len(all_.qvel)):
        all_.v_way[step + 1, i] = _shown(all_.qvel[i], all_.before[i], centred)
    if not tame(all_.qvel, wild):
        return False
    if step + 1 < len(all_.steering):
        begin(physics, step + 1)
    return True


@njit(f"i8({_TABLE}, i8, b1, f8)", cache=True, nogil=True)
def steps(physics: Indices, first: int, centred: bool, wild: float) -> int:
    """Make the steps of a tick that are left, the first of which has begun, where `STEP` is all of them.

    Bit for bit what ``mj_step`` does, without what nobody asks for: it factors the mass matrix once more, and
    looks for contacts.

    Args:
        physics: Table of `PHYSICS`; written as by `begin` and `end`.
        first: The step that has begun.
        centred: As of `end`.
        wild: As of `end`.

    Returns:
        How many steps of the tick are made; one less where after that one a velocity is not below ``wild``.
    """
    all_ = _physics_in(physics, 0)
    model, data, last = all_.step[0], all_.step[1], len(all_.step) - 1
    for step in range(first, len(all_.steering)):
        for function in all_.step[2:last]:
            updated(function, model, data)
        for i in range(len(all_.smooth)):
            force = all_.own_passive[i] - all_.bias[i] + all_.applied[i]
            all_.smooth[i] = force + all_.actuated[i]
        updated(all_.step[last], model, data)
        if not end(physics, step, centred, wild):
            return step
    return len(all_.steering)


@njit(f"b1({_TABLE}, b1)", cache=True, nogil=True)
def show(physics: Indices, centred: bool) -> bool:
    """Take over where everybody is at the end of a tick; False, and nothing is, where that is not finite.

    Args:
        physics: Table of `PHYSICS`; ``shown_q``, ``shown_v`` and the last row of the way are written.
        centred: As of `end`.
    """
    all_ = _physics_in(physics, 0)
    if not (tame(all_.qpos, np.inf) and tame(all_.qvel, np.inf)):
        return False
    last = len(all_.q_way) - 1
    for i in range(len(all_.qpos)):
        all_.shown_q[i] = all_.q_way[last, i] = all_.qpos[i]
    for i in range(len(all_.qvel)):
        all_.shown_v[i] = all_.v_way[last, i] = _shown(all_.qvel[i], all_.before[i], centred)
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _unlike(knots: Knots, joints: Joints, now: Array, moves: Array, held: bool) -> float:
    """How far speeds are from those that samples say; not a number where no sample says any.

    Between two samples those are on the straight line between both: the slope of the cubic through them is
    another one where their positions are noisy.

    Args:
        knots: Samples.
        joints: ``off`` is written: how far each is; ``q``, ``v`` and ``a`` are where it works.
        now: When [s], shape (1,).
        moves: Velocities of all joints, shape (nv,).
        held: Whether it is to be asked of the motion through the samples instead.
    """
    t, first, end = now[0], knots.kept[0], knots.kept[1]
    k = end - 1
    while k >= first and knots.instants[k] > t + SLACK:
        k -= 1
    if k < first or not knots.said[k]:
        return np.nan
    after, share = k, 0.0
    if k < end - 1:
        after = k + 1
        if not knots.said[after] or knots.jumps[after]:
            return np.nan
        share = (t - knots.instants[k]) / (knots.instants[after] - knots.instants[k])
    elif not t - knots.instants[k] <= knots.coast[0] + SLACK:
        return np.nan
    if held:
        _along(knots, now, joints.q[:1], joints.v[:1], joints.a[:1])
    for j in range(len(joints.own)):
        speed = joints.v[0, j] if held else moves[joints.own[j]]
        start = knots.speeds[k, j]
        joints.off[j] = abs(speed - (start + share * (knots.speeds[after, j] - start)))
    return greatest(joints.off)


@njit(f"void({_TABLE}, {_TABLE}, f8, f8, b1, b1)", cache=True, nogil=True, error_model="numpy")
def compare(motions: Indices, physics: Indices, t: float, dt: float, errors: bool, physical: bool) -> None:
    """How far everybody is from where they are to be and from speeds that are said, and whom limits hold.

    Args:
        motions: Table of everybody; ``off``, ``led_q`` and ``led_v`` of `Joints` are written, and ``q``,
            ``v`` and ``a`` are where it works.
        physics: Table of `PHYSICS`; ``unlike`` and, where asked for, ``error`` and ``saturated`` are written.
        t: The tick [s].
        dt: Timestep [s].
        errors: Whether errors and limits are asked for.
        physical: Whether the physics moves the twin.
    """
    all_ = _physics_in(physics, 0)
    all_.now[0] = t
    for i in range(len(all_.efforts)):
        all_.efforts[i] = 0.0
    for k in range(len(all_.dof)):
        all_.efforts[all_.dof[k]] = abs(all_.force[k])
    last = len(all_.q) - 1
    for r in range(len(motions) // MOTION_ROWS):
        knots = _knots_in(motions, r * MOTION_ROWS)
        joints = _joints_in(motions, r * MOTION_ROWS + KNOT_ROWS)
        if errors:
            most = 0.0
            for i in range(len(joints.q_places)):
                place, to = joints.q_places[i], joints.v_places[i]
                joints.led_q[i] = all_.q[last, place]
                joints.led_v[i] = all_.v[last, to] + 0.5 * dt * all_.a[last, to]
                here = abs(all_.qpos[place] - joints.led_q[i])
                if not here <= most and not np.isnan(most):  # what is not a number stays
                    most = here
            all_.error[r], all_.saturated[r] = most, False
            for place in joints.v_places:
                if all_.efforts[place] >= all_.almost[place]:
                    all_.saturated[r] = True
        # What holds it elsewhere, or a torque limit, is no noise.
        held = physical and (all_.person[r] or all_.saturated[r])
        all_.unlike[r] = _unlike(knots, joints, all_.now, all_.shown_v, held)
