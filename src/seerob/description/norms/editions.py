"""Which editions of norms the figures of a run are from: as their bases say, not as the file asks."""

from __future__ import annotations

import re
from collections.abc import Iterable

from seerob.core.snapshot import Basis

_EDITION = re.compile(r"\b(?:ISO|EN|IEC)(?:[ /](?:TS|TR|ISO|EN|IEC))*[ /]\d+(?:-\d+)?:\d{4}\b")
_NOT_USED = re.compile(r"used for [^;,()]*")


def editions(bases: Iterable[Basis | None]) -> tuple[str, ...]:
    """Editions that sources of formulae and inputs name, sorted, each once."""
    found: set[str] = set()
    for basis in bases:
        for text in () if basis is None else (basis.source, *(given.source for given in basis.inputs)):
            found.update(_EDITION.findall(_NOT_USED.sub("", text)))
    return tuple(sorted(found))


def headline(bases: Iterable[Basis | None], asked: str) -> str:
    """The editions in words, with the one that the file asks for where no figure is from it.

    Args:
        bases: Of all criteria.
        asked: ``edition`` of the workstation file.
    """
    used = editions(bases)
    text = ", ".join(used) if used else "no norm"
    if asked == "ISO/TS 15066:2016" or asked in used:
        return text
    return f"{text}; {asked} is asked for, and no figure here is from it"
