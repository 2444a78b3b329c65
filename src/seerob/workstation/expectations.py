"""What a field of a table expects, in words that an engineer reads: the remedy of a wrong value."""

from __future__ import annotations

import re
import types
from enum import Enum
from typing import Any, Literal, Union, get_args, get_origin

import msgspec
from msgspec import Struct

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


def is_struct(wanted: Any) -> bool:
    """Whether a type is a table."""
    return isinstance(wanted, type) and issubclass(wanted, Struct)


def unit_of(wanted: Any) -> str | None:
    """Unit in the metadata of a type, also inside ``X | None`` and ``dict[str, X]``."""
    for meta in getattr(wanted, "__metadata__", ()):
        if isinstance(meta, msgspec.Meta) and meta.extra and "unit" in meta.extra:
            return str(meta.extra["unit"])
    is_union = get_origin(wanted) in (Union, types.UnionType)
    if is_union or get_origin(wanted) is dict:
        return next((found for item in get_args(wanted) if (found := unit_of(item))), None)
    return None


def choices(wanted: Any) -> tuple[str, ...]:
    """What a closed set allows; empty when the type is not one."""
    found: list[str] = []
    for member in members(wanted):
        if get_origin(member) is Literal:
            found += map(str, get_args(member))
        elif isinstance(member, type) and issubclass(member, Enum):
            found += [str(item.value) for item in member]
    return tuple(found)


def described(wanted: Any) -> str | None:
    """What the metadata of a type say in words, also inside ``X | Y``."""
    for meta in getattr(wanted, "__metadata__", ()):
        if isinstance(meta, msgspec.Meta) and meta.description:
            return str(meta.description)
    if get_origin(wanted) in (Union, types.UnionType):
        return next((found for item in get_args(wanted) if (found := described(item))), None)
    return None


def expected(wanted: Any, complaint: str) -> str:
    """What would be right, from the type and the complaint of `msgspec`.

    Args:
        wanted: The field's type.
        complaint: Message of a `msgspec.ValidationError` without its place.
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
    return f"expected {' or '.join(nouns)}{rest}" + (f" [{unit}]" if unit else "")
