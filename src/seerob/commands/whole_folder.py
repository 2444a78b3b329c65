"""A folder of files that is there whole, or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp

from seerob.errors import InputError


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A place to write to; its files are moved to ``folder`` at the end, and gone when anything is raised.

    Raises:
        InputError: It may not be written.
    """
    parents = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        working = Path(mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    except OSError as error:
        what = f"cannot be made: {error.strerror}"
        raise InputError.at(folder, "", what, "give a folder that may be written") from error
    try:
        yield working
        folder.mkdir(exist_ok=True)
        for file in sorted(working.iterdir()):
            file.replace(folder / file.name)
    finally:
        shutil.rmtree(working, ignore_errors=True)
        for parent in parents:
            # Only what was made here and is empty goes again.
            with suppress(OSError):
                parent.rmdir()
