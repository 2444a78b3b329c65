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
    rest, L = np.empty((3, n)), np.empty((3, 3))
    for k in range(len(J)):
        for p in range(3):
            for i in range(n):
                rest[p, i] = J[k, p, i]
        for p in range(3):
            square = 0.0
            for i in range(n):
                square += rest[p, i] * rest[p, i]
            L[p, p] = math.sqrt(square)
            per = 1.0 / L[p, p] if square > 0.0 else 0.0
            for q in range(p + 1, 3):
                along = 0.0
                for i in range(n):
                    along += rest[p, i] * rest[q, i]
                along *= per
                L[q, p], L[p, q] = along, 0.0
                for i in range(n):
                    rest[q, i] -= along * per * rest[p, i]
        for _ in range(SWEEPS):
            turned = False
            for p in range(2):
                for q in range(p + 1, 3):
                    pp = L[p, 0] * L[p, 0] + L[p, 1] * L[p, 1] + L[p, 2] * L[p, 2]
                    qq = L[q, 0] * L[q, 0] + L[q, 1] * L[q, 1] + L[q, 2] * L[q, 2]
                    pq = L[p, 0] * L[q, 0] + L[p, 1] * L[q, 1] + L[p, 2] * L[q, 2]
                    if not pq * pq > LIKE_ORTHOGONAL * LIKE_ORTHOGONAL * pp * qq:
                        continue
                    turned = True
                    zeta = (qq - pp) / (2.0 * pq)
                    t = math.copysign(1.0, zeta) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
                    c = 1.0 / math.sqrt(1.0 + t * t)
                    s = c * t
                    for i in range(3):
                        x, y = L[p, i], L[q, i]
                        L[p, i], L[q, i] = c * x - s * y, s * x + c * y
            if not turned:
                break
        a = math.sqrt(L[0, 0] * L[0, 0] + L[0, 1] * L[0, 1] + L[0, 2] * L[0, 2])
        b = math.sqrt(L[1, 0] * L[1, 0] + L[1, 1] * L[1, 1] + L[1, 2] * L[1, 2])
        c = math.sqrt(L[2, 0] * L[2, 0] + L[2, 1] * L[2, 1] + L[2, 2] * L[2, 2])
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
    r, n = found.shape[1], J.shape[2]
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
