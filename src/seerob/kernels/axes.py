r"""Principal axes of small matrices of three rows, compiled: ellipsoids of velocity and of mass.

A one-sided Jacobi method: rotations in the space of the rows until they are orthogonal; their lengths
are then the singular values. It does not square the condition number, and small values come out
as accurately as large ones [Demmel1992]_.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from seerob.core.transforms import Array

SWEEPS = 30
"""At most; five or six are usual."""
ORTHOGONAL = 1e-16


@njit("void(f8[:,:,::1], f8[:,::1], f8[:,:,::1])", cache=True, nogil=True, error_model="numpy")
def principal_axes(A: Array, values: Array, axes: Array) -> None:
    """Singular values of many matrices, largest first, and their left directions.

    Args:
        A: Matrices, shape (N, 3, n); they are used up.
        values: Written: singular values, shape (N, 3).
        axes: Written: a right-handed frame with the directions as columns, in the same order, shape
            (N, 3, 3).
    """
    n = A.shape[2]
    for k in range(len(A)):
        rows, U = A[k], axes[k]
        for i in range(3):
            for j in range(3):
                U[i, j] = 1.0 if i == j else 0.0
        for _ in range(SWEEPS):
            turned = False
            for p in range(2):
                for q in range(p + 1, 3):
                    pp, qq, pq = 0.0, 0.0, 0.0
                    for i in range(n):
                        pp += rows[p, i] * rows[p, i]
                        qq += rows[q, i] * rows[q, i]
                        pq += rows[p, i] * rows[q, i]
                    # Written so that it ends for what is not a number.
                    if not abs(pq) > ORTHOGONAL * math.sqrt(pp * qq):
                        continue
                    turned = True
                    zeta = (qq - pp) / (2.0 * pq)
                    t = math.copysign(1.0, zeta) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
                    c = 1.0 / math.sqrt(1.0 + t * t)
                    s = c * t
                    for i in range(n):
                        x, y = rows[p, i], rows[q, i]
                        rows[p, i], rows[q, i] = c * x - s * y, s * x + c * y
                    for i in range(3):
                        x, y = U[i, p], U[i, q]
                        U[i, p], U[i, q] = c * x - s * y, s * x + c * y
            if not turned:
                break
        for p in range(3):
            square = 0.0
            for i in range(n):
                square += rows[p, i] * rows[p, i]
            values[k, p] = math.sqrt(square)
        for p in range(2):
            for q in range(2 - p):
                if values[k, q] < values[k, q + 1]:
                    values[k, q], values[k, q + 1] = values[k, q + 1], values[k, q]
                    for i in range(3):
                        # One of them turned about, so that the frame stays right-handed.
                        U[i, q], U[i, q + 1] = U[i, q + 1], -U[i, q]


@njit("b1(f8[:,:,::1], f8[:,:,::1], f8[:,:,::1])", cache=True, nogil=True, error_model="numpy")
def mobility(J: Array, M: Array, found: Array) -> bool:
    r"""Write :math:`J M^{-1} J^T` of many points, by :math:`M = U D U^T` from the last joint inward.

    Args:
        J: Shape (N, r, n).
        M: Symmetric, shape (N, n, n).
        found: Shape (N, r, r).

    Returns:
        Whether every M is positive definite; where not, nothing of use is written.
    """
    r, n = J.shape[1:]
    U = np.zeros((n, n))
    D = np.empty(n)
    W = np.empty((r, n))
    definite = True
    for k in range(len(J)):
        for j in range(n - 1, -1, -1):
            for i in range(j, -1, -1):
                rest = M[k, i, j]
                for c in range(j + 1, n):
                    rest -= U[i, c] * D[c] * U[j, c]
                if i == j:
                    D[j] = rest
                    definite = definite and rest > 0.0
                else:
                    U[i, j] = rest / D[j]
        for row in range(r):
            for i in range(n - 1, -1, -1):
                rest = J[k, row, i]
                for c in range(i + 1, n):
                    rest -= U[i, c] * W[row, c]
                W[row, i] = rest
        for p in range(r):
            for q in range(p + 1):
                total = 0.0
                for i in range(n):
                    total += W[p, i] * W[q, i] / D[i]
                found[k, p, q] = found[k, q, p] = total
    return definite


@njit("f8[::1](f8[::1])", cache=True, nogil=True, error_model="numpy")
def reciprocals(values: Array) -> Array:
    """1/x, infinite where x is not above 0; what is not a number stays so."""
    found = np.empty_like(values)
    for i in range(len(values)):
        found[i] = np.inf if values[i] <= 0.0 else 1.0 / values[i]
    return found
