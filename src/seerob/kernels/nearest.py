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
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import Layout
from seerob.kernels.pairs import (
    CLOSED,
    SOLIDS,
    VOLUME,
    Solids,
    core_distance,
    inside,
    place,
    root_bound,
)
from seerob.kernels.wide import SCRATCH, Scratch, scratch

Indices = NDArray[np.int64]
Links = NDArray[np.int32]
Flags = NDArray[np.bool_]

MARGIN = 1e-9
"""What bounds give away against rounding [m]."""
EXACT, DEPTH_AT_LEAST, BEYOND_CAP, WITHIN_CAP = 0, 1, 2, 3


class Questions(NamedTuple):
    """What is asked: groups of pairs of solids."""

    used: Indices
    """Solids in any pair."""
    pair: Indices
    """Solids of each pair, meshes first, shape (m, 2)."""
    start: Indices
    """Where the pairs of each group begin in ``members``, shape (g + 1,)."""
    members: Links
    """Pairs by group, shape (k,)."""
    swapped: Flags
    """Whether the first solid of each belongs to the second set, shape (k,)."""
    bodies: Indices
    """Of the first and of the second set, of each member and of none, shape (k + 1, 2)."""
    whether: Flags
    """Of which groups only that is asked: whether anything is nearer than the cap, shape (g,)."""


class Memory(NamedTuple):
    """What is remembered of the last poses, to be fast, and where one call works."""

    at: Array
    """World corners at the last call [m], infinity before the first, shape (ns, 8, 3)."""
    low: Array
    """Lower bound of each pair's distance then [m], -infinity before the first, shape (m,)."""
    high: Array
    """Upper bound likewise, infinity before the first."""
    first: Indices
    """Triangles that were nearest, -1 before the first, shape (m, 2)."""
    last: Indices
    """Member that won each group, -1 before the first, shape (g,)."""
    world: Array
    """Work: world_from_solid, shape (ns, 12)."""
    centre: Array
    """Work: of the balls [m], shape (ns, 3)."""
    moved: Array
    """Work: how far each solid has moved [m], shape (ns,)."""
    state: NDArray[np.int8]
    """Work: of each pair 0 ball bound, 1 root box bound, 2 value known."""
    beyond: Indices
    """Work: the last group whose best each pair was found to be farther than."""
    within: Flags
    """Work: whether a core of each pair lies inside the other."""
    value: Array
    """Work: distance of each pair [m]."""
    found: Array
    """Work: its points [m], shape (m, 6)."""
    deep: Flags
    """Work: whether the overlap is at least as deep as the value."""
    asked: Flags
    """Work: whether any group asks for the pair."""
    near: Links
    """Work: members of a group that may be nearest, shape (k,)."""


_FLOAT, _WHOLE, _FLAG = np.float64, np.int64, np.bool_
QUESTIONS = Layout(
    Questions,
    [(_WHOLE, 1), (_WHOLE, 2), (_WHOLE, 1), (np.int32, 1), (_FLAG, 1), (_WHOLE, 2), (_FLAG, 1)],
)
MEMORY = Layout(
    Memory,
    [
        (_FLOAT, 3), (_FLOAT, 1), (_FLOAT, 1), (_WHOLE, 2), (_WHOLE, 1),
        (_FLOAT, 2), (_FLOAT, 2), (_FLOAT, 1), (np.int8, 1), (_WHOLE, 1), (_FLAG, 1), (_FLOAT, 1),
        (_FLOAT, 2), (_FLAG, 1), (_FLAG, 1), (np.int32, 1),
    ],
)  # fmt: skip
LAYOUTS = SOLIDS, QUESTIONS, MEMORY, SCRATCH
_QUESTIONS_AT = len(SOLIDS.arrays)
_MEMORY_AT = _QUESTIONS_AT + len(QUESTIONS.arrays)
_SCRATCH_AT = _MEMORY_AT + len(MEMORY.arrays)
_solids_in, _questions_in, _memory_in, _scratch_in = (layout.read for layout in LAYOUTS)


class Bound:
    """Solids, questions and a memory of one's own, bound for many calls; keeps their arrays."""

    def __init__(self, solids: Solids, questions: Questions) -> None:
        ns, m, g = len(solids.which), len(questions.pair), len(questions.whether)
        memory = Memory(
            np.full((ns, 8, 3), np.inf), np.full(m, -np.inf), np.full(m, np.inf),
            np.full((m, 2), -1, np.int64), np.full(g, -1, np.int64),
            np.zeros((ns, 12)), np.zeros((ns, 3)), np.zeros(ns), np.zeros(m, np.int8), np.empty(m, np.int64),
            np.zeros(m, bool), np.empty(m), np.empty((m, 6)), np.zeros(m, bool), np.zeros(m, bool),
            np.empty(len(questions.members), np.int32),
        )  # fmt: skip
        self._kept: tuple[Solids, Questions, Memory, Scratch] = solids, questions, memory, scratch()
        rows = [layout.rows(given) for layout, given in zip(LAYOUTS, self._kept, strict=True)]
        self.table = np.concatenate(rows)
        """What `nearest` is given, shape (k, 4); valid as long as this object is there."""

    def __reduce__(self) -> tuple[type[Bound], tuple[Solids, Questions]]:
        # A copy has arrays of its own, at addresses of their own.
        return Bound, self._kept[:2]


@njit(cache=True, nogil=True, error_model="numpy")
def nearest(
    rotations: Array,
    positions: Array,
    step: int,
    table: Indices,
    cap: Array,
    figures: Array,
    winners: Indices,
    status: NDArray[np.int8],
) -> tuple[int, int]:
    """Least distance of each group of pairs, for each sample.

    Args:
        rotations: world_from_body, one sample after the other, shape (N·n, 3, 3).
        positions: Likewise [m], shape (N·n, 3).
        step: Bodies of a sample, n.
        table: Of a `Bound`, which one call uses at a time.
        cap: Distance above which the answer does not matter, of each group [m], shape (g,); -infinity
            where there is no question.
        figures: Result [m], shape (7, N·g): distances, of one sample after the other; then the points on the
            solids of the first set, three numbers each; then those on the solids of the second.
        winners: Result: bodies of the first and of the second set, -1 beyond ``cap``, shape (2, N·g).
        status: Result, shape (N·g,).

    Returns:
        Sample and body of a pose that is not finite, or -1, -1.
    """
    solids = _solids_in(table, 0)
    work = _scratch_in(table, _SCRATCH_AT)
    used, pair, start, members, swapped, bodies, whether = _questions_in(table, _QUESTIONS_AT)
    (
        at, low, high, first, last, world, centre, moved, state, beyond, within, value, found, deep, asked,
        near,
    ) = _memory_in(table, _MEMORY_AT)  # fmt: skip
    which, ball, radius, W = solids.which, solids.ball, solids.radius, work.W
    m = len(pair)
    groups = len(whether)
    samples = len(rotations) // step
    point_a = figures[1:4].reshape((samples * groups, 3))
    point_b = figures[4:7].reshape((samples * groups, 3))
    for p in range(m):
        asked[p] = False
    for g in range(groups):
        if cap[g] > -np.inf:
            for e in range(start[g], start[g + 1]):
                asked[members[e]] = True
    for n in range(samples):
        body = place(rotations, positions, n * step, solids, used, world, centre, at, moved)
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
                    within[p] = (which[i, VOLUME] and inside(j, i, solids, world)) or (
                        which[j, VOLUME] and inside(i, j, solids, world)
                    )
            low[p] = -np.inf if within[p] else max(bound, max(gap, 0.0) - r)
        for g in range(groups):
            best = cap[g]
            winning = -1
            k = n * groups + g
            status[k] = BEYOND_CAP
            for c in range(3):
                point_a[k, c] = point_b[k, c] = np.nan
            if best == -np.inf:
                figures[0, k], winners[0, k], winners[1, k] = best, -1, -1
                continue
            for e in range(start[g], start[g + 1]):
                q = members[e]
                if state[q] == 2 and value[q] < best:
                    best = value[q]
                    winning = e
                elif whether[g] and high[q] < best - MARGIN:
                    winning = e
            guess = -1 if whether[g] else last[g]
            count = -1
            while not (whether[g] and winning >= 0):
                chosen = -1
                if guess >= 0 and state[members[guess]] < 2:
                    chosen = guess
                    state[members[chosen]] = 1
                else:
                    # Bounds only rise and the best only falls: who cannot be nearest never can be again.
                    most = least = best + MARGIN
                    before = start[g + 1] - start[g] if count < 0 else count
                    first_look = count < 0
                    count = 0
                    for k_near in range(before):
                        e = start[g] + k_near if first_look else near[k_near]
                        q = members[e]
                        if state[q] < 2 and low[q] <= most and beyond[q] != g:
                            near[count] = e
                            count += 1
                            if low[q] <= least:
                                least = low[q]
                                chosen = e
                    if chosen < 0:
                        break
                guess = -1
                p = members[chosen]
                i = pair[p, 0]
                j = pair[p, 1]
                r = radius[i] + radius[j]
                if state[p] == 0 and not within[p]:
                    state[p] = 1
                    low[p] = max(low[p], root_bound(i, j, solids, world, at, work) - r)
                    continue
                reach = np.inf if within[p] else max(best + r + MARGIN, 0.0)
                d2 = core_distance(i, j, reach * reach, solids, world, at, first[p], work)
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
            figures[0, k] = best
            if whether[g]:
                figures[0, k] = cap[g]
                if winning >= 0:
                    status[k] = WITHIN_CAP
                    winning = -1  # by which pair depends on what was asked before
            elif winning >= 0:
                p = members[winning]
                status[k] = DEPTH_AT_LEAST if deep[p] else EXACT
                swap = 3 if swapped[winning] else 0
                for c in range(3):
                    point_a[k, c] = found[p, c + swap]
                    point_b[k, c] = found[p, 3 + c - swap]
            winners[0, k], winners[1, k] = bodies[winning, 0], bodies[winning, 1]
    return -1, -1
