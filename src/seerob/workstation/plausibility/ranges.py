"""Every quantity of a workstation file against the range in which it is plausible; see ``ranges.toml``.

A quantity is found by the unit in its field's metadata, so that those of criteria and sources that somebody
adds are looked at too. What is only a default is not: nobody typed it.

The quantities of a workstation, what is implausible of them, and what its file confirms of that.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import cache, lru_cache
from importlib.resources import files
from typing import Any, NamedTuple

import msgspec
from msgspec import Struct

from seerob.core.errors import Problem, suggestion
from seerob.core.quantities import splits
from seerob.core.snapshot import Finding
from seerob.workstation.conversion import fields_of, unit_of
from seerob.workstation.workstation import Confirmed, Engine, Workstation

Entries = Mapping[str, Mapping[int, Any]]
"""Table → number of the entry → the entry."""

LISTS = ("robots", "tools", "workpieces", "parts", "machines", "areas", "sensors", "humans", "phases")
PLUGINS = ("sources", "safety", "ergonomics")
FOLLOWS: dict[str, tuple[str, ...]] = {
    "robots": (
        "payload",
        "published_mass.share",
        "constraints_left_out",
        "nobody_within",
        "inside.",
        "height",
        "below_floor",
        "stands_on_nothing",
    ),
    "tools": ("mass", "extent", "bulk_density", "com_outside", "gyration", "apart", "tcp_outside", "across"),
    "workpieces": ("mass", "extent", "bulk_density", "com_outside", "gyration", "apart"),
    "parts": ("extent", "bulk_density", "inside."),
    "areas": ("extent", "below_floor"),
    "sensors": ("below_floor",),
    "machines": ("extent", "mass", "bulk_density", "com_outside", "gyration", "nobody_within"),
    "sources": ("step", "degrees", "speed"),
    "humans": ("bmi", "feet", "feet_below", "inside."),
}
"""What follows from a table and can be implausible, by table; with a point at the end, of a name."""
OF_LINKS = ("bulk_density", "com_outside", "gyration")
"""What follows from the mass that the file gives to a link of a robot."""
KEY = re.compile(r"([a-z]+)\[(\d{1,6})\]\.(.+)")


def entries_of(station: Workstation) -> dict[str, dict[int, Any]]:
    """The lists of tables of a workstation, as `seerob.session.reading` has them."""
    return {group: dict(enumerate(getattr(station, group))) for group in (*LISTS, *PLUGINS)}


def listed(entries: Entries, engine: Engine) -> Iterator[Quantity]:
    """Every quantity that somebody typed."""
    for group in LISTS:
        for i, table in entries.get(group, {}).items():
            of_adults = {f"{group}[{i}].stature", f"{group}[{i}].mass"} if group == "humans" else set()
            for quantity in quantities(
                table,
                key=f"{group}[{i}]",
                kind=group,
                about=resting(group, table, entries),
                of=name_of(table),
            ):
                # What is loose lies in the cell, and on no tool.
                lies = quantity.kind == "workpieces.at.position" and table.loose
                if quantity.key not in of_adults or table.adult:
                    yield quantity._replace(kind="parts.at.position") if lies else quantity
    for group in PLUGINS:
        for i, table in entries.get(group, {}).items():
            kind = f"{group}.{type(table).__module__.rsplit('.', 1)[-1]}"
            about = ((table.target() or "*") if group == "sources" else table.name,)
            yield from quantities(table, key=f"{group}[{i}]", kind=kind, about=about, of=name_of(table))
    yield from quantities(engine, key="engine", kind="engine", about=("*",))
    if any(engine.gravity):
        down = -engine.gravity[2] / math.hypot(*engine.gravity)
        key, angle = "engine.gravity.turned", math.acos(max(-1.0, min(1.0, down)))
        yield Quantity(key, key, "rad", (angle,), ("*",), f"gravity = {list(engine.gravity)} m/s²")


def name_of(entry: Any) -> str:
    """What an entry of a list of tables is called; a phase has a title. Empty for one that has none."""
    return str(getattr(entry, "name", "") or getattr(entry, "title", ""))


def resting(group: str, table: Any, entries: Entries) -> tuple[str, ...]:
    """Names of what rests on an entry."""
    if group == "phases":
        return ("*",)
    if group != "sensors":
        return (table.name,)
    criteria = [one for kind in ("safety", "ergonomics") for one in entries.get(kind, {}).values()]
    return (table.name, *(one.name for one in criteria if table.name in _texts(one)))


def _texts(table: Any) -> set[str]:
    """Every text that a table says, at any depth."""
    found, waiting = set(), [msgspec.to_builtins(table, enc_hook=str)]
    while waiting:
        value = waiting.pop()
        if isinstance(value, str):
            found.add(value)
        elif isinstance(value, dict):
            waiting += value.values()
        elif isinstance(value, list | tuple):
            waiting += value
    return found


def findings(all_of_them: Iterable[Quantity], confirmed: Sequence[Confirmed]) -> Iterator[Finding]:
    """What is implausible, each a finding that holds what it is about unless its value is confirmed."""
    for quantity in all_of_them:
        row = row_of(quantity)
        value = None if row is None else implausible(quantity.values, row)
        if row is None or value is None:
            continue
        text = sentence(quantity, value, row)
        why, other = confirmation(quantity, confirmed)
        subject = next((name for name in quantity.about if name != "*"), quantity.key)
        if why:
            text = f"{text.partition(', which is not plausible')[0]}; confirmed: {why}"
            yield Finding(level="note", subject=subject, text=text)
            continue
        text += other
        text += f"; {how_to_confirm(quantity)}"
        yield Finding(level="warning", subject=subject, text=text, holds=quantity.about)


def confirmation(quantity: Quantity, confirmed: Sequence[Confirmed]) -> tuple[str, str]:
    """Why a quantity is as it is meant, empty when nobody says so, and what is confirmed of it instead."""
    said = [(one, factor) for one in confirmed for k, factor in canonical(one.key) if k == quantity.key]
    why = next((one.why for one, factor in said if same(scaled(one.value, factor), quantity)), "")
    return why, f"; the file confirms {said[0][0].value}, another value" if said and not why else ""


def unknown(
    confirmed: Mapping[int, Confirmed],
    entries: Entries,
    engine: Engine,
    file: str,
    numbered: Collection[str] = (),
) -> list[Problem]:
    """Confirmations of what the file does not have, or that may be of another entry.

    Args:
        confirmed: By number.
        entries: What they may be of.
        engine: Likewise.
        file: For the messages.
        numbered: Names that nobody gave, and that are another's in another order.
    """
    if not confirmed:
        return []
    known = [quantity.key for quantity in listed(entries, engine)]
    problems: list[Problem] = []
    for i, one in confirmed.items():
        keys = [key for key, _ in canonical(one.key)]
        if any(key in known or _follows(key, entries) for key in keys):
            problems += _of_another(one, entries, numbered, file, f"confirmed[{i}].of")
            continue
        what = f"{one.key!r} is no quantity of this file: nothing is confirmed"
        problems.append(Problem(file, f"confirmed[{i}].key", what, suggestion(one.key, known)))
    return problems


def _of_another(
    one: Confirmed, entries: Entries, numbered: Collection[str], file: str, place: str
) -> Iterator[Problem]:
    """Why a confirmation may be of another entry than it was meant for: it has to say which."""
    match = KEY.fullmatch(one.key)
    if match is None:
        return
    group, i = match[1], int(match[2])
    names = {k: name_of(entry) for k, entry in entries[group].items()}
    if not names[i]:
        yield Problem(file, place, f"{group}[{i}] has no title", "give it one, and write it here")
    elif names[i] in numbered or list(names.values()).count(names[i]) > 1:
        yield Problem(
            file, place, f"several of {group} are called {names[i]!r}", "give each a name of its own"
        )
    elif one.of is None:
        remedy = f"of = {json.dumps(names[i], ensure_ascii=False)}, if that is meant"
        yield Problem(file, place, f"missing: nothing says which of {group} it is of", remedy)
    elif one.of != names[i]:
        right = next((f'key = "{group}[{k}].{match[3]}"' for k, name in names.items() if name == one.of), "")
        what = f"{group}[{i}] is {names[i]!r}, not {one.of!r}: nothing is confirmed"
        yield Problem(file, place, what, right or "confirm it anew where it is meant")


def _follows(key: str, entries: Entries) -> bool:
    """Whether a key is of what follows from an entry that is there."""
    if key.startswith("variables."):
        return True  # of the dictionary, which is another file
    match = KEY.fullmatch(key)
    if match is None or int(match[2]) not in entries.get(match[1], {}):
        return False
    link, _, what = match[3].removeprefix("masses.").rpartition(".")
    if match[1] == "robots" and what in OF_LINKS:
        return link in entries["robots"][int(match[2])].masses
    names = {entry.name for group in LISTS[:-1] for entry in entries.get(group, {}).values()}
    return any(
        match[3].removeprefix(what) in names if what.endswith(".") else match[3] == what
        for what in FOLLOWS.get(match[1], ())
    )


ROUND = 6e-4
"""By so much, relative, a round angle that is typed in radians may be off: 3.14 for π."""
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
    twice: bool = False
    last: bool = False
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
    return _row(quantity.kind, quantity.unit)


@lru_cache(4096)
def _row(kind: str, unit: str) -> Range | None:
    return next((row for row in data().ranges if row.unit == unit and fnmatchcase(kind, row.key)), None)


def implausible(values: Sequence[float], row: Range) -> float | None:
    """The first value outside of a range, or the length of the vector where that counts; None for none."""
    looked_at = [math.hypot(*values)] if row.norm else [abs(x) for x in values]
    for size, value in zip(looked_at, looked_at if row.norm else values, strict=True):
        if not (size == 0 and row.zero) and not row.low <= size <= row.high:
            return value
        if row.twice and converted_twice(size):
            return value
    if row.last and turned_in_another_order(values):
        return values[-1]
    return None


def converted_twice(angle: float) -> bool:
    """Whether an angle [rad] is a round one in radians, a multiple of 45°, that was read in degrees."""
    eighths = math.degrees(abs(angle)) / (math.pi / 4)
    return 0 < round(eighths) <= 8 and abs(eighths - round(eighths)) <= ROUND * eighths


def turned_in_another_order(wxyz: Sequence[float]) -> bool:
    """Whether a quaternion is one about z, or none, with w last: with w first it turns things over."""
    w, x, _, z = wxyz
    return w == 0 and x == 0 and z != 0


def sentence(quantity: Quantity, value: float, row: Range) -> str:
    """What is implausible, and what would be right."""
    numbers = quantity.values
    all_of_it = shown(numbers[0]) if len(numbers) == 1 else f"[{', '.join(map(shown, numbers[:12]))}]"
    unit = f" {quantity.unit}".rstrip()
    beyond = f"more than {row.high:g}{unit}" if abs(value) > row.high else f"less than {row.low:g}{unit}"
    if row.twice and converted_twice(value):
        typed = math.degrees(value)
        beyond = f"{typed:.6g}°, which would be {math.degrees(typed):.3g}° were it in radians"
    if row.last and turned_in_another_order(numbers):
        beyond = f"a turn of {2 * math.degrees(math.acos(min(abs(numbers[3]), 1))):.4g}° about z with w last"
    less = "" if len(numbers) == 1 else f"{shown(value)} is "
    said = f" ({quantity.said})" if quantity.said else ""
    return (
        f"{quantity.key} = {all_of_it}{unit}{said}: {less}{beyond}, which is not plausible: "
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
    for field in fields_of(type(table)):
        value = getattr(table, field.name)
        default = field.default
        if field.default_factory is not msgspec.NODEFAULT:
            default = field.default_factory()
        if value is None or (default is not msgspec.NODEFAULT and value == default):
            continue
        place = f"{key}.{field.encode_name}", f"{kind}.{field.encode_name}"
        yield from _of_value(value, field.type, *place, about)
    for name, unit, values in getattr(table, "derived", tuple)():
        yield Quantity(f"{key}.{name}", f"{kind}.{name}", unit, values, about, "way over speed times time")


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
