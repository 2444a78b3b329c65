"""What joints do to points that they carry, and what weight does to joints, for all of them at once.

Joints are columns of MuJoCo's ``cdof``: of each degree of freedom the twist it causes, rotation first, at the
centre of mass of its whole tree.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.axes import principal_axes, quaternion

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


@njit(cache=True, nogil=True, error_model="numpy")
def followed(
    q: Array,
    parents: Indices,
    turns: NDArray[np.bool_],
    fixed: Array,
    axes: Array,
    anchors: Array,
    reference: Array,
    rotations: Array,
    positions: Array,
    twists: Array,
) -> None:
    """Where the links of a tree are at many instants, and the twist that each joint causes.

    A link is one joint with all that is fixed to it. The first, which no joint moves, is the world.

    Args:
        q: Of the joints from where they are drawn [rad or m], shape (N, n).
        parents: Link that carries each joint, shape (n,); joints are in order from the root outward.
        turns: Whether each turns; otherwise it slides, shape (n,).
        fixed: Where the link is in its parent at 0, rotation and last column position [m], shape (n, 3, 4).
        axes: In the link, shape (n, 3).
        anchors: A point of each axis in the link [m], shape (n, 3).
        reference: Where twists are said, in the world [m], shape (3,).
        rotations: Receives world from link, shape (N, n + 1, 3, 3).
        positions: Receives their origins in the world [m], shape (N, n + 1, 3).
        twists: Receives them, rotation first, shape (N, n, 6).
    """
    turn = np.empty((3, 3))
    for k in range(len(q)):
        for r in range(3):
            positions[k, 0, r] = 0.0
            for c in range(3):
                rotations[k, 0, r, c] = 1.0 if r == c else 0.0
        for j in range(len(parents)):
            P, p = rotations[k, parents[j]], positions[k, parents[j]]
            R, x = rotations[k, j + 1], positions[k, j + 1]
            F, a, h = fixed[j], axes[j], anchors[j]
            for r in range(3):
                x[r] = p[r] + P[r, 0] * F[0, 3] + P[r, 1] * F[1, 3] + P[r, 2] * F[2, 3]
                for c in range(3):
                    turn[r, c] = P[r, 0] * F[0, c] + P[r, 1] * F[1, c] + P[r, 2] * F[2, c]
            wx = turn[0, 0] * a[0] + turn[0, 1] * a[1] + turn[0, 2] * a[2]
            wy = turn[1, 0] * a[0] + turn[1, 1] * a[1] + turn[1, 2] * a[2]
            wz = turn[2, 0] * a[0] + turn[2, 1] * a[1] + turn[2, 2] * a[2]
            twist = twists[k, j]
            if not turns[j]:
                for c in range(3):
                    twist[c] = 0.0
                twist[3], twist[4], twist[5] = wx, wy, wz
                for r in range(3):
                    x[r] += twist[3 + r] * q[k, j]
                    for c in range(3):
                        R[r, c] = turn[r, c]
                continue
            # Rodrigues' formula about the axis in the link.
            s, v = math.sin(q[k, j]), math.cos(q[k, j])
            u = 1.0 - v
            for r in range(3):
                T = turn[r]
                along_axis = (T[0] * a[0] + T[1] * a[1] + T[2] * a[2]) * u
                R[r, 0] = v * T[0] + s * (T[1] * a[2] - T[2] * a[1]) + along_axis * a[0]
                R[r, 1] = v * T[1] + s * (T[2] * a[0] - T[0] * a[2]) + along_axis * a[1]
                R[r, 2] = v * T[2] + s * (T[0] * a[1] - T[1] * a[0]) + along_axis * a[2]
                held_point = x[r] + T[0] * h[0] + T[1] * h[1] + T[2] * h[2]
                x[r] = held_point - (R[r, 0] * h[0] + R[r, 1] * h[1] + R[r, 2] * h[2])
                twist[3 + r] = reference[r] - held_point
            bx, by, bz = twist[3], twist[4], twist[5]
            twist[0], twist[1], twist[2] = wx, wy, wz
            twist[3], twist[4], twist[5] = wy * bz - wz * by, wz * bx - wx * bz, wx * by - wy * bx


@njit(cache=True, nogil=True, error_model="numpy")
def weighed(
    rotations: Array,
    positions: Array,
    twists: Array,
    parents: Indices,
    masses: Array,
    centers: Array,
    inertias: Array,
    armature: Array,
    reference: Array,
    places: Indices,
    found: Array,
) -> None:
    """Joint-space mass matrices at many instants, by the composite-rigid-body algorithm [Featherstone2008]_.

    Args:
        rotations: Of `followed`.
        positions: Of `followed`.
        twists: Of `followed`.
        parents: Of `followed`.
        masses: Of the links, all that is fixed to them included [kg], shape (n,).
        centers: Their centres of mass in the link [m], shape (n, 3).
        inertias: About these, in the link [kg·m²], shape (n, 3, 3).
        armature: Inertia of each rotor, seen by its joint, shape (n,).
        reference: Of `followed`.
        places: Row and column of each joint in what is found, -1 for those that are not asked, shape (n,).
        found: Receives them, shape (N, m, m).
    """
    n = len(parents)
    sums = np.empty((n, 10))
    A, d, f = np.empty((3, 3)), np.empty(3), np.empty(6)
    for k in range(len(found)):
        for j in range(n):
            R, x, c, local, m = rotations[k, j + 1], positions[k, j + 1], centers[j], inertias[j], masses[j]
            for r in range(3):
                d[r] = x[r] + R[r, 0] * c[0] + R[r, 1] * c[1] + R[r, 2] * c[2] - reference[r]
                for e in range(3):
                    A[r, e] = R[r, 0] * local[0, e] + R[r, 1] * local[1, e] + R[r, 2] * local[2, e]
            own = sums[j]
            dx, dy, dz = d[0], d[1], d[2]
            own[0] = A[0, 0] * R[0, 0] + A[0, 1] * R[0, 1] + A[0, 2] * R[0, 2] + m * (dy * dy + dz * dz)
            own[1] = A[1, 0] * R[1, 0] + A[1, 1] * R[1, 1] + A[1, 2] * R[1, 2] + m * (dx * dx + dz * dz)
            own[2] = A[2, 0] * R[2, 0] + A[2, 1] * R[2, 1] + A[2, 2] * R[2, 2] + m * (dx * dx + dy * dy)
            own[3] = A[0, 0] * R[1, 0] + A[0, 1] * R[1, 1] + A[0, 2] * R[1, 2] - m * dx * dy
            own[4] = A[0, 0] * R[2, 0] + A[0, 1] * R[2, 1] + A[0, 2] * R[2, 2] - m * dx * dz
            own[5] = A[1, 0] * R[2, 0] + A[1, 1] * R[2, 1] + A[1, 2] * R[2, 2] - m * dy * dz
            own[6], own[7], own[8], own[9] = m * dx, m * dy, m * dz, m
        found[k, :, :] = 0.0
        for j in range(n - 1, -1, -1):
            own, s = sums[j], twists[k, j]
            if parents[j] > 0:
                carrier = sums[parents[j] - 1]
                for i in range(10):
                    carrier[i] += own[i]
            row = places[j]
            if row < 0:
                continue
            # What a motion along this joint has of angular and linear momentum.
            f[0] = own[0] * s[0] + own[3] * s[1] + own[4] * s[2] - own[8] * s[4] + own[7] * s[5]
            f[1] = own[3] * s[0] + own[1] * s[1] + own[5] * s[2] + own[8] * s[3] - own[6] * s[5]
            f[2] = own[4] * s[0] + own[5] * s[1] + own[2] * s[2] - own[7] * s[3] + own[6] * s[4]
            f[3] = own[8] * s[1] - own[7] * s[2] + own[9] * s[3]
            f[4] = own[6] * s[2] - own[8] * s[0] + own[9] * s[4]
            f[5] = own[7] * s[0] - own[6] * s[1] + own[9] * s[5]
            found[k, row, row] = armature[j]
            i = j
            while i >= 0:
                column = places[i]
                if column >= 0:
                    w = twists[k, i]
                    total = w[0] * f[0] + w[1] * f[1] + w[2] * f[2] + w[3] * f[3] + w[4] * f[4] + w[5] * f[5]
                    if i == j:
                        found[k, row, row] += total
                    else:
                        found[k, row, column] = found[k, column, row] = total
                i = parents[i] - 1


@njit(cache=True, nogil=True, error_model="numpy")
def columns_of(
    twists: Array,
    reference: Array,
    moves: NDArray[np.bool_],
    places: Indices,
    rotations: Array,
    positions: Array,
    link: int,
    local: Array,
    found: Array,
) -> None:
    """Jacobians of a point of a link at many instants, linear rows first, world axes.

    Args:
        twists: Of `followed`.
        reference: Of `followed`.
        moves: Which joints move the link, shape (n,).
        places: Column of each joint in what is found, -1 for those that are not asked, shape (n,).
        rotations: Of `followed`.
        positions: Of `followed`.
        link: Which.
        local: The point in it [m], shape (3,).
        found: Receives them, shape (N, 6, m).
    """
    found[:] = 0.0
    for k in range(len(found)):
        R, x = rotations[k, link], positions[k, link]
        px = x[0] + R[0, 0] * local[0] + R[0, 1] * local[1] + R[0, 2] * local[2] - reference[0]
        py = x[1] + R[1, 0] * local[0] + R[1, 1] * local[1] + R[1, 2] * local[2] - reference[1]
        pz = x[2] + R[2, 0] * local[0] + R[2, 1] * local[1] + R[2, 2] * local[2] - reference[2]
        for j in range(len(moves)):
            c = places[j]
            if c < 0 or not moves[j]:
                continue
            s = twists[k, j]
            found[k, 0, c] = s[3] + (s[1] * pz - s[2] * py)
            found[k, 1, c] = s[4] + (s[2] * px - s[0] * pz)
            found[k, 2, c] = s[5] + (s[0] * py - s[1] * px)
            found[k, 3, c], found[k, 4, c], found[k, 5, c] = s[0], s[1], s[2]


@njit(cache=True, nogil=True, error_model="numpy")
def carried_by(jacobian: Array, qd: Array, found: Array) -> None:
    """Velocities that joints give a point at many instants.

    Args:
        jacobian: Shape (N, 6, n).
        qd: Joint velocities [rad/s or m/s], shape (N, n).
        found: Receives them, shape (N, 6).
    """
    for k in range(len(qd)):
        for r in range(found.shape[1]):
            total = 0.0
            for c in range(qd.shape[1]):
                total += jacobian[k, r, c] * qd[k, c]
            found[k, r] = total


@njit(
    "void(f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], i8, i8, i8[::1], b1[::1], f8[::1], f8[::1],"
    " f8[:,::1], f8[::1], f8[:,::1], f8[::1])",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def at_point(
    xmat: Array,
    xpos: Array,
    cdof: Array,
    subtree_com: Array,
    body: int,
    root: int,
    dofs: Indices,
    moves: NDArray[np.bool_],
    local: Array,
    qvel: Array,
    jacobian: Array,
    velocity: Array,
    axes: Array,
    figures: Array,
) -> None:
    """What joints do to one point now: its Jacobian, velocity and ellipsoid of velocity, in one call.

    Args:
        xmat: MuJoCo's, world from body, row by row, shape (m, 9).
        xpos: MuJoCo's [m], shape (m, 3).
        cdof: MuJoCo's, shape (nv, 6).
        subtree_com: MuJoCo's [m], shape (m, 3).
        body: MuJoCo's, of the point.
        root: First body of its tree.
        dofs: Degrees of freedom that are columns, shape (n,).
        moves: Which of them move the point, shape (n,).
        local: The point in the body [m], shape (3,).
        qvel: MuJoCo's [rad/s or m/s], shape (nv,).
        jacobian: Written: linear rows first, world axes, shape (6, n).
        velocity: Written: that of the point, linear before angular [m/s, rad/s], shape (6,).
        axes: Written: directions of the singular values of the linear rows, shape (3, 3).
        figures: Written: singular values, and the quaternion of the axes, shape (7,).
    """
    R, n = xmat[body], len(dofs)
    velocity[:] = 0.0
    x = xpos[body, 0] + (R[0] * local[0] + R[1] * local[1] + R[2] * local[2]) - subtree_com[root, 0]
    y = xpos[body, 1] + (R[3] * local[0] + R[4] * local[1] + R[5] * local[2]) - subtree_com[root, 1]
    z = xpos[body, 2] + (R[6] * local[0] + R[7] * local[1] + R[8] * local[2]) - subtree_com[root, 2]
    for c in range(n):
        i = dofs[c]
        if not moves[c]:
            jacobian[:, c] = 0.0
            continue
        wx, wy, wz = cdof[i, 0], cdof[i, 1], cdof[i, 2]
        jacobian[0, c] = cdof[i, 3] + (wy * z - wz * y)
        jacobian[1, c] = cdof[i, 4] + (wz * x - wx * z)
        jacobian[2, c] = cdof[i, 5] + (wx * y - wy * x)
        jacobian[3, c], jacobian[4, c], jacobian[5, c] = wx, wy, wz
        for r in range(6):
            velocity[r] += jacobian[r, c] * qvel[i]
    values, directions = np.empty((1, 3)), np.empty((1, 3, 3))
    principal_axes(jacobian[:3].copy().reshape(1, 3, n), values, directions)
    for r in range(3):
        for c in range(3):
            axes[r, c] = directions[0, r, c]
    lost = math.isnan(values[0, 0]) or math.isnan(values[0, 1]) or math.isnan(values[0, 2])
    for r in range(3):
        figures[r] = np.nan if lost else values[0, r]
    quaternion(axes, figures[3:])
