r"""The posture that fits what devices see of a person: damped Gauss–Newton in a box of joint values.

Minimised is, over pulls on points and on orientations of bones,

.. math:: \sum_i \rho_h\!\left(w_i |p_i - \hat p_i(q)|\right) + \sum_j \rho_h\!\left(w_j
          |\log(R_j \hat R_j(q)^T)|\right) + |W_0 (q - q_0)|^2 + |W_1 (q - q_1)|^2

with Huber's ρ, so that one thing that is seen wrongly does not carry the person away (Huber 1964), a
posture of rest :math:`q_0` for what nobody measures and the posture before :math:`q_1`. Joints at a bound
of the box that would leave it are held there (projection, Bertsekas 1982); a step that makes things worse
is taken back and damped more (Levenberg 1944).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Indices = NDArray[np.int64]

LARGEST_STEP = 0.5
"""Of one iteration and joint [rad or m]."""
HUBER = 5.0
"""In units of a pull's own error: beyond it a pull grows only linearly."""


class Links(NamedTuple):
    """Links of a person, b with n joints, the root first."""

    parent: Indices
    """Of each link, -1 for the first, shape (b,)."""
    first: Indices
    """Joint at which each link's own begin, and their number at the end, shape (b + 1,)."""
    prismatic: NDArray[np.bool_]
    """Shape (n,)."""
    axis: Array
    """In the link's frame, shape (n, 3)."""
    anchor: Array
    """Point of the axis in the link's frame [m], shape (n, 3)."""
    offset: Array
    """Of the link in its parent [m], shape (b, 3)."""
    mount: Array
    """Rotation of the link in its parent, shape (b, 3, 3)."""
    chain: Indices
    """Joints that move each link, from the root on, shape (b, most)."""
    length: Indices
    """How many, shape (b,)."""


class Poses(NamedTuple):
    """Where links and their joints are, in the root's frame."""

    R: Array
    """Root from link, shape (b, 3, 3)."""
    p: Array
    """[m], shape (b, 3)."""
    line: Array
    """Joint axes, shape (n, 3)."""
    through: Array
    """Points of them [m], shape (n, 3)."""


class Seen(NamedTuple):
    """What is seen of m points and orientations, in the root's frame."""

    bone: Indices
    """Link of each, shape (m,)."""
    at: Array
    """In the link's frame [m], shape (m, 3)."""
    position: Array
    """Of the point [m], shape (m, 3)."""
    wp: Array
    """One over the error of a position [1/m], 0 for none, shape (m,)."""
    rotation: Array
    """Root from link as it is seen, shape (m, 3, 3)."""
    wo: Array
    """One over the error of an orientation [1/rad], 0 for none, shape (m,)."""


class Beside(NamedTuple):
    """Postures beside what is seen, each with its weights [1/rad² or 1/m²], shape (n,)."""

    rest: Array
    """For what nobody measures [rad or m]."""
    w_rest: Array
    before: Array
    """The posture before [rad or m]."""
    w_before: Array


@njit(cache=True, nogil=True, error_model="numpy")
def forward(q: Array, links: Links, poses: Poses) -> None:
    """Where every bone is at joint values ``q`` [rad or m], shape (n,); writes into ``poses``."""
    parent, first, prismatic = links.parent, links.first, links.prismatic
    axis, anchor, offset, mount = links.axis, links.anchor, links.offset, links.mount
    R, p, line, through = poses.R, poses.p, poses.line, poses.through
    own, new = np.empty((3, 3)), np.empty((3, 3))
    for b in range(len(parent)):
        up = parent[b]
        for i in range(3):
            if up < 0:
                p[b, i] = offset[b, i]
            else:
                p[b, i] = p[up, i]
                for k in range(3):
                    p[b, i] += R[up, i, k] * offset[b, k]
            for j in range(3):
                if up < 0:
                    R[b, i, j] = mount[b, i, j]
                else:
                    total = 0.0
                    for k in range(3):
                        total += R[up, i, k] * mount[b, k, j]
                    R[b, i, j] = total
        for d in range(first[b], first[b + 1]):
            for i in range(3):
                line[d, i] = R[b, i, 0] * axis[d, 0] + R[b, i, 1] * axis[d, 1] + R[b, i, 2] * axis[d, 2]
                through[d, i] = p[b, i]
                for k in range(3):
                    through[d, i] += R[b, i, k] * anchor[d, k]
            if prismatic[d]:
                for i in range(3):
                    p[b, i] += line[d, i] * q[d]
                continue
            c, s = math.cos(q[d]), math.sin(q[d])
            x, y, z = axis[d, 0], axis[d, 1], axis[d, 2]
            v = 1.0 - c
            own[0, 0], own[0, 1], own[0, 2] = c + x * x * v, x * y * v - z * s, x * z * v + y * s
            own[1, 0], own[1, 1], own[1, 2] = y * x * v + z * s, c + y * y * v, y * z * v - x * s
            own[2, 0], own[2, 1], own[2, 2] = z * x * v - y * s, z * y * v + x * s, c + z * z * v
            for i in range(3):
                for j in range(3):
                    new[i, j] = R[b, i, 0] * own[0, j] + R[b, i, 1] * own[1, j] + R[b, i, 2] * own[2, j]
            for i in range(3):
                for j in range(3):  # not as a slice, which takes 4 s to compile
                    R[b, i, j] = new[i, j]
            for i in range(3):
                # The anchor stays where it was.
                p[b, i] = through[d, i] - (
                    R[b, i, 0] * anchor[d, 0] + R[b, i, 1] * anchor[d, 1] + R[b, i, 2] * anchor[d, 2]
                )


@njit(cache=True, nogil=True, error_model="numpy")
def logarithm(R: Array, S: Array, out: Array) -> None:
    """Axis times angle [rad] of ``R S^T`` for rotations (3, 3), into ``out`` (3,)."""
    m = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            m[i, j] = R[i, 0] * S[j, 0] + R[i, 1] * S[j, 1] + R[i, 2] * S[j, 2]
    x, y, z = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (m[0, 0] + m[1, 1] + m[2, 2] - 1.0)
    if sine > 1e-7:
        factor = 0.5 * math.atan2(sine, cosine) / sine
        out[0], out[1], out[2] = factor * x, factor * y, factor * z
        return
    if cosine > 0:
        out[0], out[1], out[2] = 0.5 * x, 0.5 * y, 0.5 * z
        return
    i = 0
    for k in range(1, 3):
        if m[k, k] > m[i, i]:
            i = k
    norm = 0.0
    for k in range(3):
        out[k] = 0.5 * (m[k, i] + (1.0 if k == i else 0.0))
        norm += out[k] * out[k]
    norm = math.sqrt(norm)
    for k in range(3):
        out[k] *= math.pi / norm


@njit(cache=True, nogil=True, error_model="numpy")
def residuals(poses: Poses, seen: Seen, error: Array) -> float:
    """What is missing of every pull; writes ``error`` (m, 6), position [m] first, and returns the cost."""
    R, p, bone, at, position, wp, rotation, wo = (
        poses.R, poses.p, seen.bone, seen.at, seen.position, seen.wp, seen.rotation, seen.wo,
    )  # fmt: skip
    cost = 0.0
    for k in range(len(bone)):
        b = bone[k]
        if wp[k] > 0:
            square = 0.0
            for i in range(3):
                here = p[b, i] + R[b, i, 0] * at[k, 0] + R[b, i, 1] * at[k, 1] + R[b, i, 2] * at[k, 2]
                error[k, i] = position[k, i] - here
                square += error[k, i] ** 2
            cost += _huber(wp[k] * math.sqrt(square))
        if wo[k] > 0:
            logarithm(rotation[k], R[b], error[k, 3:])
            cost += _huber(wo[k] * math.sqrt(error[k, 3] ** 2 + error[k, 4] ** 2 + error[k, 5] ** 2))
    return cost


@njit(cache=True, nogil=True, error_model="numpy")
def _huber(r: float) -> float:
    return r * r if r <= HUBER else HUBER * (2.0 * r - HUBER)


@njit(cache=True, nogil=True, error_model="numpy")
def _beside(q: Array, beside: Beside) -> float:
    rest, w_rest, before, w_before = beside
    total = 0.0
    for d in range(len(q)):
        total += w_rest[d] * (q[d] - rest[d]) ** 2 + w_before[d] * (q[d] - before[d]) ** 2
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _normal(links: Links, poses: Poses, seen: Seen, error: Array, A: Array, g: Array) -> None:
    """Adds ``J^T W J`` to the lower half of A and ``J^T W e`` to g."""
    chain, length, prismatic = links.chain, links.length, links.prismatic
    R, p, line, through = poses.R, poses.p, poses.line, poses.through
    bone, at, wp, wo = seen.bone, seen.at, seen.wp, seen.wo
    n = len(g)
    J = np.empty((6, n))
    for k in range(len(bone)):
        b = bone[k]
        m = length[b]
        x = np.empty(3)
        for i in range(3):
            x[i] = p[b, i] + R[b, i, 0] * at[k, 0] + R[b, i, 1] * at[k, 1] + R[b, i, 2] * at[k, 2]
        for c in range(m):
            d = chain[b, c]
            if prismatic[d]:
                for i in range(3):
                    J[i, c] = line[d, i]
                    J[3 + i, c] = 0.0
            else:
                ax, ay, az = line[d, 0], line[d, 1], line[d, 2]
                rx, ry, rz = x[0] - through[d, 0], x[1] - through[d, 1], x[2] - through[d, 2]
                J[0, c], J[1, c], J[2, c] = ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx
                J[3, c], J[4, c], J[5, c] = ax, ay, az
        for part in range(2):
            w = wp[k] if part == 0 else wo[k]
            if w <= 0:
                continue
            o = 3 * part
            size = w * math.sqrt(error[k, o] ** 2 + error[k, o + 1] ** 2 + error[k, o + 2] ** 2)
            ww = w * w * (1.0 if size <= HUBER else HUBER / size)
            for c in range(m):
                d = chain[b, c]
                j0, j1, j2 = ww * J[o, c], ww * J[o + 1, c], ww * J[o + 2, c]
                g[d] += j0 * error[k, o] + j1 * error[k, o + 1] + j2 * error[k, o + 2]
                for e in range(c + 1):
                    A[d, chain[b, e]] += j0 * J[o, e] + j1 * J[o + 1, e] + j2 * J[o + 2, e]


@njit(cache=True, nogil=True, error_model="numpy")
def _solve(A: Array, g: Array, damping: float, fixed: NDArray[np.bool_], L: Array, x: Array) -> None:
    """``(A + damping diag A) x = g`` by Cholesky, of the joints that are not fixed; A's lower half counts."""
    n = len(g)
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            if i == j:
                total *= 1.0 + damping
            if fixed[i] or fixed[j]:
                total = 1.0 if i == j else 0.0
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                L[i, i] = math.sqrt(max(total, 1e-12))
            else:
                L[i, j] = total / L[j, j]
    for i in range(n):
        total = 0.0 if fixed[i] else g[i]
        for k in range(i):
            total -= L[i, k] * x[k]
        x[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, n):
            total -= L[k, i] * x[k]
        x[i] = total / L[i, i]


@njit(cache=True, nogil=True, error_model="numpy")
def fit(
    q: Array, lower: Array, upper: Array, beside: Beside, links: Links, seen: Seen, iterations: int,
    enough: float, error: Array,
) -> int:  # fmt: skip
    """Improve ``q`` in place; returns the number of iterations, and in ``error`` what is missing.

    Args:
        q: Where to start [rad or m], shape (n,); brought into the box first.
        lower: Of the box, shape (n,).
        upper: Of the box, shape (n,).
        beside: What holds it where nothing is seen.
        links: Of the person.
        seen: What is seen.
        iterations: At most.
        enough: A step of which no joint is larger is the last [rad or m].
        error: Shape (m, 6).
    """
    rest, w_rest, before, w_before = beside
    n, b = len(q), len(links.parent)
    poses = Poses(np.empty((b, 3, 3)), np.empty((b, 3)), np.empty((n, 3)), np.empty((n, 3)))
    A, L = np.empty((n, n)), np.zeros((n, n))
    g, x, new = np.empty(n), np.empty(n), np.empty(n)
    fixed = np.zeros(n, np.bool_)
    for d in range(n):
        q[d] = min(max(q[d], lower[d]), upper[d])
    forward(q, links, poses)
    cost = residuals(poses, seen, error)
    cost += _beside(q, beside)
    damping = 1e-6
    done = 0
    for _ in range(iterations):
        done += 1
        A[:], g[:] = 0.0, 0.0
        _normal(links, poses, seen, error, A, g)
        for d in range(n):
            A[d, d] += w_rest[d] + w_before[d] + 1e-9
            g[d] += w_rest[d] * (rest[d] - q[d]) + w_before[d] * (before[d] - q[d])
            fixed[d] = (q[d] >= upper[d] and g[d] > 0) or (q[d] <= lower[d] and g[d] < 0)
        better = False
        largest = 0.0
        for _ in range(8):
            _solve(A, g, damping, fixed, L, x)
            largest = 0.0
            for d in range(n):
                largest = max(largest, abs(x[d]))
            scale = min(1.0, LARGEST_STEP / max(largest, 1e-300))
            for d in range(n):
                new[d] = min(max(q[d] + scale * x[d], lower[d]), upper[d])
            forward(new, links, poses)
            reached = residuals(poses, seen, error)
            reached += _beside(new, beside)
            if reached <= cost:
                better = True
                break
            damping = max(10.0 * damping, 1e-4)
        if not better:
            break
        for d in range(n):
            q[d] = new[d]
        cost = reached
        damping = max(0.1 * damping, 1e-9)
        if largest < enough:
            break
    forward(q, links, poses)
    residuals(poses, seen, error)
    return done
