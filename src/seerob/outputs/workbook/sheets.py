"""Sheets of a workbook as a person reads them: widths that fit, a header that stays, and units.

The file is written by XlsxWriter: a row in memory at a time, and the same bytes for the same cells.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, TYPE_CHECKING

from seerob.core.figures import DECIMALS
from seerob.core.files.whole_file import hidden_folder
from seerob.outputs.workbook.sheet_rows import HEAD, WRAP, Cell, Formats, SheetRows

if TYPE_CHECKING:
    from xlsxwriter import Workbook


_CREATED = datetime(1980, 1, 1, tzinfo=UTC)
"""What every file says, so that the same cells are the same bytes."""


@contextmanager
def book(file: IO[bytes] | Path) -> Iterator[Workbook]:
    """A workbook to add sheets to, written when the block ends; what an error leaves is no workbook.

    Sheets wait in temporary files, beside the file if it has a path.

    Args:
        file: Where to, open for writing bytes, or its path.

    Raises:
        OSError: The disk refuses.
    """
    if isinstance(file, Path):
        with hidden_folder(file) as beside, file.open("wb") as out:
            yield from _written(out, str(beside))
    else:
        with TemporaryDirectory() as folder:
            yield from _written(file, folder)


def _written(file: IO[bytes], folder: str) -> Iterator[Workbook]:
    from xlsxwriter import Workbook
    from xlsxwriter.exceptions import FileCreateError

    out = _Output(file)
    made = Workbook(
        out,
        {
            "constant_memory": True,
            "tmpdir": folder,
            "strings_to_formulas": False,
            "strings_to_urls": False,
            "strings_to_numbers": False,
        },
    )
    made.set_properties({"created": _CREATED})
    try:
        yield made
        made.close()
    except FileCreateError as error:
        raise error.args[0] from error
    finally:
        for sheet in made.worksheets():
            with suppress(OSError):  # of a full disk, once more; the file is closed all the same
                sheet.row_data_fh.close()
        out.over = True
    if out.refused is not None:
        raise out.refused


class _Output:
    """What the archive is written to: it takes everything, and remembers that the disk did not.

    An archive that fails half-way would try again when it is forgotten, where nobody hears its error.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.refused: OSError | None = None
        """Why the disk took no more."""
        self.over = False
        """The file is no longer ours."""
        self._at = file.tell()

    def write(self, data: bytes) -> int:
        """Write, or drop what comes after an error."""
        if self.refused is None and not self.over:
            try:
                self._file.write(data)
            except OSError as error:
                self.refused = error
        self._at += len(data)
        return len(data)

    def tell(self) -> int:
        return self._at

    def seek(self, at: int, whence: int = 0) -> int:
        """To a place that is counted from the begin: an archive asks for no other."""
        if whence:
            raise ValueError(f"seek from {whence}, not from the begin")
        if self.refused is None and not self.over:
            self._file.seek(at)
        self._at = at
        return at

    def flush(self) -> None:
        """The file is flushed when it is closed."""


EXCEL_ROWS = 1_048_576
"""Rows of a sheet, header included; longer data goes on in a further sheet."""
MOST_COLUMNS = 16_384
"""Columns of a sheet."""
_NOT_IN_SHEET_NAME = re.compile(r"[\[\]:*?/\\\x00-\x1f'\ud800-\udfff\ufffe\uffff]")
_UNIT = re.compile(r"\[([^\[\]]*)\]$")
_NARROWEST, _WIDEST, _TEXT_COLUMN = 9, 60, 44
_MORE = 2
"""Places shown beyond `DECIMALS`: here the figures are for further work. The cell holds 16 digits."""
_OWN_UNIT = ("worst value", "limit", "value")
"""Columns whose unit stands in the row."""


@contextmanager
def workbook(file: IO[bytes] | Path) -> Iterator[Sheets]:
    """A workbook to add sheets to, as `book` opens it.

    Raises:
        OSError: The disk refuses.
    """
    with book(file) as made:
        yield Sheets(made)


class Sheets:
    """Adds sheets to a workbook; made by `workbook`."""

    def __init__(self, book: Workbook) -> None:
        self._book, self._formats = book, Formats(book)
        self._names: set[str] = set()

    def add(
        self, name: str, head: Sequence[Cell], rows: Iterable[Sequence[Cell]], *, fit: bool = False
    ) -> None:
        """Add a sheet, and further ones when the rows do not fit.

        Args:
            name: Made unique and fit for Excel.
            head: Titles; a unit in brackets at the end of one gives its column's number format. Columns
                beyond those of a sheet are left out, which the last title says.
            rows: Cells; words of verdicts get their colour.
            fit: Whether columns are as wide as their text, which is wrapped beyond a limit; the rows
                must be a list then, with their units in a column named ``unit``, if any.
        """
        wide = len(head) > MOST_COLUMNS
        if wide:
            left_out = f"(left out: {len(head) - MOST_COLUMNS + 1} columns; see the CSV files)"
            head = [*head[: MOST_COLUMNS - 1], left_out]
        widths = _widths(head, rows if fit and isinstance(rows, list) else [])
        looks = [_format(_unit(title)) for title in head]
        unit_at = list(head).index("unit") if fit and "unit" in head else -1
        word = WRAP if fit else ""
        sheet = self._begin(name, head, widths, looks)
        for row in rows:
            if sheet.full or sheet.rows >= EXCEL_ROWS:
                sheet.close()
                sheet = self._begin(name, head, widths, looks)
            own = self._formats.of(_format(str(row[unit_at] or ""))) if 0 <= unit_at < len(row) else None
            formats = [own if title in _OWN_UNIT else None for title in head] if own else ()
            sheet.append(row[: MOST_COLUMNS - 1] if wide else row, formats, word=word)
        sheet.close()

    def _begin(
        self, name: str, head: Sequence[Cell], widths: Sequence[float], looks: Sequence[str]
    ) -> SheetRows:
        sheet = self._book.add_worksheet(self._unique(name))
        sheet.freeze_panes(1, 1)
        columns = [self._formats.of(look) for look in looks]
        for k, (width, column) in enumerate(zip(widths, columns, strict=True)):
            sheet.set_column(k, k, width, column)
        rows = SheetRows(sheet, self._formats, columns)
        rows.append([str(title) for title in head], word=HEAD)
        return rows

    def _unique(self, name: str) -> str:
        stem = _NOT_IN_SHEET_NAME.sub("_", name).strip() or "sheet"
        stem = stem if stem.casefold() != "history" else "history_"
        for k in range(1, 10_000):
            tail = "" if k == 1 else f" ({k})"
            unique = stem[: 31 - len(tail)] + tail
            if unique.casefold() not in self._names:
                self._names.add(unique.casefold())
                return unique
        raise ValueError(f"too many sheets named {stem!r}")


def _widths(head: Sequence[Cell], rows: Sequence[Sequence[Cell]]) -> list[float]:
    # Shorter rows are remarks below the table.
    found = []
    for k, title in enumerate(head):
        texts = [str(title), *(str(r[k]) for r in rows if len(r) == len(head) and isinstance(r[k], str))]
        longest = max(map(len, texts)) + 2
        if title in ("reason", "text"):
            longest = max(longest, _TEXT_COLUMN)
        found.append(float(min(max(longest, _NARROWEST), 90 if title == "text" else _WIDEST)))
    return found


def _unit(title: Cell) -> str:
    match = _UNIT.search(str(title))
    return match[1] if match else ""


def _format(unit: str) -> str:
    """Number format of a unit; none for a unit that is not known."""
    if unit not in DECIMALS:
        return ""
    return "0." + "0" * (DECIMALS[unit] + (_MORE if unit != "s" else 1))
