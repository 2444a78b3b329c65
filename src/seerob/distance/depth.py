"""How deep bodies reach into each other, as an interval that closes; see `seerob.kernels.depth`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seerob.core.transforms import Array
from seerob.kernels.depth import deepest
from seerob.kernels.pairs import BoundSolids
from seerob.kernels.shapes import Shapes

TOLERANCE = 1e-3
"""Width of the interval that is enough [m]."""
CELLS = 3000
"""Of the search in one pair of solids, at most."""


@dataclass(frozen=True, eq=False)
class Depth:
    """How deep one body reaches into another."""

    at_least: float
    """[m]; 0 when no point of both was found inside."""
    at_most: float
    """[m]"""
    point: Array
    """The deepest point found, in the world [m], shape (3,); NaN when there is none."""


NONE = Depth(0.0, 0.0, np.full(3, np.nan))
"""Of bodies that have nothing in common."""


class Depths:
    """How deep bodies reach into others; bound once, asked at every tick in one compiled call.

    The answers are functions of the poses alone: nothing is remembered.
    """

    def __init__(
        self, shapes: Shapes, *, tolerance: float = TOLERANCE, cells: int = CELLS, fewest: int | None = None
    ) -> None:
        """Bind.

        Args:
            shapes: Of the model.
            tolerance: Width of the interval that is enough [m].
            cells: Largest number of cells of the search in all pairs of solids: what bounds its time.
            fewest: Cells that each pair has all the same; ``cells`` for each when not given.
        """
        self.shapes, self.tolerance, self.cells, self.fewest = shapes, tolerance, cells, fewest
        self._bound = BoundSolids(shapes.arrays())

    def ask(self, rotations: Array, positions: Array, entered: Sequence[tuple[int, int]]) -> list[Depth]:
        """The largest distance to the surface of an outer body of any point of an inner one inside it.

        Exact on concave shapes. Of a body of several solids, the depth in one of them.

        Args:
            rotations: world_from_body of every body, shape (n, 3, 3).
            positions: Likewise [m], shape (n, 3).
            entered: Indices of the body that is entered and of the one that enters.
        """
        s = self.shapes
        rows = [
            (k, i, j)
            for k, (outer, inner) in enumerate(entered)
            for i in s.solids[outer]
            for j in s.solids[inner]
        ]
        if not rows:
            return [NONE] * len(entered)
        table = np.array(rows, np.int64)
        n = len(rows)
        share = self.cells if self.fewest is None else max(self.cells // n, self.fewest)
        at, least, most = np.empty((n, 3)), np.empty(n), np.empty(n)
        deepest(
            np.ascontiguousarray(table[:, 1:]), np.ascontiguousarray(rotations, float),
            np.ascontiguousarray(positions, float), self._bound.table, self.tolerance, share, at, least, most,
        )  # fmt: skip
        found = [NONE] * len(entered)
        for (k, _, _), low, high, point in zip(rows, least.tolist(), most.tolist(), at, strict=True):
            known = found[k]
            if low > known.at_least:
                found[k] = Depth(low, max(high, known.at_most), point)
            elif high > known.at_most:
                found[k] = Depth(known.at_least, high, known.point)
        return found
