"""What the engine does at every step of the physics, compiled: where the twin is to be, and the pull there.

Two samples are joined by the cubic of `seerob.twin.control.reference`; the commands are those of
`seerob.twin.engine`.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

SLACK = 1e-9
"""Instants that differ by less are the same [s]: a source's clock and the run's are sums of decimals."""

_ROW, _ROWS = "f8[::1]", "f8[:,::1]"


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


@njit(
    f"void({_ROW}, {_ROWS}, {_ROWS}, b1[::1], f8, {_ROW}, f8, i8[::1], i8[::1], {', '.join([_ROWS] * 6)})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def aim(
    instants: Array,
    points: Array,
    speeds: Array,
    jumps: Flags,
    coast: float,
    t: Array,
    dt: float,
    q_places: Indices,
    v_places: Indices,
    q: Array,
    v: Array,
    a: Array,
    q_all: Array,
    v_all: Array,
    a_all: Array,
) -> None:
    """Motion of one robot or human at the steps of a tick, and among all; writes into the last six.

    Args:
        instants: As of `along`, likewise the next five.
        points: Shape (k, n).
        speeds: Shape (k, n).
        jumps: Shape (k,).
        coast: [s]
        t: Shape (m,).
        dt: Timestep [s]; velocities among all are half of it earlier, as `mujoco.mj_step` counts.
        q_places: Where its positions are among all, shape (n,).
        v_places: Where its velocities are, shape (n,).
        q: Positions, shape (m, n).
        v: Velocities, shape (m, n).
        a: Accelerations, shape (m, n).
        q_all: Of everybody, shape (m, nq).
        v_all: Shape (m, nv).
        a_all: Shape (m, nv).
    """
    along(instants, points, speeds, jumps, coast, t, q, v, a)
    half = 0.5 * dt
    for row in range(len(t)):
        for i in range(len(v_places)):
            q_all[row, q_places[i]] = q[row, i]
            v_all[row, v_places[i]] = v[row, i] - half * a[row, i]
            a_all[row, v_places[i]] = a[row, i]


@njit(
    f"void({_ROW}, {_ROWS}, {_ROWS}, b1[::1], f8, f8, i8[::1], i8[::1], {', '.join([_ROW] * 3)})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def follow(
    instants: Array,
    points: Array,
    speeds: Array,
    jumps: Flags,
    coast: float,
    t: float,
    q_places: Indices,
    v_places: Indices,
    qpos: Array,
    qvel: Array,
    before: Array,
) -> None:
    """Put one robot or human on its motion at an instant; writes into the last three.

    Args:
        instants: As of `along`, likewise the next four.
        points: Shape (k, n).
        speeds: Shape (k, n).
        jumps: Shape (k,).
        coast: [s]
        t: When [s].
        q_places: Where its positions are among all, shape (n,).
        v_places: Where its velocities are, shape (n,).
        qpos: Positions of everybody, shape (nq,).
        qvel: Velocities of everybody, shape (nv,).
        before: Velocities of everybody a step earlier, shape (nv,).
    """
    n = points.shape[1]
    found = np.empty((3, 1, n))
    along(instants, points, speeds, jumps, coast, np.full(1, t), found[0], found[1], found[2])
    for i in range(n):
        # A negative zero is as good, and would be written differently.
        qpos[q_places[i]] = found[0, 0, i] + 0.0
        qvel[v_places[i]] = found[1, 0, i] + 0.0
        before[v_places[i]] = qvel[v_places[i]]


@njit(f"b1({_ROW}, {_ROWS}, {_ROWS}, b1[::1], b1, b1, {_ROW})", cache=True, nogil=True, error_model="numpy")
def join(
    instants: Array,
    points: Array,
    speeds: Array,
    jumps: Flags,
    derives_before: bool,
    derives_last: bool,
    largest: Array,
) -> bool:
    """Join the newest sample to the one before it; whether only a jump does.

    Writes the velocities of these two that nobody said, and that it is a jump.

    Args:
        instants: As of `along`, likewise the next three; k >= 2.
        points: Shape (k, n).
        speeds: Shape (k, n).
        jumps: Shape (k,).
        derives_before: Whether nobody said the velocities of the last but one.
        derives_last: Whether nobody said those of the newest.
        largest: Above it a motion is a jump [rad/s or m/s], shape (n,).
    """
    last, n = len(instants) - 1, points.shape[1]
    T = instants[last] - instants[last - 1]
    chord = np.empty(n)
    jump = beyond = False
    for i in range(n):
        chord[i] = (points[last, i] - points[last - 1, i]) / T
        beyond = beyond or abs(speeds[last, i]) > largest[i]
        jump = jump or abs(chord[i]) > largest[i] or abs(speeds[last - 1, i]) > largest[i]
    if jump or beyond:
        jumps[last] = True
        if derives_last or beyond:
            speeds[last] = 0.0
        return True
    bends = last > 1 and not jumps[last - 1]
    for i in range(n):
        before = after = chord[i]
        if bends:
            T0 = instants[last - 1] - instants[last - 2]
            bend = (chord[i] - (points[last - 1, i] - points[last - 2, i]) / T0) / (T + T0)
            before, after = chord[i] - T * bend, chord[i] + T * bend
        if derives_before:
            speeds[last - 1, i] = before
        if derives_last:
            speeds[last, i] = after
    return False


@njit(f"void({_ROW}, {_ROW}, {_ROW}, b1, i8, {_ROWS}, {_ROWS})", cache=True, nogil=True)
def note(q: Array, v: Array, before: Array, centred: bool, row: int, q_way: Array, v_way: Array) -> None:
    """Note where a step of the physics led to; writes a row of the last two.

    Args:
        q: Positions, shape (nq,).
        v: Velocities, shape (nv,).
        before: Those before the step, shape (nv,).
        centred: Whether velocities belong half a step earlier than positions.
        row: Which.
        q_way: Positions at all steps, shape (s, nq).
        v_way: Velocities at all steps, shape (s, nv).
    """
    for i in range(len(q)):
        q_way[row, i] = q[i]
    for i in range(len(v)):
        v_way[row, i] = v[i] + 0.5 * (v[i] - before[i]) if centred else v[i]


@njit(
    f"void({', '.join([_ROWS] * 5)}, {', '.join([_ROW] * 4)}, f8, i8[::1], {_ROWS})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def commands(
    q: Array,
    v: Array,
    a: Array,
    inertial: Array,
    passive: Array,
    armature: Array,
    damping: Array,
    kp: Array,
    kd: Array,
    dt: float,
    dof: Indices,
    ctrl: Array,
) -> None:
    """Commands of the actuators at steps of a tick; writes into ``ctrl``.

    Args:
        q: Where every joint is to be [rad or m], shape (s, n).
        v: Its velocity half a step earlier, shape (s, n).
        a: Its acceleration, shape (s, n).
        inertial: Torques of the recursive Newton–Euler algorithm, shape (s, n) [N·m or N].
        passive: Passive torques, shape (s, n).
        armature: Rotor inertia, shape (n,) [kg·m² or kg].
        damping: Joint damping, shape (n,).
        kp: Proportional gains, shape (n,).
        kd: Derivative gains, shape (n,).
        dt: Timestep [s].
        dof: Joint of each actuator, shape (m,).
        ctrl: Shape (s, m).
    """
    for s in range(len(ctrl)):
        for k in range(len(dof)):
            i = dof[k]
            # Newton–Euler knows neither rotor inertia nor passive forces. All damping is implicit: it acts
            # on the velocity at the end of the step.
            after = v[s, i] + dt * a[s, i]
            torque = inertial[s, i] + armature[i] * a[s, i] - passive[s, i] + damping[i] * (after - v[s, i])
            ctrl[s, k] = q[s, i] + (kd[i] * after + torque) / kp[i]


@njit(
    f"void({_ROW}, {_ROW}, {_ROW}, {_ROW}, i8[::1], i8[::1], i8[::1], i8[::1], i8[::1], {_ROW}, b1[::1])",
    cache=True,
    nogil=True,
)
def errors(
    q: Array,
    wanted: Array,
    force: Array,
    almost: Array,
    dof: Indices,
    q_places: Indices,
    q_start: Indices,
    v_places: Indices,
    v_start: Indices,
    off: Array,
    saturated: Flags,
) -> None:
    """How far robots and humans are from where they are to be, and whose limits hold them back.

    Writes into the last two.

    Args:
        q: Where every joint is [rad or m], shape (nq,).
        wanted: Where it is to be, shape (nq,).
        force: Of each actuator [N·m or N], shape (m,).
        almost: From which on a joint's limit is reached, shape (nv,).
        dof: Joint of each actuator, shape (m,).
        q_places: Where positions of each robot and human in turn are among all.
        q_start: Where those of each begin in that, shape (r + 1,).
        v_places: Where their velocities are.
        v_start: Shape (r + 1,).
        off: Largest error of a joint of each, shape (r,).
        saturated: Whether a limit of each is reached, shape (r,).
    """
    effort = np.zeros(len(almost))
    for k in range(len(dof)):
        effort[dof[k]] = abs(force[k])
    for r in range(len(off)):
        most = 0.0
        for k in range(q_start[r], q_start[r + 1]):
            here = abs(q[q_places[k]] - wanted[q_places[k]])
            if not here <= most and not np.isnan(most):  # what is not a number stays
                most = here
        off[r], saturated[r] = most, False
        for k in range(v_start[r], v_start[r + 1]):
            if effort[v_places[k]] >= almost[v_places[k]]:
                saturated[r] = True


@njit(f"f8({_ROW})", cache=True, nogil=True)
def greatest(v: Array) -> float:
    """Largest absolute value, 0 of none; not a number where one is not."""
    most = 0.0
    for one in v:
        if not abs(one) <= most and not np.isnan(most):
            most = abs(one)
    return most


@njit(f"f8({_ROW}, {_ROW}, f8, {_ROW}, i8[::1], {_ROW})", cache=True, nogil=True)
def unlike(before: Array, after: Array, share: float, moves: Array, rows: Indices, off: Array) -> float:
    """How far speeds are from those on the straight line between two others; writes the last argument.

    Args:
        before: Of each joint [rad/s or m/s], shape (n,).
        after: Likewise.
        share: Of the way from the former to the latter.
        moves: Speeds of all joints, shape (nv,).
        rows: Which of them, shape (n,).
        off: Receives how far each is off, shape (n,).

    Returns:
        The largest, as `greatest`.
    """
    for j in range(len(rows)):
        off[j] = abs(moves[rows[j]] - (before[j] + share * (after[j] - before[j])))
    return greatest(off)


@njit(f"b1({_ROW}, f8)", cache=True, nogil=True)
def tame(v: Array, wild: float) -> bool:
    """Whether every velocity is below ``wild``; what is not a number is not."""
    for speed in v:
        if not abs(speed) < wild:
            return False
    return True
