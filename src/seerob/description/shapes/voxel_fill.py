"""The volume inside a heap of triangles, between two bounds, by a flood from outside.

Every voxel that a triangle touches is *surface*; what a flood through faces cannot reach from outside
is *inside*. Unless a hole is wider than a voxel the true volume lies between the inside voxels and
inside and surface voxels together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes.geometry import Mesh
from seerob.core.transforms import Array
from seerob.description.shapes.moments import Moments


class Filled(NamedTuple):
    """Moments of inside voxels plus half of the surface voxels, with the bounds of the volume [m³]."""

    moments: Moments
    low: float
    high: float


def voxel_fill(mesh: Mesh, *, cells: int = 64) -> Filled | None:
    """Flood-filled moments with ``cells`` voxels along the longest side; None when nothing is inside."""
    from scipy.ndimage import label

    low = mesh.vertices.min(axis=0)
    extent = np.ptp(mesh.vertices, axis=0)
    h = float(extent.max()) / cells
    if not h > 0:
        return None
    shape = np.ceil(extent / h).astype(int) + 3
    # An odd offset keeps faces that lie on round coordinates off the voxels' faces.
    origin = low - 1.37 * h
    surface = _touched((mesh.vertices[mesh.faces] - origin) / h, shape)
    regions, _ = label(~surface)
    inside = ~surface & (regions != regions[0, 0, 0])
    if not inside.any():
        return None
    weight = inside + 0.5 * surface
    index = np.argwhere(weight > 0)
    w = weight[tuple(index.T)] * h**3
    points = origin + (index + 0.5) * h
    volume = float(w.sum())
    com = w @ points / volume
    d = points - com
    second = (d * w[:, None]).T @ d + volume * h * h / 12 * np.eye(3)
    inertia = np.trace(second) * np.eye(3) - second
    low_volume = float(inside.sum()) * h**3
    return Filled(Moments(volume, com, inertia), low_volume, low_volume + float(surface.sum()) * h**3)


def _touched(corners: Array, shape: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Unit voxels that triangles (m, 3, 3) overlap: box, plane and the three projected edge tests."""
    grid = np.zeros(tuple(shape), bool)
    first = np.floor(corners.min(axis=1) - 1e-9).astype(np.int64)
    span = np.floor(corners.max(axis=1) + 1e-9).astype(np.int64) - first + 1
    counts = span.prod(axis=1)
    # In portions of bounded memory; one triangle alone may fill the grid's whole box.
    portion = np.cumsum(counts) // 2_000_000
    for p in np.unique(portion):
        chosen = np.flatnonzero(portion == p)
        repeat = np.repeat(chosen, counts[chosen])
        number = np.arange(len(repeat)) - np.repeat(
            np.cumsum(counts[chosen]) - counts[chosen], counts[chosen]
        )
        ny, nz = span[repeat, 1], span[repeat, 2]
        offset = np.column_stack([number // (ny * nz), number // nz % ny, number % nz])
        voxel = first[repeat] + offset
        hit = _overlap(corners[repeat], voxel + 0.5)
        grid[tuple(np.clip(voxel[hit], 0, shape - 1).T)] = True
    return grid


def _overlap(corners: Array, centers: Array) -> NDArray[np.bool_]:
    edges = corners[:, [1, 2, 0]] - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    distance = np.abs(np.einsum("ij,ij->i", normal, centers - corners[:, 0]))
    hit = distance <= np.abs(normal).sum(axis=1) / 2 + 1e-9
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        sign = np.where(normal[:, axis] >= 0, 1.0, -1.0)
        for e in range(3):
            # Inward normal of the projected edge; the square's corner farthest along it decides.
            ni, nj = -sign * edges[:, e, j], sign * edges[:, e, i]
            value = ni * (centers[:, i] - corners[:, e, i]) + nj * (centers[:, j] - corners[:, e, j])
            hit &= value + (np.abs(ni) + np.abs(nj)) / 2 >= -1e-9
    return np.asarray(hit)
