"""A mesh without what says nothing: equal vertices, triangles without area, repeated triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes import Mesh
from seerob.core.transforms import Array

_ODD = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)


def tidied(mesh: Mesh) -> tuple[Mesh, str]:
    """Equal vertices merged, triangles without area and repeated triangles dropped; the surface stays.

    Triangles that are back to back both stay: they may be the two sides of a fin.

    Returns:
        The mesh, its vertices in the order of the file and without those that no triangle uses, and what
        was dropped in words, empty when nothing was.
    """
    vertices = np.ascontiguousarray(mesh.vertices, float) + 0.0  # -0.0 and 0.0 become one
    first, inverse = _equal_rows(vertices)
    faces = inverse[mesh.faces.astype(np.int64)]
    said = []
    flat = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 2] == faces[:, 0])
    vertices = vertices[first]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    flat |= ~np.cross(b - a, c - a).any(axis=1)
    if flat.any():
        said.append(f"{int(flat.sum())} triangles without area dropped")
        faces = faces[~flat]
    repeated = _repeated(faces, len(vertices))
    if repeated.any():
        said.append(f"{int(repeated.sum())} repeated triangles dropped")
        faces = faces[~repeated]
    used = np.zeros(len(vertices), bool)
    used[faces.ravel()] = True
    index = np.cumsum(used) - 1
    return Mesh(vertices[used], index[faces].astype(np.int32), mesh.color), ", ".join(said)


def _equal_rows(rows: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Index of the first of each set of equal rows, in order, and for each row the number of its set."""
    # Sorting one hash per row is several times faster than sorting rows; a collision is seen and handled.
    bits = rows.view(np.uint64)
    mixed = bits ^ (bits >> np.uint64(29))
    keys = (mixed * _ODD).sum(axis=1, dtype=np.uint64)
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    if not np.array_equal(rows[first][inverse], rows):
        _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first[order].astype(np.int64), rank[inverse.ravel()].astype(np.int64)


def _repeated(faces: NDArray[np.int64], count: int) -> NDArray[np.bool_]:
    """Which triangles are the same as an earlier one, turned in any way but not over."""
    start = faces.argmin(axis=1)
    turned = np.take_along_axis(faces, (start[:, None] + np.arange(3)) % 3, axis=1)
    if count < 2_000_000:
        # Three indices fit into one number.
        keys = (turned[:, 0] * count + turned[:, 1]) * count + turned[:, 2]
        _, first = np.unique(keys, return_index=True)
    else:
        _, first = np.unique(turned, axis=0, return_index=True)
    repeated = np.ones(len(faces), bool)
    repeated[first] = False
    return repeated
