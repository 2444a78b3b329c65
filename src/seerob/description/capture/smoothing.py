r"""What a device sees of a person without its noise: a causal low-pass filter of the second order.

.. math:: \ddot y + \sqrt 2\,\omega \dot y + \omega^2 y = \omega^2 u, \qquad \omega = 2\pi f_c

a Butterworth filter, whose gain at the frequency f is :math:`1/\sqrt{1 + (f/f_c)^4}` and which delays what
is much slower than :math:`f_c` by :math:`\sqrt 2/\omega`. Between two samples it is solved by the
trapezoidal rule, which is stable at every step, so that a lost frame or an uneven rate does no harm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from seerob.core.samples import BodyPoint, Vec3, Vec4

PAUSE = 0.25
"""Whatever was not seen for longer [s] begins anew, without a past."""
POINT_SPEED = 10.0
"""No point of a person at work is faster [m/s]."""
POINT_SLACK = 0.1
"""What a position may jump by itself, as noise [m]."""
LARGEST = 1e6
"""No position is larger [m]."""
MOST_KEPT = 4096
"""Things that are remembered; a device whose names change all the time must not fill the memory."""
LOWEST, HIGHEST = 0.5, 100.0
"""Cut-off frequencies that make sense [Hz]."""


def group_delay(cutoff: float) -> float:
    """By how much slow motion comes later [s].

    Args:
        cutoff: [Hz]; 0 for no filter.
    """
    return float(np.sqrt(2) / (2 * np.pi * cutoff)) if cutoff else 0.0


@dataclass
class _Trail:
    """What is known of one thing that moves: a position or a quaternion."""

    t: float
    """[s]"""
    heard: tuple[float, ...]
    """Unfiltered."""
    value: list[float]
    rate: list[float]


class Smoother:
    """Filters one device's points, sample by sample."""

    def __init__(self) -> None:
        self._trails: dict[tuple[str, bool], _Trail] = {}

    def __call__(self, points: Sequence[BodyPoint], t: float, cutoff: float) -> tuple[BodyPoint, ...]:
        """The points as they are without noise.

        A position that leaps stays as it came, for `seerob.description.capture.following` to judge.

        Args:
            points: Of one sample; what has no number stays as it is.
            t: Of the sample [s]; later than the one before.
            cutoff: [Hz]
        """
        out = []
        for p in points:
            position, wxyz = p.position, p.wxyz
            if position is not None and all(abs(v) < LARGEST for v in position):  # false for NaN
                x, y, z = self._moved((p.name, False), t, position, cutoff)
                position = x, y, z
            if wxyz is not None and all(abs(v) <= 2 for v in wxyz):
                wxyz = self._turned(p.name, t, wxyz, cutoff)
            out.append(replace(p, position=position, wxyz=wxyz))
        return tuple(out)

    def _moved(self, key: tuple[str, bool], t: float, heard: Vec3, cutoff: float) -> Sequence[float]:
        trail = self._trails.get(key)
        if trail is not None and t - trail.t <= PAUSE:
            leap = sum((a - b) ** 2 for a, b in zip(heard, trail.heard, strict=True)) ** 0.5
            if leap > POINT_SLACK + POINT_SPEED * (t - trail.t):
                return heard
        return self._filtered(key, t, heard, cutoff)

    def _turned(self, name: str, t: float, heard: Vec4, cutoff: float) -> Vec4:
        trail = self._trails.get((name, True))
        # q and -q are the same turn: the one nearer to where the filter is.
        if trail is not None and sum(a * b for a, b in zip(heard, trail.value, strict=True)) < 0:
            heard = (-heard[0], -heard[1], -heard[2], -heard[3])
        found = self._filtered((name, True), t, heard, cutoff)
        size = sum(v * v for v in found) ** 0.5
        if size < 0.5:  # half a turn between two samples has no middle
            del self._trails[name, True]
            return heard
        w, x, y, z = (v / size for v in found)
        return w, x, y, z

    def _filtered(
        self, key: tuple[str, bool], t: float, heard: tuple[float, ...], cutoff: float
    ) -> Sequence[float]:
        trail = self._trails.get(key)
        if trail is None or not 0 < t - trail.t <= PAUSE:
            if len(self._trails) >= MOST_KEPT:
                self._trails = {k: trail for k, trail in self._trails.items() if t - trail.t <= PAUSE}
            if len(self._trails) >= MOST_KEPT:
                return heard
            self._trails[key] = _Trail(t, heard, list(heard), [0.0] * len(heard))
            return heard
        h, w = 0.5 * (t - trail.t), 2 * np.pi * cutoff
        damping, stiff = np.sqrt(2) * w, w * w
        lead = 1 + h * damping + h * h * stiff
        for k, now in enumerate(heard):
            y, v, middle = trail.value[k], trail.rate[k], now + trail.heard[k]
            force = h * stiff * (middle - 2 * y) + v * (1 - h * damping - h * h * stiff)
            trail.rate[k] = float(force / lead)
            trail.value[k] = float(y + h * (v + trail.rate[k]))
        trail.t, trail.heard = t, heard
        return tuple(trail.value)
