"""Text logs whose format fixes the names of the columns: controllers' and simulators' own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.transforms import Array
from seerob.files.tables.grid import Numbers, read_numbers
from seerob.files.tables.text import BLANKS, TextGrid, encoding_of

SEARCH = 20
"""Rows in which the header is looked for."""


class Joints(StrEnum):
    """Which joint values of a log drive the twin."""

    MEASURED = "measured"
    COMMANDED = "commanded"
    """What the controller aimed at: a cleaner signal, but not what the robot did."""


@dataclass(frozen=True, eq=False)
class Log:
    """A text log whose header was found."""

    grid: TextGrid
    header_row: int
    """From 1."""
    names: tuple[str, ...]

    def read(self, columns: Iterable[str]) -> LogValues:
        """The columns of these names, which are there."""
        wanted = list(dict.fromkeys(columns))
        indices = {name: self.names.index(name) for name in wanted}
        return LogValues(self.grid.file, read_numbers(self.grid, self.header_row + 1, indices), tuple(wanted))


@dataclass(frozen=True, eq=False)
class LogValues:
    """Columns by name."""

    file: str
    numbers: Numbers
    names: tuple[str, ...]

    @property
    def rows(self) -> NDArray[np.int64]:
        """Row numbers in the file, shape (n,)."""
        return self.numbers.rows

    def column(self, name: str) -> Array:
        """One column, shape (n,)."""
        return self.numbers.values[:, self.names.index(name)]

    def table(self, names: Iterable[str]) -> Array:
        """Several columns, shape (n, columns)."""
        return self.numbers.values[:, [self.names.index(name) for name in names]]


def open_log(path: Path, name: str, mark: str, delimiters: str, what: str, *, comment: str = "") -> Log:
    """Find the header of a log, whatever separates its columns.

    Args:
        path: The file.
        name: The file as messages name it.
        mark: A column that every file of the format has.
        delimiters: Characters that may separate columns; a blank stands for any run of blanks.
        what: The format, for messages.
        comment: A mark that a header line may start with.

    Raises:
        InputError: No row holds the mark, or a column is there twice.
    """
    base = TextGrid(path, name, encoding_of(path, name), BLANKS, comment)
    for delimiter in delimiters:
        grid = replace(base, delimiter=delimiter)
        for row, cells in enumerate(islice(grid.rows(), SEARCH), start=1):
            names = tuple(c.strip() for c in cells)
            if mark in names:
                twice = sorted({n for n in names if n and names.count(n) > 1})
                if twice:
                    raise InputError.at(name, f"row {row}", f"column {twice[0]!r} is there twice")
                return Log(grid, row, names)
    first = " ".join(next(iter(base.rows()), []))[:80]
    remedy = f'the first row reads {first!r}; for other tables use kind = "csv"'
    raise InputError.at(name, "header", f"no column {mark!r}: not {what}", remedy)


def missing(log: Log, columns: Iterable[str], remedy: str) -> InputError | None:
    """An error that names the columns that are not there; None when all are."""
    absent = [c for c in columns if c not in log.names]
    if not absent:
        return None
    return InputError(Problem(log.grid.file, f"row {log.header_row}", f"no column {absent[0]!r}", remedy))
