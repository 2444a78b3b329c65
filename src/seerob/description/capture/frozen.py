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

import math
from bisect import bisect_right
from collections.abc import Sequence
from operator import eq

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from seerob.core.samples import BodyPoint, Vec3, Vec4
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
TOGETHER = 16
"""So many samples in which nothing repeats itself are counted in one go: small arrays take longer to call
than to compute, and longest between a packet and the mailbox."""
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
        self._last: list[object] = []
        """Positions, then orientations, as they were said last; an ellipsis, which equals nothing, before."""
        self._waiting: list[list[Vec3 | Vec4 | None]] = []
        """Said since then without a repetition, and not counted yet."""

    def _begin(self, names: tuple[str, ...]) -> None:
        """Names of the device's points; others than before begin without a past."""
        self._whole = _Whole()
        n = 2 * len(names)
        self._names, self._last, self._waiting = names, [...] * n, []
        # Positions, then orientations; what was not said last stays.
        self._value, self._step, self._bend, self._jerk = np.full((4, n, 4), np.nan)
        self._steps, self._back, self._repeats, self._same = np.zeros((4, n), np.int64)

    def __call__(self, points: tuple[BodyPoint, ...], t: float) -> tuple[BodyPoint, ...]:
        """The points of one sample without positions and orientations that only repeat those before.

        Args:
            points: As the device says them.
            t: When [s]; later than those before.
        """
        names = tuple([point.name for point in points])
        if names != self._names:
            self._begin(names)
        places = [point.position for point in points]
        said: list[Vec3 | Vec4 | None] = [*places, *[point.wxyz for point in points]]
        numbers = not math.isnan(sum(map(sum, filter(None, said))))
        if not numbers:
            places = [place if place and not math.isnan(sum(place)) else None for place in places]
        frozen = self._repeated(said, numbers=numbers)
        if len({point.bone for point in points if point.position}) >= WHOLE and self._whole.hangs(t, places):
            frozen = range(2 * len(points))
        self.bones.clear()
        if not frozen:
            return points
        found = list(points)
        for k in frozen:
            i, turned = k % len(points), k >= len(points)
            self.bones.add(points[i].bone)
            found[i] = replace(found[i], wxyz=None) if turned else replace(found[i], position=None)
        return tuple(found)

    def _repeated(self, said: list[Vec3 | Vec4 | None], *, numbers: bool) -> Sequence[int]:
        """Which values are frozen.

        Args:
            said: Positions, then orientations.
            numbers: Whether no value is NaN.
        """
        last, found = self._last, list[int]()
        # What is the same to the last bit is rare, and nothing is asked of counts before.
        if numbers and not any(map(eq, said, last)):
            self._waiting.append(said)
            if len(self._waiting) >= TOGETHER:
                self._count()
        else:
            self._count()
            with np.errstate(invalid="ignore", over="ignore"):  # numbers that cannot be are for others
                found = np.flatnonzero(self._add(_rows(said))).tolist()
        self._last = [
            b if a is None or not (numbers or _is_number(a)) else a for a, b in zip(said, last, strict=True)
        ]
        return found

    def _count(self) -> None:
        """Count what waits."""
        if not self._waiting:
            return
        values = np.array([_rows(said) for said in self._waiting])
        self._waiting = []
        with np.errstate(invalid="ignore", over="ignore"):
            if not self._add_together(values):
                for value in values:
                    self._add(value)

    def _add_together(self, values: Array) -> bool:
        """Count samples in which nothing is the same, as `_add` does one by one; False for who must do it.

        Args:
            values: Shape (k, 2n, 4).
        """
        told = ~np.isnan(values[0]).any(axis=1)
        if (np.isnan(values).any(axis=2) == told).any():
            return False  # some are said now and then
        values = values[:, told]
        steps = values - np.concatenate([self._value[None, told], values[:-1]])
        if not (np.einsum("kij,kij->ki", steps, steps) > LEAST).all():
            return False
        bends = steps - np.concatenate([self._step[None, told], steps[:-1]])
        jerks = bends - np.concatenate([self._bend[None, told], bends[:-1]])
        before = np.concatenate([self._jerk[None, told], jerks[:-1]])
        back = np.einsum("kij,kij->ki", before, jerks) < 0
        counts = np.array([self._steps[told], self._back[told], self._repeats[told]])
        counts[2] += self._same[told] > 0
        for turns in back:
            counts[0] += 1
            counts[1] += turns
            counts[:, counts[0] >= 4 * STEPS] //= 2
        self._steps[told], self._back[told], self._repeats[told] = counts
        self._value[told], self._step[told] = values[-1], steps[-1]
        self._bend[told], self._jerk[told] = bends[-1], jerks[-1]
        self._same[told] = 0
        return True

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


def _rows(said: Sequence[Vec3 | Vec4 | None]) -> Array:
    """Positions, then orientations, shape (2n, 4); NaN where not said."""
    n = len(said) // 2
    rows = [(0.0, *place) if place else NOTHING for place in said[:n]]
    return np.array([*rows, *[turn or NOTHING for turn in said[n:]]], float).reshape(-1, 4)


def _is_number(value: Sequence[float]) -> bool:
    return not math.isnan(sum(value))


Places = Sequence[Vec3 | None]
"""Of all points [m]; None where one is not seen."""


class _Whole:
    """Whether a whole body hangs: walked, and stands in all its points from one sample to the next.

    In plain numbers: this runs between a packet and the mailbox.
    """

    def __init__(self) -> None:
        self._times: list[float] = []
        self._past: list[tuple[Places, Vec3]] = []
        """Where, and by how much the middle moved since the sample before (`_way`)."""
        self._hung: Places | None = None

    def hangs(self, t: float, places: Places) -> bool:
        """Of the newest sample.

        Args:
            t: [s]
            places: Now.
        """
        times, past = self._times, self._past
        if times and t <= times[-1]:
            return False  # two at one instant, or set back: a matter of time, not of places
        times.append(t)
        past.append((places, _way(past[-1][0], places) if past else (0.0, 0.0, 0.0)))
        while len(past) > 2 and times[1] <= t - 2 * SPAN - SLACK:
            del times[0], past[0]
        if self._hung is not None:
            if not _rms_distance(places, self._hung) > GOES_ON:
                return True
            self._hung = None
            times.clear()
            past.clear()
            return False
        stood = max(bisect_right(times, t - SPAN + SLACK) - 1, 0)
        walked = bisect_right(times, times[stood] - SPAN + SLACK, 0, stood + 1) - 1
        if not 0 <= walked <= stood - 2:
            return False
        steps = [way for _, way in past[walked + 1 : stood + 1]]
        way = math.hypot(*map(sum, zip(*steps, strict=True)))
        if not way >= WALKS * SPAN:
            return False
        lengths = [math.hypot(*step) for step in steps]
        evenly = min(lengths) >= EVENLY * sum(lengths) / len(lengths)
        if not (evenly and _rms_distance(places, past[stood][0]) <= STANDS * way):
            return False
        self._hung = places
        return True


def _way(a: Places, b: Places) -> Vec3:
    """By how much the middle of the points seen at both instants moved [m]."""
    both = [(p, q) for p, q in zip(a, b, strict=True) if p and q]
    if not both:
        return 0.0, 0.0, 0.0
    n = len(both)
    (x0, y0, z0), (x1, y1, z1) = [map(sum, zip(*each, strict=True)) for each in zip(*both, strict=True)]
    return (x1 - x0) / n, (y1 - y0) / n, (z1 - z0) / n


def _rms_distance(a: Places, b: Places) -> float:
    """How far the points seen at both instants are from each other [m], RMS; none when there are none."""
    ways = [math.dist(p, q) for p, q in zip(a, b, strict=True) if p and q]
    return math.sqrt(sum([way * way for way in ways]) / len(ways)) if ways else 0.0
