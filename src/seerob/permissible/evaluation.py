"""The whole question: a motion, its map, the rescaled motion, and the same criteria asked of that again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from msgspec.structs import replace as changed

from seerob.engine import Engine
from seerob.errors import InputError
from seerob.model import Model
from seerob.permissible.given_motion import GivenMotion
from seerob.permissible.joint_limits import JointLimits
from seerob.permissible.path import Path, path_of
from seerob.permissible.rescaled import Check, Rescaled, Spent, check, rescale, spent
from seerob.permissible.speed_map import Permit, SpeedMap, Stations, speed_map
from seerob.permissible.witness import Clock, Witness
from seerob.results import ResultLog
from seerob.run import Bound, Feed, Judge, Summary, pump, ticks
from seerob.samples import JointSample, Sample
from seerob.snapshot import CriterionInfo, Finding
from seerob.source import HOLD, Opened, Source
from seerob.trajectory import TrajectorySamples

Sources = Sequence[tuple[Source, Opened]]
Say = Callable[[str, float], None]
"""Told what is being done and which share of it is done, 0 to 1; what it raises stops the work."""


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What is asked for."""

    permit: Permit = Permit.ALL
    tolerance: float = 5e-4
    """Of the path, in any joint [rad or m]."""
    spacing: float = 0.02
    """Largest way between two stations of the map in joint space [rad or m]."""
    margin: float = 0.02
    """Share of the map's speeds that is not used."""
    not_faster: bool = False
    """Nowhere faster than the given motion."""
    period: float = 0.008
    """Of the rescaled trajectory [s]."""
    rounds: int = 3
    """How often the map is made anew when somebody else moves: rescaled, the robot meets them elsewhere."""


@dataclass(frozen=True, eq=False)
class PermissibleSpeed:
    """How fast a robot may go along its path, and a motion that keeps to it."""

    map: SpeedMap
    motion: GivenMotion
    path: Path
    before: ResultLog
    """Every criterion during the given motion."""
    rescaled: Rescaled | None
    """None where the map does not permit any motion along the path."""
    refused: str
    """Why there is no rescaled motion; else empty."""
    check: Check | None
    spent: tuple[Spent, ...]
    after: Summary | None
    """Every criterion during the rescaled motion, by the same road."""
    findings: tuple[Finding, ...]


def given_motion(sources: Sources, robot: str) -> GivenMotion:
    """The recorded or planned motion of a robot.

    Raises:
        InputError: Not exactly one source of joint positions drives it.
    """
    driving = [opened for source, opened in sources if source.target() == robot]
    if len(driving) != 1:
        what = f"{len(driving)} sources drive {robot}"
        raise InputError.at("permissible speed", robot, what, "give one recorded or planned motion")
    samples = list(driving[0].samples)
    joints = [s for s in samples if isinstance(s, JointSample)]
    if len(joints) != len(samples):
        what = f"its source gives poses of {robot}'s tool, not joint positions"
        raise InputError.at("permissible speed", robot, what, "give a joint trajectory")
    return GivenMotion.of(joints)


def witness(
    model: Model, sources: Sources, bound: Sequence[Bound], infos: Sequence[CriterionInfo], say: Say
) -> tuple[Witness, ResultLog]:
    """Run the given motion once: where everybody is, and what the criteria say of it."""
    driven = {s.target(): s.timeout for s, _ in sources if s.target()}
    seen, log = Witness(Judge(bound)), ResultLog(infos)
    duration = max((opened.duration for _, opened in sources), default=0.0)
    engine = Engine(model, driven=driven)
    for out, _ in ticks(engine, seen, pump(sources, model.workstation.engine.tick)):
        log.add(out)
        say("the given motion", min(1.0, out.t / duration) if duration else 1.0)
    return seen, log


def mapped(
    model: Model,
    sources: Sources,
    seen: Witness,
    motion: GivenMotion,
    limits: JointLimits,
    wish: Wish,
    say: Say,
) -> tuple[SpeedMap, Rescaled | None, str]:
    """The map and the rescaled motion; again while others move and are met elsewhere."""
    robot = model.robot(motion.target)
    path = path_of(motion, tolerance=wish.tolerance)
    elsewhere = [m for name, m in model.mechanisms.items() if name != robot.name and seen.moves(m)]
    found: SpeedMap | None = None
    rescaled: Rescaled | None = None
    for turn in range(wish.rounds if elsewhere else 1):
        told = f"the map, round {turn + 1}" if elsewhere else "the map"
        clock: Clock = _same if rescaled is None else rescaled.own_instant
        more = speed_map(
            model, robot, motion, path, limits, seen,
            criteria=model.workstation.safety, permit=wish.permit, spacing=wish.spacing,
            others_at=clock, progress=partial(say, told),
        )  # fmt: skip
        found = more if found is None else _both(found, more)
        try:
            say("the timing", 0.0)
            rescaled = rescale(found, not_faster=wish.not_faster, margin=wish.margin)
        except InputError as refused:
            if refused.problems[0].key != robot.name:
                raise
            return found, None, refused.problems[0].what
    assert found is not None
    return found, rescaled, ""


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
    seen: tuple[Witness, ResultLog],
    motion: GivenMotion,
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
        limits: Of the robot's joints.
        wish: What is asked for.
        again: Runs the road over what is heard, whose length is told [s].
        ready: Told what was found before that.
        say: See `Say`.
    """
    found, rescaled, refused = mapped(model, sources, seen[0], motion, limits, wish, say)
    findings = list(_about(found, motion, wish))
    checked: Check | None = None
    where_to: tuple[Spent, ...] = ()
    whole: Sources = ()
    if rescaled is not None:
        checked, where_to = check(rescaled), spent(rescaled)
        whole, more = played(sources, rescaled, wish.period)
        findings += more
    answer = PermissibleSpeed(
        found, motion, found.path, seen[1], rescaled, refused, checked, where_to, None, tuple(findings)
    )
    ready(answer)
    if not whole:
        return answer
    duration = max(opened.duration for _, opened in whole)
    return replace(answer, after=again(pump(whole, model.workstation.engine.tick), duration))


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


def _about(found: SpeedMap, motion: GivenMotion, wish: Wish) -> Iterator[Finding]:
    path, name = found.path, found.robot
    off = float(path.deviation.max())
    text = (
        f"the path is off the given motion by at most {off:.2g} rad or m in any joint (by bound, not sampled)"
    )
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
