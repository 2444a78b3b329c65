"""What joints do to several points, and what somebody feels who is hit by them, all at once, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.axes import felt
from seerob.kernels.bound import Layout
from seerob.kernels.chain import KINEMATICS, at_point

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]


class MovingPoints(NamedTuple):
    """Points of MuJoCo's bodies, p of them, with c columns of joints in all."""

    M: Array
    """MuJoCo's mass matrix, of which there are only entries that are not 0, shape (nM,)."""
    bodies: Indices
    """Of MuJoCo, on which each point is, shape (p,)."""
    roots: Indices
    """The first body of its tree, shape (p,)."""
    local: Array
    """Each point as its body has it [m], shape (p, 3)."""
    start: Indices
    """Where the columns of each begin, shape (p + 1,)."""
    dofs: Indices
    """Degrees of freedom that are columns, shape (c,)."""
    moves: Flags
    """Which of them move the point, shape (c,)."""
    first: Indices
    """Where entries of the mass matrix of each begin, shape (p + 1,); none of a point that nobody weighs."""
    entries: Indices
    """Where ``M`` has them, row by row; -1 where two joints do not move each other."""
    velocity: Array
    """Written: that of each, linear before angular [m/s, rad/s], shape (p, 6)."""
    sigma: Array
    """Written: singular values of the linear rows of its Jacobian, and their axes as a quaternion, (p, 7)."""
    inverse: Array
    """Written: inverse of its effective mass matrix [1/kg], shape (p, 3, 3)."""
    masses: Array
    """Written: principal masses, smallest first [kg], and the quaternion of their axes, shape (p, 7)."""


_F, _I, _B = np.float64, np.int64, np.bool_
MOVING_POINTS = Layout(
    MovingPoints,
    [
        (_F, 1), (_I, 1), (_I, 1), (_F, 2), (_I, 1), (_I, 1), (_B, 1), (_I, 1), (_I, 1), (_F, 2), (_F, 2),
        (_F, 3), (_F, 2),
    ],
)  # fmt: skip
_points_in, _BEHIND = MOVING_POINTS.read, len(KINEMATICS.arrays)


@njit("i8(i8[:,::1])", cache=True, nogil=True, error_model="numpy")
def move_points(table: Indices) -> int:
    """Work out what joints do to points now, and their effective masses.

    Args:
        table: Of `KINEMATICS` and, behind it, `MOVING_POINTS`.

    Returns:
        Of which point the mass matrix is not positive definite; -1 of none.
    """
    all_ = _points_in(table, _BEHIND)
    axes, wrong = np.empty((3, 3)), -1
    for p in range(len(all_.bodies)):
        a, b = all_.start[p], all_.start[p + 1]
        J = np.empty((6, b - a))
        at_point(
            table, all_.bodies[p], all_.roots[p], all_.dofs[a:b], all_.moves[a:b], all_.local[p],
            J, all_.velocity[p], axes, all_.sigma[p],
        )  # fmt: skip
        first, n = all_.first[p], b - a
        if all_.first[p + 1] == first:
            continue
        M = np.empty((n, n))
        for i in range(n):
            for j in range(n):
                entry = all_.entries[first + i * n + j]
                M[i, j] = all_.M[entry] if entry >= 0 else 0.0
        if not felt(J, M, all_.inverse[p], axes, all_.masses[p]):
            wrong = p
    return wrong
