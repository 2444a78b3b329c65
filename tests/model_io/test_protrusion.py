"""How far one shape leaves another, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.core.shapes import Mesh, Solid, capsule, dilated_rectangle
from seerob.description.description import Description, Link
from seerob.description.robots.maker_geometry import outside_distances, with_protrusions
from seerob.description.shapes import shapes


def robot(visual: Mesh, *solids: Solid) -> Description:
    link = Link(name="l", parent=None, parent_from_link=np.eye(4), visual=(visual,), solids=solids)
    return Description(name="r", links=(link,), tip="l", source="test")


def protrusion(description):
    (link,) = description.links
    return outside_distances(link).max()


def cube(half, center=(0, 0, 0)):
    return shapes.box_mesh(np.array(center) - half, np.array(center) + half)


POINT = np.zeros(3)


@pytest.mark.parametrize(
    ("solids", "depth"),
    [
        ([Solid(mesh=cube(0.9))], 0.1 * 3**0.5),
        ([Solid(mesh=cube(1.1))], 0.0),
        ([Solid(mesh=cube(0.9), radius=0.05)], 0.1 * 3**0.5 - 0.05),
        ([capsule(POINT, POINT, 1.0)], 3**0.5 - 1),
        ([capsule(POINT, [0, 0, 1], 1.0)], 3**0.5 - 1),
        ([dilated_rectangle([-1, -1, 0], [2, 0, 0], [0, 2, 0], 0.5)], 0.5),
        ([Solid(mesh=cube(0.9)), Solid(mesh=cube(2, (0, 0, 1.5)))], 0.1 * 3**0.5),
    ],
)
def test_the_corners_of_a_cube(solids, depth):
    assert protrusion(robot(cube(1.0), *solids)) == pytest.approx(depth, abs=1e-12)
    text = [f.text for f in with_protrusions(robot(cube(1.0), *solids)).findings]
    assert bool(text) == (depth > 1e-4)


def test_a_crumb_far_off_is_no_surface_and_is_said():
    """A stray triangle of 2 mm² 1 m away; one of 50 mm² there counts."""
    block = cube(1.0)

    def with_triangle(edge):
        corner = np.array([[3.0, 0, 0], [3.0 + edge, 0, 0], [3.0, edge, 0]])
        vertices = np.vstack([block.vertices, corner])
        faces = np.vstack([block.faces, [np.arange(3) + len(block.vertices)]]).astype(np.int32)
        return robot(Mesh(vertices, faces), Solid(mesh=cube(1.0)))

    small, large = with_triangle(0.002), with_triangle(0.010)
    assert protrusion(small) == pytest.approx(0.0, abs=1e-12)
    assert [f.level for f in with_protrusions(small).findings] == ["note"]
    assert protrusion(large) == pytest.approx(2.01, abs=1e-2)
