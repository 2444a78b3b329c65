"""From a table of a file to a typed struct, collecting every mistake on the way.

What a field of a table expects, in words that an engineer reads: the remedy of a wrong value.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Collection, Mapping
from enum import Enum
from functools import cache
from typing import Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin

import msgspec
from msgspec import Struct

from seerob.core import quantities
from seerob.core.errors import Problem, suggestion

_NOUNS = {
    "float": "a number",
    "int": "a whole number",
    "str": "text in quotes",
    "bool": "true or false",
    "array": "a list [...]",
    "object": "a table {...}",
    "null": "nothing",
}


def members(wanted: Any) -> tuple[Any, ...]:
    """The types that a union is made of, without None; a type that is none, alone."""
    while hasattr(wanted, "__metadata__"):
        wanted = wanted.__origin__
    if get_origin(wanted) in (Union, types.UnionType):
        return tuple(m for item in get_args(wanted) if item is not type(None) for m in members(item))
    return (wanted,)


@cache
def fields_of(table: type[Struct]) -> tuple[msgspec.structs.FieldInfo, ...]:
    """Fields of a table: to ask msgspec for them evaluates every annotation anew."""
    return msgspec.structs.fields(table)


def is_struct(wanted: object) -> bool:
    """Whether a type is a table."""
    return isinstance(wanted, type) and issubclass(wanted, Struct)


def unit_of(wanted: object) -> str | None:
    """Unit in the metadata of a type, also inside ``X | None`` and ``dict[str, X]``."""
    for meta in getattr(wanted, "__metadata__", ()):
        if isinstance(meta, msgspec.Meta) and meta.extra and "unit" in meta.extra:
            return str(meta.extra["unit"])
    is_union = get_origin(wanted) in (Union, types.UnionType)
    if is_union or get_origin(wanted) is dict:
        return next((found for item in get_args(wanted) if (found := unit_of(item))), None)
    return None


def choices(wanted: object) -> tuple[str, ...]:
    """What a closed set allows; empty when the type is not one."""
    found: list[str] = []
    for member in members(wanted):
        if get_origin(member) is Literal:
            found += map(str, get_args(member))
        elif isinstance(member, type) and issubclass(member, Enum):
            found += [str(item.value) for item in member]
    return tuple(found)


def described(wanted: object) -> str | None:
    """What the metadata of a type say in words, also inside ``X | Y``."""
    for meta in getattr(wanted, "__metadata__", ()):
        if isinstance(meta, msgspec.Meta) and meta.description:
            return str(meta.description)
    if get_origin(wanted) in (Union, types.UnionType):
        return next((found for item in get_args(wanted) if (found := described(item))), None)
    return None


class Written(NamedTuple):
    """A value as it stands in the file, under a key with a unit of its own."""

    value: object
    unit: str
    factor: float
    """SI over that unit."""


def expected(wanted: object, complaint: str, written: Written | None = None) -> str:
    """What would be right, from the type and the complaint of `msgspec`.

    Args:
        wanted: The field's type.
        complaint: Message of a `msgspec.ValidationError` without its place.
        written: What it says is in the unit of that; in SI when None.
    """
    allowed = choices(wanted)
    if allowed and ("enum" in complaint or "Expected `str`" in complaint):
        return "one of: " + ", ".join(allowed)
    if "matching regex" in complaint:
        return "expected " + (described(wanted) or complaint[complaint.index("matching") :])
    found = re.match(r"Expected `([^`]+)`(.*?)(?:, got .*)?$", complaint)
    if not found:
        return complaint[:1].lower() + complaint[1:]
    nouns = [_NOUNS.get(name, name) for name in found.group(1).split(" | ") if name != "null"]
    unit = unit_of(wanted)
    rest = re.sub(r"\.0$", "", found.group(2))
    if written is not None:
        unit, factor = written.unit, written.factor
        # A bound of the number, not of how many there are.
        rest = re.sub(r"^( [<>]=? )(\S+)$", lambda bound: f"{bound[1]}{float(bound[2]) / factor:.6g}", rest)
    return f"expected {' or '.join(nouns)}{rest}" + (f" [{unit}]" if unit else "")


T = TypeVar("T", bound=Struct)

_ALSO_CALLED = {"height": "stature", "weight": "mass", "gender": "sex"}
"""Keys as others would call them."""
LARGEST = 1e9
"""Numbers beyond this are mistakes: no quantity of a workstation needs them in SI."""


def convert(
    table: Mapping[str, object],
    wanted: type[T],
    *,
    file: str,
    key: str,
    problems: list[Problem],
    hidden: Collection[str] = (),
    beside: Collection[str] = (),
) -> T | None:
    """A struct of a table; mistakes are appended to ``problems`` and make it None.

    Args:
        table: As TOML has it.
        wanted: A `msgspec.Struct` type; fields whose metadata carry a unit accept keys with a suffix.
        file: For messages.
        key: Place of the table in the file, for messages.
        problems: Receives every mistake.
        hidden: Fields that the table may not set.
        beside: Keys that somebody else reads, to be named as right ones.
    """
    fields = {f.encode_name: f for f in fields_of(wanted) if f.encode_name not in hidden}
    before = len(problems)
    values: dict[str, object] = {}
    given = {field for name in table if (field := _field(name, fields)[0]) is not None}
    missing = [name for name, info in fields.items() if info.required and name not in given]
    for name, value in table.items():
        place = _join(key, name)
        field, suffix = _field(name, fields)
        if field is None:
            remedy = _wrong_unit(name, fields) or suggestion(name, [*fields, *beside])
            meant = _ALSO_CALLED.get(name) or (missing[0] if len(missing) == 1 else "")
            if meant in missing and "did you mean" not in remedy:
                remedy = f"did you mean {meant!r}, which is missing? {remedy}"
            problems.append(Problem(file, place, "unknown key", remedy))
        elif field in values:
            problems.append(Problem(file, place, f"{field!r} is given twice, in two units", "keep one"))
        else:
            written = None
            if suffix is not None:
                factor = quantities.SUFFIXES[suffix][1]
                written = Written(value, _UNITS.get(suffix, suffix), factor)
                value = _scaled(value, factor)  # noqa: PLW2901
            values[field] = _value(value, fields[field].type, place, file, problems, written)
    for name, info in fields.items():
        if info.required and name not in values:
            problems.append(Problem(file, _join(key, name), "missing", _give(info.type)))
    if len(problems) > before:
        return None
    try:
        return wanted(**values)
    except (TypeError, ValueError) as error:
        problems.append(Problem(file, key, str(error)))
        return None


def tables(value: Any, place: str, file: str, problems: list[Problem]) -> list[Mapping[str, Any]]:
    """The entries of a list of tables; what is not one is a mistake."""
    if isinstance(value, dict):
        problems.append(Problem(file, place, "is one table, not a list of tables", f"write [[{place}]]"))
    elif not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
        problems.append(Problem(file, place, f"{short(value)} is not a list of tables", f"write [[{place}]]"))
    else:
        return value
    return []


def short(value: object) -> str:
    """A value for a message."""
    text = (
        "nothing"
        if value is None
        else "true"
        if value is True
        else "false"
        if value is False
        else repr(value)
    )
    return text if len(text) <= 60 else text[:57] + "..."


def _join(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name


def _give(wanted: object) -> str:
    unit = unit_of(wanted)
    if unit:
        return f"give it [{unit}]"
    try:
        msgspec.convert(object(), wanted)
    except msgspec.ValidationError as error:
        return expected(wanted, str(error)).replace("expected", "give", 1)
    return ""


_UNITS = {"deg_s": "deg/s", "mm_s": "mm/s", "g_cm3": "g/cm³"}
"""Units of suffixes that are written otherwise than these."""


def _field(name: str, fields: Mapping[str, Any]) -> tuple[str | None, str | None]:
    """Field and suffix that a key means: itself, or a field with a unit suffix."""
    if name in fields:
        return name, None
    for stem, unit, _ in quantities.splits(name):
        if stem in fields and unit_of(fields[stem].type) == unit:
            return stem, name.removeprefix(stem + "_")
    return None, None


def _wrong_unit(name: str, fields: Mapping[str, Any]) -> str:
    """What to say of ``mass_mm``: the field exists, but not in that unit."""
    for stem, _, _ in quantities.splits(name):
        if stem in fields:
            unit = unit_of(fields[stem].type)
            if unit is None:
                return f"{stem!r} is no quantity with a unit that could be converted"
            suffixes = [f"{stem}_{suffix}" for suffix, (si, _) in quantities.SUFFIXES.items() if si == unit]
            return f"{stem!r} is in {unit}: write " + " or ".join([stem, *suffixes])
    return ""


def _scaled(value: object, factor: float) -> object:
    """Numbers times a factor, at any depth; what is not a number is left for `_value` to refuse."""
    if isinstance(value, bool) or not isinstance(value, int | float | list | dict):
        return value
    if isinstance(value, list):
        return [_scaled(item, factor) for item in value]
    if isinstance(value, dict):
        return {name: _scaled(item, factor) for name, item in value.items()}
    return value * factor if abs(value) < LARGEST * LARGEST else math.inf


def _value(
    value: Any,
    wanted: Any,
    place: str,
    file: str,
    problems: list[Problem],
    written: Written | None = None,
) -> Any:
    for option in members(wanted) if isinstance(value, dict | list) else ():
        arguments = get_args(option)
        if is_struct(option) and isinstance(value, dict):
            return convert(value, option, file=file, key=place, problems=problems)
        if get_origin(option) is tuple and is_struct(arguments[0]) and isinstance(value, list):
            entries = tables(value, place, file, problems)
            return tuple(
                convert(entry, arguments[0], file=file, key=f"{place}[{i}]", problems=problems)
                for i, entry in enumerate(entries)
            )
        if get_origin(option) is dict and isinstance(value, dict) and is_struct(arguments[1]):
            return {
                n: _value(entry, arguments[1], f"{place}.{n}", file, problems) for n, entry in value.items()
            }
    unusable = _unusable(value, place)
    if unusable is not None:
        where, shown = unusable
        largest = LARGEST
        if written is not None:
            shown, largest = _inner(written.value, where.removeprefix(place)), LARGEST / written.factor
        remedy = f"expected a finite number, not beyond {largest:g}"
        problems.append(Problem(file, where, f"{short(shown)} is wrong", remedy))
        return None
    try:
        return msgspec.convert(value, wanted)
    except msgspec.ValidationError as error:
        complaint, _, path = str(error).partition(" - at `")
        path = path.rstrip("`").removeprefix("$")
        given = value if written is None else written.value
        what = f"{short(_inner(given, path))} is wrong"
        problems.append(Problem(file, place + path, what, expected(wanted, complaint, written)))
        return None


def _inner(value: object, path: str) -> object:
    """The value that ``[2][0]`` means inside another; the whole when the path cannot be followed."""
    for index in re.findall(r"\[(\d+)\]", path):
        if not isinstance(value, list) or int(index) >= len(value):
            break
        value = value[int(index)]
    return value


def _unusable(value: object, place: str) -> tuple[str, object] | None:
    """Place and value of the first number, at any depth, that is not finite or absurdly large."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return None if abs(value) <= LARGEST else (place, value)
    items: list[tuple[str, object]] = []
    if isinstance(value, list):
        items = [(f"{place}[{i}]", item) for i, item in enumerate(value)]
    elif isinstance(value, dict):
        items = [(f"{place}.{name}", item) for name, item in value.items()]
    return next((found for where, item in items if (found := _unusable(item, where))), None)
