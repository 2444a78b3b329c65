r"""Marks every voxel that a moving set touches.

A set S (a box or a field, see `seerob.kernels.fields`) stands at a pose and is dilated by ``reach``, which
covers its own radius and all motion that the pose stands for. A cube of half diagonal
:math:`\rho` around x misses the dilated set when :math:`f(x) > \text{reach} + \rho`; it touches it when
:math:`f(x) \le \text{reach} + \rho/\sqrt 3`. Blocks of 8³ voxels are split down to voxels by the first rule,
and a voxel that neither rule settles is split twice more. What is still open counts as touched: the
reach grows by less than a tenth of a voxel that way, and by what the field's bound gives away.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.fields import Cells, Region, signed_at_most, square_at_least

TOP = 8
"""Edge of the blocks that a pose's box is cut into [voxels]; a power of 2."""
MARGIN = 1e-9
"""What every bound gives away against rounding [m]."""
HALF_DIAGONAL = math.sqrt(3.0) / 2.0


class Voxels(NamedTuple):
    """Which voxels are marked."""

    cells: Cells
    """1 where marked, shape (nx, ny, nz). What lies outside of it is not marked."""
    full: NDArray[np.int16]
    """How many are marked in each block of `TOP`³, shape (⌈nx / TOP⌉, …)."""
    origin: Array
    """Lower corner of the first voxel [m], shape (3,)."""
    pitch: float
    """Edge of a voxel [m]."""


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _in_set(R: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _all_marked(cells: Cells, i: int, j: int, k: int) -> bool:
    """Whether all 2³ voxels from (i, j, k) on are marked; False at the end of the grid."""
    if i + 1 >= cells.shape[0] or j + 1 >= cells.shape[1] or k + 1 >= cells.shape[2]:
        return False
    for p in range(2):
        for q in range(2):
            if cells[i + p, j + q, k] == 0 or cells[i + p, j + q, k + 1] == 0:
                return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _part_touched(
    region: Region, R: Array, w: tuple[float, float, float], part: int, pitch: float, reach: float
) -> bool:
    """Whether an eighth of the voxel around ``w`` may be touched; itself cut into eighths where in doubt."""
    half = pitch / 4.0
    wx, wy, wz = w
    wx += half if part & 1 else -half
    wy += half if part & 2 else -half
    wz += half if part & 4 else -half
    x, y, z = _in_set(R, wx, wy, wz)
    out = (reach + HALF_DIAGONAL * 2.0 * half) ** 2
    square = square_at_least(region, x, y, z, out)
    if square > out:
        return False
    if square <= (reach + half) ** 2:
        return True
    half /= 2.0
    out = (reach + HALF_DIAGONAL * 2.0 * half) ** 2
    for e in range(8):
        x, y, z = _in_set(
            R,
            wx + (half if e & 1 else -half),
            wy + (half if e & 2 else -half),
            wz + (half if e & 4 else -half),
        )
        if square_at_least(region, x, y, z, out) <= out:
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def stamp(
    voxels: Voxels,
    region: Region,
    rotations: Array,
    positions: Array,
    reaches: Array,
    begin: int,
    end: int,
) -> int:
    """Mark the voxels that a set touches at each of its poses.

    Args:
        voxels: Receive the marks.
        region: The set.
        rotations: world_from_set, shape (N, 3, 3).
        positions: Likewise [m], shape (N, 3).
        reaches: How far the set is dilated at each pose [m], shape (N,).
        begin: First block along x that is marked; threads that mark different blocks do not meet.
        end: Block that is no longer marked.

    Returns:
        How many voxels were marked anew.
    """
    cells, full, origin, pitch = voxels
    low, high = region.low, region.high
    nx, ny, nz = cells.shape
    stack = np.empty((64, 4), np.int64)
    first = np.empty(3, np.int64)
    last = np.empty(3, np.int64)
    anew = 0
    for n in range(len(rotations)):
        R = rotations[n]
        P = positions[n]
        reach = reaches[n] + MARGIN
        for r in range(3):
            middle = P[r] - origin[r]
            extent = reach
            for s in range(3):
                middle += R[r, s] * (low[s] + high[s]) / 2.0
                extent += abs(R[r, s]) * (high[s] - low[s]) / 2.0
            first[r] = max(0, int(np.floor((middle - extent) / pitch))) // TOP * TOP
            last[r] = min(cells.shape[r] - 1, int(np.floor((middle + extent) / pitch)))
        for I in range(max(first[0], begin * TOP), min(last[0] + 1, end * TOP), TOP):
            for J in range(first[1], last[1] + 1, TOP):
                for K in range(first[2], last[2] + 1, TOP):
                    stack[0, 0] = I
                    stack[0, 1] = J
                    stack[0, 2] = K
                    stack[0, 3] = TOP
                    depth = 1
                    while depth > 0:
                        depth -= 1
                        i = stack[depth, 0]
                        j = stack[depth, 1]
                        k = stack[depth, 2]
                        b = stack[depth, 3]
                        if i >= nx or j >= ny or k >= nz or (b == 1 and cells[i, j, k]):
                            continue
                        if b == TOP and full[i // TOP, j // TOP, k // TOP] == TOP**3:
                            continue
                        if b == 2 and _all_marked(cells, i, j, k):
                            continue
                        wx = origin[0] + (i + 0.5 * b) * pitch - P[0]
                        wy = origin[1] + (j + 0.5 * b) * pitch - P[1]
                        wz = origin[2] + (k + 0.5 * b) * pitch - P[2]
                        x, y, z = _in_set(R, wx, wy, wz)
                        ball = HALF_DIAGONAL * pitch * b
                        out = (reach + ball) ** 2
                        square = square_at_least(region, x, y, z, out)
                        if square > out:
                            continue
                        if b > 1:
                            # A block of two is done sooner than it is looked up.
                            if b > 2 and signed_at_most(region, x, y, z) + ball <= reach:
                                for p in range(i, min(i + b, nx)):
                                    for q in range(j, min(j + b, ny)):
                                        for s in range(k, min(k + b, nz)):
                                            if cells[p, q, s] == 0:
                                                cells[p, q, s] = 1
                                                full[p // TOP, q // TOP, s // TOP] += 1
                                                anew += 1
                                continue
                            h = b // 2
                            for p in range(0, b, h):
                                for q in range(0, b, h):
                                    for s in range(0, b, h):
                                        stack[depth, 0] = i + p
                                        stack[depth, 1] = j + q
                                        stack[depth, 2] = k + s
                                        stack[depth, 3] = h
                                        depth += 1
                            continue
                        touched = square <= (reach + 0.5 * pitch) ** 2
                        for part in range(0 if touched else 8):
                            if _part_touched(region, R, (wx, wy, wz), part, pitch, reach):
                                touched = True
                                break
                        if touched:
                            cells[i, j, k] = 1
                            full[i // TOP, j // TOP, k // TOP] += 1
                            anew += 1
    return anew


@njit(cache=True, nogil=True, error_model="numpy")
def motion_bounds(
    anchors: Array,
    axes: Array,
    slides: NDArray[np.bool_],
    widths: Array,
    chain_start: NDArray[np.int64],
    chain: NDArray[np.int64],
    corners: Array,
    radius: Array,
    rotations: Array,
    positions: Array,
    bounds: Array,
) -> None:
    r"""How far any point of each set can be from where it is now, for joint positions near these.

    With joint i off by at most :math:`w_i`: turn the joints one after the other from the base to the tip.
    When joint i turns, the joints beyond it are still where they are now, so a point's distance
    :math:`\rho_i` to its axis is today's, and the way made is at most :math:`w_i \rho_i` (for a slide
    :math:`w_i`). The sum bounds the displacement. :math:`\rho_i` is convex in the point: the corners of a
    box bound all that is in it.

    Args:
        anchors: A point of each joint's axis, in the world [m], shape (nj, 3).
        axes: Unit axes in the world, shape (nj, 3).
        slides: Whether a joint is prismatic, shape (nj,).
        widths: [rad or m], shape (nj,).
        chain_start: Where each set's joints begin in ``chain``, shape (ns + 1,).
        chain: Joints that move each set.
        corners: Points whose hull contains each set, in its own frame [m], shape (ns, 8, 3).
        radius: Dilation of each set [m], shape (ns,).
        rotations: world_from_set, shape (ns, 3, 3).
        positions: Likewise [m], shape (ns, 3).
        bounds: Receives the bounds [m], shape (ns,).
    """
    at = np.empty(3)
    for s in range(len(bounds)):
        total = 0.0
        for e in range(chain_start[s], chain_start[s + 1]):
            j = chain[e]
            if widths[j] == 0.0:
                continue
            if slides[j]:
                total += widths[j]
                continue
            most = 0.0
            for c in range(8):
                for r in range(3):
                    at[r] = positions[s, r] - anchors[j, r]
                    for q in range(3):
                        at[r] += rotations[s, r, q] * corners[s, c, q]
                x = at[1] * axes[j, 2] - at[2] * axes[j, 1]
                y = at[2] * axes[j, 0] - at[0] * axes[j, 2]
                z = at[0] * axes[j, 1] - at[1] * axes[j, 0]
                most = max(most, x * x + y * y + z * z)
            total += widths[j] * (math.sqrt(most) + radius[s])
        bounds[s] = total
