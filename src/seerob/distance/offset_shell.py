"""The border of what is nearer to a convex set of points than a distance, as a closed surface to draw."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array

Faces = tuple[tuple[int, int, int], ...]


@cache
def _directions() -> tuple[Array, Faces]:
    """Corners of an icosahedron whose edges are halved, as unit vectors (42, 3), and its 80 triangles."""
    from scipy.spatial import ConvexHull

    g = (1 + 5**0.5) / 2
    twelve = np.array([np.roll([0.0, a, b], k) for k in range(3) for a in (-1, 1) for b in (-g, g)])
    apart = np.linalg.norm(twelve[:, None] - twelve, axis=2)
    i, j = np.nonzero(np.triu(np.isclose(apart, 2.0)))
    u = np.vstack([twelve, twelve[i] + twelve[j]])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    faces: NDArray[np.int32] = ConvexHull(u).simplices
    a, b, c = (u[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return u, tuple((int(p), int(q), int(r)) for p, q, r in faces)


def offset_shell(points: Array, distance: float) -> tuple[Array, Faces]:
    """A surface around the convex hull of points, at a distance from it.

    It touches the true border at 42 points and lies inside it between them, by at most a twentieth of the
    distance: for the eye, no verdict hangs on it.

    Args:
        points: Shape (k, 3) [m].
        distance: [m]; not below 0.

    Returns:
        Vertices, shape (42, 3) [m]; triangles, outward.
    """
    u, faces = _directions()
    farthest = points[np.argmax(points @ u.T, axis=0)]
    return farthest + distance * u, faces
