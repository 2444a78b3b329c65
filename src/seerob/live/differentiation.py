r"""Velocities from positions that come one by one, for devices that measure no velocities.

The slope at the newest sample of the parabola that fits the last samples best. It has no lag for any
motion of constant acceleration, as a difference of the last two samples has (half a period), and lessens
noise instead of magnifying it: with n samples at a period T and independent errors of deviation σ, that of
the velocity is :math:`\sigma_v = \frac{\sigma}{T}\sqrt{\frac{12 (2n-1)(8n-11)}{n (n^2-1)(n^2-4)}}`.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from seerob.transforms import Array

SAMPLES = 7
"""That the parabola is fitted to."""


def end_slope(times: Array, values: Array) -> Array:
    """Slope, at the last instant, of the parabola that fits best in the least squares.

    Args:
        times: Ascending [s], shape (m,), m >= 3.
        values: Shape (m, n).

    Returns:
        Per second, shape (n,).
    """
    # Seen from the last instant, in units of the span: well conditioned, and the slope is a coefficient.
    span = times[-1] - times[0]
    s = (times - times[-1]) / span
    design = np.stack([np.ones_like(s), s, s * s], axis=1)
    coefficients, *_ = np.linalg.lstsq(design, values, rcond=None)
    return np.asarray(coefficients[1] / span)


class Differentiator:
    """Keeps the last samples of one device.

    Args:
        gap: An interval above which older samples say nothing of the present [s].
    """

    def __init__(self, gap: float) -> None:
        self._gap = gap
        self._times: deque[float] = deque(maxlen=SAMPLES)
        self._values: deque[tuple[float, ...]] = deque(maxlen=SAMPLES)

    def add(self, t: float, values: tuple[float, ...]) -> tuple[float, ...] | None:
        """Velocities at the newest sample; None until there are three, and again after a gap.

        Args:
            t: [s]; what is not later than the sample before it begins anew.
            values: [rad or m], shape (n,).

        Returns:
            [rad/s or m/s], shape (n,).
        """
        if self._times and not 0.0 < t - self._times[-1] <= self._gap:
            self._times.clear()
            self._values.clear()
        self._times.append(t)
        self._values.append(values)
        if len(self._times) < 3:
            return None
        slope = end_slope(np.array(self._times), np.array(self._values))
        return tuple(slope.tolist())
