"""What repeats one value bit by bit although it never did before: a tracker that froze, frames sent again.

Whatever is measured has noise: its last digits change from sample to sample, to and fro. A point that had
noise so far and now says exactly the same is no longer measured, whatever stamp its samples carry. What
never had noise (made motions, values rounded to millimetres) may stand still in a file. A live device makes
no motions, and what it filters has little noise that goes to and fro: there a point that never repeated
itself is frozen once it does, and so is one that stands for long while others move.
"""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from seerob.core.samples import BodyPoint
from seerob.core.transforms import Array

STEPS = 30
"""Changes that are seen before anything is said of a point's noise."""
TO_AND_FRO = 0.2
"""Share of turns from which on changes are noise: of white noise it is more than two thirds."""
REPEATED = 0.05
"""Share of repeated values up to which a point is one that never repeats."""
LEAST = 1e-12
"""Square of a change that is more than the rounding of made values [m² or quaternions' units]."""
NOTHING = (np.nan,) * 4
"""What was not said."""


class Frozen:
    """Of the points of one device.

    Args:
        live: Whether it measures while it speaks.

    Attributes:
        bones: Those of which something was frozen in the newest sample.
    """

    def __init__(self, *, live: bool = False) -> None:
        self._live = live
        self.bones: set[str] = set()
        self._names: tuple[str, ...] = ()

    def _begin(self, names: tuple[str, ...]) -> None:
        """Names of the device's points; others than before begin without a past."""
        n = 2 * len(names)
        self._names = names
        # Positions, then orientations; what was not said last stays.
        self._value, self._step, self._bend, self._jerk = np.full((4, n, 4), np.nan)
        self._steps, self._back, self._repeats, self._same = np.zeros((4, n), np.int64)

    def __call__(self, points: tuple[BodyPoint, ...]) -> tuple[BodyPoint, ...]:
        """The points of one sample without positions and orientations that only repeat those before."""
        names = tuple(point.name for point in points)
        if names != self._names:
            self._begin(names)
        said = [(0.0, *point.position) if point.position else NOTHING for point in points]
        said += [point.wxyz or NOTHING for point in points]
        with np.errstate(invalid="ignore", over="ignore"):  # numbers that cannot be are for others
            frozen = self._add(np.array(said, float).reshape(-1, 4))
        self.bones.clear()
        if not frozen.any():
            return points
        found = list(points)
        for k in np.flatnonzero(frozen).tolist():
            i, turned = k % len(points), k >= len(points)
            self.bones.add(points[i].bone)
            found[i] = replace(found[i], wxyz=None) if turned else replace(found[i], position=None)
        return tuple(found)

    def _add(self, value: Array) -> NDArray[np.bool_]:
        """Which values only repeat the ones before, shape (2n,)."""
        known = ~np.isnan(value).any(axis=1)
        same = known & (value == self._value).all(axis=1)
        self._same[same] += 1
        step = value - self._value
        # Not a number where nothing was before: no comparison with it holds.
        moved = known & (np.einsum("ij,ij->i", step, step) > LEAST)
        bend = step - self._step
        jerk = bend - self._bend
        self._steps += moved
        self._back += moved & (np.einsum("ij,ij->i", self._jerk, jerk) < 0)
        self._repeats += moved & (self._same > 0)
        long = self._steps >= 4 * STEPS  # what was long ago counts less
        for count in (self._steps, self._back, self._repeats):
            count[long] //= 2
        self._step[moved], self._bend[moved], self._jerk[moved] = step[moved], bend[moved], jerk[moved]
        new = known & ~same
        self._value[new] = value[new]
        self._same[new] = 0
        never = self._repeats <= REPEATED * self._steps
        if self._live:
            often = self._steps >= STEPS
            return np.asarray(same & never & (often | ((self._same >= STEPS) & often.any())))
        noisy = (self._steps >= STEPS) & (self._back >= TO_AND_FRO * self._steps)
        return np.asarray(same & noisy & never)
