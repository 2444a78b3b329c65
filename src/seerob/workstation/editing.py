"""Edits of a workstation file as values: what is not edited stays byte for byte, comments and order included.

A file is cut at the headers of its tables; only the piece that a change is about is written anew, by
`tomlkit`. What comes out is read again and compared with what was asked for, so that a form of TOML which
this does not know ends in a refusal, never in another file than was meant.
"""

from __future__ import annotations

import copy
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeGuard

import tomlkit
from tomlkit.exceptions import TOMLKitError

from seerob.core.errors import InputError
from seerob.core.files.toml_file import loads
from seerob.core.snapshot import Change

Path = tuple[str | int, ...]

_TOKEN = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}|'
    + r"'''.*?'{3,5}|"
    + r'"(?:[^"\\\n]|\\.)*"|'
    + r"'[^'\n]*'|#[^\n]*|\n|[\[\]{}]",
    re.DOTALL,
)
_BARE = re.compile(r"[A-Za-z0-9_-]+")
DEEPEST = 12
"""Levels that the value of a change may have."""
_WRONG = (TOMLKitError, tomllib.TOMLDecodeError, LookupError, TypeError, ValueError, AttributeError)
"""What a change raises that cannot be made."""


class Event(NamedTuple):
    """What a change did to places: something was written at one, or an entry of a list came or went."""

    kind: str
    """``wrote``, ``came`` or ``went``."""
    path: Path


class _Piece(NamedTuple):
    """Lines of a file that are one table, or one entry of a list of tables, with comments that touch it.

    What stands apart from tables, such as the title of a section, belongs to none.
    """

    path: Path
    """``("parts", 1)``, ``("engine",)``; empty for what stands before the first header."""
    begin: int
    end: int


# -- changes ------------------------------------------------------------------------------------


def changed(raw: bytes, changes: Sequence[Change], file: str) -> tuple[bytes, list[Event]]:
    """A file with changes made to it, in order, and what that did to places.

    Args:
        raw: The file.
        changes: Each counts in what those before it made.
        file: Its name, for messages.

    Raises:
        InputError: A change leads nowhere, has a value that TOML has not, or cannot be made in the form that
            the file has there.
    """
    mark = b"\xef\xbb\xbf" if raw.startswith(b"\xef\xbb\xbf") else b""
    text = raw.decode("utf-8-sig")
    ends = text.count("\r\n")
    if ends and ends != text.count("\n"):
        raise InputError.at(file, "", "has lines of two kinds of ends", "save it with one of them")
    text = text.replace("\r\n", "\n")
    events: list[Event] = []
    for run in _runs(changes):
        if len(run) > 1:
            try:
                text, found = _made(text, run, _rewritten_at_once)
                events += found
                continue
            except _WRONG:  # one by one, to say which it is
                pass
        for change in run:
            try:
                text, found = _made(text, [change], lambda text, run: _rewritten(text, run[0]))
            except _WRONG as error:
                what = (
                    str(error) if isinstance(error, ValueError) and str(error) else "there is no such place"
                )
                remedy = "edit the file by hand, or read it again"
                raise InputError.at(file, named(change.path), what, remedy) from error
            events += found
    return mark + text.replace("\n", "\r\n" if ends else "\n").encode(), events


def _runs(changes: Sequence[Change]) -> Iterator[list[Change]]:
    """Changes that follow each other and can be written at once.

    These are new entries of one list, entries of it that go, from the end, or keys of entries.
    """
    run: list[Change] = []
    for change in changes:
        if run and not (_kind(change) == _kind(run[0]) != () and _goes_on(run[-1], change)):
            yield run
            run = []
        run.append(change)
    if run:
        yield run


def _kind(change: Change) -> tuple[object, ...]:
    match change.kind, len(change.path):
        case "add", 1:
            return "add", change.path[0]
        case "remove", 2 if isinstance(change.path[1], int):
            return "remove", change.path[0]
        case (("set" | "remove"), 3) if isinstance(change.path[1], int):
            return ("key",)
    return ()


def _goes_on(before: Change, change: Change) -> bool:
    return len(change.path) != 2 or int(change.path[1]) < int(before.path[1])


def _made(
    text: str, run: Sequence[Change], write: Callable[[str, Sequence[Change]], str]
) -> tuple[str, list[Event]]:
    """The text with changes made, which is what they make of what the text says; and their events."""
    plain = loads(text)
    events = []
    for change in run:
        _check_value(change.value)
        events.append(_apply(plain, change))
    text = write(text, run)
    if _told(loads(text)) != _told(plain):
        raise ValueError("is written in a form that cannot be edited here")
    return text, events


def named(path: Path) -> str:
    """A place as messages name it: ``robots[0].base.position``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def value_at(table: Mapping[str, Any], path: Path) -> Any:
    """What stands at a place; None where nothing does."""
    at: Any = table
    for part in path:
        try:
            at = at[part]
        except (LookupError, TypeError):
            return None
    return at


def literal(value: object) -> str:
    """A value in TOML, in one line: ``{ position = [0, 0, 0.75] }``."""
    match value:
        case dict():
            inner = ", ".join(f"{_key(str(key))} = {literal(item)}" for key, item in value.items())
            return f"{{ {inner} }}" if inner else "{}"
        case list() | tuple():
            return f"[{', '.join(map(literal, value))}]"
        case float():
            return repr(value)
        case _:
            return str(tomlkit.item(value).as_string())


def _key(text: str) -> str:
    return text if _BARE.fullmatch(text) else str(tomlkit.item(text).as_string())


def _check_value(value: object, level: int = 0) -> None:
    if level > DEEPEST:
        raise ValueError("nested too deeply")
    match value:
        case dict():
            for key, item in value.items():
                if not isinstance(key, str):
                    raise ValueError(f"{key!r} is no key")
                _check_value(item, level + 1)
        case list() | tuple():
            for item in value:
                _check_value(item, level + 1)
        case bool() | str():
            pass
        case int():
            if value.bit_length() > 63:
                raise ValueError("a whole number of more than 64 bits")
        case float():
            if not math.isfinite(value):
                raise ValueError(f"{value} is no number that can be meant")
        case None if level == 0:
            pass
        case _:
            raise ValueError(f"TOML has no {type(value).__name__}")


def _told(table: Mapping[str, object]) -> str:
    """A file as text, whatever the order of its keys; a list of no tables is written nowhere."""
    return json.dumps({k: v for k, v in table.items() if v != []}, sort_keys=True, default=str)


def _apply(plain: dict[str, Any], change: Change) -> Event:
    """Make a change in what was read."""
    path = change.path
    if not path or not isinstance(path[0], str):
        raise ValueError("the whole file is no key")
    if any(isinstance(part, int) and part < 0 for part in path):
        raise LookupError
    match change.kind:
        case "set":
            if change.value is None:
                raise ValueError("set needs a value")
            _of(plain, path[:-1], path[-1])[path[-1]] = _lists(change.value)
            return Event("wrote", path)
        case "remove":
            del _of(plain, path[:-1], path[-1])[path[-1]]
            return Event("went" if isinstance(path[-1], int) else "wrote", path)
        case "add":
            if not isinstance(change.value, dict):
                raise ValueError("add needs a table")
            entries = _of(plain, path[:-1], path[-1]).setdefault(path[-1], [])
            entries.append(_lists(change.value))
            return Event("came", (*path, len(entries) - 1))
        case "copy":
            entries = value_at(plain, path[:-1])
            if not isinstance(path[-1], int) or not isinstance(change.value, dict | None):
                raise ValueError("copy needs an entry, and a table of what is different in it")
            entries.append({**copy.deepcopy(entries[path[-1]]), **_lists(change.value or {})})
            return Event("came", (*path[:-1], len(entries) - 1))
    raise ValueError(f"{change.kind!r} is no kind of change")


def _of(plain: Any, path: Path, key: str | int) -> Any:
    at = plain
    for part in path:
        at = at[part]
    if not isinstance(at, list if isinstance(key, int) else dict):
        raise LookupError
    return at


def _lists(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _lists(item) for key, item in value.items()}
    return [_lists(item) for item in value] if isinstance(value, list | tuple) else value


# -- text ---------------------------------------------------------------------------------------


def _rewritten_at_once(text: str, run: Sequence[Change]) -> str:
    """The file with changes of one of `_runs` made."""
    lines = re.findall(r"[^\n]*\n|[^\n]+", text)
    pieces = list(_pieces(text, lines))
    if run[0].kind == "add":
        (group,) = run[0].path
        entries = [piece for piece in pieces if len(piece.path) == 2 and piece.path[0] == group]
        if not entries and group in loads(text):
            raise ValueError("its list is written in another form")
        return _inserted(lines, entries, "\n".join(_new_entry(change) for change in run))
    by_path = {piece.path: piece for piece in pieces}
    if len(run[0].path) == 2:
        for change in run:
            lines = _without_piece(lines, by_path[change.path])
        return "".join(lines)
    of_piece: dict[Path, list[Change]] = {}
    for change in run:
        of_piece.setdefault(change.path[:2], []).append(change)
    for path, changes in of_piece.items():
        piece = by_path[path]
        body = "".join(lines[piece.begin : piece.end])
        for change in changes:
            body += "" if body.endswith("\n") else "\n"
            inner = (path[0], 0, *change.path[2:])
            body = _in_piece(body, Change(kind=change.kind, path=inner, value=change.value))
        lines[piece.begin : piece.end] = [body, *[""] * (piece.end - piece.begin - 1)]
    return "".join(lines)


def _new_entry(change: Change) -> str:
    """A table as it is written by hand: lists of tables, such as waypoints, behind it with their headers."""
    name = _key(str(change.path[0]))
    table = _table(change.value)
    lists = {key: value for key, value in table.items() if _are_tables(value)}
    text = f"[[{name}]]\n{_body({key: value for key, value in table.items() if key not in lists})}"
    for key, entries in lists.items():
        for entry in entries:
            text += f"\n[[{name}.{_key(key)}]]\n{_body(entry)}"
    return text


def _body(table: Mapping[str, object]) -> str:
    return "".join(f"{_key(key)} = {literal(value)}\n" for key, value in table.items())


def _are_tables(value: object) -> TypeGuard[Sequence[dict[str, object]]]:
    return (
        isinstance(value, list | tuple) and len(value) > 0 and all(isinstance(each, dict) for each in value)
    )


def _without_piece(lines: list[str], piece: _Piece) -> list[str]:
    before, after = lines[: piece.begin], lines[piece.end :]
    while after and not after[0].strip():
        after.pop(0)
    while not after and before and not before[-1].strip():
        before.pop()
    return before + after


def _rewritten(text: str, change: Change) -> str:
    """The file with one change made; only lines of the piece that it is about are others."""
    lines = re.findall(r"[^\n]*\n|[^\n]+", text)
    pieces = list(_pieces(text, lines))
    path = change.path
    entries = [piece for piece in pieces if len(piece.path) == 2 and piece.path[0] == path[0]]
    if change.kind == "add" and len(path) == 1 and (entries or path[0] not in loads(text)):
        return _inserted(lines, entries, _new_entry(change))
    piece = next((p for p in pieces if p.path and path[: len(p.path)] == p.path), None)
    if piece is None:
        piece = next((p for p in pieces if p.path == ()), _Piece((), 0, 0))
    if path == piece.path and change.kind == "remove":
        return "".join(_without_piece(lines, piece))
    body = "".join(lines[piece.begin : piece.end])
    if body and not body.endswith("\n"):
        body += "\n"
    if path == piece.path and change.kind == "copy":
        for key, value in _table(change.value).items():
            body = _in_piece(body, Change(kind="set", path=(path[0], 0, key), value=value))
        return _inserted(lines, entries, body)
    within = (path[0], 0, *path[2:]) if len(piece.path) == 2 else path
    new = _in_piece(body, Change(kind=change.kind, path=within, value=change.value))
    return "".join(lines[: piece.begin]) + new + "".join(lines[piece.end :])


def _table(value: object) -> dict[str, object]:
    return value if isinstance(value, dict) else {}


def _inserted(lines: list[str], entries: list[_Piece], body: str) -> str:
    """A table behind the last one of its list, or at the end."""
    at = entries[-1].end if entries else len(lines)
    before, after = "".join(lines[:at]), "".join(lines[at:])
    if before and not before.endswith("\n"):
        before += "\n"
    if before and not before.endswith("\n\n"):
        before += "\n"
    return before + body + ("" if not after or after.startswith("\n") else "\n") + after


def _in_piece(body: str, change: Change) -> str:
    document = tomlkit.parse(body)
    at: Any = document
    for part in change.path[:-1]:
        at = at[part]
    key: Any = change.path[-1]
    match change.kind:
        case "set" if isinstance(at, tomlkit.items.InlineTable) and key not in at:
            # As it is written by hand, with spaces inside of the braces.
            inner = at.as_string().strip()[1:-1].strip()
            more = f"{_key(key)} = {literal(change.value)}"
            around: Any = document
            for part in change.path[:-2]:
                around = around[part]
            around[change.path[-2]] = tomlkit.value(f"{{ {inner + ', ' if inner else ''}{more} }}")
        case "set":
            at[key] = tomlkit.value(literal(change.value))
        case "remove":
            del at[key]
        case "add" if key not in at:
            at[key] = tomlkit.value(literal([change.value]))
        case "add":
            if isinstance(at[key], tomlkit.items.AoT) and not at[key][-1].as_string().endswith("\n\n"):
                at[key][-1].add(tomlkit.nl())
            at[key].append(_entry(at[key], change.value))
        case _:
            at.append(_entry(at, {**at[key].unwrap(), **_table(change.value)}))
    return document.as_string()


def _entry(entries: object, value: Any) -> Any:
    if not isinstance(entries, tomlkit.items.AoT):
        return tomlkit.value(literal(value))
    table = tomlkit.table()
    for key, item in value.items():
        table.add(key, tomlkit.value(literal(item)))
    return table


def _pieces(text: str, lines: list[str]) -> Iterator[_Piece]:
    """The tables of a file that TOML's own reader has read."""
    headers: list[tuple[int, str]] = []
    depth, line, start = 0, 0, 0
    for found in _TOKEN.finditer(text):
        sign = found[0]
        if sign in "[{":
            if sign == "[" and depth == 0 and not text[start : found.start()].strip():
                headers.append((line, lines[line]))
            depth += 1
        elif sign in "]}":
            depth -= 1
        else:
            line += sign.count("\n")
            if "\n" in sign:
                start = found.start() + sign.rindex("\n") + 1
    counts: dict[str, int] = {}
    begun: list[tuple[Path, int]] = [((), 0)]
    for at, header in headers:
        top = next(iter(tomllib.loads(header).items()))
        path: Path = (top[0],)
        if top[1] == [{}]:
            counts[top[0]] = counts.get(top[0], -1) + 1
            path = (top[0], counts[top[0]])
        elif top[0] in counts:
            path = (top[0], counts[top[0]])
            if begun[-1][0] == path:
                continue
        first = at
        while first > begun[-1][1] and lines[first - 1].lstrip().startswith("#"):
            first -= 1
        begun.append((path, first))
    ends = [first for _, first in begun[1:]] + [len(lines)]
    for (path, first), end in zip(begun, ends, strict=True):
        last = end
        while last > first and (not lines[last - 1].strip() or lines[last - 1].lstrip().startswith("#")):
            last -= 1
        while first < last < end and lines[last].strip():
            last += 1
        yield _Piece(path, first, last)


# -- at the same time ---------------------------------------------------------------------------

_LAST = 1 << 62
"""Number of an entry that comes behind all others, however many there are."""


class Overlap(Exception):
    """Two edits are about one place."""

    def __init__(self, path: Path) -> None:
        self.path = path
        super().__init__(named(path))


def exchanged(changes: Sequence[Change], events: Sequence[Event]) -> tuple[list[Change], list[Event]]:
    """What was to be done before something else, to be done behind it, and that to be done before.

    Args:
        changes: In order, each in places as those before it leave them.
        events: What was done to the same file instead, in order.

    Returns:
        The changes in places as the events leave them, and the events in those that the changes leave.

    Raises:
        Overlap: Both are about one place, where the changes were to be made.
    """
    made: list[Change] = []
    others = list(events)
    for change in changes:
        path, own, after = change.path, _event(change), list[Event]()
        for other in others:
            found = _moved(path, other, writes=change.kind in ("set", "remove"))
            after.append(_event_behind(other, own, change.path))
            own = _event_behind(own, other, change.path)
            if found is None:
                raise Overlap(change.path)
            path = found
        made.append(Change(kind=change.kind, path=path, value=change.value))
        others = after
    return made, others


def undone(events: Sequence[Event]) -> list[Event]:
    """What takes events back."""
    opposite = {"came": "went", "went": "came"}
    return [Event(opposite.get(event.kind, event.kind), event.path) for event in reversed(events)]


def _event(change: Change) -> Event:
    match change.kind:
        case "add":
            return Event("came", (*change.path, _LAST))
        case "copy":
            return Event("came", (*change.path[:-1], _LAST))
        case "remove" if change.path and isinstance(change.path[-1], int):
            return Event("went", change.path)
    return Event("wrote", change.path)


def _event_behind(event: Event, other: Event, place: Path) -> Event:
    path = _moved(event.path, other, writes=event.kind != "came", comes=event.kind == "came")
    if path is None:
        raise Overlap(place)
    return Event(event.kind, path)


def _moved(path: Path, event: Event, *, writes: bool, comes: bool = False) -> Path | None:
    """A place as it is called after an event; None where the event is about it."""
    other = event.path
    if event.kind == "wrote":
        return None if path[: len(other)] == other or (writes and other[: len(path)] == path) else path
    group, i = other[:-1], other[-1]
    if len(path) <= len(group):
        return None if writes and group[: len(path)] == path else path
    j = path[len(group)]
    if path[: len(group)] != group or not (isinstance(i, int) and isinstance(j, int)):
        return path
    if event.kind == "went" and j == i and not (comes and len(path) == len(other)):
        return None
    step = (1 if j >= i else 0) if event.kind == "came" else (-1 if j > i else 0)
    return (*group, j + step, *path[len(group) + 1 :])
