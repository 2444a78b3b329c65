r"""Whether a point lies inside a solid, by what a ray from it crosses; agrees with the winding number.

The winding number of a closed mesh about a point is the signed count of its triangles along any ray
from the point: :math:`w = \sum \operatorname{sign}(u \cdot n)` over those that are crossed. A ray that
comes too near an edge, lies along a triangle or meets one that is next to a line is not counted but
decided by `seerob.kernels.winding`, and so is every mesh with a rim, whose winding number is no integer.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.primitives import FLAT
from seerob.kernels.winding import contains

Links = NDArray[np.int32]

UX, UY, UZ = 0.31, 0.22, 0.9249324299644812
"""The ray: along no axis and no diagonal, where edges of made meshes lie."""
NEAR_EDGE = 1e-7
"""In barycentric coordinates."""
NEAR_PLANE = 1e-9
"""Distance of the point to a triangle below which the ray decides nothing [m]."""


@njit(cache=True, nogil=True, error_model="numpy")
def crossings(nodes: Array, links: Links, T: Array, x: float, y: float, z: float) -> tuple[int, bool]:
    """Signed count of the triangles that a ray from a point crosses, and whether it can be relied on.

    Args:
        nodes: As built by `seerob.kernels.tree.build_tree`.
        links: Likewise.
        T: Likewise.
        x: Point in the mesh's frame [m].
        y: Likewise.
        z: Likewise.
    """
    stack = np.empty(128, np.int32)
    stack[0] = 0
    depth = 1
    count = 0
    while depth > 0:
        depth -= 1
        i = stack[depth]
        px, py, pz = x - nodes[i, 0], y - nodes[i, 1], z - nodes[i, 2]
        enter, leave = 0.0, np.inf
        for a in range(3):
            bx, by, bz = nodes[i, 10 + 3 * a], nodes[i, 11 + 3 * a], nodes[i, 12 + 3 * a]
            at = bx * px + by * py + bz * pz
            slope = bx * UX + by * UY + bz * UZ
            h = nodes[i, 3 + a] + 1e-9
            if abs(slope) < 1e-12:
                if abs(at) > h:
                    leave = -1.0
            else:
                first, last = (-h - at) / slope, (h - at) / slope
                enter = max(enter, min(first, last))
                leave = min(leave, max(first, last))
        if enter > leave:
            continue
        if links[i, 1] == 0:
            stack[depth] = links[i, 0]
            stack[depth + 1] = i + 1
            depth += 2
            continue
        for k in range(links[i, 0], links[i, 0] + links[i, 1]):
            if T[k, 12] != FLAT:
                return 0, False
            nx, ny, nz = T[k, 9], T[k, 10], T[k, 11]
            size = math.sqrt(nx * nx + ny * ny + nz * nz)
            det = UX * nx + UY * ny + UZ * nz
            rx, ry, rz = x - T[k, 0], y - T[k, 1], z - T[k, 2]
            above = rx * nx + ry * ny + rz * nz
            if abs(det) <= 1e-9 * size:
                if abs(above) <= NEAR_PLANE * size or size == 0.0:
                    return 0, False
                continue
            cx, cy, cz = ry * UZ - rz * UY, rz * UX - rx * UZ, rx * UY - ry * UX
            v = -(T[k, 6] * cx + T[k, 7] * cy + T[k, 8] * cz) / det
            w = (T[k, 3] * cx + T[k, 4] * cy + T[k, 5] * cz) / det
            least = min(v, w, 1.0 - v - w)
            if least < -NEAR_EDGE:
                continue
            if abs(above) <= NEAR_PLANE * size:
                return 0, False
            if -above / det < 0.0:
                continue
            if least < NEAR_EDGE:
                return 0, False
            count += 1 if det > 0.0 else -1
    return count, True


@njit(cache=True, nogil=True, error_model="numpy")
def encloses(nodes: Array, links: Links, T: Array, closed: bool, x: float, y: float, z: float) -> bool:
    """Whether the mesh contains the point: `seerob.kernels.winding.contains`, sooner where it is closed."""
    if (
        abs(x - nodes[0, 0]) > nodes[0, 3]
        or abs(y - nodes[0, 1]) > nodes[0, 4]
        or abs(z - nodes[0, 2]) > nodes[0, 5]
    ):
        return False
    if closed:
        count, sure = crossings(nodes, links, T, x, y, z)
        if sure:
            return count != 0
    return bool(contains(nodes, links, T, x, y, z))
