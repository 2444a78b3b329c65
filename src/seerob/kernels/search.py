r"""Branch and bound in trees of boxes: nearest point of a mesh to a segment, and where two meshes touch.

A box is skipped only when its lower bound exceeds ``cut = best·(1 + 1e-9) + 1e-18`` [m²], which is
more than rounding can do to a bound (1e-15 m) and to a distance. So the primitive that wins is the
first, in the order (distance, index), of *all* primitives: upper bounds and the primitive that was
tried first change the time spent, never a bit of the answer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.boxes import box_box, segment_box
from seerob.kernels.primitives import index, on_edges, segment_triangle, triangles

Links = NDArray[np.int32]
Vec = tuple[float, float, float]
POINT = (0.0, 0.0, 0.0)
"""Direction of a segment that is a point."""


class Mesh(NamedTuple):
    """One mesh in a tree, as `seerob.kernels.tree.build_tree` lays it out."""

    nodes: Array
    links: Links
    T: Array


class Work(NamedTuple):
    """Where `mesh_segment` works."""

    stack: Links
    bounds: Array
    W: Array
    """Receives the points on mesh and segment, shape (6,)."""


@njit(cache=True, nogil=True, error_model="numpy")
def work() -> Work:
    """Room for one search at a time."""
    return Work(np.empty(128, np.int32), np.empty(128), np.empty(6))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def cut_of(best: float) -> float:
    """Squared distance above which nothing can win or tie with ``best`` [m²]."""
    return best * (1.0 + 1e-9) + 1e-18


@njit(cache=True, nogil=True, error_model="numpy")
def mesh_segment(mesh: Mesh, a: Vec, d: Vec, limit: float, first: int, work: Work) -> tuple[float, int]:
    """Nearest point of a mesh to the segment ``a + s·d``, both in the mesh's frame.

    Args:
        mesh: The mesh.
        a: Begin of the segment [m].
        d: From there to its end [m]; `POINT` of a point.
        limit: Squared distance above which nothing is looked for [m²].
        first: Triangle to begin with, -1 for none.
        work: Receives the points, too.

    Returns:
        Squared distance and triangle; infinity and -1 when all exceed ``limit``.
    """
    nodes, links, T = mesh
    stack, bounds, W = work
    ax, ay, az = a
    dx, dy, dz = d
    best = np.inf
    cut = limit
    winner = -1
    dd = dx * dx + dy * dy + dz * dz
    if first >= 0:
        g, s, px, py, pz = segment_triangle(ax, ay, az, dx, dy, dz, T, first, cut)
        if g <= cut:
            best = g
            cut = min(cut, cut_of(best))
            winner = first
            W[0], W[1], W[2], W[3], W[4], W[5] = px, py, pz, ax + s * dx, ay + s * dy, az + s * dz
    low = segment_box(nodes, int(np.int64(0)), ax, ay, az, dx, dy, dz, dd, cut)
    stack[0] = 0
    bounds[0] = low
    depth = 1
    while depth > 0:
        depth -= 1
        if bounds[depth] > cut:
            continue
        i = stack[depth]
        if links[i, 1] > 0:
            for k in range(links[i, 0], links[i, 0] + links[i, 1]):
                if k == first:
                    continue
                g, s, px, py, pz = segment_triangle(ax, ay, az, dx, dy, dz, T, k, cut)
                if g <= cut and (g < best or (g == best and k < winner)):
                    best = g
                    cut = min(cut, cut_of(best))
                    winner = k
                    W[0], W[1], W[2], W[3], W[4], W[5] = px, py, pz, ax + s * dx, ay + s * dy, az + s * dz
        else:
            left = i + 1
            right = links[i, 0]
            far = segment_box(nodes, left, ax, ay, az, dx, dy, dz, dd, cut)
            near = segment_box(nodes, right, ax, ay, az, dx, dy, dz, dd, cut)
            if far < near:
                left, right, far, near = right, left, near, far
            if far <= cut:
                stack[depth] = left
                bounds[depth] = far
                depth += 1
            if near <= cut:
                stack[depth] = right
                bounds[depth] = near
                depth += 1
    return best, winner


@njit(cache=True, nogil=True, error_model="numpy")
def row_in(T: Array, k: int, R: Array, t: Array, row: Array) -> None:
    """Triangle ``T[k]`` in frame a, given a_from_b, to ``row`` (1, 13)."""
    for c in range(3):
        for e in range(4):
            row[0, 3 * e + c] = (
                R[3 * c] * T[k, 3 * e] + R[3 * c + 1] * T[k, 3 * e + 1] + R[3 * c + 2] * T[k, 3 * e + 2]
            )
        row[0, c] += t[c]
    row[0, 12] = T[k, 12]


@njit(cache=True, nogil=True, error_model="numpy")
def first_crossing(
    first: Mesh, second: Mesh, R: Array, t: Array, pairs: Links, row: Array, W: Array
) -> tuple[int, int]:
    """The first two triangles that touch, down two trees, of meshes that do; -1, -1 where none does.

    Args:
        first: The first mesh.
        second: The second one.
        R: Rotation a_from_b, shape (9,).
        t: Position a_from_b [m], shape (3,).
        pairs: Scratch, shape (256, 2).
        row: Scratch, shape (1, 13).
        W: Receives the point on each in the frame of the first, shape (12,), of which 6 are scratch.
    """
    A, LA, TA = first
    B, LB, TB = second
    cut = cut_of(0.0)
    pairs[0, 0] = 0
    pairs[0, 1] = 0
    depth = 1
    while depth > 0:
        depth -= 1
        i = index(pairs[depth, 0])
        j = index(pairs[depth, 1])
        if LA[i, 1] > 0 and LB[j, 1] > 0:
            for a in range(LA[i, 0], LA[i, 0] + LA[i, 1]):
                for b in range(LB[j, 0], LB[j, 0] + LB[j, 1]):
                    row_in(TB, b, R, t, row)
                    d2, s, v, both = triangles(TA, a, row, index(0), cut, W)
                    if d2 == 0.0:
                        on_edges(TA, a, row, index(0), s, v, both, W)
                        return a, b
            continue
        if LB[j, 1] > 0 or (LA[i, 1] == 0 and A[i, 19] > B[j, 19]):
            i1, j1, i2, j2 = i + 1, j, index(LA[i, 0]), j
        else:
            i1, j1, i2, j2 = i, j + 1, i, index(LB[j, 0])
        low1 = box_box(A, i1, B, j1, R, t, cut)
        low2 = box_box(A, i2, B, j2, R, t, cut)
        if low1 < low2:
            i1, j1, i2, j2, low1, low2 = i2, j2, i1, j1, low2, low1
        if low1 <= cut:
            pairs[depth, 0] = i1
            pairs[depth, 1] = j1
            depth += 1
        if low2 <= cut:
            pairs[depth, 0] = i2
            pairs[depth, 1] = j2
            depth += 1
    return -1, -1
