"""Opening the sources of a workstation: what each is told of what it drives, and how long it counts."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace as changed
from itertools import islice
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from seerob.core.errors import InputError, Problem, SeerobError, UnknownName
from seerob.core.plugin import home, kind_of
from seerob.core.samples import JointSample, PoseSample
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.criteria.question import worded
from seerob.description.description import Description
from seerob.devices.live.contradictions import looked_at
from seerob.devices.live.listening import LiveSource, delay_of
from seerob.devices.sources.room import Room
from seerob.devices.variables.live_source import VariablesSource
from seerob.files.trajectories.checks import RESTS, STARTS
from seerob.files.trajectories.trajectory import Trajectory, TrajectorySamples, derived_noise
from seerob.files.waypoints.arm import Arm
from seerob.model.model import Model
from seerob.model.mounting.compilation import pose_matrix
from seerob.model.mounting.in_place import implausible_motion
from seerob.model.variables import uses
from seerob.session.steps import problems_of
from seerob.twin.controller_check import compared, controller_log
from seerob.twin.states import motion_of
from seerob.workstation.plausibility.ranges import Quantity
from seerob.workstation.plausibility.ranges import findings as implausible
from seerob.workstation.source import Matrix4, Opened, Source, TakesWaypoints, Target, delayed

FIRST, LOOKS = 2000, 8
"""Samples at the begin of a recorded motion, and how many of them are looked at for where it goes."""
MOST_CLAIMED = 100_000
"""Samples of a file against which what criteria state is held, evenly."""
MOST_NAMED = 5
"""Variables in one finding."""
_POINT = re.compile(r"points\[\d+\]")


def open_sources(model: Model) -> tuple[tuple[Source, Opened], ...]:
    """Open every source of the workstation and check it against what it drives; connects to nothing.

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
        problems += _too_short(model, source, delay)
        try:
            driven = source_target(model, source)
            found = _opened(source, model.folder, driven, file, f"sources[{i}]")
            if not (_ships(source) or isinstance(source, LiveSource)):
                found = looked_at(found, source.name or kind_of("sources", source), driven)
            said = (*_lateness(model, source), *_unknown_angles(model, source))
            found = replace(found, findings=(*found.findings, *said))
            opened.append((source, _compared(model, i, source, found)))
            problems += _begun(source, i, file)
        except InputError as error:
            problems += (_placed(problem, source, f"sources[{i}]", file) for problem in error.problems)
    if not problems:  # whose source cannot be opened says no poses, which is not the mistake
        problems += _unpublished(model, opened, file)
    if problems:
        raise InputError(problems)
    if opened:
        more = (
            *implausible_motion(model, _begins(model, opened)),
            *_clocks(opened),
            *_contradicted(model, opened),
        )
        source, first = opened[0]
        opened[0] = source, replace(first, findings=(*first.findings, *more))
    return tuple((source, delayed(each, source.begins or 0.0)) for source, each in opened)


def _unpublished(model: Model, opened: Sequence[tuple[Source, Opened]], file: str) -> Iterator[Problem]:
    """Cartesian targets of which no source says poses: nothing would ever be published."""
    for i, table in enumerate(model.workstation.targets):
        key = f"targets[{i}].at"
        try:
            frame = model.frame(table.at)
            mover = model.carrier(frame).name
        except UnknownName as error:
            yield Problem(file, key, str(error))
            continue
        if table.steps:
            yield from problems_of(model, table, file, f"targets[{i}]")
            continue
        said: list[str] = []
        for source, one in opened:
            if source.target() != mover:
                continue
            if isinstance(source, LiveSource) and not _ships(source):
                break  # what it says, nobody knows before it does
            of = one.poses_of
            if not isinstance(source, LiveSource):
                first = next(iter(one.samples), None)
                of = first.target if isinstance(first, PoseSample) else None
            if of is not None and model.between(frame, model.frame(of)) is not None:
                break
            name = source.name or kind_of("sources", source)
            said.append(f"{name} says {'joint positions' if of is None else f'poses of {of}'}")
        else:
            what = f"no source says poses of {table.at} ({'; '.join(said) or f'none drives {mover}'})"
            remedy = f'drive {mover} by poses (tool_path, or content = "tf") of what moves with {table.at}'
            yield Problem(file, key, f"{what}: nothing would be published", remedy)


def reached(model: Model, opened: Sequence[tuple[Source, Opened]]) -> tuple[tuple[Source, Opened], ...]:
    """Sources of which the live ones have been asked what they have; this connects.

    Raises:
        InputError: With everything that can be reached and is not what its source can use.
    """
    found: list[tuple[Source, Opened]] = []
    problems: list[Problem] = []
    file = next(iter(model.workstation.files), "workstation")
    for i, (source, one) in enumerate(opened):
        try:
            said = () if one.reach is None else one.reach()
            found.append((source, replace(one, findings=(*one.findings, *said), reach=None)))
        except InputError as error:
            problems += (_placed(problem, source, f"sources[{i}]", file) for problem in error.problems)
    if problems:
        raise InputError(problems)
    return tuple(found)


def _opened(source: Source, folder: Path, driven: Target | None, file: str, key: str) -> Opened:
    """What opening a source gives.

    Raises:
        SeerobError: Its file is none, or it is one of the user's and fails.
    """
    what = f"open of {type(source).__module__}"
    remedy = "open(self, folder, target) gives a seerob.api.Opened"
    try:
        return source.open(folder, driven)
    except SeerobError:
        raise
    except Exception as error:
        if _ships(source):
            raise
        raise InputError.at(file, key, f"{what} fails: {worded(error)}", remedy) from error


def _ships(source: Source) -> bool:
    """Whether it is one of those whose files are looked at where they are read."""
    return type(source).__module__.startswith(f"{home('sources')}.")


def _begins(model: Model, opened: Sequence[tuple[Source, Opened]]) -> dict[str, list[Array]]:
    """Joint positions of robots and people at some instants of the first samples of recorded sources."""
    found: dict[str, list[Array]] = {}
    for source, one in opened:
        if isinstance(source, LiveSource) or source.target() not in model.mechanisms:
            continue
        # What devices saw of a person becomes a posture only in the loop.
        if not isinstance(next(iter(one.samples), None), JointSample):
            continue
        said = [s for s in islice(one.samples, FIRST) if isinstance(s, JointSample) and s.placed]
        n = len(model.mechanisms[source.target()].joints)
        q = [np.array(s.q) for s in said[:: max(1, -(-len(said) // LOOKS))] if len(s.q) == n]
        if q and np.isfinite(q).all():
            found[source.target()] = q
    return found


def _too_short(model: Model, source: Source, delay: float) -> Iterator[Problem]:
    """Variables that would be too old whenever they are shown."""
    for variable in model.dictionary.values() if isinstance(source, LiveSource) else ():
        if variable.source == source.name and variable.timeout <= delay and not variable.write:
            what = f"{variable.timeout:g} s is not longer than the delay of {delay:g} s of the slowest source"
            key = f"variables ({variable.name}).timeout"
            yield Problem(model.workstation.variables or "", key, what, "give a longer one")


def _unknown_angles(model: Model, source: Source) -> tuple[Finding, ...]:
    """What nobody knows of the angles of a person whom a source of one's own drives."""
    people = {human.name for human in model.workstation.humans}
    if _ships(source) or source.captured or source.target() not in people:
        return ()  # one that captured them says so itself
    from seerob.devices.capture.options import unknown_error

    return unknown_error(source.posture_error(), source.name or kind_of("sources", source), source.target())


def _lateness(model: Model, source: Source) -> Iterator[Finding]:
    """What nobody would see of variables: how late they are heard, and what they are between two answers."""
    if not isinstance(source, VariablesSource):
        return
    read = [v for v in model.dictionary.values() if v.source == source.name and not v.write]
    gap = source.sampling_gap()
    if read and gap > 0:
        text = (
            f"{_named([v.name for v in read])}: heard every {gap:g} s; what one is for less than "
            "that is not seen, and nothing is judged by it"
        )
        yield Finding(level="note", subject=source.name, text=text)
    blind = [v.name for v in read if not source.times(v)]
    if not blind:
        return
    text = f"no time is sent with {_named(blind)}: a delay on the way is not seen"
    if source.delay is None:
        remedy = (
            "and what moves by it, or is beyond its limit while muted by it, is undecided: give the time of "
            "the value, or delay"
        )
        yield Finding(level="warning", subject=source.name, text=f"{text}, {remedy}")
    else:
        yield Finding(
            level="assumed", subject=source.name, text=f"{text}; the file says {source.delay:g} s at most"
        )


def _named(names: Sequence[str]) -> str:
    return ", ".join(names[:MOST_NAMED]) + (" …" if len(names) > MOST_NAMED else "")


def _begun(source: Source, i: int, file: str) -> Iterator[Problem]:
    """Why a source cannot begin when it is said to."""
    if source.begins is not None and source.live:
        what = "a live source speaks of now"
        yield Problem(file, f"sources[{i}].begins", what, "leave it out")
    if source.begins and source.loop:
        what = "one that loops has no silence before each round"
        yield Problem(file, f"sources[{i}].begins", what, "leave out begins or loop")


def _file(source: Source) -> str:
    return str(getattr(source, "file", source.name))


def _clocks(opened: Sequence[tuple[Source, Opened]]) -> Iterator[Finding]:
    """Files that begin at different instants of their clocks: which of these are the same, nobody says."""
    began = [(i, each.began) for i, (_, each) in enumerate(opened) if each.began is not None]
    first, earliest = min(began, key=lambda one: one[1], default=(0, 0.0))
    for i, start in began:
        source, of = opened[i][0], opened[first][0]
        if source.begins is not None or not abs(start - earliest) >= STARTS:
            continue
        after = start - earliest + (of.begins or 0.0)
        text = (
            f"sources[{i}] ({_file(source)}) begins at {start:.3f} s of its clock, sources[{first}] "
            f"({_file(of)}) at {earliest:.3f} s, and nobody says whether that is one clock: write "
            f"begins = {after:.6g} in sources[{i}] where it is, begins = 0 where both begin together"
        )
        subject = source.target() or source.name
        yield Finding(level="warning", subject=subject, text=text, holds=(source.target() or "*",))


def _compared(model: Model, i: int, source: Source, opened: Opened) -> Opened:
    """Add findings: what is implausible of a motion, and where it contradicts what it drives."""
    name = source.target()
    if isinstance(source, LiveSource) or name not in model.mechanisms:
        return opened
    found = list(opened.findings)
    if isinstance(opened.samples, TrajectorySamples):
        limits = [None if v is None else v.value for v in model.mechanisms[name].velocity_limits]
        every = quantities(opened.samples.trajectory, limits, key=f"sources[{i}]", about=name, of=source.name)
        found += implausible(every, model.workstation.confirmed)
        motion = opened.samples.trajectory
        if motion.qd is None or opened.samples.qd is not motion.qd:
            noise = noise_of_speeds(motion, model.mechanisms[name].description, name)
            found += [] if noise is None else [noise]
    robot = any(name == one.name for one in model.workstation.robots)
    said = controller_log(opened.samples, getattr(source, "file", source.name)) if robot else None
    if said is not None:
        found += compared(model, name, said)
    return replace(opened, findings=tuple(found))


def _contradicted(model: Model, opened: Sequence[tuple[Source, Opened]]) -> Iterator[Finding]:
    """What criteria state of a robot, and its recorded motion contradicts."""
    for source, one in opened:
        samples, name = one.samples, source.target()
        claims = [
            claim
            for criterion in model.workstation.safety
            if name in criterion.subjects()
            for claim in criterion.claims(model)
        ]
        if not claims or not isinstance(samples, TrajectorySamples) or samples.qd is None:
            continue
        motion = samples.trajectory
        some = slice(None, None, -(-len(motion.t) // MOST_CLAIMED))
        t, q, qd = motion.t[some], motion.q[some], samples.qd[some]
        places = motion_of(model, {name: q}, {name: qd}, t - t[0])
        errors = {} if samples.qd_error is None else {name: np.tile(samples.qd_error, (len(t), 1))}
        invalid_reasons = dict(places.invalid_reasons)
        if motion.invalid is not None:
            invalid_reasons[name] = np.where(motion.invalid[some], "invalid", invalid_reasons[name]).astype(
                object
            )
        places = changed(places, invalid_reasons=invalid_reasons, speed_errors=errors)
        for claim in claims:
            found = claim.of_motion(places, f"in {_file(source)} ")
            yield from () if found is None else (found,)


def _placed(problem: Problem, source: Source, at: str, file: str) -> Problem:
    """Where the workstation file has what a mistake is about.

    That is its name for a data file that cannot be read at all, and waypoints that stand in it themselves.
    A source knows its own keys, and not the file that has it.
    """
    if problem.file == "sources":
        return Problem(file, f"{at}.{problem.key}", problem.what, problem.remedy)
    if isinstance(source, TakesWaypoints) and not getattr(source, "file", ""):
        point = _POINT.search(problem.key)
        key = point[0] if point else problem.key
        return Problem(file, f"{at}.{key or 'points'}", problem.what, problem.remedy)
    if problem.key or problem.file != getattr(source, "file", None):
        return problem
    return Problem(file, f"{at}.file", f"{problem.file}: {problem.what}", problem.remedy)


def target(model: Model, name: str) -> Target | None:
    """What a source needs to know of the robot or human it drives; None for no name."""
    if not name:
        return None
    mechanism = model.mechanism(name)
    table = next((r for r in model.workstation.robots if r.name == name), None)
    return Target(
        name=name,
        model="" if table is None else table.model,
        joints=tuple(joint.name for joint in mechanism.joints),
        units=mechanism.units,
        lower=tuple(mechanism.lower.tolist()),
        upper=tuple(mechanism.upper.tolist()),
        velocity=tuple(None if v is None else v.value for v in mechanism.velocity_limits),
        acceleration=() if table is None else table.acceleration_limits or (),
        jerk=() if table is None else table.jerk_limits or (),
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
    controls = model.workstation.controls if isinstance(source, Room) else ()
    own = replace(driven or Target(), variables=variables, controls=controls)
    return replace(own, folder=str(model.folder))


def signal_timeouts(model: Model) -> tuple[dict[str, float], dict[str, float]]:
    """Time-outs [s] of the variables, and of the machines that follow those, by name.

    Of a variable its own counts, or that of its source when that is shorter, whether or not the source still
    has a connection; of one that is read from a file only that of the file, which is not asked.
    """
    delay = delay_of(model.workstation.sources)
    sources = {s.name: s for s in model.workstation.sources}
    timeouts = {
        name: min(variable.timeout, source.timeout) - delay
        if isinstance(source, LiveSource)
        else source.timeout
        for name, variable in model.dictionary.items()
        if (source := sources[variable.source]).reads_variables
    }
    followed = {m.name: m.motion.variables() for m in model.workstation.machines}
    return timeouts, {name: min(timeouts[v] for v in by) for name, by in followed.items() if by}


def gappy(model: Model) -> frozenset[str]:
    """Variables that something depends on and that are heard live, unless their source tells each change."""
    told = {s.name for s in model.workstation.sources if isinstance(s, LiveSource) and not s.tells_changes}
    used = {name for _, name, _ in uses(model.workstation)}
    return frozenset(name for name in used if model.dictionary[name].source in told)


def untimed(model: Model) -> dict[str, str]:
    """Why nobody knows how late a variable is heard, by name: its device sends no time, the file no bound."""
    sources = {s.name: s for s in model.workstation.sources}
    return {
        name: f"{name}: {source.name} sends no time and cannot be asked for it: nobody knows how late "
        "it is; give the time of the value, or a bound on its lateness as delay of the source"
        for name, variable in model.dictionary.items()
        if isinstance(source := sources[variable.source], VariablesSource)
        and source.delay is None
        and not variable.write
        and not source.times(variable)
    }


def _world_from_base(model: Model, name: str) -> Matrix4 | None:
    station = model.workstation
    standing = {r.name: r.base for r in station.robots if r.on is None}
    places = {**standing, **{h.name: h.at for h in station.humans}}
    if name not in places:
        return None
    a, b, c, d = (tuple(row) for row in pose_matrix(places[name]).tolist())
    return a, b, c, d


def coarse(model: Model) -> dict[str, str]:
    """Robots and humans that are heard too coarsely for energies and forces, and why."""
    said = ((source.target(), source.coarse(model.folder)) for source in model.workstation.sources)
    return {name: why for name, why in said if why}


TELLING = 0.005
"""Noise of the flange's speed that is told [m/s]: a fiftieth of the 250 mm/s of a reduced speed."""
POSTURES = 50
"""In which the levers are looked at, evenly."""


def noise_of_speeds(motion: Trajectory, description: Description, name: str) -> Finding | None:
    """How fast a robot seems to move that stands, when its speeds are derived from its positions."""
    valid = np.ones(len(motion.t), bool) if motion.invalid is None else ~motion.invalid
    q, error = motion.q[valid], derived_noise(motion.t, motion.q, valid)
    if error is None:
        return None
    try:
        arm = Arm(description)
    except SeerobError:
        return None
    if arm.n != q.shape[1]:
        return None
    levers = np.linalg.norm(arm.posture(q[:: max(1, len(q) // POSTURES)]).jacobian()[:, :3, :], axis=1)
    speed = float(np.sqrt(((levers * error) ** 2).sum(axis=1)).max())
    if speed < TELLING:
        return None
    text = (
        f"{motion.file}: speeds are derived from noisy positions: standing, its flange "
        f"seems to move at up to {1e3 * speed:.0f} mm/s, and figures of speed are uncertain by so much "
        "(what rests on them is not within where that could exceed a limit)"
    )
    return Finding(level="assumed", subject=name, text=text)


def quantities(
    motion: Trajectory, limits: Sequence[float | None], *, key: str, about: str, of: str
) -> Iterator[Quantity]:
    """What is looked at of a motion.

    Args:
        motion: As it was read, in SI.
        limits: Largest speed of each joint [rad/s or m/s]; None where nobody stated one.
        key: Of its source in the file.
        about: Whom it drives.
        of: Name of its source.
    """
    valid = np.ones(len(motion.t), bool) if motion.invalid is None else ~motion.invalid
    if valid.sum() < 2:
        return
    t, q = motion.t[valid], motion.q[valid]
    step = np.diff(t)
    said = f"median of {motion.file}"
    yield Quantity(f"{key}.step", "sources.step", "s", (float(np.median(step)),), (about,), said, of)
    if motion.degrees:
        largest = float(np.degrees(np.abs(q).max()))
        if largest > RESTS:
            said = f"the largest angle of {motion.file}"
            yield Quantity(f"{key}.degrees", "sources.degrees", "°", (largest,), (about,), said, of)
    known = [j for j, limit in enumerate(limits) if limit is not None and j < q.shape[1]]
    if not known:
        return
    bounds = np.array([limits[j] for j in known], float)
    speeds = np.abs(np.diff(q[:, known], axis=0) / step[:, None]).max(axis=0) / bounds
    if motion.qd is not None:
        speeds = np.maximum(speeds, (np.abs(motion.qd[valid][:, known]) / bounds).max(axis=0))
    said = f"fastest joint of {motion.file}, share of its limit"
    yield Quantity(f"{key}.speed", "sources.speed", "", (float(speeds.max()),), (about,), said, of)
