"""Turned boxes around triangles: fitting one, and how near two, or one and a segment, can be.

A bound is the largest of three: of the balls around the boxes (alone when that already suffices),
of the gaps along the three axes of a box (orthogonal, so their squares add), and of the gap between
the supporting planes across the line of centres. Turned boxes make curved surfaces thin, which is
worth 3 to 4 times the distance queries of upright ones between meshes.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Indices = NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def _spread(T: Array, order: Indices, start: int, stop: int) -> Array:
    """Second moment of triangles' area about its centroid, shape (3, 3); of a line's, its length's."""
    area = 0.0
    first = np.zeros(3)
    second = np.zeros((3, 3))
    corner = np.empty((3, 3))
    base = T[order[start], :3]
    for q in range(start, stop):
        k = order[q]
        nn = 0.0
        longest = 0.0
        for c in range(3):
            corner[0, c] = T[k, c] - base[c]
            corner[1, c] = corner[0, c] + T[k, 3 + c]
            corner[2, c] = corner[0, c] + T[k, 6 + c]
            nn += T[k, 9 + c] ** 2
            longest += T[k, 3 + c] ** 2 + T[k, 6 + c] ** 2
        # A sliver weighs a little, so that it has a direction.
        weight = np.sqrt(nn) + 1e-9 * longest
        area += weight
        for c in range(3):
            mean = (corner[0, c] + corner[1, c] + corner[2, c]) / 3.0
            first[c] += weight * mean
            for d in range(3):
                other = (corner[0, d] + corner[1, d] + corner[2, d]) / 3.0
                total = 9.0 * mean * other
                for e in range(3):
                    total += corner[e, c] * corner[e, d]
                second[c, d] += weight * total / 12.0
    if area > 0.0:
        for c in range(3):
            for d in range(3):
                second[c, d] -= first[c] * first[d] / area
    return second


@njit(cache=True, nogil=True, error_model="numpy")
def _principal_axes(C: Array) -> Array:
    """Orthonormal eigenvectors of a symmetric (3, 3), as rows: Jacobi rotations. Destroys ``C``."""
    V = np.eye(3)
    for _ in range(12):
        off = C[0, 1] ** 2 + C[0, 2] ** 2 + C[1, 2] ** 2
        if not off > 1e-30 * (C[0, 0] ** 2 + C[1, 1] ** 2 + C[2, 2] ** 2):
            break
        for pair in range(3):
            p = 0 if pair < 2 else 1
            q = 1 if pair == 0 else 2
            if C[p, q] == 0.0:
                continue
            theta = (C[q, q] - C[p, p]) / (2.0 * C[p, q])
            t = (1.0 if theta >= 0.0 else -1.0) / (abs(theta) + np.sqrt(theta * theta + 1.0))
            c = 1.0 / np.sqrt(t * t + 1.0)
            s = t * c
            for k in range(3):
                x = C[k, p]
                y = C[k, q]
                C[k, p] = c * x - s * y
                C[k, q] = s * x + c * y
            for k in range(3):
                x = C[p, k]
                y = C[q, k]
                C[p, k] = c * x - s * y
                C[q, k] = s * x + c * y
                x = V[p, k]
                y = V[q, k]
                V[p, k] = c * x - s * y
                V[q, k] = s * x + c * y
    return V


@njit(cache=True, nogil=True, error_model="numpy")
def fit_box(T: Array, order: Indices, start: int, stop: int, node: Array, upright: bool) -> None:
    """Write centre, half size, axes and radius of a box of triangles to ``node``.

    Along the mesh's axes or the triangles' principal ones, whichever has less surface; ``upright``
    for the former.
    """
    least_surface = np.inf
    low = np.empty(3)
    high = np.empty(3)
    size = np.empty(3)
    for turned in range(1 if upright else 2):
        axes = _principal_axes(_spread(T, order, start, stop)) if turned else np.eye(3)
        low[:] = np.inf
        high[:] = -np.inf
        for q in range(start, stop):
            k = order[q]
            for a in range(3):
                x = axes[a, 0] * T[k, 0] + axes[a, 1] * T[k, 1] + axes[a, 2] * T[k, 2]
                y = x + axes[a, 0] * T[k, 3] + axes[a, 1] * T[k, 4] + axes[a, 2] * T[k, 5]
                z = x + axes[a, 0] * T[k, 6] + axes[a, 1] * T[k, 7] + axes[a, 2] * T[k, 8]
                low[a] = min(low[a], x, y, z)
                high[a] = max(high[a], x, y, z)
        largest, other = 0.0, 0.0
        for a in range(3):
            size[a] = high[a] - low[a]
            largest, other = max(largest, abs(low[a])), max(other, abs(high[a]))
        surface = size[0] * size[1] + size[1] * size[2] + size[2] * size[0]
        if turned == 0 or surface < least_surface:
            least_surface = surface
            # Rounded up: a box must contain its triangles in floating point too.
            slack = 4e-15 * (largest + other)
            radius = 0.0
            for c in range(3):
                node[c] = 0.0
                for a in range(3):
                    node[c] += axes[a, c] * (low[a] + high[a]) / 2.0
                    node[10 + 3 * a + c] = axes[a, c]
                node[3 + c] = size[c] / 2.0 + slack
                radius += node[3 + c] ** 2
            node[19] = np.sqrt(radius) * (1.0 + 1e-15)


@njit(cache=True, nogil=True, error_model="numpy")
def segment_box(
    nodes: Array,
    i: int,
    ax: float,
    ay: float,
    az: float,
    dx: float,
    dy: float,
    dz: float,
    dd: float,
    cut: float,
) -> float:
    """Lower bound of the squared distance of ``a + s·d`` to box i: its ball, its axes, centre direction.

    The ball alone when that exceeds ``cut``.
    """
    ax -= nodes[i, 0]
    ay -= nodes[i, 1]
    az -= nodes[i, 2]
    t = -(ax * dx + ay * dy + az * dz) / dd if dd > 0.0 else 0.0
    t = min(max(t, 0.0), 1.0)
    # All of the segment lies beyond its point nearest to the centre, seen from the centre.
    rx = ax + t * dx
    ry = ay + t * dy
    rz = az + t * dz
    q = rx * rx + ry * ry + rz * rz
    radius = nodes[i, 19]
    if q > radius * radius:
        gap = math.sqrt(q) - radius
        if gap * gap > cut:
            return float(gap * gap)
    low = 0.0
    reach = 0.0
    for a in range(3):
        ux = nodes[i, 10 + 3 * a]
        uy = nodes[i, 11 + 3 * a]
        uz = nodes[i, 12 + 3 * a]
        h = nodes[i, 3 + a]
        half = 0.5 * (ux * dx + uy * dy + uz * dz)
        m = abs(ux * ax + uy * ay + uz * az + half) - abs(half) - h
        if m > 0.0:
            low += m * m
        reach += h * abs(ux * rx + uy * ry + uz * rz)
    if q > reach:
        gap = q - reach
        low = max(low, gap * gap / q)
    return float(low)


@njit(cache=True, nogil=True, error_model="numpy")
def box_box(A: Array, i: int, B: Array, j: int, R: Array, t: Array, cut: float) -> float:
    """Lower bound of the squared distance of boxes ``A[i]`` and ``B[j]``: balls, axes, centre direction.

    Args:
        A: Nodes.
        i: Box of A.
        B: Nodes.
        j: Box of B.
        R: Rotation a_from_b, shape (9,).
        t: Position a_from_b [m], shape (3,).
        cut: Squared distance above which the balls' bound is enough [m²].
    """
    cx = R[0] * B[j, 0] + R[1] * B[j, 1] + R[2] * B[j, 2] + t[0] - A[i, 0]
    cy = R[3] * B[j, 0] + R[4] * B[j, 1] + R[5] * B[j, 2] + t[1] - A[i, 1]
    cz = R[6] * B[j, 0] + R[7] * B[j, 1] + R[8] * B[j, 2] + t[2] - A[i, 2]
    q = cx * cx + cy * cy + cz * cz
    radius = A[i, 19] + B[j, 19]
    if q > radius * radius:
        gap = math.sqrt(q) - radius
        if gap * gap > cut:
            return float(gap * gap)
    # Centre of B in the frame of mesh b, seen from A's centre.
    bx = R[0] * cx + R[3] * cy + R[6] * cz
    by = R[1] * cx + R[4] * cy + R[7] * cz
    bz = R[2] * cx + R[5] * cy + R[8] * cz
    reach = 0.0
    low_a = 0.0
    side0 = side1 = side2 = 0.0
    for a in range(3):
        ux = A[i, 10 + 3 * a]
        uy = A[i, 11 + 3 * a]
        uz = A[i, 12 + 3 * a]
        h = A[i, 3 + a]
        # A's axis in the frame of mesh b, then against B's axes.
        vx = R[0] * ux + R[3] * uy + R[6] * uz
        vy = R[1] * ux + R[4] * uy + R[7] * uz
        vz = R[2] * ux + R[5] * uy + R[8] * uz
        m0 = abs(vx * B[j, 10] + vy * B[j, 11] + vz * B[j, 12])
        m1 = abs(vx * B[j, 13] + vy * B[j, 14] + vz * B[j, 15])
        m2 = abs(vx * B[j, 16] + vy * B[j, 17] + vz * B[j, 18])
        s = abs(ux * cx + uy * cy + uz * cz)
        reach += h * s
        m = s - h - (m0 * B[j, 3] + m1 * B[j, 4] + m2 * B[j, 5])
        if m > 0.0:
            low_a += m * m
        side0 += m0 * h
        side1 += m1 * h
        side2 += m2 * h
    s0 = abs(B[j, 10] * bx + B[j, 11] * by + B[j, 12] * bz)
    s1 = abs(B[j, 13] * bx + B[j, 14] * by + B[j, 15] * bz)
    s2 = abs(B[j, 16] * bx + B[j, 17] * by + B[j, 18] * bz)
    reach += B[j, 3] * s0 + B[j, 4] * s1 + B[j, 5] * s2
    m0 = max(s0 - B[j, 3] - side0, 0.0)
    m1 = max(s1 - B[j, 4] - side1, 0.0)
    m2 = max(s2 - B[j, 5] - side2, 0.0)
    low = max(low_a, m0 * m0 + m1 * m1 + m2 * m2)
    if q > reach:
        gap = q - reach
        low = max(low, gap * gap / q)
    return float(low)
