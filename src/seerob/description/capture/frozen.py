"""What repeats one value bit by bit although it never did before: a tracker that froze, frames sent again.

Whatever is measured has noise: its last digits change from sample to sample, to and fro. A point that had
noise so far and now says exactly the same is no longer measured, whatever stamp its samples carry. What
never had noise (made motions, values rounded to millimetres) may stand still in a file. A live device makes
no motions, and what it filters has little noise that goes to and fro: there a point that never repeated
itself is frozen once it does, and so is one that stands for long while others move.

Nor does a whole body stand from one sample to the next: one that walks, and of which then nothing moves any
more, hand nor foot, is a picture that hangs, whatever noise somebody added to it.
"""

from __future__ import annotations

from collections import deque

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
WHOLE = 8
"""Bones of which a device says where they are that make a whole body: a hand alone may stop at a table."""
WALKS = 0.3
"""A body whose middle is slower may stand at once [m/s]."""
SPAN = 0.1
"""Over which it walks, and then stands [s]: from 0.3 m/s to nothing it has at most two samples, 8 m/s²."""
STANDS = 0.15
"""Share of the way before by which points of a body that stands are off, RMS: noise, 5 mm at 0.3 m/s."""
SLACK = 1e-6
"""Of instants [s]."""
EVENLY = 0.5
"""Share of the mean speed that each step of a body that walks has; one that jumped has one step."""
GOES_ON = 0.05
"""A body that is so far from where it hung moves again [m], RMS."""


class Frozen:
    """Of the points of one device.

    Args:
        live: Whether it measures while it speaks.

    Attributes:
        bones: Those of which something was frozen in the newest sample.
    """

    def __init__(self, *, live: bool = False) -> None:
        self._live = live
        self._whole = _Whole()
        self.bones: set[str] = set()
        self._names: tuple[str, ...] = ()

    def _begin(self, names: tuple[str, ...]) -> None:
        """Names of the device's points; others than before begin without a past."""
        self._whole = _Whole()
        n = 2 * len(names)
        self._names = names
        # Positions, then orientations; what was not said last stays.
        self._value, self._step, self._bend, self._jerk = np.full((4, n, 4), np.nan)
        self._steps, self._back, self._repeats, self._same = np.zeros((4, n), np.int64)

    def __call__(self, points: tuple[BodyPoint, ...], t: float) -> tuple[BodyPoint, ...]:
        """The points of one sample without positions and orientations that only repeat those before.

        Args:
            points: As the device says them.
            t: When [s]; later than those before.
        """
        names = tuple(point.name for point in points)
        if names != self._names:
            self._begin(names)
        said = [(0.0, *point.position) if point.position else NOTHING for point in points]
        said += [point.wxyz or NOTHING for point in points]
        with np.errstate(invalid="ignore", over="ignore"):  # numbers that cannot be are for others
            value = np.array(said, float).reshape(-1, 4)
            frozen = self._add(value)
            if len({point.bone for point in points if point.position}) >= WHOLE:
                frozen |= self._whole.hangs(t, value[: len(points), 1:])
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


class _Whole:
    """Whether a whole body hangs: walked, and stands in all its points from one sample to the next."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, Array, Array]] = deque()
        """When, where, and by how much the middle moved since the sample before (`_way`)."""
        self._hung: Array | None = None

    def hangs(self, t: float, places: Array) -> bool:
        """Of the newest sample.

        Args:
            t: [s]
            places: Of all points [m], shape (n, 3); not a number where one is not seen.
        """
        past = self._past
        if past and t <= past[-1][0]:
            return False  # two at one instant, or set back: a matter of time, not of places
        past.append((t, places, _way(past[-1][1], places) if past else np.zeros(3)))
        while len(past) > 2 and past[1][0] <= t - 2 * SPAN - SLACK:
            past.popleft()
        if self._hung is not None:
            if not _rms_distance(places, self._hung) > GOES_ON:
                return True
            self._hung = None
            past.clear()
            return False
        stood = next((k for k in range(len(past) - 1, -1, -1) if past[k][0] <= t - SPAN + SLACK), 0)
        walked = next((k for k in range(stood, -1, -1) if past[k][0] <= past[stood][0] - SPAN + SLACK), stood)
        if stood - walked < 2:
            return False
        steps = np.array([past[k][2] for k in range(walked + 1, stood + 1)])
        ways = np.linalg.norm(steps, axis=1)
        way = float(np.linalg.norm(steps.sum(axis=0)))
        evenly = ways.min() >= EVENLY * ways.mean()
        if not (way >= WALKS * SPAN and evenly and _rms_distance(places, past[stood][1]) <= STANDS * way):
            return False
        self._hung = places
        return True


def _way(a: Array, b: Array) -> Array:
    """By how much the middle of the points seen at both instants moved [m], shape (3,)."""
    ways = b - a
    known = ~np.isnan(a + b).any(axis=1)
    if not known.all():
        ways = ways[known]
    return ways.sum(axis=0) / len(ways) if len(ways) else np.zeros(3)


def _rms_distance(a: Array, b: Array) -> float:
    """How far the points seen at both instants are from each other [m], RMS; none when there are none."""
    both = ~np.isnan(a + b).any(axis=1)
    return float(np.sqrt(((a[both] - b[both]) ** 2).sum(axis=1).mean())) if both.any() else 0.0
