"""A set of voxels turned a whole turn about an axis, by way of its profile of radius and height."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.fields import Cells
from seerob.kernels.voxels import MARGIN, TOP

Sums = NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def profile(
    radii: Array,
    heights: Array,
    edges: Array,
    share: float,
    wide: float,
    fine: float,
    rim: float,
    height: float,
) -> Sums:
    """Cells of the half-plane that any of some voxels meets while it turns, summed up over both axes.

    Args:
        radii: Of the voxels' centres from the axis [m], shape (n,).
        heights: Likewise along it, 0 and more [m].
        edges: Edge of each voxel [m], shape (n,).
        share: Half of a voxel's extent along the axis [edges].
        wide: Farthest that a point of it is from its centre, seen along the axis [edges].
        fine: Edge of a cell of the half-plane [m].
        rim: Radius that none passes [m].
        height: Likewise.

    Returns:
        How many cells are met below and left of each corner: a box is free when its sum is 0.
    """
    nr = int(rim / fine) + 2
    nz = int(height / fine) + 2
    met = np.zeros((nr, nz), np.bool_)
    for n in range(len(radii)):
        across = wide * edges[n] + MARGIN
        half = share * edges[n]
        r0 = max(0, int(np.floor((radii[n] - across) / fine)))
        r1 = min(nr - 1, int(np.floor((radii[n] + across) / fine)))
        z0 = max(0, int(np.floor((heights[n] - half - MARGIN) / fine)))
        z1 = min(nz - 1, int(np.floor((heights[n] + half + MARGIN) / fine)))
        for r in range(r0, r1 + 1):
            for z in range(z0, z1 + 1):
                met[r, z] = True
    sums = np.zeros((nr + 1, nz + 1), np.int64)
    for r in range(nr):
        for z in range(nz):
            sums[r + 1, z + 1] = met[r, z] + sums[r, z + 1] + sums[r + 1, z] - sums[r, z]
    return sums


@njit(cache=True, nogil=True, error_model="numpy")
def revolve(
    cells: Cells,
    full: NDArray[np.int16],
    origin: Array,
    pitch: float,
    sums: Sums,
    fine: float,
    anchor: Array,
    axis: Array,
    low: float,
    half: float,
    across: float,
) -> int:
    """Mark every voxel that meets the turned profile; returns how many.

    Args:
        cells: See `seerob.kernels.voxels.stamp`.
        full: Likewise.
        origin: Likewise.
        pitch: Likewise.
        sums: From `profile`.
        fine: Likewise.
        anchor: A point of the axis [m], shape (3,).
        axis: Unit, shape (3,).
        low: Height at which the profile begins [m].
        half: Half of a voxel's extent along the axis [m].
        across: Farthest that a point of it is from its centre, seen along the axis [m].
    """
    nr = sums.shape[0] - 1
    nz = sums.shape[1] - 1
    marked = 0
    for i in range(cells.shape[0]):
        for j in range(cells.shape[1]):
            for k in range(cells.shape[2]):
                x = origin[0] + (i + 0.5) * pitch - anchor[0]
                y = origin[1] + (j + 0.5) * pitch - anchor[1]
                z = origin[2] + (k + 0.5) * pitch - anchor[2]
                h = x * axis[0] + y * axis[1] + z * axis[2]
                r = math.sqrt(max(x * x + y * y + z * z - h * h, 0.0))
                h -= low
                r0 = max(0, int(np.floor((r - across) / fine)))
                r1 = min(nr - 1, int(np.floor((r + across) / fine)))
                z0 = max(0, int(np.floor((h - half) / fine)))
                z1 = min(nz - 1, int(np.floor((h + half) / fine)))
                if r0 > r1 or z0 > z1:
                    continue
                if sums[r1 + 1, z1 + 1] - sums[r0, z1 + 1] - sums[r1 + 1, z0] + sums[r0, z0] > 0:
                    cells[i, j, k] = 1
                    full[i // TOP, j // TOP, k // TOP] += 1
                    marked += 1
    return marked


@njit(cache=True, nogil=True, error_model="numpy")
def cut_to_ball(
    cells: Cells, full: NDArray[np.int16], origin: Array, pitch: float, centre: Array, radius: float
) -> int:
    """Unmark every voxel that lies wholly outside a ball; returns how many.

    Args:
        cells: See `seerob.kernels.voxels.stamp`.
        full: Likewise.
        origin: Likewise.
        pitch: Likewise.
        centre: Of the ball [m], shape (3,).
        radius: Likewise [m].
    """
    outside = (radius + MARGIN) ** 2
    half = 0.5 * pitch
    cut = 0
    for i in range(cells.shape[0]):
        x = max(abs(origin[0] + (i + 0.5) * pitch - centre[0]) - half, 0.0)
        for j in range(cells.shape[1]):
            y = max(abs(origin[1] + (j + 0.5) * pitch - centre[1]) - half, 0.0)
            for k in range(cells.shape[2]):
                z = max(abs(origin[2] + (k + 0.5) * pitch - centre[2]) - half, 0.0)
                if cells[i, j, k] and x * x + y * y + z * z > outside:
                    cells[i, j, k] = 0
                    full[i // TOP, j // TOP, k // TOP] -= 1
                    cut += 1
    return cut
