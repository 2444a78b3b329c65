r"""Parts of an assembly inside of others, where nothing of a given thickness can touch them from outside.

The middle of a ball of radius r that touches nothing moves through cells of edge h. A cell is closed to it
where each of its points is nearer than r to a surface, which is so when the middle of a cell with a point of
a surface is within :math:`r - \sqrt 3 h`. A part can be touched where a cell that is open, and connected with
the outside, has its middle within :math:`r + (\sqrt 3 + 1/\sqrt 3) h` of that of a cell with a point of the
part: points are at most h apart in every triangle, so that none of it is farther than :math:`h/\sqrt 3` from
one. So no part is left out that such a ball touches; some stay that none touches.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes import Mesh
from seerob.core.transforms import Array
from seerob.description.cad.assembly import Assembly, Moving
from seerob.description.description import base_from_links
from seerob.distance.voxels import dilated
from seerob.kernels.flood import FREE, REACHED, flood

PER_RADIUS = 5.0
"""Cells that a radius is long."""
MOST_CELLS = 3e7
"""Of the grid."""
_ROOT3 = math.sqrt(3.0)

Indices = NDArray[np.int64]


def unreachable(assembly: Assembly, width: float) -> tuple[int, ...]:
    """Numbers of instances that no ball of this diameter [m] touches that comes from outside.

    What moves is no wall, and what lies near it in the pose of the file counts as touched.

    Args:
        assembly: With rigid places.
        width: Diameter [m].

    Raises:
        ValueError: The assembly is too large for this diameter.
    """
    radius = width / 2
    h = radius / PER_RADIUS
    parts = [
        [mesh.moved(i.world_from_shape) for mesh in assembly.shapes[i.shape].pieces]
        for i in assembly.instances
    ]
    moving = [mesh for one in assembly.mechanisms for mesh in _moving(one)]
    if not parts:
        return ()
    points = [mesh.vertices for meshes in (*parts, moving) for mesh in meshes]
    low = np.min([p.min(axis=0) for p in points if len(p)], axis=0)
    high = np.max([p.max(axis=0) for p in points if len(p)], axis=0)
    spare = math.ceil(PER_RADIUS) + 3
    counts = np.floor((high - low) / h) + 2 * spare + 1
    if float(np.prod(counts)) > MOST_CELLS:
        finest = width * (float(np.prod(counts)) / MOST_CELLS) ** (1 / 3) * 1.05
        raise ValueError(f"at least {math.ceil(finest * 1e3)} mm for an assembly of this size")
    size = tuple(int(n) for n in counts)
    origin = low - spare * h

    def cells_of(meshes: list[Mesh]) -> Indices:
        found = [_cells(mesh, h, origin, size) for mesh in meshes if len(mesh.faces)]
        return np.unique(np.concatenate(found)) if found else np.empty(0, np.int64)

    touched = [cells_of(meshes) for meshes in parts]
    deviation = max(assembly.shapes[i.shape].deviation for i in assembly.instances) / h
    walls = np.zeros(size, np.uint8)
    for cells in touched:
        walls.ravel()[cells] = 1
    closing = PER_RADIUS - _ROOT3 - deviation
    grid = np.where(dilated(walls, closing), 0, FREE).astype(np.uint8) if closing > 0 else walls * 0 + FREE
    for axis in range(3):
        for end in (0, -1):
            np.moveaxis(grid, axis, 0)[end] = REACHED
    ball = PER_RADIUS + _ROOT3 + 1 / _ROOT3 + deviation
    if moving:
        near = np.zeros(size, np.uint8)
        near.ravel()[cells_of(moving)] = 1
        grid[dilated(near, ball)] = REACHED
    flood(grid)
    reached = dilated(grid == REACHED, ball).ravel()
    return tuple(k for k, cells in enumerate(touched) if not reached[cells].any())


def _moving(one: Moving) -> list[Mesh]:
    """Meshes of a mechanism in the world, in the pose of the file."""
    description, world, q = one.description, one.world_from_base, one.q
    joints = [joint.name for joint in description.joints()]
    poses = base_from_links(description, dict(zip(joints, q, strict=False)))
    return [
        mesh.moved(world @ poses[link.name])
        for link in description.links
        for mesh in (*link.visual, *(solid.mesh for solid in link.solids if solid.mesh is not None))
    ]


def _cells(mesh: Mesh, h: float, origin: Array, size: tuple[int, ...]) -> Indices:
    """Numbers of cells with a point of a mesh, whose triangles are looked at in points at most h apart."""
    triangles = mesh.vertices[mesh.faces]
    edges = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    pieces = np.maximum(np.ceil(edges / h), 1).astype(int)
    found: list[Indices] = []
    for n in np.unique(pieces):
        i, j = np.array([(i, j) for i in range(n + 1) for j in range(n + 1 - i)]).T
        shares = np.stack([i, j, n - i - j], axis=1) / n
        of_size = triangles[pieces == n]
        at_once = max(1, 2_000_000 // len(shares))
        for start in range(0, len(of_size), at_once):
            some = np.einsum("sk,tkx->tsx", shares, of_size[start : start + at_once]).reshape(-1, 3)
            index = np.floor((some - origin) / h).astype(np.int64)
            found.append(np.unique(np.ravel_multi_index(tuple(index.T), size)))
    return np.unique(np.concatenate(found))
