"""Voxels turned about any axis: no point of theirs is lost at any angle."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seerob.distance.voxels import VoxelGrid
from seerob.kernels.revolve import profile, revolve


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 1, 1), (0.3, -0.8, 0.2)])
def test_every_point_of_a_voxel_stays_in_the_turned_set(axis):
    rng = np.random.default_rng(0)
    axis, pitch, anchor = np.array(axis, float) / np.linalg.norm(axis), 0.1, np.array([0.03, 0.01, 0.02])
    corner = (rng.integers(-4, 4, (3, 3)) + 0.5) * pitch
    heights = (corner - anchor) @ axis
    radii = np.linalg.norm(np.cross(corner - anchor, axis), axis=1)
    low, half = heights.min() - pitch, pitch / 2 * np.abs(axis).sum()
    signs = np.array(list(product((-1, 1), repeat=3)))
    wide = np.linalg.norm(np.cross(signs, axis), axis=1).max() / 2
    plane = profile(
        radii,
        heights - low,
        np.full(3, pitch),
        half / pitch,
        wide,
        pitch / 16,
        radii.max() + pitch,
        np.ptp(heights) + 2 * pitch,
    )
    grid = VoxelGrid(pitch)
    grid.cover(np.full(3, -1.5), np.full(3, 1.5))
    grid.count = revolve(
        grid.cells, grid.full, grid.origin, pitch, plane, pitch / 16, anchor, axis, low, half, wide * pitch
    )
    points = corner[rng.integers(0, 3, 40_000)] + rng.uniform(-0.5, 0.5, (40_000, 3)) * pitch
    turned = Rotation.from_rotvec(rng.uniform(0, 2 * np.pi, 40_000)[:, None] * axis).apply(points - anchor)
    assert grid.contains(turned + anchor).all()
    far = [
        min(abs(c - r) for r in radii)
        for c in np.linalg.norm(np.cross(grid.centres() - anchor, axis), axis=1)
    ]
    assert max(far) < 2 * pitch
