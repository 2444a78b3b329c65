r"""A path coordinate over time whose jerk is bounded: a profile of constant accelerations, averaged.

.. math:: s_f(t) = \frac1w \int_{t-w}^{t} s(\tau)\, d\tau

of a profile s(t) that is a parabola on each interval and rests before and after. Speed, acceleration and
jerk of the average are differences,

.. math::
    \dot s_f = \frac{s(t) - s(t-w)}{w} \quad
    \ddot s_f = \frac{\dot s(t) - \dot s(t-w)}{w} \quad
    \dddot s_f = \frac{\ddot s(t) - \ddot s(t-w)}{w}

so speed and acceleration begin and end at 0, the acceleration is continuous, and the way is the same: only
the timing changes, never the path.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from seerob.core.transforms import Array


class Moment(NamedTuple):
    """Path coordinate and its first three derivatives by time, shape (k,) each."""

    s: Array
    speed: Array
    acceleration: Array
    jerk: Array


@dataclass(frozen=True, eq=False)
class Parabolas:
    """A profile of constant acceleration on each interval, at rest outside."""

    t: Array
    """From 0, shape (n,) [s]."""
    s: Array
    """Way at those instants, shape (n,)."""
    speed: Array
    """Speed at those instants, shape (n,); 0 at both ends."""
    acceleration: Array
    """On each interval, shape (n - 1,)."""
    area: Array
    """Integral of s up to each instant, shape (n,)."""

    @classmethod
    def of(cls, s: Array, speed: Array) -> Parabolas:
        """From speeds at path coordinates; between two of them the acceleration is constant."""
        width = 2 * np.diff(s) / np.maximum(speed[1:] + speed[:-1], 1e-300)
        t = np.concatenate([[0.0], np.cumsum(width)])
        a = np.diff(speed) / width
        part = width * (s[:-1] + width * (speed[:-1] / 2 + width * a / 6))
        return cls(t, s, speed, a, np.concatenate([[0.0], np.cumsum(part)]))

    def at(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Integral, coordinate, speed and acceleration at instants [s], shape (k,)."""
        last = len(self.t) - 1
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, last - 1)
        d = np.clip(t, 0.0, self.t[-1]) - self.t[k]
        s0, v0, a = self.s[k], self.speed[k], self.acceleration[k]
        inside = (t >= 0) & (t < self.t[-1])
        s = s0 + d * (v0 + d * a / 2)
        after = np.maximum(t - self.t[-1], 0.0)
        area = self.area[k] + d * (s0 + d * (v0 / 2 + d * a / 6)) + after * self.s[-1]
        return area, s, np.where(inside, v0 + d * a, 0.0), np.where(inside, a, 0.0)


@dataclass(frozen=True, eq=False)
class Profile:
    """Parabolas averaged over a window, and then stretched."""

    raw: Parabolas
    window: float
    """w [s]."""
    stretch: float = 1.0
    """All times are longer by this: speeds fall with it, accelerations and jerks with its square and cube."""

    @property
    def duration(self) -> float:
        """From rest to rest [s]."""
        return self.stretch * float(self.raw.t[-1] + self.window)

    def at(self, t: Array) -> Moment:
        """Where it is at instants from 0 to `duration` [s], shape (k,)."""
        k, w = self.stretch, self.window
        now, before = self.raw.at(np.asarray(t) / k), self.raw.at(np.asarray(t) / k - w)
        s, v, a, j = ((x - y) / w for x, y in zip(now, before, strict=True))
        end = self.raw.s[-1]
        return Moment(np.clip(s, 0.0, end), np.maximum(v, 0.0) / k, a / k**2, j / k**3)

    def breaks(self) -> Array:
        """Instants at which the jerk jumps, within its duration [s]."""
        return np.unique(np.concatenate([self.raw.t, self.raw.t + self.window])) * self.stretch
