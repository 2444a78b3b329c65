"""Every quantity of a workstation file against the range in which it is plausible; see ``ranges.toml``.

A quantity is found by the unit in its field's metadata, so that those of criteria and sources that somebody
adds are looked at too. What is only a default is not: nobody typed it.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import msgspec
from msgspec import Struct

from seerob.core.units import splits
from seerob.workstation.expectations import unit_of

EQUAL = 1e-6
"""By so much, relative, a value may differ from the one that was confirmed: the rounding of a conversion."""


class Range(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A row of ``ranges.toml``."""

    key: str = "*"
    unit: str
    low: float = 0.0
    high: float = math.inf
    zero: bool = False
    norm: bool = False
    because: str
    right: str
    source: str
    confidence: str


class Payload(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What makers rate robots for."""

    models: tuple[str, ...]
    kg: float
    source: str


class _File(Struct, frozen=True, forbid_unknown_fields=True):
    ranges: tuple[Range, ...]
    payloads: tuple[Payload, ...]


@cache
def data() -> _File:
    """The data file."""
    raw = files("seerob.workstation.plausibility").joinpath("ranges.toml").read_text("utf-8")
    return msgspec.convert(tomllib.loads(raw), _File)


class Quantity(NamedTuple):
    """A number, or several, of the workstation, in SI."""

    key: str
    """Where it stands in the file: ``safety[2].stop.reaction``; for what follows from several, what of it."""
    kind: str
    """What sort of quantity it is, spelled as in `Range.key`: ``safety.separation.stop.reaction``."""
    unit: str
    values: tuple[float, ...]
    about: tuple[str, ...]
    """Names of what nothing can be said of when it is wrong; ``*`` for everything."""
    said: str = ""
    """What it follows from, where it does not stand in the file."""
    of: str = ""
    """Name of the entry that it is of; empty where it is of none in a list."""


# -- mathematics --------------------------------------------------------------------------------


def row_of(quantity: Quantity) -> Range | None:
    """The first row that is of it; None when none is."""
    fitting = (
        row for row in data().ranges if row.unit == quantity.unit and fnmatchcase(quantity.kind, row.key)
    )
    return next(fitting, None)


def implausible(values: Sequence[float], row: Range) -> float | None:
    """The first value outside of a range, or the length of the vector where that counts; None for none."""
    looked_at = [math.hypot(*values)] if row.norm else [abs(x) for x in values]
    for size, value in zip(looked_at, looked_at if row.norm else values, strict=True):
        if not (size == 0 and row.zero) and not row.low <= size <= row.high:
            return value
    return None


def sentence(quantity: Quantity, value: float, row: Range) -> str:
    """What is implausible, and what would be right."""
    numbers = quantity.values
    all_of_it = shown(numbers[0]) if len(numbers) == 1 else f"[{', '.join(map(shown, numbers[:12]))}]"
    unit = f" {quantity.unit}".rstrip()
    beyond = f"more than {row.high:g}" if abs(value) > row.high else f"less than {row.low:g}"
    less = "" if len(numbers) == 1 else f"{shown(value)} is "
    said = f" ({quantity.said})" if quantity.said else ""
    return (
        f"{quantity.key} = {all_of_it}{unit}{said}: {less}{beyond}{unit}, which is not plausible: "
        f"{row.because}; {row.right}"
    )


def how_to_confirm(quantity: Quantity) -> str:
    """The lines of the file that say that it is meant."""
    numbers = [float(shown(x)) if quantity.said else x for x in quantity.values]
    value = numbers[0] if len(numbers) == 1 else numbers
    of = f"of = {json.dumps(quantity.of, ensure_ascii=False)}, " if quantity.of else ""
    return f'or confirm it: [[confirmed]] key = "{quantity.key}", {of}value = {value!r}, why = "…"'


def shown(value: float) -> str:
    """A number for a message."""
    return f"{value:.6g}"


def same(given: Any, quantity: Quantity) -> bool:
    """Whether the value of a confirmation, a number or lists of them, is that of the quantity."""
    numbers = tuple(_numbers(given))
    # What does not stand in the file was read off a message that rounds.
    near = 5e-3 if quantity.said else EQUAL
    return len(numbers) == len(quantity.values) and all(
        math.isclose(a, b, rel_tol=near, abs_tol=1e-12) for a, b in zip(numbers, quantity.values, strict=True)
    )


def canonical(key: str) -> Iterator[tuple[str, float]]:
    """A key with the factor to SI: as it is, or without a suffix such as ``_deg``."""
    yield key, 1.0
    for stem, _, factor in splits(key):
        yield stem, factor


def scaled(given: Any, factor: float) -> Any:
    """Numbers times a factor, at any depth."""
    if isinstance(given, list | tuple):
        return [scaled(item, factor) for item in given]
    return given * factor


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, bool):
        return
    if isinstance(value, int | float):
        yield float(value)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _numbers(item)


# -- the quantities of a table ------------------------------------------------------------------


def quantities(
    table: Struct, *, key: str, kind: str, about: tuple[str, ...], of: str = ""
) -> Iterator[Quantity]:
    """Every quantity of a table and of the tables in it that is not a default.

    Args:
        table: Of the workstation.
        key: Where it stands in the file.
        kind: The same without the numbers of entries, a criterion or a source with its kind.
        about: Of what nothing can be said when a quantity is wrong.
        of: Name of the entry.
    """
    for quantity in _quantities(table, key, kind, about):
        yield quantity._replace(of=of)


def _quantities(table: Struct, key: str, kind: str, about: tuple[str, ...]) -> Iterator[Quantity]:
    for field in msgspec.structs.fields(type(table)):
        value = getattr(table, field.name)
        default = field.default
        if field.default_factory is not msgspec.NODEFAULT:
            default = field.default_factory()
        if value is None or (default is not msgspec.NODEFAULT and value == default):
            continue
        place = f"{key}.{field.encode_name}", f"{kind}.{field.encode_name}"
        yield from _of_value(value, field.type, *place, about)


def _of_value(value: Any, wanted: Any, key: str, kind: str, about: tuple[str, ...]) -> Iterator[Quantity]:
    if isinstance(value, Struct):
        yield from _quantities(value, key, kind, about)
    elif isinstance(value, Mapping):
        for name, entry in value.items():
            yield from _of_value(entry, wanted, f"{key}.{name}", f"{kind}.{name}", about)
    elif isinstance(value, list | tuple) and any(isinstance(entry, Struct) for entry in value):
        for i, entry in enumerate(value):
            yield from _of_value(entry, wanted, f"{key}[{i}]", kind, about)
    elif numbers := tuple(_numbers(value)):
        # What has no unit of its own, or one that hangs on the joint, is looked at where a row names it.
        yield Quantity(key, kind, unit_of(wanted) or "", numbers, about)
