"""The variable dictionary of a workstation: read beside it, and checked against its sources."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

from seerob.dictionary import Variable, read
from seerob.errors import InputError, Problem, suggestion
from seerob.snapshot import Finding
from seerob.workstation import Workstation


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
    if station.variables is None:
        return Bound({}, {}, ())
    file = next(iter(station.files), "workstation")
    path = Path(station.folder) / station.variables
    if Path(station.variables).is_absolute() or ".." in Path(station.variables).parts:
        what = f"{station.variables} is not beside the workstation file"
        raise InputError.at(file, "variables", what, "put the dictionary into the folder of the workstation")
    variables = read(path)
    problems = list(_sources(station, variables, str(path)))
    if problems:
        raise InputError(problems)
    files = {Path(station.variables).as_posix(): path.read_bytes()}
    return Bound({v.name: v for v in variables}, files, tuple(_twice(variables)))


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
