"""Text as people may have it on a terminal or a page: both obey what they are sent, and files name things."""

from __future__ import annotations

import re
from typing import Any, TypeVar

import msgspec

T = TypeVar("T", bound=msgspec.Struct)

_OBEYED = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""What moves the cursor, colours, answers or turns the direction of reading, and what no encoding takes."""


_WRITTEN = re.compile(
    rb"\\u00[01]|\\[bfr]|\x7f|\xc2[\x80-\x9f]|\xd8\x9c|\xe2(?:\x80[\x8e\x8f\xa8-\xae]|\x81[\xa6-\xa9])"
)
"""Matches such characters in JSON, as msgspec writes it, and at times what only looks so."""


def printable(text: str) -> str:
    """Text with what a terminal or page would obey as its escape in Python; tabs and line ends stay."""
    if text.isprintable():
        return text
    return _OBEYED.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def is_printable(text: str) -> bool:
    """Whether `printable` leaves a text, and every piece of it, as it is."""
    return _OBEYED.search(text) is None


def printable_table(value: Any) -> Any:
    """A table with every text in it `printable`, keys too."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, list | tuple):
        return [printable_table(item) for item in value]
    if isinstance(value, dict):
        return {printable_table(key): printable_table(item) for key, item in value.items()}
    return value


def printable_record(record: T) -> T:
    """A record with every text in it `printable`; itself where all of them are."""
    if _WRITTEN.search(msgspec.json.encode(record)) is None:
        return record
    told = printable_table(msgspec.to_builtins(record, builtin_types=(bytes,)))
    return msgspec.convert(told, type(record), builtin_types=(bytes,))


def obeyed(text: str) -> str:
    """The first character that a terminal or page would obey, as ``U+202E``; empty where there is none."""
    found = None if text.isprintable() else _OBEYED.search(text)
    return f"U+{ord(found[0]):04X}" if found else ""
