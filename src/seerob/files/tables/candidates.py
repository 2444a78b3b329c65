"""The ways a file can be read as a table: its sheets, or its delimiters."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from seerob.core.errors import InputError, suggestion
from seerob.files.tables.grid import Grid
from seerob.files.tables.mapping import Mapping
from seerob.files.tables.text import BLANKS, TextGrid, encoding_of
from seerob.files.tables.workbook import sheets

DELIMITERS = (";", "\t", ",", "|", BLANKS)
"""Tried in this order: a comma may also be a decimal comma, and a blank part of a name."""

WORKBOOKS = (".xlsx", ".xlsm", ".xls", ".xlsb", ".ods")


def candidates(path: Path, name: str, given: Mapping) -> Iterator[tuple[Grid, Mapping]]:
    """Every reading of a file that the given mapping allows, with what it settles.

    Raises:
        InputError: The file cannot be read, or has no such sheet.
    """
    if path.suffix.lower() in WORKBOOKS:
        found: tuple[Grid, ...] = sheets(path, name)
        if given.sheet is not None:
            found = tuple(s for s in found if s.sheet == given.sheet) or _no_sheet(name, given.sheet, found)
        for sheet in found:
            yield sheet, Mapping(sheet=sheet.sheet)
        return
    encoding = encoding_of(path, name)
    if given.delimiter is not None and (len(given.delimiter) != 1 or given.delimiter in '"\r\n'):
        raise InputError.at(name, "mapping.delimiter", f"{given.delimiter!r}", "write a single character")
    for delimiter in DELIMITERS if given.delimiter is None else (given.delimiter,):
        yield TextGrid(path, name, encoding, delimiter), Mapping(delimiter=delimiter)


def _no_sheet(name: str, sheet: str, found: tuple[Grid, ...]) -> tuple[Grid, ...]:
    known = [s.sheet for s in found]
    raise InputError.at(name, "mapping.sheet", f"no sheet {sheet!r}", suggestion(sheet, known))
