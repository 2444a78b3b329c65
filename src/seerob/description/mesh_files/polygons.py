"""Polygons with more than three corners cut into triangles, concave ones too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array

Indices = NDArray[np.int64]


def triangles(vertices: Array, polygons: Sequence[Sequence[int]]) -> Indices:
    """Triangles (m, 3) that cover the polygons, in their order and with their sense.

    Args:
        vertices: Shape (n, 3).
        polygons: Vertex indices of each, at least three; checked by the caller.
    """
    sizes = np.fromiter((len(p) for p in polygons), np.int64, len(polygons))
    if not len(sizes):
        return np.empty((0, 3), np.int64)
    if (sizes == sizes[0]).all():
        table = np.array(polygons, np.int64)
        return table if sizes[0] == 3 else _equal_polygons(vertices, table)
    pieces: list[Indices | None] = [None] * len(polygons)
    for size in np.unique(sizes):
        which = np.flatnonzero(sizes == size)
        table = np.array([polygons[int(i)] for i in which], np.int64)
        cut = table if size == 3 else _equal_polygons(vertices, table)
        for i, piece in zip(which, cut.reshape(len(which), -1, 3), strict=True):
            pieces[i] = piece
    return np.vstack([p for p in pieces if p is not None])


def _equal_polygons(vertices: Array, table: Indices) -> Indices:
    """Polygons (k, s) as fans, (k (s - 2), 3); those a fan would leave are cut one by one."""
    count, size = table.shape
    first = np.repeat(table[:, :1], size - 2, axis=1)
    fans = np.stack([first, table[:, 1:-1], table[:, 2:]], axis=2)
    a, b, c = np.moveaxis(vertices[fans], 2, 0)
    with np.errstate(all="ignore"):  # corners that are no numbers, or too large, are refused later
        cross = np.cross(b - a, c - a)
        normal = cross.sum(axis=1)
        backward = (np.einsum("ksi,ki->ks", cross, normal) < 0).any(axis=1)
    for i in np.flatnonzero(backward):
        cut = _concave(vertices[table[i]], normal[i])
        if cut is not None and len(cut) == size - 2:
            fans[i] = table[i][cut]
    return fans.reshape(count * (size - 2), 3)


def _concave(corners: Array, normal: Array) -> Indices | None:
    import manifold3d

    length = np.linalg.norm(normal)
    if not (np.isfinite(length) and length > 0):
        return None
    z = normal / length
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    flat = np.column_stack([corners @ x, corners @ np.cross(z, x)])
    return np.asarray(manifold3d.triangulate([flat], allow_convex=False), np.int64)
