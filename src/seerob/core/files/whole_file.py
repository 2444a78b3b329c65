"""Files and folders that are there whole or not at all, and folders to work in, though an interrupt comes."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

from seerob.core.errors import InputError

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


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A place to write to; its files are moved to ``folder`` at the end, and gone when anything is raised.

    Raises:
        InputError: It may not be written.
    """
    made = [parent for parent in folder.parents if not parent.exists()]
    # Who may write into a folder may not always write beside it.
    working = hidden_beside(folder / "new" if folder.exists() else folder.absolute())
    try:
        try:
            working.mkdir(parents=True)
        except OSError as error:
            what = f"cannot be made: {error.strerror}"
            raise InputError.at(folder, "", what, "give a folder that may be written") from error
        yield working
        try:
            _move(working, folder)
        except KeyboardInterrupt:  # half of it would be worse, and the rest takes no time
            _move(working, folder)
            raise
    finally:
        try:
            _clear(working, made)
        except BaseException:  # an interrupted `rmtree` fails in ways of its own
            _clear(working, made)
            raise


def _move(working: Path, folder: Path) -> None:
    if not folder.exists():
        working.rename(folder)
    elif working.exists():
        for file in sorted(working.iterdir()):
            file.replace(folder / file.name)


def _clear(working: Path, made: Sequence[Path]) -> None:
    shutil.rmtree(working, ignore_errors=True)
    for parent in made:
        # Only what was made here and is empty goes again.
        with suppress(OSError):
            parent.rmdir()
