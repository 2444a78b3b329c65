"""What a source did and undid while its packets were held back or lost: no tick of the run could see it.

A run shows the world a fixed delay ago. Packets that come later than that find the twin gone on without them,
and of those that come together, or while the run is held up, only the newest is taken. Where the others lie
between the last one that was taken in time and the newest, the twin went that way, too. Where they do not,
nobody judged what was done meanwhile.

Of packets that are lost nobody knows where they lie. Within a time T a joint whose acceleration is a at most
goes away by :math:`a T^2 / 16` at most and comes back: it speeds up for T/4, brakes and turns round for T/2,
and brakes for T/4. Where that is more than noise, nobody knows what a robot did meanwhile.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from seerob.core.samples import BodySample, JointSample, Sample, SignalSample
from seerob.workstation.source import Target

TOGETHER = 0.02
"""Samples that arrive within this time may be of one tick, of which the newest is taken [s]."""
PLACE, SPEED = 5e-3, 0.05
"""How far beyond both others a sample may be, for noise and for the curve of a motion that goes on [rad or m,
and of orientations a share of a quaternion; rad/s or m/s]. Own choice."""
FASTER = 0.9
"""Share of the time between two samples within which they arrive that were held back; others come late one by
one."""
MOST = 1024
"""Samples that are kept; of more nobody knows that they lie between."""

SILENT = 1.0
"""Longer ones are a silence, after which all begins anew [s]."""
USUAL = 32
"""Newest intervals between samples: a quarter of them are as short as usual, however many are lost."""
MISSING = 1.8
"""Times the usual interval after which a sample is missing: the next but one is due after two."""
QUICKEST = 30.0
"""No joint accelerates harder that states nothing [rad/s² or m/s²]: published stopping tables of arms come to
that."""

OF_SIGNALS = 0.05
"""As `PLACE`, of a number of a machine: a share of the largest, or `PLACE`, whatever its unit. Own choice."""

MISSED = "was something else in between that no tick has seen, and that was judged at no instant"

Said = dict[str, float | bool | str]
"""What a sample says: places [rad or m], and speeds after `RATE`; or what variables are."""
RATE = "rate of "


class HeldBack:
    """Looks at all samples of one robot, person or thing of a live source, as they arrive.

    Args:
        behind: How far a run is behind the world at least [s].
    """

    def __init__(self, behind: float) -> None:
        self._behind = behind
        self._taken: Said = {}
        """By the last sample that a run has taken."""
        self._missed: dict[str, list[float | bool | str]] = {}
        """By those since then that none may have taken: of numbers the least and the largest."""
        self._count = 0
        """Of those."""
        self._last: Said = {}
        self._t = self._arrived = -math.inf
        """When the last one was so, and when it arrived [s]; -inf where that was in time."""

    def reason(self, sample: Sample, t: float, host: float, *, waits: bool = False) -> str:
        """Why what a source did until now was not judged; empty when it was. Arguments as of `unjudged`."""
        if not self.unjudged(sample, t, host, waits=waits):
            return ""
        return "its packets were held back, and what it did meanwhile and undid was judged at no instant"

    def unjudged(self, sample: Sample, t: float, host: float, *, waits: bool) -> list[str]:
        """What of all that a source says did something until now that nobody judged.

        Args:
            sample: That arrives now.
            t: When what it says was so, on the host's clock [s].
            host: When it arrives [s].
            waits: Whether the one before was taken by nobody yet, whose place this one takes.
        """
        since = host - self._arrived
        if waits or (since <= TOGETHER and since < FASTER * (t - self._t)):
            # Before any was taken nothing is judged.
            self._miss(self._last if self._taken or not waits else {})
        else:
            self._begin()
        self._last, self._t = said_by(sample), t
        self._arrived = host if host - t > self._behind else -math.inf
        signals = isinstance(sample, SignalSample)
        beyond = (
            [*self._last] if self._count > MOST else [w for w in self._missed if self._beyond(w, signals)]
        )
        if beyond:
            self._begin()  # is said once
        return beyond

    def _begin(self) -> None:
        """The last one was taken."""
        self._taken, self._missed, self._count = self._last, {}, 0

    def _miss(self, said: Said) -> None:
        self._count += 1
        for what, value in said.items():
            known = self._missed.setdefault(what, [])
            if isinstance(value, bool | str):
                known += [] if value in known else [value]
            else:
                number = math.inf if math.isnan(value) else value  # which lies nowhere
                known[:] = [min([*known, number]), max([*known, number])]

    def _beyond(self, what: str, signals: bool) -> bool:
        """Whether any that was missed lies beyond what the last that was taken and the newest say."""
        missed = self._missed[what]
        ends = [each[what] for each in (self._taken, self._last) if what in each]
        room = SPEED if what.startswith(RATE) else PLACE
        if signals:
            sizes = (abs(x) for x in (*missed, *ends) if not isinstance(x, str))
            room = max(PLACE, OF_SIGNALS * max(filter(math.isfinite, sizes), default=0.0))
        return not ends or any(is_beyond(value, ends, room) for value in missed)


class Lost:
    """Looks at when the samples of one robot were so, as they arrive, whether some are missing.

    Args:
        target: With acceleration limits; None where nobody knows them.
    """

    def __init__(self, target: Target | None) -> None:
        quickest = max(() if target is None else target.acceleration, default=QUICKEST)
        self._unseen = 4 * math.sqrt(PLACE / quickest)
        """So long nobody has to know where it was [s]."""
        self._intervals: deque[float] = deque(maxlen=USUAL)
        self._t = -math.inf

    def reason(self, t: float) -> str:
        """Why nobody knows what it did since its last sample; empty where that is known well enough.

        Args:
            t: When what is said now was so [s].
        """
        interval, self._t = t - self._t, t
        if not interval < SILENT:
            self._intervals.clear()
            return ""
        self._intervals.append(interval)
        usual = sorted(self._intervals)[len(self._intervals) // 4]
        if interval < max(MISSING * usual, self._unseen):
            return ""
        return f"what it said for {1e3 * interval:.0f} ms is missing: nobody knows what it did and undid"


def is_beyond(value: float | bool | str, ends: Sequence[float | bool | str], room: float) -> bool:
    """Whether a value is none of others, nor a number between them or so near."""
    numbers = [x for x in (value, *ends) if not isinstance(x, bool | str)]
    if len(numbers) <= len(ends):
        return value not in ends
    first, *rest = numbers
    return not min(rest) - room <= first <= max(rest) + room


def said_by(sample: Sample) -> Said:
    """What a sample says of places and speeds, or of variables on which something may rest."""
    if isinstance(sample, SignalSample):
        return {name: value for name, value in sample.values.items() if name not in sample.doubts}
    if isinstance(sample, JointSample):
        joints: Said = {f"{j}": value for j, value in enumerate(sample.q)}
        return joints | {f"{RATE}{j}": value for j, value in enumerate(sample.qd or ())}
    found: Said = {}
    for point in sample.points if isinstance(sample, BodySample) else (sample,):
        name, turn = getattr(point, "name", ""), point.wxyz
        found |= {f"{name} {k}": x for k, x in enumerate(point.position or ())}
        if turn is not None:
            side = math.copysign(1.0, turn[0])  # both signs of a quaternion are one orientation
            found |= {f"{name} turned {k}": side * x for k, x in enumerate(turn)}
    return found
