"""The quantities of a workstation, what is implausible of them, and what its file confirms of that."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

import msgspec

from seerob.core.errors import Problem, suggestion
from seerob.core.snapshot import Finding
from seerob.workstation.plausibility.ranges import (
    Quantity,
    canonical,
    how_to_confirm,
    implausible,
    quantities,
    row_of,
    same,
    scaled,
    sentence,
)
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
        "stands_on_nothing",
    ),
    "tools": ("mass", "extent", "bulk_density"),
    "workpieces": ("mass", "extent", "bulk_density"),
    "parts": ("extent", "bulk_density", "inside."),
    "machines": ("extent", "mass", "bulk_density", "nobody_within"),
    "sources": ("step", "degrees", "speed"),
    "humans": ("bmi", "feet", "inside."),
}
"""What follows from a table and can be implausible, by table; with a point at the end, of a name."""
KEY = re.compile(r"([a-z]+)\[(\d{1,6})\]\.(.+)")


def entries_of(station: Workstation) -> dict[str, dict[int, Any]]:
    """The lists of tables of a workstation, as `seerob.session.reading` has them."""
    return {group: dict(enumerate(getattr(station, group))) for group in (*LISTS, *PLUGINS)}


def listed(entries: Entries, engine: Engine) -> Iterator[Quantity]:
    """Every quantity that somebody typed."""
    for group in LISTS:
        for i, table in entries.get(group, {}).items():
            yield from quantities(
                table, key=f"{group}[{i}]", kind=group, about=_about(group, table, entries), of=name_of(table)
            )
    for group in PLUGINS:
        for i, table in entries.get(group, {}).items():
            kind = f"{group}.{type(table).__module__.rsplit('.', 1)[-1]}"
            about = ((table.target() or "*") if group == "sources" else table.name,)
            yield from quantities(table, key=f"{group}[{i}]", kind=kind, about=about, of=name_of(table))
    yield from quantities(engine, key="engine", kind="engine", about=("*",))


def name_of(entry: Any) -> str:
    """What an entry of a list of tables is called; a phase has a title. Empty for one that has none."""
    return str(getattr(entry, "name", "") or getattr(entry, "title", ""))


def _about(group: str, table: Any, entries: Entries) -> tuple[str, ...]:
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
    if match[1] == "robots" and match[3].endswith(".bulk_density"):
        masses = entries["robots"][int(match[2])].masses
        return match[3].removeprefix("masses.").removesuffix(".bulk_density") in masses
    names = {entry.name for group in LISTS[:-1] for entry in entries.get(group, {}).values()}
    return any(
        match[3].removeprefix(what) in names if what.endswith(".") else match[3] == what
        for what in FOLLOWS.get(match[1], ())
    )
