"""What criteria say of the time between two ticks: what may have been exceeded there is not within.

At every tick the way since the last one is bounded (`seerob.twin.spans`). Where the margin that a criterion
has at both ends is more than what it can lose on the way, all of it is within, and no instant of it is looked
at. Else spans are halved, the one with the worst bound first, and the criterion is asked of the twin in the
middle, until every span is cleared, an instant is met that exceeds, or the instants are used up.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import mujoco
import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from seerob.core.errors import Undecided, UnknownName
from seerob.core.snapshot import Result, Verdict
from seerob.core.transforms import Array
from seerob.criteria.criterion import Criterion, Evaluate, Follows, Lowest, Moment
from seerob.kernels.spans import greatest, least_margins
from seerob.model.model import Model
from seerob.twin.signals import SLACK
from seerob.twin.spans import (
    AllFalls,
    Approaching,
    Fall,
    Falls,
    Gap,
    Margin,
    Path,
    Points,
    Span,
    Speeding,
    Turning,
)
from seerob.twin.state import State
from seerob.workstation.variables import VARIABLE

MOST = 32
"""Instants that are looked at between two ticks, of one criterion: spans of 10 ms are halved to less than
1 ms everywhere; more would hold up a live run."""
FEW = 8
"""Instants that are looked at between two ticks, of a criterion whose bound is a judgement of its own
(`Criterion.lowest`)."""

KEPT = 1.0
"""How long ticks are remembered while robots are heard live [s]: what is missing for longer is silence."""

_WITHIN, _EXCEEDED, _UNDECIDED = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED


@dataclass(frozen=True, eq=False)
class Watch:
    """How a criterion is judged between two ticks."""

    criterion: Criterion
    points: Points
    """Shared by all criteria of a workstation."""
    falls: Falls | None
    lowest: Lowest | None
    """Either of them."""
    remembers: bool
    """Whether it is asked in the order of time only."""
    again: Callable[[], Evaluate]
    """Makes another one of it, which is asked of instants in any order."""
    follows: Follows | None
    """What its limit follows from, when that is bounded apart."""
    within: Follows | None
    """Another one of it, which is asked of instants between ticks."""
    moves: bool
    """Whether it is about bodies."""
    people: tuple[str, ...]
    """Whose place it depends on: how well devices know that changes from tick to tick."""
    looks: int
    """Instants that are looked at between two ticks at most."""

    @property
    def plain(self) -> bool:
        """Whether it applies at all times, by a limit that is bounded with its figure, which is one."""
        own = type(self.criterion).margin is not Criterion.margin
        return self.criterion.active is None and self.follows is None and not own

    @property
    def informs(self) -> bool:
        """Whether it has no limit, and so never a verdict that the way between two ticks could take back.

        Of kinds that ship and compare one figure with the limit of the file; by its period it is asked
        earlier where nothing is known of the way, and then it has to be looked at all the same.
        """
        criterion = self.criterion
        compares = self.plain and isinstance(self.falls, Approaching | Speeding | Turning)
        ships = type(criterion).__module__.startswith("seerob.")
        return compares and ships and criterion.every is None and getattr(criterion, "limit", 0.0) is None

    @property
    def accepted(self) -> str:
        """Why the file accepts what is not known between ticks; what is known to exceed there counts."""
        return self.criterion.between_samples or "" if self.looks < MOST else ""


def watched(criterion: Criterion, model: Model, points: Points) -> Watch | None:
    """How a criterion is judged between two ticks; None when nothing bounds it."""
    falls, lowest = criterion.falls(model, points), criterion.lowest(model, points)
    if falls is None and lowest is None:
        return None
    if falls is not None and not type(criterion).__module__.startswith("seerob."):
        falls = partial(_losing, falls)
    remembers, people = criterion.remembers(model), _people(criterion, model)
    follows = criterion.follows(model, points)
    within = criterion.follows(model, points)
    again = follows.again if follows is not None else lambda: criterion.bind(model)
    looks = 0 if criterion.bounded_once(model) else MOST if lowest is None else FEW
    moves = bool(criterion.depends(model))
    return Watch(criterion, points, falls, lowest, remembers, again, follows, within, moves, people, looks)


def _losing(falls: Falls, span: Span, margin: float | Array) -> Fall:
    """What a bound of one's own says, unless a margin would grow by it."""
    said = falls(span, margin)
    if not all(np.min(each) >= 0 for each in said):
        raise ValueError(f"falls says {said}, and no margin falls by less than nothing")
    return said


def _people(criterion: Criterion, model: Model) -> tuple[str, ...]:
    found = set(criterion.depends(model))
    for name in tuple(found):
        with suppress(UnknownName):
            found |= {model.bodies[i].mover for i in model.select(name)}
    return tuple(h.name for h in model.workstation.humans if h.name in found)


class End(Struct, frozen=True, eq=False):
    """What is known of one end of a span."""

    t: float
    verdict: Verdict | None
    margin: Margin | None
    """None unless it is within."""
    speeds: Array
    """Speed of every body [m/s]."""
    idle: bool = False
    """Nothing was there to judge."""
    muted: bool = False
    """It did not apply."""
    figure: Array | None = None
    """What its limit follows from there, see `Follows`; None where nothing is, or it is not known."""


@dataclass
class Followed:
    """What a limit follows from, up to now."""

    last: Moment | None = None
    """At the last tick; None where it was not known."""
    known: Array | None = None
    """The largest at any instant at which the criterion was asked."""
    most: Array = field(default_factory=lambda: np.zeros(0))
    """A bound on it: of the way from the last tick or, where it keeps, ever."""
    open: bool = True
    """Whether nobody knows it on the way from the last tick."""


class Past(NamedTuple):
    """A tick that was judged, as long as samples before it may turn out to be missing."""

    path: Path
    ids: bytes
    """Which of MuJoCo's bodies moved each body where it began."""
    speeds: Array
    """Of every body there [m/s]."""
    ends: tuple[End | None, ...]
    """What was known of every criterion there."""
    moments: dict[Watch, Moment | None]
    """What limits followed from there."""


class Back(NamedTuple):
    """The way since before samples of robots are missing."""

    first: Past
    """The tick in which they were last heard."""
    span: Span
    """Bounds on all of it, whatever way they went."""
    known: bool
    """Whether they hold: it is remembered, and nothing was picked up or let go."""
    text: str
    """Why what has less room than these is not known to be within."""


class Asking(NamedTuple):
    """What only who asks the criteria can do."""

    now: Callable[[int], Result]
    """Asks a criterion now, before its period is over."""
    at: Callable[[int, Evaluate, State, bool], Result]
    """What another one of it says of a state, by the same rules; as if it applied, when that is wanted."""
    take_back: Callable[[Result, str], Result]
    """Makes what is within undecided, with a reason."""


class SpanResult(Struct, frozen=True, eq=False):
    """What a way between two instants came to."""

    exceeded: Result | None = None
    """At an instant between."""
    open: str = ""
    """Why it is not known; empty when all of it is within or something is exceeded."""


NOTHING = SpanResult()
"""Of a way on which all is within, or where no margin says anything."""


class BetweenTicks:
    """Judges the way from tick to tick.

    Args:
        watches: Of every criterion, None where nothing bounds it.
    """

    def __init__(self, watches: Sequence[Watch | None]) -> None:
        watches = [None if watch is None or watch.informs else watch for watch in watches]
        self._watches = watches
        self._points = next((watch.points for watch in watches if watch is not None), None)
        self._before: list[End | None] = [None] * len(watches)
        self._ids: bytes | None = None
        """Which of MuJoCo's bodies moved each body at the last tick."""
        self._speeds: Array | None = None
        self._shadow: State | None = None
        self._shadow_of: State | None = None
        """Of whom that is the twin between two ticks."""
        self._whole: Span | None = None
        """Of the way from tick to tick, which all criteria ask for."""
        self._simple = AllFalls(watch.falls for watch in watches if watch is not None)
        self._plain = [
            (i, watch.criterion.margin, watch.falls)
            for i, watch in enumerate(watches)
            if watch is not None and watch.falls in self._simple.bounds and watch.plain
        ]
        """Of criteria that `_unclear` looks at: which they are, their margins, and what bounds these."""
        self._others = sorted({*range(len(watches))} - {i for i, *_ in self._plain})
        self._falls: dict[Falls, Fall] | None = None
        """What these can lose on that way."""
        self._again: dict[int, Evaluate] = {}
        self._followed: dict[Watch, Followed] = {}
        self._past: list[Past] = []
        """Ticks that were judged lately, where robots are heard live."""
        self._failed: dict[int, str] = {}
        """Why nothing bounds a criterion any more in this run."""
        self.looks = 0
        """Instants between ticks that were looked at so far."""

    def __call__(
        self,
        state: State,
        results: Sequence[Result],
        asking: Asking,
    ) -> tuple[Result, ...]:
        """The results of a tick, each with what happened since the last one.

        Args:
            state: The twin at this tick.
            results: Of every criterion at it; one with a period may speak of an earlier instant.
            asking: See there.
        """
        found = list(results)
        if not any(self._watches):
            return tuple(found)
        speeds, ids, path = state.largest_speeds(), state.attachments.ids, state.path
        if path is None or self._ids is None:
            path, self._before, self._followed, self._past = None, [None] * len(found), {}, []
        self._way, self._asking, self._whole, self._falls = path, asking, None, None
        if path is not None:
            self._begins, self._ends = float(path.t[0]), float(path.t[-1])
            self._same = self._ids == ids.tobytes()
            self._remember(path)
        back = None
        gaps = () if path is None else path.gaps or ()
        if moved := tuple(gap for gap in gaps if not gap.name.startswith(VARIABLE)):
            back = self._back(moved, ids.tobytes(), speeds, state)
        # Whoever looks back, or failed, is looked at one by one.
        alone = back is not None or self._failed
        for i in range(len(found)) if alone else (*self._others, *self._unclear(found, state, speeds)):
            watch = self._watches[i]
            if watch is None:
                continue
            try:
                if i not in self._failed:
                    found[i] = self._one(i, watch, found[i], state, speeds)
                    if back is not None:
                        found[i] = self._look_back(i, watch, back, found[i], state)
            except Exception as error:
                # One's own bound that fails must not end a run that others are judged in.
                self._failed[i] = f"what bounds it between two ticks failed: {type(error).__name__}: {error}"
            if i in self._failed:
                found[i] = asking.take_back(found[i], self._failed[i])
        self._ids, self._speeds = ids.tobytes(), speeds
        return tuple(found)

    def _unclear(self, results: Sequence[Result], state: State, speeds: Array) -> list[int]:
        """Which criteria with one figure at each end may have lost their margin since the last tick.

        Of the others `_one` would come to nothing, and nothing else is asked of them.
        """
        left, path, ends, t = list[int](), self._way, self._before, state.t
        begin = self._begins if path is not None and self._ends == t else None
        silent = End(t, None, None, speeds)  # of all that say nothing against a limit
        for i, margin_of, falls in self._plain:
            result, before = results[i], ends[i]
            if before is None or before.t != begin or result.t is not None:
                left.append(i)
                continue
            verdict = result.verdict
            if verdict is None and before.margin is None and not (result.nothing or result.muted):
                ends[i] = silent
                continue
            margin = margin_of(result) if verdict is _WITHIN else None
            now = End(t, verdict, margin, speeds, result.nothing, result.muted)
            if verdict is not _EXCEEDED and before.verdict is not _EXCEEDED:
                last = before.margin
                if last is None or margin is None:
                    if last is not margin:
                        left.append(i)
                        continue
                else:
                    assert path is not None
                    fall = (self._falls or self._every_fall(path, (before, now), state))[falls]
                    if not _least(margin, last, fall) >= 0:
                        left.append(i)
                        continue
            ends[i] = now
        return left

    def _remember(self, path: Path) -> None:
        """Keep what is known where a tick begins, while robots are heard live."""
        if path.gaps is None:
            return
        assert self._ids is not None
        assert self._speeds is not None
        moments = {watch: told.last for watch, told in self._followed.items()}
        self._past.append(Past(path.copied(), self._ids, self._speeds, tuple(self._before), moments))
        while self._past[0].path.t[-1] < self._ends - KEPT:
            del self._past[0]

    def _back(self, gaps: tuple[Gap, ...], ids: bytes, speeds: Array, state: State) -> Back:
        """The way since before samples of robots are missing: they came another one than the twin."""
        begin = min(gap.begin for gap in gaps) + SLACK
        since = max((k for k, tick in enumerate(self._past) if tick.path.t[0] <= begin), default=0)
        past = self._past[since:]
        first, path = past[0], Path.joined([tick.path for tick in past], gaps)
        assert self._points is not None
        span = self._points.span(
            path, float(path.t[0]), self._ends, np.frombuffer(first.ids, np.int64), state.model.mj
        )
        span.between_speeds(first.speeds, speeds)
        span.foresee, span.knots = state.foresee, state.knots
        if state.speed_errors:
            span.derived(state.speed_noise(tuple(range(len(speeds)))), state.joint_noise())
        names = ", ".join(sorted({gap.name for gap in gaps}))
        text = (
            f"samples of {names} are missing from {begin:.4g} s to {max(gap.end for gap in gaps):.4g} s: not "
            "known to be within where it can have been meanwhile"
        )
        return Back(first, span, first.ids == ids and first.path.t[0] <= begin, text)

    def _look_back(self, i: int, watch: Watch, back: Back, result: Result, state: State) -> Result:
        """Take back what is within by less than robots may have done whose samples turn out to be missing."""
        before, now = back.first.ends[i], self._before[i]
        if watch.accepted or not (result.verdict is _WITHIN or result.muted or result.nothing):
            return result
        if before is None or now is None or before.verdict is _EXCEEDED or before.verdict is _UNDECIDED:
            return result  # which was said there
        idle = watch.lowest is not None and (before.idle or now.idle)
        margins = [end.margin for end in (before, now) if end.margin is not None]
        if not margins and not idle:
            return result
        low, broken = -np.inf, back.span.path.broken
        if back.known:
            with suppress(Undecided):
                low = self._lowest(watch, back.span, (before, now), back.first.moments.get(watch), state)
            falls, limit = watch.falls, result.limit
            if isinstance(falls, Speeding) and watch.criterion.at_most and limit is not None and not broken:
                # Over several ticks how fast a point gets says more than how quickly it can get faster.
                off = max(float(np.max(off)) for _, off in margins)
                low = max(low, limit - greatest(back.span.fast, falls.rows) - off)
        return result if low >= 0 else replace(self._asking.take_back(result, back.text), muted=False)

    def _lowest(
        self, watch: Watch, span: Span, ends: tuple[End, End], moment: Moment | None, state: State
    ) -> float:
        """Bound on the margin on a way of several ticks, given what is known where it begins and ends."""
        if watch.lowest is not None:
            return float(watch.lowest(state, span))
        assert watch.falls is not None
        margins = [end.margin for end in ends]
        if watch.follows is not None:
            most = None if moment is None else watch.follows.most(span, moment)
            for k, end in enumerate(ends):
                if (margin := end.margin) is not None:
                    risen = (
                        np.inf if most is None or end.figure is None else np.maximum(most - end.figure, 0.0)
                    )
                    margins[k] = margin[0] - risen, margin[1]
        one, *rest = [margin for margin in margins if margin is not None]
        fall = watch.falls(
            span, one[0] - one[1] if not rest else np.minimum(one[0] - one[1], rest[0][0] - rest[0][1])
        )
        return least_margin(one, rest[0] if rest else None, fall)

    def _one(self, i: int, watch: Watch, result: Result, state: State, speeds: Array) -> Result:
        """What a criterion says of a tick, with what happened since the last one."""
        before = self._before[i]
        switches = () if watch.criterion.active is None else self._switches(watch, before, state)
        if watch.follows is not None:
            self._follow(watch, watch.follows, state, speeds, muted=result.muted)
        if result.t is not None and result.t != state.t and before is not None:
            self._before[i] = None if switches else self._falling(watch, before, state, speeds)
            if self._before[i] is not None:
                return result
            result = self._asking.now(i)
        now = _end(watch.criterion, result, state.t, speeds)
        if watch.follows is not None:
            now = replace(now, figure=self._figure(watch, watch.follows, result, state.t))
        if before is not None:
            told = (
                self._switched(i, watch, (before, now), switches, state)
                if switches
                else self._judge(i, watch, (before, now), state)
            )
            if told.exceeded is not None:
                result = told.exceeded
            elif told.open and not watch.accepted and (now.verdict is _WITHIN or now.muted or now.idle):
                result = replace(self._asking.take_back(result, told.open), muted=False)
        self._before[i] = now
        return result

    def _follow(self, watch: Watch, follows: Follows, state: State, speeds: Array, *, muted: bool) -> None:
        """Bound what a limit follows from on the way to this tick."""
        told = self._followed.setdefault(watch, Followed())
        now: Moment | None = None
        with suppress(Undecided):
            now = None if muted and follows.keeps else follows.now(state)
        before = told.last
        told.last, told.open = now, True
        if now is None:
            return
        highest = [now.figure]
        if before is not None:
            assert self._speeds is not None
            ends = End(self._begins, None, None, self._speeds), End(state.t, None, None, speeds)
            most = self._highest(watch, follows, ends, (before, now), told, state)
            told.open = not np.isfinite(most).all()
            highest += [] if told.open else [most]
        if follows.keeps and told.most.size:
            highest.append(told.most)
        told.most = np.max(highest, axis=0)

    def _highest(
        self,
        watch: Watch,
        follows: Follows,
        ends: tuple[End, End],
        moments: tuple[Moment, Moment],
        told: Followed,
        state: State,
    ) -> Array:
        """Bound what a limit follows from between two ticks; looks at instants where that is worth it."""
        path, within = self._way, watch.within
        assert path is not None
        assert within is not None
        least = np.maximum(*(moment.figure for moment in moments))
        if follows.keeps and told.most.size:
            least = np.maximum(least, told.most)

        def bounded(a: End, b: End, at: Moment) -> tuple[float, float, End, End, Moment, Array]:
            most = follows.most(self._span(path, (a, b), state), at)
            return -float((most - least).max(initial=0.0)), a.t, a, b, at, most

        spans = [bounded(*ends, moments[0])]
        for _ in range(FEW):
            if not follows.close < -spans[0][0] < np.inf:
                break
            _, _, a, b, at, _ = heapq.heappop(spans)
            t = path.middle(a.t, b.t)
            self.looks += 1
            shadow = self.placed(path, t, state)
            try:
                moment = within.now(shadow)
            except Undecided:
                return np.full(len(least), np.inf)
            least = np.maximum(least, moment.figure)
            middle = End(t, None, None, shadow.largest_speeds())
            heapq.heappush(spans, bounded(a, middle, at))
            heapq.heappush(spans, bounded(middle, b, moment))
        return np.asarray(np.max([span[-1] for span in spans], axis=0))

    def _figure(self, watch: Watch, follows: Follows, result: Result, t: float) -> Array | None:
        """What the margin of a result that was asked now rests on."""
        told = self._followed[watch]
        if told.last is None:
            return None
        if not follows.keeps:
            return told.last.figure
        if result.value is not None and result.t in (None, t):
            now = told.last.figure
            told.known = now if told.known is None else np.maximum(told.known, now)
        return told.known

    def _left(self, watch: Watch, end: End) -> Margin | None:
        """What is left of the margin at an end, were its limit as bad as anywhere on the way."""
        if end.margin is None or watch.follows is None:
            return end.margin
        told, (margin, off) = self._followed[watch], end.margin
        if told.open or end.figure is None:
            return -np.inf, off
        return margin - np.maximum(told.most - end.figure, 0.0), off

    @staticmethod
    def _switches(watch: Watch, before: End | None, state: State) -> tuple[float, ...]:
        """When a criterion began or ceased to apply since the last tick [s]."""
        active = watch.criterion.active
        if active is None or before is None:
            return ()
        if watch.moves and active in state.signals.untimed:
            return ()  # nobody knows when: it is asked throughout
        return state.signals.switches(active, before.t, state.t)

    def _switched(
        self, i: int, watch: Watch, ends: tuple[End, End], switches: tuple[float, ...], state: State
    ) -> SpanResult:
        """The way between two ticks, of which a criterion applied in parts: each of these by itself."""
        active, path = watch.criterion.active, self._way
        assert active is not None
        assert path is not None
        before, now = ends
        opened = SpanResult()
        for begin, end in pairwise((before.t, *switches, now.t)):
            known = state.signals.at(active, begin)
            if end <= begin or (known.value is False and not known.invalid_reason):
                continue
            if watch.remembers:
                return SpanResult(open=f"{active} switched between two ticks, and what is asked remembers")
            a, b = before, now
            if begin != before.t:
                result, a, _ = self._look(i, watch, path, begin, state)
                if a.verdict is _EXCEEDED:
                    return SpanResult(exceeded=_between(result, begin))
            if end != now.t or now.muted:
                _, b, _ = self._look(i, watch, path, end, state, applies=True)
                # It does not apply there any more: what it would say is known, and is no verdict.
                b = replace(b, verdict=None)
            told = self._judge(i, watch, (a, b), state, cut=True)
            if told.exceeded is not None:
                return told
            opened = opened if opened.open else told
        return opened

    def _falling(self, watch: Watch, before: End, state: State, speeds: Array) -> End | None:
        """What is left at this tick of a margin that was not asked for; None when that is not enough."""
        path = self._way
        assert path is not None
        if not self._same:
            return None  # what was picked up has the speed of the hand at once
        if watch.lowest is not None:
            now = replace(before, t=state.t, speeds=speeds)
            some = before.margin is not None or before.idle
            return now if not some or self._low(watch, path, (before, now), state) >= 0 else None
        if any(state.hearings[person].bones for person in watch.people):
            return None  # how far devices are off now is not known from then
        if before.margin is None:
            # Where nothing was there to judge no margin says how long that holds.
            return None if before.idle else replace(before, t=state.t, speeds=speeds)
        fall = self._fall(watch, path, (before, replace(before, t=state.t, speeds=speeds)), state)
        margin, off = before.margin
        end = replace(before, t=state.t, margin=(margin - fall.fall, off), speeds=speeds)
        left = self._left(watch, end)
        assert left is not None
        return end if np.all(left[0] - left[1] >= 0) else None

    def _judge(
        self, i: int, watch: Watch, ends: tuple[End, End], state: State, *, cut: bool = False
    ) -> SpanResult:
        """The way between two instants at which a criterion was asked.

        At one of them it began or ceased to apply when it is ``cut``.
        """
        before, now = ends
        idle = watch.lowest is not None and (before.idle or now.idle)
        if before.margin is None and now.margin is None and not idle:
            return NOTHING
        if before.verdict is _EXCEEDED or now.verdict is _EXCEEDED:
            return NOTHING
        assert self._way is not None
        low = self._low(watch, self._way, ends, state)
        if low >= 0:
            return NOTHING
        if not (np.isfinite(low) or (before.margin and now.margin) or watch.lowest or cut):
            # Nothing was known at one end, which is said there, and from the other nothing follows.
            return NOTHING
        if not np.isfinite(low) and self._way.broken:
            return SpanResult(
                open=f"{', '.join(self._way.broken)} jumped: its way between two ticks is not known"
            )
        return self._search(i, watch, ends, low, state)

    def _span(self, path: Path, ends: tuple[End, End], state: State) -> Span:
        a, b = ends
        whole = a.t == self._begins and b.t == self._ends
        span = self._whole if whole else None
        if span is None:
            assert self._ids is not None
            assert self._points is not None
            ids = np.frombuffer(self._ids, np.int64)
            span = self._points.span(path, a.t, b.t, ids, state.model.mj)
            span.between_speeds(a.speeds, b.speeds)
            span.foresee, span.knots = state.foresee, state.knots
            if state.speed_errors:
                span.derived(state.speed_noise(tuple(range(len(a.speeds)))), state.joint_noise())
            self._whole = span if whole else self._whole
        return span

    def _every_fall(self, path: Path, ends: tuple[End, End], state: State) -> dict[Falls, Fall]:
        """What simple ones can lose from tick to tick."""
        self._falls = self._simple.of(self._span(path, ends, state))
        return self._falls

    def _fall(self, watch: Watch, path: Path, ends: tuple[End, End], state: State) -> Fall:
        assert watch.falls is not None
        a, b = ends
        if a.t == self._begins and b.t == self._ends and watch.falls in self._simple.bounds:
            return (self._falls or self._every_fall(path, ends, state))[watch.falls]
        span = self._span(path, ends, state)
        (m, off), *rest = [end.margin for end in ends if end.margin is not None]
        if not rest:
            return watch.falls(span, m - off)
        m, other = m - off, rest[0][0] - rest[0][1]
        return watch.falls(span, min(m, other) if type(m) is float is type(other) else np.minimum(m, other))

    def _low(self, watch: Watch, path: Path, ends: tuple[End, End], state: State) -> float:
        """Bound on the margin everywhere between two ends, of which one is within at least.

        Args:
            watch: Of the criterion.
            path: The way from tick to tick.
            ends: Of a part of it.
            state: The twin at one of them.
        """
        if watch.lowest is not None:
            if not self._same:
                return -np.inf
            try:
                return float(watch.lowest(state, self._span(path, ends, state)))
            except Undecided:
                return -np.inf
        fall = self._fall(watch, path, ends, state)
        one, other = ends[0].margin, ends[1].margin
        if watch.follows is not None:
            one, other = self._left(watch, ends[0]), self._left(watch, ends[1])
        if one is None:
            one, other = other, None
        assert one is not None
        return least_margin(one, other, fall)

    def _search(self, i: int, watch: Watch, ends: tuple[End, End], low: float, state: State) -> SpanResult:
        path = self._way
        assert path is not None
        begin, end = (f"{each.t:.4g} s" for each in ends)
        remembers = watch.remembers and watch.follows is None
        if remembers or not self._same:
            what = "it remembers" if remembers else "something was picked up or let go"
            return SpanResult(open=f"not known to be within from {begin} to {end}: {what}")
        spans = [(low, ends[0].t, *ends)]
        invalid_reason = ""
        for _ in range(watch.looks):
            if not spans:
                break
            _, _, a, b = heapq.heappop(spans)
            t = path.middle(a.t, b.t)
            result, middle, shadow = self._look(i, watch, path, t, state)
            if middle.verdict is _EXCEEDED:
                return SpanResult(exceeded=_between(result, t))
            for pair in ((a, middle), (middle, b)):
                if pair[0].margin or pair[1].margin or (watch.lowest and (pair[0].idle or pair[1].idle)):
                    low = self._low(watch, path, pair, shadow)
                    if not low >= 0:
                        heapq.heappush(spans, (low, pair[0].t, *pair))
                elif _UNDECIDED in (pair[0].verdict, pair[1].verdict):
                    invalid_reason = invalid_reason or result.reason
        if not spans and not invalid_reason:
            return NOTHING
        if not spans:
            return SpanResult(open=f"between two ticks: {invalid_reason}")
        _, _, a, b = spans[0]
        return SpanResult(open=f"not known to be within from {a.t:.4f} s to {b.t:.4f} s, between two ticks")

    def _look(
        self, i: int, watch: Watch, path: Path, t: float, state: State, *, applies: bool = False
    ) -> tuple[Result, End, State]:
        """A criterion at an instant between two ticks; what is in doubt at the tick is in doubt there."""
        self.looks += 1
        if i not in self._again:
            self._again[i] = watch.again()
        shadow = self.placed(path, t, state)
        result = self._asking.at(i, self._again[i], shadow, applies)
        end = _end(watch.criterion, result, t, shadow.largest_speeds())
        if watch.within is not None:
            with suppress(Undecided):
                end = replace(end, figure=watch.within.now(shadow).figure)
        return result, end, shadow

    def placed(self, path: Path, t: float, state: State) -> State:
        """The twin at an instant between two ticks."""
        shadow = self._shadow
        if shadow is None or self._shadow_of is not state:  # it hears what the twin of this run does
            data = mujoco.MjData(state.model.mj)
            shadow = self._shadow = State(state.model, data, state.hearings, state.signals)
            shadow.between, self._shadow_of = True, state
        shadow.attachments, shadow.columns = state.attachments, state.columns
        shadow.foresee, shadow.knots = state.foresee, state.knots
        shadow.data.qpos[:], shadow.data.qvel[:] = path.at(t)
        shadow.captured_between = path.captured_at(t)
        shadow.refresh(t)
        return shadow


def least_margin(one: Margin, other: Margin | None, lost: Fall) -> float:
    """Bound on the margin between two ends, of which one is known at least, tolerances taken off."""
    (m, off), (fall, bend) = one, lost
    if other is None:
        return float(np.min(m - fall - off))
    m_other, also = other
    if type(fall) is float is type(m) and type(m_other) is float is type(bend):
        return _least((m, off), (m_other, also), (fall, bend))
    each = [given for given in (m, off, m_other, also, bend) if isinstance(given, np.ndarray)]
    if type(fall) is float and len(each) == 5 and len({*map(len, each)}) == 1:
        return float(least_margins(each[0], each[1], each[2], each[3], fall, each[4]))
    low = np.maximum((m + m_other - fall) / 2, np.minimum(m, m_other) - bend)
    return float(np.min(low - np.maximum(off, also)))


def _least(one: tuple[Any, Any], other: tuple[Any, Any], lost: tuple[Any, Any]) -> float:
    """`least_margin` of one figure, known at both ends."""
    (m, off), (m_other, also), (fall, bend) = one, other, lost
    least: float = max((m + m_other - fall) / 2, min(m, m_other) - bend) - max(off, also)
    return least


def _end(criterion: Criterion, result: Result, t: float, speeds: Array) -> End:
    margin = criterion.margin(result) if result.verdict is _WITHIN else None
    return End(t, result.verdict, margin, speeds, result.nothing, result.muted)


def _between(result: Result, t: float) -> Result:
    """What was met at an instant between two ticks."""
    reason = f"between two ticks, at {t:.4f} s: {result.reason}".removesuffix(": ")
    return replace(result, t=t, reason=reason)
