"""Fields of squared distances: exact nodes, and a bound between them that is one."""

import numpy as np
import pytest
import trimesh
from scipy.ndimage import distance_transform_edt

from concave import bumpy_ball
from seerob.kernels.fields import Region, cells_field, mesh_field, square_at_least
from seerob.kernels.tree_file import tree_of


def field_of(vertices, faces, spacing, pad):
    vertices, faces = np.ascontiguousarray(vertices, float), np.ascontiguousarray(faces, np.int32)
    tree = tree_of(vertices, faces)
    start = vertices.min(axis=0) - pad
    shape = np.ceil((np.ptp(vertices, axis=0) + 2 * pad) / spacing).astype(np.int64) + 1
    return mesh_field(tree.nodes, tree.links, tree.triangles, tree.closed, start, spacing, shape, pad), start


@pytest.mark.parametrize("spacing", [0.0225, 0.02, 0.025, 0.1 / 3, 0.017])
def test_nodes_of_a_box_have_its_signed_square_also_when_faces_fall_between_or_on_them(spacing):
    box = trimesh.creation.box((0.4, 0.1, 0.2))
    field, start = field_of(box.vertices, box.faces, spacing, 0.05)
    nodes = start + np.indices(field.shape).reshape(3, -1).T * spacing
    over = np.abs(nodes) - np.array([0.2, 0.05, 0.1])
    out = (np.maximum(over, 0) ** 2).sum(axis=1)
    near = (out > 1e-9) & (out < 0.05**2)
    assert np.allclose(field.ravel()[near], out[near], rtol=1e-5, atol=0)
    assert (field.ravel() <= out + 1e-12).all()
    inside = (over < -1e-9).all(axis=1)
    assert (field.ravel()[inside] < 0).all()
    assert (np.sqrt(-field.ravel()[inside]) <= -over[inside].max(axis=1) + 1e-6).all()


def test_bound_between_nodes_is_never_above_the_truth_and_of_second_order():
    mesh = bumpy_ball(2)
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.3, 1.3, (3000, 3))
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    _, exact, _ = trimesh.proximity.closest_point_naive(solid, points)
    errors = []
    for spacing in (0.1, 0.05):
        field, start = field_of(mesh.vertices, mesh.faces, spacing, 0.3)
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        region = Region(field, start, spacing, low, high)
        bound = np.array([square_at_least(region, *p, np.inf) for p in points])
        assert (bound <= exact**2 + 1e-6).all()
        some = (bound > 0) & (exact > 0.15) & (exact < 0.25)
        errors.append((exact[some] ** 2 - bound[some]).mean())
    assert errors[1] < 0.35 * errors[0]


def test_field_of_cells_is_the_distance_to_their_cubes():
    """On a grid three times as fine, a cube is its 27 parts and its edge half a part beyond their centres."""
    rng = np.random.default_rng(1)
    cells = np.zeros((16, 17, 18), np.uint8)
    cells[5:-5, 5:-5, 5:-5] = rng.random((6, 7, 8)) < 0.3
    field = cells_field(cells, 0.1, 5)
    marked = (np.argwhere(cells) + 0.5) * 0.1
    free = np.argwhere(cells == 0)
    gap = np.maximum(np.abs((free[:, None] + 0.5) * 0.1 - marked) - 0.05, 0)
    exact = (gap**2).sum(axis=2).min(axis=1)
    value = field[tuple(free.T)]
    near = exact < (4 * 0.1) ** 2
    assert np.allclose(value[near], exact[near], rtol=1e-5)
    assert (value <= exact * (1 + 1e-6)).all()
    deep = distance_transform_edt(cells)
    assert (np.sqrt(np.maximum(-field[cells != 0], 0)) <= deep[cells != 0] * 0.1).all()
