r"""Corners and faces of :math:`\{f \in R^3 : l_i \le a_i^T f \le h_i,\ i = 1 \dots n\}`, exactly.

Each pair of planes that are not parallel meets in a line

.. math:: p + t\,d,\quad d = \frac{a_i \times a_j}{s},\quad s = |a_i \times a_j|,\quad
          p = b_i\,a_i + \frac{b_j - c\,b_i}{s}\; d \times a_i,\quad c = a_i^T a_j

with unit normals, :math:`b` one of the two offsets of each. The other slabs clip the line; what is left
of it is an edge. A bounded polytope in three dimensions has no corner that is not the end of an edge, so
:math:`2n(n-1)` clippings find every one: :math:`O(n^3)`, where the corners of the box of
:math:`(l, h)` are :math:`2^n`. A corner is found once per edge that ends there; `merged` keeps one.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Indices = NDArray[np.int64]

PARALLEL = 1e-12
"""Sine below which a line and a plane, or two planes, are parallel."""
INERT = 1e-12
"""A column shorter than this, relative to the longest, constrains nothing."""
ROUNDING = 1e-12
"""How far outside a parallel slab a line may lie, relative to the largest finite offset."""

EMPTY = -1
"""No point satisfies every constraint."""
UNBOUNDED = -2
"""A line satisfies every constraint that is not parallel to it."""


@njit(cache=True, nogil=True, error_model="numpy")
def unit_slabs(A: Array, low: Array, high: Array) -> tuple[bool, Array, Array, Array]:
    """Scale the normals of a polytope to length one, and drop the columns that are zero.

    Args:
        A: Normals as columns, shape (3, n).
        low: Lower bounds, shape (n,).
        high: Upper bounds, shape (n,).

    Returns:
        Whether the zero columns leave anything, unit normals (m, 3), bounds (m,) and (m,).
    """
    n = A.shape[1]
    N, l, h = np.empty((n, 3)), np.empty(n), np.empty(n)
    longest = 0.0
    for i in range(n):
        longest = max(longest, math.sqrt(A[0, i] ** 2 + A[1, i] ** 2 + A[2, i] ** 2))
    m = 0
    possible = True
    for i in range(n):
        length = math.sqrt(A[0, i] ** 2 + A[1, i] ** 2 + A[2, i] ** 2)
        if length <= INERT * longest:
            possible = possible and low[i] <= 0.0 <= high[i]
            continue
        for r in range(3):
            N[m, r] = A[r, i] / length
        l[m], h[m] = low[i] / length, high[i] / length
        m += 1
    return possible, N[:m], l[:m], h[:m]


@njit(cache=True, nogil=True, error_model="numpy")
def corners(N: Array, l: Array, h: Array, V: Array) -> int:
    """Write the corners of a polytope into ``V``.

    Args:
        N: Unit normals, shape (n, 3).
        l: Lower bounds, finite, shape (n,).
        h: Upper bounds, finite, shape (n,); equal to the lower one for a plane.
        V: Room for corners, shape (m, 3) with m >= 4 n (n - 1).

    Returns:
        Number of corners, each as often as edges end there; `EMPTY` or `UNBOUNDED`.
    """
    n = len(N)
    # For each pair, of the lines' range within slab k: its middle base ± by_i ± by_j, half its length.
    base, by_i, by_j, half = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    scale = 0.0
    for i in range(n):
        scale = max(scale, abs(l[i]), abs(h[i]))
    slack = ROUNDING * scale
    count = 0
    for i in range(n):
        ax, ay, az = N[i, 0], N[i, 1], N[i, 2]
        mi, ri = 0.5 * (l[i] + h[i]), 0.5 * (h[i] - l[i])
        for j in range(i + 1, n):
            bx, by, bz = N[j, 0], N[j, 1], N[j, 2]
            dx, dy, dz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            s2 = dx * dx + dy * dy + dz * dz
            if s2 < PARALLEL * PARALLEL:
                continue
            s = math.sqrt(s2)
            dx, dy, dz = dx / s, dy / s, dz / s
            c = ax * bx + ay * by + az * bz
            mj, rj = 0.5 * (l[j] + h[j]), 0.5 * (h[j] - l[j])
            ex, ey, ez = dy * az - dz * ay, dz * ax - dx * az, dx * ay - dy * ax
            w0, wi, wj = (mj - c * mi) / s, -c * ri / s, rj / s
            for k in range(n):
                if k in (i, j):
                    base[k], by_i[k], by_j[k], half[k] = 0.0, 0.0, 0.0, np.inf
                    continue
                gi = N[k, 0] * ax + N[k, 1] * ay + N[k, 2] * az
                ge = N[k, 0] * ex + N[k, 1] * ey + N[k, 2] * ez
                along = N[k, 0] * dx + N[k, 1] * dy + N[k, 2] * dz
                # A parallel line is within or without, whole; its middle is measured across the slab.
                lies = abs(along) < PARALLEL
                per = 1.0 if lies else 1.0 / along
                base[k] = (0.5 * (l[k] + h[k]) - (mi * gi + w0 * ge)) * per
                by_i[k] = -(ri * gi + wi * ge) * per
                by_j[k] = -wj * ge * per
                half[k] = np.nan if lies else 0.5 * (h[k] - l[k]) * abs(per)
            for side_i in range(2 if ri > 0.0 else 1):
                si = 2.0 * side_i - 1.0
                for side_j in range(2 if rj > 0.0 else 1):
                    sj = 2.0 * side_j - 1.0
                    t0, t1 = -np.inf, np.inf
                    for k in range(n):
                        middle = base[k] + si * by_i[k] + sj * by_j[k]
                        if not math.isnan(half[k]):
                            t0, t1 = max(t0, middle - half[k]), min(t1, middle + half[k])
                        elif abs(middle) > 0.5 * (h[k] - l[k]) + slack:
                            t0, t1 = np.inf, -np.inf
                        if t0 > t1:
                            break
                    if t0 > t1:
                        continue
                    if t0 == -np.inf:
                        return UNBOUNDED
                    u, w = mi + si * ri, w0 + si * wi + sj * wj
                    px, py, pz = u * ax + w * ex, u * ay + w * ey, u * az + w * ez
                    for t in (t0, t1):
                        V[count, 0], V[count, 1], V[count, 2] = px + t * dx, py + t * dy, pz + t * dz
                        count += 1
    return count if count else _without_corners(N, l, h)


@njit(cache=True, nogil=True, error_model="numpy")
def _without_corners(N: Array, l: Array, h: Array) -> int:
    """Whether no corner means nothing or, all planes being parallel, a slab without end."""
    n = len(N)
    low, high = -np.inf, np.inf
    for i in range(n):
        x = N[0, 1] * N[i, 2] - N[0, 2] * N[i, 1]
        y = N[0, 2] * N[i, 0] - N[0, 0] * N[i, 2]
        z = N[0, 0] * N[i, 1] - N[0, 1] * N[i, 0]
        if x * x + y * y + z * z >= PARALLEL * PARALLEL:
            return EMPTY
        if N[0, 0] * N[i, 0] + N[0, 1] * N[i, 1] + N[0, 2] * N[i, 2] > 0:
            low, high = max(low, l[i]), min(high, h[i])
        else:
            low, high = max(low, -h[i]), min(high, -l[i])
    return UNBOUNDED if low <= high else EMPTY


@njit(cache=True, nogil=True, error_model="numpy")
def inscribed(l: Array, h: Array) -> float:
    """Radius of the largest ball about 0 inside; below 0 when 0 is outside. Unit normals."""
    radius = np.inf
    for i in range(len(l)):
        radius = min(radius, h[i], -l[i])
    return radius


@njit(cache=True, nogil=True, error_model="numpy")
def largest(A: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
    """Farthest point and inscribed ball of many polytopes.

    A norm is convex, so it is largest at a corner.

    Args:
        A: Normals as columns, shape (N, 3, n).
        low: Lower bounds, finite, shape (N, n).
        high: Upper bounds, finite, shape (N, n).

    Returns:
        Norm of the farthest point (N,): inf when unbounded, nan when empty. The point (N, 3), nan when
        there is none. Radius of the largest ball about 0 inside (N,): below 0 when 0 is outside, nan
        when empty.
    """
    N, _, n = A.shape
    room = max(4 * n * (n - 1), 1)
    V = np.empty((room, 3))
    norm, point, radius = np.full(N, np.nan), np.full((N, 3), np.nan), np.full(N, np.nan)
    for s in range(N):
        possible, normals, l, h = unit_slabs(A[s], low[s], high[s])
        count = EMPTY
        if possible:
            count = corners(normals, l, h, V) if len(l) else UNBOUNDED
        if count != EMPTY:
            radius[s] = inscribed(l, h)
        if count == UNBOUNDED:
            norm[s] = np.inf
        squared = -1.0
        for k in range(count):
            q = V[k, 0] ** 2 + V[k, 1] ** 2 + V[k, 2] ** 2
            if q > squared:
                squared = q
                point[s] = V[k]
        if count > 0:
            norm[s] = math.sqrt(squared)
    return norm, point, radius


@njit(cache=True, nogil=True, error_model="numpy")
def vertices(A: Array, low: Array, high: Array, tolerance: float) -> tuple[Array, Indices]:
    """All corners of many polytopes, each once.

    Args:
        A: Normals as columns, shape (N, 3, n).
        low: Lower bounds, finite, shape (N, n).
        high: Upper bounds, finite, shape (N, n).
        tolerance: Corners nearer than this are one, relative to the farthest.

    Returns:
        The corners of one after the other, shape (m, 3), and where each begins, shape (N + 1,): the same
        index twice where a polytope is empty or unbounded, which `largest` tells apart.
    """
    N, _, n = A.shape
    V = np.empty((max(4 * n * (n - 1), 1), 3))
    # A polytope of 2 n planes has at most 4 n - 4 corners, and rounding leaves a few of them double.
    found = np.empty((N * (4 * n + 4), 3))
    begin = np.zeros(N + 1, np.int64)
    at = 0
    for s in range(N):
        possible, normals, l, h = unit_slabs(A[s], low[s], high[s])
        count = corners(normals, l, h, V) if possible and len(l) else EMPTY
        far = 0.0
        for k in range(count):
            far = max(far, V[k, 0] ** 2 + V[k, 1] ** 2 + V[k, 2] ** 2)
        same = tolerance * math.sqrt(far)
        for k in range(count):
            new = True
            for i in range(begin[s], at):
                gap = max(abs(V[k, 0] - found[i, 0]), abs(V[k, 1] - found[i, 1]))
                if max(gap, abs(V[k, 2] - found[i, 2])) <= same:
                    new = False
                    break
            if new:
                if at == len(found):
                    more = np.empty((2 * len(found) + 1, 3))
                    for i in range(at):
                        for c in range(3):
                            more[i, c] = found[i, c]
                    found = more
                for c in range(3):
                    found[at, c] = V[k, c]
                at += 1
        begin[s + 1] = at
    return found[:at].copy(), begin


@njit(cache=True, nogil=True, error_model="numpy")
def merged(V: Array, tolerance: float) -> Array:
    """Corners without those nearer than ``tolerance`` to an earlier one."""
    kept = np.empty_like(V)
    count = 0
    for i in range(len(V)):
        new = True
        for k in range(count):
            gap = max(abs(V[i, 0] - kept[k, 0]), abs(V[i, 1] - kept[k, 1]), abs(V[i, 2] - kept[k, 2]))
            if gap <= tolerance:
                new = False
                break
        if new:
            kept[count] = V[i]
            count += 1
    return kept[:count].copy()


@njit(cache=True, nogil=True, error_model="numpy")
def faces(N: Array, l: Array, h: Array, V: Array, tolerance: float) -> Indices:
    """Triangles of the polytope's surface, seen from outside counter-clockwise.

    Args:
        N: Unit normals, shape (n, 3).
        l: Shape (n,).
        h: Shape (n,).
        V: Distinct corners, shape (k, 3).
        tolerance: Of a corner's distance to a plane that it lies on.

    Returns:
        Indices of corners, shape (m, 3); of a flat polytope both sides.
    """
    n, k = len(N), len(V)
    triangles = np.empty((2 * n * max(k, 1), 3), np.int64)
    seen = np.zeros((2 * n, k), np.bool_)
    count, planes = 0, 0
    on, angle = np.empty(k, np.int64), np.empty(k)
    for plane in range(2 * n):
        i = plane // 2
        sign = 1.0 if plane % 2 else -1.0
        b = h[i] if plane % 2 else l[i]
        m = 0
        cx, cy, cz = 0.0, 0.0, 0.0
        for v in range(k):
            seen[planes, v] = abs(N[i, 0] * V[v, 0] + N[i, 1] * V[v, 1] + N[i, 2] * V[v, 2] - b) <= tolerance
            if seen[planes, v]:
                on[m] = v
                m += 1
                cx, cy, cz = cx + V[v, 0], cy + V[v, 1], cz + V[v, 2]
        if m < 3:
            continue
        known = False
        for other in range(planes):
            equal = l[i] < h[i]
            for v in range(k):
                equal = equal and seen[other, v] == seen[planes, v]
            known = known or equal
        if known:
            continue
        planes += 1
        cx, cy, cz = cx / m, cy / m, cz / m
        nx, ny, nz = sign * N[i, 0], sign * N[i, 1], sign * N[i, 2]
        ux, uy, uz = V[on[0], 0] - cx, V[on[0], 1] - cy, V[on[0], 2] - cz
        up = ux * nx + uy * ny + uz * nz
        ux, uy, uz = ux - up * nx, uy - up * ny, uz - up * nz
        wx, wy, wz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
        for p in range(m):
            v = on[p]
            ax, ay, az = V[v, 0] - cx, V[v, 1] - cy, V[v, 2] - cz
            about = math.atan2(ax * wx + ay * wy + az * wz, ax * ux + ay * uy + az * uz)
            at = p
            while at > 0 and angle[at - 1] > about:
                angle[at], on[at] = angle[at - 1], on[at - 1]
                at -= 1
            angle[at], on[at] = about, v
        for p in range(1, m - 1):
            triangles[count, 0], triangles[count, 1], triangles[count, 2] = on[0], on[p], on[p + 1]
            count += 1
    return triangles[:count].copy()
