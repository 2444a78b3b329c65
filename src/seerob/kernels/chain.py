"""What joints do to points that they carry, and what weight does to joints, for all of them at once.

Joints are columns of MuJoCo's ``cdof``: of each degree of freedom the twist it causes, rotation first, at the
centre of mass of its whole tree.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Indices = NDArray[np.int64]


@njit(
    "void(f8[:,::1], f8[:,::1], i8[::1], b1[:,::1], f8[:,::1], f8[:,::1], f8[:,::1])",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def along(
    cdof: Array,
    subtree_com: Array,
    roots: Indices,
    moves: NDArray[np.bool_],
    points: Array,
    directions: Array,
    found: Array,
) -> None:
    r"""Rows :math:`u^T J_v` of points: how fast each joint carries each point along its direction.

    Args:
        cdof: MuJoCo's, shape (nv, 6).
        subtree_com: MuJoCo's [m], shape (m, 3).
        roots: First body of the tree of each point, shape (b,).
        moves: Which degrees of freedom move which point, shape (b, nv).
        points: In the world [m], shape (b, 3).
        directions: In the world, shape (b, 3).
        found: Receives the rows, shape (b, nv).
    """
    for k in range(len(points)):
        ux, uy, uz = directions[k, 0], directions[k, 1], directions[k, 2]
        root = roots[k]
        ax = points[k, 0] - subtree_com[root, 0]
        ay = points[k, 1] - subtree_com[root, 1]
        az = points[k, 2] - subtree_com[root, 2]
        # u · (w × a) = w · (a × u)
        mx, my, mz = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
        for i in range(len(cdof)):
            found[k, i] = 0.0
            if moves[k, i]:
                found[k, i] = (
                    cdof[i, 0] * mx + cdof[i, 1] * my + cdof[i, 2] * mz
                    + cdof[i, 3] * ux + cdof[i, 4] * uy + cdof[i, 5] * uz
                )  # fmt: skip


@njit(
    "void(f8[:,::1], f8[:,::1], f8[:,::1], i8[::1], i8[::1], b1[::1], f8[::1], f8[::1], f8[::1])",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def held(
    subtree_com: Array,
    anchors: Array,
    axes: Array,
    bodies: Indices,
    joints: Indices,
    turns: NDArray[np.bool_],
    masses: Array,
    gravity: Array,
    found: Array,
) -> None:
    """Torques that hold what joints carry [N·m or N]: its weight acts at its common centre of mass.

    Args:
        subtree_com: Of what each body carries, itself included [m], shape (m, 3).
        anchors: Of all joints in the world [m], shape (j, 3).
        axes: Likewise, shape (j, 3).
        bodies: Body of each joint that is asked for, shape (n,).
        joints: Which, shape (n,).
        turns: Whether it turns, shape (n,); otherwise it slides.
        masses: What it carries [kg], shape (n,).
        gravity: [m/s²], shape (3,).
        found: Receives them, shape (n,).
    """
    gx, gy, gz = gravity[0], gravity[1], gravity[2]
    for k in range(len(joints)):
        j, b = joints[k], bodies[k]
        fx, fy, fz = gx, gy, gz
        if turns[k]:
            # (axis × arm) · g is axis · (arm × g) where a joint turns; one that slides falls along it.
            x = subtree_com[b, 0] - anchors[j, 0]
            y = subtree_com[b, 1] - anchors[j, 1]
            z = subtree_com[b, 2] - anchors[j, 2]
            fx, fy, fz = y * gz - z * gy, z * gx - x * gz, x * gy - y * gx
        found[k] = -masses[k] * (axes[j, 0] * fx + axes[j, 1] * fy + axes[j, 2] * fz)


@njit(
    "void(f8[:,:,::1], f8[:,:,::1], i8, i8[::1], b1[::1], f8[:,::1], f8[:,:,::1])",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def jacobians(
    cdof: Array,
    subtree_com: Array,
    root: int,
    dofs: Indices,
    moves: NDArray[np.bool_],
    points: Array,
    found: Array,
) -> None:
    """Jacobians of a point of a body at many instants, linear rows first, world axes.

    Args:
        cdof: MuJoCo's, shape (N, nv, 6).
        subtree_com: MuJoCo's [m], shape (N, m, 3).
        root: First body of the tree of the point.
        dofs: Degrees of freedom that are columns, shape (n,).
        moves: Which of all move the point, shape (nv,).
        points: In the world [m], shape (N, 3).
        found: Receives them, shape (N, 6, n).
    """
    for k in range(len(points)):
        x = points[k, 0] - subtree_com[k, root, 0]
        y = points[k, 1] - subtree_com[k, root, 1]
        z = points[k, 2] - subtree_com[k, root, 2]
        for c in range(len(dofs)):
            i = dofs[c]
            if not moves[i]:
                found[k, :, c] = 0.0
                continue
            wx, wy, wz = cdof[k, i, 0], cdof[k, i, 1], cdof[k, i, 2]
            found[k, 0, c] = cdof[k, i, 3] + (wy * z - wz * y)
            found[k, 1, c] = cdof[k, i, 4] + (wz * x - wx * z)
            found[k, 2, c] = cdof[k, i, 5] + (wx * y - wy * x)
            found[k, 3, c], found[k, 4, c], found[k, 5, c] = wx, wy, wz


@njit(cache=True, nogil=True, error_model="numpy")
def held_many(
    subtree_com: Array,
    anchors: Array,
    axes: Array,
    bodies: Indices,
    joints: Indices,
    turns: NDArray[np.bool_],
    masses: Array,
    gravity: Array,
    found: Array,
) -> None:
    """`held` at many instants: arrays that move have one more dimension in front."""
    for k in range(len(found)):
        held(subtree_com[k], anchors[k], axes[k], bodies, joints, turns, masses, gravity, found[k])
