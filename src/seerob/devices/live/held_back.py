"""What a source did and undid while its packets, or the run, were held back: no tick was there to see it.

A run shows the world a fixed delay ago. Packets that come later than that find the twin gone on without them,
and of those that come together, or while the run is held up, only the newest is taken. Where the others lie
between the last one that was taken in time and the newest, the twin went that way, too. Where they do not,
nobody judged what was done meanwhile.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from operator import add, le, sub

from seerob.core.samples import NO_PLACE, JointSample, PoseSample, Sample

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
Layout = tuple[tuple[str, bool, bool] | int, ...]
"""What the numbers of a sample are about: numbers of joints and of their speeds, else each point's name, and
whether its place and its turn are said."""


class HeldBack:
    """Looks at all samples of one robot, person or thing of a live source, as they arrive.

    Args:
        behind: How far a run is behind the world at least [s].
    """

    def __init__(self, behind: float) -> None:
        self._behind = behind
        self._taken = _Told(None)
        """By the last sample that a run has taken."""
        self._missed: list[tuple[Layout, list[float], list[float]]] = []
        """Least and largest by those since then that none may have taken, by layout."""
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
        if together or (waits and self._taken.said[1]):
            self._miss(*self._last.said)
            self._since = min(self._since, self._host)
        elif not waits:
            self._begin()
        self._last, self._t, self._host = _Told(sample), t, host
        self._late = host if host - t > self._behind else -math.inf
        if not (together or host - self._since > HELD_UP) or not self._beyond():
            return ""
        self._begin()  # is said once
        return "its packets were held back, and what it did meanwhile and undid was judged at no instant"

    def _begin(self) -> None:
        """The last one was taken."""
        self._taken, self._missed, self._since = self._last, [], math.inf

    def _miss(self, layout: Layout, said: Sequence[float]) -> None:
        if not said:
            return
        if math.isnan(sum(said)):
            said = [math.inf if math.isnan(value) else value for value in said]  # which lies nowhere
        for k, (other, low, high) in enumerate(self._missed):
            if other == layout:
                self._missed[k] = layout, [*map(min, low, said)], [*map(max, high, said)]
                return
        self._missed.append((layout, [*said], [*said]))

    def _beyond(self) -> bool:
        """Whether any that was missed lies beyond what the last that was taken and the newest say."""
        if not self._missed:
            return False
        (layout, taken), (newest, last) = self._taken.said, self._last.said
        about, low, high = self._missed[0]
        if layout == newest == about and len(self._missed) == 1:
            # As nearly always: number by number.
            room = _rooms(layout)
            lows, highs = map(sub, map(min, taken, last), room), map(add, map(max, taken, last), room)
            return not (all(map(le, lows, low)) and all(map(le, high, highs)))
        ends = [
            dict(zip(_names(each), said, strict=True)) for each, said in ((layout, taken), (newest, last))
        ]
        missed: dict[str, tuple[float, float]] = {}
        for each, low, high in self._missed:
            for what, a, b in zip(_names(each), low, high, strict=True):
                least, most = missed.get(what, (a, b))
                missed[what] = min(least, a), max(most, b)
        return any(_lies_beyond(what, *bounds, ends) for what, bounds in missed.items())


def _lies_beyond(what: str, low: float, high: float, said: Sequence[Said]) -> bool:
    ends = [each[what] for each in said if what in each]
    room = SPEED if what.startswith(RATE) else PLACE
    return not ends or not (min(ends) - room <= low and high <= max(ends) + room)


class _Told:
    """A sample, and what it says once that is asked: of most samples nobody does.

    Args:
        sample: None before there is one.
    """

    __slots__ = ("_said", "_sample")

    def __init__(self, sample: Sample | None) -> None:
        self._sample = sample
        self._said: tuple[Layout, Sequence[float]] | None = None

    @property
    def said(self) -> tuple[Layout, Sequence[float]]:
        """What its numbers are about, and they."""
        if self._said is None:
            self._said = ((0, 0), ()) if self._sample is None else said_by(self._sample)
        return self._said


@lru_cache(8)
def _names(layout: Layout) -> tuple[str, ...]:
    """What each number is about."""
    found: list[str] = []
    for k, part in enumerate(layout):
        if isinstance(part, int):
            found += [f"{RATE * k}{j}" for j in range(part)]  # joints, then their speeds
        else:
            name, placed, turned = part
            found += [f"{name} {j}" for j in range(3 * placed)]
            found += [f"{name} turned {j}" for j in range(4 * turned)]
    return tuple(found)


@lru_cache(8)
def _rooms(layout: Layout) -> tuple[float, ...]:
    return tuple(SPEED if name.startswith(RATE) else PLACE for name in _names(layout))


def said_by(sample: Sample) -> tuple[Layout, Sequence[float]]:
    """What a sample says of places and speeds; nothing of signals and grabs, which are told one by one."""
    if isinstance(sample, JointSample):
        qd = sample.qd or ()
        return (len(sample.q), len(qd)), (*sample.q, *qd)
    if isinstance(sample, NO_PLACE):
        return (0, 0), ()
    found: list[float] = []
    layout: list[tuple[str, bool, bool]] = []
    points = (
        [("", sample.position, sample.wxyz)]
        if isinstance(sample, PoseSample)
        else [(p.name, p.position, p.wxyz) for p in sample.points]
    )
    for name, place, turn in points:
        layout.append((name, place is not None, turn is not None))
        found += place or ()
        if turn is not None:
            # Both signs of a quaternion are one orientation.
            found += turn if math.copysign(1.0, turn[0]) > 0 else [-x for x in turn]
    return tuple(layout), found
