r"""A tree of eight turned boxes per node in single precision, and the nearest points that it finds.

It is made of the tree of `seerob.kernels.tree` and serves nothing but skipping: all that decides is
computed in double precision by `seerob.kernels.primitives`. Eight boxes are bounded by a few vector
instructions (see `seerob.kernels.lanes`), and a node is a third of the memory of the boxes that it replaces:
a query that comes between other work waits for memory more than it computes.

A box is skipped only when a lower bound exceeds ``cut = best·(1 + 1e-9) + 1e-18`` [m²], a primitive when its
extent along the line between the nearest points so far does. Every bound gives away more than rounding can
take: single precision rounds at 6e-8 of the largest length in a query, boxes are grown and gaps shrunk
by 1e-6 and more of it. So the primitive that wins is the first, in the order (distance, index), of *all*
primitives: upper bounds and the primitive that was tried first change the time spent, never a bit of
the answer.

A node is a row of 120: by eight the boxes' centres, half sizes and axes as rows. Its children are other
nodes, triangles as ``~k``, or `NONE` from the first that is missing. Node 0 has one box, that of the mesh.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import Layout
from seerob.kernels.boxes import fit_box
from seerob.kernels.lanes import WIDTH, Lanes, asked_soon, first_lane, of_rows
from seerob.kernels.primitives import index, on_edges, segment_triangle, triangles
from seerob.kernels.search import Vec, cut_of, row_in
from seerob.kernels.slab import FEW, pairs_in_slab

Boxes = NDArray[np.float32]
Links = NDArray[np.int32]
Shares = NDArray[np.int8]

ROWS = 15
_soon = asked_soon(ROWS)
NONE = 2**31 - 1
STACK = 1100
"""Entries that no search exceeds: of pairs seven for each of the 72 levels of two trees, and eight more; of
nodes two at a time fourteen for each of 72 levels, and sixteen more."""
DOWN = 1.0 - 1e-5
"""Rounds squares down by more than single precision rounds them up."""


class Trees(NamedTuple):
    """Meshes in wide trees, in numbers of all their nodes and triangles."""

    boxes: Boxes
    """By nodes, shape (k, 120)."""
    kids: Links
    """By nodes, shape (k, 8)."""
    T: Array
    """Triangles, shape (n, 13), as `seerob.kernels.primitives` lays them out."""


class Scratch(NamedTuple):
    """Where one search works."""

    stack: Links
    bounds: Boxes
    given: Boxes
    low: Boxes
    R: Array
    """Rotation a_from_b of two meshes, shape (9,)."""
    t: Array
    """Position a_from_b [m], shape (3,)."""
    row: Array
    ends: Array
    """Of triangles along directions, for `seerob.kernels.slab`."""
    W: Array
    """Receives the points on both, shape (36,), of which 30 are scratch."""


_FLOAT, _SINGLE, _INT = np.float64, np.float32, np.int32
SCRATCH = Layout(
    Scratch,
    [
        (_INT, 2), (_SINGLE, 1), (_SINGLE, 1), (_SINGLE, 1),
        (_FLOAT, 1), (_FLOAT, 1), (_FLOAT, 2), (_FLOAT, 2), (_FLOAT, 1),
    ],
)  # fmt: skip


def scratch() -> Scratch:
    """Room for one search at a time."""
    return Scratch(
        np.empty((STACK, 2), np.int32), np.empty(STACK, np.float32), np.empty(16, np.float32),
        np.empty(2 * WIDTH, np.float32), np.empty(9), np.empty(3), np.empty((1, 13)), np.empty((FEW, 7)),
        np.empty(36),
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _shares(nodes: Array, links: Links) -> Shares:
    """Of up to 8 places in a wide node, how many the left child of each node takes; 0 where that takes one.

    The least area of all wide nodes, which is about how often one is looked at, from the leaves up: a node is
    a wide node of its own in one place, or its children share the places. Shape (k, 8), by places less one.
    """
    cost = np.zeros((len(nodes), WIDTH), np.float32)
    share = np.zeros((len(nodes), WIDTH), np.int8)
    for i in range(len(nodes) - 1, -1, -1):  # children come after their parent
        x, y, z = nodes[i, 3], nodes[i, 4], nodes[i, 5]
        area = x * y + y * z + z * x
        if links[i, 1] > 0:
            cost[i, : links[i, 1] - 1] = area
            continue
        left, right = i + 1, links[i, 0]
        for n in range(2, WIDTH + 1):
            for k in range(1, n):
                both = cost[left, k - 1] + cost[right, n - k - 1]
                if k == 1 or both < cost[i, n - 1]:
                    cost[i, n - 1] = both
                    share[i, n - 1] = k
        cost[i, 0] = area + cost[i, WIDTH - 1]
        for n in range(2, WIDTH):
            if cost[i, 0] < cost[i, n - 1]:
                cost[i, n - 1] = cost[i, 0]
                share[i, n - 1] = 0
    return share


@njit(cache=True, nogil=True, error_model="numpy")
def widen(nodes: Array, links: Links, T: Array) -> tuple[Boxes, Links]:
    """Boxes, shape (k, 120), and children, shape (k, 8), of a tree of `seerob.kernels.tree.build_tree`."""
    boxes = np.zeros((len(T) + 2, 15 * WIDTH), np.float32)
    kids = np.full((len(T) + 2, WIDTH), NONE, np.int32)
    grow = 0.0
    for c in range(3):
        grow += abs(nodes[0, c]) + nodes[0, 3 + c]
    grow *= 1e-6
    box = np.empty(20)
    every = np.arange(len(T))
    share = _shares(nodes, links)
    ref = np.empty(WIDTH, np.int64)  # nodes of the given tree, or triangles as ~k
    room = np.empty((WIDTH + 1, 2), np.int64)  # nodes that become children, and in how many places
    stack = np.empty((8 * 80, 2), np.int64)
    stack[0, 0] = stack[0, 1] = 0
    depth = 1
    made = 1
    while depth > 0:
        depth -= 1
        w = stack[depth, 0]
        top = stack[depth, 1]
        room[0, 0] = top
        room[0, 1] = WIDTH if w > 0 else 1
        left = 1
        n = 0
        while left > 0:
            left -= 1
            i = room[left, 0]
            places = room[left, 1]
            if links[i, 1] > 0 and links[i, 1] <= places:
                for q in range(links[i, 1]):
                    ref[n] = ~(links[i, 0] + q)
                    n += 1
                continue
            first = share[i, places - 1] if places > 1 else 0
            if first == 0:
                ref[n] = i
                n += 1
                continue
            room[left, 0] = links[i, 0]
            room[left, 1] = places - first
            room[left + 1, 0] = i + 1
            room[left + 1, 1] = first
            left += 2
        for k in range(n):
            i = ref[k]
            if i >= 0:
                for c in range(20):
                    box[c] = nodes[i, c]
                kids[w, k] = made
                stack[depth, 0] = made
                stack[depth, 1] = i
                depth += 1
                made += 1
            else:
                fit_box(T, every, ~i, ~i + 1, box, i >= 0)
                kids[w, k] = i
            for c in range(3):
                boxes[w, WIDTH * c + k] = box[c]
                boxes[w, WIDTH * (3 + c) + k] = box[3 + c] * (1.0 + 1e-6) + grow
            for c in range(9):
                boxes[w, WIDTH * (6 + c) + k] = box[10 + c]
    return boxes[:made].copy(), kids[:made].copy()


@njit(cache=True, nogil=True, error_model="numpy")
def _size(boxes: Boxes, root: int) -> float:
    """No coordinate of a mesh is larger [m]."""
    size = 0.0
    for c in range(6):
        size += abs(boxes[root, WIDTH * c])
    return size


def _to_segment_formula(w: list[Lanes], given: list[Lanes]) -> Lanes:
    """Lower bounds of the squared distances of ``a + s·d`` to the boxes of a node: axes, centre direction."""
    ax, ay, az, dx, dy, dz, over, slack = given
    x, y, z = ax - w[0], ay - w[1], az - w[2]
    t = ((x * dx).plus_product(y, dy).plus_product(z, dz) * over).at_least(0.0).at_most(1.0)
    # From the centre to about the nearest point of the segment.
    rx, ry, rz = x.plus_product(t, dx), y.plus_product(t, dy), z.plus_product(t, dz)
    mx, my, mz = x + dx * 0.5, y + dy * 0.5, z + dz * 0.5
    axes = []
    for c in (0, 1, 2):
        h, (ux, uy, uz) = w[3 + c], w[6 + 3 * c : 9 + 3 * c]
        half = abs((ux * dx).plus_product(uy, dy).plus_product(uz, dz)) * 0.5
        middle = abs((ux * mx).plus_product(uy, my).plus_product(uz, mz))
        gap = (middle - half - h - slack).at_least(0.0)
        reach = h * abs((ux * rx).plus_product(uy, ry).plus_product(uz, rz))
        axes.append((gap * gap, reach))
    q = (rx * rx).plus_product(ry, ry).plus_product(rz, rz) + 1e-30
    # Of both ends along that direction: rounding may have missed the nearest point.
    begin = (x * rx).plus_product(y, ry).plus_product(z, rz)
    end = (dx * rx).plus_product(dy, ry).plus_product(dz, rz) + begin
    near = begin.at_most(end) - (axes[0][1] + axes[1][1] + axes[2][1])
    gap = (near / q.sqrt() - slack).at_least(0.0)
    return (axes[0][0] + axes[1][0] + axes[2][0]).at_least(gap * gap) * DOWN


_to_segment = of_rows(ROWS, 8, _to_segment_formula)
_two_to_segment = of_rows(ROWS, 8, _to_segment_formula, rows=2)


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_to_segment(
    trees: Trees, root: int, a: Vec, d: Vec, limit: float, first: int, scratch: Scratch
) -> tuple[float, int]:
    """Nearest point of a mesh to the segment ``a + s·d``, both in the mesh's frame.

    Args:
        trees: Of the mesh, and maybe of others.
        root: First node of the mesh.
        a: Begin of the segment [m].
        d: From there to its end [m].
        limit: Squared distance above which nothing is looked for [m²].
        first: Triangle to begin with, -1 for none.
        scratch: Receives the points on mesh and segment, too.

    Returns:
        Squared distance and triangle; infinity and -1 when all exceed ``limit``.
    """
    boxes, kids, T = trees
    stack, bounds, given, low, W = scratch.stack[:, 0], scratch.bounds, scratch.given, scratch.low, scratch.W
    ax, ay, az = a
    dx, dy, dz = d
    best = np.inf
    cut = limit
    winner = -1
    ux = uy = uz = 0.0
    size = _size(boxes, root) + abs(ax) + abs(ay) + abs(az) + abs(dx) + abs(dy) + abs(dz)
    fine = 1e-14 * size  # what rounding takes of a gap, and below what square it turns a direction
    coarse = (1e-8 * size) ** 2
    dd = dx * dx + dy * dy + dz * dz
    given[0], given[1], given[2], given[3], given[4], given[5] = ax, ay, az, dx, dy, dz
    given[6] = -1.0 / dd if dd > 1e-30 else 0.0
    given[7] = 2e-6 * size
    k = first
    stack[0] = kids[root, 0]
    bounds[0] = 0.0
    depth = 1
    begun = k < 0
    while True:
        if begun:
            if depth == 0:
                break
            depth -= 1
            if bounds[depth] > cut:
                continue
            i = stack[depth]
            if i >= 0:
                # The next on the stack is nearly always looked at, too: both at once take little longer.
                while depth > 0 and bounds[depth - 1] > cut:
                    depth -= 1
                j = i
                if depth > 0 and stack[depth - 1] >= 0:
                    depth -= 1
                    j = stack[depth]
                    hits = _two_to_segment(boxes, i, j, given, cut, low)
                else:
                    hits = _to_segment(boxes, i, given, cut, low)
                base = depth
                while hits:
                    c = first_lane(hits)
                    hits &= hits - 1
                    kid = kids[i, c] if c < WIDTH else kids[j, c - WIDTH]
                    if kid == NONE:
                        continue
                    if kid >= 0:
                        _soon(boxes, kid)
                    bound = low[c]
                    at = depth
                    while at > base and bounds[at - 1] < bound:
                        bounds[at] = bounds[at - 1]
                        stack[at] = stack[at - 1]
                        at -= 1
                    bounds[at] = bound
                    stack[at] = kid
                    depth += 1
                continue
            k = ~i
            if k == first:
                continue
            e = max(dx * ux + dy * uy + dz * uz, 0.0)
            b1 = T[k, 3] * ux + T[k, 4] * uy + T[k, 5] * uz
            b2 = T[k, 6] * ux + T[k, 7] * uy + T[k, 8] * uz
            gap = (
                (T[k, 0] - ax) * ux + (T[k, 1] - ay) * uy + (T[k, 2] - az) * uz + min(b1, b2, 0.0) - e - fine
            )
            if gap > 0.0 and gap * gap > cut * (1.0 + 1e-6):
                continue
        begun = True
        g, s, px, py, pz = segment_triangle(ax, ay, az, dx, dy, dz, T, k, cut)
        if g <= cut and (g < best or (g == best and k < winner)):
            best = g
            cut = min(cut, cut_of(best))
            winner = k
            W[0], W[1], W[2], W[3], W[4], W[5] = px, py, pz, ax + s * dx, ay + s * dy, az + s * dz
            over_best = 1.0 / math.sqrt(best) if best > coarse else 0.0
            ux = (W[0] - W[3]) * over_best
            uy = (W[1] - W[4]) * over_best
            uz = (W[2] - W[5]) * over_best
    return best, winner


def _to_box_formula(w: list[Lanes], given: list[Lanes]) -> Lanes:
    """Lower bounds of the squared distances of a box to those of a node: axes of either, centre direction."""
    centre, half, axes, slack = given[:3], given[3:6], given[6:15], given[15]
    cx, cy, cz = (centre[c] - w[c] for c in range(3))
    q = (cx * cx).plus_product(cy, cy).plus_product(cz, cz) + 1e-30
    first, reach, sides = [], [], []
    for a in range(3):
        ux, uy, uz = w[6 + 3 * a : 9 + 3 * a]
        h = w[3 + a]
        along = [
            abs((ux * axes[3 * b]).plus_product(uy, axes[3 * b + 1]).plus_product(uz, axes[3 * b + 2]))
            for b in range(3)
        ]
        s = abs((ux * cx).plus_product(uy, cy).plus_product(uz, cz))
        other = (along[0] * half[0]).plus_product(along[1], half[1]).plus_product(along[2], half[2])
        gap = (s - h - other - slack).at_least(0.0)
        first.append(gap * gap)
        reach.append(h * s)
        sides.append([m * h for m in along])
    second = []
    for b in range(3):
        s = abs((cx * axes[3 * b]).plus_product(cy, axes[3 * b + 1]).plus_product(cz, axes[3 * b + 2]))
        gap = (s - half[b] - (sides[0][b] + sides[1][b] + sides[2][b]) - slack).at_least(0.0)
        second.append(gap * gap)
        reach.append(half[b] * s)
    gap = (
        (q - (reach[0] + reach[1] + reach[2] + reach[3] + reach[4] + reach[5])) / q.sqrt() - slack
    ).at_least(0.0)
    near = (first[0] + first[1] + first[2]).at_least(second[0] + second[1] + second[2])
    return near.at_least(gap * gap) * DOWN


_to_box = of_rows(ROWS, 16, _to_box_formula)


@njit(cache=True, nogil=True, error_model="numpy")
def _box_in(boxes: Boxes, ref: int, R: Array, t: Array, given: Boxes) -> None:
    """A box, named by eight times its node and its place there, in another frame, given its frame's pose."""
    i = ref >> 3
    k = ref & 7
    for c in range(3):
        given[3 + c] = boxes[i, WIDTH * (3 + c) + k]
        given[c] = (
            R[3 * c] * boxes[i, k]
            + R[3 * c + 1] * boxes[i, WIDTH + k]
            + R[3 * c + 2] * boxes[i, 2 * WIDTH + k]
            + t[c]
        )
        for a in range(3):
            u = WIDTH * (6 + 3 * a) + k
            given[6 + 3 * a + c] = (
                R[3 * c] * boxes[i, u]
                + R[3 * c + 1] * boxes[i, u + WIDTH]
                + R[3 * c + 2] * boxes[i, u + 2 * WIDTH]
            )


@njit(cache=True, nogil=True, error_model="numpy")
def _radius(boxes: Boxes, ref: int) -> float:
    """Of the ball around a box, squared [m²]."""
    i = ref >> 3
    k = ref & 7
    return float(boxes[i, 24 + k] ** 2 + boxes[i, 32 + k] ** 2 + boxes[i, 40 + k] ** 2)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _from_to(W: Array, best: float, coarse: float) -> Vec:
    """Direction from one nearest point so far to the other; none where rounding would turn it."""
    over = 1.0 / math.sqrt(best) if best > coarse else 0.0
    return (W[3] - W[0]) * over, (W[4] - W[1]) * over, (W[5] - W[2]) * over


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _tried(
    trees: Trees, a: int, b: int, cut: float, found: tuple[float, int, int], scratch: Scratch
) -> tuple[float, int, int]:
    """The nearer of what is found, squared distance and triangles, and triangles a and, in ``row``, b."""
    T, row, W = trees.T, scratch.row, scratch.W
    points = W[12:24]
    best, ka, kb = found
    g, s, v, both = triangles(T, a, row, index(0), cut, points)
    if g <= cut and (g < best or (g == best and (a < ka or (a == ka and b < kb)))):
        best, ka, kb = g, a, b
        on_edges(T, a, row, index(0), s, v, both, points)
        for c in range(6):
            W[c] = points[c]
    return best, ka, kb


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_of_meshes(
    trees: Trees,
    one: tuple[int, int, int],
    other: tuple[int, int, int],
    limit: float,
    first_a: int,
    first_b: int,
    scratch: Scratch,
) -> tuple[float, int, int]:
    """Nearest points of two meshes, in the frame of the first.

    Args:
        trees: Of both.
        one: First node, and first and last triangle, of the first mesh.
        other: Of the second.
        limit: Squared distance above which nothing is looked for [m²].
        first_a: Triangles to begin with, -1 for none.
        first_b: Likewise.
        scratch: With where b is in a; receives the points, too.

    Returns:
        Squared distance and the two triangles; infinity and -1 when all exceed ``limit``.
        Stops at an intersection, which depends on ``limit`` and ``first``: `first_crossing` has *the*
        first one.
    """
    boxes, kids, T = trees
    pairs, bounds, given, low, R, t, row, ends, W = scratch
    root_a, root_b = one[0], other[0]
    size = _size(boxes, root_a) + _size(boxes, root_b) + abs(t[0]) + abs(t[1]) + abs(t[2])
    fine = 1e-14 * size  # what rounding takes of a gap, and below what square it turns a direction
    coarse = (1e-8 * size) ** 2
    found = np.inf, -1, -1
    cut = limit
    u = 0.0, 0.0, 0.0
    posed = -1
    if first_a >= 0:
        row_in(T, first_b, R, t, row)
        posed = first_b
        found = _tried(trees, first_a, first_b, cut, found, scratch)
        if found[0] < np.inf:
            cut = min(cut, cut_of(found[0]))
            u = _from_to(W, found[0], coarse)
        if coarse < found[0] < np.inf and one[2] - one[1] + other[2] - other[1] <= FEW:
            many = pairs_in_slab(T, one[1:], other[1:], R, t, u, cut, fine, pairs, ends)
            for k in range(many):
                a, b = pairs[k, 0], pairs[k, 1]
                if a == first_a and b == first_b:
                    continue
                if b != posed:
                    row_in(T, b, R, t, row)
                    posed = b
                found = _tried(trees, a, b, cut, found, scratch)
                cut = min(cut, cut_of(found[0]))
            if many >= 0:
                return found
    Q, p = W[24:33], W[33:36]
    for c in range(3):
        p[c] = 0.0
        for d in range(3):
            Q[3 * c + d] = R[3 * d + c]
            p[c] -= R[3 * d + c] * t[d]
    given[15] = 4e-6 * size
    moved, posed = posed, -1
    pairs[0, 0] = 8 * root_a
    pairs[0, 1] = 8 * root_b
    bounds[0] = 0.0
    depth = 1
    while depth > 0 and found[0] > 0.0:
        depth -= 1
        if bounds[depth] > cut:
            continue
        ra = pairs[depth, 0]
        rb = pairs[depth, 1]
        na = kids[ra >> 3, ra & 7]
        nb = kids[rb >> 3, rb & 7]
        if na >= 0 or nb >= 0:
            split_a = nb < 0 or (na >= 0 and _radius(boxes, ra) > _radius(boxes, rb))
            # Where the box is in the other frame is mostly known: its partner's parts come one by one.
            if split_a:
                if posed != 2 * rb:
                    _box_in(boxes, rb, R, t, given)
                i, posed = na, 2 * rb
            else:
                if posed != 2 * ra + 1:
                    _box_in(boxes, ra, Q, p, given)
                i, posed = nb, 2 * ra + 1
            hits = _to_box(boxes, i, given, cut, low)
            base = depth
            while hits:
                c = first_lane(hits)
                hits &= hits - 1
                if kids[i, c] == NONE:
                    break
                bound = low[c]
                at = depth
                while at > base and bounds[at - 1] < bound:
                    bounds[at] = bounds[at - 1]
                    pairs[at, 0] = pairs[at - 1, 0]
                    pairs[at, 1] = pairs[at - 1, 1]
                    at -= 1
                bounds[at] = bound
                pairs[at, 0] = 8 * i + c if split_a else ra
                pairs[at, 1] = rb if split_a else 8 * i + c
                depth += 1
            continue
        a = ~na
        b = ~nb
        if a == first_a and b == first_b:
            continue
        if b != moved:
            row_in(T, b, R, t, row)
            moved = b
        a1 = T[a, 3] * u[0] + T[a, 4] * u[1] + T[a, 5] * u[2]
        a2 = T[a, 6] * u[0] + T[a, 7] * u[1] + T[a, 8] * u[2]
        b1 = row[0, 3] * u[0] + row[0, 4] * u[1] + row[0, 5] * u[2]
        b2 = row[0, 6] * u[0] + row[0, 7] * u[1] + row[0, 8] * u[2]
        gap = (row[0, 0] - T[a, 0]) * u[0] + (row[0, 1] - T[a, 1]) * u[1] + (row[0, 2] - T[a, 2]) * u[2]
        gap += min(b1, b2, 0.0) - max(a1, a2, 0.0) - fine
        if gap > 0.0 and gap * gap > cut * (1.0 + 1e-6):
            continue
        nearer = _tried(trees, a, b, cut, found, scratch)
        if nearer[1] != found[1] or nearer[2] != found[2]:
            found = nearer
            cut = min(cut, cut_of(found[0]))
            u = _from_to(W, found[0], coarse)
    return found
