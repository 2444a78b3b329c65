"""A mesh without what says nothing, and the bodies it is made of: whether closed, and which lie in which."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes import Mesh
from seerob.core.transforms import Array
from seerob.description.shapes.moments import signed_volume
from seerob.kernels.tree import component_of

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


Indices = NDArray[np.int64]


def joined(meshes: Sequence[Mesh]) -> tuple[Mesh, str]:
    """All of them as one mesh, with equal vertices merged: a body split by colour closes again.

    Returns:
        The mesh, and what was dropped in words.
    """
    return tidied(joined_unmerged(meshes))


def joined_unmerged(meshes: Sequence[Mesh]) -> Mesh:
    """All of them as one mesh, vertex by vertex and triangle by triangle, in the first one's colour."""
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = np.vstack([m.faces + o for m, o in zip(meshes, offsets, strict=False)])
    return Mesh(np.vstack([m.vertices for m in meshes]), faces.astype(np.int32), meshes[0].color)


def edge_balance(faces: NDArray[np.integer]) -> tuple[Indices, Indices, Indices]:
    """Undirected edges (k, 2), how often each is passed upward minus downward, and by how many faces.

    A mesh encloses a volume when the balance of every edge is 0, whether or not it is manifold.
    """
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    upward = directed[:, 0] < directed[:, 1]
    low, high = directed.min(axis=1), directed.max(axis=1)
    # One number per edge sorts much faster than two columns.
    span = int(faces.max()) + 1 if len(faces) else 1
    keys, inverse, uses = np.unique(low * span + high, return_inverse=True, return_counts=True)
    balance = np.bincount(inverse.ravel(), np.where(upward, 1, -1), len(keys)).astype(np.int64)
    return np.column_stack([keys // span, keys % span]), balance, uses.astype(np.int64)


def is_closed(mesh: Mesh) -> bool:
    """Whether every edge is passed as often one way as the other."""
    return bool(len(mesh.faces)) and not edge_balance(mesh.faces)[1].any()


def bodies(mesh: Mesh) -> tuple[Mesh, ...]:
    """The parts of a mesh whose faces share edges, largest first."""
    number, label = components(len(mesh.faces), adjacent_faces(mesh.faces))
    if number == 1:
        return (mesh,)
    order = np.argsort(label, kind="stable")
    groups = np.split(mesh.faces[order], np.flatnonzero(np.diff(label[order])) + 1)
    parts = [_only(mesh, faces) for faces in groups]
    return tuple(sorted(parts, key=lambda m: -float(np.prod(np.ptp(m.vertices, axis=0) + 1e-12))))


def components(count: int, pairs: NDArray[np.integer]) -> tuple[int, Indices]:
    """Connected components of an undirected graph, numbered by their first node.

    Args:
        count: Of nodes.
        pairs: Nodes that are connected, shape (k, 2).

    Returns:
        How many there are, and the component of each node, shape (count,).
    """
    root = component_of(np.ascontiguousarray(pairs[:, [0, 1, 1]], np.int64), count)
    first, label = np.unique(root, return_inverse=True)
    return len(first), label.astype(np.int64)


def _only(mesh: Mesh, faces: NDArray[np.int32]) -> Mesh:
    used, index = np.unique(faces, return_inverse=True)
    return Mesh(mesh.vertices[used], index.reshape(-1, 3).astype(np.int32), mesh.color)


def adjacent_faces(faces: NDArray[np.integer]) -> Indices:
    """Pairs of faces that share an edge, each face with the next one around the edge, shape (k, 2)."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    key = edges[:, 0] * (int(faces.max()) + 1) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    return np.column_stack([order[:-1][same] // 3, order[1:][same] // 3])


def winding_number(mesh: Mesh, point: Array) -> float:
    """How often the mesh goes around a point (3,): 1 inside a closed mesh, 0 outside, by solid angles."""
    corners = mesh.vertices[mesh.faces] - point
    lengths = np.linalg.norm(corners, axis=2)
    a, b, c = np.moveaxis(corners, 1, 0)
    la, lb, lc = lengths.T
    det = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a))]
    below = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return float(2 * np.arctan2(det, below).sum() / (4 * np.pi))


def outward(parts: tuple[Mesh, ...]) -> tuple[tuple[Mesh, ...], int]:
    """Closed bodies with their outer surfaces turned outward; inward ones inside another stay cavities.

    Returns:
        The bodies, and how many were turned.
    """
    low = np.array([m.vertices.min(axis=0) for m in parts])
    high = np.array([m.vertices.max(axis=0) for m in parts])
    turned = 0
    result = []
    for i, part in enumerate(parts):
        root = i
        # The parts are sorted, so the first one that holds this one is the outermost.
        for j in np.flatnonzero(((low[:i] <= low[i]) & (high[i] <= high[:i])).all(axis=1)).tolist():
            if abs(winding_number(parts[j], part.vertices[0])) > 0.5:
                root = j
                break
        inward = signed_volume(parts[root]) < 0
        turned += inward
        result.append(flipped(part) if inward else part)
    return tuple(result), turned


def flipped(mesh: Mesh) -> Mesh:
    """The mesh inside out."""
    return Mesh(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1]), mesh.color)
