"""What repeats one value bit by bit although it never did before: a tracker that froze, frames sent again.

Whatever is measured has noise: its last digits change from sample to sample, to and fro. A point that had
noise so far and now says exactly the same is no longer measured, whatever stamp its samples carry. What
never had noise (made motions, values rounded to millimetres) may stand still.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from seerob.samples import BodyPoint

STEPS = 30
"""Changes that are seen before anything is said of a point's noise."""
TO_AND_FRO = 0.2
"""Share of turns from which on changes are noise: of white noise it is more than two thirds."""
REPEATED = 0.05
"""Share of repeated values up to which a point is one that never repeats."""
LEAST = 1e-12
"""Square of a change that is more than the rounding of made values [m² or quaternions' units]."""
MOST_KEPT = 4096
"""Points that are remembered."""


@dataclass
class _Value:
    """One position or orientation over time."""

    value: tuple[float, ...]
    step: tuple[float, ...] = ()
    """The last change."""
    bend: tuple[float, ...] = ()
    """By how much it differed from the one before."""
    jerk: tuple[float, ...] = ()
    """And that from the one before."""
    steps: int = 0
    back: int = 0
    """How often that turned round: of a smooth motion hardly ever."""
    repeats: int = 0
    """Values that were repeated and changed again."""
    same: int = 0
    """How often the newest was repeated."""

    def add(self, value: tuple[float, ...]) -> None:
        if value == self.value:
            self.same += 1
            return
        step = tuple(b - a for a, b in zip(self.value, value, strict=True))
        if sum(x * x for x in step) > LEAST:
            self.steps += 1
            bend = tuple(b - a for a, b in zip(self.step, step, strict=False))
            jerk = tuple(b - a for a, b in zip(self.bend, bend, strict=False))
            self.back += sum(a * b for a, b in zip(self.jerk, jerk, strict=False)) < 0
            self.repeats += self.same > 0
            if self.steps >= 4 * STEPS:  # what was long ago counts less
                self.steps, self.back, self.repeats = self.steps // 2, self.back // 2, self.repeats // 2
            self.step, self.bend, self.jerk = step, bend, jerk
        self.value, self.same = value, 0

    @property
    def frozen(self) -> bool:
        noisy = self.steps >= STEPS and self.back >= TO_AND_FRO * self.steps
        return self.same > 0 and noisy and self.repeats <= REPEATED * self.steps


class Frozen:
    """Of the points of one device.

    Attributes:
        bones: Those of which something was frozen in the newest sample.
    """

    def __init__(self) -> None:
        self._values: dict[tuple[str, bool], _Value] = {}
        self.bones: set[str] = set()

    def __call__(self, points: Sequence[BodyPoint]) -> tuple[BodyPoint, ...]:
        """The points of one sample without positions and orientations that only repeat those before."""
        found = []
        self.bones.clear()
        for point in points:
            lost = [
                value is not None and self._is_frozen((point.name, turned), value)
                for turned, value in ((False, point.position), (True, point.wxyz))
            ]
            if any(lost):
                self.bones.add(point.bone)
                position, wxyz = (
                    None if gone else x for gone, x in zip(lost, (point.position, point.wxyz), strict=True)
                )
                point = replace(point, position=position, wxyz=wxyz)  # noqa: PLW2901
            found.append(point)
        return tuple(found)

    def _is_frozen(self, key: tuple[str, bool], value: tuple[float, ...]) -> bool:
        known = self._values.get(key)
        if known is None:
            if len(self._values) < MOST_KEPT:
                self._values[key] = _Value(value)
            return False
        known.add(value)
        return known.frozen
