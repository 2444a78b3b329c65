"""Where one solid is, and how far a point is from its surface, inside or out."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.crossings import encloses
from seerob.kernels.pairs import CLOSED, CORNERS, MESH, VOLUME, Solids, mesh_of
from seerob.kernels.primitives import point_segment
from seerob.kernels.search import POINT, Mesh, Work, cut_of, mesh_segment, work
from seerob.kernels.winding import contains

Links = NDArray[np.int32]
Indices = NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def signed_distance(
    s: int, solids: Solids, world: Array, x: Array, known: Array, sign: int, work: Work, near: Array
) -> float:
    """Distance of a point to the surface of a solid, negative inside; ``near`` is its nearest surface point.

    Args:
        s: The solid.
        solids: Of all.
        world: world_from_solid, nine of the rotation and three of the position, shape (ns, 12).
        x: The point in the world [m], shape (3,).
        known: A point of its surface in the world [m], or NaN, shape (3,).
        sign: -1 where it is known to be inside the core, 1 outside, 0 where that is not known.
        work: Room for a search.
        near: Receives the point in the world [m], shape (3,); may be ``known``.
    """
    which, corners, radius = solids.which, solids.corners, solids.radius
    p = np.empty(3)
    for c in range(3):
        p[c] = 0.0
        for d in range(3):
            p[c] += world[s, 3 * d + c] * (x[d] - world[s, 9 + d])
    q = np.empty(3)
    outside = 1.0
    if which[s, MESH] == 1:
        mesh, limit = mesh_of(solids, s), np.inf
        if radius[s] == 0.0 and not math.isnan(known[0]):
            limit = cut_of((x[0] - known[0]) ** 2 + (x[1] - known[1]) ** 2 + (x[2] - known[2]) ** 2) + 1e-12
        d2, _ = mesh_segment(mesh, (p[0], p[1], p[2]), POINT, limit, int(np.int64(-1)), work)
        for c in range(3):
            q[c] = work.W[c]
        if which[s, VOLUME] == 1 and sign <= 0:
            closed = which[s, CLOSED] == 1
            if sign < 0 or encloses(mesh.nodes, mesh.links, mesh.T, closed, p[0], p[1], p[2]):
                outside = -1.0
    else:
        a = corners[s, 0]
        e = corners[s, 1] - a if which[s, CORNERS] > 1 else np.zeros(3)
        dd = e[0] * e[0] + e[1] * e[1] + e[2] * e[2]
        d2, t = point_segment(p[0], p[1], p[2], a[0], a[1], a[2], e[0], e[1], e[2], dd)
        for c in range(3):
            q[c] = a[c] + t * e[c]
    gap = math.sqrt(d2)
    if radius[s] > 0.0:
        # The surface lies the radius farther along the line through the core's nearest point.
        if gap > 1e-12:
            for c in range(3):
                q[c] += outside * (p[c] - q[c]) * radius[s] / gap
        else:
            q[0] += radius[s]
    for c in range(3):
        near[c] = world[s, 9 + c]
        for d in range(3):
            near[c] += world[s, 3 * c + d] * q[d]
    return float(outside * gap - radius[s])


@njit(cache=True, nogil=True, error_model="numpy")
def place_one(rotation: Array, position: Array, local: Array, s: int, world: Array) -> None:
    """World pose of a solid from that of its body, to its row of ``world``."""
    for c in range(3):
        world[s, 9 + c] = position[c]
        for d in range(3):
            world[s, 3 * c + d] = 0.0
            world[s, 9 + c] += rotation[c, d] * local[s, 9 + d]
            for e in range(3):
                world[s, 3 * c + d] += rotation[c, e] * local[s, 3 * e + d]


@njit(cache=True, nogil=True, error_model="numpy")
def place(
    rotations: Array, positions: Array, which: Indices, local: Array, solids: Indices, world: Array
) -> None:
    """World poses of some solids, to their rows of ``world``, shape (ns, 12); see `deepest`."""
    for s in solids:
        place_one(rotations[which[s, 0]], positions[which[s, 0]], local, s, world)


@njit(cache=True, nogil=True, error_model="numpy")
def bounds_of(s: int, solids: Solids, world: Array, box: Array) -> None:
    """Upright box around a solid in the world, to ``box`` (2, 3)."""
    which, corners, radius = solids.which, solids.corners, solids.radius
    box[0], box[1] = np.inf, -np.inf
    for k in range(which[s, CORNERS]):
        for c in range(3):
            x = world[s, 9 + c]
            for d in range(3):
                x += world[s, 3 * c + d] * corners[s, k, d]
            box[0, c] = min(box[0, c], x - radius[s] - 1e-12)
            box[1, c] = max(box[1, c], x + radius[s] + 1e-12)


# -- Distance of many points to the solid that a mesh bounds: 0 inside, to the surface out -----


NEGLIGIBLE = 1e-6
"""Closer to the surface than this, the side does not matter [m]."""


@njit(cache=True, nogil=True, error_model="numpy")
def outside(nodes: Array, links: Links, T: Array, points: Array) -> Array:
    """Distance [m] of each point (n, 3) to the solid, shape (n,).

    Args:
        nodes: As built by `seerob.kernels.tree.build_tree`.
        links: Likewise.
        T: Likewise.
        points: In the mesh's frame [m].
    """
    distance = np.zeros(len(points))
    mesh, room = Mesh(nodes, links, T), work()
    hint = -1
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        squared, hint = mesh_segment(mesh, (x, y, z), POINT, np.inf, hint, room)
        d = math.sqrt(squared)
        if d > NEGLIGIBLE and contains(nodes, links, T, x, y, z):
            d = 0.0
        distance[n] = d
    return distance


@njit(cache=True, nogil=True, error_model="numpy")
def farthest_outside(nodes: Array, links: Links, T: Array, closed: bool, points: Array) -> float:
    """Distance [m] of the farthest of points (n, 3) that lie outside of the solid; 0 where none does.

    Which side a point is on takes a hundred times as long as how far it is, and is asked of those alone that
    are farther than all before.

    Args:
        nodes: As built by `seerob.kernels.tree.build_tree`.
        links: Likewise.
        T: Likewise.
        closed: Whether the mesh encloses anything; no point is inside of one that does not.
        points: In the mesh's frame [m].
    """
    far = 0.0
    mesh, room = Mesh(nodes, links, T), work()
    hint = -1
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        squared, hint = mesh_segment(mesh, (x, y, z), POINT, np.inf, hint, room)
        d = math.sqrt(squared)
        if d > far and (d <= NEGLIGIBLE or not closed or not encloses(nodes, links, T, closed, x, y, z)):
            far = d
    return far
