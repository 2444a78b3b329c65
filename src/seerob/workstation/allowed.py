"""What whoever starts seerob allows a workstation file to do; the file itself cannot.

What a workstation file names outside its folder, found before any of it is read.

Every text of the file is looked at, whatever key it stands at: one that is the path of a file or folder which
lies, wherever links lead, outside the folder of the workstation file is such a name. What is installed
(``package:``) or ships (``library:``) has other names, and is not outside.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from seerob.core.errors import Problem
from seerob.core.files.bounded import REMEDY, leads_outside

MOST = 1000
"""Files of a folder that a source names which are looked at."""
DEEPEST = 32
"""No table of a workstation, nor of a plug-in, is nested more deeply."""
_LONGEST = 4096
"""Of a path [characters]."""


class Named(NamedTuple):
    """A file or folder outside."""

    key: str
    """Where the workstation file names it: ``sources[0].file``."""
    name: str
    """Name that it has."""
    real: Path
    """Where that leads."""

    def problem(self, file: str) -> Problem:
        """That it may not be read."""
        return Problem(file, self.key, f"leads to {self.real}, outside the folder of the workstation", REMEDY)


def named_outside(table: Mapping[str, object], folder: Path) -> Iterator[Named]:
    """What a workstation file names outside its folder.

    Args:
        table: The file as TOML has it.
        folder: Its folder.

    Raises:
        ValueError: It is nested more deeply than any table is.
    """
    known: dict[str, Path | None] = {}  # instances share their meshes
    for key, text in texts(table):
        if len(text) > _LONGEST:
            continue
        path = folder / text
        if text not in known:
            known[text] = leads_outside(path, folder)
        if (real := known[text]) is not None:
            yield Named(key, text, real)
        elif key.startswith("sources[") and text and path.is_dir():
            yield from (Named(key, text, real) for real in _linked(path, folder))


def _linked(folder: Path, within: Path) -> Iterator[Path]:
    """Where links in a folder lead that leave another one."""
    for _, entry in zip(range(MOST), folder.rglob("*"), strict=False):
        if entry.is_symlink() and (real := leads_outside(entry, within)) is not None:
            yield real


def texts(table: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """Every text of a file with its key, in order.

    Raises:
        ValueError: It is nested more deeply than any table is.
    """
    waiting: list[tuple[str, object, int]] = [("", table, 0)]
    while waiting:
        key, value, depth = waiting.pop()
        if depth > DEEPEST:
            raise ValueError(f"{key[:80]} …: nested too deeply")
        if isinstance(value, str):
            yield key, value
        elif isinstance(value, Mapping):
            inner = [(f"{key}.{name}" if key else name, one, depth + 1) for name, one in value.items()]
            waiting += reversed(inner)
        elif isinstance(value, list):
            waiting += reversed([(f"{key}[{i}]", one, depth + 1) for i, one in enumerate(value)])


class Allowed(NamedTuple):
    """Nothing, unless said on the command line or in Python."""

    plugins: bool = False
    """A dotted kind that no installed package offers is imported by its name (``--allow-plugins``)."""
    outside: bool = False
    """Files outside the workstation's folder are read (``--allow-outside``)."""
    replayed: bool = False
    """Its sources are not opened, for their samples are there: what they name need not be."""


NOTHING = Allowed()
