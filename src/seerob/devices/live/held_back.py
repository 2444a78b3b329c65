"""What a source did and undid while its packets, or the run, were held back: no tick was there to see it.

A run shows the world a fixed delay ago. Packets that come later than that find the twin gone on without them,
and of those that come together, or while the run is held up, only the newest is taken. Where the others lie
between the last one that was taken in time and the newest, the twin went that way, too. Where they do not,
nobody judged what was done meanwhile.
"""

from __future__ import annotations

import math
from functools import cache, cached_property

from seerob.core.samples import NO_PLACE, BodySample, JointSample, Sample

TOGETHER = 0.02
"""Samples that arrive within this time may be of one tick, of which the newest is taken [s]."""
PLACE, SPEED = 5e-3, 0.05
"""How far beyond both others a sample may be, for noise and for the curve of a motion that goes on [rad or m,
and of orientations a share of a quaternion; rad/s or m/s]. Own choice."""
FASTER = 0.9
"""Share of the time between two samples within which they arrive that were held back; others come late one by
one."""
HELD_UP = 0.05
"""A run that took nothing for longer is held up [s]: of several samples within a tick the newest speaks."""

Said = dict[str, float]
"""What a sample says, by what it is about: places [rad or m], and speeds after `RATE`."""
RATE = "rate of "


class HeldBack:
    """Looks at all samples of one robot, person or thing of a live source, as they arrive.

    Args:
        behind: How far a run is behind the world at least [s].
    """

    def __init__(self, behind: float) -> None:
        self._behind = behind
        self._taken = _Told(None)
        """By the last sample that a run has taken."""
        self._missed: dict[str, tuple[float, float]] = {}
        """Least and largest by those since then that none may have taken."""
        self._since = math.inf
        """When the first of those arrived [s]."""
        self._last = _Told(None)
        self._t = self._host = -math.inf
        """When the last one was so, and when it arrived [s]."""
        self._late = -math.inf
        """When it arrived, if that was too late [s]; -inf where that was in time."""

    def reason(self, sample: Sample, t: float, host: float, *, waits: bool = False) -> str:
        """Why what a source did until now was not judged; empty when it was.

        Args:
            sample: That arrives now.
            t: When what it says was so, on the host's clock [s].
            host: When it arrives [s].
            waits: Whether the one before was taken by nobody yet, whose place this one takes.
        """
        since = host - self._late
        together = since <= TOGETHER and since < FASTER * (t - self._t)
        # Before any was taken nothing is judged.
        if together or (waits and self._taken.said):
            self._miss(self._last.said)
            self._since = min(self._since, self._host)
        elif not waits:
            self._begin()
        self._last, self._t, self._host = _Told(sample), t, host
        self._late = host if host - t > self._behind else -math.inf
        if not (together or host - self._since > HELD_UP) or not any(map(self._beyond, self._missed)):
            return ""
        self._begin()  # is said once
        return "its packets were held back, and what it did meanwhile and undid was judged at no instant"

    def _begin(self) -> None:
        """The last one was taken."""
        self._taken, self._missed, self._since = self._last, {}, math.inf

    def _miss(self, said: Said) -> None:
        for what, value in said.items():
            number = math.inf if math.isnan(value) else value  # which lies nowhere
            low, high = self._missed.get(what, (number, number))
            self._missed[what] = min(low, number), max(high, number)

    def _beyond(self, what: str) -> bool:
        """Whether any that was missed lies beyond what the last that was taken and the newest say."""
        low, high = self._missed[what]
        ends = [each.said[what] for each in (self._taken, self._last) if what in each.said]
        room = SPEED if what.startswith(RATE) else PLACE
        return not ends or not (min(ends) - room <= low and high <= max(ends) + room)


class _Told:
    """A sample, and what it says once that is asked: of most samples nobody does.

    Args:
        sample: None before there is one.
    """

    def __init__(self, sample: Sample | None) -> None:
        self._sample = sample

    @cached_property
    def said(self) -> Said:
        """By what it is about."""
        return {} if self._sample is None else said_by(self._sample)


@cache
def _names(joints: int) -> tuple[str, ...]:
    return tuple(map(str, range(joints)))


@cache
def _rates(joints: int) -> tuple[str, ...]:
    return tuple(f"{RATE}{j}" for j in range(joints))


def said_by(sample: Sample) -> Said:
    """What a sample says of places and speeds; nothing of signals and grabs, which are told one by one."""
    if isinstance(sample, NO_PLACE):
        return {}
    if isinstance(sample, JointSample):
        found = dict(zip(_names(len(sample.q)), sample.q, strict=True))
        qd = sample.qd or ()
        return found | dict(zip(_rates(len(qd)), qd, strict=True))
    found = {}
    for point in sample.points if isinstance(sample, BodySample) else (sample,):
        name, turn = getattr(point, "name", ""), point.wxyz
        found |= {f"{name} {k}": x for k, x in enumerate(point.position or ())}
        if turn is not None:
            side = math.copysign(1.0, turn[0])  # both signs of a quaternion are one orientation
            found |= {f"{name} turned {k}": side * x for k, x in enumerate(turn)}
    return found
