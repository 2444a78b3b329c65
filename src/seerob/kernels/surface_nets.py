r"""A smooth closed surface around voxels that never cuts into one, after [Gibson1998]_.

The surface starts as the faces of the voxels. Each vertex is relaxed towards the mean of its
neighbours, but per axis only to the side on which *none* of its faces has a voxel behind it, and by less
than half a voxel. Take a face with its voxel below, at z = 0: its corners stay at z >= 0, and where a voxel
stands beside the space above the face, their common corners carry a face of that voxel and stay on the
near side of it. So no face enters a voxel, now or at any stage of the way, and all voxels remain inside.
Ridges of stairs stay, their valleys are filled up to the ridges: slopes come out flat.

`fill_pinches` first marks the few voxels that keep two voxels from touching in an edge or a corner only;
then every edge of the surface has exactly two faces.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.fields import Cells

Faces = NDArray[np.int32]
Indices = NDArray[np.int64]

FREE = 0.49
"""How far a vertex may move along each axis [voxels]; sheets on either side of a voxel stay apart."""


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _close(cells: Cells, p0: int, p1: int, p2: int, q0: int, q1: int, q2: int) -> int:
    """Mark the first of two free voxels (the second goes on being free)."""
    if cells[p0, p1, p2] == 0:
        cells[p0, p1, p2] = 1
    else:
        cells[q0, q1, q2] = 1
    return 1


@njit(cache=True, nogil=True, error_model="numpy")
def fill_pinches(cells: Cells) -> int:
    """Mark voxels, between those that are marked, until none touch in an edge or corner only.

    Args:
        cells: Not 0 where marked, shape (nx, ny, nz).

    Returns:
        How many were marked.
    """
    nx, ny, nz = cells.shape
    filled = 0
    before = -1
    while filled != before:
        before = filled
        for i in range(nx - 1):
            for j in range(ny - 1):
                for k in range(nz - 1):
                    count = 0
                    for a in range(2):
                        for b in range(2):
                            for c in range(2):
                                if cells[i + a, j + b, k + c]:
                                    count += 1
                    if count < 2 or count > 6:
                        continue
                    for s in range(2):
                        if (
                            (cells[i + s, j, k] != 0) == (cells[i + s, j + 1, k + 1] != 0)
                            and (cells[i + s, j, k + 1] != 0) == (cells[i + s, j + 1, k] != 0)
                            and (cells[i + s, j, k] != 0) != (cells[i + s, j + 1, k] != 0)
                        ):
                            filled += _close(cells, i + s, j, k, i + s, j, k + 1)
                        if (
                            (cells[i, j + s, k] != 0) == (cells[i + 1, j + s, k + 1] != 0)
                            and (cells[i, j + s, k + 1] != 0) == (cells[i + 1, j + s, k] != 0)
                            and (cells[i, j + s, k] != 0) != (cells[i + 1, j + s, k] != 0)
                        ):
                            filled += _close(cells, i, j + s, k, i, j + s, k + 1)
                        if (
                            (cells[i, j, k + s] != 0) == (cells[i + 1, j + 1, k + s] != 0)
                            and (cells[i, j + 1, k + s] != 0) == (cells[i + 1, j, k + s] != 0)
                            and (cells[i, j, k + s] != 0) != (cells[i + 1, j, k + s] != 0)
                        ):
                            filled += _close(cells, i, j, k + s, i, j + 1, k + s)
                    count = 0
                    for a in range(2):
                        for b in range(2):
                            for c in range(2):
                                if cells[i + a, j + b, k + c]:
                                    count += 1
                    if count not in (2, 6):
                        continue
                    for b in range(2):
                        for c in range(2):
                            one = cells[i, j + b, k + c] != 0
                            if one == (cells[i + 1, j + 1 - b, k + 1 - c] != 0) and one == (count == 2):
                                # Two voxels, or two gaps, that meet in a corner only.
                                if one:
                                    cells[i, j + b, k + 1 - c] = 1
                                else:
                                    cells[i, j + b, k + c] = 1
                                filled += 1
                                count = 0
    return filled


@njit(cache=True, nogil=True, error_model="numpy")
def _count(cells: Cells) -> tuple[int, int]:
    """Corners and faces on the boundary of the marked voxels."""
    nx, ny, nz = cells.shape
    corners = 0
    faces = 0
    for i in range(nx - 1):
        for j in range(ny - 1):
            for k in range(nz - 1):
                here = cells[i, j, k] != 0
                z = (cells[i, j, k + 1] != 0) != here
                y = (cells[i, j + 1, k] != 0) != here
                x = (cells[i + 1, j, k] != 0) != here
                faces += x + y + z
                if (
                    x
                    or y
                    or z
                    or (cells[i, j + 1, k + 1] != 0) != here
                    or (cells[i + 1, j, k + 1] != 0) != here
                    or (cells[i + 1, j + 1, k] != 0) != here
                    or (cells[i + 1, j + 1, k + 1] != 0) != here
                ):
                    corners += 1
    return corners, faces


@njit(cache=True, nogil=True, error_model="numpy")
def boundary(cells: Cells) -> tuple[Array, Faces, NDArray[np.int8]]:
    """The faces between marked and other voxels.

    Args:
        cells: Not 0 where marked, shape (nx, ny, nz); the outermost layer is not marked.

    Returns:
        Corners [voxels], shape (n, 3); quads of corners, counter-clockwise from outside, shape (m, 4); and
        the outward normal of each, ±1, ±2, ±3 for x, y, z, shape (m,).
    """
    nx, ny, nz = cells.shape
    n, m = _count(cells)
    points = np.empty((n, 3))
    quads = np.empty((m, 4), np.int32)
    normals = np.empty(m, np.int8)
    # Corner (i, j, k) is the upper one of voxel (i, j, k); those of this slice and the one before.
    maps = np.full((2, ny, nz), -1, np.int32)
    made = 0
    faces = 0
    for i in range(nx - 1):
        now = maps[i % 2]
        old = maps[1 - i % 2]
        for j in range(ny - 1):
            for k in range(nz - 1):
                count = 0
                for a in range(2):
                    for b in range(2):
                        for c in range(2):
                            if cells[i + a, j + b, k + c]:
                                count += 1
                if 0 < count < 8:
                    now[j, k] = made
                    points[made, 0] = i + 1
                    points[made, 1] = j + 1
                    points[made, 2] = k + 1
                    made += 1
        for j in range(ny - 1):
            for k in range(nz - 1):
                here = cells[i, j, k] != 0
                for axis in range(3):
                    if axis == 0:
                        other = cells[i + 1, j, k] != 0
                    elif axis == 1:
                        other = cells[i, j + 1, k] != 0
                    else:
                        other = cells[i, j, k + 1] != 0
                    if here == other:
                        continue
                    # Corners counter-clockwise seen from the end of the axis.
                    if axis == 0:
                        c0, c1, c2, c3 = now[j - 1, k - 1], now[j, k - 1], now[j, k], now[j - 1, k]
                    elif axis == 1:
                        c0, c1, c2, c3 = old[j, k - 1], old[j, k], now[j, k], now[j, k - 1]
                    else:
                        c0, c1, c2, c3 = old[j - 1, k], now[j - 1, k], now[j, k], old[j, k]
                    if here:
                        quads[faces, 0], quads[faces, 1], quads[faces, 2], quads[faces, 3] = c0, c1, c2, c3
                    else:
                        quads[faces, 0], quads[faces, 1], quads[faces, 2], quads[faces, 3] = c3, c2, c1, c0
                    normals[faces] = axis + 1 if here else -axis - 1
                    faces += 1
    return points, quads, normals


@njit(cache=True, nogil=True, error_model="numpy")
def relax(points: Array, quads: Faces, normals: NDArray[np.int8], rounds: int) -> Array:
    """Smooth the boundary of voxels without entering one.

    Args:
        points: From `boundary`.
        quads: Likewise.
        normals: Likewise.
        rounds: How often each vertex moves to the mean of its neighbours.

    Returns:
        The vertices [voxels], shape (n, 3).
    """
    n = len(points)
    low = np.full((n, 3), -FREE, np.float32)
    high = np.full((n, 3), FREE, np.float32)
    beside = np.full((n, 6), -1, np.int32)
    for f in range(len(quads)):
        axis = abs(normals[f]) - 1
        for e in range(4):
            p = quads[f, e]
            q = quads[f, (e + 1) % 4]
            if normals[f] > 0:
                low[p, axis] = 0.0
            else:
                high[p, axis] = 0.0
            for c in range(3):
                if points[q, c] > points[p, c]:
                    beside[p, 2 * c] = q
                    beside[q, 2 * c + 1] = p
                elif points[q, c] < points[p, c]:
                    beside[p, 2 * c + 1] = q
                    beside[q, 2 * c] = p
    now = points.copy()
    then = points.copy()
    for _ in range(rounds):
        for p in range(n):
            count = 0
            x = y = z = 0.0
            for e in range(6):
                q = beside[p, e]
                if q >= 0:
                    x += now[q, 0]
                    y += now[q, 1]
                    z += now[q, 2]
                    count += 1
            then[p, 0] = points[p, 0] + min(max(x / count - points[p, 0], low[p, 0]), high[p, 0])
            then[p, 1] = points[p, 1] + min(max(y / count - points[p, 1], low[p, 1]), high[p, 1])
            then[p, 2] = points[p, 2] + min(max(z / count - points[p, 2], low[p, 2]), high[p, 2])
        now, then = then, now
    return now


@njit(cache=True, nogil=True, error_model="numpy")
def triangles(points: Array, quads: Faces) -> Faces:
    """Each quad cut along its shorter diagonal, shape (2 m, 3)."""
    faces = np.empty((2 * len(quads), 3), np.int32)
    for f in range(len(quads)):
        a, b, c, d = quads[f]
        ac = bd = 0.0
        for r in range(3):
            ac += (points[a, r] - points[c, r]) ** 2
            bd += (points[b, r] - points[d, r]) ** 2
        if ac <= bd:
            faces[2 * f, 0], faces[2 * f, 1], faces[2 * f, 2] = a, b, c
            faces[2 * f + 1, 0], faces[2 * f + 1, 1], faces[2 * f + 1, 2] = a, c, d
        else:
            faces[2 * f, 0], faces[2 * f, 1], faces[2 * f, 2] = a, b, d
            faces[2 * f + 1, 0], faces[2 * f + 1, 1], faces[2 * f + 1, 2] = b, c, d
    return faces


@njit(cache=True, nogil=True, error_model="numpy")
def coarser(cells: Cells, factor: int) -> Cells:
    """Blocks of ``factor``³ voxels, marked where any of them is; an empty layer around."""
    nx, ny, nz = cells.shape
    out = np.zeros((nx // factor + 3, ny // factor + 3, nz // factor + 3), np.uint8)
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if cells[i, j, k]:
                    out[i // factor + 1, j // factor + 1, k // factor + 1] = 1
    return out
