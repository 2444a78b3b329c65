r"""Squared distance to a closed set on a grid, and a lower bound of it everywhere between the nodes.

Let f be the distance to a closed set S. Then :math:`|x|^2 - f(x)^2 = \max_{p \in S} 2 x \cdot p - |p|^2`
is convex, so that for a point :math:`x = \sum w_i x_i` in a cell with corners :math:`x_i` and trilinear
weights :math:`w_i` Jensen's inequality gives

.. math:: f(x)^2 \ge \sum_i w_i f(x_i)^2 - h^2 \left(a(1-a) + b(1-b) + c(1-c)\right)

with the spacing h and the fractions a, b, c of x in its cell. It holds whatever the shape of S, and is of
second order where f is smooth. Nodes may hold less than the truth: the bound stays one.

A field holds :math:`f^2` outside S and :math:`-g^2` inside, with g a lower bound of the depth.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.search import POINT, Mesh, mesh_segment, work
from seerob.kernels.winding import contains

Field = NDArray[np.float32]
Cells = NDArray[np.uint8]
Links = NDArray[np.int32]
Indices = NDArray[np.int64]

DOWN = 1.0 - 1e-6
"""Rounds a squared distance down by more than float32 rounds it up."""


class Region(NamedTuple):
    """A set by its field."""

    field: Field
    """Empty when the set is the box itself."""
    start: Array
    """First node of the field [m], shape (3,)."""
    spacing: float
    """Of the nodes [m]."""
    low: Array
    """A box that contains the set [m], shape (3,)."""
    high: Array


@njit(cache=True, nogil=True, error_model="numpy")
def mesh_field(
    nodes: Array,
    links: Links,
    T: Array,
    closed: bool,
    start: Array,
    spacing: float,
    shape: Indices,
    band: float,
) -> Field:
    """Field of a mesh and its inside.

    Args:
        nodes: Tree of the mesh, see `seerob.kernels.tree.build_tree`.
        links: Likewise.
        T: Likewise.
        closed: Whether the mesh has no rim, so that its inside ends only at its surface.
        start: First node [m], shape (3,).
        spacing: [m]
        shape: Number of nodes, shape (3,).
        band: Distance up to which nodes outside are exact [m]; farther ones hold a lower bound.

    Returns:
        Shape ``shape`` [m²].
    """
    field = np.empty((shape[0], shape[1], shape[2]), np.float32)
    mesh, room = Mesh(nodes, links, T), work()
    for i in range(shape[0]):
        x = start[0] + i * spacing
        for j in range(shape[1]):
            y = start[1] + j * spacing
            winner = -1
            before = 0.0  # distance at the last node asked, and how many nodes ago
            since = 0
            sign = 0.0
            for k in range(shape[2]):
                z = start[2] + k * spacing
                since += 1
                # What is farther than the band by more than the steps made needs no exact value.
                left = before - since * spacing
                if closed and sign != 0.0 and left > (band if sign > 0.0 else 2.0 * spacing):
                    field[i, j, k] = sign * left * left * DOWN
                    continue
                d2, winner = mesh_segment(mesh, (x, y, z), POINT, np.inf, winner, room)
                d = math.sqrt(d2)
                # Balls that overlap leave no room for a surface; those that touch may have one between them.
                if not closed or sign == 0.0 or before + d <= since * spacing * (1.0 + 1e-6):
                    sign = -1.0 if contains(nodes, links, T, x, y, z) else 1.0
                field[i, j, k] = sign * d2 * DOWN
                before = d
                since = 0
    return field


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _gap(n: int) -> float:
    """Squared distance of the centre of a cell to the nth cell beside it [cells²]."""
    return (abs(n) - 0.5) ** 2 if n != 0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def cells_field(cells: Cells, spacing: float, band: int) -> Field:
    """Field of a set of cubic cells, at their centres; exact up to ``band`` cells, a lower bound beyond.

    The square of the distance to a cube is a sum of one term per axis, so its least over many cubes
    is found one axis after the other.

    Args:
        cells: Not 0 where marked, shape (nx, ny, nz), with at least ``band`` unmarked cells around.
        spacing: Edge of a cell [m].
        band: In cells.
    """
    nx, ny, nz = cells.shape
    field = np.empty(cells.shape, np.float32)
    cap = (band - 0.5) ** 2
    line = np.empty(max(nx, ny, nz), np.float32)
    for inside in range(2):
        a = np.full(cells.shape, np.float32(cap), np.float32)
        for i in range(nx):
            for j in range(ny):
                for k in range(nz):
                    if (cells[i, j, k] == 0) == (inside == 1):
                        for s in range(max(0, k - band + 1), min(nz, k + band)):
                            a[i, j, s] = min(a[i, j, s], np.float32(_gap(s - k)))
        for axis in range(2):
            n, m, w = (nx, ny, nz) if axis == 0 else (ny, nx, nz)
            for j in range(m):
                for k in range(w):
                    least = np.float32(cap)
                    for i in range(n):
                        line[i] = a[i, j, k] if axis == 0 else a[j, i, k]
                        least = min(least, line[i])
                    if least >= cap:
                        continue
                    for i in range(n):
                        best = line[i]
                        for s in range(max(0, i - band + 1), min(n, i + band)):
                            best = min(best, np.float32(line[s] + _gap(s - i)))
                        if axis == 0:
                            a[i, j, k] = best
                        else:
                            a[j, i, k] = best
        scale = np.float32(spacing * spacing * DOWN)
        for i in range(nx):
            for j in range(ny):
                for k in range(nz):
                    if inside == 0 and cells[i, j, k] == 0:
                        field[i, j, k] = a[i, j, k] * scale
                    elif inside == 1 and cells[i, j, k] != 0:
                        field[i, j, k] = -a[i, j, k] * scale
    return field


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def box_square(low: Array, high: Array, x: float, y: float, z: float) -> float:
    """Squared distance of a point to the upright box from ``low`` to ``high`` [m²]."""
    dx = max(low[0] - x, 0.0, x - high[0])
    dy = max(low[1] - y, 0.0, y - high[1])
    dz = max(low[2] - z, 0.0, z - high[2])
    return float(dx * dx + dy * dy + dz * dz)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _out(value: float) -> float:
    return value if value > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def square_at_least(region: Region, x: float, y: float, z: float, enough: float) -> float:
    """Lower bound of the squared distance of a point to a set [m²]; 0 or less when it may be inside.

    Args:
        region: The set.
        x: The point [m]; ``y`` and ``z`` likewise.
        enough: A bound above this need not be a better one [m²].
    """
    field, start, spacing, low, high = region
    least = box_square(low, high, x, y, z)
    nx, ny, nz = field.shape
    if nx == 0 or least > enough:
        return least
    u = (x - start[0]) / spacing
    v = (y - start[1]) / spacing
    w = (z - start[2]) / spacing
    if not (u >= 0.0 and v >= 0.0 and w >= 0.0 and u < nx - 1 and v < ny - 1 and w < nz - 1):
        return least
    i = int(u)
    j = int(v)
    k = int(w)
    a = u - i
    b = v - j
    c = w - k
    f00 = _out(field[i, j, k]) * (1.0 - c) + _out(field[i, j, k + 1]) * c
    f01 = _out(field[i, j + 1, k]) * (1.0 - c) + _out(field[i, j + 1, k + 1]) * c
    f10 = _out(field[i + 1, j, k]) * (1.0 - c) + _out(field[i + 1, j, k + 1]) * c
    f11 = _out(field[i + 1, j + 1, k]) * (1.0 - c) + _out(field[i + 1, j + 1, k + 1]) * c
    mean = (f00 * (1.0 - b) + f01 * b) * (1.0 - a) + (f10 * (1.0 - b) + f11 * b) * a
    return float(max(least, mean - spacing * spacing * (a * (1.0 - a) + b * (1.0 - b) + c * (1.0 - c))))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def signed_at_most(region: Region, x: float, y: float, z: float) -> float:
    """Upper bound of the signed distance of a point to a set (negative inside) [m]; infinity if unknown."""
    field, start, spacing, low, high = region
    nx, ny, nz = field.shape
    if nx == 0:
        out = box_square(low, high, x, y, z)
        if out > 0.0:
            return math.sqrt(out)
        return -float(min(x - low[0], high[0] - x, y - low[1], high[1] - y, z - low[2], high[2] - z))
    i = int(np.floor((x - start[0]) / spacing + 0.5))
    j = int(np.floor((y - start[1]) / spacing + 0.5))
    k = int(np.floor((z - start[2]) / spacing + 0.5))
    if not (0 <= i < nx and 0 <= j < ny and 0 <= k < nz):
        return np.inf
    value = field[i, j, k]
    dx = x - start[0] - i * spacing
    dy = y - start[1] - j * spacing
    dz = z - start[2] - k * spacing
    away = math.sqrt(dx * dx + dy * dy + dz * dz)
    # Far nodes hold less than the distance: only what is inside tells how far at most.
    return away - math.sqrt(-value) if value < 0.0 else np.inf
