"""Distance of many points to the solid that a mesh bounds: 0 inside, to the surface outside."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.search import mesh_segment
from seerob.kernels.winding import contains

Links = NDArray[np.int32]

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
    stack = np.empty(128, np.int32)
    bounds = np.empty(128)
    W = np.empty(6)
    hint = -1
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        squared, hint = mesh_segment(nodes, links, T, x, y, z, 0.0, 0.0, 0.0, np.inf, hint, stack, bounds, W)
        d = math.sqrt(squared)
        if d > NEGLIGIBLE and contains(nodes, links, T, x, y, z):
            d = 0.0
        distance[n] = d
    return distance
