"""The screening over time: seconds per posture line and of an asymmetric trunk, and the points of both."""

from __future__ import annotations

import math
from typing import NamedTuple

from seerob.criteria.scoring.eaws_posture import Interpolation, asymmetry_points, line_points
from seerob.criteria.scoring.measured import Accuracy, Measured
from seerob.criteria.scoring.posture_time import PostureTime
from seerob.criteria.scoring.published import published
from seerob.description.humans.angles import Angles

_TURNS = ("trunk_twist", "trunk_side_bend")


class Points(NamedTuple):
    """Points so far."""

    lines: dict[str, float]
    rotation: float
    bending: float

    @property
    def total(self) -> float:
        """Points of section 1, far reach apart."""
        most = float(published("eaws_posture")["asymmetry_sum_most"])
        return sum(self.lines.values()) + min(self.rotation + self.bending, most)


class _Ledger:
    """Time by line and by size of the asymmetry, at one end of what is possible."""

    def __init__(self, hold: float) -> None:
        self.lines = PostureTime(hold)
        self.turns = {name: [PostureTime(0.0) for _ in range(3)] for name in _TURNS}


class Screening:
    """Points of a posture as time goes on, least and greatest.

    Args:
        cycle: Length of the cycle [s]; shares are of this, or of all that was heard when that is longer.
        hold: How long a posture is held to count [s].
        interpolation: Between the columns of the form.
    """

    def __init__(self, cycle: float, hold: float, interpolation: Interpolation) -> None:
        self._cycle, self._hold, self._interpolation = cycle, hold, interpolation
        self._t = -math.inf
        self._begin()

    def _begin(self) -> None:
        self._ends = (_Ledger(self._hold), _Ledger(self._hold))

    def add(self, t: float, possible: tuple[str, ...], angles: Angles, accuracy: Accuracy) -> None:
        """What a posture may be at an instant [s], lightest line first; an earlier instant begins anew."""
        if t < self._t:
            self._begin()
        if t == self._t:
            return
        self._t = t
        measured = Measured(angles, accuracy)
        for end, ledger in enumerate(self._ends):
            ledger.lines.add(t, possible[-end])
            for name, timers in ledger.turns.items():
                for edge, timer in zip(published("eaws_posture")["asymmetry_from_deg"], timers, strict=True):
                    turned = measured.beyond(name, math.radians(edge))
                    timer.add(t, "turned" if int(turned[end]) else "")

    @property
    def heard(self) -> float:
        """Time that was heard [s]."""
        return self._ends[0].lines.heard

    @property
    def silent(self) -> float:
        """Time in which nothing was heard [s]."""
        return self._ends[0].lines.silent

    @property
    def coverage(self) -> float:
        """Share of the time that was heard."""
        return self.heard / (self.heard + self.silent) if self.heard > 0 else 0.0

    @property
    def complete(self) -> bool:
        """Whether a whole cycle was heard."""
        return self.heard >= self._cycle - 1e-6

    def points(self) -> tuple[Points, Points]:
        """Least and greatest."""
        whole = max(self._cycle, self.heard)
        found = []
        for ledger in self._ends:
            seconds = {name: s for name, s in ledger.lines.seconds.items() if name}
            turns = [
                asymmetry_points(tuple(timer.seconds.get("turned", 0.0) / whole for timer in timers))
                for timers in ledger.turns.values()
            ]
            points = {name: line_points(name, s / whole, self._interpolation) for name, s in seconds.items()}
            found.append(Points(points, *turns))
        return found[0], found[1]
