"""What the tree of eight boxes skips never changes a bit: against all primitives, near, far and very far."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from seerob.kernels import wide
from seerob.kernels.primitives import segment_triangle, triangles
from seerob.kernels.search import row_in
from seerob.kernels.tree_file import tree_of
from seerob.kernels.wide import NONE, Trees, nearest_of_meshes, nearest_to_segment


def tree(mesh):
    return tree_of(np.ascontiguousarray(mesh.vertices, float), np.ascontiguousarray(mesh.faces, np.int32))


@pytest.fixture(scope="module")
def ball():
    """One whose nearest triangles tie at corners and differ little elsewhere."""
    return tree(trimesh.creation.icosphere(2, 0.3))


@pytest.fixture(scope="module")
def scratch():
    return wide.scratch()


def first_least(values):
    return min(enumerate(values), key=lambda one: (one[1], one[0]))


@pytest.mark.parametrize("away", [0.0, 0.301, 0.5, 3.0, 1e3, 1e7, 1e25, 1e60])
def test_nearest_to_a_segment_is_the_first_of_all_triangles(ball, scratch, away):
    rng, W, trees = np.random.default_rng(1), scratch.W, Trees(ball.boxes, ball.kids, ball.triangles)
    for n in range(12):
        direction = rng.normal(size=3)
        a = away * direction / np.linalg.norm(direction)
        d = rng.normal(size=3) * [0.0, 0.01, 1.0, 30.0][n % 4]
        a = a if n < 6 else np.round(a, 1) - d / 2  # some of their middles lie on axes of symmetry
        all_of_them = [
            segment_triangle(*a, *d, ball.triangles, k, np.inf) for k in range(len(ball.triangles))
        ]
        k, least = first_least([one[0] for one in all_of_them])
        for first in (-1, int(rng.integers(len(ball.triangles)))):
            found = nearest_to_segment(trees, 0, tuple(a), tuple(d), np.inf, first, scratch)
            assert found == (least, k)
            assert W[:3].tolist() == list(all_of_them[k][2:])


@pytest.mark.parametrize("away", [0.6, 0.7, 3.0, 1e3, 1e25])
def test_nearest_of_two_meshes_is_the_first_of_all_pairs(ball, scratch, away):
    rng = np.random.default_rng(2)
    row, W = np.empty((1, 13)), np.empty(12)
    m = len(ball.triangles)
    small = tree(trimesh.creation.box((0.1, 0.2, 0.3)))
    kids = np.where(small.kids == NONE, NONE, small.kids + np.where(small.kids < 0, -m, len(ball.boxes)))
    boxes, kids = (
        np.concatenate([ball.boxes, small.boxes]),
        np.concatenate([ball.kids, kids]).astype(np.int32),
    )
    T = np.concatenate([ball.triangles, small.triangles])
    for n in range(4):
        turn = np.eye(3) if n < 2 else Rotation.random(random_state=n).as_matrix()
        direction = np.eye(3)[n] if n < 2 else rng.normal(size=3)
        R, t = np.ascontiguousarray(turn.ravel()), away * direction / np.linalg.norm(direction)
        values = np.empty((m, len(T) - m))
        for b in range(len(T) - m):
            row_in(T, m + b, R, t, row)
            values[:, b] = [triangles(T, a, row, 0, np.inf, W)[0] for a in range(m)]
        k, least = first_least(values.ravel().tolist())
        pair = k // values.shape[1], m + k % values.shape[1]
        scratch.R[:], scratch.t[:] = R, t
        for first in ((-1, -1), (int(rng.integers(m)), m)):
            found = nearest_of_meshes(Trees(boxes, kids, T), 0, len(ball.boxes), np.inf, *first, scratch)
            assert found == (least, *pair)


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
def test_every_triangle_is_in_the_tree_once(size):
    """Also where no area of a box is a number of single precision."""
    mesh = trimesh.creation.icosphere(2, 0.3)
    ball = tree_of(np.array(mesh.vertices, float) * size, np.ascontiguousarray(mesh.faces, np.int32))
    used = ball.kids[ball.kids != NONE]
    assert sorted((~used[used < 0]).tolist()) == list(range(len(ball.triangles)))
    assert sorted(used[used >= 0].tolist()) == list(range(1, len(ball.boxes)))
