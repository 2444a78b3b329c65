"""Where an arm is from its description alone, how fast points of its flange move, and where these were said.

None has types in its decorator: most runs ask none of them, and what is typed is loaded with the module.
Arrays are copied number by number: Numba compiles a slice that is written from an array for seconds.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def postures(
    q: Array,
    base: Array,
    links: Array,
    start: Indices,
    order: Indices,
    own_anchors: Array,
    own_axes: Array,
    slides: Flags,
    rotations: Array,
    positions: Array,
    anchors: Array,
    axes: Array,
) -> None:
    """Forward kinematics of a chain of links; writes into the last four.

    Args:
        q: Joint positions [rad or m], shape (N, n).
        base: Base from root, shape (4, 4).
        links: Each link from its parent, the tool point from its link at last, shape (k, 4, 4).
        start: Where the joints between a link and its parent begin in ``order``, shape (k + 1,).
        order: Joints from root to tool, of ``q``.
        own_anchors: A point on the axis of each joint in the frame that it leaves [m], shape (n, 3).
        own_axes: Unit axis of each joint there, shape (n, 3).
        slides: Which joints are prismatic, shape (n,).
        rotations: Base from tool, shape (N, 3, 3).
        positions: Of the tool point in the base [m], shape (N, 3).
        anchors: Of the joints in the base [m], shape (N, n, 3); 0 of one that does not move the tool.
        axes: Likewise, shape (N, n, 3).
    """
    R, A, B = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    p, moved = np.empty(3), np.empty(3)
    for s in range(len(q)):
        for i in range(3):
            p[i] = base[i, 3]
            for j in range(3):
                R[i, j] = base[i, j]
        for link in range(len(links)):
            for i in range(3):
                moved[i] = p[i]
                for j in range(3):
                    moved[i] += R[i, j] * links[link, j, 3]
                    B[i, j] = 0.0
                    for m in range(3):
                        B[i, j] += R[i, m] * links[link, m, j]
            for i in range(3):
                p[i] = moved[i]
                for j in range(3):
                    R[i, j] = B[i, j]
            for k in range(start[link], start[link + 1]):
                joint = order[k]
                x, y, z = own_axes[joint]
                for i in range(3):
                    anchors[s, joint, i] = p[i]
                    axes[s, joint, i] = 0.0
                    for j in range(3):
                        anchors[s, joint, i] += R[i, j] * own_anchors[joint, j]
                        axes[s, joint, i] += R[i, j] * own_axes[joint, j]
                if slides[joint]:
                    for i in range(3):
                        p[i] += axes[s, joint, i] * q[s, joint]
                    continue
                # Rodrigues: I + sin K + (1 - cos) K²
                sin, cos = math.sin(q[s, joint]), 1.0 - math.cos(q[s, joint])
                A[0, 0], A[0, 1], A[0, 2] = (
                    1.0 - cos * (y * y + z * z),
                    cos * x * y - sin * z,
                    cos * x * z + sin * y,
                )
                A[1, 0], A[1, 1], A[1, 2] = (
                    cos * x * y + sin * z,
                    1.0 - cos * (x * x + z * z),
                    cos * y * z - sin * x,
                )
                A[2, 0], A[2, 1], A[2, 2] = (
                    cos * x * z - sin * y,
                    cos * y * z + sin * x,
                    1.0 - cos * (x * x + y * y),
                )
                for i in range(3):
                    for j in range(3):
                        B[i, j] = 0.0
                        for m in range(3):
                            B[i, j] += R[i, m] * A[m, j]
                for i in range(3):
                    # The axis stays where it is.
                    p[i] = anchors[s, joint, i]
                    for j in range(3):
                        p[i] -= B[i, j] * own_anchors[joint, j]
                        R[i, j] = B[i, j]
        for i in range(3):
            positions[s, i] = p[i]
            for j in range(3):
                rotations[s, i, j] = R[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def point_speeds(
    rotations: Array, positions: Array, anchors: Array, axes: Array, slides: Flags, qd: Array, points: Array
) -> Array:
    """Speeds of points that are fixed to the tool [m/s], shape (k, N).

    Args:
        rotations: As of `postures`, likewise the next three.
        positions: Shape (N, 3) [m].
        anchors: Shape (N, n, 3) [m].
        axes: Shape (N, n, 3).
        slides: Shape (n,).
        qd: [rad/s or m/s], shape (N, n).
        points: In the tool's frame [m], shape (k, 3).
    """
    found = np.empty((len(points), len(qd)))
    v, w, a = np.empty(3), np.empty(3), np.empty(3)
    for s in range(len(qd)):
        v[:], w[:] = 0.0, 0.0
        for joint in range(len(slides)):
            u, rate = axes[s, joint], qd[s, joint]
            if slides[joint]:
                for i in range(3):
                    v[i] += u[i] * rate
                continue
            for i in range(3):
                a[i] = positions[s, i] - anchors[s, joint, i]
                w[i] += u[i] * rate
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                v[i] += (u[j] * a[k] - u[k] * a[j]) * rate
        for point in range(len(points)):
            for i in range(3):
                a[i] = 0.0
                for j in range(3):
                    a[i] += rotations[s, i, j] * points[point, j]
            squares = 0.0
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                squares += (v[i] + w[j] * a[k] - w[k] * a[j]) ** 2
            found[point, s] = math.sqrt(squares)
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_point(
    rotations: Array, positions: Array, points: Array, bases: Array, said: Array, errors: Array
) -> tuple[int, int]:
    """Which point that is fixed to the tool is where it was said to be, and in which frame it was said.

    Args:
        rotations: Base from tool, shape (N, 3, 3), N > 0.
        positions: Of the tool in the base [m], shape (N, 3).
        points: In the tool's frame [m], shape (k, 3).
        bases: Base from the frames in which it may have been said, shape (b, 4, 4).
        said: Where it is, shape (N, 3) [m].
        errors: Receives how far that point is from there [m], shape (N,).

    Returns:
        Rows of ``points`` and ``bases``, of which the largest error is least; the first of equal ones.
    """
    least, best = np.inf, (0, 0)
    for base in range(len(bases)):
        for point in range(len(points)):
            most = 0.0
            for s in range(len(said)):
                error = _apart(rotations[s], positions[s], points[point], bases[base], said[s])
                if not error <= most and not np.isnan(most):  # what is not a number stays
                    most = error
            if (base == 0 and point == 0) or most < least:
                least, best = most, (point, base)
    for s in range(len(said)):
        errors[s] = _apart(rotations[s], positions[s], points[best[0]], bases[best[1]], said[s])
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def _apart(rotation: Array, position: Array, point: Array, base: Array, said: Array) -> float:
    squares = 0.0
    for i in range(3):
        off = position[i] - base[i, 3]
        for j in range(3):
            off += rotation[i, j] * point[j] - base[i, j] * said[j]
        squares += off * off
    return math.sqrt(squares)


@njit(cache=True, nogil=True, error_model="numpy")
def other_way(
    times: Array, speeds: Array, ways: Array, t: float, speed: Array, way: Array, bounds: Array
) -> int:
    """First of some instants since which a point went another way than each of others; -1 where none is.

    Args:
        times: The instants [s], shape (k,).
        speeds: Of the point and of the others then [m/s], shape (k, 1 + m).
        ways: How far they had gone [m], likewise.
        t: Now [s].
        speed: Now, shape (1 + m,).
        way: Now, likewise.
        bounds: Longest time that is looked back [s]; by how much ways may differ [m], by which share of the
            longer one, and by how long one speed may lag behind the other [s].
    """
    back, floor, share, lag = bounds
    for k in range(len(times)):
        if not t - times[k] <= back:
            continue
        differs = True
        for i in range(1, len(way)):
            said, twin = way[0] - ways[k, 0], way[i] - ways[k, i]
            fastest = max(speed[0], speeds[k, 0], speed[i], speeds[k, i])
            if abs(twin - said) <= floor + share * max(said, twin) + lag * fastest:
                differs = False
        if differs:
            return k
    return -1
