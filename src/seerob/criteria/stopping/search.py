"""The largest factor on all speeds for which a robot still stops in time, found by asking."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from seerob.core.errors import Undecided
from seerob.core.transforms import Array
from seerob.criteria.stopping.terms import largest_scale

TOP = 10.0
"""Factor on the present speeds beyond which a larger permissible speed is not searched for."""
HALVINGS, COSTLY_HALVINGS = 14, 6
"""Of the search for the largest permissible speed."""


def factor_by_search(S_p: Callable[[float], Array], distance: Array, costly: bool) -> float:
    """Largest factor of all speeds for which no part is nearer than its S_p.

    Args:
        S_p: Of every part at a factor [m], shape (n,).
        distance: Of every part [m], shape (n,).
        costly: Whether asking takes long; then no more than the present speeds are looked at.
    """

    def holds(factor: float) -> bool:
        try:
            return bool(np.all(S_p(factor) <= distance))
        except Undecided:
            return False

    return largest_scale(holds, 1.0, COSTLY_HALVINGS) if costly else largest_scale(holds, TOP, HALVINGS)
