"""The main path: pump samples in, move the twin, judge it, write it out; once per tick.

Live, replayed and as-fast-as-possible runs are this same loop with another clock.
"""

from __future__ import annotations

import functools
import gc
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from itertools import count
from typing import TYPE_CHECKING

from seerob.core.errors import InputError, Problem, SeerobError, ended_by
from seerob.core.samples import Sample, printable_sample
from seerob.core.snapshot import Result, Scene, Snapshot, SourceLine, Verdict
from seerob.criteria.between_ticks import watched
from seerob.criteria.judging import Judge as Judge  # noqa: PLC0414
from seerob.criteria.judging import undecided
from seerob.criteria.question import Bound as Bound  # noqa: PLC0414
from seerob.criteria.question import bound_to
from seerob.description.capture.fitting import Fitter
from seerob.devices.live.listening import LiveSource, delay_of
from seerob.devices.live.receivers import Clock
from seerob.model.model import Model
from seerob.outputs.notebook import plotted, results_html
from seerob.outputs.sink import BeginsAtEnd, KeepsResults, Sends, Writer
from seerob.recording.frames import criterion_series
from seerob.recording.result_log import ResultLog
from seerob.session.huge_pages import use_huge_pages
from seerob.session.opening import coarse, gappy, signal_timeouts, untimed
from seerob.session.scene import Looks, camera_of, invalid_reasons, landmark_of
from seerob.twin import controller_check
from seerob.twin.engine import Engine, last_tick
from seerob.twin.spans import Points
from seerob.twin.state import State
from seerob.workstation.source import Opened, Pump, Source

if TYPE_CHECKING:
    from anywidget import AnyWidget
    from matplotlib.figure import Figure

    from seerob.outputs.film import Film

Feed = Iterator[tuple[Sample, ...]]
"""For each tick, from t = 0 on, the samples that were heard for it; ends when the run does."""


# -- before the run -----------------------------------------------------------------------------


def bind(model: Model) -> tuple[Bound, ...]:
    """Bind every criterion and rule of the workstation.

    Raises:
        InputError: With every name that does not exist and every option that cannot be.
    """
    bound: list[Bound] = []
    points = Points(model)
    problems: list[Problem] = []
    file = next(iter(model.workstation.files), "workstation")
    for i, display in enumerate(model.workstation.displays):
        try:
            model.select(display.of)
        except SeerobError as error:
            problems.append(Problem(file, f"displays[{i}].of", str(error)))
    for i, landmark in enumerate(model.workstation.landmarks):
        try:
            landmark_of(model, landmark)
        except SeerobError as error:
            problems.append(Problem(file, f"landmarks[{i}].on", str(error)))
    for i, camera in enumerate(model.workstation.cameras):
        try:
            camera_of(model, camera)
        except SeerobError as error:
            problems.append(Problem(file, f"cameras[{i}].calibration", str(error)))
    for group in ("safety", "ergonomics"):
        for i, criterion in enumerate(getattr(model.workstation, group)):
            try:
                one = replace(bound_to(model, criterion, group), watch=watched(criterion, model, points))
                if one.closed is not None and model.closed is not None:
                    closed = replace(one.closed, watch=watched(criterion, model.closed, points))
                    one = replace(one, closed=closed)
                bound.append(one)
            except SeerobError as error:
                # Many messages begin with the name of the criterion, which the key already says.
                text = str(error).removeprefix(f"{criterion.name}: ")
                problems.append(Problem(file, f"{group}[{i}] ({criterion.name})", text))
    named: set[str] = set()
    for one in bound:
        name = one.criterion.name
        if name in named:
            # What is said under one name is one criterion to whoever keeps results.
            what = f"two criteria are called {name!r}" if name else "two criteria have no name"
            problems.append(Problem(file, one.group, f"{what}: give each a name of its own"))
        named.add(name)
    if problems:
        raise InputError(problems)
    return tuple(bound)


# -- feeds: what is heard for each tick ---------------------------------------------------------


def looks_ahead(model: Model) -> Mapping[str, float]:
    """Name of a robot or person → how far ahead criteria ask what its recorded motion does [s]."""
    found: dict[str, float] = {}
    for criterion in (*model.workstation.safety, *model.workstation.ergonomics):
        for name, span in criterion.looks_ahead(model).items():
            found[name] = max(span, found.get(name, 0.0))
    return found


def ends_at(opened: Sequence[tuple[Source, Opened]]) -> float:
    """When the last of some recorded sources ends [s]."""
    return max((one.duration for _, one in opened), default=0.0)


def pump(
    opened: Sequence[tuple[Source, Opened]],
    period: float,
    *,
    endless: bool = False,
    ahead: Mapping[str, float] | None = None,
) -> Feed:
    """Samples of recorded sources as run time passes; of some targets so much ahead [s].

    The last tick ends with the last sample of the last source (`last_tick`): who steps the twin has to be
    told that instant, `ends_at`. A source that loops does not keep a run going on its own unless
    ``endless``. Without sources there is one tick.
    """
    pumps = [
        (Pump(o, loop=source.loop, pause=source.loop_pause), (ahead or {}).get(source.target(), 0.0))
        for source, o in opened
    ]
    end = ends_at(opened)
    last = last_tick(end, period)
    k = 0
    while endless or k <= last:
        # Every sample, not only the newest: the run starts on the first one, and a source that is
        # faster than the ticks is followed exactly. One ahead, so that references reach to the tick's end.
        t = k * period if endless or k < last else max(end, k * period)
        yield tuple(sample for each, more in pumps for sample in each.until(t + more))
        k += 1


# -- the loop -----------------------------------------------------------------------------------


class Lateness:
    """How late live sources are heard, by what they drive, and how late they may be [s].

    Args:
        model: The compiled workstation.
    """

    def __init__(self, model: Model) -> None:
        live = [s for s in model.workstation.sources if isinstance(s, LiveSource) and s.target()]
        self._drives = {source.name: (source.target(), source.timeout) for source in live}
        self._late: dict[str, float] = {}

    def take(self, samples: Sequence[Sample]) -> dict[str, tuple[float, float]]:
        """The latest of each; of several devices of one person the worst."""
        for sample in samples if self._drives else ():
            if sample.t_device is not None and sample.source in self._drives:
                self._late[sample.source] = sample.late
        found: dict[str, tuple[float, float]] = {}
        for source, late in self._late.items():
            target, bound = self._drives[source]
            found[target] = max((late, bound), found.get(target, (late, bound)))
        return found


def snapshot(
    state: State,
    seq: int,
    results: tuple[Result, ...],
    looks: Looks | None = None,
    late: dict[str, tuple[float, float]] | None = None,
    sources: dict[str, SourceLine] | None = None,
) -> Snapshot:
    """What goes out of a state."""
    hearings = state.hearings
    return Snapshot(
        seq=seq,
        t=state.t,
        poses=state.poses(),
        joints=state.joints(),
        tracking={name: hearing.error for name, hearing in hearings.items()},
        bones={name: hearing.bones for name, hearing in hearings.items() if hearing.bones},
        late=late or {},
        results=results,
        looks={} if looks is None else looks.at(state),
        doubts=invalid_reasons(state),
        sources=sources or {},
        events=state.events,
    )


def warm_up(model: Model) -> None:
    """Ask every criterion once, of the twin at home, and forget it.

    What is compiled or loaded at first use would else make the first tick of a live run late.
    """
    engine = Engine(model, controllers=False)
    judge = Judge(bind(model))
    judge(engine.start())
    judge(engine.tick())
    Engine(model).tick()
    for source in model.workstation.sources:
        controller_check.try_out(model, source.target())
        if source.target() in {human.name for human in model.workstation.humans}:
            Fitter(model.human(source.target()).description)


def engine_of(model: Model, state: type[State] = State, *, contacts: bool = True) -> Engine:
    """The twin as the workstation's sources drive it; ``state`` and ``contacts`` as of `Engine`."""
    # What is shown is a delay old: silence shows that much earlier, so that it shows within the time-out.
    delay = delay_of(model.workstation.sources)
    driven: dict[str, float] = {}
    for source in model.workstation.sources:
        if source.target():
            timeout = source.timeout - (delay if isinstance(source, LiveSource) else 0.0)
            # Devices that complement one another may fall silent one by one.
            driven[source.target()] = max(timeout, driven.get(source.target(), timeout))
    listened = [s for s in model.workstation.sources if isinstance(s, LiveSource)]
    live = {s.target() for s in listened}
    signals, following = signal_timeouts(model)
    return Engine(
        model,
        driven={**following, **driven},
        live={*live, *following},
        complete={s.target() for s in listened if s.tells_changes},
        signals=signals,
        untimed=untimed(model),
        gappy=gappy(model),
        coarse=coarse(model),
        contacts=contacts,
        state=state,
    )


Lines = Callable[[], dict[str, SourceLine]]
"""How live sources are heard, by name."""
LINES_EVERY = 1.0
"""Run time between two tellings of that [s]."""
LINES_STAND = 0.1
"""Every tick of so long says it [s]: a page is not sent each."""


def ticks(
    engine: Engine,
    judge: Callable[[State], tuple[Result, ...]],
    feed: Feed,
    end: float = math.inf,
    lines: Lines = dict,
) -> Iterator[tuple[Snapshot, tuple[Sample, ...]]]:
    """The road: for each tick what goes out, and the samples it was made from; ``end`` of `Engine` [s]."""
    engine.end, told, now = end, -math.inf, dict[str, SourceLine]()
    looks, lateness = Looks(engine.model), Lateness(engine.model)
    for seq, heard in enumerate(feed):
        samples = tuple(map(printable_sample, heard))
        engine.take(samples)
        late = lateness.take(samples)
        state = engine.tick() if seq else engine.start()
        if state.t >= told + LINES_EVERY:
            now, told = lines(), state.t
        shown = now if state.t < told + LINES_STAND else None
        yield snapshot(state, seq, judge(state), looks, late, shown), samples


def no_greener(
    judge: Callable[[State], tuple[Result, ...]], before: Iterable[Snapshot], by: str
) -> Callable[[State], tuple[Result, ...]]:
    """A judge that calls nothing within that was not when the same samples were judged before.

    Another version may know better or worse, and nothing here tells which.

    Args:
        judge: Asked at each tick in turn.
        before: What was said then; ticks may be missing.
        by: Who said it.
    """
    ticks, earlier = count(), iter(before)
    then = next(earlier, None)

    def judged(state: State) -> tuple[Result, ...]:
        nonlocal then
        seq, results = next(ticks), judge(state)
        while then is not None and then.seq < seq:
            then = next(earlier, None)
        if then is None or then.seq > seq:
            return results
        others = {r.name: r for r in then.results if r.verdict in (Verdict.UNDECIDED, Verdict.EXCEEDED)}
        return tuple(
            undecided(now, f"{by} said {others[now.name].verdict} of the same samples")
            if now.verdict is Verdict.WITHIN and now.name in others
            else now
            for now in results
        )

    return judged


@functools.cache
def _spared() -> bool:
    """Whether the collector is spared what was there before the first loop: counting it takes 20 ms."""
    return gc.get_freeze_count() > 0


LONG = 10.0
"""Motion that is worth the tenth of a second that larger pages take [s]: some 800 ticks of
``benchmarks/everything.py`` save as much."""


@contextmanager
def settled() -> Iterator[None]:
    """Spare the garbage collector what was made before the loop: it all lives as long as the loop does.

    Who has done so already, around many loops, is left to it: it took longer than short loops do.
    """
    if _spared() or gc.get_freeze_count():
        yield
        return
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


@dataclass(frozen=True, repr=False)
class Summary:
    """What a run came to."""

    results: ResultLog
    scene: Scene
    ticks: int
    duration: float
    """Run time [s]."""
    wall: float
    """Time it took [s]."""
    slipped: float
    """Real time that was lost in a live run [s]."""
    late: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Per robot and human that a live source drives: by how much samples came too late at worst, and how late
    they may come [s]."""
    sources: Mapping[str, SourceLine] = field(default_factory=dict)
    """How live sources were heard, and targets sent, by name."""
    again: Callable[[], Film] | None = field(default=None, compare=False)
    """Runs the same samples once more, for what `show` shows; None of a run that cannot be had again."""

    def __getstate__(self) -> dict[str, object]:
        """All but the way to run it again, which is of this process."""
        return {**self.__dict__, "again": None}

    @property
    def verdict(self) -> Verdict | None:
        """Verdict of the whole run."""
        return self.results.verdict

    def __repr__(self) -> str:
        verdict = "no verdict" if self.verdict is None else self.verdict.value
        of = f"{len(self.results)} criteria, {self.ticks} ticks, {self.duration:g} s"
        return f"<Summary {self.scene.title!r}: {verdict}, {of}>"

    def _repr_html_(self) -> str:
        return results_html(self.results)

    def show(self, *, height: int = 480) -> AnyWidget:
        """Show the run in a notebook: the page's scene, with a slider, offline.

        The same samples are run once more, and frames of that are kept, 25 a second of a run of two minutes.

        Args:
            height: Of the scene [px].

        Raises:
            MissingPackage: anywidget is not installed (extra ``notebook``).
            InputError: It was a live run, of which its recording is shown, or comes from another process.
        """
        if self.again is None:
            what = "was live, or comes from another process, and cannot be had again"
            raise InputError.at("run", "show", what, "sr.load_recorded(recording).show() shows a recording")
        word = "no verdict" if self.verdict is None else self.verdict.value
        return self.again().widget(height=height, verdict=f"the run: {word}")

    def plot(self, *criteria: str) -> Figure:
        """Plot criteria over time: figure, limit, and where it is exceeded, undecided or not asked.

        Args:
            criteria: Their names, in the order wanted; all of them when not given.

        Returns:
            One axis each [criterion's unit over s]; a notebook shows it, ``savefig`` writes it.

        Raises:
            UnknownName: There is none of that name.
            MissingPackage: matplotlib is not installed (extra ``data``).
        """
        return plotted([criterion_series(self.results[name]) for name in criteria or self.results])


def run(
    model: Model,
    feed: Feed,
    *,
    bound: Sequence[Bound],
    scene: Scene,
    before: tuple[Iterable[Snapshot], str] | None = None,
    end: float = math.inf,
    writers: Sequence[Writer] = (),
    clock: Clock | None = None,
    lines: Lines = dict,
    stop: Callable[[], bool] = lambda: False,
    progress: Callable[[float], None] = lambda _: None,
) -> Summary:
    """Run to the end of the feed, or until asked to stop.

    Args:
        model: The compiled workstation.
        feed: Samples per tick.
        bound: Criteria, from `bind`.
        scene: The same that the writers were opened with.
        before: What was said of the same samples, and by whom, see `no_greener`.
        end: When the motion ends, and the last tick with it [s]; inf while nobody knows.
        writers: Open sinks; they are closed at the end, whatever happens.
        clock: Real time; as fast as possible when None.
        lines: How live sources are heard.
        stop: Asked once per tick.
        progress: Told the run time once per tick [s].
    """
    log = ResultLog(scene.criteria)
    begun = time.perf_counter()
    done, t = 0, 0.0
    late: dict[str, tuple[float, float]] = {}
    sending = [writer for writer in writers if isinstance(writer, Sends)]

    def told() -> dict[str, SourceLine]:
        found = lines()
        for writer in sending:
            found = writer.lines(found)
        return found

    if end >= LONG:
        use_huge_pages()
    with ExitStack() as open_writers, settled():
        for writer in writers:
            open_writers.enter_context(writer)
            if isinstance(writer, KeepsResults):
                writer.share(log)
        engine = engine_of(model)
        judge: Callable[[State], tuple[Result, ...]] = Judge(bound, scene.findings)
        if before is not None:
            judge = no_greener(judge, *before)
        try:
            for out, samples in ticks(engine, judge, feed, end, told):
                done, t = done + 1, out.t
                for writer in writers:
                    writer.write(out, samples)
                log.add(out)  # after those who look on
                for name, latest in out.late.items():
                    late[name] = max(latest, late.get(name, latest))
                progress(t)
                if stop():
                    break
                if clock is not None:
                    clock.wait(t + model.workstation.engine.tick)
                    log.slip(clock.slipped)
        except KeyboardInterrupt:  # somebody has seen enough
            raise
        except BaseException as error:
            log.break_off(f"the run broke off after {t:.4g} s: {ended_by(error)}")
            raise
        for writer in writers:
            if isinstance(writer, BeginsAtEnd):
                writer.begin()
    return Summary(
        results=log,
        scene=scene,
        ticks=done,
        duration=t,
        wall=time.perf_counter() - begun,
        slipped=0.0 if clock is None else clock.slipped,
        late=late,
        sources=told(),
    )
