"""What closes the openings of a mesh that lacks triangles where there is a surface in reality.

Where a surface is that a mesh lacks, no mesh tells. What closes an opening by the shortest way lies in the
convex hull of its rim, and what lies between several of them, as a wall between two edges, in the hull of all
of them. A surface that bulges beyond is not in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Literal

import numpy as np

from seerob.core.remembered import remembered
from seerob.core.shapes import Faces, Mesh, Solid
from seerob.core.transforms import Array
from seerob.description.shapes.hull import convex_hull
from seerob.description.shapes.mesh_bodies import is_closed
from seerob.description.shapes.mesh_mending import SEAM, Mended, mended

Said = Literal["open", "closed"] | None
"""What the user says of openings."""


def told(solids: Sequence[Solid], said: Said, depth: float = 0.0) -> tuple[Solid, ...]:
    """Solids of a body with what closes their openings in reality, or may where nobody says that.

    Args:
        solids: As the file has them.
        said: Of all openings.
        depth: As of `closed`.
    """
    found: list[Solid] = []
    for solid in solids:
        if said == "open" or solid.mesh is None or is_closed(solid.mesh):
            found.append(solid)
        elif said == "closed":
            found += [replace(solid, mesh=mesh) for mesh in closed(solid.mesh, depth)]
        else:
            found.append(replace(solid, lids=possibly_closed(solid.mesh)))
    return tuple(found)


def closed(mesh: Mesh, depth: float = 0.0) -> tuple[Mesh, ...]:
    """Every opening closed by itself, with all that may be a surface there.

    Args:
        mesh: With holes.
        depth: How far that may lie beyond the convex hull of each opening's rim [m].

    Returns:
        Meshes that take the place of this one, each of them closed but that of a heap of triangles.
    """
    made = mended(mesh, 0.0)
    if not is_closed(made.mesh):
        return mesh, *_around_all(made, depth)
    # A rim that is flat is spanned by what is mended.
    return made.mesh, *(lid for rim in made.rims for lid in _hull(rim, depth + made.moved))


@remembered
def possibly_closed(mesh: Mesh) -> tuple[Mesh, ...]:
    """All that may be a surface besides, where nobody says whether openings are closed, nor which rims meet.

    Args:
        mesh: With holes.

    Returns:
        Closed meshes; none where corners that were rounded apart were all that was open.
    """
    made = mended(mesh, 0.0)
    if not is_closed(made.mesh):
        return _around_all(made, 0.0)
    if not made.rims:
        return ()
    return made.mesh, *_hull(np.concatenate(made.rims), made.moved)


def _around_all(heap: Mended, depth: float) -> tuple[Mesh, ...]:
    """What holds a heap of triangles whose rims nobody can tell; that of a flat one is not flat."""
    return _hull(heap.mesh.vertices, max(depth + heap.moved, SEAM))


def _hull(points: Array, beyond: float) -> tuple[Mesh, ...]:
    """The convex hull of points (n, 3), so much larger to each side [m]; none where that is flat."""
    cube = beyond * np.array(list(product((-1.0, 1.0), repeat=3))) if beyond > 0 else np.zeros((1, 3))
    around = (points[:, None] + cube).reshape(-1, 3)
    faces = convex_hull(around)
    return () if faces is None else (_compact(around, faces),)


def _compact(points: Array, faces: Faces) -> Mesh:
    used, index = np.unique(faces, return_inverse=True)
    return Mesh(points[used], index.reshape(-1, 3).astype(np.int32))
