"""Which side of a surface is out, where a file contradicts itself: no triangle is added, moved or left out.

What is inside of a mesh goes by the winding number. Triangles that disagree with their neighbours, a body
inside out that overlaps others, and a surface that is there twice, once for each side, all make it 0 where
there is an inside, and whoever is in there would be far from the surface and outside.
"""

from __future__ import annotations

import numpy as np

from seerob.core.shapes.geometry import Mesh
from seerob.description.shapes.mesh_bodies import bodies, edge_balance, is_closed, joined_unmerged, outward
from seerob.description.shapes.mesh_mending import one_sided, oriented
from seerob.description.shapes.moments import signed_volume

MOST_BODIES = 300
"""Of one mesh, whose sides are compared: the time grows with the square."""


def sided(mesh: Mesh) -> tuple[Mesh, str]:
    """Turn the triangles of a surface so that closed bodies have an inside.

    Args:
        mesh: Tidied.

    Returns:
        The mesh, and what was turned in words; the same mesh and nothing where nothing is.
    """
    said = []
    # Of a closed surface that is there twice four triangles or more meet at every edge.
    if (edge_balance(mesh.faces)[2] >= 4).all():
        single = one_sided(mesh)
        agreed = oriented(single)[0]
        if 2 * len(single.faces) == len(mesh.faces) and is_closed(agreed):
            mesh = agreed
            said.append("every triangle is there twice, once for each side: taken once")
    unbalanced = _contradictions(mesh)
    if unbalanced:
        agreed, turned = oriented(mesh)
        if _contradictions(agreed) < unbalanced:
            mesh = agreed
            said.append(f"{turned} triangles turned over, so that neighbours agree which side is out")
    if is_closed(mesh):
        parts = bodies(mesh)
        inward = [signed_volume(part) < 0 for part in parts]
        mixed = any(inward) and not all(inward)
        if mixed and len(parts) > MOST_BODIES:
            said.append(
                f"{sum(inward)} of {len(parts)} bodies are inside out: too many to tell cavities from"
            )
        elif mixed:
            turned_parts, count = outward(parts)
            if count:
                mesh = joined_unmerged(turned_parts)
                said.append(f"{count} of {len(parts)} bodies were inside out: turned")
    return mesh, ", ".join(said)


def _contradictions(mesh: Mesh) -> int:
    """Edges between two triangles that take different sides for out."""
    _, balance, uses = edge_balance(mesh.faces)
    return int(np.count_nonzero((uses == 2) & (balance != 0)))
