"""A folder of files that is there whole, or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from seerob.core.errors import InputError
from seerob.core.files.whole_file import hidden_beside


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
