"""A table as rows of cells, read as a stream; nothing is interpreted here but numbers."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.transforms import Array
from seerob.files.trajectories.trajectory import MAX_SAMPLES

Cell = object
"""str, int, float, None or whatever a workbook holds; only numbers and text have a meaning."""

MAX_COLUMNS = 16_384
MAX_PROBLEMS = 10
"""Mistakes collected before reading stops."""


class Grid(Protocol):
    """One table of one file; iterating again reads again."""

    @property
    def file(self) -> str:
        """The file, as the user named it."""

    @property
    def sheet(self) -> str:
        """Sheet of a workbook; empty for text."""

    def rows(self) -> Iterator[Sequence[Cell]]:
        """Every row from the first on, blank ones too."""


def place(grid: Grid, row: int | None = None, column: str = "") -> str:
    """``sheet 'Joints' row 17 column 'J3'``, as far as there is any."""
    parts = [f"sheet {grid.sheet!r}"] if grid.sheet else []
    parts += [f"row {row}"] if row is not None else []
    parts += [f"column {column!r}"] if column else []
    return " ".join(parts)


def blank(cell: Cell) -> bool:
    """Whether a cell holds nothing."""
    return cell is None or (isinstance(cell, str) and not cell.strip())


def number(cell: Cell, *, decimal_comma: bool = False) -> float | str:
    """The number in a cell, or what is wrong with it."""
    if isinstance(cell, float | int) and not isinstance(cell, bool):
        try:
            value = float(cell)
        except OverflowError:
            return "holds a number beyond all bounds"
        return value if isfinite(value) else f"is {value}"
    if isinstance(cell, str):
        text = cell.strip()
        if decimal_comma and "." not in text:
            text = text.replace(",", ".")
        try:
            value = float(text) if "_" not in text else float("nan")
        except ValueError:
            value = float("nan")
        if isfinite(value):
            return value
        return f"holds {_short(cell)!r}" if text else "is empty"
    if cell is None:
        return "is empty"
    return f"holds {_short(str(cell))!r} ({type(cell).__name__})"


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "…"


@dataclass(frozen=True, eq=False)
class Numbers:
    """The columns that were asked for."""

    rows: NDArray[np.int64]
    """Row numbers in the file, from 1, shape (n,)."""
    values: Array
    """Shape (n, columns), as the file has them."""
    skipped: int
    """Blank rows between rows with values."""
    selections: tuple[str, ...]
    """Distinct texts in the column of selection, at most a hundred."""
    longer: int = 0
    """Rows with values beyond the last column of the header."""
    first_longer: int = 0
    """The first of them, from 1; 0 when there is none."""


def read_numbers(
    grid: Grid,
    first_row: int,
    columns: Mapping[str, int],
    *,
    decimal_comma: bool = False,
    select: tuple[int, str | None] | None = None,
    width: int | None = None,
) -> Numbers:
    """Read numeric columns.

    Args:
        grid: The table.
        first_row: First row with values, from 1.
        columns: Column index, from 0, per name.
        decimal_comma: Whether text such as ``1,5`` is a number.
        select: Column index and the text that a row must have there; None takes every row.
        width: Columns of the header; None when there is no header.

    Raises:
        InputError: A cell that is not a finite number, or more rows or columns than are taken;
            several mistakes at once.
    """
    indices, names = list(columns.values()), list(columns)
    flat, numbers = array("d"), array("q")
    problems: list[Problem] = []
    seen: dict[str, None] = {}
    skipped = pending = longer = first_longer = 0
    for count, row in enumerate(grid.rows(), start=1):
        if count < first_row:
            continue
        if len(row) > MAX_COLUMNS:
            raise InputError.at(grid.file, place(grid, count), f"{len(row)} columns, more than {MAX_COLUMNS}")
        cells = [row[i] if i < len(row) else None for i in indices]
        if all(map(blank, cells)):
            pending += 1
            continue
        skipped, pending = skipped + pending, 0
        if select is not None:
            found = str(row[select[0]]).strip() if select[0] < len(row) else ""
            if len(seen) < 100:
                seen[found] = None
            if select[1] is not None and found != select[1]:
                continue
        if len(numbers) >= MAX_SAMPLES:
            raise InputError.at(
                grid.file, place(grid, count), f"more than {MAX_SAMPLES} rows", "split the file"
            )
        if width is not None and len(row) > width and not all(map(blank, row[width:])):
            longer, first_longer = longer + 1, first_longer or count
        values = [number(cell, decimal_comma=decimal_comma) for cell in cells]
        for name, value in zip(names, values, strict=True):
            if isinstance(value, str):
                remedy = "every cell must hold a number"
                if value == "is empty":
                    remedy += " (merged cells and formulas that were never calculated read as empty)"
                problems.append(Problem(grid.file, place(grid, count, name), value, remedy))
        if len(problems) >= MAX_PROBLEMS:
            break
        if not problems:
            flat.extend(values)  # type: ignore[arg-type]  # no text among them here
            numbers.append(count)
    if problems:
        raise InputError(problems)
    # Views of the arrays: a long file is not held twice.
    table = np.frombuffer(flat, np.float64).reshape(-1, len(indices))
    return Numbers(np.frombuffer(numbers, np.int64), table, skipped, tuple(seen), longer, first_longer)
