"""Text tables that are written row by row to disk, whose columns may become more, and folders of them.

What a table has at its head (the number of rows, the names of columns that turned up late) is known only
at the end: the rows wait in a file of their own, and are put below the head when the run is over. Memory
does not grow with the length of the run. A folder of them is there with all of its tables, or not at all.
"""

from __future__ import annotations

import math
import re
import shutil
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import IO, TypeVar

from seerob.core.errors import InputError, SeerobError
from seerob.core.files.whole_file import hidden_beside
from seerob.core.samples import Sample
from seerob.core.snapshot import Snapshot
from seerob.outputs.sink import AtEnd

MOST_COLUMNS = 8192
"""Of one table; columns beyond are left out and counted."""
_COPIED = 1 << 20


class GrowingTable:
    """One table. Cells are text already, without line ends and without separators that are not quoted.

    Args:
        path: Of the finished file; its rows wait beside it.
        separator: Between cells.
        missing: What stands where a row has nothing.
        columns: That are known before the first row.
    """

    def __init__(self, path: Path, *, separator: str, missing: str, columns: Sequence[str] = ()) -> None:
        self.path = path
        self.columns: list[str] = list(columns)
        self.rows = 0
        self.left_out: set[str] = set()
        """Columns that were one too many."""
        self._separator, self._missing = separator, missing
        self._places = {name: k for k, name in enumerate(self.columns)}
        self._widths: list[tuple[int, int]] = []
        """Row from which on rows are so wide."""
        self._waiting = path.with_name(path.name + ".rows")
        self._file: IO[str] = self._waiting.open("w+", encoding="utf-8", newline="")

    def add(self, cells: Mapping[str, str]) -> None:
        """Append a row; a column that is new goes to the end."""
        for name in cells:
            if name not in self._places:
                if len(self.columns) >= MOST_COLUMNS:
                    self.left_out.add(name)
                    continue
                self._places[name] = len(self.columns)
                self.columns.append(name)
        row = [self._missing] * len(self.columns)
        for name, cell in cells.items():
            place = self._places.get(name)
            if place is not None:
                row[place] = cell
        self.append(row)

    def append(self, row: Sequence[str]) -> None:
        """Append a row with a cell for each column there is."""
        if not self._widths or self._widths[-1][1] != len(row):
            self._widths.append((self.rows, len(row)))
        self._file.write(self._separator.join(row) + "\n")
        self.rows += 1

    def finish(self, head: Iterable[str]) -> None:
        """Write the file: the head, line by line, then all rows, equally wide."""
        self._file.seek(0)
        with self.path.open("w", encoding="utf-8", newline="") as out:
            out.writelines(head)
            if len(self._widths) <= 1 and all(width == len(self.columns) for _, width in self._widths):
                shutil.copyfileobj(self._file, out, _COPIED)
            else:
                out.writelines(self._filled())
        self.discard()

    def _filled(self) -> Iterator[str]:
        for (first, width), (last, _) in pairwise([*self._widths, (self.rows, 0)]):
            fill = (self._separator + self._missing) * (len(self.columns) - width)
            for _ in range(last - first):
                line = self._file.readline()
                yield line[:-1] + fill + "\n"

    def discard(self) -> None:
        """Remove the rows that wait."""
        with suppress(OSError):  # of a full disk, once more; the file is closed all the same
            self._file.close()
        self._waiting.unlink(missing_ok=True)


# -- text that spreadsheets take for no formula ---------------------------------------------------

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a formula begins with."""


def no_formula(text: str) -> str:
    """The text, with an apostrophe before it where it begins like a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text


# -- when a further row is due --------------------------------------------------------------------

_SLACK = 1e-6
"""Of a period: instants are not exact multiples of it."""


class Pace:
    """Rows at least so far apart.

    Args:
        every: Least time between two rows [s]; 0 for every tick.
        period: Of ticks [s].
    """

    def __init__(self, every: float, period: float) -> None:
        self._every, self._slack, self._next = every, _SLACK * period, -math.inf

    def due(self, t: float) -> bool:
        """Whether the tick at ``t`` [s] has a row; to be asked once per tick."""
        if t < self._next - self._slack:
            return False
        self._next = t + self._every
        return True


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
