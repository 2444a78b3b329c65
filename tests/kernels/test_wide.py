"""What the tree of eight boxes skips never changes a bit: against all primitives, near, far and very far."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from seerob.kernels import wide
from seerob.kernels.primitives import segment_triangle, triangles
from seerob.kernels.search import row_in
from seerob.kernels.slab import FEW, pairs_in_slab
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
        trees = Trees(boxes, kids, T)
        for first, few in (((-1, -1), True), ((int(rng.integers(m)), m), True), ((3, m), False)):
            # Of many triangles their trees alone tell.
            one, other = (0, 0, m if few else FEW), (len(ball.boxes), m, len(T))
            assert nearest_of_meshes(trees, one, other, np.inf, *first, scratch) == (least, *pair)


@pytest.mark.parametrize("gap", [1e-7, 1e-3, 0.05, 1.0])
def test_what_a_slab_leaves_has_the_first_of_all_pairs(scratch, gap):
    """Of bodies with ties everywhere and of loose triangles, whichever two are tried first."""
    rng = np.random.default_rng(5)
    row, W = np.empty((1, 13)), np.empty(12)
    bodies = [
        tree(trimesh.creation.box((0.4, 0.3, 0.2))),
        tree(trimesh.creation.cylinder(0.1, 0.3, sections=12)),
        tree(trimesh.creation.torus(0.3, 0.05, major_sections=8, minor_sections=5)),
        tree_of(rng.normal(size=(30, 3)) * 0.2, np.arange(30, dtype=np.int32).reshape(10, 3)),
    ]
    left = 0
    for a, b in [(a, b) for a in range(4) for b in range(4)]:
        m, T = len(bodies[a].triangles), np.concatenate([bodies[a].triangles, bodies[b].triangles])
        other = bodies[b].kids
        kids = np.where(other == NONE, NONE, other + np.where(other < 0, -m, len(bodies[a].boxes)))
        boxes = np.concatenate([bodies[a].boxes, bodies[b].boxes])
        trees = Trees(boxes, np.concatenate([bodies[a].kids, kids]).astype(np.int32), T)
        for n in range(3):
            R = np.eye(3) if n == 0 else Rotation.random(random_state=10 * a + b + n).as_matrix()
            towards = np.eye(3)[2] if n == 0 else rng.normal(size=3) @ np.diag([1, 1, 0.2])
            towards /= np.linalg.norm(towards)
            ends = [T[:, :3], T[:, :3] + T[:, 3:6], T[:, :3] + T[:, 6:9]]
            front = max((end[:m] @ towards).max() for end in ends)
            back = min((end[m:] @ R.T @ towards).min() for end in ends)
            t = towards * (front - back + gap)
            values = np.empty((m, len(T) - m))
            for k in range(len(T) - m):
                row_in(T, m + k, R.ravel(), t, row)
                values[:, k] = [triangles(T, i, row, 0, np.inf, W)[0] for i in range(m)]
            k, least = first_least(values.ravel().tolist())
            pair = k // values.shape[1], m + k % values.shape[1]
            near = np.argsort(values, axis=None)
            for rank in (0, 1, 7, 40, values.size - 1):
                first = divmod(int(near[min(rank, values.size - 1)]), values.shape[1])
                scratch.R[:], scratch.t[:] = R.ravel(), t
                given = (0, 0, m), (len(bodies[a].boxes), m, len(T))
                found = nearest_of_meshes(trees, *given, np.inf, first[0], m + first[1], scratch)
                assert found == (least, *pair)
                u = scratch.W[3:6] - scratch.W[:3]
                many = pairs_in_slab(
                    T, given[0][1:], given[1][1:], scratch.R, t, tuple(u / np.linalg.norm(u)), least, 1e-14,
                    scratch.stack, scratch.ends,
                )  # fmt: skip
                left += many >= 0
                kept = {tuple(one) for one in scratch.stack[: max(many, 0)].tolist()}
                within = {(i, m + j) for i, j in np.argwhere(values <= least).tolist()}
                assert many < 0 or within <= kept
    assert left > 120


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
def test_every_triangle_is_in_the_tree_once(size):
    """Also where no area of a box is a number of single precision."""
    mesh = trimesh.creation.icosphere(2, 0.3)
    ball = tree_of(np.array(mesh.vertices, float) * size, np.ascontiguousarray(mesh.faces, np.int32))
    used = ball.kids[ball.kids != NONE]
    assert sorted((~used[used < 0]).tolist()) == list(range(len(ball.triangles)))
    assert sorted(used[used >= 0].tolist()) == list(range(1, len(ball.boxes)))
