"""How far bodies are from edges of a polygon on the floor, in its plane."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Indices = NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def turn(a: Array, b: Array, c: Array) -> float:
    """Twice the area of a triangle, above 0 where it turns left."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


@njit(cache=True, nogil=True, error_model="numpy")
def _sift(p: Array, root: int, end: int) -> None:
    """Let a row of a heap sink to where no later one, by x and where that is the same by y, is below it."""
    while 2 * root + 1 < end:
        child = 2 * root + 1
        other = child + 1
        if other < end and (
            p[child, 0] < p[other, 0] or (p[child, 0] == p[other, 0] and p[child, 1] < p[other, 1])
        ):
            child = other
        if p[root, 0] > p[child, 0] or (p[root, 0] == p[child, 0] and p[root, 1] >= p[child, 1]):
            return
        for i in range(2):
            p[root, i], p[child, i] = p[child, i], p[root, i]
        root = child


@njit(cache=True, nogil=True, error_model="numpy")
def hull(points: Array) -> Array:
    """Convex hull of points in the plane by [Andrew1979]_, counter-clockwise, (n, 2) to (k, 2).

    Sorted and copied number by number: Numba takes 10 s to compile its own sort and slices that are written.
    """
    p = points.copy()
    n = len(p)
    for root in range(n // 2 - 1, -1, -1):
        _sift(p, root, n)
    for end in range(n - 1, 0, -1):
        for i in range(2):
            p[0, i], p[end, i] = p[end, i], p[0, i]
        _sift(p, 0, end)
    found = np.empty((2 * n + 1, 2))
    k = 0
    for i in range(n):
        while k >= 2 and turn(found[k - 2], found[k - 1], p[i]) <= 0.0:
            k -= 1
        found[k, 0], found[k, 1] = p[i, 0], p[i, 1]
        k += 1
    lower = k + 1
    for i in range(n - 2, -1, -1):
        while k >= lower and turn(found[k - 2], found[k - 1], p[i]) <= 0.0:
            k -= 1
        found[k, 0], found[k, 1] = p[i, 0], p[i, 1]
        k += 1
    return found[: max(k - 1, 1)].copy()


@njit(cache=True, nogil=True, error_model="numpy")
def _set(ends: Array, a: Array, b: Array) -> None:
    """Write two points."""
    for i in range(2):
        ends[0, i], ends[1, i] = a[i], b[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _to_segment(p: Array, a: Array, b: Array, foot: Array) -> float:
    """Distance of a point to a segment, and the point of the segment that is nearest to it."""
    ex, ey = b[0] - a[0], b[1] - a[1]
    share = ((p[0] - a[0]) * ex + (p[1] - a[1]) * ey) / max(ex * ex + ey * ey, 1e-300)
    share = min(max(share, 0.0), 1.0)
    foot[0], foot[1] = a[0] + share * ex, a[1] + share * ey
    return math.sqrt((p[0] - foot[0]) ** 2 + (p[1] - foot[1]) ** 2)


@njit(cache=True, nogil=True, error_model="numpy")
def _cross(p: Array, q: Array, a: Array, b: Array) -> bool:
    """Whether two segments have a point in common, but for touching."""
    return bool(turn(p, q, a) * turn(p, q, b) < 0.0 and turn(a, b, p) * turn(a, b, q) < 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def ring_to_edges(ring: Array, border: Array, edges: Indices, ends: Array) -> float:
    """Least distance of a closed ring of points to some edges of a polygon; 0 where they cross.

    Args:
        ring: Shape (n, 2) [m].
        border: Corners of the polygon, shape (m, 2) [m].
        edges: Which of its edges.
        ends: Receives the point on the ring and the point on the border, shape (2, 2) [m].
    """
    best = np.inf
    foot = np.empty(2)
    for i in range(len(ring)):
        p, q = ring[i], ring[(i + 1) % len(ring)]
        for e in edges:
            a, b = border[e], border[(e + 1) % len(border)]
            if _cross(p, q, a, b):
                _set(ends, p, p)
                return 0.0
            d = _to_segment(p, a, b, foot)
            if d < best:
                best = d
                _set(ends, p, foot)
            for c in (a, b):
                d = _to_segment(c, p, q, foot)
                if d < best:
                    best = d
                    _set(ends, foot, c)
    return float(best)


@njit(cache=True, nogil=True, error_model="numpy")
def _encloses(ring: Array, x: float, y: float) -> bool:
    inside = False
    for i in range(len(ring)):
        a, b = ring[i], ring[(i + 1) % len(ring)]
        if (a[1] > y) != (b[1] > y) and x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]):
            inside = not inside
    return inside


@njit(cache=True, nogil=True, error_model="numpy")
def _beyond(border: Array, edges: Indices, area: float, p: Array) -> bool:
    """Whether a point lies on the outer side of the edge that it is nearest to."""
    best, left = np.inf, 0.0
    foot = np.empty(2)
    for e in edges:
        a, b = border[e], border[(e + 1) % len(border)]
        d = _to_segment(p, a, b, foot)
        if d < best:
            best = d
            left = turn(a, b, p)
    return left * area < 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def bodies_to_border(
    bodies: Indices,
    rotations: Array,
    positions: Array,
    corners: Array,
    start: Indices,
    radius: Array,
    plane: int,
    border: Array,
    edges: Indices,
    every: bool,
    ends: Array,
) -> tuple[float, int]:
    """The body that is nearest to the border from inside a polygon, or farthest beyond it.

    Args:
        bodies: Which to look at.
        rotations: world_from_body of every body, shape (n, 3, 3).
        positions: Likewise [m], shape (n, 3).
        corners: Points of these bodies whose hull, dilated by ``radius``, contains each [m], shape (k, 3).
        start: Where those of each begin, shape (b + 1,).
        radius: [m], shape (b,).
        plane: The body whose xy plane the polygon lies in.
        border: Its corners, shape (m, 2) [m].
        edges: Which of its edges count.
        every: Whether those are all, so that outside the polygon is beyond them.
        ends: Receives the points on the border and on the body, in the plane, and the height of the body's
            lowest corner in the world [m], shape (5,).

    Returns:
        Distance in the plane [m], not above 0 beyond the border, and the row of the body.
    """
    area = 0.0
    for i in range(len(border)):
        a, b = border[i], border[(i + 1) % len(border)]
        area += a[0] * b[1] - a[1] * b[0]
    R, x = rotations[plane], positions[plane]
    two = np.empty((2, 2))
    best, row = np.inf, -1
    for k in range(len(bodies)):
        B, y = rotations[bodies[k]], positions[bodies[k]]
        n = start[k + 1] - start[k]
        flat = np.empty((n, 2))
        lowest = np.inf
        outside = False
        for i in range(n):
            c = corners[start[k] + i]
            wx = B[0, 0] * c[0] + B[0, 1] * c[1] + B[0, 2] * c[2] + y[0]
            wy = B[1, 0] * c[0] + B[1, 1] * c[1] + B[1, 2] * c[2] + y[1]
            wz = B[2, 0] * c[0] + B[2, 1] * c[1] + B[2, 2] * c[2] + y[2]
            lowest = min(lowest, wz)
            for a_ in range(2):
                flat[i, a_] = R[0, a_] * (wx - x[0]) + R[1, a_] * (wy - x[1]) + R[2, a_] * (wz - x[2])
        ring = hull(flat)
        d = ring_to_edges(ring, border, edges, two)
        if every:
            for i in range(len(ring)):
                outside = outside or not _encloses(border, ring[i, 0], ring[i, 1])
        value = -d if outside or _beyond(border, edges, area, two[0]) else d
        value -= radius[k]
        if value < best:
            best, row = value, k
            for i in range(2):
                ends[i], ends[2 + i] = two[1, i], two[0, i]
            ends[4] = lowest
    return best, row
