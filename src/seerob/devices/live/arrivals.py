"""How regularly a source is heard: rate, jitter and gaps, in constant memory."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Statistics:
    """What arrived so far."""

    count: int = 0
    """Samples with news."""
    repeated: int = 0
    """Samples that were not newer than the one before."""
    rate: float | None = None
    """Mean rate while heard [1/s]; None below two samples."""
    jitter: float | None = None
    """Standard deviation of the interval between arrivals [s]."""
    longest_gap: float | None = None
    """Longest interval between arrivals, losses left out [s]."""
    missed: int = 0
    """Samples that the device's own time says are missing."""
    losses: int = 0
    """Times it was lost after it had been heard."""
    offset: float | None = None
    """Host's monotonic time less device time [s]."""

    def __str__(self) -> str:
        if self.rate is None or self.jitter is None or self.longest_gap is None:
            return f"{self.count} samples"
        return (
            f"{self.count} samples at {self.rate:.1f}/s, jitter {1e3 * self.jitter:.2f} ms, "
            f"longest gap {1e3 * self.longest_gap:.1f} ms, {self.missed} missed, "
            f"{self.repeated} repeated, {self.losses} losses"
        )


class Arrivals:
    """Counts what arrives; Welford's running mean and variance of the intervals.

    Args:
        period: Expected period of the source [s], to tell what is missing.
    """

    def __init__(self, period: float | None = None) -> None:
        self._period = period
        self._count = self._repeated = self._missed = self._losses = 0
        self._intervals, self._mean, self._squares, self._longest = 0, 0.0, 0.0, 0.0
        self._last: float | None = None
        self._last_device: float | None = None

    def add(self, host: float, device: float | None) -> None:
        """News arrived at ``host`` [s], stamped ``device`` [s]."""
        self._count += 1
        if self._last is not None:
            interval = host - self._last
            self._intervals += 1
            change = interval - self._mean
            self._mean += change / self._intervals
            self._squares += change * (interval - self._mean)
            self._longest = max(self._longest, interval)
        if device is not None and self._last_device is not None and self._period is not None:
            # Rounded: a device's clock has ticks of its own.
            self._missed += max(0, round((device - self._last_device) / self._period) - 1)
        self._last, self._last_device = host, device

    def repeat(self) -> None:
        """Something arrived that was not new."""
        self._repeated += 1

    def lose(self) -> None:
        """The source was lost: the silence until it returns is no interval."""
        self._losses += self._last is not None
        self._last = self._last_device = None

    def statistics(self, offset: float | None = None) -> Statistics:
        """What arrived so far."""
        known = self._intervals > 0 and self._mean > 0
        return Statistics(
            count=self._count,
            repeated=self._repeated,
            rate=1 / self._mean if known else None,
            jitter=math.sqrt(self._squares / self._intervals) if known else None,
            longest_gap=self._longest if known else None,
            missed=self._missed,
            losses=self._losses,
            offset=offset,
        )
