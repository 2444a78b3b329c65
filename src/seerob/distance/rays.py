"""Rays into the scene: how far a beam gets and what stops it; see `seerob.kernels.rays`."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.rays import cast
from seerob.kernels.shapes import Shapes
from seerob.kernels.signed_distance import place

Indices = NDArray[np.int64]


class Rays:
    """What some bodies do to rays; bound once, asked at every tick."""

    def __init__(self, shapes: Shapes, bodies: Iterable[int]) -> None:
        """Of a model, and indices of the bodies that can stop a ray; none is allowed."""
        self.shapes, self.bodies = shapes, tuple(dict.fromkeys(bodies))
        self._solids = np.array([s for b in self.bodies for s in shapes.solids[b]], np.int64)
        self._world = np.zeros((len(shapes.which), 12))

    def cast(
        self,
        rotations: Array,
        positions: Array,
        origins: Array,
        directions: Array,
        distance: Array,
        met: Indices,
    ) -> None:
        """Shorten rays to where they meet a body.

        Args:
            rotations: world_from_body of every body, shape (n, 3, 3).
            positions: Likewise [m], shape (n, 3).
            origins: World [m], shape (k, 3).
            directions: Unit vectors, shape (k, 3).
            distance: Length of each ray [m], shape (k,); shortened.
            met: Set to the body that a ray meets, where it does, shape (k,).
        """
        s = self.shapes
        if not len(self._solids):
            return
        place(
            np.ascontiguousarray(rotations, float), np.ascontiguousarray(positions, float), s.which, s.local,
            self._solids, self._world,
        )  # fmt: skip
        starts = np.ascontiguousarray(origins, float)
        along = np.ascontiguousarray(directions, float)
        cast(
            starts, along, self._solids, s.which, s.ball, s.corners, s.radius, s.nodes, s.links, s.triangles,
            self._world, distance, met,
        )  # fmt: skip
