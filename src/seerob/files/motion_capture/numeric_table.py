"""Delimited text whose first row names the columns and whose other rows are numbers only."""

from __future__ import annotations

from array import array
from itertools import islice
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.transforms import Array
from seerob.files.motion_capture.decimal_comma import Commas
from seerob.files.motion_capture.frame_arrays import check_size
from seerob.files.tables.candidates import candidates
from seerob.files.tables.grid import MAX_COLUMNS, MAX_PROBLEMS, Grid
from seerob.files.tables.mapping import Mapping


def read_columns(path: Path, *, file: str) -> tuple[list[str], Array, Array]:
    """Header, first column (n,) and the other columns (n, k); empty cells and ``NaN`` are NaN.

    Raises:
        InputError: It is no such table; every row that is wrong, up to a bound.
    """
    for grid, _ in candidates(path, file, Mapping()):
        rows = [list(map(str, row)) for row in islice(grid.rows(), 2)]
        if len(rows) == 2 and 2 <= len(rows[0]) <= MAX_COLUMNS and len(rows[0]) == len(rows[1]):
            return _read(grid, [cell.strip() for cell in rows[0]])
    raise InputError.at(file, "", "no table: a row of names and rows of numbers", "is it delimited text?")


def _read(grid: Grid, header: list[str]) -> tuple[list[str], Array, Array]:
    flat = array("d")
    count = 0
    problems: list[Problem] = []
    commas = Commas(grid.file)
    for number, row in enumerate(islice(grid.rows(), 1, None), start=2):
        cells = [str(cell).strip() for cell in row]
        if not any(cells):
            continue
        if len(cells) != len(header):
            problems.append(Problem(grid.file, f"row {number}", f"{len(cells)} cells, {len(header)} names"))
        else:
            try:
                flat.extend([commas.number(cell or "nan") for cell in cells])
                count += 1
            except ValueError as error:
                problems.append(Problem(grid.file, f"row {number}", str(error)[:120]))
        if len(problems) >= MAX_PROBLEMS:
            break
        check_size(grid.file, count, len(header))
    if problems:
        raise InputError(problems)
    commas.check()
    table = np.array(flat).reshape(count, len(header)) if count else np.empty((0, len(header)))
    return header, table[:, 0], table[:, 1:]
