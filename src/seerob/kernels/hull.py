"""Convex hulls: which facets a point sees is decided exactly, where rounding could decide."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Indices = NDArray[np.int64]

NOISE = 1e-12
"""Of the largest coordinate: what is nearer to a facet than this is not looked at further, and is flat."""
_ROUNDING = 100 * 2.0**-52
"""Bound on what rounding adds to the volume of a point over a facet, of the product of its lengths."""
_SPLIT = 134217729.0


@njit(cache=True, nogil=True, error_model="numpy")
def _product(a: float, b: float) -> tuple[float, float]:
    """A product and what rounding took from it (Dekker 1971)."""
    p = a * b
    t = _SPLIT * a
    ah = t - (t - a)
    t = _SPLIT * b
    bh = t - (t - b)
    al, bl = a - ah, b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@njit(cache=True, nogil=True, error_model="numpy")
def _sum(a: float, b: float) -> tuple[float, float]:
    """A sum and what rounding took from it (Knuth 1969)."""
    s = a + b
    v = s - a
    return s, (a - (s - v)) + (b - v)


@njit(cache=True, nogil=True, error_model="numpy")
def _added(E: Array, n: int, number: float) -> int:
    """Add a number to the exact sum of the first ``n`` of ``E``, smallest first (Shewchuk 1997)."""
    m = 0
    for i in range(n):
        number, rest = _sum(number, E[i])
        if rest != 0.0:
            E[m] = rest
            m += 1
    if number != 0.0:
        E[m] = number
        m += 1
    return m


@njit(cache=True, nogil=True, error_model="numpy")
def outside(P: Array, a: int, b: int, c: int, p: int, E: Array) -> bool:
    """Whether a point is above the plane of three others that turn counter-clockwise from there, exactly.

    Args:
        P: Points, shape (n, 3).
        a: Row of a corner.
        b: Of the next.
        c: Of the last.
        p: Of the point.
        E: Room for 200 numbers.
    """
    n = 0
    for k in range(6):
        i = k % 3
        j, h = ((i + 1) % 3, (i + 2) % 3) if k < 3 else ((i + 2) % 3, (i + 1) % 3)
        side = 1.0 if k < 3 else -1.0
        u = _sum(P[b, j], -P[a, j])
        v = _sum(P[c, h], -P[a, h])
        w = _sum(P[p, i], -P[a, i])
        for x in u:
            for y in v:
                high, low = _product(x, y)
                for z in w:
                    if high * z != 0.0 or low * z != 0.0:
                        for part in (high, low):
                            one, rest = _product(part, side * z)
                            n = _added(E, n, one)
                            n = _added(E, n, rest)
    return bool(n > 0 and E[n - 1] > 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _facet(P: Array, f: int, F: Indices, N: Array, size: float) -> bool:
    """Fill row ``f`` of ``N``: normal, its product with a corner, bound on rounding, length of the normal.

    Returns:
        Whether a point within the bound may be further than `NOISE`: a sliver, whose normal is all rounding.
    """
    a, b, c = F[f, 0], F[f, 1], F[f, 2]
    us, vs, square, offset = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        j, h = (i + 1) % 3, (i + 2) % 3
        n = (P[b, j] - P[a, j]) * (P[c, h] - P[a, h]) - (P[b, h] - P[a, h]) * (P[c, j] - P[a, j])
        N[f, i] = n
        square += n * n
        offset += n * P[a, i]
        us += abs(P[b, i] - P[a, i])
        vs += abs(P[c, i] - P[a, i])
    N[f, 3], N[f, 4], N[f, 5] = offset, _ROUNDING * size * us * vs, math.sqrt(square)
    return bool(N[f, 4] > NOISE * size * N[f, 5])


@njit(cache=True, nogil=True, error_model="numpy")
def quickhull(P: Array, first: Indices, size: float) -> Indices:
    """Triangles of the convex hull, counter-clockwise from outside.

    Args:
        P: Points, finite, shape (n, 3).
        first: Rows of four that span space, the fourth below the triangle of the others.
        size: Largest coordinate.

    Returns:
        Rows of ``P``, shape (m, 3); none where there are more than points can have.
    """
    n = len(P)
    room = 2 * n + 16
    F, N = np.empty((room, 3), np.int64), np.empty((room, 6))
    alive, sliver = np.zeros(room, np.bool_), np.zeros(room, np.bool_)
    # Points that a facet has outside of it, as lists; places of facets to use again.
    head, following = np.full(room, -1), np.empty(n, np.int64)
    pool, seen, fresh, free = (
        np.arange(n),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.arange(room),
    )
    edges, chain = np.empty((3 * room, 2), np.int64), np.empty(3 * room, np.int64)
    leaving, stamp = np.empty(n, np.int64), np.full(n, -1)
    E = np.empty(200)
    top, next_, frees, pooled, made, turn = 4, 0, 0, n, 4, 0
    a, b, c, d = first
    F[0, 0], F[0, 1], F[0, 2] = a, b, c
    F[1, 0], F[1, 1], F[1, 2] = a, c, d
    F[2, 0], F[2, 1], F[2, 2] = a, d, b
    F[3, 0], F[3, 1], F[3, 2] = b, d, c
    for f in range(4):
        fresh[f] = f
    while True:
        for k in range(made):
            f = fresh[k]
            sliver[f] = _facet(P, f, F, N, size)
            alive[f] = True
            head[f] = -1
        for k in range(pooled):
            p = pool[k]
            best, held = 0.0, -1
            for j in range(made):
                f = fresh[j]
                over = N[f, 0] * P[p, 0] + N[f, 1] * P[p, 1] + N[f, 2] * P[p, 2] - N[f, 3] - N[f, 4]
                if over > best * N[f, 5]:
                    best, held = over / N[f, 5], f
            if held < 0:
                for j in range(made):
                    f = fresh[j]
                    if sliver[f]:
                        over = N[f, 0] * P[p, 0] + N[f, 1] * P[p, 1] + N[f, 2] * P[p, 2] - N[f, 3]
                        if over >= -N[f, 4] and outside(P, F[f, 0], F[f, 1], F[f, 2], p, E):
                            held = f
                            break
            if held >= 0:
                following[p] = head[held]
                head[held] = p
        passed = 0
        while passed < top and head[next_] < 0:
            next_ = next_ + 1 if next_ + 1 < top else 0
            passed += 1
        if passed == top:
            break
        f = next_
        point, farthest = -1, -np.inf
        p = head[f]
        while p >= 0:
            over = N[f, 0] * P[p, 0] + N[f, 1] * P[p, 1] + N[f, 2] * P[p, 2]
            if over > farthest:
                farthest, point = over, p
            p = following[p]
        pooled, made, seeing, count = 0, 0, 0, 0
        turn += 1
        for g in range(top):
            if not alive[g]:
                continue
            over = N[g, 0] * P[point, 0] + N[g, 1] * P[point, 1] + N[g, 2] * P[point, 2] - N[g, 3]
            if over < -N[g, 4] or (over <= N[g, 4] and not outside(P, F[g, 0], F[g, 1], F[g, 2], point, E)):
                continue
            seen[seeing] = g
            seeing += 1
            for i in range(3):
                v = F[g, i]
                edges[count, 0], edges[count, 1] = v, F[g, (i + 1) % 3]
                chain[count] = leaving[v] if stamp[v] == turn else -1
                stamp[v], leaving[v] = turn, count
                count += 1
            p = head[g]
            while p >= 0:
                if p != point:
                    pool[pooled] = p
                    pooled += 1
                p = following[p]
            head[g] = -1
        for k in range(seeing):
            alive[seen[k]] = False
            free[frees] = seen[k]
            frees += 1
        for e in range(count):
            v, w = edges[e, 0], edges[e, 1]
            back = leaving[w] if stamp[w] == turn else -1
            while back >= 0 and edges[back, 1] != v:
                back = chain[back]
            if back >= 0:
                continue
            if frees > 0:
                frees -= 1
                f = free[frees]
            elif top < room:
                f = top
                top += 1
            else:
                return F[:0]
            F[f, 0], F[f, 1], F[f, 2] = v, w, point
            fresh[made] = f
            made += 1
    return F[:top][alive[:top]]
