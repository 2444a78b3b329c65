"""Reading a table of angle zones that somebody wrote in a spreadsheet, a text file or TOML."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.files.toml_file import read_toml
from seerob.criteria.scoring.zones import ZoneRow, mistakes
from seerob.files.tables.candidates import candidates
from seerob.files.tables.grid import Cell, Grid, blank, number, place
from seerob.files.tables.mapping import Mapping as TableMapping
from seerob.workstation.conversion import convert, tables

MAX_ROWS = 2000
"""Rows of a table; more are a mistake."""
MAX_HEAD = 20
"""Rows above the header that may say something else."""
NAMES = ("angle", "score")
"""Columns by which the header is known."""
COLUMNS: dict[str, tuple[str, float]] = {
    "from_deg": ("low", math.pi / 180),
    "to_deg": ("high", math.pi / 180),
    "from_rad": ("low", 1.0),
    "to_rad": ("high", 1.0),
    "hold_s": ("hold", 1.0),
    "allowed_s": ("allowed", 1.0),
    "allowed_at_end_s": ("allowed_at_end", 1.0),
    "score": ("score", 1.0),
    "per_minute": ("per_minute", 1.0),
}
"""Columns with numbers: the field, and the factor to its unit."""
TEXTS = ("angle", "side", "support", "colour", "label", "confidence")
SAME = {"points": "score", "color": "colour"}
"""Other words for a column."""
REMARKS = ("remark", "remarks", "comment", "comments", "note", "notes")
"""Columns for whoever reads the table; not read here."""
UNITS = {"deg": ("°", "deg"), "rad": ("rad",), "s": ("s",)}
"""What may stand behind a number, by the end of the column's name."""
YES_NO = {"yes": True, "no": False, "true": True, "false": False, "1": True, "0": False}


class ZoneTable(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of angle zones."""

    title: str = ""
    """What it is called."""
    source: str = ""
    """Document, edition and clause."""
    rows: tuple[ZoneRow, ...]


def read_zones(path: Path, name: str, *, sheet: str | None = None) -> ZoneTable:
    """The zones of a file; its ending tells how it is read.

    Args:
        path: A ``.toml``, ``.csv``, ``.txt`` or ``.xlsx`` file.
        name: The file as the user named it.
        sheet: Of a workbook; the first that has the columns when not given.

    Raises:
        InputError: With every mistake, by row and column.
    """
    if path.suffix.lower() == ".toml":
        table, _ = read_toml(path)
        return zones_of(table, name)
    missing: list[Problem] = []
    for grid, _ in candidates(path, name, TableMapping(sheet=sheet)):
        header = _header(grid)
        if header is None:
            missing.append(_headless(grid))
        else:
            return ZoneTable(title=Path(name).stem, source=name, rows=_rows(grid, *header))
    # A reading with a header that lacks a column is nearer than one without any.
    nearest = sorted(missing, key=lambda problem: "row" not in problem.key)
    raise InputError(nearest[:1] or Problem(name, "", "holds no table"))


def zones_of(table: Mapping[str, Any], name: str) -> ZoneTable:
    """The zones of a parsed TOML file.

    Raises:
        InputError: With every mistake.
    """
    problems: list[Problem] = []
    rest = {key: value for key, value in table.items() if key != "rows"}
    entries = tables(table.get("rows", []), "rows", name, problems)
    if not entries and not problems:
        problems.append(Problem(name, "rows", "there is none", "write [[rows]]"))
    if len(entries) > MAX_ROWS:
        raise InputError.at(name, "rows", f"{len(entries)} rows, more than {MAX_ROWS}")
    rows = []
    for i, entry in enumerate(entries):
        row = convert(entry, ZoneRow, file=name, key=f"rows[{i}]", problems=problems)
        if row is not None:
            rows.append(row)
            problems += [
                Problem(name, f"rows[{i}].{key}", what, remedy) for key, what, remedy in mistakes(row)
            ]
    head = convert({**rest, "rows": []}, ZoneTable, file=name, key="", problems=problems)
    if problems or head is None:
        raise InputError(problems)
    return msgspec.structs.replace(head, rows=tuple(rows))


def _known() -> tuple[str, ...]:
    return (*TEXTS, *COLUMNS, "either_way")


def _key(cell: Cell) -> str:
    text = str(cell or "").strip().lower().replace("[", "").replace("]", "").replace("°", "deg")
    return "_".join(text.replace("-", " ").replace("_", " ").split())


def _column(cell: Cell) -> str:
    key = _key(cell)
    return SAME.get(key, key)


def _header(grid: Grid) -> tuple[int, dict[int, str]] | None:
    for count, row in enumerate(islice(grid.rows(), MAX_HEAD), start=1):
        names = {i: _column(cell) for i, cell in enumerate(row) if not blank(cell)}
        if set(NAMES) <= set(names.values()):
            return count, {i: name for i, name in names.items() if name not in REMARKS}
    return None


def _headless(grid: Grid) -> Problem:
    """What is missing, of the row that looks most like a header."""
    rows = [[_column(cell) for cell in row] for row in islice(grid.rows(), MAX_HEAD)]
    fits = [len(set(row) & {*_known()}) for row in rows]
    best = max(range(len(rows)), key=lambda k: fits[k], default=0)
    remedy = "head the table with " + ", ".join(_known())
    if not rows or not fits[best]:
        return Problem(grid.file, place(grid), f"no row with the columns {' and '.join(NAMES)}", remedy)
    absent = " and ".join(name for name in NAMES if name not in rows[best])
    return Problem(grid.file, place(grid, best + 1), f"the header has no column {absent}", remedy)


def _bare(cell: Cell, column: str) -> Cell:
    """A cell without the unit that its column says anyway: ``45°``."""
    if isinstance(cell, str):
        for unit in UNITS.get(column.rpartition("_")[2], ()):
            if cell.strip().lower().endswith(unit):
                return cell.strip()[: -len(unit)]
    return cell


def _rows(grid: Grid, header: int, names: Mapping[int, str]) -> tuple[ZoneRow, ...]:
    problems = [
        Problem(grid.file, place(grid, header, name), "unknown column", suggestion(name, _known()))
        for name in names.values()
        if name not in _known()
    ]
    fields = [COLUMNS[n][0] if n in COLUMNS else n for n in names.values()]
    for field in sorted({f for f in fields if fields.count(f) > 1}):
        problems.append(Problem(grid.file, place(grid, header), f"two columns give {field!r}", "keep one"))
    rows: list[ZoneRow] = []
    for count, cells in enumerate(grid.rows(), start=1):
        if count <= header or all(map(blank, cells)):
            continue
        if count > header + MAX_ROWS:
            problems.append(Problem(grid.file, place(grid, count), f"more than {MAX_ROWS} rows"))
            break
        row = _row(grid, count, cells, names, problems)
        if row is not None:
            rows.append(row)
    if not rows and not problems:
        problems.append(Problem(grid.file, place(grid, header), "no row below the header", "write one"))
    if problems:
        raise InputError(problems)
    return tuple(rows)


def _row(
    grid: Grid, count: int, cells: Sequence[Cell], names: Mapping[int, str], problems: list[Problem]
) -> ZoneRow | None:
    def wrong(column: str, what: str, remedy: str = "") -> None:
        problems.append(Problem(grid.file, place(grid, count, column), what, remedy))

    before = len(problems)
    values: dict[str, Any] = {}
    column_of = {}
    for i, name in names.items():
        cell = cells[i] if i < len(cells) else None
        if blank(cell) or name not in _known():
            continue
        if name in COLUMNS:
            field, factor = COLUMNS[name]
            value = number(_bare(cell, name), decimal_comma=True)
            column_of[field] = name
            if isinstance(value, str):
                wrong(name, value, "give a number")
            else:
                values[field] = value * factor
        elif name == "either_way":
            text = str(cell).strip().lower()
            if text not in YES_NO:
                wrong(name, f"{str(cell)[:40]!r}", "write yes or no")
            values[name] = YES_NO.get(text, False)
        else:
            text = str(cell).strip()
            values[name] = _key(text) if name in ("angle", "side", "support") else text
    for name in NAMES:
        if name not in values and len(problems) == before:
            wrong(name, "is empty", "every row needs it")
    if len(problems) > before:
        return None
    found: list[Problem] = []
    row = convert(values, ZoneRow, file=grid.file, key="", problems=found)
    for problem in found:
        wrong(column_of.get(problem.key, problem.key), problem.what, problem.remedy)
    if row is None:
        return None
    for field, what, remedy in mistakes(row):
        wrong(column_of.get(field, field), what, remedy)
    return row
