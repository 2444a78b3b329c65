r"""A tree of boxes over the triangles of a mesh, and what the inside test needs of each box.

Binned surface-area splits, top down, in pre-order: the left child of inner node i is i + 1.
A node is a row of 20: centre and half size of a box (see `seerob.kernels.boxes`; the root's is upright),
the sum of its triangles' area vectors :math:`\sum \frac12 e_0 \times e_1` and of their areas (the dipole of
`seerob.kernels.winding`), the box's axes as rows, and the radius of the ball around it.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.boxes import fit_box
from seerob.kernels.primitives import FLAT, LINE, THIN, index

Links = NDArray[np.int32]
Indices = NDArray[np.int64]

LEAF = 2
"""Triangles of a leaf, at most."""
BINS = 16
DEEP = 40
"""Level below which nodes are halved by count, so that no mesh makes a tree deeper than 72."""


@njit(cache=True, nogil=True, error_model="numpy")
def triangle_rows(vertices: Array, faces: Links) -> Array:
    """Rows of 13 (see `seerob.kernels.primitives`) of a mesh's faces, shape (m, 13)."""
    T = np.empty((len(faces), 13))
    for k in range(len(faces)):
        a = vertices[faces[k, 0]]
        for c in range(3):
            T[k, c] = a[c]
            T[k, 3 + c] = vertices[faces[k, 1], c] - a[c]
            T[k, 6 + c] = vertices[faces[k, 2], c] - a[c]
        for c in range(3):
            d = (c + 1) % 3
            e = (c + 2) % 3
            T[k, 9 + c] = T[k, 3 + d] * T[k, 6 + e] - T[k, 3 + e] * T[k, 6 + d]
        nn = longest = 0.0
        uu = vv = ww = 0.0
        for c in range(3):
            nn += T[k, 9 + c] ** 2
            uu += T[k, 3 + c] ** 2
            vv += T[k, 6 + c] ** 2
            ww += (T[k, 6 + c] - T[k, 3 + c]) ** 2
        longest = max(uu, vv, ww)
        # |n| = longest · height: height/longest decides.
        if nn > 1e-10 * longest * longest:
            T[k, 12] = FLAT
        elif nn > 1e-22 * longest * longest:
            T[k, 12] = THIN
        else:
            T[k, 12] = LINE
    return T


@njit(cache=True, nogil=True, error_model="numpy")
def _sort(order: Indices, start: int, stop: int, centre: Array, axis: int) -> None:
    """Sort ``order[start:stop]`` along an axis, stably; what NumPy has for it takes seconds to compile."""
    other = np.empty(stop - start, np.int64)
    width = 1
    while width < stop - start:
        for low in range(start, stop, 2 * width):
            middle = min(low + width, stop)
            high = min(low + 2 * width, stop)
            i = low
            j = middle
            for k in range(low, high):
                if j >= high or (i < middle and centre[order[i], axis] <= centre[order[j], axis]):
                    other[k - start] = order[i]
                    i += 1
                else:
                    other[k - start] = order[j]
                    j += 1
        for k in range(start, stop):
            order[k] = other[k - start]
        width *= 2


@njit(cache=True, nogil=True, error_model="numpy")
def _split(order: Indices, start: int, stop: int, centre: Array, low: Array, high: Array, level: int) -> int:
    """Reorder ``order[start:stop]`` and return where the right half begins."""
    middle = (start + stop) // 2
    least = np.empty(3)
    most = np.empty(3)
    for c in range(3):
        least[c], most[c] = np.inf, -np.inf
    for q in range(start, stop):
        for c in range(3):
            least[c] = min(least[c], centre[order[q], c])
            most[c] = max(most[c], centre[order[q], c])
    axis = index(0)
    for c in range(1, 3):
        if most[c] - least[c] > most[axis] - least[axis]:
            axis = c
    extent = most[axis] - least[axis]
    if not extent > 0.0:
        return middle
    if level < DEEP and stop - start > 4:
        best = np.inf
        best_axis = best_bin = -1
        for c in range(3):
            if not most[c] - least[c] > 1e-3 * extent:
                continue
            scale = BINS * (1.0 - 1e-12) / (most[c] - least[c])
            count = np.zeros(BINS, np.int64)
            box = np.empty((BINS, 6))
            for b in range(BINS):
                for d in range(3):
                    box[b, d], box[b, 3 + d] = np.inf, -np.inf
            for q in range(start, stop):
                k = order[q]
                b = min(max(int((centre[k, c] - least[c]) * scale), 0), BINS - 1)
                count[b] += 1
                for d in range(3):
                    box[b, d] = min(box[b, d], low[k, d])
                    box[b, 3 + d] = max(box[b, 3 + d], high[k, d])
            cost = np.zeros(BINS)
            for side in range(2):
                grown = np.empty(6)
                for d in range(3):
                    grown[d], grown[3 + d] = np.inf, -np.inf
                n = 0
                for m in range(BINS - 1):
                    b = m if side == 0 else BINS - 1 - m
                    n += count[b]
                    for d in range(3):
                        grown[d] = min(grown[d], box[b, d])
                        grown[3 + d] = max(grown[3 + d], box[b, 3 + d])
                    # Split s: bins up to s on the left.
                    s = b if side == 0 else b - 1
                    if n == 0:
                        cost[s] = np.inf
                        continue
                    x = grown[3] - grown[0]
                    y = grown[4] - grown[1]
                    z = grown[5] - grown[2]
                    cost[s] += n * (x * y + y * z + z * x)
            for s in range(BINS - 1):
                if cost[s] < best:
                    best = cost[s]
                    best_axis = c
                    best_bin = s
        if best_axis >= 0:
            c = best_axis
            scale = BINS * (1.0 - 1e-12) / (most[c] - least[c])
            i = start
            j = stop - 1
            while i <= j:
                if min(max(int((centre[order[i], c] - least[c]) * scale), 0), BINS - 1) <= best_bin:
                    i += 1
                else:
                    order[i], order[j] = order[j], order[i]
                    j -= 1
            if start < i < stop:
                return i
    _sort(order, start, stop, centre, axis)
    return middle


@njit(cache=True, nogil=True, error_model="numpy")
def build_tree(vertices: Array, faces: Links) -> tuple[Array, Links, Array]:
    """Tree of a mesh.

    Args:
        vertices: [m], shape (n, 3), finite.
        faces: Vertex indices in range, shape (m, 3), m > 0.

    Returns:
        nodes: Box centre, half size, area vector, area, axes of the box (rows), radius: shape (k, 20).
        links: First triangle and count of a leaf, or right child and 0, shape (k, 2).
        triangles: Rows of 13 in the order of the leaves, shape (m, 13).
    """
    T = triangle_rows(vertices, faces)
    m = len(T)
    low = np.empty((m, 3))
    high = np.empty((m, 3))
    for k in range(m):
        for c in range(3):
            a = vertices[faces[k, 0], c]
            b = vertices[faces[k, 1], c]
            d = vertices[faces[k, 2], c]
            low[k, c] = min(a, b, d)
            high[k, c] = max(a, b, d)
    centre = (low + high) / 2.0
    order = np.arange(m)
    nodes = np.zeros((2 * m, 20))
    links = np.zeros((2 * m, 2), np.int32)
    # Entries: first, end, parent whose right child this is (or -1), level.
    stack = np.empty((256, 4), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0, m, -1, 0
    depth = 1
    made = 0
    while depth > 0:
        depth -= 1
        start, stop, parent, level = stack[depth, 0], stack[depth, 1], stack[depth, 2], stack[depth, 3]
        i = made
        made += 1
        if parent >= 0:
            links[parent, 0] = i
        fit_box(T, order, start, stop, nodes[i], i == 0)
        for q in range(start, stop):
            nn = 0.0
            for c in range(3):
                n = T[order[q], 9 + c]
                nodes[i, 6 + c] += n / 2.0
                nn += n * n
            nodes[i, 9] += np.sqrt(nn) / 2.0
        if stop - start <= LEAF:
            links[i, 0] = start
            links[i, 1] = stop - start
            continue
        middle = _split(order, start, stop, centre, low, high, level)
        for begin, end, right_of in ((middle, stop, i), (start, middle, -1)):
            stack[depth, 0], stack[depth, 1], stack[depth, 2], stack[depth, 3] = (
                begin,
                end,
                right_of,
                level + 1,
            )
            depth += 1
    return nodes[:made].copy(), links[:made].copy(), T[order]


@njit(cache=True, nogil=True, error_model="numpy")
def component_of(faces: Indices, n: int) -> Indices:
    """Root vertex of the connected piece of each of ``n`` vertices, pieces joined by faces, shape (n,)."""
    root = np.arange(n)
    for k in range(len(faces)):
        for c in range(1, 3):
            a = faces[k, 0]
            b = faces[k, c]
            while root[a] != a:
                root[a] = root[root[a]]
                a = root[a]
            while root[b] != b:
                root[b] = root[root[b]]
                b = root[b]
            if a < b:
                root[b] = a
            else:
                root[a] = b
    for i in range(n):
        while root[root[i]] != root[i]:
            root[i] = root[root[i]]
    return root
