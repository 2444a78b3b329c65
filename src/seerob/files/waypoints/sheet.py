"""Waypoints as rows of a table: CSV or a workbook. Every column says its unit in its name.

Columns: ``name``, ``move``; ``q1_deg`` … (or ``_rad``, ``_m``, ``_mm``); ``x_m y_m z_m`` (or ``_mm``) with
``roll_deg pitch_deg yaw_deg`` (or ``_rad``), ``rx_rad ry_rad rz_rad`` (a rotation vector) or ``qw qx qy qz``;
``via_x_m via_y_m via_z_m``; ``speed``, ``acceleration`` (in the unit of the move: rad/s or m/s, and so on);
``duration_s``, ``pause_s``, ``blend_m`` or ``blend_mm``. Units are never guessed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.orientation import wxyz_from
from seerob.files.tables.candidates import DELIMITERS, WORKBOOKS
from seerob.files.tables.grid import Grid, blank, number, place
from seerob.files.tables.mapping import SI
from seerob.files.tables.text import TextGrid, encoding_of
from seerob.files.tables.workbook import SheetGrid, sheets
from seerob.files.waypoints.point import program_of
from seerob.files.waypoints.waypoint import MAX_WAYPOINTS, Program

TEXTS = ("name", "move")
BARE = ("speed", "acceleration", "qw", "qx", "qy", "qz")
WITH_UNIT = re.compile(
    r"(?P<stem>q\d{1,2}|(?:via_)?[xyz]|roll|pitch|yaw|r[xyz]|blend|duration|pause)_(?P<unit>deg|rad|mm|m|s|ms)"
)
KIND = {"x": "m", "y": "m", "z": "m", "blend": "m", "duration": "s", "pause": "s"}
CALCULATE = "open it in Excel or LibreOffice and save it: what wrote it does not calculate"
REMEDY = "columns are named in docs/sources/waypoints.md: q1_deg, x_mm, roll_deg, blend_mm …"


def read_sheet(path: Path, file: str) -> Program:
    """The waypoints of a table.

    Args:
        path: A workbook (its first sheet) or delimited text.
        file: Its name, for messages.

    Raises:
        InputError: With every wrong column, or every wrong row.
    """
    grid: Grid
    if path.suffix.lower() in WORKBOOKS:
        grid, *_ = sheets(path, file)
        _check_formulas(grid)
    else:
        encoding = encoding_of(path, file)
        grids = [TextGrid(path, file, encoding, d) for d in DELIMITERS]
        # What separates the columns is what cuts the first row into most pieces.
        grid = max(grids, key=lambda g: len(next(iter(g.rows()), [])))
    rows = iter(grid.rows())
    names = [str(c).strip().lower() if not blank(c) else "" for c in next(rows, [])]
    factors = _columns(names, file)
    comma = isinstance(grid, TextGrid) and grid.delimiter not in (",", " ")
    problems: list[Problem] = []
    tables = list(_tables(grid, islice(rows, MAX_WAYPOINTS + 1), names, factors, comma, problems))
    if problems:
        raise InputError(problems[:20])
    return program_of(tables, file)


def _check_formulas(grid: SheetGrid) -> None:
    """A speed or pause that looks empty would be taken as not given."""
    problems = [
        Problem(grid.file, place(grid, row), f"cell {column}: a formula without its result", CALCULATE)
        for row, column in islice(grid.uncalculated(), 20)
    ]
    if problems:
        raise InputError(problems)


def _columns(names: Sequence[str], file: str) -> list[float]:
    """Factor to SI of each column."""
    factors, problems = [], []
    for i, name in enumerate(names):
        match = WITH_UNIT.fullmatch(name)
        if name and names.index(name) != i:
            problems.append(Problem(file, f"column {i + 1}", f"{name!r} is there twice", "name each once"))
        if match is not None:
            si, factor = SI[match["unit"]]
            stem = match["stem"].removeprefix("via_")
            wanted = KIND.get(stem, "" if stem[0] == "q" else "rad")
            if wanted not in ("", si) or (si == "s" and wanted != "s"):
                problems.append(Problem(file, f"column {name!r}", f"{match['unit']} does not fit", REMEDY))
            factors.append(factor)
        elif name in (*TEXTS, *BARE, ""):
            factors.append(1.0)
        else:
            problems.append(Problem(file, f"column {name!r}", "is no column of waypoints", REMEDY))
            factors.append(1.0)
    if not names:
        problems.append(Problem(file, "row 1", "no header", REMEDY))
    if problems:
        raise InputError(problems)
    return factors


def _tables(
    grid: Grid,
    rows: Iterator[Sequence[object]],
    names: Sequence[str],
    factors: Sequence[float],
    comma: bool,
    problems: list[Problem],
) -> Iterator[tuple[str, dict[str, Any]]]:
    for row, cells in enumerate(rows, start=2):
        values: dict[str, Any] = {}
        if not all(blank(cell) for cell in cells[len(names) :]):
            what = f"{len(cells)} cells, the header names {len(names)} columns"
            remedy = "was a decimal comma taken for a separator? put ; between the cells"
            problems.append(Problem(grid.file, place(grid, row), what, remedy))
            continue
        for name, factor, cell in zip(names, factors, cells, strict=False):
            if blank(cell) or not name:
                continue
            if name in TEXTS:
                values[name] = str(cell).strip()
                continue
            value = number(cell, decimal_comma=comma)
            if isinstance(value, str):
                problems.append(Problem(grid.file, place(grid, row, name), value, "give a number"))
            else:
                stem = match["stem"] if (match := WITH_UNIT.fullmatch(name)) else name
                values[stem] = value * factor
        if values:
            try:
                yield place(grid, row), _table(values)
            except ValueError as error:
                problems.append(
                    Problem(grid.file, place(grid, row), str(error), "fill them, or leave all empty")
                )


def _table(values: dict[str, Any]) -> dict[str, Any]:
    """A row as the table of a `Point`."""
    table = {
        k: values[k] for k in (*TEXTS, "speed", "acceleration", "duration", "blend", "pause") if k in values
    }
    joints = sorted((k for k in values if re.fullmatch(r"q\d+", k)), key=lambda k: int(k[1:]))
    if joints:
        if joints != [f"q{i + 1}" for i in range(len(joints))]:
            raise ValueError(f"joints {', '.join(joints)}, but some before them are empty")
        table["q"] = [values[k] for k in joints]
    position = _all(values, ("x", "y", "z"))
    if position is not None:
        table["at"] = {"position": position}
        rpy = _all(values, ("roll", "pitch", "yaw"))
        wxyz = _all(values, ("qw", "qx", "qy", "qz"))
        vector = _all(values, ("rx", "ry", "rz"))
        if vector is not None:
            wxyz = wxyz_from("rotation_vector", np.array([vector]))[0].tolist()
        table["at"] |= {k: v for k, v in (("rpy", rpy), ("wxyz", wxyz)) if v is not None}
    via = _all(values, ("via_x", "via_y", "via_z"))
    return table | ({} if via is None else {"via": via})


def _all(values: dict[str, Any], keys: Sequence[str]) -> list[float] | None:
    there = [k for k in keys if k in values]
    if there and len(there) < len(keys):
        raise ValueError(f"only {', '.join(there)} of {', '.join(keys)}")
    return [values[k] for k in keys] if there else None
