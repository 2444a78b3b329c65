"""Floor polygons: what is refused, areas, triangles, the prism, insides, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.core.shapes import (
    check_polygon,
    contains,
    prism_mesh,
    signed_area,
    triangulate,
)
from seerob.description.shapes.mesh_bodies import is_closed
from seerob.description.shapes.moments import signed_volume

L = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]

STRAIGHT = [(0, 0), (1, 0), (2, 0), (2, 1)]


def star(n, seed=0):
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    r = rng.uniform(0.3, 1.0, n)
    return [tuple(p) for p in np.column_stack([r * np.cos(angle), r * np.sin(angle)]).tolist()]


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        ([(0, 0), (1, 0)], "at least 3 corners"),
        ([(0, 0), (1, 0), (1, 1), (0, 0)], "leave it out"),
        ([(0, 0), (1, 0), (1, 0), (0, 1)], "corners 1 and 2"),
        ([(0, 0), (1, 1), (1, 0), (0, 1)], "crosses or touches itself: edge 0"),
        ([(0, 0), (2, 0), (2, 2), (1, 0), (0, 2)], "crosses or touches itself"),
        ([(0, 0), (0.3, 0.3), (1, 0), (0.7, 0.7), (0.1, 0.1), (0, 1)], "crosses or touches itself"),
        ([(0, 0), (1, 0), (2, 0)], "turns back on itself"),
        ([(0, 0), (2, 0), (1, 0), (1, 1)], "turns back on itself"),
    ],
)
def test_what_is_no_simple_polygon_is_refused(corners, words):
    with pytest.raises(ValueError, match=words):
        check_polygon(corners)
    with pytest.raises(ValueError, match="polygon"):
        check_polygon(corners[::-1])


@pytest.mark.parametrize("corners", [L, L[::-1], star(30), star(31, 4)[::-1], STRAIGHT])
def test_triangles_cover_the_polygon_and_its_prism_is_closed(corners):
    check_polygon(corners)
    area = abs(signed_area(corners))
    made = triangulate(corners)
    assert len(made) == len(corners) - 2
    pieces = [signed_area([corners[k] for k in t]) for t in made.tolist()]
    assert min(pieces) >= 0
    assert sum(pieces) == pytest.approx(area, rel=1e-12)
    mesh = prism_mesh(corners, -0.5, 1.5)
    assert is_closed(mesh)
    assert signed_volume(mesh) == pytest.approx(2 * area, rel=1e-12)


def test_area_of_an_l():
    assert signed_area(L) == 5.0
    assert signed_area(L[::-1]) == -5.0


def _to_edge(corners, points):
    """Distance of each point to the border [m]."""
    a = np.asarray(corners, float)
    edge = np.roll(a, -1, axis=0) - a
    away = points[:, None] - a
    share = np.clip(np.einsum("nij,ij->ni", away, edge) / np.einsum("ij,ij->i", edge, edge), 0.0, 1.0)
    return np.linalg.norm(away - share[..., None] * edge, axis=2).min(axis=1)


def test_inside_agrees_with_sampling():
    """A disc of the distance to the edge lies on one side of it; random points have the area's share."""
    rng = np.random.default_rng(2)
    points = rng.uniform(-0.5, 3.5, (20_000, 2))
    inside = contains(L, points)
    assert inside.mean() * 16 == pytest.approx(5.0, abs=0.15)
    room = _to_edge(L, points)
    turn = rng.uniform(0, 2 * np.pi, len(points))
    moved = points + 0.999 * room[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    np.testing.assert_array_equal(contains(L, moved), inside)
