r"""A device's clock on the host's: the offset between both, from what arrives.

A sample that the device stamped :math:`t_d` arrives at host time :math:`t_h = t_d + o + \lambda` with an
offset :math:`o` and a latency :math:`\lambda \ge 0`. The smallest :math:`t_h - t_d` of late bounds the
offset from above by the least latency, so :math:`t_d + \min(t_h - t_d)` is when the sample was taken,
free of the jitter of the way, and never later than it arrived. The minimum is one over a window that
moves on, because clocks drift.
"""

from __future__ import annotations

import math

WINDOW = 5.0
"""Of the minimum, by two halves [s]: long beside jitter, short beside drift (0.1 ms/s at most between
quartz clocks)."""
RESTART = 1.0
"""A device whose time goes back by more has started again [s]."""
LATEST = 1e12
"""No clock counts further [s]: what is later or not finite is no instant."""


class DeviceClock:
    """Estimates when, on the host's clock, a device took its samples."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget the device: it has connected anew, and its clock may have too."""
        self._last = -math.inf
        self._older = self._newer = math.inf
        self._turn = -math.inf

    @property
    def offset(self) -> float | None:
        """Host time less device time [s], too large by the least latency; None before anything arrived."""
        found = min(self._older, self._newer)
        return found if math.isfinite(found) else None

    def instant(self, device: float, host: float) -> float | None:
        """Host instant at which the sample was taken [s].

        Args:
            device: Its device time [s].
            host: When it arrived, on the host's monotonic clock [s].

        Returns:
            At most ``host``; None for a sample that is not newer than the one before, which is no news.
        """
        if not abs(device) <= LATEST:
            return None
        if device < self._last - RESTART:
            self.restart()
        if device <= self._last:
            return None
        self._last = device
        if host >= self._turn:
            self._older, self._newer = self._newer, math.inf
            self._turn = host + WINDOW / 2
        self._newer = min(self._newer, host - device)
        return device + min(self._older, self._newer)
