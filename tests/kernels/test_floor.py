"""Hulls and distances in the plane of a polygon."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from seerob.kernels.floor import bodies_to_border, hull, ring_to_edges

L = np.array([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)], float)
RING = np.array([[0.2, 0.2], [0.5, 0.2], [0.5, 0.6], [0.2, 0.6]])


def apart(ring, edges):
    return ring_to_edges(ring, L, np.asarray(edges, np.int64), np.empty((2, 2)))


def test_a_hull_is_that_of_another_library():
    rng = np.random.default_rng(0)
    for n in (3, 4, 10, 200):
        points = rng.normal(size=(n, 2)).round(1 if n > 10 else 6)
        own, other = hull(points), ConvexHull(points)
        x, y = own.T
        area = 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
        assert area == pytest.approx(other.volume, abs=1e-12)
        assert {tuple(p) for p in own} == {tuple(p) for p in points[other.vertices]}


def test_a_hull_of_points_in_a_line_or_at_one_place_is_their_ends():
    line = np.array([[0.0, 0], [2, 2], [1, 1], [2, 2]])
    assert {tuple(p) for p in hull(line)} == {(0, 0), (2, 2)}
    assert {tuple(p) for p in hull(np.ones((3, 2)))} == {(1, 1)}


def test_distance_of_a_ring_to_edges_is_that_of_its_densely_sampled_border():
    rng = np.random.default_rng(1)
    share = np.linspace(0, 1, 400)[:, None]
    for _ in range(20):
        ring = hull(rng.uniform(-1, 4, 2) + rng.normal(size=(6, 2)) * 0.4)
        border = np.vstack(
            [a + share * (b - a) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
        )
        for e in range(len(L)):
            edge = L[e] + share * (L[(e + 1) % len(L)] - L[e])
            sampled = np.linalg.norm(border[:, None] - edge, axis=2).min()
            assert sampled - 0.02 <= apart(ring, [e]) <= sampled + 1e-12


def test_edges_that_cross_are_not_apart():
    assert apart(RING + np.array([0.8, 0.5]), range(6)) == 0.0
    assert apart(RING, range(6)) == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("at", "value", "height"),
    [
        # Upside-up bodies of radius 0.1: 0.2 from the lower edge; 0.1 beyond it; far outside.
        ((1.6, 0.0, 0.2), 0.2 - 0.1, 0.2),
        ((1.6, -0.3, 0.2), -0.1, 0.2),
        ((1.6, -1.0, 0.4), -0.4 - 0.1, 0.4),
    ],
)
def test_a_body_beyond_the_border_counts_by_how_far_it_is_out(at, value, height):
    corners = np.vstack([np.column_stack([RING, np.full(4, z)]) for z in (0.0, 1.0)])
    x = np.array([[0.0, 0, 0], [0.3, 0.3, 0.7], at])
    ends = np.empty(5)
    found, row = bodies_to_border(
        np.array([1, 2]),
        np.repeat(np.eye(3)[None], 3, axis=0),
        x,
        np.vstack([corners, corners]),
        np.array([0, 8, 16]),
        np.array([0.1, 0.1]),
        0,
        L,
        np.arange(6),
        True,
        ends,
    )
    assert row == 1
    assert found == pytest.approx(value, abs=1e-12)
    assert ends[4] == height
