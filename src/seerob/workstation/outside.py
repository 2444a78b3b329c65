"""What a workstation file names outside its folder, found before any of it is read.

Every text of the file is looked at, whatever key it stands at: one that is the path of a file or folder which
lies, wherever links lead, outside the folder of the workstation file is such a name. What is installed
(``package:``) or ships (``library:``) has other names, and is not outside.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from seerob.core.errors import Problem
from seerob.core.files.outside import REMEDY, leads_outside

MOST = 1000
"""Files of a folder that a source names which are looked at."""
_LONGEST = 4096
"""Of a path [characters]."""


class Named(NamedTuple):
    """A file or folder outside."""

    key: str
    """Where the workstation file names it: ``sources[0].file``."""
    name: str
    """As it has it."""
    real: Path
    """Where that leads."""

    def problem(self, file: str) -> Problem:
        """That it may not be read."""
        return Problem(file, self.key, f"leads to {self.real}, outside the folder of the workstation", REMEDY)


def named_outside(table: Mapping[str, Any], folder: Path) -> Iterator[Named]:
    """What a workstation file names outside its folder.

    Args:
        table: The file as TOML has it.
        folder: Its folder.
    """
    for key, text in _texts(table, ""):
        if len(text) > _LONGEST:
            continue
        path = folder / text
        if (real := leads_outside(path, folder)) is not None:
            yield Named(key, text, real)
        elif key.startswith("sources[") and text and path.is_dir():
            yield from (Named(key, text, real) for real in _linked(path, folder))


def _linked(folder: Path, within: Path) -> Iterator[Path]:
    """Where links in a folder lead that leave another one."""
    for _, entry in zip(range(MOST), folder.rglob("*"), strict=False):
        if entry.is_symlink() and (real := leads_outside(entry, within)) is not None:
            yield real


def _texts(value: Any, key: str) -> Iterator[tuple[str, str]]:
    if isinstance(value, str):
        yield key, value
    elif isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _texts(inner, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from _texts(inner, f"{key}[{i}]")
