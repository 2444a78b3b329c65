r"""How deep one solid reaches into another: the largest depth of a point of both, by branch and bound.

The depth of a point x in a solid A is its distance to A's surface, and the answer is
:math:`\max \{ \operatorname{depth}_A(x) : x \in A \cap B \}`. Both solids may be concave.

Of any surface point p of A, :math:`\operatorname{depth}_A(x) \le |x - p|`; and the depth, negative outside,
changes no faster than x moves. A capsule B of axis ab and radius r is cut into pieces of its axis: no point
of a piece with ends e, f is deeper than :math:`\max(|e - p|, |f - p|) + r`, and the point of B that is
farthest from p past the axis yields a lower bound. What that leaves open (where several sides of A are
equally near), and any other B, is cut into cells, whose farthest corner from p bounds the depth; no point
of B is in a cell whose centre is farther from B than its corners. The interval closes until it is narrower
than the tolerance, or the cells are used up: it holds either way.

Each nearest point begins with the distance to one that is known, which saves time and changes no bit.
"""

from __future__ import annotations

import math
from heapq import heappop, heappush

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.pairs import CORNERS, MESH, SOLIDS, Solids
from seerob.kernels.search import Work, work
from seerob.kernels.signed_distance import bounds_of, place_one, signed_distance

Indices = NDArray[np.int64]

_solids_in = SOLIDS.read
PIECES = 24
"""Of a capsule's axis, at most."""


@njit(cache=True, nogil=True, error_model="numpy")
def _put(x: Array, y: Array) -> None:
    """Copy a point; an array that is assigned to another takes three seconds to compile."""
    for c in range(3):
        y[c] = x[c]


@njit(cache=True, nogil=True, error_model="numpy")
def _apart(x: Array, y: Array) -> float:
    return math.sqrt((x[0] - y[0]) ** 2 + (x[1] - y[1]) ** 2 + (x[2] - y[2]) ** 2)


@njit(cache=True, nogil=True, error_model="numpy")
def _along_axis(
    i: int, j: int, solids: Solids, world: Array, tolerance: float, work: Work, at: Array
) -> tuple[float, float]:
    """Interval of how deep a capsule j reaches into solid i, from pieces of its axis; `deepest`."""
    which, corners, radius = solids.which, solids.corners, solids.radius
    ends = np.empty((2, 3))
    for k in range(2):
        for c in range(3):
            ends[k, c] = world[j, 9 + c]
            for d in range(3):
                ends[k, c] += world[j, 3 * c + d] * corners[j, min(k, which[j, CORNERS] - 1), d]
    r = radius[j]
    length = _apart(ends[0], ends[1])
    # Points of the axis that were asked: where, depth, nearest surface point.
    t = np.empty(PIECES + 3)
    depth = np.empty(PIECES + 3)
    near = np.empty((PIECES + 3, 3))
    x, y, other = np.empty(3), np.empty(3), np.full(3, np.nan)
    # Pieces: the asked points at both ends, and a bound of the depth.
    left, right = np.empty(PIECES + 3, np.int64), np.empty(PIECES + 3, np.int64)
    bound = np.empty(PIECES + 3)
    best, asked, pieces = 0.0, 0, 0
    chosen, done, highest = -1, 0.0, 0.0
    while True:
        if asked < 2:
            t[asked] = float(asked)
        else:
            chosen = -1
            top = best
            for k in range(pieces):
                if bound[k] > top:
                    top = bound[k]
                    chosen = k
            top = max(top, done)
            short = chosen >= 0 and (t[right[chosen]] - t[left[chosen]]) * length < 0.25 * tolerance
            # No piece with a point of the axis has a bound below its depth and the radius.
            short = short or highest > best + tolerance
            if chosen < 0 or top <= best + tolerance or short or asked >= PIECES:
                return best, top
            t[asked] = (t[left[chosen]] + t[right[chosen]]) / 2.0
        for c in range(3):
            x[c] = ends[0, c] + t[asked] * (ends[1, c] - ends[0, c])
        sign = 0
        if asked > 0:
            k = 0 if asked == 1 else left[chosen]
            _put(near[k], near[asked])
            # No surface is crossed within the distance to it; a dilated core has another sign.
            if radius[i] == 0.0 and abs(t[asked] - t[k]) * length < 0.999 * abs(depth[k]):
                sign = -1 if depth[k] > 0.0 else 1
        else:
            near[0] = np.nan
        depth[asked] = -signed_distance(i, solids, world, x, near[asked], sign, work, near[asked])
        room = abs(depth[asked])
        if room > 1e-12:
            way = r / room if depth[asked] > 0.0 else -r / room
            for c in range(3):
                y[c] = x[c] + way * (x[c] - near[asked, c])
            _put(near[asked], other)
            sign = -1 if radius[i] == 0.0 and depth[asked] > 1.001 * r else 0
            deep = -signed_distance(i, solids, world, y, other, sign, work, other)
            if deep > best:
                best = deep
                _put(y, at)
        if depth[asked] > best:
            best = depth[asked]
            _put(x, at)
        highest = max(highest, depth[asked] + r)
        asked += 1
        if asked == 1:
            continue
        n = asked - 1
        if asked == 2:
            left[0], right[0] = 0, 1
            pieces = 1
            first = 0
        else:
            first = pieces
            left[pieces], right[pieces] = n, right[chosen]
            right[chosen] = n
            pieces += 1
        for turn in range(2):
            k = first if turn == 0 else chosen
            if k < 0:
                continue
            a, b = left[k], right[k]
            least = 0.5 * (depth[a] + depth[b] + abs(t[b] - t[a]) * length)
            for e in range(asked):
                farthest = 0.0
                for end in (a, b):
                    s = 0.0
                    for c in range(3):
                        s += (ends[0, c] + t[end] * (ends[1, c] - ends[0, c]) - near[e, c]) ** 2
                    farthest = max(farthest, s)
                least = min(least, math.sqrt(farthest))
            bound[k] = least + r
            if bound[k] <= best + tolerance:
                done = max(done, bound[k])


@njit(cache=True, nogil=True, error_model="numpy")
def _in_cells(
    i: int,
    j: int,
    solids: Solids,
    world: Array,
    box: Array,
    tolerance: float,
    cells: int,
    known: tuple[float, float],
    work: Work,
    at: Array,
) -> tuple[float, float]:
    """Interval of how deep solid j reaches into solid i in a ``box``, within the ``known`` one; `deepest`."""
    best, most = known
    x, y = np.empty(3), np.empty(3)
    near, other, parent = np.full(3, np.nan), np.full(3, np.nan), np.empty(3)
    for k in range(3):
        x[k], y[k] = (box[0, k] + box[1, k]) / 2.0, (box[1, k] - box[0, k]) / 2.0
    heap = [(-most, x[0], x[1], x[2], y[0], y[1], y[2])]
    used = 0
    done = best
    either = int(np.int64(0))  # a literal would be compiled for by itself
    while len(heap) > 0:
        top, cx, cy, cz, hx, hy, hz = heappop(heap)
        top = min(-top, most)
        if top <= best + tolerance:
            return best, max(top, best, done)
        if used >= cells:
            return best, max(top, done)
        half = np.array([hx, hy, hz])
        x[0], x[1], x[2] = cx, cy, cz
        # Along the axis that the last bound hung on most.
        room = signed_distance(i, solids, world, x, near, either, work, near)
        _put(near, parent)
        axis = 0
        gain = -1.0
        for k in range(3):
            now = half[k] * (abs(x[k] - near[k]) + half[k])
            if now > gain:
                gain = now
                axis = k
        half[axis] /= 2.0
        reach = math.sqrt(half[0] ** 2 + half[1] ** 2 + half[2] ** 2)
        # No surface is crossed within the distance to it.
        same = solids.radius[i] == 0.0 and half[axis] < 0.999 * abs(room)
        for side in range(2):
            used += 1
            x[0], x[1], x[2] = cx, cy, cz
            x[axis] += half[axis] if side == 1 else -half[axis]
            gap = signed_distance(j, solids, world, x, other, either, work, other)
            if gap > reach + 1e-12:
                continue
            sign = 0 if not same else (-1 if room < 0.0 else 1)
            _put(parent, near)
            depth = -signed_distance(i, solids, world, x, near, sign, work, near)
            far = 0.0
            for k in range(3):
                far += (abs(x[k] - near[k]) + half[k]) ** 2
            bound = min(math.sqrt(far), depth + reach, most)
            _put(x, y)
            if gap > 0.0:
                _put(other, y)
                depth = -signed_distance(i, solids, world, y, near, either, work, near)
            if depth > best:
                best = depth
                _put(y, at)
            if bound > best + tolerance:
                heappush(heap, (-bound, x[0], x[1], x[2], half[0], half[1], half[2]))
            else:
                done = max(done, bound)
    return best, max(best, done)


@njit(cache=True, nogil=True, error_model="numpy")
def deepest(
    pairs: Indices,
    rotations: Array,
    positions: Array,
    table: Indices,
    tolerance: float,
    cells: int,
    at: Array,
    least: Array,
    most: Array,
) -> None:
    """Intervals of how deep solids reach into others.

    Args:
        pairs: The solid that is entered and the one that enters, shape (n, 2).
        rotations: world_from_body of every body, shape (nb, 3, 3).
        positions: Likewise [m], shape (nb, 3).
        table: Of all solids, see `seerob.kernels.pairs.BoundSolids`.
        tolerance: Width of an interval that is enough [m].
        cells: Largest number of cells of each pair.
        at: Receives the deepest points found, NaN where there is none [m], shape (n, 3).
        least: Receives at least how deep [m], shape (n,); 0 when they have no point in common.
        most: Likewise at most.
    """
    solids, room = _solids_in(table, 0), work()
    which = solids.which
    world = np.zeros((len(which), 12))
    first, second, box = np.empty((2, 3)), np.empty((2, 3)), np.empty((2, 3))
    for n in range(len(pairs)):
        i, j = pairs[n, 0], pairs[n, 1]
        at[n] = np.nan
        least[n] = most[n] = 0.0
        for s in (i, j):
            place_one(rotations[which[s, 0]], positions[which[s, 0]], solids.local, s, world)
        bounds_of(i, solids, world, first)
        bounds_of(j, solids, world, second)
        empty = False
        for c in range(3):
            box[0, c], box[1, c] = max(first[0, c], second[0, c]), min(first[1, c], second[1, c])
            empty = empty or box[0, c] > box[1, c]
        if empty:
            continue
        best, top = 0.0, np.inf
        if which[j, MESH] == 0:
            best, top = _along_axis(i, j, solids, world, tolerance, room, at[n])
        if top > best + tolerance:
            best, top = _in_cells(i, j, solids, world, box, tolerance, cells, (best, top), room, at[n])
        least[n], most[n] = best, max(top, best)
