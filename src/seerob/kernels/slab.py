r"""Triangles of two meshes that can be nearest at all, told by the line between two points of them.

Along a direction u a triangle of a second mesh is no nearer to one of a first mesh than the least of its
:math:`u \cdot x` less the largest of the other's. With u from one of two points near each other to the other
that bound is nearly the distance itself, for all but the few triangles about these points; two directions
across u tell which of those lie beside one another. For meshes of some hundred triangles this takes less
time than to go down their trees.

Extents along u, v and w add up, as those of boxes do: gaps are rounded as in `seerob.kernels.wide`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.search import Vec

Links = NDArray[np.int32]

FEW = 400
"""Triangles of both meshes above which their trees are faster."""
MOST = 32
"""Triangles of the first mesh that may be nearest, or pairs, above which their trees are faster, too."""


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _extent(T: Array, k: int, u: Vec) -> tuple[float, float]:
    """Least and largest of u·x of a triangle."""
    x = T[k, 0] * u[0] + T[k, 1] * u[1] + T[k, 2] * u[2]
    p = T[k, 3] * u[0] + T[k, 4] * u[1] + T[k, 5] * u[2]
    q = T[k, 6] * u[0] + T[k, 7] * u[1] + T[k, 8] * u[2]
    return x + min(p, q, 0.0), x + max(p, q, 0.0)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _turned(R: Array, u: Vec) -> Vec:
    """A direction of frame a in frame b, given the rotation a_from_b."""
    return (
        R[0] * u[0] + R[3] * u[1] + R[6] * u[2],
        R[1] * u[0] + R[4] * u[1] + R[7] * u[2],
        R[2] * u[0] + R[5] * u[1] + R[8] * u[2],
    )


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _across(u: Vec) -> tuple[Vec, Vec]:
    """Two directions that make a frame with u."""
    x, y, z = u
    if abs(x) > 0.7:
        over = 1.0 / math.sqrt(x * x + y * y)
        v = (-y * over, x * over, 0.0)
    else:
        over = 1.0 / math.sqrt(y * y + z * z)
        v = (0.0, -z * over, y * over)
    return v, (y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0])


@njit(cache=True, nogil=True, error_model="numpy")
def pairs_in_slab(
    T: Array,
    of_a: tuple[int, int],
    of_b: tuple[int, int],
    R: Array,
    t: Array,
    u: Vec,
    cut: float,
    fine: float,
    near: Links,
    ends: Array,
) -> int:
    """Pairs of triangles that may be no farther apart than ``cut``.

    Args:
        T: Triangles, as `seerob.kernels.primitives` lays them out.
        of_a: First and last triangle of the first mesh.
        of_b: Of the second one, likewise.
        R: Rotation a_from_b, shape (9,).
        t: Position a_from_b [m], shape (3,).
        u: From a point of the first mesh to one of the second, in frame a, of length 1.
        cut: Squared distance [m²].
        fine: What rounding takes of a gap [m].
        near: Receives the pairs, those of one triangle of the second mesh together, shape (n, 2), n ≥ `MOST`.
        ends: Scratch, shape (m, 7), m ≥ `FEW`.

    Returns:
        How many; -1 for too many to be worth it.
    """
    a0, a1 = of_a
    b0, b1 = of_b
    reach = math.sqrt(cut * (1.0 + 1e-6)) + fine
    ub = _turned(R, u)
    shift = u[0] * t[0] + u[1] * t[1] + u[2] * t[2]
    front, back = -np.inf, np.inf
    for k in range(a0, a1):
        _, high = _extent(T, k, u)
        ends[k - a0, 0] = high
        front = max(front, high)
    n = a1 - a0
    for k in range(b0, b1):
        low, _ = _extent(T, k, ub)
        low += shift
        ends[n + k - b0, 0] = low
        back = min(back, low)
    v, w = _across(u)
    some = 0
    for k in range(n):
        high = ends[k, 0]
        if back - high <= reach:
            if some == MOST:
                return -1
            ends[some, 1], ends[some, 6] = high, a0 + k
            ends[some, 2], ends[some, 3] = _extent(T, a0 + k, v)
            ends[some, 4], ends[some, 5] = _extent(T, a0 + k, w)
            some += 1
    vb, wb = _turned(R, v), _turned(R, w)
    besides = v[0] * t[0] + v[1] * t[1] + v[2] * t[2]
    above = w[0] * t[0] + w[1] * t[1] + w[2] * t[2]
    most = cut * (1.0 + 1e-6)
    found = 0
    for k in range(b0, b1):
        low = ends[n + k - b0, 0]
        if low - front > reach:
            continue
        v0, v1 = _extent(T, k, vb)
        w0, w1 = _extent(T, k, wb)
        for c in range(some):
            gap = max(low - ends[c, 1] - fine, 0.0)
            side = max(v0 + besides - ends[c, 3], ends[c, 2] - (v1 + besides), fine) - fine
            other = max(w0 + above - ends[c, 5], ends[c, 4] - (w1 + above), fine) - fine
            if gap * gap + side * side + other * other <= most:
                if found == MOST:
                    return -1
                near[found, 0], near[found, 1] = int(ends[c, 6]), k
                found += 1
    return found
