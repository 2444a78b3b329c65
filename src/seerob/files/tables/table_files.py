"""Files as grids of cells: delimited text, Excel workbooks, and the ways in which one file can be read.

Delimited text as a grid: encodings, delimiters, and files that are something else.

An Excel workbook as grids, one per sheet; values only, formulas as last calculated.

Whatever is unpacked or parsed is in the parsers' process, from which rows come as they are asked for.

The ways a file can be read as a table: its sheets, or its delimiters.
"""

from __future__ import annotations

import csv
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

from seerob.core.errors import InputError, suggestion
from seerob.core.files.bounded import TooLarge, missing_file, sizes
from seerob.core.files.parser_process import parsed, parsed_one_by_one
from seerob.core.printable import printable
from seerob.files.tables.grid import MAX_COLUMNS, Cell, Grid
from seerob.files.tables.mapping import Mapping

MAX_BYTES = 4 << 30
MAX_LINE = 4 << 20
"""Longest line that is taken, in characters."""

BLANKS = " "
"""Delimiter that means any run of blanks and tabs."""

BOMS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))


def check_file(path: Path, name: str, max_bytes: int = MAX_BYTES) -> bytes:
    """The first bytes of a readable file of a bearable size; InputError otherwise."""
    try:
        there = path.is_file()
    except (OSError, ValueError) as error:
        raise InputError.at(name[:200], "", f"is no name of a file: {error.args[-1]}", "name one") from error
    if not there:
        if path.is_dir():
            raise InputError.at(name, "", "is a folder", "give the file that is meant")
        raise InputError.at(name, "", "no such file", missing_file(name, f"looked for {path}"))
    size = path.stat().st_size
    if size == 0:
        raise InputError.at(name, "", "the file is empty")
    if size > max_bytes:
        raise InputError.at(name, "", f"{size} bytes, more than {max_bytes}", "split the file")
    try:
        with path.open("rb") as file:
            return file.read(1 << 16)
    except OSError as error:
        raise InputError.at(name, "", f"cannot be read: {error.strerror}") from error


def encoding_of(path: Path, name: str) -> str:
    """Encoding of a text file: by its byte order mark, else UTF-8 if it is, else Windows-1252.

    Raises:
        InputError: The file is missing, empty, too large, or not text.
    """
    head = check_file(path, name)
    if head.startswith(b"PK\x03\x04"):
        raise InputError.at(name, "", "a zip archive, not text", 'for a workbook use kind = "excel"')
    if head.startswith(b"\xd0\xcf\x11\xe0"):
        raise InputError.at(name, "", "an old Excel file (.xls), not text", "save it as .xlsx or .csv")
    for mark, encoding in BOMS:
        if head.startswith(mark):
            return encoding
    if b"\0" in head:
        raise InputError.at(name, "", "binary data, not text", "export the trajectory as text")
    try:
        # A cut through a character at the end of the head is no mistake.
        head.decode("utf-8") if len(head) < 1 << 16 else head[: head.rfind(b"\n") + 1].decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def lines(path: Path, name: str, encoding: str) -> Iterator[str]:
    """Lines of a text file, each of bounded length."""
    with path.open(encoding=encoding, newline="") as file:
        count = 0
        while True:
            line = _line(file, name, count + 1)
            if not line:
                return
            count += 1
            body = line.rstrip("\r\n")
            # Names of columns and cells that are no number go into messages and results.
            yield line if body.replace("\t", " ").isprintable() else printable(body) + line[len(body) :]


def _line(file: TextIO, name: str, number: int) -> str:
    try:
        line = file.readline(MAX_LINE)
    except UnicodeError as error:
        raise InputError.at(name, f"row {number}", f"not text: {error}", "save the file as UTF-8") from error
    if len(line) >= MAX_LINE:
        raise InputError.at(name, f"row {number}", f"a line longer than {MAX_LINE} characters")
    return line


@dataclass(frozen=True)
class TextGrid:
    """A delimited text file."""

    path: Path
    file: str
    encoding: str
    delimiter: str
    comment: str = ""
    """A mark that is taken away where a line starts with it: ``%`` before a header."""
    sheet: str = ""

    def rows(self) -> Iterator[Sequence[str]]:
        """Rows as lists of text; a blank line is an empty list."""
        if self.delimiter == BLANKS:
            for line in self._lines():
                yield line.split()
            return
        reader = csv.reader(self._lines(), delimiter=self.delimiter)
        count = 0
        while True:
            count += 1
            try:
                row = next(reader)
            except StopIteration:
                return
            except csv.Error as error:
                raise InputError.at(self.file, f"row {count}", f"not delimited text: {error}") from error
            yield row

    def _lines(self) -> Iterator[str]:
        for line in lines(self.path, self.file, self.encoding):
            yield line.removeprefix(self.comment) if self.comment else line


def head(grid: TextGrid, count: int) -> list[Sequence[str]]:
    """The first rows."""
    return list(islice(grid.rows(), count))


LARGEST_WORKBOOK = 1 << 30
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
    head = check_file(path, name, LARGEST_WORKBOOK)
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
