"""Opening the sources of a workstation: what each is told of what it drives, and how long it counts."""

from __future__ import annotations

from msgspec.structs import replace

from seerob.errors import InputError, Problem
from seerob.live.listening import LiveSource, delay_of
from seerob.model import Model
from seerob.mounting.compilation import pose_matrix
from seerob.source import Matrix4, Opened, Source, Target


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
            problems += (_placed(problem, source, f"sources[{i}].file", file) for problem in error.problems)
    if problems:
        raise InputError(problems)
    return tuple(opened)


def _placed(problem: Problem, source: Source, key: str, file: str) -> Problem:
    """Of a data file that cannot be read at all, the place where the workstation file names it."""
    if problem.key or problem.file != getattr(source, "file", None):
        return problem
    return Problem(file, key, f"{problem.file}: {problem.what}", problem.remedy)


def target(model: Model, name: str) -> Target | None:
    """What a source needs to know of the robot or human it drives; None for no name."""
    if not name:
        return None
    mechanism = model.mechanism(name)
    table = next((r for r in model.workstation.robots if r.name == name), None)
    return Target(
        name=name,
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


def coarse(model: Model) -> dict[str, str]:
    """Robots and humans that are heard too coarsely for energies and forces, and why."""
    said = ((source.target(), source.coarse(model.folder)) for source in model.workstation.sources)
    return {name: why for name, why in said if why}
