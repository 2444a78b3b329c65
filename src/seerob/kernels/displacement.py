"""How far bodies have moved between two instants, in the world or seen from another body."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Indices = NDArray[np.int64]


@njit(
    "void(f8[:,:,::1], f8[:,::1], f8[:,:,::1], f8[:,::1], i8[:,::1], f8[:,::1], i8[::1], f8[::1])",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def displacements(
    R0: Array,
    x0: Array,
    R1: Array,
    x1: Array,
    pairs: Indices,
    corners: Array,
    start: Indices,
    found: Array,
) -> None:
    """Largest displacement of any point of a body, seen from another; writes into the last argument.

    A displacement is an affine function of the point and its norm a convex one: over a hull it is largest at
    a corner.

    Args:
        R0: World from body before, shape (n, 3, 3).
        x0: Likewise [m], shape (n, 3).
        R1: World from body now, shape (n, 3, 3).
        x1: Likewise [m], shape (n, 3).
        pairs: From which body, -1 for the world, and of which, shape (k, 2).
        corners: Points of all bodies in their own frames, whose hulls contain them [m], shape (m, 3).
        start: Where each body's corners start, shape (n + 1,).
        found: Receives [m], shape (k,).
    """
    D = np.empty((3, 3))
    e = np.empty(3)
    for k in range(len(pairs)):
        i = pairs[k, 0]
        j = pairs[k, 1]
        for r in range(3):
            if i < 0:
                for c in range(3):
                    D[r, c] = R1[j, r, c] - R0[j, r, c]
                e[r] = x1[j, r] - x0[j, r]
                continue
            for c in range(3):
                D[r, c] = 0.0
                for s in range(3):
                    D[r, c] += R1[i, s, r] * R1[j, s, c] - R0[i, s, r] * R0[j, s, c]
            e[r] = 0.0
            for s in range(3):
                e[r] += R1[i, s, r] * (x1[j, s] - x1[i, s]) - R0[i, s, r] * (x0[j, s] - x0[i, s])
        most = 0.0
        for q in range(start[j], start[j + 1]):
            square = 0.0
            for r in range(3):
                d = D[r, 0] * corners[q, 0] + D[r, 1] * corners[q, 1] + D[r, 2] * corners[q, 2] + e[r]
                square += d * d
            most = max(most, square)
        found[k] = math.sqrt(most)
