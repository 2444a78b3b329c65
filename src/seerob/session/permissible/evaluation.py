"""The whole question: a motion, its map, the rescaled motion, and the same criteria asked of that again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from msgspec.structs import replace as changed

from seerob.core.errors import InputError
from seerob.core.figures import rounded_up
from seerob.core.samples import JointSample, PoseSample, Sample
from seerob.core.snapshot import CriterionInfo, Finding, Snapshot, Verdict
from seerob.files.trajectories.trajectory import TrajectorySamples
from seerob.model.model import Model
from seerob.recording.result_log import ResultLog
from seerob.recording.series import CODES, Series, worst_verdict
from seerob.session.permissible.ceilings import By, Method
from seerob.session.permissible.joint_limits import JointLimits
from seerob.session.permissible.path import GivenMotion, Path, path_of, solved
from seerob.session.permissible.rescaled import Check, Rescaled, Spent, check, rescale, spent
from seerob.session.permissible.speed_map import SpeedMap, Stations
from seerob.session.permissible.survey import SPACING, Survey, Verified, verify
from seerob.session.permissible.witness import Clock, Witness
from seerob.session.run import Bound, Feed, Judge, Summary, ends_at, engine_of, looks_ahead, pump, ticks
from seerob.workstation.source import HOLD, Opened, Source

Sources = Sequence[tuple[Source, Opened]]
Say = Callable[[str, float], None]
"""Told what is being done and which share of it is done, 0 to 1; what it raises stops the work."""


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What is asked for."""

    by: By = By.ALL
    tolerance: float = 5e-4
    """Tolerance of the path, in any joint [rad or m]."""
    spacing: float = SPACING
    """Largest way between two stations of the map in joint space [rad or m]."""
    margin: float = 0.02
    """Share of the map's speeds that is not used, for what happens between two stations and how the twin
    follows."""
    not_faster: bool = False
    """Nowhere faster than the given motion."""
    period: float = 0.008
    """Period of the rescaled trajectory [s]."""
    rounds: int = 3
    """How often the map is made anew when somebody else moves: rescaled, the robot meets them elsewhere; and
    how often it gets more stations where the plan uses more than is permitted between two of them."""
    verify: float = 1e-3
    """Period at which the criteria are asked of the plan [s]."""


@dataclass(frozen=True, eq=False)
class PermissibleSpeed:
    """How fast a robot may go along its path, and a motion that keeps to it."""

    map: SpeedMap
    motion: GivenMotion
    path: Path
    before: ResultLog
    """Every criterion during the given motion."""
    first: Snapshot
    """First snapshot of the given motion, for pictures."""
    rescaled: Rescaled | None
    """None where the map does not permit any motion along the path."""
    refused: str
    """Why there is no rescaled motion; else empty."""
    check: Check | None
    verified: Verified | None
    """What the criteria that count say of the plan at a fixed period; None without a plan."""
    spent: tuple[Spent, ...]
    after: Summary | None
    """Every criterion during the rescaled motion, by the same road."""
    findings: tuple[Finding, ...]

    @property
    def verdict(self) -> Verdict | None:
        """Verdict of the rescaled motion, or why there is none.

        That of every criterion in the run of it; with `By.EITHER` the two methods count together, as they
        were asked at `Verified.period` and at each tick of the run, instead of each by itself.
        """
        if self.after is None or self.verified is None:
            return Verdict.UNDECIDED if self.map.undecided else Verdict.EXCEEDED
        planned = Verdict.UNDECIDED if self.verified.undecided else Verdict.EXCEEDED
        if self.verified.kept:
            planned = Verdict.WITHIN
        alone = {
            name: series.verdict
            for name, series in self.after.results.items()
            if self.map.by is not By.EITHER or name not in self.map.methods
        }
        either = [either_permits(self.after.results, self.map.methods)] if self.map.by is By.EITHER else []
        return worst_verdict([planned, *alone.values(), *either])


_SURE, _PLANNED, _OPEN, _BEYOND = range(4)
"""What a method says at a tick: it permits it; it has nothing to judge, and only the plan's own looks say
whether it does (nobody is near, it does not apply); nobody knows; it does not."""
_RANKS = np.full(256, _OPEN)
_RANKS[[CODES[Verdict.WITHIN], CODES[None], CODES[Verdict.EXCEEDED]]] = _SURE, _PLANNED, _BEYOND


def either_permits(log: Mapping[str, Series], methods: Mapping[str, Method]) -> Verdict:
    """Verdict of two methods of which one suffices at each tick of a run, with all that a run takes back.

    Args:
        log: What every criterion said over the run; what nothing bounds between ticks is open.
        methods: Names of the criteria of each method.
    """
    t = np.unique(np.concatenate([log[name].t for name in methods]))
    worst = {method: np.full(len(t), _SURE) for method in methods.values()}
    for name, method in methods.items():
        series = log[name]
        k = np.searchsorted(series.t, t, side="right") - 1
        said = np.where(k < 0, _OPEN, _RANKS[series.verdicts[np.maximum(k, 0)]])
        if series.gap():
            said = np.where(said == _SURE, _OPEN, said)
        worst[method] = np.maximum(worst[method], said)
    least = np.min(list(worst.values()), axis=0).max(initial=_SURE)
    return {_BEYOND: Verdict.EXCEEDED, _OPEN: Verdict.UNDECIDED}.get(int(least), Verdict.WITHIN)


def given_motion(model: Model, sources: Sources, robot: str) -> tuple[GivenMotion, tuple[Finding, ...]]:
    """The recorded or planned motion of a robot; poses of its tool are solved as the engine solves them.

    Raises:
        InputError: Not exactly one source drives it, or it gives neither joint positions nor poses, or a
            pose is out of reach.
    """
    if on := model.robot(robot).on:
        remedy = "the map is of a robot that stands; judge its motion with seerob assess"
        raise InputError.at("permissible speed", robot, f"it is carried by {on}", remedy)
    driving = [opened for source, opened in sources if source.target() == robot]
    if len(driving) != 1:
        what = f"{len(driving)} sources drive {robot}"
        raise InputError.at("permissible speed", robot, what, "give one recorded or planned motion")
    samples = list(driving[0].samples)
    joints = [s for s in samples if isinstance(s, JointSample)]
    poses = [s for s in samples if isinstance(s, PoseSample)]
    if len(joints) == len(samples):
        return GivenMotion.of(joints), ()
    if len(poses) != len(samples):
        what = f"its source gives neither only joint positions nor only poses of {robot}'s tool"
        raise InputError.at("permissible speed", robot, what, "give a joint trajectory or a tool path")
    text = (
        "joint positions of the given motion are solved from poses of its tool, on the branch that is "
        "nearest from pose to pose; the controller may choose another, and then this map is not its map"
    )
    finding = Finding(level="assumed", subject=robot, text=text)
    return GivenMotion.of(solved(model, model.robot(robot), poses)), (finding,)


def witness(
    model: Model, sources: Sources, bound: Sequence[Bound], infos: Sequence[CriterionInfo], say: Say
) -> tuple[Witness, ResultLog, Snapshot]:
    """Run the given motion once: where everybody is, what the criteria say of it, and its first tick."""
    findings = [found for _, opened in sources for found in opened.findings]
    seen, log = Witness(Judge(bound, findings)), ResultLog(infos)
    duration = ends_at(sources)
    first: Snapshot | None = None
    feed = pump(sources, model.workstation.engine.tick, ahead=looks_ahead(model))
    for out, _ in ticks(engine_of(model), seen, feed, duration):
        first = first or out
        log.add(out)
        say("the given motion", min(1.0, out.t / duration) if duration else 1.0)
    assert first is not None  # there always is a tick
    return seen, log, first


def mapped(
    model: Model,
    survey: Survey,
    seen: Witness,
    motion: GivenMotion,
    wish: Wish,
    say: Say,
) -> tuple[SpeedMap, Rescaled | None, Verified | None, str]:
    """The map, the rescaled motion and what was found in it; again while others are met elsewhere."""
    elsewhere = [m for name, m in model.mechanisms.items() if name != motion.target and seen.moves(m)]
    found: SpeedMap | None = None
    rescaled: Rescaled | None = None
    verified: Verified | None = None
    try:
        for turn in range(wish.rounds if elsewhere else 1):
            told = f"the map, round {turn + 1}" if elsewhere else "the map"
            clock: Clock = _same if rescaled is None else rescaled.own_instant
            more = survey.map(spacing=wish.spacing, others_at=clock, progress=partial(say, told))
            found = more if found is None else _both(found, more)
            say("the timing", 0.0)
            rescaled = rescale(found, not_faster=wish.not_faster, margin=wish.margin)
        for turn in range(wish.rounds):
            assert found is not None
            assert rescaled is not None
            looked = f"what lies between, round {turn + 1}"
            verified = verify(rescaled, survey, period=wish.verify, progress=partial(say, looked))
            if verified.kept or turn == wish.rounds - 1:
                break
            found = survey.denser(found, verified.over, rescaled.own_instant)
            rescaled = rescale(found, not_faster=wish.not_faster, margin=wish.margin)
    except InputError as refused:
        if found is None or refused.problems[0].key != motion.target:
            raise
        first = refused.problems[0]
        return found, None, None, f"{first.what}; {first.remedy}"
    assert found is not None
    return found, rescaled, verified, ""


def _same(t: float) -> float:
    return t


def _both(a: SpeedMap, b: SpeedMap) -> SpeedMap:
    """The map that keeps to both."""
    return replace(a, stations=tuple(map(_joined, a.stations, b.stations)))


def _joined(a: Stations, b: Stations) -> Stations:
    return replace(a, ceilings=tuple((*x, *y) for x, y in zip(a.ceilings, b.ceilings, strict=True)))


def evaluation(
    model: Model,
    sources: Sources,
    *,
    seen: tuple[Witness, ResultLog, Snapshot],
    motion: GivenMotion,
    solved_from: Sequence[Finding],
    limits: JointLimits,
    wish: Wish,
    again: Callable[[Feed, float], Summary],
    ready: Callable[[PermissibleSpeed], None],
    say: Say,
) -> PermissibleSpeed:
    """All of it; see `PermissibleSpeed`.

    Args:
        model: The compiled workstation.
        sources: Its sources, opened.
        seen: From `witness`.
        motion: From `given_motion`.
        solved_from: Likewise.
        limits: Of the robot's joints.
        wish: What is asked for.
        again: Runs the road over what is heard, whose length is told [s].
        ready: Told what was found before that.
        say: See `Say`.
    """
    robot = model.robot(motion.target)
    path = path_of(motion, tolerance=wish.tolerance)
    criteria = model.workstation.safety
    survey = Survey(model, robot, motion, path, limits, seen[0], criteria=criteria, by=wish.by)
    found, rescaled, verified, refused = mapped(model, survey, seen[0], motion, wish, say)
    findings = [*solved_from, *_about(found, motion, wish)]
    checked: Check | None = None
    where_to: tuple[Spent, ...] = ()
    whole: Sources = ()
    if rescaled is not None:
        checked, where_to = check(rescaled), spent(rescaled)
        whole, more = played(sources, rescaled, wish.period)
        findings += more
        if verified is not None:
            findings += _between_stations(verified, robot.name)
    answer = PermissibleSpeed(
        found,
        motion,
        path,
        seen[1],
        seen[2],
        rescaled,
        refused,
        checked,
        verified,
        where_to,
        None,
        tuple(findings),
    )
    ready(answer)
    if not whole:
        return answer
    duration = ends_at(whole)
    return replace(
        answer, after=again(pump(whole, model.workstation.engine.tick, ahead=looks_ahead(model)), duration)
    )


def played(sources: Sources, rescaled: Rescaled, period: float) -> tuple[Sources, tuple[Finding, ...]]:
    """The sources with the robot's motion replaced; who ends early stands still to the end."""
    robot = rescaled.of.robot
    trajectory = rescaled.trajectory(period)
    samples = TrajectorySamples(trajectory, "rescaled trajectory", robot, trajectory.qd)
    new = Opened(samples=samples, duration=trajectory.duration)
    mixed = [
        (changed(source, loop=False), new) if source.target() == robot else (source, opened)
        for source, opened in sources
    ]
    last = max(opened.duration for _, opened in mixed)
    out: list[tuple[Source, Opened]] = []
    findings = []
    for source, opened in mixed:
        if opened.duration >= last - HOLD or source.loop:
            out.append((source, opened))
            continue
        held = Opened(samples=_Held(opened, last), duration=last)
        out.append((source, held))
        text = f"stands still after its last sample at {opened.duration:.2f} s, to {last:.2f} s"
        findings.append(Finding(level="assumed", subject=source.target() or source.name, text=text))
    return out, tuple(findings)


class _Held:
    """Samples, and then the last one again and again, at rest."""

    def __init__(self, opened: Opened, until: float) -> None:
        self._opened, self._until = opened, until

    def __iter__(self) -> Iterator[Sample]:
        last: Sample | None = None
        for last in self._opened.samples:
            yield last
        if last is None:
            return
        k, t = 1, last.t + HOLD
        while t < self._until + HOLD:
            held = changed(last, t=t, seq=last.seq + k)
            if isinstance(held, JointSample) and held.qd is not None:
                held = changed(held, qd=(0.0,) * len(held.qd))
            yield held
            k, t = k + 1, t + HOLD


def _between_stations(verified: Verified, robot: str) -> Iterator[Finding]:
    if not verified.kept:
        what = (
            f"uses {rounded_up(verified.use)} of what is permitted at {verified.at:.3f} s ({verified.what})"
        )
        if verified.undecided:
            what = f"cannot be judged at {verified.undecided} of {verified.asked} instants"
        text = f"between the stations of the map the plan {what}: give a smaller spacing or a larger margin"
        yield Finding(level="warning", subject=robot, text=text)


def _about(found: SpeedMap, motion: GivenMotion, wish: Wish) -> Iterator[Finding]:
    path, name = found.path, found.robot
    off = float(path.deviation.max())
    most = rounded_up(off, "rad or m")
    text = f"the path is off the given motion by at most {most} in any joint (by bound, not sampled)"
    yield Finding(level="note", subject=name, text=text)
    if off > wish.tolerance * (1 + 1e-9):
        text = f"the path is off by more than the tolerance of {wish.tolerance:g}: the motion is too rough"
        yield Finding(level="warning", subject=name, text=text)
    if motion.derived:
        text = "velocities of the given motion are derived from its positions"
        yield Finding(level="assumed", subject=name, text=text)
    for i, when in ((0, "begins"), (-1, "ends")):
        fastest = float(abs(motion.qd[i]).max())
        if fastest > 1e-2:
            text = f"the given motion {when} at {fastest:.3g} rad/s or m/s; the rescaled one {when} at rest"
            yield Finding(level="warning", subject=name, text=text)
