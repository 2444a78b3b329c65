"""Which cells of a grid are connected, through faces of cells, with some of them."""

from __future__ import annotations

from numba import njit

from seerob.kernels.fields import Cells

FREE, REACHED = 1, 2
"""What a cell may be; 0 is neither."""


@njit(cache=True, nogil=True, error_model="numpy")
def flood(cells: Cells) -> None:
    """Make every free cell that is connected with a reached one a reached one, in place.

    Args:
        cells: `FREE`, `REACHED` or 0, shape (a, b, c).
    """
    a, b, c = cells.shape
    changed = True
    while changed:
        changed = False
        # Once forward and once backward through all cells, each of which asks its neighbours.
        for turn in range(2):
            for n in range(a * b * c):
                at = n if turn == 0 else a * b * c - 1 - n
                k = at % c
                j = (at // c) % b
                i = at // (b * c)
                if cells[i, j, k] != FREE:
                    continue
                if (
                    (i > 0 and cells[i - 1, j, k] == REACHED)
                    or (j > 0 and cells[i, j - 1, k] == REACHED)
                    or (k > 0 and cells[i, j, k - 1] == REACHED)
                    or (i < a - 1 and cells[i + 1, j, k] == REACHED)
                    or (j < b - 1 and cells[i, j + 1, k] == REACHED)
                    or (k < c - 1 and cells[i, j, k + 1] == REACHED)
                ):
                    cells[i, j, k] = REACHED
                    changed = True
