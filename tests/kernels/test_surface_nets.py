"""The surface around voxels: closed, outside of every voxel, flat on slopes."""

import numpy as np
import pytest
import trimesh

from made_sweep import inside
from seerob.core.shapes import Mesh
from seerob.distance.voxels import VoxelGrid


def grid_of(marked, pitch=0.1):
    grid = VoxelGrid(pitch)
    grid.cover(np.zeros(3), np.array(marked.shape) * pitch)
    start = -grid.first
    grid.cells[tuple(slice(s, s + n) for s, n in zip(start, marked.shape, strict=True))] = marked
    grid.count = int(marked.sum())
    return grid


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("most", [None, 600])
def test_random_voxels_lie_inside_a_closed_surface(share, most):
    rng = np.random.default_rng(int(share * 100))
    grid = grid_of(rng.random((9, 8, 10)) < share)
    mesh = grid.mesh(most=most)
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    points = grid.centres()[rng.integers(0, grid.count, 1500)]
    points = points + rng.uniform(-0.4999, 0.4999, points.shape) * grid.pitch
    assert inside(mesh, points).all()
    assert solid.volume >= grid.volume


def test_block_stays_a_block():
    mesh = grid_of(np.ones((3, 4, 5), bool)).mesh()
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(0.06)


def test_slope_comes_out_flat():
    """Stairs under 45°: the surface lies on their ridges, so it holds half a voxel more per tread."""
    i, _, k = np.indices((24, 6, 24))
    grid = grid_of(i + k < 24)
    mesh = grid.mesh(smoothing=100)
    middle = (
        (mesh.vertices[:, 0] > 0.6) & (mesh.vertices[:, 2] > 0.6) & (np.abs(mesh.vertices[:, 1] - 0.3) < 0.2)
    )
    height = mesh.vertices[middle].sum(axis=1) - mesh.vertices[middle, 1]
    assert middle.sum() > 20
    assert np.ptp(height[height > 1.5]) < 0.03  # Of the stairs it is 0.1.


def test_two_voxels_in_a_corner_are_one_surface():
    marked = np.zeros((2, 2, 2), bool)
    marked[0, 0, 0] = marked[1, 1, 1] = True
    mesh: Mesh = grid_of(marked).mesh()
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.body_count == 1
