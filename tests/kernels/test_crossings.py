"""What a ray crosses says the same as the winding number, on closed meshes of every sort."""

from __future__ import annotations

import numpy as np
import pytest

from concave import bumpy_ball
from seerob.core.shapes import Mesh, prism_mesh
from seerob.description.shapes.shapes import box_mesh
from seerob.kernels.crossings import UX, UY, UZ, crossings, encloses
from seerob.kernels.tree_file import tree_of
from seerob.kernels.winding import winding_number

BOX = box_mesh([-0.5] * 3, [0.5] * 3)
STAR = bumpy_ball(2, 0.6)


def both(*meshes):
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + k for m, k in zip(meshes, offsets, strict=False)]
    return Mesh(np.vstack([m.vertices for m in meshes]), np.vstack(faces).astype(np.int32))


MESHES = {
    "box": BOX,
    "concave": STAR,
    "inside out": Mesh(STAR.vertices, STAR.faces[:, ::-1].copy()),
    "L": prism_mesh([(-0.5, -0.5), (1, -0.5), (1, 0), (0, 0), (0, 1), (-0.5, 1)], -1, 1),
    "two that overlap": both(BOX, Mesh(BOX.vertices + np.array([0.4, 0.1, 0.0]), BOX.faces)),
    "a hollow": both(Mesh(3 * BOX.vertices, BOX.faces), Mesh(BOX.vertices, BOX.faces[:, ::-1].copy())),
}


def winding(tree, p):
    return winding_number(tree.nodes, tree.links, tree.triangles, *p, np.inf)[0]


@pytest.mark.parametrize("name", MESHES)
def test_the_count_is_the_winding_number(name):
    mesh = MESHES[name]
    tree = tree_of(np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces))
    assert tree.closed
    counted = 0
    for p in np.random.default_rng(0).uniform(-1.3, 1.3, (1500, 3)):
        count, sure = crossings(tree.nodes, tree.links, tree.triangles, *p)
        w = winding(tree, p)
        if sure:
            assert count == round(w)
            counted += 1
        assert encloses(tree.nodes, tree.links, tree.triangles, True, *p) == (abs(w) > 0.5)
    assert counted > 1490


def test_a_ray_through_an_edge_or_a_corner_decides_nothing():
    tree = tree_of(np.ascontiguousarray(STAR.vertices), np.ascontiguousarray(STAR.faces))
    u = np.array([UX, UY, UZ])
    assert np.linalg.norm(u) == pytest.approx(1.0, abs=1e-12)
    a, b = STAR.vertices[STAR.faces[:200, 0]], STAR.vertices[STAR.faces[:200, 1]]
    for target in (a, (a + b) / 2):
        for p in target - 0.3 * u:
            assert not crossings(tree.nodes, tree.links, tree.triangles, *p)[1]
            inside = abs(winding(tree, p)) > 0.5
            assert encloses(tree.nodes, tree.links, tree.triangles, True, *p) == inside


def test_a_mesh_with_a_rim_is_left_to_the_winding_number():
    faces = np.ascontiguousarray(STAR.faces[3:])
    tree = tree_of(np.ascontiguousarray(STAR.vertices), faces)
    assert not tree.closed
    for p in np.random.default_rng(1).uniform(-0.6, 0.6, (300, 3)):
        inside = abs(winding(tree, p)) > 0.5
        assert encloses(tree.nodes, tree.links, tree.triangles, tree.closed, *p) == inside


def test_triangles_that_are_next_to_lines_decide_nothing():
    sliver = np.array([[-0.6, 0.0, 0.2], [0.6, 0.0, 0.2], [0.0, 1e-13, 0.2]])
    mesh = both(BOX, Mesh(sliver, np.array([[0, 1, 2], [0, 2, 1]], np.int32)))
    tree = tree_of(np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces))
    for x in np.linspace(-0.4, 0.4, 30):
        p = np.array([x, 0.0, 0.2]) - 0.1 * np.array([UX, UY, UZ])
        assert encloses(tree.nodes, tree.links, tree.triangles, tree.closed, *p)
