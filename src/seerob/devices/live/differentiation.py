r"""Velocities from positions that come one by one, for devices that measure no velocities.

The slope at the newest sample of the parabola that fits the last samples best. It has no lag for any
motion of constant acceleration, as a difference of the last two samples has (half a period), and lessens
noise instead of magnifying it: with n samples at a period T and independent errors of deviation σ, that of
the velocity is :math:`\sigma_v = \frac{\sigma}{T}\sqrt{\frac{12 (2n-1)(8n-11)}{n (n^2-1)(n^2-4)}}`.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections import deque
from collections.abc import Sequence
from operator import mul

SAMPLES = 7
"""That the parabola is fitted to."""
DEVIATIONS = 3.0
"""That are told of noise: of normal errors 99.7 % lie within."""
REMEMBERED, FEW = 64, 16
"""Third differences that noise is told by; of fewer the largest counts, not the median."""
DEVIATIONS_OF_FEW = 206.0, 18.0, 8.9, 6.2, 4.7, 4.0, 3.5, 3.2
"""How many times the largest of one, two, three… third differences are told, so that 99.7 % of normal errors
lie within from the first on; later `DEVIATIONS`. Of 400 000 series each, of slopes through all `SAMPLES`."""
OF_MEDIAN = 26.0
"""What is added to `DEVIATIONS` of a median, over how many it is of: its own noise, likewise for 99.7 %. Of
400 000 series each it takes 4.59 of 16, 3.80 of 32 and 3.36 of 64; by `DEVIATIONS` 98.0, 98.9 and 99.3 % lie
within."""
FLAT = 1e-9
"""Sum of the squares that a parabola has beside the best line, in units of the span, below which its
curvature is not told by the instants: all but two of them fall together."""


def end_weights(times: Sequence[float]) -> list[float]:
    """What each value counts for in the slope, at the last instant, of the parabola that fits best.

    Least squares by polynomials that are orthogonal over the instants, in plain numbers: this runs between a
    packet and the mailbox, where calls of a linear-algebra library cost more than they compute. Where the
    instants do not tell a parabola from a line, that of the line.

    Args:
        times: Ascending [s], shape (m,), m >= 3.

    Returns:
        [1/s], shape (m,).
    """
    count, last = len(times), times[-1]
    span = last - times[0]
    s = [(t - last) / span for t in times]
    mean = sum(s) / count
    line = [x - mean for x in s]
    squares = list(map(mul, line, line))
    second = sum(squares)
    tilt, level = sum(map(mul, squares, line)) / second, second / count
    bend = [x * (x - tilt) - level for x in line]
    fourth = sum(map(mul, bend, bend))
    by_line = 1.0 / (second * span)
    if fourth < FLAT:
        return [by_line * x for x in line]
    by_bend = (2.0 * line[-1] - tilt) / (fourth * span)
    return [by_line * x + by_bend * y for x, y in zip(line, bend, strict=True)]


class Differentiator:
    """Keeps the last samples of one device.

    Args:
        gap: An interval above which older samples say nothing of the present [s].
    """

    def __init__(self, gap: float) -> None:
        self._gap = gap
        self._times: deque[float] = deque(maxlen=SAMPLES)
        self._values: deque[tuple[float, ...]] = deque(maxlen=SAMPLES)
        self._noise = PositionNoise()
        self._weights: list[float] = []
        """Of the newest slope [1/s]."""

    def error(self) -> tuple[float, ...] | None:
        """How far the newest velocities may be off by the noise of positions [rad/s or m/s], shape (n,)."""
        return self._noise.error_by(self._weights) if len(self._times) > 2 else None

    def add(self, t: float, values: tuple[float, ...]) -> tuple[float, ...] | None:
        """Velocities at the newest sample; None until there are three, and again after a gap.

        And None as long as nothing is told of the noise of positions, which takes four once: speeds of which
        nobody knows how far they may be off pass for measured ones.

        Args:
            t: [s]; what is not later than the sample before it begins anew.
            values: [rad or m], shape (n,).

        Returns:
            [rad/s or m/s], shape (n,).
        """
        if self._times and not 0.0 < t - self._times[-1] <= self._gap:
            if t < self._times[-1]:
                self._noise.restart()
            self._times.clear()
            self._values.clear()
        self._times.append(t)
        self._values.append(values)
        self._noise.add(t, values)
        if len(self._times) < 3 or not self._noise.told:
            return None
        weights = self._weights = end_weights(self._times)
        return tuple([sum(map(mul, weights, column)) for column in zip(*self._values, strict=True)])


class PositionNoise:
    """Standard deviation of the noise of positions that come one by one."""

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=4)
        self._values: deque[tuple[float, ...]] = deque(maxlen=4)
        self._found: deque[list[float]] = deque(maxlen=REMEMBERED)
        self._sorted: list[list[float]] = []
        """What was found, of each value, ascending: its median is asked for at every sample."""

    @property
    def told(self) -> bool:
        """Whether enough positions came to tell anything of it."""
        return bool(self._found)

    def restart(self) -> None:
        """Take up a clock that has begun again; what was found of the noise stays."""
        self._times.clear()
        self._values.clear()

    def add(self, t: float, values: tuple[float, ...]) -> None:
        """Take what came.

        Args:
            t: [s]; what is not later than the sample before it is left out.
            values: [rad or m], shape (n,).
        """
        if self._times and not t > self._times[-1]:
            return
        if self._values and len(self._values[-1]) != len(values):
            self._values.clear()
            self._times.clear()
            self._found.clear()
            self._sorted.clear()
        self._times.append(t)
        self._values.append(values)
        if len(self._times) < 4:
            return
        # Divided differences, so that unevenly spaced instants are no noise; written out, for speed.
        a, b, c, d = self._times
        ab, ac, ad, bc, bd, cd = a - b, a - c, a - d, b - c, b - d, c - d
        try:
            w, x, y, z = 1 / (ab * ac * ad), 1 / (-ab * bc * bd), 1 / (ac * bc * cd), 1 / (-ad * bd * cd)
            size = math.sqrt(w * w + x * x + y * y + z * z)
            differences = [
                abs(w * p + x * q + y * r + z * s) / size for p, q, r, s in zip(*self._values, strict=True)
            ]
        except ZeroDivisionError:  # instants nearer or farther apart than numbers can tell
            differences = [math.nan] * len(values)
        # By what is no number, nothing is told.
        found = [math.inf if math.isnan(each) else each for each in differences]
        oldest = self._found[0] if len(self._found) == REMEMBERED else None
        self._found.append(found)
        self._sorted = self._sorted or [[] for _ in found]
        for k, (ordered, new) in enumerate(zip(self._sorted, found, strict=True)):
            if oldest is not None:
                del ordered[bisect_left(ordered, oldest[k])]
            insort(ordered, new)

    def speed_error(self, times: Sequence[float]) -> tuple[float, ...] | None:
        """How far a slope of the parabola through values at instants may be off at the last of them.

        Args:
            times: Ascending [s], shape (m,), m >= 3.

        Returns:
            [rad/s or m/s], shape (n,); None as long as nothing is told of the noise.
        """
        return self.error_by(end_weights(times)) if self.told else None

    def error_by(self, weights: Sequence[float]) -> tuple[float, ...] | None:
        """Say what `speed_error` does, by the weights of that slope (`end_weights`) [1/s]."""
        if not self.told:
            return None
        count, size = len(self._found), math.sqrt(sum(map(mul, weights, weights)))
        few = count <= len(DEVIATIONS_OF_FEW)
        if count < FEW:
            by = size * (DEVIATIONS_OF_FEW[count - 1] if few else DEVIATIONS)
            return tuple([by * ordered[-1] for ordered in self._sorted])
        by = size * (DEVIATIONS + OF_MEDIAN / count)
        half, odd = divmod(count, 2)
        middles = [o[half] if odd else 0.5 * (o[half - 1] + o[half]) for o in self._sorted]
        return tuple([by * (1.4826 * middle) for middle in middles])
