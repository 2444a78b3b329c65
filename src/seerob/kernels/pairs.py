"""Two solids at given poses: where they are, whether one is inside the other, how near their cores are.

Columns of ``which``, per solid: body, is a mesh, has an inside, is closed, first and last node, first
and last triangle, first and last probe (a vertex of each connected piece), number of corners, first node of
`seerob.kernels.wide`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import Layout
from seerob.kernels.boxes import box_box, segment_box
from seerob.kernels.crossings import encloses
from seerob.kernels.primitives import segment_segment
from seerob.kernels.search import Mesh, first_crossing
from seerob.kernels.wide import Scratch, Trees, nearest_of_meshes, nearest_to_segment

Boxes = NDArray[np.float32]
Links = NDArray[np.int32]
Indices = NDArray[np.int64]

BODY, MESH, VOLUME, CLOSED, NODE, NODE_END, TRIANGLE, TRIANGLE_END, PROBE, PROBE_END, CORNERS, WIDE = range(
    12
)
COLUMNS = 12


class Solids(NamedTuple):
    """The solids of a model."""

    which: Indices
    """One row per solid, shape (ns, 12)."""
    local: Array
    """body_from_solid, nine of the rotation and three of the position [m], shape (ns, 12)."""
    ball: Array
    """Bounding ball of each core in its own frame: centre and radius [m], shape (ns, 4)."""
    corners: Array
    """Points whose hull contains the core, in its own frame [m], shape (ns, 8, 3)."""
    radius: Array
    """[m], shape (ns,)."""
    nodes: Array
    """Trees of all meshes, one after the other, as `seerob.kernels.tree` lays them out; links and T too."""
    links: Links
    T: Array
    boxes: Boxes
    """Trees of `seerob.kernels.wide`, of all meshes; kids in numbers of all nodes and triangles."""
    kids: Links
    probes: Array
    """A vertex of each connected piece of each core [m], shape (np, 3)."""


_FLOAT, _SINGLE, _INT, _WHOLE = np.float64, np.float32, np.int32, np.int64
SOLIDS = Layout(
    Solids,
    [
        (_WHOLE, 2), (_FLOAT, 2), (_FLOAT, 2), (_FLOAT, 3), (_FLOAT, 1), (_FLOAT, 2), (_INT, 2), (_FLOAT, 2),
        (_SINGLE, 2), (_INT, 2), (_FLOAT, 2),
    ],
)  # fmt: skip


class BoundSolids:
    """Solids bound for many calls; keeps their arrays."""

    def __init__(self, solids: Solids) -> None:
        self._kept, self.table = solids, SOLIDS.rows(solids)

    def __reduce__(self) -> tuple[type[BoundSolids], tuple[Solids]]:
        # A copy has arrays of its own, at addresses of their own.
        return BoundSolids, (self._kept,)


@njit(cache=True, nogil=True, error_model="numpy")
def mesh_of(solids: Solids, s: int) -> Mesh:
    """The mesh of a solid."""
    which = solids.which
    n0, n1, t0, t1 = which[s, NODE], which[s, NODE_END], which[s, TRIANGLE], which[s, TRIANGLE_END]
    return Mesh(solids.nodes[n0:n1], solids.links[n0:n1], solids.T[t0:t1])


@njit(cache=True, nogil=True, error_model="numpy")
def place(
    rotation: Array,
    position: Array,
    begin: int,
    solids: Solids,
    used: Indices,
    world: Array,
    centre: Array,
    at: Array,
    moved: Array,
) -> int:
    """World poses, ball centres and corners of the solids in use, and how far each has moved.

    The poses of the bodies are rows from ``begin`` on.

    Returns the body of a pose that is not finite, or -1.
    """
    which, local, ball, corners = solids.which, solids.local, solids.ball, solids.corners
    for s in used:
        body = which[s, BODY]
        R = rotation[begin + body]
        p = position[begin + body]
        size = 0.0
        for c in range(3):
            size += abs(R[c, 0]) + abs(R[c, 1]) + abs(R[c, 2]) + abs(p[c])
        if not size < 1e100:
            return int(body)
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
def inside(i: int, j: int, solids: Solids, world: Array) -> bool:
    """Whether a connected piece of core i begins inside the mesh of solid j."""
    which, probes, mesh = solids.which, solids.probes, mesh_of(solids, j)
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
        if encloses(mesh.nodes, mesh.links, mesh.T, which[j, CLOSED] == 1, x, y, z):
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
def root_bound(i: int, j: int, solids: Solids, world: Array, at: Array, scratch: Scratch) -> float:
    """Lower bound of the distance of cores i (a mesh where one is) and j, from their root boxes [m]."""
    which, nodes, R, t = solids.which, solids.nodes, scratch.R, scratch.t
    if not which[i, MESH]:
        return 0.0
    root = which[i, NODE]
    if which[j, MESH]:
        _relative(world, i, j, R, t)
        return math.sqrt(box_box(nodes, root, nodes, which[j, NODE], R, t, np.inf))
    ax, ay, az = _into(world, i, at[j, 0, 0], at[j, 0, 1], at[j, 0, 2])
    bx, by, bz = _into(world, i, at[j, 1, 0], at[j, 1, 1], at[j, 1, 2])
    bx -= ax
    by -= ay
    bz -= az
    return math.sqrt(segment_box(nodes, root, ax, ay, az, bx, by, bz, bx * bx + by * by + bz * bz, np.inf))


@njit(cache=True, nogil=True, error_model="numpy")
def core_distance(
    i: int, j: int, limit: float, solids: Solids, world: Array, at: Array, first: Indices, scratch: Scratch
) -> float:
    """Squared distance of two cores, with world points on i and j in ``W[:6]``; i is a mesh where one is."""
    which, trees = solids.which, Trees(solids.boxes, solids.kids, solids.T)
    R, t, W = scratch.R, scratch.t, scratch.W
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
    if which[j, MESH]:
        _relative(world, i, j, R, t)
        one = which[i, WIDE], which[i, TRIANGLE], which[i, TRIANGLE_END]
        other = which[j, WIDE], which[j, TRIANGLE], which[j, TRIANGLE_END]
        d2, ka, kb = nearest_of_meshes(trees, one, other, limit, first[0], first[1], scratch)
        if d2 == 0.0:
            ka, kb = first_crossing(
                mesh_of(solids, i), mesh_of(solids, j), R, t, scratch.stack, scratch.row, W
            )
            ka += which[i, TRIANGLE]
            kb += which[j, TRIANGLE]
        if ka >= 0:
            first[0] = ka
            first[1] = kb
    else:
        ax, ay, az = _into(world, i, at[j, 0, 0], at[j, 0, 1], at[j, 0, 2])
        bx, by, bz = _into(world, i, at[j, 1, 0], at[j, 1, 1], at[j, 1, 2])
        d2, ka = nearest_to_segment(
            trees, which[i, WIDE], (ax, ay, az), (bx - ax, by - ay, bz - az), limit, first[0], scratch
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
