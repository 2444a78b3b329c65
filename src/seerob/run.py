"""The main path: pump samples in, move the twin, judge it, write it out; once per tick.

Live, replayed and as-fast-as-possible runs are this same loop with another clock.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.metadata import version

from msgspec.structs import replace

from seerob.engine import Engine
from seerob.errors import InputError, Problem, SeerobError
from seerob.judging import Bound as Bound  # noqa: PLC0414
from seerob.judging import Judge as Judge  # noqa: PLC0414
from seerob.live.listening import LiveSource, delay_of
from seerob.live.real_time import Clock
from seerob.machines.displays import Looks
from seerob.model import Model
from seerob.mounting.compilation import pose_matrix
from seerob.results.result_log import ResultLog
from seerob.samples import Sample
from seerob.sink import KeepsResults, Writer
from seerob.snapshot import (
    CriterionInfo,
    Finding,
    JointInfo,
    MechanismInfo,
    Node,
    Result,
    Scene,
    Snapshot,
    Verdict,
)
from seerob.source import Matrix4, Opened, Pump, Source, Target
from seerob.state import State
from seerob.whereabouts.in_doubt import in_doubt
from seerob.workstation import content_hash

Feed = Iterator[tuple[Sample, ...]]
"""For each tick, from t = 0 on, the samples that were heard for it; ends when the run does."""


# -- before the run -----------------------------------------------------------------------------


def bind(model: Model) -> tuple[Bound, ...]:
    """Bind every criterion and rule of the workstation.

    Raises:
        InputError: With every name that does not exist and every option that cannot be.
    """
    bound: list[Bound] = []
    problems: list[Problem] = []
    file = next(iter(model.workstation.files), "workstation")
    for i, display in enumerate(model.workstation.displays):
        try:
            model.select(display.of)
        except SeerobError as error:
            problems.append(Problem(file, f"displays[{i}].of", str(error)))
    for group in ("safety", "ergonomics"):
        for i, criterion in enumerate(getattr(model.workstation, group)):
            try:
                bound.append(Bound(criterion, group, criterion.bind(model), criterion.basis(model)))
            except SeerobError as error:
                # Many messages begin with the name of the criterion, which the key already says.
                text = str(error).removeprefix(f"{criterion.name}: ")
                problems.append(Problem(file, f"{group}[{i}] ({criterion.name})", text))
    if problems:
        raise InputError(problems)
    return tuple(bound)


def target(model: Model, name: str) -> Target | None:
    """What a source needs to know of the robot or human it drives; None for no name."""
    if not name:
        return None
    mechanism = model.mechanism(name)
    return Target(
        name=name,
        joints=tuple(joint.name for joint in mechanism.joints),
        units=mechanism.units,
        lower=tuple(mechanism.lower.tolist()),
        upper=tuple(mechanism.upper.tolist()),
        velocity=tuple(None if v is None else v.value for v in mechanism.velocity_limits),
        description=mechanism.description,
        world_from_base=_world_from_base(model, name),
        frames=tuple(f.name for f in model.frames.values() if f.mj in mechanism.mj_bodies),
    )


def source_target(model: Model, source: Source) -> Target | None:
    """What a source needs to know: of what it drives, or of the variables that it reads."""
    driven = target(model, source.target())
    variables = tuple(v for v in model.dictionary.values() if v.source == source.name)
    if not source.reads_variables:
        return driven
    return replace(driven or Target(), variables=variables, folder=str(model.folder))


def signal_timeouts(model: Model) -> tuple[dict[str, float], dict[str, float]]:
    """Time-outs [s] of the sources of variables, and of the machines that follow those, by name."""
    delay = delay_of(model.workstation.sources)
    sources = {
        s.name: s.timeout - (delay if isinstance(s, LiveSource) else 0.0)
        for s in model.workstation.sources
        if s.reads_variables
    }
    followed = {
        machine.name: {model.dictionary[name].source for name in names}
        for machine in model.workstation.machines
        if (names := machine.motion.variables())
    }
    return sources, {name: min(sources[s] for s in by) for name, by in followed.items()}


def _world_from_base(model: Model, name: str) -> Matrix4 | None:
    station = model.workstation
    standing = {r.name: r.base for r in station.robots if r.on is None}
    places = {**standing, **{h.name: h.at for h in station.humans}}
    if name not in places:
        return None
    a, b, c, d = (tuple(row) for row in pose_matrix(places[name]).tolist())
    return a, b, c, d


def open_sources(model: Model) -> tuple[tuple[Source, Opened], ...]:
    """Open every source of the workstation and check it against what it drives.

    Raises:
        InputError: With every mistake in every file.
    """
    opened: list[tuple[Source, Opened]] = []
    problems: list[Problem] = []
    file = next(iter(model.workstation.files), "workstation")
    delay = delay_of(model.workstation.sources)
    for i, source in enumerate(model.workstation.sources):
        if isinstance(source, LiveSource) and source.timeout <= delay:
            what = (
                f"{source.timeout:g} s is not longer than the delay of {delay:g} s of the slowest live source"
            )
            problems.append(Problem(file, f"sources[{i}].timeout", what, "give a longer one"))
        try:
            opened.append((source, source.open(model.folder, source_target(model, source))))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return tuple(opened)


def scene(
    model: Model, bound: Sequence[Bound], findings: Iterable[Finding] = (), *, files: dict[str, bytes]
) -> Scene:
    """What sinks and the page need to know once; ``files`` are what the hash is of."""
    station = model.workstation
    too_coarse = coarse(model)
    return Scene(
        title=station.title,
        edition=station.edition,
        version=version("seerob"),
        workstation_hash=content_hash(files),
        period=station.engine.tick,
        nodes=tuple(
            Node(
                name=body.name,
                role=body.role,
                owner=body.owner,
                mesh=body.mesh,
                triangles=body.triangles,
                moves=bool(body.mover),
                mover=body.mover,
                mass=None if body.mass is None else body.mass.value,
                mass_origin=model.mass_origin(body),
                note=body.note,
            )
            for body in model.bodies
        ),
        mechanisms=tuple(
            MechanismInfo(
                name=m.name,
                role=m.role,
                joints=tuple(
                    JointInfo(name=joint.name, unit=unit, lower=joint.lower, upper=joint.upper)
                    for joint, unit in zip(m.joints, m.units, strict=True)
                ),
                coarse=too_coarse.get(m.name, ""),
            )
            for m in model.mechanisms.values()
        ),
        criteria=tuple(
            CriterionInfo(
                name=b.criterion.name,
                kind=type(b.criterion).__module__.removeprefix(f"seerob.{b.group}."),
                group=b.group,
                title=(type(b.criterion).__doc__ or "").strip().split("\n")[0],
                subjects=b.criterion.subjects(),
                unit=b.criterion.unit,
                limit=getattr(b.criterion, "limit", None),
                at_most=b.criterion.at_most,
                basis=b.basis,
                levels=getattr(b.criterion, "levels", ()),
            )
            for b in bound
        ),
        findings=tuple(dict.fromkeys((*model.findings, *_without_physics(model), *findings))),
    )


def _without_physics(model: Model) -> tuple[Finding, ...]:
    if model.workstation.engine.physics:
        return ()
    text = (
        "engine.physics = false: the twin is put where the samples say; whether torque limits and contacts "
        "allow that motion is not looked at"
    )
    return (Finding(level="note", subject="engine", text=text),)


# -- feeds: what is heard for each tick ---------------------------------------------------------


def pump(opened: Sequence[tuple[Source, Opened]], period: float, *, endless: bool = False) -> Feed:
    """Samples of recorded sources as run time passes.

    Ends with the last sample of the last source; a source that loops does not keep a run going
    on its own unless ``endless``. Without sources there is one tick.
    """
    pumps = [Pump(o, loop=source.loop, pause=source.loop_pause) for source, o in opened]
    duration = max((o.duration for _, o in opened), default=0.0)
    last = round(duration / period - 0.5 + 1e-9)
    k = 0
    while endless or k <= last:
        # Every sample, not only the newest: the run starts on the first one, and a source that is
        # faster than the ticks is followed exactly. One ahead, so that references reach to the tick's end.
        yield tuple(sample for each in pumps for sample in each.until(k * period))
        k += 1


# -- the loop -----------------------------------------------------------------------------------


def snapshot(state: State, seq: int, results: tuple[Result, ...], looks: Looks | None = None) -> Snapshot:
    """What goes out of a state."""
    mechanisms = state.model.mechanisms.values()
    return Snapshot(
        seq=seq,
        t=state.t,
        poses=state.poses(),
        joints={m.name: tuple(state.joint_positions(m).tolist()) for m in mechanisms},
        tracking={m.name: state.hearings[m.name].error for m in mechanisms},
        bones={m.name: bones for m in mechanisms if (bones := state.hearings[m.name].bones)},
        results=results,
        looks={} if looks is None else looks.at(state),
        doubts=in_doubt(state),
    )


def warm_up(model: Model) -> None:
    """Ask every criterion once, of the twin at home, and forget it.

    What is compiled or loaded at first use would else make the first tick of a live run late.
    """
    engine = Engine(model, controllers=False)
    judge = Judge(bind(model))
    judge(engine.start())
    Engine(model).tick()


def coarse(model: Model) -> dict[str, str]:
    """Robots and humans that are heard too coarsely for energies and forces, and why."""
    said = ((source.target(), source.coarse(model.folder)) for source in model.workstation.sources)
    return {name: why for name, why in said if why}


def engine_of(model: Model) -> Engine:
    """The twin as the workstation's sources drive it."""
    # What is shown is a delay old: silence shows that much earlier, so that it shows within the time-out.
    delay = delay_of(model.workstation.sources)
    driven: dict[str, float] = {}
    for source in model.workstation.sources:
        if source.target():
            timeout = source.timeout - (delay if isinstance(source, LiveSource) else 0.0)
            # Devices that complement one another may fall silent one by one.
            driven[source.target()] = max(timeout, driven.get(source.target(), timeout))
    live = {s.target() for s in model.workstation.sources if isinstance(s, LiveSource)}
    signals, following = signal_timeouts(model)
    engine = Engine(model, driven={**following, **driven}, live={*live, *following}, signals=signals)
    for name, why in coarse(model).items():
        engine.state.hearings[name].coarse = why
    return engine


def ticks(
    engine: Engine, judge: Callable[[State], tuple[Result, ...]], feed: Feed
) -> Iterator[tuple[Snapshot, tuple[Sample, ...]]]:
    """The road: for each tick what goes out, and the samples it was made from."""
    looks = Looks(engine.model)
    for seq, samples in enumerate(feed):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        yield snapshot(state, seq, judge(state), looks), samples


@contextmanager
def settled() -> Iterator[None]:
    """Spare the garbage collector what was made before the loop: it all lives as long as the loop does."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


@dataclass(frozen=True)
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

    @property
    def verdict(self) -> Verdict | None:
        """Verdict of the whole run."""
        return self.results.verdict


def run(
    model: Model,
    feed: Feed,
    *,
    bound: Sequence[Bound],
    scene: Scene,
    writers: Sequence[Writer] = (),
    clock: Clock | None = None,
    stop: Callable[[], bool] = lambda: False,
    progress: Callable[[float], None] = lambda _: None,
) -> Summary:
    """Run to the end of the feed, or until asked to stop.

    Args:
        model: The compiled workstation.
        feed: Samples per tick.
        bound: Criteria, from `bind`.
        scene: From `scene`, the same that the writers were opened with.
        writers: Open sinks; they are closed at the end, whatever happens.
        clock: Real time; as fast as possible when None.
        stop: Asked once per tick.
        progress: Told the run time once per tick [s].
    """
    log = ResultLog(scene.criteria)
    begun = time.perf_counter()
    count, t = 0, 0.0
    with ExitStack() as open_writers, settled():
        for writer in writers:
            open_writers.enter_context(writer)
            if isinstance(writer, KeepsResults):
                writer.share(log)
        engine = engine_of(model)
        for out, samples in ticks(engine, Judge(bound), feed):
            count, t = count + 1, out.t
            log.add(out)
            for writer in writers:
                writer.write(out, samples)
            progress(t)
            if stop():
                break
            if clock is not None:
                clock.wait(t + model.workstation.engine.tick)
    return Summary(
        results=log,
        scene=scene,
        ticks=count,
        duration=t,
        wall=time.perf_counter() - begun,
        slipped=0.0 if clock is None else clock.slipped,
    )
