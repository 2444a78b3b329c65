"""Reading a workstation file: typed tables, plug-ins by their kind, and every mistake at once."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from msgspec import Struct

from seerob.core import plugin
from seerob.core.errors import InputError, Problem, SeerobError
from seerob.core.files.bounded import leads_outside
from seerob.core.files.toml_file import parsed_toml, read_toml
from seerob.criteria.criterion import Criterion
from seerob.outputs.sink import Sink
from seerob.workstation import naming
from seerob.workstation.allowed import NOTHING, Allowed, Named, named_outside
from seerob.workstation.conversion import convert, tables
from seerob.workstation.plausibility.ranges import unknown
from seerob.workstation.source import Emulator, Source
from seerob.workstation.tables.controller_zones import zones_of
from seerob.workstation.workstation import PLUGINS, TABLES, Robot, Workstation, locate

BASES: dict[str, type[Struct]] = {
    "sources": Source,
    "safety": Criterion,
    "ergonomics": Criterion,
    "sinks": Sink,
    "emulators": Emulator,
}
"""Plug-in table → base class of its entries."""

_NOT_IN_FILE = ("folder", "outside", "files")
_MAX_PROBLEMS = 200

_log = logging.getLogger(__name__)


class Readable(NamedTuple):
    """What of a workstation file can be read, and every mistake in it."""

    head: Workstation
    """What is not in a list of tables; what is wrong there is as if it were not given."""
    entries: dict[str, dict[int, Any]]
    """List of tables → number of the entry in the file → the entry, where it could be read; of a
    robot of the library or a human, what is wrong is as if it were not given."""
    names: list[naming.Named]
    """What the file declares, also where it cannot be read."""
    problems: list[Problem]
    between: list[Problem]
    """Problems that an entry has with other entries: a name that is taken or leads nowhere."""


def read(path: Path | str, allowed: Allowed = NOTHING) -> Workstation:
    """The workstation of a file or of a folder that contains one.

    Args:
        path: The file or the folder.
        allowed: What the file may do.

    Raises:
        InputError: With every mistake in it: unknown keys, missing keys, wrong types and ranges,
            unknown kinds, names that are taken or lead nowhere.
    """
    found = readable(path, allowed)
    if found.problems:
        raise InputError(shortened(found.problems))
    return with_entries(found.head, found.entries)


def readable(path: Path | str, allowed: Allowed = NOTHING, raw: bytes | None = None) -> Readable:
    """What can be read of a file or of a folder that contains one, beside every mistake in it.

    Args:
        path: The file or the folder.
        allowed: What the file may do.
        raw: What is to be read in place of the file.

    Raises:
        InputError: There is no such file, it is not TOML, or it names files outside its folder, which are
            not allowed; nothing is read then that it names.
    """
    file = locate(path)
    table, raw = read_toml(file) if raw is None else (parsed_toml(raw, file), raw)
    files = {file.name: raw}
    problems: list[Problem] = []
    for outside in _outside(table, file):
        if allowed.replayed and outside.key.startswith("sources["):
            continue
        if not allowed.outside:
            problems.append(outside.problem(str(file)))
        else:
            _log.warning("%s: %s: reads %s, outside its folder", file, outside.key, outside.real)
    if problems:
        raise InputError(shortened(problems))
    if "zones" in table:
        zones = zones_of(table["zones"], file.parent, str(file), problems)
        files |= zones.files
        own = table.get("areas", [])
        table |= {"areas": [*own, *zones.areas] if isinstance(own, list) else own}
    found = _convert(table, str(file), allowed)
    folder = str(file.parent.resolve())
    head = msgspec.structs.replace(found.head, folder=folder, outside=allowed.outside, files=files)
    return found._replace(head=head, problems=[*problems, *found.problems])


def _outside(table: Mapping[str, object], file: Path) -> list[Named]:
    """The file itself where it is a link that leaves its folder, and what it names outside.

    Raises:
        InputError: It is nested more deeply than any table is.
    """
    real = leads_outside(file, file.parent)
    itself = [] if real is None else [Named("", file.name, real)]
    try:
        return [*itself, *named_outside(table, file.parent)]
    except ValueError as error:
        raise InputError.at(file, "", str(error), "no table needs more than four levels") from None


def convert_workstation(
    table: Mapping[str, object], file: str, allowed: Allowed = NOTHING
) -> tuple[Workstation | None, list[Problem]]:
    """The typed workstation of a parsed file, and every mistake that was found."""
    found = _convert(table, file, allowed)
    if found.problems:
        return None, shortened(found.problems)
    return with_entries(found.head, found.entries), []


def with_entries(head: Workstation, entries: Mapping[str, Mapping[int, object]]) -> Workstation:
    """A workstation of its head and its lists of tables."""
    return msgspec.structs.replace(head, **{g: tuple(found.values()) for g, found in entries.items()})


def shortened(problems: list[Problem]) -> list[Problem]:
    """At most so many mistakes as anybody reads, and how many more there are."""
    more = len(problems) - _MAX_PROBLEMS
    if more <= 0:
        return problems
    last = Problem(problems[0].file, "", f"and {more} mistakes more", "mend these first")
    return [*problems[:_MAX_PROBLEMS], last]


def _convert(table: Mapping[str, Any], file: str, allowed: Allowed = NOTHING) -> Readable:
    problems: list[Problem] = []
    groups = (*TABLES, *PLUGINS)
    entries: dict[str, dict[int, Any]] = {}
    for group in groups:
        entries[group] = {}
        for i, table_of_entry in enumerate(tables(table.get(group, []), group, file, problems)):
            entry = _entry(table_of_entry, group, f"{group}[{i}]", file, problems, allowed)
            if entry is not None:
                entries[group][i] = entry
    numbered: set[str] = set()
    for group in ("sources", "safety", "ergonomics"):
        entries[group] = _named(entries[group], numbered)
    head = _head({key: value for key, value in table.items() if key not in groups}, file, problems)
    names = naming.declared(table)
    between = naming.check(names, entries, file)
    problems += unknown(entries["confirmed"], entries, head.engine, file, numbered)
    return Readable(head, entries, names, [*problems, *between], between)


def _entry(
    table: Mapping[str, object], group: str, key: str, file: str, problems: list[Problem], allowed: Allowed
) -> Struct | None:
    if group in PLUGINS:
        return _plugin(table, group, key, file, problems, allowed)
    before = len(problems)
    entry = convert(table, TABLES[group], file=file, key=key, problems=problems)
    if entry is not None or group not in ("robots", "humans"):
        return entry
    rest = convert(_right(table, key, problems[before:]), TABLES[group], file=file, key=key, problems=[])
    # Whether a file can be read may hang on the key that is wrong: packages, arguments.
    files = isinstance(rest, Robot) and not (rest.model.startswith("library:") and rest.meshes is None)
    return None if files else rest


def _right(table: Mapping[str, object], place: str, problems: Sequence[Problem]) -> dict[str, object]:
    """A table without the keys that problems are in."""
    start = f"{place}." if place else ""
    wrong = [problem.key for problem in problems]
    return {
        name: value
        for name, value in table.items()
        if not any(
            key == start + name or key.startswith((f"{start}{name}.", f"{start}{name}[")) for key in wrong
        )
    }


def _head(table: Mapping[str, object], file: str, problems: list[Problem]) -> Workstation:
    """What is not in a list of tables; a key that is wrong is left out."""
    groups = (*TABLES, *PLUGINS)
    hidden = (*_NOT_IN_FILE, *groups)
    before = len(problems)
    head = convert(table, Workstation, file=file, key="", problems=problems, hidden=hidden, beside=groups)
    if head is not None:
        return head
    right = _right(table, "", problems[before:])
    return convert(right, Workstation, file=file, key="", problems=[], hidden=hidden) or Workstation()


def _plugin(
    entry: Mapping[str, object], group: str, key: str, file: str, problems: list[Problem], allowed: Allowed
) -> Struct | None:
    kind = entry.get("kind")
    if not isinstance(kind, str):
        what = "missing" if kind is None else f"{kind!r} is not text"
        known = ", ".join(plugin.kinds(group)) or "none ships here; a dotted name is a kind of your own"
        problems.append(Problem(file, f"{key}.kind", what, f"kinds of [[{group}]]: {known}"))
        return None
    try:
        folder = Path(file).parent
        wanted = plugin.load(group, kind, BASES[group], folder=folder, allow_plugins=allowed.plugins)
    except SeerobError as error:
        problems.append(Problem(file, f"{key}.kind", str(error)))
        return None
    rest = {name: value for name, value in entry.items() if name != "kind"}
    return convert(rest, wanted, file=file, key=key, problems=problems, beside=("kind",))


def _named(entries: Mapping[int, Any], numbered: set[str]) -> dict[int, Any]:
    """Give every criterion and source that has no name one that says what it is.

    Args:
        entries: By number.
        numbered: Gets names that are another's in another order.
    """
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
            numbered |= {base, name}
        taken.add(name)
        named[i] = msgspec.structs.replace(entry, name=name)
    return named


def default_name(kind: str, subjects: tuple[str, ...]) -> str:
    """``minimum distance ur10 – operator`` of a kind and the names it speaks of."""
    words = re.sub(r"[_.]+", " ", kind).strip()
    return f"{words} {' – '.join(subjects)}".strip()
