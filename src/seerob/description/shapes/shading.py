"""Normals for the screen: smooth over gentle bends, sharp over creases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes.geometry import Mesh
from seerob.core.transforms import Array

CREASE = np.pi / 6
"""Edges that bend more than this [rad] are shown sharp."""


def shaded(mesh: Mesh, crease: float = CREASE) -> tuple[Array, Array, NDArray[np.int64]]:
    """Vertices split along creases, with the angle-weighted normal of the smooth patch around each.

    Returns:
        Vertices (k, 3) [m], unit normals (k, 3) and faces (m, 3) that index them.
    """
    from seerob.kernels.tree import component_of

    faces = mesh.faces.astype(np.int64)
    count = len(faces)
    corners = mesh.vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)

    # Corner c of face f has number 3 f + c. Two corners at one vertex belong together when their
    # faces share an edge there that bends less than the crease.
    at = np.arange(3 * count).reshape(-1, 3)
    begin, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    corner_begin, corner_end = at.ravel(), at[:, [1, 2, 0]].ravel()
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    corner_low = np.where(begin < end, corner_begin, corner_end)
    corner_high = np.where(begin < end, corner_end, corner_begin)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    first, second = order[:-1][same], order[1:][same]
    smooth = np.einsum("ij,ij->i", normal[first // 3], normal[second // 3]) > np.cos(crease)
    first, second = first[smooth], second[smooth]
    # Twice the second: an edge is a triangle without area.
    joined = np.concatenate(
        [
            np.column_stack([corner[first], corner[second], corner[second]])
            for corner in (corner_low, corner_high)
        ]
    )
    root = component_of(joined, 3 * count)
    # A root is the first corner of its group: numbered in that order, the order is the mesh's own.
    is_root = root == np.arange(3 * count)
    group = (np.cumsum(is_root) - 1)[root]
    vertices = mesh.vertices[faces.ravel()[is_root]]

    edges = corners[:, [1, 2, 0]] - corners
    edges /= np.maximum(np.linalg.norm(edges, axis=2, keepdims=True), 1e-300)
    cosine = -np.einsum("fci,fci->fc", edges, edges[:, [2, 0, 1]])
    weighted = (np.arccos(np.clip(cosine, -1, 1))[:, :, None] * normal[:, None, :]).reshape(-1, 3)
    summed = np.stack([np.bincount(group, weighted[:, i], len(vertices)) for i in range(3)], axis=1)
    size = np.linalg.norm(summed, axis=1, keepdims=True)
    normals = np.where(size > 1e-12, summed / np.maximum(size, 1e-300), [0.0, 0.0, 1.0])
    return vertices, normals, group.reshape(-1, 3)
