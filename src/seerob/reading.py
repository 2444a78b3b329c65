"""Reading tables of a file into typed structs, collecting every mistake on the way."""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin

import msgspec
from msgspec import Struct

from seerob import plugin, units
from seerob.criterion import Criterion
from seerob.errors import InputError, Problem, UnknownName, suggestion
from seerob.sink import Sink
from seerob.source import Source
from seerob.workstation import (
    PLUGINS,
    Workstation,
    check_names,
    default_name,
    locate,
    read_toml,
    source_target_problem,
)

T = TypeVar("T", bound=Struct)

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


def convert_workstation(table: dict[str, Any], file: str) -> tuple[Workstation | None, list[Problem]]:
    """The typed workstation of a parsed file, and every mistake that was found."""
    problems: list[Problem] = []
    plain = {key: value for key, value in table.items() if key not in PLUGINS}
    station = convert(
        plain, Workstation, file=file, key="", problems=problems, hidden=(*_NOT_IN_FILE, *PLUGINS)
    )
    plugins: dict[str, tuple[Any, ...]] = {}
    for group in PLUGINS:
        entries = table.get(group, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            problems.append(Problem(file, group, "is not a list of tables", f"write [[{group}]]"))
            continue
        read_entries = [
            _plugin(entry, group, f"{group}[{i}]", file, problems) for i, entry in enumerate(entries)
        ]
        plugins[group] = tuple(entry for entry in read_entries if entry is not None)
    if station is None or len(problems) > _MAX_PROBLEMS:
        return None, problems[:_MAX_PROBLEMS]
    station = msgspec.structs.replace(station, **_named(plugins))
    problems += check_names(station, file)
    problems += _check_plugins(station, file)
    return station, problems


def _plugin(entry: dict[str, Any], group: str, key: str, file: str, problems: list[Problem]) -> Struct | None:
    kind = entry.get("kind")
    if not isinstance(kind, str):
        known = ", ".join(plugin.kinds(group)) or "none"
        problems.append(Problem(file, f"{key}.kind", "missing", f"kinds of [[{group}]]: {known}"))
        return None
    try:
        wanted = plugin.load(group, kind, BASES[group])
    except UnknownName as error:
        problems.append(Problem(file, f"{key}.kind", str(error)))
        return None
    rest = {name: value for name, value in entry.items() if name != "kind"}
    return convert(rest, wanted, file=file, key=key, problems=problems)


def _named(plugins: dict[str, tuple[Any, ...]]) -> dict[str, tuple[Any, ...]]:
    """Give every criterion and source that has no name one that says what it is."""
    for group in ("sources", "safety", "ergonomics"):
        named: list[Any] = []
        for entry in plugins.get(group, ()):
            if not entry.name:
                kind = type(entry).__module__.rsplit(".", 1)[-1]
                subjects = entry.subjects() if isinstance(entry, Criterion) else (entry.target(),)
                taken = {other.name for other in named}
                base = default_name(kind, tuple(s for s in subjects if s))
                name, n = base, 1
                while name in taken:
                    n += 1
                    name = f"{base} {n}"
                entry = msgspec.structs.replace(entry, name=name)  # noqa: PLW2901
            named.append(entry)
        plugins[group] = tuple(named)
    return plugins


def _check_plugins(station: Workstation, file: str) -> list[Problem]:
    problems: list[Problem] = []
    known = {r.name for r in station.robots} | {h.name for h in station.humans}
    driven: dict[str, str] = {}
    for i, source in enumerate(station.sources):
        target = source.target()
        problem = source_target_problem(target, known, file, f"sources[{i}]")
        if problem is not None:
            problems.append(problem)
        elif target in driven:
            problems.append(
                Problem(
                    file, f"sources[{i}]", f"{target!r} is already driven by {driven[target]}", "keep one"
                )
            )
        driven.setdefault(target, f"sources[{i}]")
    seen: dict[str, str] = {}
    for group in ("safety", "ergonomics"):
        for i, criterion in enumerate(getattr(station, group)):
            if criterion.name in seen:
                problems.append(
                    Problem(
                        file,
                        f"{group}[{i}].name",
                        f"the name {criterion.name!r} is taken by {seen[criterion.name]}",
                        "choose another",
                    )
                )
            seen.setdefault(criterion.name, f"{group}[{i}]")
    return problems


def convert(
    table: Mapping[str, Any],
    wanted: type[T],
    *,
    file: str,
    key: str,
    problems: list[Problem],
    hidden: tuple[str, ...] = (),
) -> T | None:
    """A struct of a table; mistakes are appended to ``problems`` and make it None.

    Args:
        table: As TOML has it.
        wanted: A `msgspec.Struct` type; fields whose metadata carry a unit accept keys with a suffix.
        file: For messages.
        key: Place of the table in the file, for messages.
        problems: Receives every mistake.
        hidden: Fields that the file may not set.
    """
    fields = {f.encode_name: f for f in msgspec.structs.fields(wanted) if f.encode_name not in hidden}
    before = len(problems)
    values: dict[str, Any] = {}
    for name, value in table.items():
        place = f"{key}.{name}" if key else name
        field, factor = _field(name, fields)
        if field is None:
            problems.append(Problem(file, place, "unknown key", suggestion(name, fields)))
        elif field in values:
            problems.append(Problem(file, place, f"{field!r} is given twice, in two units", "keep one"))
        else:
            if factor is not None:
                value = _scaled(value, factor, place, file, problems)  # noqa: PLW2901
            values[field] = _value(value, fields[field].type, place, file, problems)
    for name, info in fields.items():
        if info.required and name not in values:
            unit = _unit_of(info.type)
            problems.append(
                Problem(
                    file, f"{key}.{name}" if key else name, "missing", f"give it [{unit}]" if unit else ""
                )
            )
    if len(problems) > before:
        return None
    try:
        return wanted(**values)
    except (TypeError, ValueError) as error:
        problems.append(Problem(file, key, str(error)))
        return None


def _field(name: str, fields: Mapping[str, Any]) -> tuple[str | None, float | None]:
    """Field and factor that a key means: itself, or a field with a unit suffix."""
    if name in fields:
        return name, None
    parts = units.split(name)
    if parts is None or parts[0] not in fields:
        return None, None
    stem, unit, factor = parts
    return (stem, factor) if _unit_of(fields[stem].type) == unit else (None, None)


def _unit_of(wanted: Any) -> str | None:
    """Unit in the metadata of a type, also inside ``X | None`` and ``dict[str, X]``."""
    for item in (wanted, *get_args(wanted)):
        for meta in getattr(item, "__metadata__", ()):
            if isinstance(meta, msgspec.Meta) and meta.extra and "unit" in meta.extra:
                return str(meta.extra["unit"])
        for inner in get_args(item) if get_origin(item) in (Union, types.UnionType) else ():
            found = _unit_of(inner)
            if found:
                return found
    return None


def _scaled(value: Any, factor: float, place: str, file: str, problems: list[Problem]) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float | list | dict):
        problems.append(Problem(file, place, f"{value!r} is not a number", "a key with a unit takes numbers"))
        return value
    if isinstance(value, list):
        return [_scaled(item, factor, place, file, problems) for item in value]
    if isinstance(value, dict):
        return {name: _scaled(item, factor, place, file, problems) for name, item in value.items()}
    return value * factor


def _value(value: Any, wanted: Any, place: str, file: str, problems: list[Problem]) -> Any:
    options = [o for o in get_args(wanted) if o is not type(None)] if _is_union(wanted) else [wanted]
    for option in options:
        if isinstance(option, type) and issubclass(option, Struct) and isinstance(value, dict):
            return convert(value, option, file=file, key=place, problems=problems)
        item = get_args(option)
        if item and isinstance(item[0], type) and issubclass(item[0], Struct) and isinstance(value, list):
            return tuple(
                _value(entry, item[0], f"{place}[{i}]", file, problems) for i, entry in enumerate(value)
            )
        if get_origin(option) is dict and isinstance(value, dict) and _is_struct(item[1]):
            return {n: _value(entry, item[1], f"{place}.{n}", file, problems) for n, entry in value.items()}
    if _not_finite(value):
        problems.append(Problem(file, place, f"{value!r} is not finite", "give a finite number"))
        return None
    try:
        return msgspec.convert(value, wanted)
    except msgspec.ValidationError as error:
        where, _, what = str(error).partition(" - at `$")
        inner = what.rstrip("`") if what else ""
        problems.append(Problem(file, place + inner, f"{_short(value)} is wrong", where))
        return None


def _is_union(wanted: Any) -> bool:
    return get_origin(wanted) in (Union, types.UnionType)


def _is_struct(wanted: Any) -> bool:
    return isinstance(wanted, type) and issubclass(wanted, Struct)


def _not_finite(value: Any) -> bool:
    if isinstance(value, float):
        return not math.isfinite(value)
    if isinstance(value, list):
        return any(map(_not_finite, value))
    return isinstance(value, dict) and any(map(_not_finite, value.values()))


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
