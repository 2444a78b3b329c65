"""Static and repeated work: found joint by joint while it happens, or in recorded scores of postures.

Causal: what is said at an instant depends on nothing after it, so that live and replayed runs agree.
A joint is *held* while its angle stays within a band of twice the tolerance, short absences apart; a
*movement* is a rise of more than a stated amplitude after a fall of as much, or the reverse. Both figures
are choices: the methods ask "held longer than" and "repeated more than … per minute" of an observer. Of
recorded scores a posture is static while they stay, and a joint repeats when its score rises into a higher
band.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from msgspec import Struct
from numpy.typing import ArrayLike, NDArray

from seerob.core.domains import agree, number
from seerob.core.transforms import Array
from seerob.criteria.scoring.spans import Angle, Ints, Span, between
from seerob.description.humans.angles import SIDED, Angles

GAP = 1.0
"""A posture that is left for less [s] was not left."""
WINDOW = 60.0
"""Over which repetitions are counted [s]."""
QUICK = 0.4
"""Nobody moves a joint to and fro by what is counted in less [s]; a choice."""
_ROUNDING = 1e-9
"""Instants [s] and angles [rad] that differ by less are the same."""


def static(t: ArrayLike, scores: ArrayLike, hold: float, *, gap: float = GAP) -> NDArray[np.bool_]:
    """Whether each instant belongs to a posture that is held long enough.

    Args:
        t: Instants, increasing, shape (n,) [s]; scores hold until the next one.
        scores: Component scores, shape (n, k) or (n,).
        hold: How long is static [s]: 60 in RULA and REBA, `rula.Profile.static`.
        gap: Interruptions that are shorter do not count [s].

    Returns:
        Shape (n,); the interruptions within a held posture belong to it.
    """
    instants, vectors = _increasing(t), number("a score", scores)
    agree(n=(len(instants), len(vectors)))
    number("hold", hold, 0, unit="s")
    number("gap", gap, 0, unit="s")
    found = np.zeros(len(instants), bool)
    if len(instants) < 2:
        return found
    ends = np.append(instants[1:], instants[-1])
    _, kinds = np.unique(vectors.reshape(len(vectors), -1), axis=0, return_inverse=True)
    for kind in range(int(kinds.max()) + 1):
        at = np.flatnonzero(kinds.ravel() == kind)
        # A stretch ends where the posture is away for at least the gap.
        away = instants[at[1:]] - ends[at[:-1]]
        for stretch in np.split(at, np.flatnonzero(away >= gap - _ROUNDING) + 1):
            if ends[stretch[-1]] - instants[stretch[0]] >= hold - _ROUNDING:
                found[stretch[0] : stretch[-1] + 1] = True
    return found


def repetitions(t: ArrayLike, scores: ArrayLike, *, window: float = WINDOW) -> Ints:
    """How often a score rose within the last ``window``, at each instant.

    Args:
        t: Instants, increasing, shape (n,) [s].
        scores: Of one component, shape (n,).
        window: [s]

    Returns:
        Counts, shape (n,); 4 or more per minute is repeated work in RULA's worksheet, more than 4 in REBA.
    """
    instants, values = _increasing(t), number("a score", scores)
    agree(n=(*instants.shape, *values.shape))
    number("window", window, 0, unit="s")
    rises = instants[1:][np.diff(values) > 0]
    first = np.searchsorted(rises, instants - window + _ROUNDING, side="right")
    return np.asarray(np.searchsorted(rises, instants, side="right") - first)


def _increasing(t: ArrayLike) -> Array:
    instants = number("an instant", t, unit="s")
    if (np.diff(instants) <= 0).any():
        raise ValueError("instants do not increase")
    return instants


SAMPLE = 0.05
"""Angles are looked at no more often than this [s]."""
PARTS: dict[str, tuple[str, ...]] = {
    "upper arm": ("shoulder_flexion", "shoulder_abduction"),
    "lower arm": ("elbow_flexion", "forearm_rotation"),
    "wrist": ("wrist_flexion", "wrist_deviation"),
    "neck": ("neck_flexion", "neck_side_bend", "neck_twist"),
    "trunk": ("trunk_flexion", "trunk_side_bend", "trunk_twist"),
    "legs": ("knee_flexion",),
}
"""Part of the body → angles that are watched."""
ARMS = ("upper arm", "lower arm", "wrist")
BODY = ("neck", "trunk", "legs")


class WorkDetection(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Static and repeated work is found in the movement, where no phase enters it."""

    tolerance: Angle = math.radians(5)
    """A joint that stays within this on either side is held [rad]; a choice."""
    movement: Angle = math.radians(10)
    """A movement to and fro of more than this is counted [rad]; a choice."""
    from_rest: bool = False
    """The work begins with the run. If not, what was before is unknown and the first minute undecided."""


class Hold:
    """How long one angle has been held.

    Args:
        tolerance: Half the width of the band [rad].
        window: How far back it looks [s].
        gap: Absences that are shorter do not count [s].
    """

    def __init__(self, tolerance: float, window: float, gap: float = GAP) -> None:
        self._width, self._window, self._gap = 2 * tolerance + _ROUNDING, window, gap
        self._t: deque[float] = deque()
        self._low: deque[tuple[float, float]] = deque()
        self._high: deque[tuple[float, float]] = deque()
        self._away: list[tuple[float, float]] = []
        self.since = math.nan
        """Since when [s]; nan when nothing is known."""

    def add(self, t: float, angle: float) -> None:
        """The angle [rad] at an instant [s] after the one before."""
        if self._t and self._spread(angle) > self._width:
            self._away.append((t, angle))
            if t - self._away[0][0] < self._gap - _ROUNDING:
                return
            for sample in self._away:
                self._push(*sample)
        else:
            self._push(t, angle)
        self._away.clear()

    def _spread(self, angle: float) -> float:
        return max(self._high[0][1], angle) - min(self._low[0][1], angle)

    def _push(self, t: float, angle: float) -> None:
        if math.isnan(self.since):
            self.since = t
        self._t.append(t)
        while self._low and self._low[-1][1] >= angle:
            self._low.pop()
        while self._high and self._high[-1][1] <= angle:
            self._high.pop()
        self._low.append((t, angle))
        self._high.append((t, angle))
        while self._high[0][1] - self._low[0][1] > self._width:
            oldest = min(self._low, self._high, key=lambda ends: ends[0][0])
            self._forget(oldest.popleft()[0])
            self.since = self._t[0]
        while self._t[0] < t - self._window - _ROUNDING:
            self._forget(self._t[0])

    def _forget(self, until: float) -> None:
        for ends in (self._low, self._high):
            while ends and ends[0][0] <= until:
                ends.popleft()
        while self._t and self._t[0] <= until:
            self._t.popleft()


class Moves:
    """How often one angle moved to and fro by an amplitude within the last minute.

    Rises and falls are counted apart and the larger number counts: a trunk that turns to the left and back
    moves as often as one that turns to the right.

    Args:
        amplitude: [rad]
        window: [s]
    """

    def __init__(self, amplitude: float, window: float = WINDOW) -> None:
        self._amplitude, self._window = max(amplitude, _ROUNDING), window
        self._low = self._high = math.nan
        self._going = 0
        """1 since a rise, -1 since a fall, 0 before the first of either."""
        self._turns: dict[int, deque[float]] = {1: deque(), -1: deque()}

    def add(self, t: float, angle: float) -> None:
        """The angle [rad] at an instant [s] after the one before."""
        if math.isnan(self._low):
            self._low = self._high = angle
        self._low, self._high = min(self._low, angle), max(self._high, angle)
        for way, passed in ((1, angle - self._low), (-1, self._high - angle)):
            if self._going != way and passed >= self._amplitude - _ROUNDING:
                self._going, self._low, self._high = way, angle, angle
                self._turns[way].append(t)
                break
        for turns in self._turns.values():
            while turns and turns[0] <= t - self._window + _ROUNDING:
                turns.popleft()

    @property
    def count(self) -> int:
        """Within the window that ended with the last sample."""
        return max(map(len, self._turns.values()))


class Hidden:
    """How many events may have happened between two looks within the last minute.

    Args:
        least: Time that one takes [s]; between looks that follow faster there is none.
        window: [s]
    """

    def __init__(self, least: float, window: float = WINDOW) -> None:
        self._least, self._window = least, window
        self._gaps: deque[tuple[float, int]] = deque()

    def add(self, t: float, gap: float) -> None:
        """A look at an instant [s], so long after the one before [s]."""
        self.at(t)
        if many := int((gap + _ROUNDING) / self._least):
            self._gaps.append((t, many))

    def at(self, t: float) -> int:
        """Within the window that ends at an instant [s]."""
        while self._gaps and self._gaps[0][0] <= t - self._window + _ROUNDING:
            self._gaps.popleft()
        return sum(many for _, many in self._gaps)


class FoundWork(NamedTuple):
    """What is known of one part of the body: 0 or 1, or both when it cannot be known yet."""

    static: Span
    repeated: Span


class WorkMonitor:
    """Every part of a body over time.

    Args:
        detection: Tolerances.
        hold: How long is static [s].
        count: How many movements per minute are repeated work.
    """

    def __init__(self, detection: WorkDetection, *, hold: float, count: int) -> None:
        self._detection, self._hold, self._count = detection, hold, count
        self._t = -math.inf
        self.begin()

    def begin(self) -> None:
        """Forget everything."""
        self._start = math.nan
        self._holds: dict[tuple[str, int], Hold] = {}
        self._moves: dict[tuple[str, int], Moves] = {}
        self._since: dict[tuple[str, int], float] = {}
        """Since when each angle is seen without a gap [s]."""
        self._known_before = dict.fromkeys(_keys(), self._detection.from_rest)
        """Whether nothing was held or repeated before."""
        self._seen: dict[tuple[str, int], float] = {}
        self._hidden = {key: Hidden(QUICK) for key in _keys()}

    def add(self, t: float, angles: Angles) -> None:
        """The posture at an instant [s]; an earlier one than before begins anew, the same adds nothing."""
        if t < self._t - _ROUNDING:
            self._t = -math.inf
            self.begin()
        if t < self._t + SAMPLE - _ROUNDING:
            return
        if math.isfinite(self._t) and t - self._t > GAP + SAMPLE:
            # What happened in a silence is not known, so neither is what was before.
            self.begin()
            self._known_before = dict.fromkeys(_keys(), False)
        self._t = t
        if math.isnan(self._start):
            self._start = t
        for name, side in _keys():
            value = getattr(angles, name)
            angle = float(value[side] if name in SIDED else value)
            if not math.isnan(angle):
                self._begin_again(t, name, side)
                self._hidden[name, side].add(t, t - self._seen.get((name, side), t))
                self._seen[name, side] = t
                self._holds[name, side].add(t, angle)
                self._moves[name, side].add(t, angle)

    def _begin_again(self, t: float, name: str, side: int) -> None:
        """Forget an angle that nobody saw for a while, as all are forgotten in a silence."""
        key = (name, side)
        unseen = t - self._seen.get(key, self._start) > GAP + SAMPLE
        if key not in self._since or unseen:
            self._holds[key] = Hold(self._detection.tolerance, self._hold)
            self._moves[key] = Moves(self._detection.movement)
            self._since[key] = t if unseen else self._start
            self._known_before[key] = self._known_before[key] and not unseen

    def part(self, part: str, side: int) -> FoundWork:
        """What is known of a part of the body on a side, 0 right and 1 left."""
        keys = [(name, side if name in SIDED else 0) for name in PARTS[part]]
        return FoundWork(_every(map(self._static, keys)), _any(map(self._repeated, keys)))

    def parts(self, part: str) -> tuple[FoundWork, ...]:
        """Of one side after the other; of the body's middle once."""
        sided = PARTS[part][0] in SIDED
        return tuple(self.part(part, side) for side in range(2 if sided else 1))

    def _static(self, key: tuple[str, int]) -> Span:
        if key not in self._seen or self._t - self._seen[key] > GAP:
            return between(0, 1)
        since = self._holds[key].since
        if self._t - since >= self._hold - _ROUNDING:
            return between(1, 1)
        whole = since <= self._since[key] + _ROUNDING
        return between(0, 1) if whole and not self._known_before[key] else between(0, 0)

    def _repeated(self, key: tuple[str, int]) -> Span:
        if key not in self._seen or self._t - self._seen[key] > GAP:
            return between(0, 1)
        count = self._moves[key].count
        if count >= self._count:
            return between(1, 1)
        if count + self._hidden[key].at(self._t) >= self._count:
            return between(0, 1)
        short = self._t - self._since[key] < WINDOW - _ROUNDING
        return between(0, 1) if short and not self._known_before[key] else between(0, 0)


def muscle_use(watch: WorkMonitor) -> tuple[Span, Span]:
    """RULA: of the arms, shape (2,), and of the body. Static when every part is held, or any is repeated."""
    arms = [_mainly([watch.part(part, side) for part in ARMS]) for side in range(2)]
    body = _mainly([found for part in BODY for found in watch.parts(part)])
    return between([a.low for a in arms], [a.high for a in arms]), body


def activity(watch: WorkMonitor, *, walking: bool) -> tuple[Span, Span]:
    """REBA: any part held, and any part repeated, walking apart."""
    found = [each for part in PARTS for each in watch.parts(part)]
    moving = [each for part in PARTS if not (walking and part == "legs") for each in watch.parts(part)]
    return _any(f.static for f in found), _any(f.repeated for f in moving)


def _mainly(found: list[FoundWork]) -> Span:
    return _any([_every(f.static for f in found), *(f.repeated for f in found)])


def _every(spans: Iterable[Span]) -> Span:
    every = list(spans)
    return between(min(int(s.low) for s in every), min(int(s.high) for s in every))


def _any(spans: Iterable[Span]) -> Span:
    every = list(spans)
    return between(max(int(s.low) for s in every), max(int(s.high) for s in every))


def _keys() -> Iterable[tuple[str, int]]:
    for names in PARTS.values():
        for name in names:
            yield from ((name, side) for side in range(2 if name in SIDED else 1))
