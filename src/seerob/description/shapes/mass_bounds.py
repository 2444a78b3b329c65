r"""How far mass properties may be off: a surface lies within a deviation, or a volume is not known.

A mesh may have a real surface on either side of it. What a body has and its mesh has not, or the other way
round, lies within δ of the mesh. A point there has its nearest point y on a triangle, an edge or a corner, so
that the layer on one side holds no more than

.. math::
    \mu = \sum_{\text{triangles}} A\,\delta + \sum_{\text{edges}} \tfrac12 \theta\,l\,\delta^2
    + \sum_{\text{corners}} \tfrac13 \Omega\,\delta^3

(Steiner), with the angle θ between both triangles of an edge, and with Ω of a corner no larger than that of
the cone about the mean normal which all normals there are in. Each point is no farther than δ from its y, so
in the order of Loewner its part of the spatial inertia is no more than :math:`(1 + \epsilon)` that of y and
:math:`(1 + 1/\epsilon)\,\delta^2` in every turn (Young's inequality). The largest eigenvalue k of the layer's
spatial inertia over the body's bounds everything at once: for every motion the body's part of a mass matrix,
so its mass, its centre and its moments, is between :math:`1 - k` and :math:`1 + k` times that of the mesh.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes import Mesh
from seerob.core.transforms import Array
from seerob.description.shapes.moments import Moments

Indices = NDArray[np.integer[Any]]


class Off(NamedTuple):
    """By which shares mass properties may be off."""

    volume: float
    """The volume, and with it the mass."""
    inertia: float
    """What the body adds to a mass matrix, in any motion: mass, centre and moments at once."""


def off_by(mesh: Mesh, deviation: float, moments: Moments) -> Off:
    """Shares by which a volume and mass properties may be off.

    Args:
        mesh: The surface they were worked out of [m], equal corners merged.
        deviation: How far the real surface may lie from it, on either side [m].
        moments: What was worked out.
    """
    if not deviation > 0:
        return Off(0.0, 0.0)
    points = mesh.vertices - moments.com
    weight, first, second = _measure(points, mesh.faces, deviation)
    spread = np.sqrt(np.trace(second) / (3 * weight)) if weight > 0 else 0.0
    eps = deviation / spread if spread > 0 else 1.0
    layer = _spatial((1 + eps) * weight, (1 + eps) * first, (1 + eps) * second)
    layer[3:, 3:] += (1 + 1 / eps) * deviation**2 * weight * np.eye(3)
    return Off(weight / moments.volume, _share(layer, _of_body(moments)))


def largest_gyration(com: Array, low: Array, high: Array) -> float:
    """Radius of gyration that no body within a box exceeds, about any axis through its centre of mass [m].

    Along each axis of the box the mean square distance from the centre c is no more than
    :math:`(c - l)(h - c)`, which half of the mass at either end has in the right proportion (Bhatia and
    Davis 2000), and no moment of inertia per mass is more than their sum.

    Args:
        com: Its centre of mass [m], shape (3,).
        low: Lowest corner of the box [m], shape (3,).
        high: Highest corner [m], shape (3,).
    """
    return float(np.sqrt(np.maximum((com - low) * (high - com), 0.0).sum()))


def off_by_volume(points: Array, volume: float, moments: Moments) -> float:
    """Share by which mass properties may be off where a volume [m³] may be missing, or too many, anywhere.

    Args:
        points: The convex hull of these holds it, shape (n, 3) [m].
        volume: At most so much of it.
        moments: What was worked out.
    """
    inverse = np.linalg.inv(_of_body(moments))
    y = points - moments.com
    # Of a unit of volume at y; the largest eigenvalue is convex in y, so that it is at a corner of the hull.
    cross = np.zeros((len(y), 3, 3))
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        cross[:, i, j], cross[:, j, i] = -y[:, k], y[:, k]
    moved = np.concatenate([np.broadcast_to(np.eye(3), cross.shape), -cross], axis=2)
    return float(volume * np.linalg.eigvalsh(moved @ inverse @ moved.transpose(0, 2, 1))[:, -1].max())


def off_by_difference(larger: Moments, smaller: Moments) -> float:
    """Share by which the larger of two moments may be off where the truth lies between both."""
    d = smaller.com - larger.com
    second = smaller.second + smaller.volume * np.outer(d, d)
    of_smaller = _spatial(smaller.volume, smaller.volume * d, second)
    body = _of_body(larger)
    return min(max(_share(body - of_smaller, body), 0.0), 1.0)


def _measure(points: Array, faces: Indices, deviation: float) -> tuple[float, Array, Array]:
    """Volume of the layer on one side, at the nearest points of the surface: its 0th to 2nd moments."""
    corners = points[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(normal, axis=1)
    normal = np.divide(normal, double[:, None], out=np.zeros_like(normal), where=double[:, None] > 0)
    total = corners.sum(axis=1)
    w = double / 2 * deviation
    weight, first = w.sum(), w @ total / 3
    second = sum(np.einsum("i,ij,ik->jk", w / 12, p, p) for p in (*np.moveaxis(corners, 1, 0), total))

    first_end, second_end, angle, odd = _edges(faces, normal)
    a, b = points[first_end], points[second_end]
    w = angle * np.linalg.norm(b - a, axis=1) * deviation**2 / 2
    weight, first = weight + w.sum(), first + w @ (a + b) / 2
    second = second + sum(np.einsum("i,ij,ik->jk", w / 6, p, p) for p in (a, b, a + b))

    w = _solid_angles(len(points), faces, normal, odd) * deviation**3 / 3
    return (
        float(weight + w.sum()),
        first + w @ points,
        second + np.einsum("i,ij,ik->jk", w, points, points),
    )


def _edges(faces: Indices, normal: Array) -> tuple[Indices, Indices, Array, Indices]:
    """Both corners of each edge, the angle of what is nearest to it [rad], corners of unknown angle."""
    pairs = np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    upward = faces.T.ravel() == pairs[:, 0]
    owner = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    pairs, owner, upward = pairs[order], owner[order], upward[order]
    start = np.flatnonzero(np.r_[True, (pairs[1:] != pairs[:-1]).any(axis=1)])
    count = np.diff(np.r_[start, len(pairs)])
    second = np.minimum(start + 1, len(pairs) - 1)
    # Neighbours that pass their edge the same way have opposite sides.
    turned = np.where(upward[start] == upward[second], -1.0, 1.0)
    one, other = normal[owner[start]], turned[:, None] * normal[owner[second]]
    angle = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.einsum("ij,ij->i", one, other))
    flat = one.any(axis=1) & other.any(axis=1)
    angle = np.where((count == 2) & flat, angle, np.where(count > 2, 2 * np.pi, np.pi))
    edges = pairs[start]
    return edges[:, 0], edges[:, 1], angle, np.unique(edges[(count != 2) | ~flat])


def _solid_angles(count: int, faces: Indices, normal: Array, odd: Indices) -> Array:
    """Bounds of the solid angles in which corners are the nearest of the surface, shape (count,)."""
    mean = np.zeros((count, 3))
    for column in faces.T:
        np.add.at(mean, column, normal)
    size = np.linalg.norm(mean, axis=1)
    mean = np.divide(mean, size[:, None], out=np.zeros_like(mean), where=size[:, None] > 0)
    least = np.ones(count)
    for column in faces.T:
        np.minimum.at(least, column, np.einsum("ij,ij->i", mean[column], normal))
    found = np.where(least > 0, 2 * np.pi * (1 - least), 4 * np.pi)
    found[odd] = 4 * np.pi
    used = np.zeros(count, bool)
    used[faces.ravel()] = True
    return np.where(used, found, 0.0)


def _of_body(moments: Moments) -> Array:
    inertia = np.zeros((6, 6))
    inertia[:3, :3], inertia[3:, 3:] = moments.volume * np.eye(3), moments.inertia
    return inertia


def _spatial(weight: float, first: Array, second: Array) -> Array:
    """Spatial inertia (6, 6) about the origin, linear before angular, of moments at density 1."""
    x, y, z = first
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turns = np.trace(second) * np.eye(3) - second
    return np.block([[weight * np.eye(3), -cross], [cross, turns]])


def _share(layer: Array, body: Array) -> float:
    """Largest k such that, for some motion, the layer has k times the body's energy."""
    root = np.linalg.inv(np.linalg.cholesky(body))
    return float(np.linalg.eigvalsh(root @ layer @ root.T)[-1])
