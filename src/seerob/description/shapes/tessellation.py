"""Solids as meshes, for the screen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes.geometry import Mesh, Solid
from seerob.core.transforms import Array
from seerob.description.shapes.tidy import tidied

_ROUND = 20
"""Segments of a full circle; a multiple of four."""


def solid_mesh(solid: Solid, *, color: tuple[float, float, float, float] | None = None) -> Mesh:
    """A solid's surface for the screen; every vertex of a rounded one lies on the true surface.

    Args:
        solid: Any solid. A mesh with an envelope is shown with its vertices moved out by the radius.
        color: Red, green, blue, alpha in 0…1; the mesh's own, or the default, when None.

    Returns:
        About 400 triangles for a capsule; 8 for a flat rectangle without radius.
    """
    if solid.mesh is not None:
        mesh = solid.mesh
        vertices = mesh.vertices + solid.radius * _vertex_normals(mesh) if solid.radius else mesh.vertices
        return Mesh(vertices, mesh.faces, color or mesh.color)
    assert solid.points is not None
    tessellated = _capsule if len(solid.points) == 2 else _rounded_rectangle
    vertices, faces = tessellated(solid.points, solid.radius)
    # Where a ring shrinks to the corners of its rectangle, quads lose their area.
    return tidied(Mesh(vertices, faces.astype(np.int32), color or Mesh.color))[0]


def _vertex_normals(mesh: Mesh) -> Array:
    corners = mesh.vertices[mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    summed = np.stack(
        [np.bincount(mesh.faces.ravel(), np.repeat(normal[:, i], 3), len(mesh.vertices)) for i in range(3)],
        axis=1,
    )
    return np.asarray(summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-300))


def _frame(axis: Array) -> Array:
    """Rotation (3, 3) whose third column is the axis' direction; the identity for no axis."""
    length = float(np.linalg.norm(axis))
    if length < 1e-12:
        return np.eye(3)
    z = axis / length
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _rings(rings: list[Array], bottom: Array, top: Array) -> tuple[Array, NDArray[np.int64]]:
    """Rings of equally many points, from the bottom up, joined by quads and closed by two fans."""
    n = len(rings[0])
    vertices = np.vstack([bottom[None], *rings, top[None]])
    here = np.arange(n)
    there = (here + 1) % n
    faces = [np.column_stack([np.zeros(n, int), 1 + there, 1 + here])]
    for k in range(len(rings) - 1):
        a, b = 1 + k * n, 1 + (k + 1) * n
        faces.append(np.column_stack([a + here, a + there, b + there]))
        faces.append(np.column_stack([a + here, b + there, b + here]))
    last = 1 + (len(rings) - 1) * n
    faces.append(np.column_stack([last + here, last + there, np.full(n, len(vertices) - 1)]))
    return vertices, np.vstack(faces)


def _capsule(points: Array, radius: float) -> tuple[Array, NDArray[np.int64]]:
    start, end = points
    frame = _frame(end - start)
    angle = 2 * np.pi * np.arange(_ROUND) / _ROUND
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_ROUND)]) @ frame.T
    latitudes = np.linspace(0, np.pi / 2, _ROUND // 4 + 1)[:-1]
    axis = frame[:, 2]
    lower = [start + radius * (np.cos(b) * circle - np.sin(b) * axis) for b in latitudes[::-1]]
    upper = [end + radius * (np.cos(b) * circle + np.sin(b) * axis) for b in latitudes]
    if np.linalg.norm(end - start) < 1e-12:
        upper = upper[1:]
    return _rings(lower + upper, start - radius * axis, end + radius * axis)


def _rounded_rectangle(points: Array, radius: float) -> tuple[Array, NDArray[np.int64]]:
    corner, u, v = points[0], points[1] - points[0], points[2] - points[0]
    if min(np.linalg.norm(u), np.linalg.norm(v)) < 1e-12:
        # As narrow as that it is a capsule: a person who is round there has such a trunk.
        return _capsule(np.array([corner, corner + u + v]), radius)
    frame = np.column_stack([u / np.linalg.norm(u), v / np.linalg.norm(v), np.zeros(3)])
    frame[:, 2] = np.cross(frame[:, 0], frame[:, 1])
    quarter = _ROUND // 4
    angles = np.concatenate([np.linspace(q, q + 1, quarter + 1) * np.pi / 2 for q in range(4)])
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))]) @ frame.T
    at = np.repeat([corner + u + v, corner + v, corner, corner + u], quarter + 1, axis=0)
    axis = frame[:, 2]
    latitudes = np.linspace(-np.pi / 2, np.pi / 2, _ROUND // 2 + 1)[1:-1]
    rings = [at + radius * (np.cos(b) * circle + np.sin(b) * axis) for b in latitudes]
    rings = [at - radius * axis, *rings, at + radius * axis]
    middle = corner + (u + v) / 2
    return _rings(rings, middle - radius * axis, middle + radius * axis)
