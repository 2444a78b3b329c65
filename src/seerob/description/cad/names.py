"""Names of CAD files as names may be here: ASCII, without blanks, each of them once."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable

LONGEST_NAME = 60
"""Of one name in a path [characters]."""
LONGEST_PATH = 190
"""Of a full name [characters], before a number tells it from others."""


def plain_name(name: str) -> str:
    """A name in letters, digits, ``_``, ``.`` and ``-``; letters of other scripts as ``u4e2d``."""
    decomposed = unicodedata.normalize("NFKD", name)
    letters = (
        "" if unicodedata.combining(c) else c if c.isascii() or not c.isalnum() else f"u{ord(c):x}"
        for c in decomposed
    )
    return re.sub(r"[^A-Za-z0-9_.\-]+", "_", "".join(letters)).strip("_.")[:LONGEST_NAME] or "unnamed"


def full_name(path: Iterable[str]) -> str:
    """``line/fixture_2/clamp_1``; what is too long loses names behind the first."""
    names = [plain_name(name) for name in path] or ["unnamed"]
    while len("/".join(names)) > LONGEST_PATH and len(names) > 1:
        del names[1 if len(names) > 2 else 0]
    return "/".join(names)


def told_apart(names: Iterable[str]) -> list[str]:
    """Names with a number where they are there again: ``pin``, ``pin_2``; none that another one has."""
    wanted = list(names)
    given = set(wanted)
    taken: set[str] = set()
    numbers: dict[str, int] = {}
    found = []
    for name in wanted:
        one = name
        while one in taken or (one != name and one in given):
            numbers[name] = numbers.get(name, 1) + 1
            one = f"{name}_{numbers[name]}"
        taken.add(one)
        found.append(one)
    return found
