"""When a further row is due in a table with fewer rows than ticks."""

from __future__ import annotations

import math

_SLACK = 1e-6
"""Of a period: instants are not exact multiples of it."""


class Pace:
    """Rows at least so far apart.

    Args:
        every: Least time between two rows [s]; 0 for every tick.
        period: Of ticks [s].
    """

    def __init__(self, every: float, period: float) -> None:
        self._every, self._slack, self._next = every, _SLACK * period, -math.inf

    def due(self, t: float) -> bool:
        """Whether the tick at ``t`` [s] has a row; to be asked once per tick."""
        if t < self._next - self._slack:
            return False
        self._next = t + self._every
        return True
