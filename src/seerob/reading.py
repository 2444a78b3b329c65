"""Reading a workstation file: typed tables, plug-ins by their kind, and every mistake at once."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from seerob import naming, plugin
from seerob.conversion import convert, tables
from seerob.criterion import Criterion
from seerob.errors import InputError, Problem, SeerobError
from seerob.sink import Sink
from seerob.source import Source
from seerob.workstation import PLUGINS, TABLES, Workstation, locate, read_toml

BASES: dict[str, type[Struct]] = {
    "sources": Source,
    "safety": Criterion,
    "ergonomics": Criterion,
    "sinks": Sink,
}
"""Plug-in table → base class of its entries."""

_NOT_IN_FILE = ("folder", "files")
_MAX_PROBLEMS = 200


def read(path: Path | str) -> Workstation:
    """The workstation of a file or of a folder that contains one.

    Raises:
        InputError: With every mistake in it: unknown keys, missing keys, wrong types and ranges,
            unknown kinds, names that are taken or lead nowhere.
    """
    file = locate(path)
    table, raw = read_toml(file)
    station, problems = convert_workstation(table, str(file))
    if problems or station is None:
        raise InputError(problems)
    return msgspec.structs.replace(station, folder=str(file.parent.resolve()), files={file.name: raw})


def convert_workstation(table: Mapping[str, Any], file: str) -> tuple[Workstation | None, list[Problem]]:
    """The typed workstation of a parsed file, and every mistake that was found."""
    problems: list[Problem] = []
    groups = (*TABLES, *PLUGINS)
    entries: dict[str, dict[int, Any]] = {}
    for group in groups:
        read_entries = {
            i: convert(entry, TABLES[group], file=file, key=f"{group}[{i}]", problems=problems)
            if group in TABLES
            else _plugin(entry, group, f"{group}[{i}]", file, problems)
            for i, entry in enumerate(tables(table.get(group, []), group, file, problems))
        }
        entries[group] = {i: entry for i, entry in read_entries.items() if entry is not None}
    for group in ("sources", "safety", "ergonomics"):
        entries[group] = _named(entries[group])
    head = {key: value for key, value in table.items() if key not in groups}
    hidden = (*_NOT_IN_FILE, *groups)
    station = convert(head, Workstation, file=file, key="", problems=problems, hidden=hidden, beside=groups)
    problems += naming.check(naming.declared(table), entries, file)
    if station is None or problems:
        more = len(problems) - _MAX_PROBLEMS
        if more > 0:
            problems[_MAX_PROBLEMS:] = [Problem(file, "", f"and {more} mistakes more", "mend these first")]
        return None, problems
    return msgspec.structs.replace(station, **{g: tuple(found.values()) for g, found in entries.items()}), []


def _plugin(
    entry: Mapping[str, Any], group: str, key: str, file: str, problems: list[Problem]
) -> Struct | None:
    kind = entry.get("kind")
    if not isinstance(kind, str):
        what = "missing" if kind is None else f"{kind!r} is not text"
        known = ", ".join(plugin.kinds(group)) or "none ships here; a dotted name is a module of your own"
        problems.append(Problem(file, f"{key}.kind", what, f"kinds of [[{group}]]: {known}"))
        return None
    try:
        wanted = plugin.load(group, kind, BASES[group])
    except SeerobError as error:
        problems.append(Problem(file, f"{key}.kind", str(error)))
        return None
    rest = {name: value for name, value in entry.items() if name != "kind"}
    return convert(rest, wanted, file=file, key=key, problems=problems, beside=("kind",))


def _named(entries: Mapping[int, Any]) -> dict[int, Any]:
    """Give every criterion and source that has no name one that says what it is."""
    taken = {entry.name for entry in entries.values()}
    named = {}
    for i, entry in entries.items():
        if entry.name:
            named[i] = entry
            continue
        kind = type(entry).__module__.rsplit(".", 1)[-1]
        subjects = entry.subjects() if isinstance(entry, Criterion) else (entry.target(),)
        base = default_name(kind, tuple(s for s in subjects if s))
        name, n = base, 1
        while name in taken:
            n += 1
            name = f"{base} {n}"
        taken.add(name)
        named[i] = msgspec.structs.replace(entry, name=name)
    return named


def default_name(kind: str, subjects: tuple[str, ...]) -> str:
    """``minimum distance ur10 – operator`` of a kind and the names it speaks of."""
    words = re.sub(r"[_.]+", " ", kind).strip()
    return f"{words} {' – '.join(subjects)}".strip()
