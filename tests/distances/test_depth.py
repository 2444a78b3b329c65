"""How deep one body reaches into another, in closed form and against dense sampling."""

from __future__ import annotations

import numpy as np
import pytest

from concave import bumpy_ball
from seerob.core.shapes import Solid, capsule, prism_mesh
from seerob.description.shapes.shapes import box_mesh
from seerob.distance.depth import Depths
from seerob.distance.least import Shapes
from seerob.kernels.tree_file import tree_of
from seerob.kernels.winding import contains

CUBE = Solid(mesh=box_mesh([-0.5] * 3, [0.5] * 3))
L = Solid(mesh=prism_mesh([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], 0, 2))
ROD = capsule([0, 0, 0], [0, 0, 0.3], 0.1)
SMALL = Solid(mesh=box_mesh([-0.15] * 3, [0.15] * 3))


def found(outer, inner, at, tolerance=1e-3, cells=20_000):
    shapes = Shapes.build([("outer", (outer,)), ("inner", (inner,))])
    x = np.array([[0.0, 0, 0], at])
    asked = Depths(shapes, tolerance=tolerance, cells=cells)
    return asked.ask(np.repeat(np.eye(3)[None], 2, axis=0), x, [(0, 1)])[0]


@pytest.mark.parametrize(
    ("outer", "inner", "at", "expected"),
    [
        (CUBE, ROD, (0.45, 0, 0), 0.15),
        (CUBE, ROD, (0.55, 0, -0.1), 0.05),
        (CUBE, SMALL, (0.6, 0, 0), 0.05),
        (CUBE, SMALL, (0.6, 0.63, 0), 0.02),
        (CUBE, CUBE, (0, 0, 0), 0.5),
        (SMALL, CUBE, (0, 0, 0), 0.15),
        (L, ROD, (0.9, 0.9, 0.8), 0.1 * (1 + np.sqrt(2))),
        (ROD, SMALL, (0.2, 0, 0.1), 0.05),
        (L, SMALL, (1.2, 1.2, 1), 0.0),
        (CUBE, ROD, (3, 3, 3), 0.0),
    ],
)
def test_depth_in_closed_form(outer, inner, at, expected):
    deep = found(outer, inner, at)
    assert deep.at_least - 1e-9 <= expected <= deep.at_most + 1e-9
    # Where the deepest points are a line, it closes slowly.
    assert deep.at_most - deep.at_least <= 0.01


@pytest.mark.parametrize("cells", [10, 300])
def test_the_interval_holds_however_few_cells_there_are(cells):
    deep = found(CUBE, SMALL, (0.6, 0.1, 0), cells=cells)
    assert deep.at_least <= 0.05 <= deep.at_most + 1e-12


def test_depth_of_a_concave_star_in_a_cube_is_that_of_its_deepest_sample():
    star = bumpy_ball(5, 0.7)
    deep = found(CUBE, Solid(mesh=star), (0.9, 0.4, 0.0))
    tree = tree_of(star.vertices, star.faces)
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.4, -0.4, -0.5], [0.5, 0.5, 0.5], (60_000, 3))
    room = (0.5 - np.abs(points)).min(axis=1)
    own = points - [0.9, 0.4, 0.0]
    least = 0.0
    for k in np.argsort(-room):
        if contains(tree.nodes, tree.links, tree.triangles, *own[k]):
            least = room[k]
            break
    assert 0.2 < least <= deep.at_most
    assert least == pytest.approx(deep.at_least, abs=0.02)
    assert np.abs(deep.point).max() == pytest.approx(0.5 - deep.at_least, abs=1e-6)
