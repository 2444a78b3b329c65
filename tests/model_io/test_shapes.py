"""Meshes of simple shapes against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from seerob.description.shapes import shapes

AXIS = np.array([1.0, 2, -2]) / 3


def body(mesh):
    made = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert made.is_volume
    return made


def test_box():
    assert body(shapes.box_mesh([-1, 0, 2], [1, 3, 2.5])).volume == pytest.approx(3)


def test_prism_is_around_and_cylinder_within():
    start, end = np.array([1.0, 2, 3]), np.array([1.0, 2, 3]) + 0.7 * AXIS
    area = 16 * math.tan(math.pi / 16) * 0.2**2
    assert body(shapes.prism_mesh(start, end, 0.2)).volume == pytest.approx(0.7 * area)
    area = 24 * math.sin(2 * math.pi / 48) * 0.2**2
    assert body(shapes.cylinder_mesh(start, end, 0.2)).volume == pytest.approx(0.7 * area)


@pytest.mark.parametrize("end", [np.zeros(3), 0.5 * AXIS])
def test_capsules_and_spheres_for_display_lie_on_the_real_one(end):
    made = body(shapes.capsule_mesh(np.zeros(3), end, 0.1))
    points = made.vertices
    share = np.clip(points @ end / max(end @ end, 1e-9), 0, 1)
    away = np.linalg.norm(points - share[:, None] * end, axis=1)
    assert away.max() <= 0.1 + 1e-12
    assert np.quantile(away, 0.05) > 0.099


def test_hull_of_two_tubes():
    tubes = [shapes.prism_mesh([x, 0, 0], [x, 0, 1], 0.1) for x in (0, 1)]
    made = body(shapes.hull_mesh(tubes))
    assert made.is_convex
    # A prism of 16 sides cut in half at its widest, and the block between the halves.
    outer = 0.1 / math.cos(math.pi / 16)
    area = 16 * math.tan(math.pi / 16) * 0.01
    width = 2 * max(abs(tubes[0].vertices[:, 1]))
    assert width == pytest.approx(2 * outer * math.cos(math.pi / 16))
    assert made.volume == pytest.approx(area + width, rel=1e-6)


def test_frames_along_any_axis_are_rotations():
    for axis in [*np.eye(3), AXIS, -AXIS, [1e-9, 1, 0]]:
        R = shapes.frame_along(axis)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) == pytest.approx(1)
        assert R[:, 2] @ axis > 0
