r"""Branch and bound in trees of boxes: nearest points of a mesh to a segment and of two meshes.

A box is skipped only when its lower bound exceeds ``cut = best·(1 + 1e-9) + 1e-18`` [m²], which is
more than rounding can do to a bound (1e-15 m) and to a distance. So the primitive that wins is the
first, in the order (distance, index), of *all* primitives: upper bounds and the primitive that was
tried first change the time spent, never a bit of the answer.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.transforms import Array

Links = NDArray[np.int32]
Indices = NDArray[np.int64]

from seerob.kernels.primitives import segment_triangle, triangle_triangle


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def cut_of(best: float) -> float:
    """Squared distance above which nothing can win or tie with ``best`` [m²]."""
    return best * (1.0 + 1e-9) + 1e-18


@njit(cache=True, nogil=True, error_model="numpy")
def segment_box(
    nodes: Array, i: int, ax: float, ay: float, az: float, dx: float, dy: float, dz: float, dd: float
) -> float:
    """Lower bound of the squared distance of ``a + s·d`` to box i: box axes and centre direction."""
    cx = nodes[i, 0]
    cy = nodes[i, 1]
    cz = nodes[i, 2]
    hx = nodes[i, 3]
    hy = nodes[i, 4]
    hz = nodes[i, 5]
    mx = max(abs(ax + 0.5 * dx - cx) - 0.5 * abs(dx) - hx, 0.0)
    my = max(abs(ay + 0.5 * dy - cy) - 0.5 * abs(dy) - hy, 0.0)
    mz = max(abs(az + 0.5 * dz - cz) - 0.5 * abs(dz) - hz, 0.0)
    low = mx * mx + my * my + mz * mz
    rx = cx - ax
    ry = cy - ay
    rz = cz - az
    t = (rx * dx + ry * dy + rz * dz) / dd if dd > 0.0 else 0.0
    t = min(max(t, 0.0), 1.0)
    # All of the segment lies beyond its point nearest to the centre, seen from the centre.
    rx -= t * dx
    ry -= t * dy
    rz -= t * dz
    q = rx * rx + ry * ry + rz * rz
    reach = hx * abs(rx) + hy * abs(ry) + hz * abs(rz)
    if q > reach:
        gap = q - reach
        low = max(low, gap * gap / q)
    return low


@njit(cache=True, nogil=True, error_model="numpy")
def mesh_segment(
    nodes: Array,
    links: Links,
    T: Array,
    ax: float,
    ay: float,
    az: float,
    dx: float,
    dy: float,
    dz: float,
    limit: float,
    first: int,
    stack: Links,
    bounds: Array,
    W: Array,
) -> tuple[float, int]:
    """Nearest point of a mesh to the segment ``a + s·d``, both in the mesh's frame.

    Args:
        nodes: Tree of the mesh, see `seerob.kernels.tree.build_tree`.
        links: Likewise.
        T: Likewise.
        ax: Segment [m]; ``ay`` to ``dz`` likewise.
        limit: Squared distance above which nothing is looked for [m²].
        first: Triangle to begin with, -1 for none.
        stack: Scratch, shape (128,).
        bounds: Scratch, shape (128,).
        W: Receives the points on mesh and segment, shape (6,).

    Returns:
        Squared distance and triangle; infinity and -1 when all exceed ``limit``.
    """
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
    low = segment_box(nodes, 0, ax, ay, az, dx, dy, dz, dd)
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
            a = segment_box(nodes, left, ax, ay, az, dx, dy, dz, dd)
            b = segment_box(nodes, right, ax, ay, az, dx, dy, dz, dd)
            if a < b:
                left, right, a, b = right, left, b, a
            if a <= cut:
                stack[depth] = left
                bounds[depth] = a
                depth += 1
            if b <= cut:
                stack[depth] = right
                bounds[depth] = b
                depth += 1
    return best, winner


@njit(cache=True, nogil=True, error_model="numpy")
def box_box(A: Array, i: int, B: Array, j: int, R: Array, F: Array, t: Array) -> float:
    """Lower bound of the squared distance of boxes ``A[i]`` and ``B[j]``.

    Args:
        A: Nodes.
        i: Box of A.
        B: Nodes.
        j: Box of B.
        R: Rotation a_from_b, shape (9,).
        F: Its absolute values, shape (9,).
        t: Position a_from_b [m], shape (3,).
    """
    hx = B[j, 3]
    hy = B[j, 4]
    hz = B[j, 5]
    gx = A[i, 3]
    gy = A[i, 4]
    gz = A[i, 5]
    cx = R[0] * B[j, 0] + R[1] * B[j, 1] + R[2] * B[j, 2] + t[0] - A[i, 0]
    cy = R[3] * B[j, 0] + R[4] * B[j, 1] + R[5] * B[j, 2] + t[1] - A[i, 1]
    cz = R[6] * B[j, 0] + R[7] * B[j, 1] + R[8] * B[j, 2] + t[2] - A[i, 2]
    mx = max(abs(cx) - gx - (F[0] * hx + F[1] * hy + F[2] * hz), 0.0)
    my = max(abs(cy) - gy - (F[3] * hx + F[4] * hy + F[5] * hz), 0.0)
    mz = max(abs(cz) - gz - (F[6] * hx + F[7] * hy + F[8] * hz), 0.0)
    low = mx * mx + my * my + mz * mz
    ux = abs(R[0] * cx + R[3] * cy + R[6] * cz)
    uy = abs(R[1] * cx + R[4] * cy + R[7] * cz)
    uz = abs(R[2] * cx + R[5] * cy + R[8] * cz)
    mx = max(ux - hx - (F[0] * gx + F[3] * gy + F[6] * gz), 0.0)
    my = max(uy - hy - (F[1] * gx + F[4] * gy + F[7] * gz), 0.0)
    mz = max(uz - hz - (F[2] * gx + F[5] * gy + F[8] * gz), 0.0)
    low = max(low, mx * mx + my * my + mz * mz)
    q = cx * cx + cy * cy + cz * cz
    reach = gx * abs(cx) + gy * abs(cy) + gz * abs(cz) + hx * ux + hy * uy + hz * uz
    if q > reach:
        gap = q - reach
        low = max(low, gap * gap / q)
    return low


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _row_in(T: Array, k: int, R: Array, t: Array, row: Array) -> None:
    """Triangle ``T[k]`` in frame a, given a_from_b, to ``row`` (1, 13)."""
    for c in range(3):
        for e in range(4):
            row[0, 3 * e + c] = (
                R[3 * c] * T[k, 3 * e] + R[3 * c + 1] * T[k, 3 * e + 1] + R[3 * c + 2] * T[k, 3 * e + 2]
            )
        row[0, c] += t[c]
    row[0, 12] = T[k, 12]


@njit(cache=True, nogil=True, error_model="numpy")
def mesh_mesh(
    A: Array,
    LA: Links,
    TA: Array,
    B: Array,
    LB: Links,
    TB: Array,
    R: Array,
    t: Array,
    limit: float,
    first_a: int,
    first_b: int,
    pairs: Links,
    bounds: Array,
    W: Array,
) -> tuple[float, int, int]:
    """Nearest points of two meshes, in the frame of the first.

    Args:
        A: Tree of the first mesh.
        LA: Likewise.
        TA: Likewise.
        B: Tree of the second mesh.
        LB: Likewise.
        TB: Likewise.
        R: Rotation a_from_b, shape (9,).
        t: Position a_from_b [m], shape (3,).
        limit: Squared distance above which nothing is looked for [m²].
        first_a: Triangles to begin with, -1 for none.
        first_b: Likewise.
        pairs: Scratch, shape (256, 2).
        bounds: Scratch, shape (256,).
        W: Receives the points, shape (12,), of which 6 are scratch.

    Returns:
        Squared distance and the two triangles; infinity and -1 when all exceed ``limit``.
        Stops at the first intersection, which depends on ``limit`` and ``first``: ask again
        without them for *the* first one.
    """
    F = np.abs(R)
    row = np.empty((1, 13))
    points = np.empty(12)
    best = np.inf
    cut = limit
    ka = kb = -1
    if first_a >= 0:
        _row_in(TB, first_b, R, t, row)
        g = triangle_triangle(TA, first_a, row, 0, cut, points)
        if g <= cut:
            best = g
            cut = min(cut, cut_of(best))
            ka = first_a
            kb = first_b
            W[:6] = points[:6]
    pairs[0, 0] = 0
    pairs[0, 1] = 0
    bounds[0] = box_box(A, 0, B, 0, R, F, t)
    depth = 1
    while depth > 0 and best > 0.0:
        depth -= 1
        if bounds[depth] > cut:
            continue
        i = pairs[depth, 0]
        j = pairs[depth, 1]
        if LA[i, 1] > 0 and LB[j, 1] > 0:
            for b in range(LB[j, 0], LB[j, 0] + LB[j, 1]):
                _row_in(TB, b, R, t, row)
                for a in range(LA[i, 0], LA[i, 0] + LA[i, 1]):
                    g = triangle_triangle(TA, a, row, 0, cut, points)
                    if g <= cut and (g < best or (g == best and (a < ka or (a == ka and b < kb)))):
                        best = g
                        cut = min(cut, cut_of(best))
                        ka = a
                        kb = b
                        W[:6] = points[:6]
            continue
        descend_a = LB[j, 1] > 0 or (
            LA[i, 1] == 0 and A[i, 3] + A[i, 4] + A[i, 5] > B[j, 3] + B[j, 4] + B[j, 5]
        )
        if descend_a:
            i1, j1, i2, j2 = i + 1, j, np.int64(LA[i, 0]), j
        else:
            i1, j1, i2, j2 = i, j + 1, i, np.int64(LB[j, 0])
        low1 = box_box(A, i1, B, j1, R, F, t)
        low2 = box_box(A, i2, B, j2, R, F, t)
        if low1 < low2:
            i1, j1, i2, j2, low1, low2 = i2, j2, i1, j1, low2, low1
        if low1 <= cut:
            pairs[depth, 0] = i1
            pairs[depth, 1] = j1
            bounds[depth] = low1
            depth += 1
        if low2 <= cut:
            pairs[depth, 0] = i2
            pairs[depth, 1] = j2
            bounds[depth] = low2
            depth += 1
    return best, ka, kb
