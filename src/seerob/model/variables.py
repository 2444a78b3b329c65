"""The variable dictionary of a workstation: read beside it, and checked against its sources."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.files.bounded import content
from seerob.core.files.toml_file import MAX_FILE_SIZE
from seerob.core.snapshot import Finding
from seerob.workstation.tables.controls import ControlKind
from seerob.workstation.variables import Kind, Variable, read
from seerob.workstation.workstation import Robot, Thing, Workstation

MOST_NAMED = 20
"""In one finding."""


class Bound(NamedTuple):
    """The variables of a workstation."""

    variables: dict[str, Variable]
    """By name."""
    files: dict[str, bytes]
    findings: tuple[Finding, ...]


def bound(station: Workstation) -> Bound:
    """The dictionary that a workstation names.

    Raises:
        InputError: With every mistake in it: also a path that leads out of the folder, and a source that
            does not exist, or that drives something instead of reading variables.
    """
    file = next(iter(station.files), "workstation")
    if station.variables is None:
        if problems := _uses(station, {}, file):
            raise InputError(problems)
        return Bound({}, {}, ())
    path = Path(station.folder) / station.variables
    if Path(station.variables).is_absolute() or ".." in Path(station.variables).parts:
        what = f"{station.variables} is not beside the workstation file"
        raise InputError.at(file, "variables", what, "put the dictionary into the folder of the workstation")
    variables = read(path)
    by_name = {v.name: v for v in variables}
    problems = [*_sources(station, variables, str(path)), *_uses(station, by_name, file)]
    if problems:
        raise InputError(problems)
    files = {Path(station.variables).as_posix(): content(path, MAX_FILE_SIZE)}
    return Bound(by_name, files, (*_twice(variables), *_unused(station, variables)))


def _sources(station: Workstation, variables: tuple[Variable, ...], file: str) -> list[Problem]:
    known = {source.name: source for source in station.sources}
    readers = [name for name, source in known.items() if source.reads_variables]
    problems = []
    for variable in variables:
        key = f"variables ({variable.name}).source"
        if variable.source not in known:
            what = f"no source named {variable.source!r}"
            problems.append(Problem(file, key, what, suggestion(variable.source, readers)))
        elif variable.source not in readers:
            what = f"{variable.source!r} reads no variables of a dictionary"
            problems.append(Problem(file, key, what, suggestion(variable.source, readers)))
    return problems


def _twice(variables: tuple[Variable, ...]) -> list[Finding]:
    """What two names are given to: allowed, and seldom meant."""
    names: dict[tuple[str, str], list[str]] = defaultdict(list)
    for variable in variables:
        names[variable.source, repr(variable.address)].append(variable.name)
    return [
        Finding(
            level="warning",
            subject=given[0],
            text=f"{', '.join(given)} are the same variable of {source}: {address}",
        )
        for (source, address), given in names.items()
        if len(given) > 1
    ]


def uses(station: Workstation) -> Iterator[tuple[str, str, str]]:
    """Every use of a variable: key in the workstation file, variable, what it must be."""
    for i, machine in enumerate(station.machines):
        for name, what in machine.motion.variables().items():
            yield f"machines[{i}] ({machine.name})", name, what
    for i, part in enumerate(station.parts):
        for name, what in ({} if part.conveyor is None else part.conveyor.variables()).items():
            yield f"parts[{i}] ({part.name})", name, what
    for i, display in enumerate(station.displays):
        yield f"displays[{i}] ({display.of})", display.variable, ""
    for group in ("safety", "ergonomics"):
        for i, criterion in enumerate(getattr(station, group)):
            for name, what in criterion.variables().items():
                yield f"{group}[{i}] ({criterion.name})", name, what


def _uses(station: Workstation, variables: dict[str, Variable], file: str) -> list[Problem]:
    """Variables that do not exist, are written, or are of another sort than what uses them needs."""
    problems = []
    for key, name, what in uses(station):
        variable = variables.get(name)
        if variable is None:
            remedy = suggestion(name, variables) if station.variables else "name the file: variables = …"
            problems.append(Problem(file, key, f"no variable {name!r} in the dictionary", remedy))
        elif variable.write:
            problems.append(Problem(file, key, f"{name} is written, not read", "name one that is read"))
        elif what and what != _sort(variable):
            problem = f"{name} is {_said(_sort(variable))}, {_said(what)} is needed"
            problems.append(Problem(file, key, problem, "name another, or mend its type or unit"))
    problems += _triggers(station, variables, file)
    problems += _controls(station, variables, file)
    driven = {source.target() for source in station.sources}
    for i, machine in enumerate(station.machines):
        if machine.motion.variables() and machine.name in driven:
            what = f"{machine.name} follows variables and has a source of its own"
            problems.append(Problem(file, f"machines[{i}]", what, "keep one of both"))
    return problems


def _triggers(station: Workstation, variables: dict[str, Variable], file: str) -> list[Problem]:
    criteria = [criterion.name for criterion in (*station.safety, *station.ergonomics)]
    problems = []
    for i, trigger in enumerate(station.triggers):
        key = f"triggers[{i}]"
        variable = variables.get(trigger.variable)
        if variable is None or not variable.write or variable.type is not Kind.BOOL:
            what = f"no variable {trigger.variable!r} that is a bool with write = true"
            fits = [v.name for v in variables.values() if v.write and v.type is Kind.BOOL]
            problems.append(Problem(file, f"{key}.variable", what, suggestion(trigger.variable, fits)))
        if trigger.control is not None:
            found = next((c for c in station.controls if c.name == trigger.control), None)
            if found is None or found.kind is ControlKind.LEVER:
                what = f"no control named {trigger.control!r} that is true or false"
                known = [c.name for c in station.controls if c.kind is not ControlKind.LEVER]
                problems.append(Problem(file, f"{key}.control", what, suggestion(trigger.control, known)))
        elif trigger.criterion not in criteria:
            what = f"no criterion named {trigger.criterion!r}"
            problems.append(Problem(file, f"{key}.criterion", what, suggestion(trigger.criterion, criteria)))
    return problems


def _controls(station: Workstation, variables: dict[str, Variable], file: str) -> list[Problem]:
    rooms = {source.name for source in station.sources if source.pulled}
    names = [control.name for control in station.controls]
    things: tuple[Thing | Robot, ...] = (*station.parts, *station.machines, *station.tools, *station.robots)
    known = [thing.name for thing in things]
    problems = []
    for i, control in enumerate(station.controls):
        key = f"controls[{i}]"
        variable = variables.get(control.sets)
        if variable is None or variable.source not in rooms or variable.write:
            fits = [v.name for v in variables.values() if v.source in rooms]
            remedy = suggestion(control.sets, fits)
            if variable is not None and variable.write:
                remedy = "a machine is written by a [[triggers]] of this control, and nothing else"
            what = f"no variable {control.sets!r} of a source of kind room"
            problems.append(Problem(file, f"{key}.sets", what, remedy))
        elif variable.type not in (Kind.BOOL, Kind.NUMBER) or (
            (variable.type is Kind.NUMBER) != (control.kind is ControlKind.LEVER)
        ):
            what = f"{control.sets} is {_said(_sort(variable))}, and {control.name} a {control.kind}"
            problems.append(Problem(file, f"{key}.sets", what, "a lever sets a number, others set a bool"))
        if control.of.split("/")[0] not in known and control.of not in known:
            what = f"nothing named {control.of!r} to pull"
            problems.append(Problem(file, f"{key}.of", what, suggestion(control.of, known)))
        if names.count(control.name) > 1:
            problems.append(
                Problem(file, f"{key}.name", f"the name {control.name!r} is taken", "choose another")
            )
    return problems


def _sort(variable: Variable) -> str:
    return variable.si_unit if variable.type is Kind.NUMBER else str(variable.type)


def _said(sort: str) -> str:
    return f"a {sort}" if sort in set(Kind) else f"in {sort}"


def _unused(station: Workstation, variables: tuple[Variable, ...]) -> list[Finding]:
    used = {name for _, name, _ in uses(station)}
    idle = [v.name for v in variables if v.name not in used and not v.write]
    if not idle:
        return []
    text = f"{len(idle)} of {len(variables)} variables are used by nothing: {', '.join(idle[:MOST_NAMED])}"
    return [Finding(level="note", subject="variables", text=text + (" …" if len(idle) > MOST_NAMED else ""))]
