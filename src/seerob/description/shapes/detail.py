"""Two levels of detail of one mesh: exact for distances, light for the screen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes import Mesh
from seerob.core.transforms import Array
from seerob.description.shapes.mesh_bodies import bodies, joined_unmerged, tidied
from seerob.kernels.signed_distance import outside
from seerob.kernels.tree import build_tree

LOSSLESS = 1e-6
"""Tolerance of the simplification for distances [m]."""
SHOWN = 20_000
"""Most triangles of a mesh on the screen, unless the user says otherwise."""


@dataclass(frozen=True, eq=False)
class DerivedMesh(Mesh):
    """A mesh made from another one, with how far their surfaces are apart."""

    deviation: float = 0.0
    """Largest distance from either surface to the other [m]: an upper bound."""
    method: str = ""
    """``as it is``, ``cleaned``, ``simplified`` or ``clustered``."""


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


def from_manifold(solid: Any, color: tuple[float, float, float, float] = Mesh.color) -> Mesh:
    """The surface of a `manifold3d.Manifold`."""
    out = solid.to_mesh64()
    return Mesh(np.array(out.vert_properties[:, :3], float), np.array(out.tri_verts, np.int32), color)


def physics_mesh(mesh: Mesh) -> DerivedMesh:
    """The mesh for distances: the same surface within 2e-6 m, with as few triangles as that allows.

    Closed bodies are simplified with a tolerance of `LOSSLESS`; what is open is only cleaned.
    """
    clean, said = tidied(mesh)
    simple = _simplified(clean, LOSSLESS)
    if simple is None and len(clean.faces):
        parts = [(part, _simplified(part, LOSSLESS)) for part in bodies(clean)]
        if any(lighter is not None for _, lighter in parts):
            simple = joined_unmerged([part if lighter is None else lighter for part, lighter in parts])
    if simple is not None:
        return DerivedMesh(simple.vertices, simple.faces, mesh.color, 2 * LOSSLESS, "simplified")
    return DerivedMesh(clean.vertices, clean.faces, mesh.color, 0.0, "cleaned" if said else "as it is")


def _simplified(mesh: Mesh, tolerance: float) -> Mesh | None:
    """A lighter mesh within the tolerance [m]; None when the mesh is open, or nothing can be left out."""
    solid = manifold(mesh)
    if solid is None:
        return None
    simple = tidied(from_manifold(solid.simplify(tolerance), mesh.color))[0]
    return simple if 0 < len(simple.faces) < len(mesh.faces) else None


def display_mesh(mesh: Mesh, *, max_triangles: int = SHOWN) -> DerivedMesh:
    """A mesh for the screen.

    Args:
        mesh: Any mesh [m].
        max_triangles: Most triangles; at least 100.

    Returns:
        A mesh with at most that many triangles and a bound on its deviation: simplified when it is
        closed and 2 % of its size are enough for that, else with near vertices pulled together.
    """
    if max_triangles < 100:
        raise ValueError(f"max_triangles is {max_triangles}: at least 100 are needed to show a shape")
    best = physics_mesh(mesh)
    if len(best.faces) <= max_triangles:
        return best
    size = float(np.linalg.norm(np.ptp(best.vertices, axis=0)))
    closed = manifold(best) is not None
    tolerance = 1e-4 * size
    while closed and tolerance < 0.02 * size:
        simple = _simplified(best, tolerance)
        if simple is not None and len(simple.faces) <= max_triangles:
            deviation = 2 * tolerance + best.deviation
            return DerivedMesh(simple.vertices, simple.faces, mesh.color, deviation, "simplified")
        tolerance *= 2
    cell = size / 1000
    while True:
        simple, deviation = _clustered(best, cell)
        if len(simple.faces) <= max_triangles:
            deviation += best.deviation
            return DerivedMesh(simple.vertices, simple.faces, mesh.color, deviation, "clustered")
        cell *= 1.2


def _clustered(mesh: Mesh, cell: float) -> tuple[Mesh, float]:
    """Vertices of each cubic cell replaced by their mean, and a bound on the distance either way [m]."""
    low: Array = mesh.vertices.min(axis=0)
    x, y, z = np.floor((mesh.vertices - low) / cell).astype(np.int64).T
    _, inverse, count = np.unique((x << 40) + (y << 20) + z, return_inverse=True, return_counts=True)
    inverse = inverse.ravel()
    mean = np.stack([np.bincount(inverse, mesh.vertices[:, i]) / count for i in range(3)], axis=1)
    moved = float(np.linalg.norm(mesh.vertices - mean[inverse], axis=1).max())
    faces = inverse[mesh.faces]
    light = tidied(Mesh(mean, faces.astype(np.int32), mesh.color))[0]
    return light, moved + (_lost(mean, faces) if len(light.faces) else 0.0)


def _lost(vertices: Array, faces: NDArray[np.int64]) -> float:
    """How far triangles that shrank to an edge or a point may be from those that remain [m]."""
    count = len(vertices)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 3, 2), axis=2)
    keys = edges[..., 0] * count + edges[..., 1]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    flat = ~np.cross(b - a, c - a).any(axis=1)
    lost = np.unique(keys[flat][~np.isin(keys[flat], keys[~flat])])
    if not len(lost):
        return 0.0
    ends = vertices[np.column_stack([lost // count, lost % count])]
    kept = np.unique(faces[~flat])
    # The distance to triangles that are points is that to the points.
    nodes, links, T = build_tree(vertices, np.column_stack([kept, kept, kept]).astype(np.int32))
    away = outside(nodes, links, T, np.ascontiguousarray(ends.reshape(-1, 3))).reshape(-1, 2).max(axis=1)
    return float((away + np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) / 2).max())
