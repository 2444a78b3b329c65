"""Rays against closed forms and against every triangle, one by one."""

from __future__ import annotations

import numpy as np
import pytest

from concave import SOLIDS, bumpy_ball, poses
from seerob.core.shapes import Solid, capsule
from seerob.distance.least import Query, Shapes
from seerob.distance.scan import Rays

I3, ORIGIN = np.eye(3)[None], np.zeros((1, 3))


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def cast(shapes, R, x, origins, directions, most=10.0, bodies=None):
    distance, met = np.full(len(origins), most), np.full(len(origins), -1)
    chosen = range(len(shapes.names)) if bodies is None else bodies
    Rays(shapes, chosen).cast(R, x, origins, directions, distance, met)
    return distance, met


def brute_force(mesh, origins, directions):
    """Least t over all triangles, by solving for the barycentric coordinates of each."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    best = np.full(len(origins), np.inf)
    for k, (o, u) in enumerate(zip(origins, directions, strict=True)):
        A = np.stack([b - a, c - a, np.broadcast_to(-u, a.shape)], axis=2)
        with np.errstate(all="ignore"):
            v, w, t = np.linalg.solve(A, (o - a)[..., None])[..., 0].T
        inside = (v >= 0) & (w >= 0) & (v + w <= 1) & (t >= 0)
        best[k] = t[inside].min(initial=np.inf)
    return best


def test_rays_meet_a_concave_mesh_where_the_first_of_all_triangles_is():
    rng = np.random.default_rng(1)
    mesh = bumpy_ball(3)
    shapes = Shapes.build([("ball", (Solid(mesh=mesh),))])
    origins = unit(rng.normal(size=(400, 3))) * 3
    directions = unit(rng.uniform(-0.9, 0.9, (400, 3)) - origins)
    R, x = poses(1, 1, 0.3, seed=2)
    distance, met = cast(shapes, R[0], x[0], origins @ R[0, 0].T + x[0], directions @ R[0, 0].T)
    expected = brute_force(mesh, origins, directions)
    hit = np.isfinite(expected)
    assert 100 < hit.sum() < 400
    np.testing.assert_array_equal(met == 0, hit)
    np.testing.assert_allclose(distance[hit], expected[hit], atol=1e-12)
    assert (distance[~hit] == 10.0).all()


def test_rays_pass_no_seam_of_a_mesh_of_thousands():
    """Through edges and corners of a closed mesh, where rounding would let a ray slip between triangles."""
    mesh = bumpy_ball(7, subdivisions=4)
    shapes = Shapes.build([("ball", (Solid(mesh=mesh),))])
    middles = (mesh.vertices[mesh.faces[:, 0]] + mesh.vertices[mesh.faces[:, 1]]) / 2
    ends = np.vstack([mesh.vertices, middles])
    _, met = cast(shapes, I3, ORIGIN, 3 * unit(ends), -unit(ends))
    assert (met == 0).all()


@pytest.mark.parametrize("h", [0.0, 0.3, 0.999])
def test_ball_and_capsule_in_closed_form(h):
    shapes = Shapes.build(
        [("ball", (capsule([0, 0, 0], [0, 0, 0], 1.0),)), ("rod", (capsule([0, 0, -1], [0, 0, 1], 1),))]
    )
    R, x = np.repeat(I3, 2, axis=0), np.zeros((2, 3))
    t = 5 - np.sqrt(1 - h**2)
    for body, z, expected in ((0, h, t), (1, h, 4.0), (1, 1 + h, t), (1, -1 - h, t)):
        distance, met = cast(shapes, R, x, np.array([[5.0, 0, z]]), np.array([[-1.0, 0, 0]]), bodies=[body])
        assert distance[0] == pytest.approx(expected, abs=1e-12)
        assert met[0] == body
    # Along the axis, from inside, and away from it.
    for body in (0, 1):
        for o, u, expected in (
            ((0, 0, 5), (0, 0, -1), 4.0 - body),
            ((0.2, 0, 0), (1, 0, 0), 0.0),
            ((5, 0, 0), (1, 0, 0), 10.0),
        ):
            distance, _ = cast(shapes, R, x, np.array([o], float), np.array([u], float), bodies=[body])
            assert distance[0] == pytest.approx(expected, abs=1e-12)


def test_a_ray_ends_on_a_solid_and_passes_none():
    """The end of a ray that meets something lies on it, and no point before does: any kind of solid."""
    names = list(SOLIDS)
    shapes = Shapes.build(
        [(n, (SOLIDS[n],)) for n in names] + [("point", (capsule([0, 0, 0], [0, 0, 0], 0.0),))]
    )
    rng = np.random.default_rng(0)
    R, x = poses(1, len(names) + 1, 1.0, seed=4)
    R, x = R[0], x[0]
    targets = x[rng.integers(0, len(names), 300)]
    origins = rng.uniform(-3, 3, (300, 3))
    directions = unit(targets + rng.normal(size=(300, 3)) * 0.2 - origins)
    distance, met = cast(shapes, R, x, origins, directions, most=8.0, bodies=range(len(names)))
    query = Query(shapes, range(len(names)), [len(names)])
    assert len(set(met.tolist())) == len(names) + 1

    def gap(point):
        x[-1] = point
        return query.minimum(R, x)

    for o, u, t, body in zip(origins, directions, distance, met, strict=True):
        if body >= 0 and t > 0:
            at_end = gap(o + t * u)
            assert abs(at_end.distance) < 2e-5
        before = [gap(o + share * t * u).distance for share in (0.2, 0.5, 0.8, 0.97)]
        assert t == 0 or min(before) > -1e-9


def test_the_nearest_of_several_bodies_is_met():
    balls = [(str(k), (capsule([0, 0, 0], [0, 0, 0], 0.1),)) for k in range(4)]
    shapes = Shapes.build(balls)
    x = np.array([[4.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0], [2.0, 5, 0]])
    distance, met = cast(shapes, np.repeat(I3, 4, axis=0), x, np.zeros((1, 3)), np.array([[1.0, 0, 0]]))
    assert (distance[0], met[0]) == (pytest.approx(1.9), 1)
