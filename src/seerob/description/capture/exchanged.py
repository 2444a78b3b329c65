"""Points of a recording that exchange their places from one frame to the next: labels that were swapped."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from seerob.core.transforms import Array

FAR = 0.05
"""Points that are nearer to each other [m] may as well have moved there."""
NEAR = 0.02
"""How far each may be from where the other was [m]; a choice, half a frame of a quick hand."""
LATE = 0.2
"""After a longer gap [s] nothing is said: both may have moved."""
MOST = 40
"""Points that move so far in one frame beyond which a device lost them altogether."""


class Exchanges:
    """Watches a recording frame by frame."""

    def __init__(self) -> None:
        self._t = -np.inf
        self._before: Array | None = None
        self.found: dict[tuple[int, int], list[float]] = {}
        """Two rows → when they exchanged their places [s]."""

    def add(self, t: float, positions: Array) -> None:
        """A frame at an instant [s] after the one before; positions of shape (n, 3), NaN where not seen."""
        before, since = self._before, t - self._t
        self._t, self._before = t, positions
        if before is None or len(before) != len(positions) or since > LATE:
            return
        with np.errstate(invalid="ignore", over="ignore"):
            moved = np.flatnonzero(np.linalg.norm(positions - before, axis=1) > FAR)
        if not 2 <= len(moved) <= MOST:
            return
        for i, j in combinations(moved.tolist(), 2):
            if (
                np.linalg.norm(positions[i] - before[j]) < NEAR
                and np.linalg.norm(positions[j] - before[i]) < NEAR
            ):
                self.found.setdefault((i, j), []).append(t)

    def text(self, names: Sequence[str]) -> str:
        """What is to be said; empty when nothing was exchanged.

        Args:
            names: Of the rows.
        """
        if not self.found:
            return ""
        shown = [
            f"{names[i]} and {names[j]} "
            + (f"({len(times)} times, first at " if len(times) > 1 else "(at ")
            + f"{times[0]:.2f} s)"
            for (i, j), times in sorted(self.found.items(), key=lambda item: -len(item[1]))
        ]
        more = f" and {len(shown) - 6} more" if len(shown) > 6 else ""
        return (
            f"exchange their places from one frame to the next: {', '.join(shown[:6])}{more}; labels swapped?"
        )
