"""How far what is shown sticks out of what distances see.

Makers simplify collision meshes, and a simplified mesh is not larger everywhere: a distance to it may
be that much too long. The figure is a finding of the model; it is sampled, so a lower bound.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from seerob.core.shapes.geometry import Mesh, Solid
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.description import Description, Link
from seerob.kernels.protrusion import outside
from seerob.kernels.tree_file import tree_of

WORTH_SAYING = 1e-4
"""Protrusions below this are not reported [m]."""
SAMPLES = 2000
"""Vertices looked at per link, besides the extreme ones."""
CRUMB = 1e-5
"""A loose piece of one or two triangles of at most this area [m²] is a slip of the export, no surface."""


def with_protrusions(description: Description) -> Description:
    """The description with the figure on each solid that a shown shape sticks out of, and a finding.

    Distances carry the figure as an interval, so a verdict that hangs on it is UNDECIDED.
    """
    found = []
    deviating: dict[str, float] = {}
    for link, depths in _depths(description):
        crumbs = sum(without_crumbs(mesh)[1] for mesh in link.visual)
        if crumbs:
            text = (
                f"{crumbs} loose pieces of one or two triangles and at most {CRUMB * 1e6:.0f} mm² are shown "
                "but not taken for surface"
            )
            found.append(Finding(level="note", subject=f"{description.name}/{link.name}", text=text))
        if depths.max(initial=0.0) > WORTH_SAYING:
            text = (
                f"the shape shown sticks out of the collision shape by up to {depths.max() * 1e3:.1f} mm "
                f"(99 % of it by at most {np.quantile(depths, 0.99) * 1e3:.1f} mm; sampled): "
                "distances may be that much too long"
            )
            found.append(Finding(level="warning", subject=f"{description.name}/{link.name}", text=text))
            deviating[link.name] = float(depths.max())
    links = tuple(
        replace(link, solids=tuple(replace(solid, deviation=deviating[link.name]) for solid in link.solids))
        if link.name in deviating
        else link
        for link in description.links
    )
    return replace(description, links=links, findings=(*description.findings, *found))


def _depths(description: Description) -> Iterator[tuple[Link, Array]]:
    for link in description.links:
        if link.visual and link.solids:
            yield link, outside_distances(link)


def outside_distances(link: Link) -> Array:
    """Distance [m] of sampled display vertices to the nearest solid, 0 inside, shape (n,)."""
    points = np.concatenate(
        [_sampled(without_crumbs(mesh)[0], SAMPLES // len(link.visual) + 1) for mesh in link.visual]
    )
    least = np.full(len(points), np.inf)
    for solid in link.solids:
        # Points that some solid contains need not be looked at again.
        rest = least > 0
        least[rest] = np.minimum(least[rest], _from_solid(solid, points[rest]))
    return least


def without_crumbs(mesh: Mesh) -> tuple[Array, int]:
    """Vertices of a mesh without those of loose crumbs, shape (n, 3) [m], and how many crumbs there were.

    Makers' display meshes carry stray triangles far from the surface; one of 5 mm² would otherwise
    make every distance of its link uncertain by centimetres.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    _, place = np.unique(np.round(mesh.vertices, 7), axis=0, return_inverse=True)
    faces = place.ravel()[mesh.faces]
    n = int(place.max()) + 1
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(n, n))
    count, piece = connected_components(graph, directed=False)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    area = np.bincount(piece[faces[:, 0]], np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, count)
    triangles = np.bincount(piece[faces[:, 0]], minlength=count)
    crumb = (triangles > 0) & (triangles <= 2) & (area <= CRUMB)
    if not crumb.any() or crumb.all():
        return mesh.vertices, 0
    return mesh.vertices[~crumb[piece[place.ravel()]]], int(crumb.sum())


def _from_solid(solid: Solid, points: Array) -> Array:
    if solid.mesh is not None:
        tree = tree_of(solid.mesh.vertices, solid.mesh.faces)
        depth = outside(tree.nodes, tree.links, tree.triangles, np.ascontiguousarray(points))
        return np.asarray(np.maximum(depth - solid.radius, 0.0))
    assert solid.points is not None
    corner, *ends = solid.points
    offset = points - corner
    nearest = np.zeros_like(points)
    for end in ends:
        edge = end - corner
        squared = float(edge @ edge)
        share = np.clip(offset @ edge / squared, 0, 1) if squared else np.zeros(len(points))
        nearest += share[:, None] * edge
    return np.asarray(np.maximum(np.linalg.norm(offset - nearest, axis=1) - solid.radius, 0.0))


def _sampled(vertices: Array, count: int) -> Array:
    """Every so-many-th vertex, and the outermost along 13 directions."""
    grid = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], [-1, 0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
    along = vertices @ grid[14:].T
    outer = np.concatenate([along.argmax(axis=0), along.argmin(axis=0)])
    step = max(1, len(vertices) // count)
    chosen = np.unique(np.concatenate([np.arange(0, len(vertices), step), outer]))
    return np.asarray(vertices[chosen])
