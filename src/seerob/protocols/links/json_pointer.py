"""Values inside a JSON document by JSON pointer (RFC 6901)."""

from __future__ import annotations

import json

from seerob.protocols import ProtocolError

LARGEST = 1 << 20
"""Document [byte]."""
DEEPEST = 32
"""Parts of a pointer."""


def document(data: bytes | str) -> object:
    """A JSON document; NaN and Infinity, which JSON does not have, are refused.

    Raises:
        ProtocolError: It is too large, or no JSON.
    """
    if len(data) > LARGEST:
        raise ProtocolError(f"a document of {len(data)} bytes; at most {LARGEST} are read")
    try:
        return json.loads(data, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise ProtocolError(f"no JSON: {str(error)[:100]}") from None


def _refuse(word: str) -> object:
    raise ValueError(f"{word} is no JSON value")


def parts(pointer: str) -> tuple[str, ...]:
    """The parts of a pointer; empty for the whole document.

    Raises:
        ValueError: It is no pointer.
    """
    if pointer == "":
        return ()
    if not pointer.startswith("/") or pointer.count("/") > DEEPEST:
        raise ValueError(f"{pointer!r} is no JSON pointer: write /a/b/0")
    return tuple(p.replace("~1", "/").replace("~0", "~") for p in pointer[1:].split("/"))


def at(value: object, pointer: tuple[str, ...]) -> object:
    """What a pointer leads to.

    Raises:
        KeyError: It leads nowhere.
    """
    for part in pointer:
        if isinstance(value, dict):
            value = value[part]
        elif isinstance(value, list) and part.isdecimal() and int(part) < len(value):
            value = value[int(part)]
        else:
            raise KeyError(part)
    return value
