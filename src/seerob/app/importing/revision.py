"""A new revision of a CAD file in a folder that was made of an older one: what stays, comes, moves and goes.

Parts are the same where their full names are, whatever their only root is called. What the user wrote in
their tables stays; what the import wrote and nobody changed becomes what it writes now. Comments and the
order of the file stay.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import numpy as np

from seerob.core.errors import InputError
from seerob.core.page_messages import Change
from seerob.description.cad.assembly import Assembly
from seerob.workstation.editing import changed

_MESH = re.compile(r"cad/[\w.\-]+\.glb|robots/[\w\-][\w.\-]*/(?:meshes/)?[\w.\-]+\.(?:stl|urdf)", re.ASCII)
"""Names of files that an import makes; nothing else is removed, whatever a stranger's table says."""
NEAR = 1e-6
"""Places that differ by less are one [m]."""


class Revision(NamedTuple):
    """What a new revision does to a folder."""

    text: bytes
    """The workstation file."""
    told: tuple[tuple[str, str], ...]
    """What is new: a word, and what it is about."""
    unused: tuple[str, ...]
    """Mesh files of the older revision that no table names any more."""


def under_former_root(assembly: Assembly, before: Mapping[str, Any]) -> tuple[Assembly, str]:
    """The assembly under the name that everything of the older revision is under, and what is told of it.

    CAD systems call the root as the file, which a new revision often calls otherwise. It is the same root
    where both revisions have one alone, and at least half of the fewer names below are in both.

    Args:
        assembly: Of the new revision.
        before: The table of the older one.
    """
    older = [row["name"].partition("/") for row in before["parts"]]
    newer = [name.partition("/") for name in assembly.names()]
    roots = [{root for root, _, _ in names} for names in (older, newer)]
    if len(roots[0]) != 1 or len(roots[1]) != 1 or roots[0] == roots[1]:
        return assembly, ""
    (was,), (now,) = roots
    below = [{rest for _, _, rest in names if rest} for names in (older, newer)]
    same, fewer = len(below[0] & below[1]), min(map(len, below))
    if not fewer or 2 * same < fewer:
        return assembly, ""
    instances = tuple(replace(i, path=(was, *i.path[1:])) for i in assembly.instances)
    left_out = tuple(
        (was + name.removeprefix(now) if name.partition("/")[0] == now else name, why)
        for name, why in assembly.left_out
    )
    text = f"{now} is taken as {was}, for {same} of {len(below[0])} names below it are the same"
    return replace(assembly, instances=instances, left_out=left_out), text


def revised(
    raw: bytes, before: Mapping[str, Any], rows: Mapping[str, tuple[dict[str, Any], ...]], file: str
) -> Revision:
    """The workstation file with the parts and mechanisms of a new revision.

    Args:
        raw: The workstation file.
        before: The table of the older revision.
        rows: Of the table of the new one, by the table of the workstation file that they are written to.
        file: Name of the workstation file, for messages.

    Raises:
        InputError: It cannot be read or edited, or something new has the name of one of the user's.
    """
    changes, told = changes_of(read_tables(raw, file), before, rows, file)
    text, _ = changed(raw, changes, file)
    named = {entry.get("mesh") for entry in _tables(tomllib.loads(text.decode("utf-8-sig")))}
    now = {name for of_group in rows.values() for row in of_group for name in _files(row)}
    made = {name for group in rows for row in before.get(group, ()) for name in _files(row)}
    unused = sorted(name for name in made - named - now if _MESH.fullmatch(name))
    return Revision(text, tuple(told), tuple(unused))


def read_tables(raw: bytes, file: str) -> dict[str, Any]:
    """What a workstation file says.

    Raises:
        InputError: It cannot be read.
    """
    try:
        return tomllib.loads(raw.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputError.at(file, "", f"cannot be read: {error}", "mend it first") from error


def changes_of(
    table: Mapping[str, Any],
    before: Mapping[str, Any],
    rows: Mapping[str, tuple[dict[str, Any], ...]],
    file: str,
) -> tuple[list[Change], list[tuple[str, str]]]:
    """What of a workstation file changes with a new revision, and what is told of it.

    Args:
        table: What the file says.
        before: As of `revised`, as the others.
        rows: Likewise.
        file: Likewise.

    Raises:
        InputError: Something new has the name of one of the user's.
    """
    changes: list[Change] = []
    told: list[tuple[str, str]] = []
    for group, of_group in rows.items():
        _revise_group(group, table, before.get(group, ()), of_group, file, changes, told)
    return changes, told


def _files(row: Mapping[str, Any]) -> list[str]:
    return [str(name) for name in (row.get("mesh"), *row.get("files", ())) if name]


def _revise_group(
    group: str,
    table: Mapping[str, Any],
    former: Iterable[Mapping[str, Any]],
    rows: tuple[dict[str, Any], ...],
    file: str,
    changes: list[Change],
    told: list[tuple[str, str]],
) -> None:
    """Adds what becomes of one list of tables, and what is told of it."""
    entries = [entry for entry in table.get(group, []) if isinstance(entry, dict)]
    at = {entry.get("name"): number for number, entry in enumerate(entries)}
    old = {row["name"]: row for row in former}
    new = {row["name"]: row for row in rows}
    added: list[Change] = []

    def tell(word: str, name: str, what: str = "") -> None:
        touched = ", ".join(_touched(table, group, name))
        told.append((word, f"{name}{what}" + (f": touches {touched}" if touched else "")))

    for name, row in new.items():
        if name not in old:
            if name in at:
                what = f"one of yours is called {name}, as a new one of the CAD file"
                raise InputError.at(file, f"{group}[{at[name]}].name", what, "give yours another name")
            added.append(Change(kind="add", path=(group,), value=row["written"]))
            tell("added", name)
        elif name not in at:
            tell("left out", name, ", whose table was taken out by hand")
        else:
            where = group, at[name]
            kept = list(_changes(where, entries[at[name]], old[name]["written"], row["written"], changes))
            if how := _differs(old[name], row):
                tell(how, name)
            told += [("kept", f"{name}: {key} as it was changed by hand") for key in kept]
    changes += added  # kinds one after another, which are written at once
    lost = [name for name in old if name not in new]
    # From the end, so that numbers of entries stay what they are.
    for name in sorted((n for n in lost if n in at), key=lambda n: -at[n]):
        changes.append(Change(kind="remove", path=(group, at[name])))
    for name in lost:
        tell("lost", name)
    told += [("renamed?", text) for text in _renamed(old, new, lost)]


def _changes(
    where: tuple[str, int],
    entry: Mapping[str, Any],
    old: Mapping[str, Any],
    new: Mapping[str, Any],
    changes: list[Change],
) -> Iterator[str]:
    """Adds what a table gets; yields keys that the user changed and the new revision would change too."""
    for key in dict.fromkeys((*old, *new)):
        if old.get(key) == new.get(key):
            continue
        if entry.get(key) != old.get(key):
            yield key
        elif key in new:
            changes.append(Change(kind="set", path=(*where, key), value=new[key]))
        else:
            changes.append(Change(kind="remove", path=(*where, key)))


def _differs(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """``moved``, ``resized``, both, or nothing."""
    words = []
    if any(old["written"].get(key) != new["written"].get(key) for key in ("at", "base")):
        words.append("moved")
    if old["shape"] != new["shape"]:
        words.append(
            "resized" if "box" in old and np.abs(_size(old) - _size(new)).max() > NEAR else "reshaped"
        )
    return " and ".join(words)


def _size(row: Mapping[str, Any]) -> Any:
    return np.ptp(np.array(row["box"], float), axis=0)


def _renamed(old: Mapping[str, Any], new: Mapping[str, Any], lost: list[str]) -> Iterator[str]:
    """Lost parts that are perhaps new ones: of one shape, nearest first."""
    free = [name for name in new if name not in old]
    for name in lost:
        alike = [other for other in free if new[other]["shape"] == old[name]["shape"]]
        if not alike:
            continue
        if "box" not in old[name]:
            free.remove(alike[0])
            yield f"{name} is perhaps {alike[0]} now: the same links and joints"
            continue

        def away(other: str, name: str = name) -> float:
            middles = [np.mean(row["box"], axis=0) for row in (old[name], new[other])]
            return float(np.linalg.norm(middles[0] - middles[1]))

        best = min(alike, key=away)
        free.remove(best)
        where = "the same place" if away(best) < NEAR else f"{away(best):.3g} m away"
        yield f"{name} is perhaps {best} now: the same shape, {where}"


def _touched(table: Mapping[str, Any], of: str, name: str) -> Iterator[str]:
    """Tables that name a part, by pattern or as what lies above it."""
    for group, rows in table.items():
        for number, row in enumerate(rows if isinstance(rows, list) else ()):
            if group == of or not isinstance(row, dict):
                continue
            if any(_means(text, name) for text in _texts(row)):
                label = row.get("name") or row.get("kind") or number
                yield f"{group} {label}"


def _means(text: str, name: str) -> bool:
    return name == text or name.startswith(f"{text}/") or ("*" in text and fnmatchcase(name, text))


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _texts(item)


def _tables(table: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    for rows in table.values():
        for row in rows if isinstance(rows, list) else ():
            if isinstance(row, dict):
                yield row
