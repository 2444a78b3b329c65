"""How deep bodies reach into each other, as an interval that closes; see `seerob.kernels.depth`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seerob.kernels.depth import deepest
from seerob.kernels.pairs import CORNERS
from seerob.kernels.shapes import Shapes
from seerob.transforms import Array

TOLERANCE = 1e-3
"""Width of the interval that is enough [m]."""
CELLS = 3000
"""Of the search in one pair of solids, at most."""


@dataclass(frozen=True, eq=False)
class Depth:
    """How deep one body reaches into another."""

    at_least: float
    """[m]; 0 when they have nothing in common but their surfaces."""
    at_most: float
    """[m]"""
    point: Array
    """The deepest point found, in the world [m], shape (3,); NaN when there is none."""


def depth(
    shapes: Shapes,
    rotations: Array,
    positions: Array,
    outer: int,
    inner: int,
    *,
    tolerance: float = TOLERANCE,
    cells: int = CELLS,
) -> Depth:
    """The largest distance to the surface of ``outer`` of any point of ``inner`` that is inside it.

    Exact on concave shapes. Of a body of several solids, the depth in one of them.

    Args:
        shapes: Of the model.
        rotations: world_from_body of every body, shape (n, 3, 3).
        positions: Likewise [m], shape (n, 3).
        outer: Index of the body that is entered.
        inner: Index of the body that enters.
        tolerance: Width of the interval that is enough [m].
        cells: Largest number of cells of the search per pair of solids: what bounds its time.
    """
    world = np.zeros((len(shapes.which), 12))
    box = {
        s: _placed(shapes, rotations, positions, b, s, world)
        for b in (outer, inner)
        for s in shapes.solids[b]
    }
    low, high, point = 0.0, 0.0, np.full(3, np.nan)
    for i in shapes.solids[outer]:
        for j in shapes.solids[inner]:
            least, most = np.maximum(box[i][0], box[j][0]), np.minimum(box[i][1], box[j][1])
            if (least > most).any():
                continue
            at = np.full(3, np.nan)
            found = deepest(
                i, j, shapes.which, shapes.corners, shapes.radius, shapes.nodes, shapes.links,
                shapes.triangles, world, least, most, tolerance, cells, at,
            )  # fmt: skip
            if found[0] > low:
                low, point = found[0], at
            high = max(high, found[1])
    return Depth(low, max(high, low) if low > 0 else 0.0, point)


def place_solid(shapes: Shapes, rotations: Array, positions: Array, body: int, s: int, world: Array) -> None:
    """Write world_from_solid of a solid of a body to row ``s`` of ``world``, shape (ns, 12)."""
    world[s, :9] = (rotations[body] @ shapes.local[s, :9].reshape(3, 3)).ravel()
    world[s, 9:] = rotations[body] @ shapes.local[s, 9:] + positions[body]


def _placed(
    shapes: Shapes, rotations: Array, positions: Array, body: int, s: int, world: Array
) -> tuple[Array, Array]:
    """Place a solid; the upright box around it in the world [m], (3,) each."""
    place_solid(shapes, rotations, positions, body, s, world)
    corners = shapes.corners[s, : shapes.which[s, CORNERS]] @ world[s, :9].reshape(3, 3).T + world[s, 9:]
    beyond = shapes.radius[s] + 1e-12
    return corners.min(axis=0) - beyond, corners.max(axis=0) + beyond
