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

BLOCK = 32
"""Matrices of which each figure is worked out in turn, so that the compiler does several at once."""
SWEEPS = 30
"""At most; five or six are usual."""
ORTHOGONAL = 1e-16
LIKE_ORTHOGONAL = 1e-15
"""Cosine that is left where directions are not asked: it changes a length by no more than rounding does."""


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


@njit(cache=True, nogil=True, error_model="numpy")
def half_axes(J: Array, values: Array) -> None:
    """Singular values of the first three rows of many matrices, largest first, without their directions.

    What the rows are to one another, a triangle of 3 by 3, has the same ones, and is turned as
    `principal_axes` turns rows; to rounding they are the same.

    Args:
        J: Matrices, shape (N, 3, n) or with more rows.
        values: Written: shape (N, 3); NaN, all three, of what is not finite.
    """
    n = J.shape[2]
    rest, L = np.empty((3, n, BLOCK)), np.empty((9, BLOCK))
    per, along, turned = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK, np.bool_)
    for begin in range(0, len(J), BLOCK):
        m = min(BLOCK, len(J) - begin)
        for i in range(m):
            for p in range(3):
                for j in range(n):
                    rest[p, j, i] = J[begin + i, p, j]
        for p in range(3):
            along[:] = 0.0
            for j in range(n):
                for i in range(m):
                    along[i] += rest[p, j, i] * rest[p, j, i]
            size = L[4 * p]
            for i in range(m):
                size[i] = math.sqrt(along[i])
                per[i] = 1.0 / size[i] if along[i] > 0.0 else 0.0
            for q in range(p + 1, 3):
                below, above = L[3 * q + p], L[3 * p + q]
                along[:] = 0.0
                for j in range(n):
                    for i in range(m):
                        along[i] += rest[p, j, i] * rest[q, j, i]
                for i in range(m):
                    along[i] *= per[i]
                    below[i], above[i] = along[i], 0.0
                for j in range(n):
                    for i in range(m):
                        rest[q, j, i] -= along[i] * per[i] * rest[p, j, i]
        for _ in range(SWEEPS):
            some = False
            for p in range(2):
                for q in range(p + 1, 3):
                    P, Q = L[3 * p : 3 * p + 3], L[3 * q : 3 * q + 3]
                    for i in range(m):
                        x0, x1, x2, y0, y1, y2 = P[0, i], P[1, i], P[2, i], Q[0, i], Q[1, i], Q[2, i]
                        pp, qq = x0 * x0 + x1 * x1 + x2 * x2, y0 * y0 + y1 * y1 + y2 * y2
                        pq = x0 * y0 + x1 * y1 + x2 * y2
                        turn = pq * pq > LIKE_ORTHOGONAL * LIKE_ORTHOGONAL * pp * qq
                        zeta = (qq - pp) / (2.0 * pq)
                        t = math.copysign(1.0, zeta) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
                        c = 1.0 / math.sqrt(1.0 + t * t)
                        s = c * t
                        c, s, turned[i] = c if turn else 1.0, s if turn else 0.0, turn
                        P[0, i], P[1, i], P[2, i] = c * x0 - s * y0, c * x1 - s * y1, c * x2 - s * y2
                        Q[0, i], Q[1, i], Q[2, i] = s * x0 + c * y0, s * x1 + c * y1, s * x2 + c * y2
                    for i in range(m):
                        some = some or turned[i]
            if not some:
                break
        for i in range(m):
            a = math.sqrt(L[0, i] * L[0, i] + L[1, i] * L[1, i] + L[2, i] * L[2, i])
            b = math.sqrt(L[3, i] * L[3, i] + L[4, i] * L[4, i] + L[5, i] * L[5, i])
            c = math.sqrt(L[6, i] * L[6, i] + L[7, i] * L[7, i] + L[8, i] * L[8, i])
            k = begin + i
            if not math.isfinite(a + b + c):
                values[k, 0] = values[k, 1] = values[k, 2] = np.nan
                continue
            a, b = max(a, b), min(a, b)
            b, c = max(b, c), min(b, c)
            values[k, 0], values[k, 1], values[k, 2] = max(a, b), min(a, b), c


@njit("b1(f8[:,:,::1], f8[:,:,::1], f8[:,:,::1])", cache=True, nogil=True, error_model="numpy")
def mobility(J: Array, M: Array, found: Array) -> bool:
    r"""Write :math:`J M^{-1} J^T` of many points, by :math:`M = U D U^T` from the last joint inward.

    Args:
        J: Shape (N, r, n) or with more rows, of which the first r count.
        M: Symmetric, shape (N, n, n).
        found: Shape (N, r, r).

    Returns:
        Whether every M is positive definite; where not, nothing of use is written.
    """
    r, n, wide = found.shape[1], J.shape[2], min(BLOCK, len(J))
    U, D = np.zeros((n, n, wide)), np.empty((n, wide))
    solved, total = np.empty((r, n, wide)), np.empty(wide)
    definite = True
    for begin in range(0, len(J), BLOCK):
        m = min(BLOCK, len(J) - begin)
        for j in range(n - 1, -1, -1):
            for i in range(j, -1, -1):
                for k in range(m):
                    total[k] = M[begin + k, i, j]
                for c in range(j + 1, n):
                    for k in range(m):
                        total[k] -= U[i, c, k] * D[c, k] * U[j, c, k]
                for k in range(m):
                    if i == j:
                        D[j, k] = total[k]
                        definite = definite and total[k] > 0.0
                    else:
                        U[i, j, k] = total[k] / D[j, k]
        for row in range(r):
            W = solved[row]
            for i in range(n - 1, -1, -1):
                for k in range(m):
                    W[i, k] = J[begin + k, row, i]
                for c in range(i + 1, n):
                    for k in range(m):
                        W[i, k] -= U[i, c, k] * W[c, k]
        for p in range(r):
            for q in range(p + 1):
                total[:] = 0.0
                for i in range(n):
                    for k in range(m):
                        total[k] += solved[p, i, k] * solved[q, i, k] / D[i, k]
                for k in range(m):
                    found[begin + k, p, q] = found[begin + k, q, p] = total[k]
    return definite


@njit("f8[::1](f8[::1])", cache=True, nogil=True, error_model="numpy")
def reciprocals(values: Array) -> Array:
    """1/x, infinite where x is not above 0; what is not a number stays so."""
    found = np.empty_like(values)
    for i in range(len(values)):
        found[i] = np.inf if values[i] <= 0.0 else 1.0 / values[i]
    return found


@njit("UniTuple(f8, 4)(f8[:,::1], f8[:], f8)", cache=True, nogil=True, error_model="numpy")
def mass_along(inverse: Array, along: Array, least: float) -> tuple[float, float, float, float]:
    """Mass felt along a direction.

    Args:
        inverse: Inverse of the effective mass matrix [1/kg], shape (3, 3).
        along: Direction of any length, shape (3,).
        least: Up to this length there is no direction.

    Returns:
        The direction, of unit length, and the mass [kg]: NaN without a direction, infinite of what cannot be
        pushed that way.
    """
    x, y, z = along[0], along[1], along[2]
    length = math.sqrt(x * x + y * y + z * z)
    if not length > least:
        return x, y, z, np.nan
    x, y, z = x / length, y / length, z / length
    square = (
        x * (inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z)
        + y * (inverse[1, 0] * x + inverse[1, 1] * y + inverse[1, 2] * z)
        + z * (inverse[2, 0] * x + inverse[2, 1] * y + inverse[2, 2] * z)
    )
    return x, y, z, np.inf if square <= 0.0 else 1.0 / square


@njit("void(f8[:,:,::1], f8[:,::1], f8, f8[::1])", cache=True, nogil=True, error_model="numpy")
def masses_along(inverse: Array, along: Array, least: float, masses: Array) -> None:
    """Masses felt along directions; writes into the last argument.

    Args:
        inverse: Inverse of the effective mass matrix [1/kg], shape (N, 3, 3).
        along: Directions of any length, shape (N, 3).
        least: Up to this length there is no direction.
        masses: [kg], shape (N,); NaN without a direction, infinite of what cannot be pushed that way.
    """
    for k in range(len(along)):
        masses[k] = mass_along(inverse[k], along[k], least)[3]


@njit("void(f8[:,::1], f8[::1])", cache=True, nogil=True, error_model="numpy")
def quaternion(R: Array, found: Array) -> None:
    """Write the unit quaternion with w >= 0 of a rotation, as `seerob.core.transforms.wxyz_from_rotation`.

    Args:
        R: Rotation matrix, shape (3, 3).
        found: Written: w, x, y, z, shape (4,).
    """
    # Shepperd's method: divide by the largest of the four, so that nothing cancels.
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    largest, square = 0, trace
    for i in range(3):
        if R[i, i] > square:
            largest, square = i + 1, R[i, i]
    found[0] = 1.0 + trace
    found[1], found[2], found[3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    if largest > 0:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        found[0] = R[k, j] - R[j, k]
        found[1 + i] = 1.0 + R[i, i] - R[j, j] - R[k, k]
        found[1 + j] = R[j, i] + R[i, j]
        found[1 + k] = R[k, i] + R[i, k]
    length = 0.0
    for i in range(4):
        length += found[i] * found[i]
    length = math.sqrt(length)
    if found[0] < 0.0:
        length = -length
    for i in range(4):
        found[i] /= length


@njit("b1(f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[::1])", cache=True, nogil=True, error_model="numpy")
def felt(J: Array, M: Array, inverse: Array, axes: Array, figures: Array) -> bool:
    """Effective mass matrix of one point, its principal masses and axes, in one call.

    Args:
        J: Jacobian, linear rows first, shape (6, n).
        M: Symmetric, shape (n, n).
        inverse: Written: see `mobility`, shape (3, 3).
        axes: Written: see `principal_axes`, shape (3, 3).
        figures: Written: principal masses, smallest first [kg], and the quaternion of the axes, shape (7,).

    Returns:
        Whether M is positive definite.
    """
    n = J.shape[1]
    rows, found = J[:3].copy().reshape(1, 3, n), np.empty((1, 3, 3))
    if not mobility(rows, M.reshape(1, n, n), found):
        return False
    # Element by element: an array that is assigned to another takes three seconds to compile.
    for i in range(3):
        for j in range(3):
            inverse[i, j] = found[0, i, j]
    values, turned = np.empty((1, 3)), np.empty((1, 3, 3))
    principal_axes(found, values, turned)
    for i in range(3):
        for j in range(3):
            axes[i, j] = turned[0, i, j]
    lost = math.isnan(values[0, 0]) or math.isnan(values[0, 1]) or math.isnan(values[0, 2])
    for i in range(3):
        figures[i] = np.nan if lost else np.inf if values[0, i] <= 0.0 else 1.0 / values[0, i]
    quaternion(axes, figures[3:])
    return True
