r"""One time step of joints that are held by dry brakes, whatever sticks or slips.

Velocities after the step solve :math:`M(v^+ - v) = h(\tau - b)` with :math:`|\tau_j| \le B_j`, opposed
to :math:`v^+_j` where that is not 0. They are the minimum of the convex function

.. math:: \tfrac12 (v^+ - v^*)^T M (v^+ - v^*) + h \sum_j B_j |v^+_j|, \qquad v^* = v - h M^{-1} b

found by descent along one joint after the other, each exact: a joint that its brake can hold gets
exactly 0.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from seerob.core.transforms import Array


@njit(cache=True, nogil=True, error_model="numpy")
def braked(M: Array, b: Array, v: Array, B: Array, h: float, out: Array) -> bool:
    """Velocities after a step, into ``out`` (n,); whether they were found to rounding.

    Args:
        M: Mass matrix, positive definite, shape (n, n).
        b: Torques of gravity and velocity products, shape (n,).
        v: Velocities before, shape (n,).
        B: Largest brake torques, shape (n,).
        h: Time step [s].
        out: Filled.
    """
    n = len(v)
    wanted = np.empty(n)
    for j in range(n):
        impulse = 0.0
        for k in range(n):
            impulse += M[j, k] * v[k]
        wanted[j] = impulse - h * b[j]
    for j in range(n):
        out[j] = v[j]
    for _ in range(2000):
        change, largest = 0.0, 0.0
        for j in range(n):
            rest = wanted[j]
            for k in range(n):
                if k != j:
                    rest -= M[j, k] * out[k]
            slack = h * B[j]
            new = (rest - slack if rest > slack else rest + slack if rest < -slack else 0.0) / M[j, j]
            change = max(change, abs(new - out[j]))
            largest = max(largest, abs(new))
            out[j] = new
        if change <= 1e-12 * largest or change < 1e-14:
            return True
    return bool(np.all(np.isfinite(out)) and change < 1e-6)
