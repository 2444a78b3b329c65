r"""What a robot, a machine or a variable that is heard live may have done while its samples were lost.

From one sample to the next the twin goes along a cubic through both. Of a joint whose acceleration is a at
most, and whose cubic has b at most, the difference e from it has :math:`|\ddot e| \le a + b`, and vanishes at
both ends: with its derivative there, where samples say speeds, and else without. So within a time T

.. math:: |\dot e| \le (a + b)\,T/4, \qquad |e| \le (a + b)\,T^2/16,

or twice as much without speeds: it speeds up for T/4, brakes and turns round for T/2, and brakes for T/4.
Of a machine nobody states a, so that it may have been anywhere; and a variable anything.
"""

from __future__ import annotations

import math
from collections import deque

from seerob.core.transforms import Array
from seerob.twin.spans import Gap

USUAL = 32
"""Newest intervals between samples: a quarter of them are as short as usual, however many are lost."""
MISSING = 1.8
"""Times the usual interval after which a sample is missing: the next but one is due after two."""
QUICKEST = 35.0
"""No joint accelerates harder that states nothing [rad/s² or m/s²]: the hardest stop of the published tables,
of the wrist of a UR3, comes to 34.7 rad/s² (its speed over its stopping time)."""
BEATS = 0.05
"""Between two pictures of a machine that is heard [s]: after that it is silent, and when it was in motion
nobody says that it stopped."""
SAME = 1e-6
"""Instants that differ by less are the same [s]: a picture of variables may say once more what was known."""
SEEN = 5e-3
"""How far a joint may go away unseen and come back [rad or m]: what its samples, and the twin, are off by."""


class Unheard:
    """Looks at when samples of one were so, as the twin takes them, whether some between are missing.

    Args:
        name: Of the robot, machine or variable.
        acceleration: Largest acceleration of its joints [rad/s² or m/s²], shape (n,); infinite where nobody
            knows it.
        timeout: After which the twin does not rely on it [s].
    """

    def __init__(self, name: str, acceleration: Array, timeout: float) -> None:
        self._name, self._acceleration = name, acceleration
        # A sample comes a delay before the twin shows its instant; the time-out is more than that delay.
        self._longest = 2 * timeout
        quickest = float(acceleration.max(initial=1e-9))
        self._least = 4 * math.sqrt(SEEN / quickest) if math.isfinite(quickest) else BEATS
        """So long nobody has to know where it was [s]."""
        self._intervals: deque[float] = deque(maxlen=USUAL)
        self._t, self._seq, self._said = -math.inf, 0, False
        self._gaps: list[Gap] = []

    def hear(self, t: float, seq: int, *, speeds: bool) -> None:
        """Take note of a sample.

        Args:
            t: When it was so [s].
            seq: Its number: those between were heard, and a newer one took their place.
            speeds: Whether it says speeds.
        """
        if t <= self._t + SAME:
            return
        interval, said = t - self._t, speeds and self._said
        each = interval / max(seq - self._seq, 1)
        begin, self._t, self._seq, self._said = self._t, t, seq, speeds
        if not interval <= self._longest:
            self._intervals.clear()
            return
        self._intervals.append(each)
        usual = sorted(self._intervals)[len(self._intervals) // 4]
        if each >= MISSING * usual and interval >= self._least:
            self._gaps.append(Gap(self._name, begin, t, self._acceleration, said))

    def ended(self, t: float) -> tuple[Gap, ...]:
        """Times that are over at an instant [s] in which samples are missing; told once."""
        found = tuple(gap for gap in self._gaps if gap.end <= t)
        if found:
            self._gaps = [gap for gap in self._gaps if gap.end > t]
        return found
