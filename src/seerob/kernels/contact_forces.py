"""All that is asked of the forces at a point contact at every tick, in one compiled call."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from seerob.core.transforms import Array
from seerob.kernels.axes import principal_axes
from seerob.kernels.polytope import Indices, corners, faces, inscribed, merged, unit_slabs


@njit(cache=True, nogil=True, error_model="numpy")
def zero_moment_set(
    J_v: Array, low: Array, high: Array, singular: float, same: float
) -> tuple[bool, Array, Indices, Array, float]:
    """The set ``{f : low <= J_vᵀ f <= high}``.

    Args:
        J_v: Linear Jacobian of the point, shape (3, n).
        low: Torques left below, shape (n,) [N·m or N].
        high: Torques left above, shape (n,).
        singular: Singular value below which a direction counts as not driven, relative to the largest.
        same: Corners nearer than this are one, relative to the farthest.

    Returns:
        Whether bounds are finite and not inverted; distinct corners (k, 3) [N], none where there is no such
        force, of an unbounded set those of its section across the free directions; triangles (m, 3); free
        directions as columns (3, d); radius of the largest ball about 0 [N].
    """
    no_corners, no_triangles = np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    proper = True
    for i in range(len(low)):
        proper = proper and math.isfinite(low[i]) and math.isfinite(high[i]) and low[i] <= high[i]
        for r in range(3):
            proper = proper and math.isfinite(J_v[r, i])
    if not proper:
        return False, no_corners, no_triangles, np.zeros((3, 0)), np.nan
    possible, normals, below, above = unit_slabs(J_v, low, high)
    driven = len(normals)
    sigma, axes = np.empty((1, 3)), np.empty((1, 3, 3))
    count = 0
    if driven:
        used_up = np.empty((1, 3, driven))
        for i in range(driven):
            for r in range(3):
                used_up[0, r, i] = normals[i, r]
        principal_axes(used_up, sigma, axes)
        while count < 3 and sigma[0, count] > singular * sigma[0, 0]:
            count += 1
    free = np.zeros((3, 3 - count))
    for r in range(3):
        for c in range(count, 3):
            free[r, c - count] = axes[0, r, c] if driven else 1.0 if r == c else 0.0
    if not possible:
        return True, no_corners, no_triangles, free, np.nan
    # Across the free directions it is a polygon, a stretch or a point: one plane more for each.
    planes = free.shape[1]
    n = driven + planes
    N, l, h = np.zeros((n, 3)), np.zeros(n), np.zeros(n)
    for i in range(n):
        for r in range(3):
            N[i, r] = normals[i, r] if i < driven else free[r, i - driven]
        if i < driven:
            l[i], h[i] = below[i], above[i]
    if planes == 3:
        V = np.zeros((1, 3))
    else:
        room = np.empty((4 * n * (n - 1), 3))
        V = room[: max(corners(N, l, h, room), 0)]
    if not len(V):
        return True, no_corners, no_triangles, free, np.nan
    size = 0.0
    for i in range(len(V)):
        for r in range(3):
            size = max(size, abs(V[i, r]))
    V = merged(V, same * size)
    return True, V, faces(N, l, h, V, 10 * same * size), free, inscribed(below, above)


@njit(cache=True, nogil=True, error_model="numpy")
def drawn_corners(corners: Array, at: Array, scale: float, largest: float) -> tuple[Array, bool]:
    """Where corners of a set of forces are drawn, and whether any is drawn nearer than it is.

    Args:
        corners: Shape (k, 3) [N].
        at: Where the force acts [m], shape (3,).
        scale: Length drawn for 1 N [m].
        largest: Longest that is drawn [m].

    Returns:
        Shape (k, 3) [m].
    """
    found, cut = np.empty_like(corners), False
    for i in range(len(corners)):
        length = scale * math.sqrt(corners[i, 0] ** 2 + corners[i, 1] ** 2 + corners[i, 2] ** 2)
        shorter = scale
        if length > largest:
            cut = True
            shorter = scale * (largest / length)
        for c in range(3):
            found[i, c] = at[c] + shorter * corners[i, c]
    return found, cut
