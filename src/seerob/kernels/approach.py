"""How fast bodies move seen from other bodies, and how low they are."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Indices = NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def relative_speeds(
    rotations: Array,
    positions: Array,
    linear: Array,
    angular: Array,
    pairs: Indices,
    corners: Array,
    start: Indices,
    reach: Array,
    found: Array,
) -> None:
    """Bound on the speed of any point of a body, seen from another; writes into the last argument.

    It is a convex function of the point: over a hull it is largest at a corner. What lies around the hull
    turns with it: a capsule about its own axis moves past its neighbour, as a cylinder does.

    Args:
        rotations: World from body, shape (n, 3, 3).
        positions: World positions of the bodies' origins [m], shape (n, 3).
        linear: Velocities of the origins, world axes [m/s], shape (n, 3).
        angular: World axes [rad/s], shape (n, 3).
        pairs: From which body, and of which, shape (k, 2).
        corners: Points of all bodies in their own frames, shape (m, 3).
        start: Where each body's corners start, shape (n + 1,).
        reach: How far a body may lie outside its corners' hull [m], shape (n,).
        found: Receives [m/s], shape (k,).
    """
    for k in range(len(pairs)):
        i, j = pairs[k]
        # As of one body that turns by the difference, at the origin of the one looked at.
        w = angular[j] - angular[i]
        d = positions[j] - positions[i]
        e = angular[i]
        ux = linear[j, 0] - linear[i, 0] - (e[1] * d[2] - e[2] * d[1])
        uy = linear[j, 1] - linear[i, 1] - (e[2] * d[0] - e[0] * d[2])
        uz = linear[j, 2] - linear[i, 2] - (e[0] * d[1] - e[1] * d[0])
        R = rotations[j]
        most = 0.0
        for q in range(start[j], start[j + 1]):
            c = corners[q]
            ax = R[0, 0] * c[0] + R[0, 1] * c[1] + R[0, 2] * c[2]
            ay = R[1, 0] * c[0] + R[1, 1] * c[1] + R[1, 2] * c[2]
            az = R[2, 0] * c[0] + R[2, 1] * c[1] + R[2, 2] * c[2]
            vx = ux + w[1] * az - w[2] * ay
            vy = uy + w[2] * ax - w[0] * az
            vz = uz + w[0] * ay - w[1] * ax
            most = max(most, vx * vx + vy * vy + vz * vz)
        turn = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        found[k] = math.sqrt(most) + turn * reach[j]


@njit(cache=True, nogil=True, error_model="numpy")
def lowest_points(
    bodies: Indices,
    rotations: Array,
    positions: Array,
    corners: Array,
    start: Indices,
    radius: Array,
    found: Array,
) -> None:
    """Height of the lowest point of bodies; writes into the last argument.

    It is linear in the point: over a dilated hull it is least at a corner, moved by the radius.

    Args:
        bodies: Which, shape (b,).
        rotations: World from body, shape (n, 3, 3).
        positions: World positions of the bodies' origins [m], shape (n, 3).
        corners: Points of these bodies whose hull, dilated by ``radius``, contains each [m], shape (k, 3).
        start: Where those of each begin, shape (b + 1,).
        radius: [m], shape (b,).
        found: Receives heights [m], infinity of a body without corners, shape (b,).
    """
    for k in range(len(bodies)):
        R = rotations[bodies[k]]
        low = np.inf
        for q in range(start[k], start[k + 1]):
            c = corners[q]
            low = min(low, R[2, 0] * c[0] + R[2, 1] * c[1] + R[2, 2] * c[2])
        found[k] = positions[bodies[k], 2] + low - radius[k]
