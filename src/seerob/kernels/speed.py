"""Where every body is and how it moves, and its fastest point, for all of them at once.

The speed of a rigid body is a convex function of the point, so over a convex hull it is largest at
a corner; what lies up to r outside the corners' hull adds at most ``|ω| r``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import Layout
from seerob.kernels.mujoco_calls import updated

Indices = NDArray[np.int64]


_ROWS = "f8[:,::1]"


class Placed(NamedTuple):
    """Poses of MuJoCo's m bodies, and of n that each are one of them."""

    calls: Indices
    """Addresses: the `mujoco.MjModel`, its data, and what is called so that they are up to date."""
    xmat: Array
    """World from body, row by row, shape (m, 9)."""
    xpos: Array
    """[m], shape (m, 3)."""
    xquat: Array
    """Shape (m, 4)."""
    rotations: Array
    """Shape (n, 3, 3)."""
    positions: Array
    """[m], shape (n, 3)."""
    quaternions: Array
    """Shape (n, 4)."""
    shown: NDArray[np.float32]
    """Position [m] and quaternion of each, shape (n, 7)."""


PLACED = Layout(
    Placed,
    [(np.int64, 1), *[(np.float64, 2)] * 3, (np.float64, 3), *[(np.float64, 2)] * 2, (np.float32, 2)],
)
_placed_in = PLACED.read


@njit("void(i8[:,::1], i8[::1])", cache=True, nogil=True)
def place(table: Indices, ids: Indices) -> None:
    """Work out poses and velocities of MuJoCo's bodies, and take over the poses of some.

    Args:
        table: Of `PLACED`; its last four are written, and what MuJoCo works out where ``calls`` says.
        ids: Which, shape (n,).
    """
    all_ = _placed_in(table, 0)
    for function in all_.calls[2:]:
        updated(function, all_.calls[0], all_.calls[1])
    for i in range(len(ids)):
        for c in range(9):
            all_.rotations[i, c // 3, c % 3] = all_.xmat[ids[i], c]
        for c in range(3):
            all_.positions[i, c] = all_.shown[i, c] = all_.xpos[ids[i], c]
        for c in range(4):
            all_.quaternions[i, c] = all_.shown[i, 3 + c] = all_.xquat[ids[i], c]


@njit(cache=True, nogil=True)
def carried(xmat: Array, xpos: Array, body: int, body_from_frame: Array) -> tuple[Array, Array]:
    """World rotation (3, 3) and position (3,) [m] of a frame on one of MuJoCo's bodies.

    Args:
        xmat: World from body, row by row, shape (m, 9).
        xpos: [m], shape (m, 3).
        body: Which.
        body_from_frame: Shape (4, 4).
    """
    rotation, position = np.empty((3, 3)), np.empty(3)
    for r in range(3):
        x, y, z = xmat[body, 3 * r], xmat[body, 3 * r + 1], xmat[body, 3 * r + 2]
        for c in range(3):
            rotation[r, c] = x * body_from_frame[0, c] + y * body_from_frame[1, c] + z * body_from_frame[2, c]
        position[r] = xpos[body, r] + (
            x * body_from_frame[0, 3] + y * body_from_frame[1, 3] + z * body_from_frame[2, 3]
        )
    return rotation, position


@njit(f"UniTuple(f8, 3)(f8[:,:,::1], {_ROWS}, i8, f8[:])", cache=True, nogil=True)
def in_body(rotations: Array, positions: Array, index: int, point: Array) -> tuple[float, float, float]:
    """Where a point of the world is in the frame of a body [m].

    Args:
        rotations: World from body, shape (n, 3, 3).
        positions: [m], shape (n, 3).
        index: Which body.
        point: In the world [m], shape (3,).
    """
    x, y, z = point[0] - positions[index, 0], point[1] - positions[index, 1], point[2] - positions[index, 2]
    R = rotations[index]
    return (
        x * R[0, 0] + y * R[1, 0] + z * R[2, 0],
        x * R[0, 1] + y * R[1, 1] + z * R[2, 1],
        x * R[0, 2] + y * R[1, 2] + z * R[2, 2],
    )


@njit(f"void({_ROWS}, {_ROWS}, {_ROWS}, i8[::1], i8[::1], {_ROWS}, {_ROWS})", cache=True, nogil=True)
def velocities(
    cvel: Array,
    subtree_com: Array,
    positions: Array,
    ids: Indices,
    roots: Indices,
    linear: Array,
    angular: Array,
) -> None:
    """Velocities of bodies at their origins; writes into the last two arguments.

    Args:
        cvel: MuJoCo's twists: rotation first, at the centre of mass of the whole tree, shape (m, 6).
        subtree_com: Centre of mass of the tree below each of MuJoCo's bodies [m], shape (m, 3).
        positions: World positions of the bodies' origins [m], shape (n, 3).
        ids: MuJoCo's body of each, shape (n,).
        roots: The first body of its tree, shape (n,).
        linear: World axes [m/s], shape (n, 3).
        angular: World axes [rad/s], shape (n, 3).
    """
    for i in range(len(ids)):
        k, root = ids[i], roots[i]
        wx, wy, wz = cvel[k, 0], cvel[k, 1], cvel[k, 2]
        ax = positions[i, 0] - subtree_com[root, 0]
        ay = positions[i, 1] - subtree_com[root, 1]
        az = positions[i, 2] - subtree_com[root, 2]
        angular[i, 0], angular[i, 1], angular[i, 2] = wx, wy, wz
        linear[i, 0] = cvel[k, 3] + (wy * az - wz * ay)
        linear[i, 1] = cvel[k, 4] + (wz * ax - wx * az)
        linear[i, 2] = cvel[k, 5] + (wx * ay - wy * ax)


@njit(
    f"void(f8[:,:,::1], {_ROWS}, {_ROWS}, {_ROWS}, {_ROWS}, i8[::1], f8[::1], f8[::1], {_ROWS}, {_ROWS})",
    cache=True,
    nogil=True,
)
def fastest(
    rotations: Array,
    positions: Array,
    linear: Array,
    angular: Array,
    corners: Array,
    start: Indices,
    reach: Array,
    speed: Array,
    point: Array,
    velocity: Array,
) -> None:
    """Bound on the speed of any point of each body; writes into the last three arguments.

    Args:
        rotations: World from body, shape (n, 3, 3).
        positions: World positions of the bodies' origins [m], shape (n, 3).
        linear: Velocities of the origins, world axes [m/s], shape (n, 3).
        angular: Angular velocities, world axes [rad/s], shape (n, 3).
        corners: Points of all bodies in their own frames, by coordinate [m], shape (3, k).
        start: Where each body's corners start, shape (n + 1,).
        reach: How far a body may lie outside its corners' hull [m], shape (n,).
        speed: Bound [m/s], shape (n,); 0 for a body without corners.
        point: The corner where it is, in the world [m], shape (n, 3).
        velocity: The corner's velocity [m/s], shape (n, 3).
    """
    squares = np.empty(corners.shape[1])
    for i in range(len(speed)):
        wx, wy, wz = angular[i, 0], angular[i, 1], angular[i, 2]
        ux, uy, uz = linear[i, 0], linear[i, 1], linear[i, 2]
        xx, xy, xz = rotations[i, 0, 0], rotations[i, 0, 1], rotations[i, 0, 2]
        yx, yy, yz = rotations[i, 1, 0], rotations[i, 1, 1], rotations[i, 1, 2]
        zx, zy, zz = rotations[i, 2, 0], rotations[i, 2, 1], rotations[i, 2, 2]
        first, last = start[i], start[i + 1]
        x, y, z, found = (
            corners[0, first:last], corners[1, first:last], corners[2, first:last], squares[first:last]
        )  # fmt: skip
        # All of them first, without a branch: so the compiler takes several corners at once.
        for k in range(len(found)):
            cx, cy, cz = x[k], y[k], z[k]
            ax, ay, az = xx * cx + xy * cy + xz * cz, yx * cx + yy * cy + yz * cz, zx * cx + zy * cy + zz * cz
            vx, vy, vz = ux + wy * az - wz * ay, uy + wz * ax - wx * az, uz + wx * ay - wy * ax
            found[k] = vx * vx + vy * vy + vz * vz
        best, at = -1.0, -1
        for k in range(len(found)):
            if found[k] > best:
                best, at = found[k], k
        if at >= 0:
            cx, cy, cz = x[at], y[at], z[at]
            ax, ay, az = xx * cx + xy * cy + xz * cz, yx * cx + yy * cy + yz * cz, zx * cx + zy * cy + zz * cz
            point[i, 0], point[i, 1] = positions[i, 0] + ax, positions[i, 1] + ay
            point[i, 2] = positions[i, 2] + az
            velocity[i, 0], velocity[i, 1] = ux + wy * az - wz * ay, uy + wz * ax - wx * az
            velocity[i, 2] = uz + wx * ay - wy * ax
        turn = math.sqrt(wx * wx + wy * wy + wz * wz)
        speed[i] = math.sqrt(best) + turn * reach[i] if best >= 0 else 0.0


@njit(
    f"void({_ROWS}, {_ROWS}, {_ROWS}, {_ROWS}, i8[::1], i8[::1], {_ROWS}, i8[::1], f8[::1], f8[::1])",
    cache=True,
    nogil=True,
)
def fastest_of(
    xmat: Array,
    xpos: Array,
    cvel: Array,
    subtree_com: Array,
    ids: Indices,
    roots: Indices,
    corners: Array,
    start: Indices,
    reach: Array,
    speed: Array,
) -> None:
    """Bound on the speed of any point of some of MuJoCo's bodies; writes into the last argument.

    Args:
        xmat: As `placed` takes it, with the next.
        xpos: Likewise.
        cvel: As `velocities` takes it, with the next.
        subtree_com: Likewise.
        ids: Which bodies, shape (n,).
        roots: The first body of the tree of each, shape (n,).
        corners: As `fastest` takes it, with the next two.
        start: Likewise.
        reach: Likewise.
        speed: Bound [m/s], shape (n,).
    """
    n = len(ids)
    rotations, every = np.empty((n, 3, 3)), np.empty((5, n, 3))
    positions, linear, angular = every[0], every[1], every[2]
    for i in range(n):
        for c in range(9):
            rotations[i, c // 3, c % 3] = xmat[ids[i], c]
        for c in range(3):
            positions[i, c] = xpos[ids[i], c]
    velocities(cvel, subtree_com, positions, ids, roots, linear, angular)
    fastest(rotations, positions, linear, angular, corners, start, reach, speed, every[3], every[4])


def stacked(parts: list[Array]) -> tuple[Array, Indices]:
    """Corners of all bodies in one array, and where each body's start."""
    start = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int64)
    return np.ascontiguousarray(np.concatenate([np.zeros((0, 3)), *parts])), start


def by_coordinate(parts: list[Array]) -> tuple[Array, Indices]:
    """Corners of all bodies as `fastest` takes them, shape (3, k), and where each body's start."""
    corners, start = stacked(parts)
    return np.ascontiguousarray(corners.T), start


@njit(cache=True, nogil=True)
def velocities_many(
    cvel: Array, subtree_com: Array, positions: Array, ids: Indices, roots: Indices, found: Array
) -> None:
    """`velocities` at many instants, to linear and angular ones, shape (2, N, n, 3)."""
    for k in range(len(cvel)):
        velocities(cvel[k], subtree_com[k], positions[k], ids, roots, found[0, k], found[1, k])


@njit(cache=True, nogil=True)
def fastest_many(
    rotations: Array,
    positions: Array,
    linear: Array,
    angular: Array,
    corners: Array,
    start: Indices,
    reach: Array,
    speed: Array,
    point: Array,
    velocity: Array,
) -> None:
    """`fastest` at many instants: arrays that move have one more dimension in front."""
    for k in range(len(speed)):
        fastest(
            rotations[k], positions[k], linear[k], angular[k], corners, start, reach,
            speed[k], point[k], velocity[k],
        )  # fmt: skip


@njit("Tuple((b1, f8[:,::1]))(f8[:,::1], f8)", cache=True, nogil=True, error_model="numpy")
def directions(v: Array, still: float) -> tuple[bool, Array]:
    """Whether any of many velocities has a direction, and which, NaN where none, shape (n, 3).

    Args:
        v: [m/s], shape (n, 3).
        still: Speed up to which there is none [m/s].
    """
    found = np.full(v.shape, np.nan)
    some = False
    for i in range(len(v)):
        speed = math.sqrt(v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1] + v[i, 2] * v[i, 2])
        if speed > still:
            some = True
            for c in range(3):
                found[i, c] = v[i, c] / speed
    return some, found
