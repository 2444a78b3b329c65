r"""How deep one solid reaches into another: the largest depth of a point of both, by branch and bound.

The depth of a point x in a solid A is its distance to A's surface, and the answer is
:math:`\max \{ \operatorname{depth}_A(x) : x \in A \cap B \}`. Both solids may be concave.

In a cell with centre c the depth is at most :math:`\max_x |x - p|` with p the point of A's surface nearest
to c: the distance to the cell's farthest corner. (Outside A it is 0, which is less.) No point of B is in the
cell when c is farther from B than the cell's corners. Each cell also yields a point of B (c itself or the
one nearest to it) whose depth is a lower bound of the answer. The interval closes until it is narrower than
the tolerance, or the cells are used up: it holds either way.
"""

from __future__ import annotations

import math
from heapq import heappop, heappush

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.kernels.pairs import CORNERS, MESH, NODE, NODE_END, TRIANGLE, TRIANGLE_END, VOLUME
from seerob.kernels.primitives import point_segment
from seerob.kernels.search import mesh_segment
from seerob.kernels.winding import contains
from seerob.transforms import Array

Links = NDArray[np.int32]
Indices = NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def signed_distance(
    s: int,
    which: Indices,
    corners: Array,
    radius: Array,
    nodes: Array,
    links: Links,
    T: Array,
    world: Array,
    x: Array,
    stack: Links,
    bounds: Array,
    W: Array,
    near: Array,
) -> float:
    """Distance of a point to the surface of a solid, negative inside; ``near`` is its nearest surface point.

    Args:
        s: The solid.
        which: See `seerob.kernels.shapes.Shapes`; ``corners`` to ``T`` likewise.
        corners: Likewise.
        radius: Likewise.
        nodes: Likewise.
        links: Likewise.
        T: Likewise.
        world: world_from_solid, nine of the rotation and three of the position, shape (ns, 12).
        x: The point in the world [m], shape (3,).
        stack: Scratch, shape (128,).
        bounds: Scratch, shape (128,).
        W: Scratch, shape (6,).
        near: Receives the point in the world [m], shape (3,).
    """
    p = np.empty(3)
    for c in range(3):
        p[c] = 0.0
        for d in range(3):
            p[c] += world[s, 3 * d + c] * (x[d] - world[s, 9 + d])
    sign = 1.0
    q = np.empty(3)
    if which[s, MESH] == 1:
        n0, n1 = which[s, NODE], which[s, NODE_END]
        t0, t1 = which[s, TRIANGLE], which[s, TRIANGLE_END]
        d2, _ = mesh_segment(
            nodes[n0:n1], links[n0:n1], T[t0:t1], p[0], p[1], p[2], 0.0, 0.0, 0.0, np.inf, -1,
            stack, bounds, W,
        )  # fmt: skip
        q[:] = W[:3]
        if which[s, VOLUME] == 1 and contains(nodes[n0:n1], links[n0:n1], T[t0:t1], p[0], p[1], p[2]):
            sign = -1.0
    else:
        a = corners[s, 0]
        e = corners[s, 1] - a if which[s, CORNERS] > 1 else np.zeros(3)
        dd = e[0] * e[0] + e[1] * e[1] + e[2] * e[2]
        d2, t = point_segment(p[0], p[1], p[2], a[0], a[1], a[2], e[0], e[1], e[2], dd)
        for c in range(3):
            q[c] = a[c] + t * e[c]
    gap = math.sqrt(d2)
    if radius[s] > 0.0:
        # The surface lies the radius farther along the line through the core's nearest point.
        if gap > 1e-12:
            for c in range(3):
                q[c] += sign * (p[c] - q[c]) * radius[s] / gap
        else:
            q[0] += radius[s]
    for c in range(3):
        near[c] = world[s, 9 + c]
        for d in range(3):
            near[c] += world[s, 3 * c + d] * q[d]
    return float(sign * gap - radius[s])


@njit(cache=True, nogil=True, error_model="numpy")
def deepest(
    i: int,
    j: int,
    which: Indices,
    corners: Array,
    radius: Array,
    nodes: Array,
    links: Links,
    T: Array,
    world: Array,
    low: Array,
    high: Array,
    tolerance: float,
    cells: int,
    at: Array,
) -> tuple[float, float]:
    """Interval of how deep solid j reaches into solid i.

    Args:
        i: The solid that is entered.
        j: The one that enters.
        which: See `signed_distance`; ``corners`` to ``world`` likewise.
        corners: Likewise.
        radius: Likewise.
        nodes: Likewise.
        links: Likewise.
        T: Likewise.
        world: Likewise.
        low: Corner of a box in the world that contains what both have in common [m], shape (3,).
        high: The opposite corner.
        tolerance: Width of the interval that is enough [m].
        cells: Largest number of cells.
        at: Receives the deepest point found [m], shape (3,).

    Returns:
        At least and at most [m]; 0, 0 when they have no point in common.
    """
    stack = np.empty(128, np.int32)
    bounds = np.empty(128)
    W = np.empty(6)
    x, y, near, other = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    best = 0.0
    c = (low + high) / 2.0
    h = (high - low) / 2.0
    heap = [(-np.inf, c[0], c[1], c[2], h[0], h[1], h[2])]
    used = 0
    while len(heap) > 0:
        top, cx, cy, cz, hx, hy, hz = heappop(heap)
        if -top <= best + tolerance:
            return best, max(-top, best)
        if used >= cells:
            return best, -top
        half = np.array([hx, hy, hz])
        x[0], x[1], x[2] = cx, cy, cz
        # Along the axis that the last bound hung on most.
        signed_distance(i, which, corners, radius, nodes, links, T, world, x, stack, bounds, W, near)
        axis = 0
        most = -1.0
        for k in range(3):
            gain = half[k] * (abs(x[k] - near[k]) + half[k])
            if gain > most:
                most = gain
                axis = k
        half[axis] /= 2.0
        for side in range(2):
            used += 1
            x[0], x[1], x[2] = cx, cy, cz
            x[axis] += half[axis] if side == 1 else -half[axis]
            reach = math.sqrt(half[0] ** 2 + half[1] ** 2 + half[2] ** 2)
            gap = signed_distance(
                j, which, corners, radius, nodes, links, T, world, x, stack, bounds, W, other
            )
            if gap > reach + 1e-12:
                continue
            depth = -signed_distance(
                i, which, corners, radius, nodes, links, T, world, x, stack, bounds, W, near
            )
            far = 0.0
            for k in range(3):
                far += (abs(x[k] - near[k]) + half[k]) ** 2
            bound = min(math.sqrt(far), depth + reach)
            y[:] = x
            if gap > 0.0:
                y[:] = other
                depth = -signed_distance(
                    i, which, corners, radius, nodes, links, T, world, y, stack, bounds, W, near
                )
            if depth > best:
                best = depth
                at[:] = y
            if bound > best + tolerance:
                heappush(heap, (-bound, x[0], x[1], x[2], half[0], half[1], half[2]))
            else:
                top = min(top, -bound)
    return best, best + tolerance
