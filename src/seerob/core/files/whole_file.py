"""A file that is there whole, or as it was before, and a folder to work in, whenever an interrupt comes."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from secrets import token_hex

_LONGEST = 40
"""Of the name that a hidden one takes over [characters]; file systems allow 255 bytes."""


def hidden_beside(path: Path) -> Path:
    """A hidden name in the same folder that nobody uses.

    Whoever knows it before there is anything of that name can remove that whenever an interrupt comes.
    """
    return path.with_name(f".{path.name.lstrip('.')[:_LONGEST]}.{token_hex(8)}")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A hidden path beside a file; what was written there has the file's name at the end.

    Raises:
        OSError: It cannot be written; nothing is left behind.
    """
    hidden = hidden_beside(path)
    try:
        yield hidden
        hidden.replace(path)
    finally:
        try:
            hidden.unlink(missing_ok=True)
        except BaseException:  # a second interrupt, or one in this very moment
            hidden.unlink(missing_ok=True)
            raise


@contextmanager
def hidden_folder(path: Path) -> Iterator[Path]:
    """A folder to work in beside a file; gone at the end.

    Raises:
        OSError: It cannot be made.
    """
    folder = hidden_beside(path)
    try:
        folder.mkdir()
        yield folder
    finally:
        try:
            shutil.rmtree(folder, ignore_errors=True)
        except BaseException:  # an interrupted one fails in ways of its own
            shutil.rmtree(folder, ignore_errors=True)
            raise
