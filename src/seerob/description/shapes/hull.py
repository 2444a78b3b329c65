"""The convex hull of points in space.

Quickhull (Barber, Dobkin and Huhdanpaa 1996): the farthest point outside of a facet replaces all facets that
it sees. Which those are is decided exactly, so that they are one piece and the hull is closed and
convex, however many points lie in one plane.
"""

from __future__ import annotations

import numpy as np

from seerob.core.shapes import Faces, Mesh
from seerob.core.transforms import Array
from seerob.description.shapes.moments import signed_volume
from seerob.kernels.hull import NOISE, quickhull


def convex_hull(points: Array) -> Faces | None:
    """Triangles of the convex hull of points, counter-clockwise from outside.

    Args:
        points: Shape (n, 3).

    Returns:
        Rows of ``points``, shape (m, 3); None where the points are flat, too few or not finite. No point is
        further outside than `NOISE` of the largest coordinate.
    """
    points = np.ascontiguousarray(points, float).reshape(-1, 3)
    if len(points) < 4 or not np.isfinite(points).all():
        return None
    size = float(np.abs(points).max())
    corners = _simplex(points, NOISE * size)
    if corners is None:
        return None
    faces = quickhull(points, np.array(corners), size)
    if not len(faces):
        raise ArithmeticError("a convex hull that is not closed")
    return faces.astype(np.int32)


def hull_volume(points: Array) -> float:
    """Volume of the convex hull of points (n, 3), in the cube of their unit; 0 where they are flat."""
    faces = convex_hull(points)
    return 0.0 if faces is None else signed_volume(Mesh(points, faces))


def _simplex(points: Array, noise: float) -> tuple[int, int, int, int] | None:
    """Four points that span space, the fourth below the triangle of the first three."""
    a = int(np.lexsort(points.T[::-1])[0])
    arms = points - points[a]
    b = int(np.argmax(np.einsum("ij,ij->i", arms, arms)))
    length = float(np.linalg.norm(arms[b]))
    if not length > noise:
        return None
    across = np.linalg.norm(np.cross(arms, arms[b] / length), axis=1)
    c = int(np.argmax(across))
    if not across[c] > noise:
        return None
    normal = np.cross(arms[b], arms[c])
    above = arms @ (normal / np.linalg.norm(normal))
    d = int(np.argmax(np.abs(above)))
    if not abs(above[d]) > noise:
        return None
    return (a, b, c, d) if above[d] < 0 else (a, c, b, d)
