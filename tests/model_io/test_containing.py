"""Meshes around solids: no point of the solid is farther outside than is said."""

import numpy as np
import pytest

from seerob.core.shapes import Mesh, Solid, capsule, dilated_rectangle
from seerob.description.cad.containing import around
from seerob.description.description import Link
from seerob.description.robots.maker_geometry import outside_distances
from seerob.description.shapes.shapes import box_mesh

BOX = box_mesh([0, 0, 0], [0.1, 0.2, 0.3])
X, Y = np.array([0.3, 0, 0]), np.array([0, 0.2, 0])


@pytest.mark.parametrize(
    "solid",
    [
        capsule(X, X, 0.2),
        capsule(X, -Y, 0.1),
        dilated_rectangle(np.zeros(3), X, Y, 0.1),
        dilated_rectangle(np.zeros(3), X, 0 * Y, 0.1),
        Solid(mesh=BOX),
        Solid(mesh=BOX, radius=0.05, deviation=0.01),
    ],
)
def test_the_solid_is_within_its_mesh_and_deviation(solid):
    mesh, deviation = around(solid)
    rng = np.random.default_rng(1)
    away = rng.normal(size=(4000, 3))
    away *= solid.radius / np.linalg.norm(away, axis=1, keepdims=True)
    if solid.mesh is not None:
        core = solid.mesh.vertices[rng.integers(0, len(solid.mesh.vertices), len(away))]
    else:
        first, *rest = solid.points
        core = first + sum(rng.random((len(away), 1)) * (end - first) for end in rest)
    points = core + away
    cloud = Mesh(points, np.zeros((0, 3), np.int32))
    link = Link("l", None, np.eye(4), visual=(cloud,), solids=(Solid(mesh=mesh),))
    assert outside_distances(link).max() <= deviation + 1e-12
    # No more is said than can be.
    assert deviation <= solid.deviation + (solid.radius if solid.mesh is not None else 0.025 * solid.radius)
