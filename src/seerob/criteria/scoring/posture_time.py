"""How long each posture of a list lasted, the short ones apart."""

from __future__ import annotations

import math

from seerob.core.domains import number
from seerob.criteria.scoring.repetition import GAP

_ROUNDING = 1e-9


class PostureTime:
    """Seconds by posture; a posture counts, from its begin, once it was held long enough.

    Args:
        hold: How long a posture is held to count [s].
    """

    def __init__(self, hold: float) -> None:
        self._hold = hold
        self._posture: str | None = None
        self._since = self._t = math.nan
        self.seconds: dict[str, float] = {}
        """Posture → time for which it was held [s], where it was held long enough to count."""
        self.heard = 0.0
        """All time that was heard [s]."""
        self.silent = 0.0
        """Time in which nothing was heard [s]."""

    def add(self, t: float, posture: str) -> None:
        """The posture from the instant before up to this one [s]."""
        number("the instant", t, unit="s")
        step = t - self._t
        if math.isnan(step):
            self._posture, self._since = posture, t
        elif step > GAP + _ROUNDING:
            self.silent += step
            self._posture, self._since = posture, t
        else:
            self.heard += step
            before = 0.0 if self._posture is None else self._credit(self._t)
            after = 0.0 if self._posture is None else self._credit(t)
            if self._posture is not None and after > before:
                self.seconds[self._posture] = self.seconds.get(self._posture, 0.0) + after - before
            if posture != self._posture:
                self._posture, self._since = posture, t
        self._t = t

    def _credit(self, t: float) -> float:
        held = t - self._since
        return held if held >= self._hold - _ROUNDING else 0.0
