r"""Which solids of two sets of bodies are nearest: the loop over pairs, for one tick or many.

A solid is a core dilated by a radius; a core is a mesh (a rectangle is a mesh of two triangles
without an inside) or a segment. With :math:`\varphi` the distance of two cores, the distance of a
pair is :math:`\varphi - r_1 - r_2`. Where cores intersect :math:`\varphi = 0`; where one lies wholly inside a
mesh :math:`\varphi = -d` with d the distance of the surfaces; both are upper bounds (the overlap is at
least that deep).

Pairs are skipped by lower bounds: of the previous tick's bound less the largest displacement of
either solid since (a displacement is a convex function of the point, so the corners of a box bound
all it contains, and :math:`\varphi` of closed cores is 1-Lipschitz), of bounding spheres, of root boxes.
The inside test is never skipped except where a positive bound of closed cores proves the answer.
Bounds carry a margin of `MARGIN`, and ties go to the earlier pair of a group: the answer is a function of
the poses alone, bit for bit, whatever was asked before or is asked beside it. What one group has found
of a pair holds for every group that it is in.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.lanes import WIDTH
from seerob.kernels.pairs import CLOSED, VOLUME, core_distance, inside, place, root_bound
from seerob.kernels.wide import STACK

Boxes = NDArray[np.float32]
Links = NDArray[np.int32]
Indices = NDArray[np.int64]

MARGIN = 1e-9
"""What bounds give away against rounding [m]."""
EXACT, DEPTH_AT_LEAST, BEYOND_CAP, WITHIN_CAP = 0, 1, 2, 3


@njit(cache=True, nogil=True, error_model="numpy")
def nearest(
    rotations: Array,
    positions: Array,
    step: int,
    which: Indices,
    local: Array,
    ball: Array,
    corners: Array,
    radius: Array,
    nodes: Array,
    links: Links,
    T: Array,
    boxes: Boxes,
    kids: Links,
    probes: Array,
    used: Indices,
    pair: Indices,
    start: Indices,
    members: Indices,
    bodies: Indices,
    cap: Array,
    whether: NDArray[np.bool_],
    at: Array,
    low: Array,
    high: Array,
    first: Indices,
    last: Indices,
    distance: Array,
    point_a: Array,
    point_b: Array,
    body_a: Indices,
    body_b: Indices,
    status: NDArray[np.int8],
) -> tuple[int, int]:
    """Least distance of each group of pairs, for each sample.

    Args:
        rotations: world_from_body, one sample after the other, shape (N·n, 3, 3).
        positions: Likewise [m], shape (N·n, 3).
        step: Bodies of a sample, n.
        which: See `seerob.kernels.pairs`, shape (ns, 12).
        local: body_from_solid, nine of the rotation and three of the position, shape (ns, 12).
        ball: Bounding ball of each core in its own frame: centre and radius [m], shape (ns, 4).
        corners: Points whose hull contains the core, in its own frame, shape (ns, 8, 3).
        radius: [m], shape (ns,).
        nodes: Trees of all meshes, one after the other.
        links: Likewise.
        T: Likewise.
        boxes: See `seerob.kernels.wide`, of all meshes.
        kids: Likewise, in numbers of all nodes and triangles.
        probes: A vertex of each connected piece of each core, shape (np, 3).
        used: Solids in any pair.
        pair: Solids of each pair, meshes first, shape (m, 2).
        start: Where the pairs of each group begin in ``members``, shape (g + 1,).
        members: By group, a pair, and 1 where its first solid belongs to the second set, shape (k, 2).
        bodies: Of the first and of the second set, of each member and of none, shape (k + 1, 2).
        cap: Distance above which the answer does not matter, of each group [m], shape (g,); -infinity
            where there is no question.
        whether: Of which groups only that is asked: whether anything is nearer than the cap, shape (g,).
        at: State: world corners at the last call, infinity before the first, shape (ns, 8, 3).
        low: State: lower bound of each pair's distance then, -infinity before the first.
        high: State: upper bound of each pair's distance then, infinity before the first.
        first: State: triangles that were nearest, -1 before the first, shape (m, 2).
        last: State: member that won each group, -1 before the first.
        distance: Result [m], of one sample after the other, shape (N·g,).
        point_a: Result: point on the solid of the first set [m], shape (N·g, 3).
        point_b: Result: on that of the second.
        body_a: Result: body of the first set, -1 beyond ``cap``, shape (N·g,).
        body_b: Result: of the second.
        status: Result, shape (N·g,).

    Returns:
        Sample and body of a pose that is not finite, or -1, -1.
    """
    ns = len(which)
    m = len(pair)
    world = np.zeros((ns, 12))
    centre = np.zeros((ns, 3))
    moved = np.zeros(ns)
    state = np.zeros(m, np.int8)  # 0 ball bound, 1 root box bound, 2 value known
    beyond = np.full(m, -1, np.int64)  # the last group whose best it was found to be farther than
    within = np.zeros(m, np.bool_)
    value = np.empty(m)
    found = np.empty((m, 6))
    deep = np.zeros(m, np.bool_)
    asked = np.zeros(m, np.bool_)
    for g in range(len(start) - 1):
        if cap[g] > -np.inf:
            for e in range(start[g], start[g + 1]):
                asked[members[e, 0]] = True
    stack = np.empty((STACK, 2), np.int32)
    bounds = np.empty(STACK, np.float32)
    given = np.empty(16, np.float32)
    box_low = np.empty(WIDTH, np.float32)
    R = np.empty(9)
    t = np.empty(3)
    W = np.empty(12)
    groups = len(start) - 1
    for n in range(len(rotations) // step):
        body = place(
            rotations, positions, n * step, which, local, ball, corners, used, world, centre, at, moved
        )
        if body >= 0:
            return n, body
        for p in range(m):
            i = pair[p, 0]
            j = pair[p, 1]
            if not asked[p]:
                low[p] -= moved[i] + moved[j]
                high[p] += moved[i] + moved[j]
                continue
            r = radius[i] + radius[j]
            gap = math.sqrt(
                (centre[i, 0] - centre[j, 0]) ** 2
                + (centre[i, 1] - centre[j, 1]) ** 2
                + (centre[i, 2] - centre[j, 2]) ** 2
            )
            gap -= ball[i, 3] + ball[j, 3] + MARGIN
            bound = low[p] - moved[i] - moved[j]
            # The distance of two surfaces changes no faster than they move, whatever is inside of what.
            high[p] += moved[i] + moved[j]
            state[p] = 0
            beyond[p] = -1
            within[p] = False
            if gap <= 0.0 and (which[i, VOLUME] or which[j, VOLUME]):
                proven = which[i, CLOSED] and which[j, CLOSED] and bound + r > MARGIN
                if not proven:
                    within[p] = (
                        which[i, VOLUME] and inside(j, i, which, nodes, links, T, probes, world)
                    ) or (which[j, VOLUME] and inside(i, j, which, nodes, links, T, probes, world))
            low[p] = -np.inf if within[p] else max(bound, max(gap, 0.0) - r)
        for g in range(groups):
            best = cap[g]
            winning = -1
            k = n * groups + g
            status[k] = BEYOND_CAP
            for c in range(3):
                point_a[k, c] = point_b[k, c] = np.nan
            if best == -np.inf:
                distance[k], body_a[k], body_b[k] = best, -1, -1
                continue
            for e in range(start[g], start[g + 1]):
                q = members[e, 0]
                if state[q] == 2 and value[q] < best:
                    best = value[q]
                    winning = e
                elif whether[g] and high[q] < best - MARGIN:
                    winning = e
            guess = -1 if whether[g] else last[g]
            while not (whether[g] and winning >= 0):
                chosen = -1
                if guess >= 0 and state[members[guess, 0]] < 2:
                    chosen = guess
                    state[members[chosen, 0]] = 1
                else:
                    least = best + MARGIN
                    for e in range(start[g], start[g + 1]):
                        q = members[e, 0]
                        if state[q] < 2 and low[q] <= least and beyond[q] != g:
                            least = low[q]
                            chosen = e
                    if chosen < 0:
                        break
                guess = -1
                p = members[chosen, 0]
                i = pair[p, 0]
                j = pair[p, 1]
                r = radius[i] + radius[j]
                if state[p] == 0 and not within[p]:
                    state[p] = 1
                    low[p] = max(low[p], root_bound(i, j, which, nodes, world, at, R, t) - r)
                    continue
                reach = np.inf if within[p] else max(best + r + MARGIN, 0.0)
                d2 = core_distance(
                    i, j, reach * reach, which, nodes, links, T, boxes, kids, world, at, first[p], stack,
                    bounds, given, box_low, R, t, W,
                )  # fmt: skip
                if not d2 < np.inf:
                    low[p] = max(low[p], best)
                    beyond[p] = g
                    continue
                state[p] = 2
                d = math.sqrt(d2)
                value[p] = (-d if within[p] else d) - r
                deep[p] = within[p] or d2 == 0.0
                low[p] = value[p]
                high[p] = d - r
                # Points move from the cores to the surfaces, apart when a core is inside.
                for c in range(3):
                    u = (W[3 + c] - W[c]) / d if d > 0.0 else 0.0
                    if within[p]:
                        u = -u
                    found[p, c] = W[c] + radius[i] * u
                    found[p, 3 + c] = W[3 + c] - radius[j] * u
                if value[p] < best or (value[p] == best and chosen < winning):
                    best = value[p]
                    winning = chosen
            last[g] = winning
            distance[k] = best
            if whether[g]:
                distance[k] = cap[g]
                if winning >= 0:
                    status[k] = WITHIN_CAP
                    winning = -1  # by which pair depends on what was asked before
            elif winning >= 0:
                p = members[winning, 0]
                status[k] = DEPTH_AT_LEAST if deep[p] else EXACT
                swap = 3 * members[winning, 1]
                for c in range(3):
                    point_a[k, c] = found[p, c + swap]
                    point_b[k, c] = found[p, 3 + c - swap]
            body_a[k], body_b[k] = bodies[winning, 0], bodies[winning, 1]
    return -1, -1
