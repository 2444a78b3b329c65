"""What joints do to points that they carry, and what weight does to joints, for all of them at once.

Joints are columns of MuJoCo's ``cdof``: of each degree of freedom the twist it causes, rotation first, at the
centre of mass of its whole tree.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.axes import principal_axes, quaternion
from seerob.kernels.bound import Layout

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


BLOCK = 32
"""Instants of which `followed` and `weighed` work out each figure one after the other, so that the compiler
does several at once."""


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
    n = len(parents)
    # Of each link the rotation, row by row, and the position; then where it would be with its joint at 0.
    links, turn, wave = np.empty((n + 1, 4, 3, BLOCK)), np.empty((3, 3, BLOCK)), np.empty((2, BLOCK))
    axis, arm = np.empty((3, BLOCK)), np.empty((3, BLOCK))
    links[0] = 0.0
    for r in range(3):
        links[0, r, r] = 1.0
    for begin in range(0, len(q), BLOCK):
        m = min(BLOCK, len(q) - begin)
        for j in range(n):
            P, L, F, a, h = links[parents[j]], links[j + 1], fixed[j], axes[j], anchors[j]
            for r in range(3):
                p, o, x, w, T = P[r], P[3, r], L[3, r], axis[r], turn[r]
                for i in range(m):
                    x[i] = o[i] + p[0, i] * F[0, 3] + p[1, i] * F[1, 3] + p[2, i] * F[2, 3]
                for c in range(3):
                    f, g, e, t = F[0, c], F[1, c], F[2, c], T[c]
                    for i in range(m):
                        t[i] = p[0, i] * f + p[1, i] * g + p[2, i] * e
                for i in range(m):
                    w[i] = T[0, i] * a[0] + T[1, i] * a[1] + T[2, i] * a[2]
            if not turns[j]:
                for i in range(m):
                    twist = twists[begin + i, j]
                    for r in range(3):
                        twist[r], twist[3 + r] = 0.0, axis[r, i]
                        L[3, r, i] += axis[r, i] * q[begin + i, j]
                L[:3] = turn
                continue
            for i in range(m):
                wave[0, i], wave[1, i] = math.sin(q[begin + i, j]), math.cos(q[begin + i, j])
            # Rodrigues' formula about the axis in the link.
            a0, a1, a2, h0, h1, h2 = a[0], a[1], a[2], h[0], h[1], h[2]
            for r in range(3):
                T, R, x, b, at = turn[r], L[r], L[3, r], arm[r], reference[r]
                for i in range(m):
                    s, v, t0, t1, t2 = wave[0, i], wave[1, i], T[0, i], T[1, i], T[2, i]
                    along_axis = (t0 * a0 + t1 * a1 + t2 * a2) * (1.0 - v)
                    r0 = v * t0 + s * (t1 * a2 - t2 * a1) + along_axis * a0
                    r1 = v * t1 + s * (t2 * a0 - t0 * a2) + along_axis * a1
                    r2 = v * t2 + s * (t0 * a1 - t1 * a0) + along_axis * a2
                    held_point = x[i] + t0 * h0 + t1 * h1 + t2 * h2
                    R[0, i], R[1, i], R[2, i] = r0, r1, r2
                    x[i] = held_point - (r0 * h0 + r1 * h1 + r2 * h2)
                    b[i] = at - held_point
            for i in range(m):
                wx, wy, wz, bx, by, bz = axis[0, i], axis[1, i], axis[2, i], arm[0, i], arm[1, i], arm[2, i]
                twist = twists[begin + i, j]
                twist[0], twist[1], twist[2] = wx, wy, wz
                twist[3], twist[4], twist[5] = wy * bz - wz * by, wz * bx - wx * bz, wx * by - wy * bx
        for j in range(n + 1):
            for i in range(m):
                for r in range(3):
                    positions[begin + i, j, r] = links[j, 3, r, i]
                    for c in range(3):
                        rotations[begin + i, j, r, c] = links[j, r, c, i]


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
    # Of each link, and then of all that it carries: moments about the reference, first moments, mass.
    sums, carried = np.empty((n, 9, BLOCK)), np.empty(n)
    link, A, d = np.empty((4, 3, BLOCK)), np.empty((3, 3, BLOCK)), np.empty((3, BLOCK))
    s, f, entry = np.empty((n, 6, BLOCK)), np.empty((6, BLOCK)), np.empty(BLOCK)
    for begin in range(0, len(found), BLOCK):
        m = min(BLOCK, len(found) - begin)
        for j in range(n):
            for i in range(m):
                for r in range(3):
                    link[3, r, i] = positions[begin + i, j + 1, r]
                    for c in range(3):
                        link[r, c, i] = rotations[begin + i, j + 1, r, c]
                for r in range(6):
                    s[j, r, i] = twists[begin + i, j, r]
            center, local, mass, own = centers[j], inertias[j], masses[j], sums[j]
            carried[j] = mass
            for r in range(3):
                R, x, off, at = link[r], link[3, r], d[r], reference[r]
                for i in range(m):
                    off[i] = x[i] + R[0, i] * center[0] + R[1, i] * center[1] + R[2, i] * center[2] - at
                for e in range(3):
                    f0, f1, f2, to = local[0, e], local[1, e], local[2, e], A[r, e]
                    for i in range(m):
                        to[i] = R[0, i] * f0 + R[1, i] * f1 + R[2, i] * f2
            for k in range(6):
                p, r = (k, k) if k < 3 else (0, k - 2) if k < 5 else (1, 2)
                a, R, to = A[p], link[r], own[k]
                for i in range(m):
                    to[i] = a[0, i] * R[0, i] + a[1, i] * R[1, i] + a[2, i] * R[2, i]
            for i in range(m):
                x, y, z = d[0, i], d[1, i], d[2, i]
                own[0, i] += mass * (y * y + z * z)
                own[1, i] += mass * (x * x + z * z)
                own[2, i] += mass * (x * x + y * y)
                own[3, i] -= mass * x * y
                own[4, i] -= mass * x * z
                own[5, i] -= mass * y * z
                own[6, i], own[7, i], own[8, i] = mass * x, mass * y, mass * z
        found[begin : begin + m] = 0.0
        for j in range(n - 1, -1, -1):
            own, w, weight = sums[j], s[j], carried[j]
            if parents[j] > 0:
                carried[parents[j] - 1] += weight
                for e in range(9):
                    more, to = own[e], sums[parents[j] - 1, e]
                    for i in range(m):
                        to[i] += more[i]
            row = places[j]
            if row < 0:
                continue
            # What a motion along this joint has of angular and linear momentum.
            for i in range(m):
                w0, w1, w2, w3, w4, w5 = w[0, i], w[1, i], w[2, i], w[3, i], w[4, i], w[5, i]
                x, y, z = own[6, i], own[7, i], own[8, i]
                f[0, i] = own[0, i] * w0 + own[3, i] * w1 + own[4, i] * w2 - z * w4 + y * w5
                f[1, i] = own[3, i] * w0 + own[1, i] * w1 + own[5, i] * w2 + z * w3 - x * w5
                f[2, i] = own[4, i] * w0 + own[5, i] * w1 + own[2, i] * w2 - y * w3 + x * w4
                f[3, i] = z * w1 - y * w2 + weight * w3
                f[4, i] = x * w2 - z * w0 + weight * w4
                f[5, i] = y * w0 - x * w1 + weight * w5
            k = j
            while k >= 0:
                column, v = places[k], s[k]
                if column >= 0:
                    for i in range(m):
                        entry[i] = (
                            v[0, i] * f[0, i] + v[1, i] * f[1, i] + v[2, i] * f[2, i]
                            + v[3, i] * f[3, i] + v[4, i] * f[4, i] + v[5, i] * f[5, i]
                        )  # fmt: skip
                    for i in range(m):
                        total = armature[j] + entry[i] if k == j else entry[i]
                        found[begin + i, row, column] = found[begin + i, column, row] = total
                k = parents[k] - 1


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


class Kinematics(NamedTuple):
    """MuJoCo's, of one instant: m bodies."""

    xmat: Array
    """World from body, row by row, shape (m, 9)."""
    xpos: Array
    """[m], shape (m, 3)."""
    cdof: Array
    """Axes of the joints, at the centre of mass of the whole tree, shape (nv, 6)."""
    subtree_com: Array
    """Centre of mass of the tree below each body [m], shape (m, 3)."""
    qvel: Array
    """Velocities of all joints [rad/s or m/s], shape (nv,)."""


_F = np.float64
KINEMATICS = Layout(Kinematics, [(_F, 2), (_F, 2), (_F, 2), (_F, 2), (_F, 1)])
_kinematics_in = KINEMATICS.read


@njit(
    "void(i8[:,::1], i8, i8, i8[::1], b1[::1], f8[::1], f8[:,::1], f8[::1], f8[:,::1], f8[::1])",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def at_point(
    kinematics: Indices,
    body: int,
    root: int,
    dofs: Indices,
    moves: NDArray[np.bool_],
    local: Array,
    jacobian: Array,
    velocity: Array,
    axes: Array,
    figures: Array,
) -> None:
    """What joints do to one point now: its Jacobian, velocity and ellipsoid of velocity, in one call.

    Args:
        kinematics: Table that begins with rows of `KINEMATICS`.
        body: MuJoCo's, of the point.
        root: First body of its tree.
        dofs: Degrees of freedom that are columns, shape (n,).
        moves: Which of them move the point, shape (n,).
        local: The point in the body [m], shape (3,).
        jacobian: Written: linear rows first, world axes, shape (6, n).
        velocity: Written: that of the point, linear before angular [m/s, rad/s], shape (6,).
        axes: Written: directions of the singular values of the linear rows, shape (3, 3).
        figures: Written: singular values, and the quaternion of the axes, shape (7,).
    """
    xmat, xpos, cdof, subtree_com, qvel = _kinematics_in(kinematics, 0)
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
