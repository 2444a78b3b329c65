"""A folder of files that is there when the run is over, with all of them, or not at all."""

from __future__ import annotations

import re
import shutil
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from seerob.core.errors import InputError, SeerobError
from seerob.core.files.whole_file import hidden_beside
from seerob.core.samples import Sample
from seerob.core.snapshot import Snapshot
from seerob.outputs.sink import AtEnd
from seerob.outputs.tables.growing_table import GrowingTable

NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"
"""Of such a folder."""
_PLAIN = re.compile(r"[^\w-]+")
MOST_TABLES = 1000
T = TypeVar("T")


def checked(folder: Path, name: str, key: str) -> Path:
    """The folder to be, after a look at its name.

    Raises:
        InputError: The name is none of a folder, or it exists.
    """
    if not re.match(NAME, name):
        remedy = "letters, digits, _ and -"
        raise InputError.at(folder, key, f"{name!r} is not the name of a folder", remedy)
    if (folder / name).exists():
        raise InputError.at(folder / name, "", "exists already", f"give another folder or {key}")
    return folder / name


class WholeFolder(AtEnd):
    """Writes tables into a hidden folder beside the one to be, which gets its name at the end.

    A disk that refuses does not end the run: nothing is written from then on, and `close` tells.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        """Of the folder to be."""
        self.tables: dict[str, GrowingTable] = {}
        """By file name without its suffix."""
        self._hidden: Path | None = None
        self._forgotten: weakref.finalize[..., WholeFolder] | None = None
        self._error: OSError | None = None

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick."""
        if self._error is None:
            try:
                self.take(snapshot, samples)
            except OSError as error:
                self._error = error

    def take(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Add rows."""
        raise NotImplementedError

    def finish(self) -> None:
        """Finish every table."""
        raise NotImplementedError

    def table(self, name: str, suffix: str, make: Callable[[Path], GrowingTable]) -> GrowingTable:
        """The table of that name, made at first use.

        Args:
            name: What it holds; made fit for a file name, and unique.
            suffix: Of the file, with its dot.
            make: Makes it, given its path.
        """
        known = self.tables.get(name)
        if known is None:
            if len(self.tables) >= MOST_TABLES:
                raise SeerobError(f"{self.path}: more than {MOST_TABLES} tables")
            known = self.tables[name] = make(self._folder() / self._unique(name, suffix))
        return known

    def _unique(self, name: str, suffix: str) -> str:
        stem = _PLAIN.sub("_", name).strip("_")[:100] or "table"
        taken = {table.path.name.casefold() for table in self.tables.values()}
        k = 1
        while True:
            unique = f"{stem}{'' if k == 1 else f'_{k}'}{suffix}"
            if unique.casefold() not in taken:
                return unique
            k += 1

    def _folder(self) -> Path:
        if self._hidden is None:
            self._hidden = hidden_beside(self.path)
            # Nobody closes what was interrupted between two statements.
            self._forgotten = weakref.finalize(self, shutil.rmtree, self._hidden, ignore_errors=True)
            self._hidden.mkdir()
        return self._hidden

    def close(self) -> None:
        """Finish the tables and give the folder its name.

        Raises:
            InputError: It cannot be written; nothing is left behind.
        """
        try:
            if self._error is not None:
                raise self._error
            folder = self._folder()
            self.finish()
            folder.rename(self.path)
            self._there()
        except OSError as error:
            what = f"cannot be written: {error.strerror or error}"
            remedy = "make room, or give a folder that may be written"
            raise InputError.at(self.path, "", what, remedy) from error
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Discard every table and the hidden folder, so that nothing is left behind."""
        for table in self.tables.values():
            table.discard()
        if self._hidden is not None:
            shutil.rmtree(self._hidden, ignore_errors=True)
            self._there()

    def _there(self) -> None:
        self._hidden = None
        if self._forgotten is not None:
            self._forgotten.detach()
