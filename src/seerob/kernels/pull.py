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
    for row in range(len(t)):
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
    f"void({', '.join([_ROW] * 9)}, f8, i8[::1], {_ROW})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def command(
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
    """Commands of the actuators; writes into ``ctrl``.

    Args:
        q: Where every joint is to be [rad or m], shape (n,).
        v: Its velocity half a step earlier, shape (n,).
        a: Its acceleration, shape (n,).
        inertial: Torques of the recursive Newton–Euler algorithm, shape (n,) [N·m or N].
        passive: Passive torques, shape (n,).
        armature: Rotor inertia, shape (n,) [kg·m² or kg].
        damping: Joint damping, shape (n,).
        kp: Proportional gains, shape (n,).
        kd: Derivative gains, shape (n,).
        dt: Timestep [s].
        dof: Joint of each actuator, shape (m,).
        ctrl: Shape (m,).
    """
    for k in range(len(ctrl)):
        i = dof[k]
        # Newton–Euler knows neither rotor inertia nor passive forces. All damping is implicit: it acts
        # on the velocity at the end of the step.
        after = v[i] + dt * a[i]
        torque = inertial[i] + armature[i] * a[i] - passive[i] + damping[i] * (after - v[i])
        ctrl[k] = q[i] + (kd[i] * after + torque) / kp[i]


@njit(f"b1({_ROW}, f8)", cache=True, nogil=True)
def tame(v: Array, wild: float) -> bool:
    """Whether every velocity is below ``wild``; what is not a number is not."""
    for speed in v:
        if not abs(speed) < wild:
            return False
    return True
