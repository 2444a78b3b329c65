"""Surfaces that a file splits into open pieces, by colour or by name, and that enclose a volume together.

None of the pieces has an inside, and whoever is in there would be far from all of them and outside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seerob.core.shapes.geometry import Mesh, Solid
from seerob.description.shapes.detail import physics_mesh
from seerob.description.shapes.mesh_bodies import edge_balance, is_closed, joined
from seerob.description.shapes.mesh_sides import sided
from seerob.description.shapes.tidy import tidied

SEAM = 1e-6
"""How far apart corners of two pieces may be that are the same one, rounded differently [m]."""
MEET = 6
"""Pieces that may meet in one corner."""


def enclosing(meshes: Sequence[Mesh]) -> Mesh | None:
    """All of them as one closed mesh, corners on its seams moved by no more than rounding.

    Returns:
        None where they leave a hole.
    """
    whole = joined(meshes)[0]
    for _ in range(2):
        around = sided(whole)[0]
        if is_closed(around):
            return around
        whole = _sewn(whole)
    return None


def with_insides(solids: Sequence[Solid]) -> tuple[Solid, ...]:
    """The solids of one body, those that are open and close together as one."""
    split = [s for s in solids if s.mesh is not None and s.radius == 0 and not is_closed(s.mesh)]
    around = enclosing([s.mesh for s in split if s.mesh is not None]) if len(split) > 1 else None
    if around is None:
        return tuple(solids)
    rest = [s for s in solids if all(s is not piece for piece in split)]
    notes = dict.fromkeys(piece.note for piece in split if piece.note)
    whole = Solid(mesh=physics_mesh(around), name=split[0].name, note=", ".join(notes))
    return *rest, whole


def _sewn(mesh: Mesh) -> Mesh:
    """Corners on open edges that are within `SEAM` of each other merged."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    edges, _, uses = edge_balance(mesh.faces)
    seam = np.unique(edges[uses == 1])
    if len(seam) < 2:
        return mesh
    corners = mesh.vertices[seam]
    k = min(MEET, len(seam))
    _, other = cKDTree(corners).query(corners, k=k, distance_upper_bound=SEAM)
    here, there = np.repeat(np.arange(len(seam)), k), other.ravel()
    near = there < len(seam)
    pairs = coo_matrix((np.ones(near.sum(), bool), (here[near], there[near])), shape=(len(seam),) * 2)
    _, label = connected_components(pairs, directed=False)
    _, first = np.unique(label, return_index=True)
    vertices = mesh.vertices.copy()
    vertices[seam] = corners[first[label]]
    return tidied(Mesh(vertices, mesh.faces, mesh.color))[0]
