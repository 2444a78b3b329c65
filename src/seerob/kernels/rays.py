r"""Where rays first meet solids: exact on triangles, capsules and balls; by sphere tracing on dilations.

A ray :math:`o + t u` meets a triangle by [MollerTrumbore1997]_ in the solid's frame; boxes of the tree are
cut by slabs. It meets a capsule at the least root of the cylinder about its axis and the balls at its ends.
A core that is dilated (a rounded rectangle, an envelope) is met by steps of the distance to it, which
never jump over it: the ray counts as meeting it when it comes within `CLOSE`.
A ray that begins inside a solid meets it at 0.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.crossings import encloses
from seerob.kernels.pairs import CLOSED, CORNERS, MESH, SOLIDS, VOLUME, mesh_of
from seerob.kernels.search import POINT, Mesh, Work, mesh_segment, work

Links = NDArray[np.int32]
Indices = NDArray[np.int64]

_solids_in = SOLIDS.read
CLOSE = 1e-5
"""Distance to a dilated core at which a ray meets it [m]."""
STEPS = 500


@njit(cache=True, nogil=True, error_model="numpy")
def _triangle(T: Array, k: int, o: Array, u: Array, most: float) -> float:
    """Where a ray meets a triangle; infinity when it does not up to ``most``."""
    ax, ay, az = T[k, 3], T[k, 4], T[k, 5]
    bx, by, bz = T[k, 6], T[k, 7], T[k, 8]
    det = u[0] * T[k, 9] + u[1] * T[k, 10] + u[2] * T[k, 11]
    if det == 0.0:
        return np.inf
    rx, ry, rz = o[0] - T[k, 0], o[1] - T[k, 1], o[2] - T[k, 2]
    t = -(rx * T[k, 9] + ry * T[k, 10] + rz * T[k, 11]) / det
    if not 0.0 <= t <= most:
        return np.inf
    # r × u, whose products with the edges are the barycentric coordinates.
    cx, cy, cz = ry * u[2] - rz * u[1], rz * u[0] - rx * u[2], rx * u[1] - ry * u[0]
    v = -(bx * cx + by * cy + bz * cz) / det
    w = (ax * cx + ay * cy + az * cz) / det
    # Closed, and a little beyond: no ray slips between two triangles.
    slack = 1e-9
    return t if v >= -slack and w >= -slack and v + w <= 1.0 + slack else np.inf


@njit(cache=True, nogil=True, error_model="numpy")
def _box(nodes: Array, i: int, o: Array, u: Array, most: float) -> bool:
    """Whether a ray enters box i before ``most``."""
    enter, leave = 0.0, most
    for a in range(3):
        x = y = 0.0
        for c in range(3):
            x += nodes[i, 10 + 3 * a + c] * (o[c] - nodes[i, c])
            y += nodes[i, 10 + 3 * a + c] * u[c]
        h = nodes[i, 3 + a] + 1e-9
        if abs(y) < 1e-300:
            if abs(x) > h:
                return False
            continue
        first, last = (-h - x) / y, (h - x) / y
        enter = max(enter, min(first, last))
        leave = min(leave, max(first, last))
    return enter <= leave


@njit(cache=True, nogil=True, error_model="numpy")
def _mesh(mesh: Mesh, o: Array, u: Array, most: float, stack: Links) -> float:
    nodes, links, T = mesh
    best = np.inf
    stack[0] = 0
    depth = 1
    while depth > 0:
        depth -= 1
        i = stack[depth]
        if not _box(nodes, i, o, u, min(most, best)):
            continue
        if links[i, 1] > 0:
            for k in range(links[i, 0], links[i, 0] + links[i, 1]):
                best = min(best, _triangle(T, k, o, u, min(most, best)))
        else:
            stack[depth] = links[i, 0]
            stack[depth + 1] = i + 1
            depth += 2
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def _ball(px: float, py: float, pz: float, r: float, u: Array, most: float) -> float:
    """Where a ray from the origin meets a ball about p; 0 from inside."""
    b = px * u[0] + py * u[1] + pz * u[2]
    c = px * px + py * py + pz * pz - r * r
    if c <= 0.0:
        return 0.0
    # Distance of the line to the centre, without the cancellation of b² - c.
    qx, qy, qz = px - b * u[0], py - b * u[1], pz - b * u[2]
    left = r * r - (qx * qx + qy * qy + qz * qz)
    if b < 0.0 or left < 0.0:
        return np.inf
    t = c / (b + math.sqrt(left))
    return t if t <= most else np.inf


@njit(cache=True, nogil=True, error_model="numpy")
def _capsule(a: Array, b: Array, r: float, o: Array, u: Array, most: float) -> float:
    best = min(
        _ball(a[0] - o[0], a[1] - o[1], a[2] - o[2], r, u, most),
        _ball(b[0] - o[0], b[1] - o[1], b[2] - o[2], r, u, most),
    )
    e = b - a
    length = math.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    if length == 0.0 or best == 0.0:
        return best
    e = e / length
    p = o - a
    along, slope = p[0] * e[0] + p[1] * e[1] + p[2] * e[2], u[0] * e[0] + u[1] * e[1] + u[2] * e[2]
    # Across the axis it is a circle.
    px, py, pz = p[0] - along * e[0], p[1] - along * e[1], p[2] - along * e[2]
    vx, vy, vz = u[0] - slope * e[0], u[1] - slope * e[1], u[2] - slope * e[2]
    A = vx * vx + vy * vy + vz * vz
    c = px * px + py * py + pz * pz - r * r
    if c <= 0.0 and 0.0 <= along <= length:
        return 0.0
    if A < 1e-24:
        return best
    b_ = -(px * vx + py * vy + pz * vz)
    s = b_ / A
    qx, qy, qz = px + s * vx, py + s * vy, pz + s * vz
    left = A * (r * r - (qx * qx + qy * qy + qz * qz))
    if left < 0.0 or c <= 0.0 or b_ <= 0.0:
        return best
    t = c / (b_ + math.sqrt(left))
    at = along + t * slope
    return min(best, t) if 0.0 <= at <= length and t <= most else best


@njit(cache=True, nogil=True, error_model="numpy")
def _traced(mesh: Mesh, o: Array, u: Array, r: float, most: float, work: Work) -> float:
    """Where a ray comes within `CLOSE` of a mesh dilated by r."""
    t = 0.0
    winner = -1
    for _ in range(STEPS):
        x = o[0] + t * u[0], o[1] + t * u[1], o[2] + t * u[2]
        d2, winner = mesh_segment(mesh, x, POINT, np.inf, winner, work)
        d = math.sqrt(d2) - r
        if d <= CLOSE:
            return t
        t += d
        if t > most:
            return np.inf
    return t


@njit(cache=True, nogil=True, error_model="numpy")
def cast(
    origins: Array,
    directions: Array,
    those: Indices,
    table: Indices,
    world: Array,
    distance: Array,
    met: Indices,
) -> None:
    """Shorten rays to where they first meet one of some solids.

    Args:
        origins: World [m], shape (n, 3).
        directions: Unit vectors, shape (n, 3).
        those: What they can meet, shape (k,).
        table: Of all solids, see `seerob.kernels.pairs.BoundSolids`.
        world: world_from_solid, nine of the rotation and three of the position, shape (ns, 12).
        distance: Length of each ray, shortened where it meets something [m], shape (n,).
        met: Set to the body that a ray meets, where it does, shape (n,).
    """
    solids, room = _solids_in(table, 0), work()
    which, ball, corners, radius = solids.which, solids.ball, solids.corners, solids.radius
    o, u, p = np.empty(3), np.empty(3), np.empty(3)
    for s in those:
        mesh = mesh_of(solids, s)
        for c in range(3):
            p[c] = world[s, 9 + c]
            for d in range(3):
                p[c] += world[s, 3 * c + d] * ball[s, d]
        size = ball[s, 3] + radius[s] + 1e-9
        for k in range(len(origins)):
            best = distance[k]
            b = q = 0.0
            for c in range(3):
                b += (p[c] - origins[k, c]) * directions[k, c]
                q += (p[c] - origins[k, c]) ** 2
            if b < -size or b > best + size or q - b * b > size * size + 1e-9 * q:
                continue
            for c in range(3):
                o[c] = u[c] = 0.0
                for d in range(3):
                    o[c] += world[s, 3 * d + c] * (origins[k, d] - world[s, 9 + d])
                    u[c] += world[s, 3 * d + c] * directions[k, d]
            if which[s, MESH] == 0:
                far = corners[s, 1] if which[s, CORNERS] > 1 else corners[s, 0]
                t = _capsule(corners[s, 0], far, radius[s], o, u, best)
            elif which[s, VOLUME] == 1 and encloses(
                mesh.nodes, mesh.links, mesh.T, which[s, CLOSED] == 1, o[0], o[1], o[2]
            ):
                t = 0.0
            elif radius[s] > 0.0:
                t = _traced(mesh, o, u, radius[s], best, room)
            else:
                t = _mesh(mesh, o, u, best, room.stack)
            if t < distance[k] or (t == distance[k] and met[k] < 0):
                distance[k] = t
                met[k] = which[s, 0]
