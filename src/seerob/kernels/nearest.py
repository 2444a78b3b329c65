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
Bounds carry a margin of `MARGIN`, and ties go to the lower pair: the answer is a function of the
poses alone, bit for bit, whatever was asked before.

Solids (columns of ``which``, per solid): body, is a mesh, has an inside, is closed, first and last
node, first and last triangle, first and last probe, number of corners, and whether it is in use.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.transforms import Array

Links = NDArray[np.int32]
Indices = NDArray[np.int64]

from seerob.kernels.primitives import segment_segment
from seerob.kernels.search import box_box, mesh_mesh, mesh_segment, segment_box
from seerob.kernels.winding import contains

BODY, MESH, VOLUME, CLOSED, NODE, NODE_END, TRIANGLE, TRIANGLE_END, PROBE, PROBE_END, CORNERS = range(11)
MARGIN = 1e-9
"""What bounds give away against rounding [m]."""
EXACT, DEPTH_AT_LEAST, BEYOND_CAP = 0, 1, 2


@njit(cache=True, nogil=True, error_model="numpy")
def _place(
    rotation: Array,
    position: Array,
    which: Indices,
    local: Array,
    ball: Array,
    corners: Array,
    used: Indices,
    world: Array,
    centre: Array,
    at: Array,
    moved: Array,
) -> int:
    """World poses, ball centres and corners of the solids in use, and how far each has moved.

    Returns the body of a pose that is not finite, or -1.
    """
    for s in used:
        body = which[s, BODY]
        R = rotation[body]
        p = position[body]
        size = 0.0
        for c in range(3):
            size += abs(R[c, 0]) + abs(R[c, 1]) + abs(R[c, 2]) + abs(p[c])
        if not size < 1e100:
            return body
        for c in range(3):
            for d in range(3):
                world[s, 3 * c + d] = (
                    R[c, 0] * local[s, d] + R[c, 1] * local[s, 3 + d] + R[c, 2] * local[s, 6 + d]
                )
            world[s, 9 + c] = R[c, 0] * local[s, 9] + R[c, 1] * local[s, 10] + R[c, 2] * local[s, 11] + p[c]
        for c in range(3):
            centre[s, c] = (
                world[s, 3 * c] * ball[s, 0]
                + world[s, 3 * c + 1] * ball[s, 1]
                + world[s, 3 * c + 2] * ball[s, 2]
                + world[s, 9 + c]
            )
        most = 0.0
        for k in range(which[s, CORNERS]):
            gap = 0.0
            for c in range(3):
                x = (
                    world[s, 3 * c] * corners[s, k, 0]
                    + world[s, 3 * c + 1] * corners[s, k, 1]
                    + world[s, 3 * c + 2] * corners[s, k, 2]
                    + world[s, 9 + c]
                )
                gap += (x - at[s, k, c]) ** 2
                at[s, k, c] = x
            most = max(most, gap)
        moved[s] = math.sqrt(most) + 1e-12
    return -1


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _into(world: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A world point in the frame of solid s."""
    x -= world[s, 9]
    y -= world[s, 10]
    z -= world[s, 11]
    return (
        world[s, 0] * x + world[s, 3] * y + world[s, 6] * z,
        world[s, 1] * x + world[s, 4] * y + world[s, 7] * z,
        world[s, 2] * x + world[s, 5] * y + world[s, 8] * z,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _inside(
    i: int, j: int, which: Indices, nodes: Array, links: Links, T: Array, probes: Array, world: Array
) -> bool:
    """Whether a connected piece of core i begins inside the mesh of solid j."""
    for k in range(which[i, PROBE], which[i, PROBE_END]):
        x = world[i, 0] * probes[k, 0] + world[i, 1] * probes[k, 1] + world[i, 2] * probes[k, 2] + world[i, 9]
        y = (
            world[i, 3] * probes[k, 0]
            + world[i, 4] * probes[k, 1]
            + world[i, 5] * probes[k, 2]
            + world[i, 10]
        )
        z = (
            world[i, 6] * probes[k, 0]
            + world[i, 7] * probes[k, 1]
            + world[i, 8] * probes[k, 2]
            + world[i, 11]
        )
        x, y, z = _into(world, j, x, y, z)
        if contains(
            nodes[which[j, NODE] : which[j, NODE_END]],
            links[which[j, NODE] : which[j, NODE_END]],
            T[which[j, TRIANGLE] : which[j, TRIANGLE_END]],
            x,
            y,
            z,
        ):
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _relative(world: Array, i: int, j: int, R: Array, t: Array) -> None:
    """Pose of solid j in the frame of solid i, to R (9,) and t (3,)."""
    for c in range(3):
        for d in range(3):
            R[3 * c + d] = (
                world[i, c] * world[j, d]
                + world[i, 3 + c] * world[j, 3 + d]
                + world[i, 6 + c] * world[j, 6 + d]
            )
    t[0], t[1], t[2] = _into(world, i, world[j, 9], world[j, 10], world[j, 11])


@njit(cache=True, nogil=True, error_model="numpy")
def _root_bound(
    i: int, j: int, which: Indices, nodes: Array, world: Array, at: Array, R: Array, t: Array
) -> float:
    """Lower bound of the distance of cores i (a mesh where one is) and j, from their root boxes [m]."""
    if not which[i, MESH]:
        return 0.0
    A = nodes[which[i, NODE] : which[i, NODE_END]]
    if which[j, MESH]:
        _relative(world, i, j, R, t)
        return math.sqrt(box_box(A, 0, nodes[which[j, NODE] : which[j, NODE_END]], 0, R, np.abs(R), t))
    ax, ay, az = _into(world, i, at[j, 0, 0], at[j, 0, 1], at[j, 0, 2])
    bx, by, bz = _into(world, i, at[j, 1, 0], at[j, 1, 1], at[j, 1, 2])
    bx -= ax
    by -= ay
    bz -= az
    return math.sqrt(segment_box(A, 0, ax, ay, az, bx, by, bz, bx * bx + by * by + bz * bz))


@njit(cache=True, nogil=True, error_model="numpy")
def _core_distance(
    i: int,
    j: int,
    limit: float,
    which: Indices,
    nodes: Array,
    links: Links,
    T: Array,
    world: Array,
    at: Array,
    first: Indices,
    stack: Links,
    bounds: Array,
    R: Array,
    t: Array,
    W: Array,
) -> float:
    """Squared distance of two cores, with world points on i and j in ``W[:6]``; i is a mesh where one is."""
    if not which[i, MESH]:
        a = at[i]
        b = at[j]
        ex, ey, ez = b[1, 0] - b[0, 0], b[1, 1] - b[0, 1], b[1, 2] - b[0, 2]
        dx, dy, dz = a[1, 0] - a[0, 0], a[1, 1] - a[0, 1], a[1, 2] - a[0, 2]
        d2, u, v = segment_segment(
            a[0, 0], a[0, 1], a[0, 2], dx, dy, dz, b[0, 0], b[0, 1], b[0, 2], ex, ey, ez
        )
        W[0], W[1], W[2] = a[0, 0] + u * dx, a[0, 1] + u * dy, a[0, 2] + u * dz
        W[3], W[4], W[5] = b[0, 0] + v * ex, b[0, 1] + v * ey, b[0, 2] + v * ez
        return d2
    A = nodes[which[i, NODE] : which[i, NODE_END]]
    LA = links[which[i, NODE] : which[i, NODE_END]]
    TA = T[which[i, TRIANGLE] : which[i, TRIANGLE_END]]
    if which[j, MESH]:
        B = nodes[which[j, NODE] : which[j, NODE_END]]
        LB = links[which[j, NODE] : which[j, NODE_END]]
        TB = T[which[j, TRIANGLE] : which[j, TRIANGLE_END]]
        _relative(world, i, j, R, t)
        d2, ka, kb = mesh_mesh(A, LA, TA, B, LB, TB, R, t, limit, first[0], first[1], stack, bounds, W)
        if d2 == 0.0:
            d2, ka, kb = mesh_mesh(A, LA, TA, B, LB, TB, R, t, np.inf, -1, -1, stack, bounds, W)
        if ka >= 0:
            first[0] = ka
            first[1] = kb
    else:
        ax, ay, az = _into(world, i, at[j, 0, 0], at[j, 0, 1], at[j, 0, 2])
        bx, by, bz = _into(world, i, at[j, 1, 0], at[j, 1, 1], at[j, 1, 2])
        d2, ka = mesh_segment(
            A, LA, TA, ax, ay, az, bx - ax, by - ay, bz - az, limit, first[0], stack[:, 0], bounds, W
        )
        if ka >= 0:
            first[0] = ka
    for e in (0, 3):
        x, y, z = W[e], W[e + 1], W[e + 2]
        for c in range(3):
            W[e + c] = (
                world[i, 3 * c] * x + world[i, 3 * c + 1] * y + world[i, 3 * c + 2] * z + world[i, 9 + c]
            )
    return d2


@njit(cache=True, nogil=True, error_model="numpy")
def nearest(rotations: Array, positions: Array, which: Indices, local: Array, ball: Array, corners: Array, radius: Array, nodes: Array, links: Links, T: Array, probes: Array, used: Indices, pair: Indices, start: Indices, members: Indices, cap: float, at: Array, low: Array, first: Indices, last: Indices, distance: Array, points: Array, winner: Indices, status: NDArray[np.int8]) -> tuple[int, int]:  # fmt: skip
    """Least distance of each group of pairs, for each sample.

    Args:
        rotations: world_from_body, shape (N, n, 3, 3).
        positions: world_from_body [m], shape (N, n, 3).
        which: See the module, shape (ns, 12).
        local: body_from_solid, nine of the rotation and three of the position, shape (ns, 12).
        ball: Bounding ball of each core in its own frame: centre and radius [m], shape (ns, 4).
        corners: Points whose hull contains the core, in its own frame, shape (ns, 8, 3).
        radius: [m], shape (ns,).
        nodes: Trees of all meshes, one after the other.
        links: Likewise.
        T: Likewise.
        probes: A vertex of each connected piece of each core, shape (np, 3).
        used: Solids in any pair.
        pair: Solids of each pair, meshes first, and 1 where the first belongs to the second set: (m, 3).
        start: Where the pairs of each group begin in ``members``, shape (g + 1,).
        members: Pairs by group, ascending in each.
        cap: Distance above which the answer does not matter [m].
        at: State: world corners at the last call, infinity before the first, shape (ns, 8, 3).
        low: State: lower bound of each pair's distance then, -infinity before the first.
        first: State: triangles that were nearest, -1 before the first, shape (m, 2).
        last: State: pair that won each group, -1 before the first.
        distance: Result [m], shape (N, g).
        points: Result: points on the solids of the first and second set, shape (N, g, 6).
        winner: Result: pair, or -1 beyond ``cap``, shape (N, g).
        status: Result, shape (N, g).

    Returns:
        Sample and body of a pose that is not finite, or -1, -1.
    """
    ns = len(which)
    m = len(pair)
    world = np.zeros((ns, 12))
    centre = np.zeros((ns, 3))
    moved = np.zeros(ns)
    state = np.zeros(m, np.int8)  # 0 ball bound, 1 root box bound, 2 settled
    within = np.zeros(m, np.bool_)
    value = np.empty(m)
    found = np.empty((m, 6))
    deep = np.zeros(m, np.bool_)
    stack = np.empty((256, 2), np.int32)
    bounds = np.empty(256)
    R = np.empty(9)
    t = np.empty(3)
    W = np.empty(12)
    for n in range(len(rotations)):
        body = _place(rotations[n], positions[n], which, local, ball, corners, used, world, centre, at, moved)
        if body >= 0:
            return n, body
        for p in range(m):
            i = pair[p, 0]
            j = pair[p, 1]
            r = radius[i] + radius[j]
            gap = math.sqrt(
                (centre[i, 0] - centre[j, 0]) ** 2
                + (centre[i, 1] - centre[j, 1]) ** 2
                + (centre[i, 2] - centre[j, 2]) ** 2
            )
            gap -= ball[i, 3] + ball[j, 3] + MARGIN
            bound = low[p] - moved[i] - moved[j]
            state[p] = 0
            within[p] = False
            if gap <= 0.0 and (which[i, VOLUME] or which[j, VOLUME]):
                proven = which[i, CLOSED] and which[j, CLOSED] and bound + r > MARGIN
                if not proven:
                    within[p] = (
                        which[i, VOLUME] and _inside(j, i, which, nodes, links, T, probes, world)
                    ) or (which[j, VOLUME] and _inside(i, j, which, nodes, links, T, probes, world))
            low[p] = -np.inf if within[p] else max(bound, max(gap, 0.0) - r)
        for g in range(len(start) - 1):
            best = cap
            best_pair = -1
            guess = last[g]
            while True:
                p = -1
                if guess >= 0:
                    p = guess
                    guess = -1
                    state[p] = 1
                else:
                    least = best + MARGIN
                    for e in range(start[g], start[g + 1]):
                        q = members[e]
                        if state[q] < 2 and low[q] <= least:
                            least = low[q]
                            p = q
                    if p < 0:
                        break
                i = pair[p, 0]
                j = pair[p, 1]
                r = radius[i] + radius[j]
                if state[p] == 0 and not within[p]:
                    state[p] = 1
                    low[p] = max(low[p], _root_bound(i, j, which, nodes, world, at, R, t) - r)
                    continue
                state[p] = 2
                reach = np.inf if within[p] else max(best + r + MARGIN, 0.0)
                d2 = _core_distance(
                    i, j, reach * reach, which, nodes, links, T, world, at, first[p], stack, bounds, R, t, W
                )
                if not d2 < np.inf:
                    low[p] = max(low[p], best)
                    continue
                d = math.sqrt(d2)
                value[p] = (-d if within[p] else d) - r
                deep[p] = within[p] or d2 == 0.0
                low[p] = value[p]
                # Points move from the cores to the surfaces, apart when a core is inside.
                for c in range(3):
                    u = (W[3 + c] - W[c]) / d if d > 0.0 else 0.0
                    if within[p]:
                        u = -u
                    found[p, c] = W[c] + radius[i] * u
                    found[p, 3 + c] = W[3 + c] - radius[j] * u
                if value[p] < best or (value[p] == best and p < best_pair):
                    best = value[p]
                    best_pair = p
            distance[n, g] = best
            winner[n, g] = best_pair
            status[n, g] = BEYOND_CAP
            last[g] = best_pair
            if best_pair >= 0:
                status[n, g] = DEPTH_AT_LEAST if deep[best_pair] else EXACT
                for c in range(3):
                    swap = 3 * pair[best_pair, 2]
                    points[n, g, c] = found[best_pair, c + swap]
                    points[n, g, 3 + c] = found[best_pair, 3 + c - swap]
    return -1, -1
