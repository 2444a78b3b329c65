"""Straight ways of an arm in joint space: whether they keep a distance, and a search among them.

On a way every point of a body moves at most by a weight per joint, so a span whose middle is farther than
needed by half of that is clear, and only the pairs of solids of which that is not so are looked at in its
halves. Where nothing is proven a pair counts as clear as soon as it moves less than a spacing between two
postures that were looked at.

Others may move meanwhile: at instants they are placed, too, before anything is asked.

The search is RRT-Connect ([Kuffner2000]_): two trees, of which one takes a step towards a random posture and
the other follows it as far as it can. All of it is one loop, without a call of Python.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import Layout
from seerob.kernels.chain import followed
from seerob.kernels.nearest import MARGIN
from seerob.kernels.pairs import MESH, SOLIDS, VOLUME, Solids, core_distance, inside, place, root_bound
from seerob.kernels.wide import SCRATCH, scratch

Indices = NDArray[np.int64]
Random = NDArray[np.uint64]

COARSE = 0.05
"""Of spans on which a pair moves farther only bounds are looked at [m]."""
ON, FOUND, FULL = 0, 1, 2
"""What `connect` says."""


class Arm(NamedTuple):
    """A tree of joints, of which an arm moves some, and the bodies that these move."""

    base: Array
    """Joint positions where the arm's are 0, from where they are drawn [rad or m], shape (j,)."""
    coupling: Array
    """Theirs by those of the arm, shape (j, n)."""
    parents: Indices
    """Link that carries each joint, shape (j,); the next four are for `kernels.chain.followed`, too."""
    turns: NDArray[np.bool_]
    fixed: Array
    axes: Array
    anchors: Array
    link: Indices
    """Link of each body that moves, shape (b,)."""
    local: Array
    """Pose of the body in its link, rotation and last column position [m], shape (b, 3, 4)."""
    body: Indices
    """Which body, shape (b,)."""
    used: Indices
    """Solids of these bodies."""


class Apart(NamedTuple):
    """Pairs of solids that are kept apart."""

    pair: Indices
    """Meshes first, shape (p, 2)."""
    weight: Array
    """Largest change of each distance per joint of the arm [m/rad or 1], shape (p, n)."""


class Room(NamedTuple):
    """Where postures are looked at: one search at a time."""

    rotations: Array
    """Of links, shape (j + 1, 3, 3)."""
    positions: Array
    twists: Array
    q: Array
    """Of the tree's joints, shape (1, j)."""
    R: Array
    """world_from_body of all bodies, shape (nb, 3, 3); of those that stand as they stand."""
    x: Array
    """[m], shape (nb, 3)."""
    world: Array
    """world_from_solid, shape (ns, 12); `seerob.kernels.pairs.place` fills it and the next three."""
    centre: Array
    at: Array
    moved: Array
    first: Indices
    """Triangles that were nearest, shape (p, 2)."""
    counts: Indices
    """Postures that were looked at, and the pair that was too near the last time, shape (2,)."""


_FLOAT, _WHOLE = np.float64, np.int64
ARM = Layout(
    Arm,
    [
        (_FLOAT, 1), (_FLOAT, 2), (_WHOLE, 1), (np.bool_, 1), (_FLOAT, 3), (_FLOAT, 2), (_FLOAT, 2),
        (_WHOLE, 1), (_FLOAT, 3), (_WHOLE, 1), (_WHOLE, 1),
    ],
)  # fmt: skip
APART = Layout(Apart, [(_WHOLE, 2), (_FLOAT, 2)])
ROOM = Layout(
    Room,
    [
        (_FLOAT, 3), (_FLOAT, 3), (_FLOAT, 3), (_FLOAT, 2), (_FLOAT, 3), (_FLOAT, 2), (_FLOAT, 2),
        (_FLOAT, 2), (_FLOAT, 3), (_FLOAT, 1), (_WHOLE, 2), (_WHOLE, 1),
    ],
)  # fmt: skip
LAYOUTS = SOLIDS, SCRATCH, ARM, APART, ROOM
_SCRATCH_AT = len(SOLIDS.arrays)
_ARM_AT = _SCRATCH_AT + len(SCRATCH.arrays)
_APART_AT = _ARM_AT + len(ARM.arrays)
_ROOM_AT = _APART_AT + len(APART.arrays)
_solids_in, _scratch_in, _arm_in, _apart_in, _room_in = (layout.read for layout in LAYOUTS)


class Bound:
    """An arm among solids that stand, and pairs of them, bound for many calls; keeps their arrays.

    Args:
        solids: Of the model.
        arm: Who moves.
        apart: From what.
        R: world_from_body of all bodies, shape (nb, 3, 3).
        x: [m], shape (nb, 3).
    """

    def __init__(self, solids: Solids, arm: Arm, apart: Apart, R: Array, x: Array) -> None:
        j, ns = len(arm.base), len(solids.which)
        room = Room(
            np.empty((j + 1, 3, 3)), np.empty((1, j + 1, 3)), np.empty((1, j, 6)), np.empty((1, j)),
            np.array(R), np.array(x), np.zeros((ns, 12)), np.zeros((ns, 3)), np.full((ns, 8, 3), np.inf),
            np.zeros(ns), np.full((len(apart.pair), 2), -1, np.int64), np.zeros(2, np.int64),
        )  # fmt: skip
        used = np.unique(apart.pair)
        place(room.R, room.x, 0, solids, used, room.world, room.centre, room.at, room.moved)
        self.room = room
        self._kept = solids, scratch(), arm, apart, room
        rows = [layout.rows(given) for layout, given in zip(LAYOUTS, self._kept, strict=True)]
        self.table = np.concatenate(rows)
        """What the loops below are given, shape (k, 4); valid as long as this object is there."""


@njit(cache=True, nogil=True, error_model="numpy")
def put(q: Array, table: Indices) -> None:
    """Place the arm's solids at joint positions, shape (n,)."""
    solids, arm, room = _solids_in(table, 0), _arm_in(table, _ARM_AT), _room_in(table, _ROOM_AT)
    room.counts[0] += 1
    for j in range(len(arm.base)):
        room.q[0, j] = arm.base[j]
        for i in range(len(q)):
            room.q[0, j] += arm.coupling[j, i] * q[i]
    rotations = room.rotations.reshape((1, len(room.rotations), 3, 3))
    followed(
        room.q, arm.parents, arm.turns, arm.fixed, arm.axes, arm.anchors, room.x[0], rotations,
        room.positions, room.twists,
    )  # fmt: skip
    for b in range(len(arm.body)):
        P, p = room.rotations[arm.link[b]], room.positions[0, arm.link[b]]
        L, k = arm.local[b], arm.body[b]
        for r in range(3):
            room.x[k, r] = p[r] + P[r, 0] * L[0, 3] + P[r, 1] * L[1, 3] + P[r, 2] * L[2, 3]
            for c in range(3):
                room.R[k, r, c] = P[r, 0] * L[0, c] + P[r, 1] * L[1, c] + P[r, 2] * L[2, c]
    place(room.R, room.x, 0, solids, arm.used, room.world, room.centre, room.at, room.moved)


@njit(cache=True, nogil=True, error_model="numpy")
def far(p: int, limit: float, table: Indices) -> bool:
    """Whether balls or boxes around a pair tell that its distance is not less than a limit [m]."""
    solids, apart, room = _solids_in(table, 0), _apart_in(table, _APART_AT), _room_in(table, _ROOM_AT)
    scratch = _scratch_in(table, _SCRATCH_AT)
    i, j = apart.pair[p, 0], apart.pair[p, 1]
    ball, centre = solids.ball, room.centre
    reach = limit + solids.radius[i] + solids.radius[j] + MARGIN
    if reach <= 0.0:
        return True
    x, y, z = centre[i, 0] - centre[j, 0], centre[i, 1] - centre[j, 1], centre[i, 2] - centre[j, 2]
    if x * x + y * y + z * z > (ball[i, 3] + ball[j, 3] + MARGIN + reach) ** 2:
        return True
    return bool(solids.which[i, MESH] == 1 and root_bound(i, j, solids, room.world, room.at, scratch) > reach)


@njit(cache=True, nogil=True, error_model="numpy")
def gap_of(p: int, limit: float, table: Indices) -> float:
    """Distance of a pair as of `seerob.kernels.nearest` where it is less than a limit, else infinity [m]."""
    solids, apart, room = _solids_in(table, 0), _apart_in(table, _APART_AT), _room_in(table, _ROOM_AT)
    scratch = _scratch_in(table, _SCRATCH_AT)
    if far(p, limit, table):
        return np.inf
    i, j = apart.pair[p, 0], apart.pair[p, 1]
    which, ball, centre = solids.which, solids.ball, room.centre
    r = solids.radius[i] + solids.radius[j]
    reach = limit + r + MARGIN
    d = math.sqrt(core_distance(i, j, reach * reach, solids, room.world, room.at, room.first[p], scratch))
    x, y, z = centre[i, 0] - centre[j, 0], centre[i, 1] - centre[j, 1], centre[i, 2] - centre[j, 2]
    if (
        d > 0.0
        and x * x + y * y + z * z <= (ball[i, 3] + ball[j, 3] + MARGIN) ** 2
        and (
            (which[i, VOLUME] and inside(j, i, solids, room.world))
            or (which[j, VOLUME] and inside(i, j, solids, room.world))
        )
    ):
        return float(-min(d, reach) - r)
    return float(d - r) if d - r < limit else np.inf


@njit(cache=True, nogil=True, error_model="numpy")
def too_near(q: Array, need: Array, table: Indices) -> bool:
    """Whether any pair is nearer than it needs to be [m], shape (p,), at joint positions (n,)."""
    room = _room_in(table, _ROOM_AT)
    put(q, table)
    before = room.counts[1]
    if len(need) > 0 and gap_of(before, need[before], table) < need[before]:
        return True
    for p in range(len(need)):
        if gap_of(p, need[p], table) < need[p]:
            room.counts[1] = p
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def is_clear(a: Array, b: Array, need: Array, spacing: float, proven: bool, table: Indices) -> bool:
    """Whether all pairs keep what they need on the straight way between two postures.

    Args:
        a: Joint positions, shape (n,).
        b: Likewise.
        need: Of each pair [m], shape (p,).
        spacing: Of spans on which a pair moves no farther none is halved for it [m].
        proven: Whether a pair that is not known to be clear on such a span is not.
        table: Of a `Bound`.
    """
    apart, room = _apart_in(table, _APART_AT), _room_in(table, _ROOM_AT)
    n, many = len(a), len(need)
    if not proven and too_near(b, need, table):
        return False
    moved, q = np.zeros(many), np.empty(n)
    for p in range(many):
        for i in range(n):
            moved[p] += apart.weight[p, i] * abs(b[i] - a[i])
    listed = np.empty(max(2 * many, 1024), np.int32)  # pairs that are looked at, by span
    for p in range(many):
        listed[p] = p
    spans, middles = np.empty((256, 2), np.int64), np.empty((256, 2))
    spans[0, 0], spans[0, 1], middles[0, 0], middles[0, 1] = 0, many, 0.5, 0.5
    filled, head, tail = many, 0, 1
    while head < tail:  # the coarsest first: what is not clear is met the sooner
        begin, end, middle, half = spans[head, 0], spans[head, 1], middles[head, 0], middles[head, 1]
        head += 1
        for i in range(n):
            q[i] = a[i] + middle * (b[i] - a[i])
        put(q, table)
        if filled + end - begin > len(listed):
            listed = np.concatenate((listed, np.empty(len(listed) + end - begin, np.int32)))
        kept = filled
        for e in range(begin, end):
            p = listed[e]
            beyond = moved[p] * half
            if far(p, need[p] + beyond, table):
                continue
            # How far something is costs more the farther it is: on long spans only whether it is near.
            coarse = beyond > COARSE
            gap = gap_of(p, need[p] + (0.0 if coarse else beyond), table)
            if gap < need[p]:
                room.counts[1] = p
                return False
            if gap == np.inf and not coarse:
                continue
            if beyond >= spacing / 2:
                listed[kept] = p
                kept += 1
            elif proven:
                return False
        if kept == filled:
            continue
        if tail + 2 > len(spans):
            spans = np.concatenate((spans, np.empty_like(spans)))
            middles = np.concatenate((middles, np.empty_like(middles)))
        for sign in (-0.5, 0.5):
            spans[tail, 0], spans[tail, 1] = filled, kept
            middles[tail, 0], middles[tail, 1] = middle + sign * half, half / 2
            tail += 1
        filled = kept
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def stand(R: Array, x: Array, bodies: Indices, used: Indices, table: Indices) -> None:
    """Place bodies that the arm does not move.

    Args:
        R: world_from_body of all bodies, shape (nb, 3, 3).
        x: [m], shape (nb, 3).
        bodies: Which are placed, shape (b,).
        used: Their solids.
        table: Of a `Bound`.
    """
    solids, room = _solids_in(table, 0), _room_in(table, _ROOM_AT)
    for b in bodies:
        for r in range(3):
            room.x[b, r] = x[b, r]
            for c in range(3):
                room.R[b, r, c] = R[b, r, c]
    place(room.R, room.x, 0, solids, used, room.world, room.centre, room.at, room.moved)


@njit(cache=True, nogil=True, error_model="numpy")
def clear_at(
    q: Array,
    R: Array,
    x: Array,
    bodies: Indices,
    used: Indices,
    need: Array,
    clear: NDArray[np.bool_],
    stop: bool,
    table: Indices,
) -> int:
    """At which instants all pairs keep what they need, the others being elsewhere at each.

    Args:
        q: Joint positions of the arm, shape (k, n).
        R: Of all bodies, shape (k, nb, 3, 3).
        x: [m], shape (k, nb, 3).
        bodies: As of `stand`, and so is the next.
        used: Likewise.
        need: Of each pair [m], shape (p,).
        clear: Is written, shape (k,).
        stop: Whether to end where it is not.
        table: Of a `Bound`.

    Returns:
        How many instants were looked at.
    """
    for k in range(len(q)):
        stand(R[k], x[k], bodies, used, table)
        clear[k] = not too_near(q[k], need, table)
        if stop and not clear[k]:
            return k + 1
    return len(q)


CLEAR, OPEN, NEAR = 0, 1, 2
"""What `judged` says of a pair."""


@njit(cache=True, nogil=True, error_model="numpy")
def judged(
    q: Array,
    R: Array,
    x: Array,
    bodies: Indices,
    used: Indices,
    pairs: Indices,
    need: Array,
    beyond: Array,
    found: NDArray[np.int8],
    table: Indices,
) -> None:
    """Whether pairs keep what they need as long as their distances change by no more than a bound.

    Args:
        q: Joint positions of the arm, shape (n,).
        R: Of all bodies, shape (nb, 3, 3).
        x: [m], shape (nb, 3).
        bodies: As of `stand`, and so is the next.
        used: Likewise.
        pairs: Which are asked of, shape (e,).
        need: Of each of these [m], shape (e,).
        beyond: By how much the distance may change [m], shape (e,).
        found: Is written: `CLEAR`, `NEAR` where it is less now, else `OPEN`; shape (e,).
        table: Of a `Bound`.
    """
    stand(R, x, bodies, used, table)
    put(q, table)
    for e in range(len(pairs)):
        found[e] = CLEAR
        if far(pairs[e], need[e] + beyond[e], table):
            continue
        coarse = beyond[e] > COARSE
        gap = gap_of(pairs[e], need[e] + (0.0 if coarse else beyond[e]), table)
        if gap < need[e]:
            found[e] = NEAR
        elif coarse or gap < np.inf:
            found[e] = OPEN


@njit(cache=True, nogil=True, error_model="numpy")
def least_on(path: Array, deviation: Array, tolerance: float, table: Indices) -> float:
    """A bound from below on the least distance on straight ways between postures, too small by a tolerance.

    Args:
        path: Joint positions, shape (k, n).
        deviation: By how much each pair may be nearer [m], shape (p,); infinite where none is asked for.
        tolerance: [m].
        table: Of a `Bound`.
    """
    apart = _apart_in(table, _APART_AT)
    met, n = np.inf, path.shape[1]
    asked = np.flatnonzero(deviation < np.inf)
    gaps, q = np.empty(len(deviation)), np.empty(n)
    for k in range(len(path)):
        put(path[k], table)
        for p in asked:
            gap = gap_of(int(p), met + deviation[p], table)
            met = min(met, gap - deviation[p])
    moved = np.zeros(len(deviation))
    for k in range(len(path) - 1):
        a, b = path[k], path[k + 1]
        for p in asked:
            moved[p] = 0.0
            for i in range(n):
                moved[p] += apart.weight[p, i] * abs(b[i] - a[i])
        stack = [(0.5, 0.5, asked)]
        while len(stack) > 0:
            middle, half, pairs = stack.pop()
            for i in range(n):
                q[i] = a[i] + middle * (b[i] - a[i])
            put(q, table)
            for p in pairs:
                gaps[p] = np.inf
                beyond = moved[p] * half
                if far(int(p), met + beyond + deviation[p], table):
                    continue
                coarse = beyond > max(COARSE, tolerance)
                limit = met + deviation[p] + (0.0 if coarse else beyond)
                gaps[p] = gap_of(int(p), limit, table) - deviation[p]
                met = min(met, gaps[p])
                gaps[p] = -np.inf if coarse else gaps[p]
            near = np.array([p for p in pairs if gaps[p] < met - tolerance + moved[p] * half], np.int64)
            if len(near) > 0:
                stack.append((middle - half / 2, half / 2, near))
                stack.append((middle + half / 2, half / 2, near))
    return met - tolerance if len(path) > 1 else met


@njit(cache=True, nogil=True, error_model="numpy")
def drawn(random: Random) -> float:
    """A number from 0 to 1, and the next state: splitmix64."""
    random[0] += np.uint64(0x9E3779B97F4A7C15)
    z = random[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return float((z ^ (z >> np.uint64(31))) >> np.uint64(11)) / 9007199254740992.0


@njit(cache=True, nogil=True, error_model="numpy")
def connect(
    nodes: Array,
    parents: Indices,
    size: Indices,
    random: Random,
    low: Array,
    high: Array,
    stride: float,
    steps: int,
    need: Array,
    spacing: float,
    proven: bool,
    table: Indices,
) -> int:
    """Grow two trees until they meet, for some steps at most.

    Args:
        nodes: Postures of both, shape (2, most, n).
        parents: Of each; that of the first is itself, shape (2, most).
        size: How many there are of each; then which tree is next, shape (3,). When they met, the last of
            each tree is the same posture.
        random: State, shape (1,).
        low: Of what is tried [rad or m], shape (n,).
        high: Likewise.
        stride: Largest step in joint space [rad or m].
        steps: Random postures that are tried.
        need: As of `is_clear`, and so are the others.
        spacing: Likewise.
        proven: Likewise.
        table: Likewise.

    Returns:
        `ON`, `FOUND`, or `FULL` where there is no room for more.
    """
    n = len(low)
    goal, new = np.empty(n), np.empty(n)
    for _ in range(steps):
        tree = size[2]
        size[2] = 1 - tree
        for i in range(n):
            goal[i] = low[i] + drawn(random) * (high[i] - low[i])
        follows = False
        while True:
            if size[tree] == nodes.shape[1]:
                return FULL
            near, least = 0, np.inf
            for k in range(size[tree]):
                away = 0.0
                for i in range(n):
                    away += (nodes[tree, k, i] - goal[i]) ** 2
                if away < least:
                    near, least = k, away
            length = math.sqrt(least)
            share = 1.0 if length <= stride else stride / length
            for i in range(n):
                new[i] = nodes[tree, near, i] + share * (goal[i] - nodes[tree, near, i])
                if share == 1.0:
                    new[i] = goal[i]
            if not is_clear(nodes[tree, near], new, need, spacing, proven, table):
                break
            nodes[tree, size[tree]] = new
            parents[tree, size[tree]] = near
            size[tree] += 1
            if follows and share == 1.0:
                return FOUND
            if not follows:
                follows, tree = True, 1 - tree
                goal[:] = new
    return ON
