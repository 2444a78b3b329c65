"""Whether criteria say within while a source lies: files are played and live streams heard, with each lie."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import aclosing, suppress
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import replace as changed

from seerob.core.errors import SeerobError
from seerob.core.samples import (
    BodySample,
    GrabSample,
    JointSample,
    Mailbox,
    PoseSample,
    Quality,
    Sample,
    SignalSample,
)
from seerob.criteria.criterion import Criterion
from seerob.criteria.judging import Judge
from seerob.criteria.question import declared
from seerob.devices.live.contradictions import LookedAt
from seerob.devices.live.listening import Listener, LiveSource, at_start, because
from seerob.devices.live.receivers import PATIENCE
from seerob.session.opening import source_target
from seerob.session.run import engine_of, pump, ticks
from seerob.session.station import Station, load
from seerob.testing.criteria import nobody_called, where_within
from seerob.workstation.source import Source


@dataclass(frozen=True)
class Lie:
    """One way in which a source can be wrong from an instant on."""

    what: str
    said: Callable[[Sample, float, Sample], Sample | None]
    """What it yields instead of a sample from that instant on; None for nothing. It is given that instant [s]
    and what was said last before it."""


def _numberless(sample: Sample, since: float, last: Sample) -> Sample:
    if isinstance(sample, JointSample):
        return changed(sample, q=(math.nan,) * len(sample.q))
    if isinstance(sample, PoseSample):
        return changed(sample, position=(math.nan,) * 3)
    if isinstance(sample, BodySample):
        nowhere = (math.nan,) * 3, (math.nan,) * 4
        points = [
            changed(
                point,
                position=None if point.position is None else nowhere[0],
                wxyz=None if point.wxyz is None else nowhere[1],
            )
            for point in sample.points
        ]
        return changed(sample, points=tuple(points))
    if isinstance(sample, GrabSample):
        return sample
    # What can be no number; of the rest it says nothing.
    return changed(sample, values={n: math.nan for n, v in sample.values.items() if type(v) is float})


def _again(sample: Sample, since: float, last: Sample) -> Sample | None:
    """What it said last, with new times, where speeds tell that it moves; who stands may say so."""
    if not isinstance(last, JointSample) or max(map(abs, last.qd or (0.0,))) < MOVES:
        return None
    return changed(last, seq=sample.seq, t=sample.t)


def _fails(sample: Sample, since: float, last: Sample) -> Sample:
    raise OSError("the disk is gone")


def _misshapen(sample: Sample, since: float, last: Sample) -> Sample | None:
    if isinstance(sample, JointSample):
        return changed(sample, q=sample.q[:-1], qd=None)
    return changed(sample, t=None)


LIES = (
    Lie("stops", lambda s, t, last: None),
    Lie("fails", _fails),
    Lie("says what is no number", _numberless),
    Lie("says no time", lambda s, t, last: changed(s, t=math.nan)),
    Lie("goes back in time", lambda s, t, last: changed(s, t=s.t - t)),
    Lie("says everything at one instant", lambda s, t, last: changed(s, t=t)),
    Lie("says its last sample with new times", _again),
    Lie("says an old sample in between", lambda s, t, last: last if s.seq % 2 else s),
    Lie("speaks of the future", lambda s, t, last: changed(s, t=s.t + 10.0)),
    Lie("says what has the wrong shape", _misshapen),
    Lie("calls it invalid", lambda s, t, last: changed(s, quality=Quality.INVALID)),
)


def _at_speed(sample: Sample, last: Sample, speed: float) -> Sample | None:
    """With the device's stamp of a clock that goes so fast from an instant of the host on."""
    if sample.t_device is None or last.t_device is None:
        return None
    return changed(sample, t_device=last.t_device + speed * (sample.t - last.t))


def _old_in_between(sample: Sample, since: float, last: Sample) -> Sample | None:
    """An old sample that comes now, with the stamp that it had; what has none may stand."""
    if sample.t_device is None:
        return None
    return changed(last, t=sample.t) if sample.seq % 2 else sample


def _of_another(sample: Sample, since: float, last: Sample) -> Sample:
    """Of a robot, person or variable that is not there."""
    if isinstance(sample, SignalSample):
        return changed(sample, values={"seerob.testing/another": 5.0})
    return changed(sample, target="seerob.testing/nobody")


LIVE_LIES = (
    *(lie for lie in LIES if lie.what != "says an old sample in between"),
    Lie("says an old sample in between", _old_in_between),
    Lie("comes a second late", lambda s, t, last: None if s.t_device is None else changed(s, t=s.t + 1.0)),
    Lie("has a clock of twice the speed", lambda s, t, last: _at_speed(s, last, 2.0)),
    Lie("has a clock of a fifth of the speed", lambda s, t, last: _at_speed(s, last, 0.2)),
    Lie("stamps no time", lambda s, t, last: None if s.t_device is None else changed(s, t_device=math.nan)),
    Lie("stands at its last stamp", lambda s, t, last: _at_speed(s, last, 0.0)),
    Lie("speaks of somebody else", _of_another),
)
"""Of live sources, whose samples have the host's time when they arrive, and may have the device's. How late
those are that have not, the file says (`LiveSource.delay`), and nobody can see that it is not so."""
SHOWS = 0.3
"""By when a live stream that contradicts itself shows it, beside its time-out [s]."""
LISTENS = 2.0
"""For so long a live source is listened to, and as long as it takes to be silent [s]."""
MOVES = 0.1
"""Speed of a joint that does not stand [rad/s or m/s]."""
LIES_FROM = 0.3
"""Share of a source's duration after which it lies."""


def sources_never_within(cell: Station | Path | str, *, names: Sequence[str] = ()) -> None:
    """Fail unless every criterion is within while files are played, and not once a source lies.

    Args:
        cell: A workstation, or its file or folder. Its live sources have to be there, or their emulators; of
            several live ones only that is heard which lies.
        names: Sources that lie, one after the other, by name; all of them when not given.

    Raises:
        AssertionError: With every criterion that is within where it must not be, or never.
        InputError: The workstation or a file cannot be used.
    """
    station = cell if isinstance(cell, Station) else load(cell, allow_plugins=True)
    told: list[str] = []
    asked = [source.name for source, _ in station.sources if not names or source.name in names]
    if unknown := nobody_called(names, asked, "source"):
        raise AssertionError(unknown)
    for i, (source, _) in enumerate(station.sources):
        if not names or source.name in names:
            told += (_Heard if isinstance(source, LiveSource) else _Played)(station, i).failures()
    if told:
        raise AssertionError("\n".join(dict.fromkeys(told)))


class _Played:
    """A workstation whose files are played, one source of which lies.

    Args:
        station: The workstation.
        which: Number of that source.
    """

    lies: tuple[Lie, ...] = LIES

    def __init__(self, station: Station, which: int) -> None:
        self._model, self._sources, self._which = station.model, station.sources, which
        self._findings = station.scene().findings
        source, _ = station.sources[which]
        self._name = source.name or type(source).__module__
        self._end = self._duration()
        self._since = LIES_FROM * self._end
        """Instant from which it lies [s]."""
        self._from = self._since + source.timeout + 2 * station.workstation.engine.tick
        """From which nothing may be within [s]."""
        self._bound = [one for one in station.bound if self._concerns(source, one.criterion)]

    def _duration(self) -> float:
        """How long it speaks [s]."""
        return self._sources[self._which][1].duration

    def _concerns(self, source: Source, criterion: Criterion) -> bool:
        variables = (self._model.dictionary.get(name) for name in criterion.variables())
        if any(v is not None and v.source == source.name for v in variables):
            return True
        return source.target() in declared(self._model, criterion.depends(self._model))

    def failures(self) -> list[str]:
        """What is wrong, one sentence each."""
        if not self._bound:
            return [f"{self._name}: no criterion depends on what it says: add one"]
        if self._from >= self._end:
            more = f"give more than {self._from / LIES_FROM:.3g} s, it says {self._end:.3g} s"
            return [f"{self._name}: {more}"]
        honest = self._within(None, 0.0)
        told = [
            f"{one.criterion.name}: give a motion in which it is within, as {self._name} says it"
            for one in self._bound
            if one.criterion.name not in honest and getattr(one.criterion, "limit", None) is not None
        ]
        for lie in self.lies:
            for name, (where, t) in self._within(lie, self._from).items():
                told.append(f"{name}: {where} is within at {t:.3f} s although {self._name} {lie.what}")
        return told

    def _feed(self, lie: Lie | None) -> Iterator[tuple[Sample, ...]]:
        """What is said for each tick."""
        source, opened = self._sources[self._which]
        target = source_target(self._model, source)
        sources = list(self._sources)
        if lie is not None:
            lying = LookedAt(_Lying(opened.samples, lie, self._since), self._name, target)
            sources[self._which] = source, changed(opened, samples=lying)
        return pump(sources, self._model.workstation.engine.tick)

    def _within(self, lie: Lie | None, start: float) -> dict[str, tuple[str, float]]:
        """By criterion that is within from an instant on, what of it, and when first."""
        found: dict[str, tuple[str, float]] = {}
        try:
            for out, _ in ticks(engine_of(self._model), Judge(self._bound, self._findings), self._feed(lie)):
                for result in out.results if out.t >= start else ():
                    if result.name not in found and (where := where_within(result)):
                        found[result.name] = where, out.t
        except (SeerobError, OSError):
            if lie is None:  # what ends a run is no verdict
                raise
        return found


class _Heard(_Played):
    """A workstation one live source of which was listened to, and lies."""

    lies = LIVE_LIES

    def _duration(self) -> float:
        source, _ = self._sources[self._which]
        assert isinstance(source, LiveSource)
        self._live, seconds = source, LISTENS + 2 * source.timeout
        try:
            self._said = at_start(self._listened(seconds), within=seconds + PATIENCE)
        except (OSError, EOFError, SeerobError) as error:
            raise AssertionError(f"{self._name}: {because(error)}; is it there?") from None
        self._begun = self._said[0].t
        return self._said[-1].t - self._begun

    async def _listened(self, seconds: float) -> list[Sample]:
        """What it says in so long [s], as it is yielded."""
        said: list[Sample] = []
        async with aclosing(self._live.listen(source_target(self._model, self._live))) as samples:
            async for sample in samples:
                said.append(changed(sample, seq=len(said)))
                if sample.t - said[0].t >= seconds:
                    break
        if not said:
            raise SeerobError("it says nothing")
        return said

    def failures(self) -> list[str]:
        """What is wrong, one sentence each."""
        self._from += self._live.behind() + SHOWS
        return super().failures()

    def _feed(self, lie: Lie | None) -> Iterator[tuple[Sample, ...]]:
        """What is taken at each tick: of a live source as a run hears it, by the instants of its arrivals."""
        box, tick = Mailbox(), self._model.workstation.engine.tick
        listener = Listener(self._live, source_target(self._model, self._live), box.post)
        waiting, last, since = deque(self._said), self._said[0], self._begun + self._since
        files = [pair for pair in self._sources if not isinstance(pair[0], LiveSource)]
        for k, recorded in enumerate(pump(files, tick, endless=True)):
            while waiting and waiting[0].t <= self._begun + self._live.behind() + k * tick:
                sample = waiting.popleft()
                # What fails ends a session, and a run goes on.
                with suppress(Exception):
                    if lie is None or sample.t < since:
                        last = sample
                        listener.take(sample)
                    elif (said := lie.said(sample, since, last)) is not None:
                        listener.take(said)
            yield (*recorded, *(changed(sample, t=sample.t - self._begun) for sample in box.take()))
            if not waiting:
                return


class _Lying:
    """What a source yields, and from an instant on [s] something else."""

    def __init__(self, said: Iterable[Sample], lie: Lie, since: float) -> None:
        self._said, self._lie, self._since = said, lie, since

    def __iter__(self) -> Iterator[Sample]:
        last: Sample | None = None
        for sample in self._said:
            if sample.t < self._since or last is None:
                last = sample
                yield sample
            elif (said := self._lie.said(sample, self._since, last)) is not None:
                yield said
