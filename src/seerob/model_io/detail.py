"""Two levels of detail of one mesh: exact for distances, light for the screen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from seerob.geometry import Mesh
from seerob.transforms import Array

LOSSLESS = 1e-6
"""Tolerance of the simplification for distances [m]."""


@dataclass(frozen=True, eq=False)
class DerivedMesh(Mesh):
    """A mesh made from another one, with how far their surfaces are apart."""

    deviation: float = 0.0
    """Largest distance from either surface to the other [m]: an upper bound."""
    method: str = ""
    """``as it is``, ``cleaned``, ``simplified`` or ``clustered``."""


def tidied(mesh: Mesh) -> tuple[Mesh, str]:
    """Equal vertices merged, triangles without area and repeated triangles dropped; the surface stays.

    Returns:
        The mesh, without vertices that no triangle uses, and what was done in words, empty when nothing was.
    """
    # + 0.0 makes -0.0 and 0.0 one; comparing bytes is much faster than comparing rows.
    vertices = np.ascontiguousarray(mesh.vertices, float) + 0.0
    keys = vertices.view(np.dtype((np.void, vertices.dtype.itemsize * 3))).ravel()
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    # Keep the file's order of vertices: what was written together is read together.
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    faces = rank[inverse.ravel()][mesh.faces]
    vertices = vertices[first[order]]
    said = []
    flat = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 2] == faces[:, 0])
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat |= ~cross.any(axis=1)
    if flat.any():
        said.append(f"{int(flat.sum())} triangles without area dropped")
        faces = faces[~flat]
    start = faces.argmin(axis=1)
    turned = np.take_along_axis(faces, (start[:, None] + np.arange(3)) % 3, axis=1)
    _, kept = np.unique(turned, axis=0, return_index=True)
    if len(kept) < len(faces):
        said.append(f"{len(faces) - len(kept)} repeated triangles dropped")
        faces = faces[np.sort(kept)]
    used = np.zeros(len(vertices), bool)
    used[faces.ravel()] = True
    index = np.cumsum(used) - 1
    return Mesh(vertices[used], index[faces].astype(np.int32), mesh.color), ", ".join(said)


def manifold(mesh: Mesh) -> Any | None:
    """The mesh as a `manifold3d.Manifold`, or None when it is not closed and oriented."""
    import manifold3d

    if len(mesh.faces) < 4:
        return None
    solid = manifold3d.Manifold(
        manifold3d.Mesh64(
            vert_properties=np.ascontiguousarray(mesh.vertices, np.float64),
            tri_verts=np.ascontiguousarray(mesh.faces, np.uint64),
        )
    )
    return None if solid.status() != manifold3d.Error.NoError or solid.is_empty() else solid


def _from_manifold(solid: Any, color: tuple[float, float, float, float]) -> Mesh:
    out = solid.to_mesh64()
    vertices = np.array(out.vert_properties[:, :3], float)
    return tidied(Mesh(vertices, np.array(out.tri_verts, np.int32), color))[0]


def physics_mesh(mesh: Mesh) -> DerivedMesh:
    """The mesh for distances: the same surface within 2e-6 m, with as few triangles as that allows.

    Closed meshes are simplified with a tolerance of `LOSSLESS`, others are only cleaned.
    """
    clean, said = tidied(mesh)
    solid = manifold(clean)
    if solid is not None:
        simple = _from_manifold(solid.simplify(LOSSLESS), mesh.color)
        if 0 < len(simple.faces) < len(clean.faces):
            return DerivedMesh(simple.vertices, simple.faces, mesh.color, 2 * LOSSLESS, "simplified")
    return DerivedMesh(clean.vertices, clean.faces, mesh.color, 0.0, "cleaned" if said else "as it is")


def display_mesh(mesh: Mesh, *, max_triangles: int = 20_000) -> DerivedMesh:
    """A mesh for the screen with at most ``max_triangles`` triangles (more only where nothing helps)."""
    best = physics_mesh(mesh)
    if len(best.faces) <= max_triangles:
        return best
    size = float(np.linalg.norm(np.ptp(best.vertices, axis=0)))
    solid = manifold(best)
    tolerance = 1e-4 * size
    while solid is not None and tolerance < 0.02 * size:
        simple = _from_manifold(solid.simplify(tolerance), mesh.color)
        if 0 < len(simple.faces) <= max_triangles:
            deviation = tolerance + best.deviation
            return DerivedMesh(simple.vertices, simple.faces, mesh.color, deviation, "simplified")
        tolerance *= 2
    cell = size / 400
    while True:
        simple = _clustered(best, cell)
        if len(simple.faces) <= max_triangles:
            deviation = cell * 3**0.5 + best.deviation
            return DerivedMesh(simple.vertices, simple.faces, mesh.color, deviation, "clustered")
        cell *= 1.25


def _clustered(mesh: Mesh, cell: float) -> Mesh:
    """Vertices of each cubic cell replaced by their mean: no vertex moves more than the cell's diagonal."""
    low: Array = mesh.vertices.min(axis=0)
    keys = np.floor((mesh.vertices - low) / cell).astype(np.int64)
    _, inverse, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    inverse = inverse.ravel()
    mean = np.stack([np.bincount(inverse, mesh.vertices[:, i]) / count for i in range(3)], axis=1)
    return tidied(Mesh(mean, inverse[mesh.faces].astype(np.int32), mesh.color))[0]
