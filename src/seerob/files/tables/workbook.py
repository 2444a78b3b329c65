"""An Excel workbook as grids, one per sheet; values only, formulas as last calculated.

Whatever is unpacked or parsed is in the parsers' process, from which rows come as they are asked for.
"""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from seerob.core.errors import InputError
from seerob.core.files.bounded import TooLarge, sizes
from seerob.core.files.parser_process import parsed, parsed_one_by_one
from seerob.files.tables.grid import MAX_COLUMNS, Cell
from seerob.files.tables.text import check_file

MAX_BYTES = 1 << 30
MAX_UNPACKED = 1 << 30
MAX_RATIO, UNSUSPECTED = 200, 64 << 20
"""A workbook unpacks to so many times its size at most, or to so much [byte]; both our choice."""
MAX_ROWS = 1_048_576
"""Excel's own bound; a file that states a larger row number is not Excel's."""
MAX_STRINGS = 256 << 20
"""Largest table of shared strings, which is held in memory."""
MAX_LEFT_OUT = 10_000
"""Rows that a sheet leaves out one after the other; a file that leaves out more states a wrong row number."""

SAVE_AS = "open it in Excel or LibreOffice and save it as .xlsx"


@dataclass(frozen=True)
class SheetGrid:
    """One sheet of a workbook."""

    path: Path
    file: str
    sheet: str

    def rows(self) -> Iterator[Sequence[Cell]]:
        """Rows as tuples of cells."""
        return parsed_one_by_one(_rows, self.path, self.file, self.sheet, file=self.file, remedy=SAVE_AS)

    def uncalculated(self) -> Iterator[tuple[int, int]]:
        """Row and column, from 1, of formulas whose result the file does not hold.

        Programs that write workbooks without calculating leave them so; their cells look empty.
        """
        given = self.path, self.file, self.sheet
        return parsed_one_by_one(_uncalculated, *given, file=self.file, remedy=SAVE_AS)


def sheets(path: Path, name: str) -> tuple[SheetGrid, ...]:
    """The sheets with cells, in order; InputError when the file is no workbook."""
    head = check_file(path, name, MAX_BYTES)
    if head.startswith(b"\xd0\xcf\x11\xe0"):
        raise InputError.at(name, "", "an old Excel file (.xls) or one with a password", SAVE_AS)
    if path.suffix.lower() not in (".xlsx", ".xlsm"):
        raise InputError.at(name, "", f"{path.suffix or 'no'} extension, not .xlsx or .xlsm", SAVE_AS)
    titles = parsed(_titles, path, name, MAX_UNPACKED, file=name, remedy=SAVE_AS)
    return tuple(SheetGrid(path, name, title) for title in titles)


# -- in the parsers' process --------------------------------------------------------------------


def _check(path: Path, name: str, most: int) -> None:
    """InputError unless it is a workbook that unpacks to ``most`` bytes at most."""
    try:
        with zipfile.ZipFile(path) as archive:
            parts = archive.infolist()
            names = {part.filename for part in parts}
            if "[Content_Types].xml" not in names or not any(n.startswith("xl/") for n in names):
                raise InputError.at(name, "", "a zip archive, but not a workbook", SAVE_AS)
            suspected = max(UNSUSPECTED, MAX_RATIO * path.stat().st_size)
            held = sizes(archive, min(most, suspected))
            if sum(size for part, size in held.items() if part.endswith("sharedStrings.xml")) > MAX_STRINGS:
                raise InputError.at(name, "", f"more than {MAX_STRINGS} bytes of texts", "split it")
            # No workbook has a document type; one that has is after the parser's entities.
            for part in parts:
                if part.filename.endswith((".xml", ".rels")):
                    with archive.open(part) as stream:
                        if b"<!DOCTYPE" in stream.read(4096):
                            raise InputError.at(name, part.filename, "declares a document type", SAVE_AS)
    except (InputError, MemoryError):
        raise
    except TooLarge as error:
        raise InputError.at(name, "", f"{error}, which is more than is taken", "split it") from None
    except Exception as error:  # zipfile and zlib raise many things over a broken archive
        raise InputError.at(name, "", f"not a workbook: {error}", SAVE_AS) from error


def _titles(path: Path, name: str, most: int) -> list[str]:
    _check(path, name, most)
    with _opened(path, name) as book:
        found = [sheet.title for sheet in book.worksheets]
    if not found:
        raise InputError.at(name, "", "a workbook without a sheet of cells", SAVE_AS)
    return found


def _rows(path: Path, name: str, title: str) -> Iterator[Sequence[Cell]]:
    with _opened(path, name) as book:
        sheet = book[title]
        # The stated extent may be wrong by any amount; what is there counts.
        sheet.reset_dimensions()
        yield from _bounded(_parsed(sheet.iter_rows(values_only=True), name, title), name, title)


def _bounded(rows: Iterator[Sequence[Any]], name: str, title: str) -> Iterator[Sequence[Any]]:
    """Rows, as long as there are no more of them, none is longer and none is further down than in a sheet."""
    left_out = 0
    for count, row in enumerate(rows, start=1):
        if count > MAX_ROWS:
            raise InputError.at(name, f"sheet {title!r}", f"more than {MAX_ROWS} rows")
        left_out = 0 if row else left_out + 1
        if left_out > MAX_LEFT_OUT:
            what = f"leaves out more than {MAX_LEFT_OUT} rows before row {count}"
            raise InputError.at(name, f"sheet {title!r}", what, SAVE_AS)
        if len(row) > MAX_COLUMNS:
            what = f"{len(row)} columns, more than {MAX_COLUMNS}"
            raise InputError.at(name, f"sheet {title!r}", what)
        yield row


def _uncalculated(path: Path, name: str, title: str) -> Iterator[tuple[int, int]]:
    with _opened(path, name) as book, _opened(path, name, formulas=True) as written:
        both = book[title], written[title]
        for sheet in both:
            sheet.reset_dimensions()
        values, formulas = (_bounded(_parsed(sheet.iter_rows(), name, title), name, title) for sheet in both)
        for row, cells in enumerate(zip(values, formulas, strict=True), start=1):
            for column, (value, formula) in enumerate(zip(*cells, strict=False), start=1):
                # An empty text is a result.
                if formula.data_type == "f" and value.value is None and value.data_type == "n":
                    yield row, column


@contextmanager
def _opened(path: Path, name: str, *, formulas: bool = False) -> Iterator[Any]:
    from openpyxl import load_workbook

    # A file of its own: openpyxl leaves the one that it opens open when a part is broken.
    with path.open("rb") as file:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                book = load_workbook(file, read_only=True, data_only=not formulas)
        except MemoryError:
            raise
        except Exception as error:  # openpyxl raises whatever a broken part makes it raise
            raise InputError.at(name, "", f"not a workbook: {error}", SAVE_AS) from error
        try:
            yield book
        finally:
            book.close()


def _parsed(rows: Iterator[Sequence[Any]], name: str, sheet: str) -> Iterator[Sequence[Any]]:
    iterator = iter(rows)
    count = 0
    while True:
        count += 1
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                row = next(iterator)
        except StopIteration:
            return
        except MemoryError:
            raise
        except Exception as error:  # as above: a broken part of the file
            where = f"sheet {sheet!r} row {count}"
            raise InputError.at(name, where, f"cannot be read: {error}", SAVE_AS) from error
        yield row
