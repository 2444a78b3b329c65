"""The rows of one sheet of a workbook: numbers are numbers, and text stays text whatever it begins with.

How cells look is made once for each look.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from seerob.core.snapshot import Verdict
from seerob.outputs.palette import DARK_HEX, HEX
from seerob.outputs.tables.growing_table import FORMULA

if TYPE_CHECKING:
    from xlsxwriter import Workbook
    from xlsxwriter.format import Format
    from xlsxwriter.worksheet import Worksheet


HEAD, WRAP = "head", "wrap"
"""Looks beside the verdicts' words and number formats such as ``0.000``."""
WORDS = {v.value: v for v in Verdict}
"""Of verdicts, which have a look each."""
_WRAPPED: dict[str, Any] = {"text_wrap": True, "valign": "top"}


class Formats:
    """Formats of a workbook by the name of their look.

    Args:
        book: Whose formats they are.
    """

    def __init__(self, book: Workbook) -> None:
        self._book = book
        self._made: dict[tuple[str, bool], Format | None] = {("", False): None}

    def of(self, look: str, *, quoted: bool = False) -> Format | None:
        """Format of a look; None for a plain one.

        Args:
            look: `HEAD`, `WRAP`, the word of a verdict, a number format, or nothing.
            quoted: Text that spreadsheets would take for a formula stays text when it is edited, too.
        """
        key = look, quoted
        if key not in self._made:
            self._made[key] = self._book.add_format(_properties(look) | {"quote_prefix": quoted})
        return self._made[key]


def _properties(look: str) -> dict[str, Any]:
    if look == HEAD:
        return {"bold": True, **_WRAPPED}
    if look == WRAP:
        return _WRAPPED
    if look in WORDS:
        verdict = WORDS[look]
        fill = {"bg_color": HEX[verdict]} if verdict is Verdict.UNDECIDED else {}
        return {"bold": verdict is not Verdict.WITHIN, "font_color": DARK_HEX[verdict], **fill}
    return {"num_format": look} if look else {}


Cell = str | float | int | None

FULL = 1 << 30
"""A sheet of about so many bytes is full: archives of 32 bits hold no larger part."""
_NUMBER, _CHARACTER = 64, 5
"""Bytes of a number's cell, and of a character, at most."""
_LARGEST = 9.99999999999999e307
"""A larger number is none in Excel."""
_LONGEST_TEXT = 32_767
"""UTF-16 units."""
_NOT_TEXT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_ESCAPED = re.compile("(_x[0-9a-fA-F]{4}_)")
_MOST_KNOWN = 4096
"""Texts that are kept as they are written: verdicts and reasons come again and again."""


class SheetRows:
    """Writes a sheet, row by row, as the XML that XlsxWriter itself would write for these cells.

    Its own way through objects, checks and attributes of each cell takes six times as long; a report has
    hundreds of thousands of them.

    Args:
        sheet: New, of a workbook with constant memory.
        formats: Of its workbook.
        columns: Format of each column; cells beyond them have none.
    """

    def __init__(self, sheet: Worksheet, formats: Formats, columns: Sequence[Format | None]) -> None:
        from xlsxwriter.utility import xl_col_to_name

        self._letters = xl_col_to_name
        self._sheet, self._formats, self._columns = sheet, formats, columns
        self._begins: list[str] = []
        self._styles: list[str | None] = []
        self._known: dict[tuple[str, str], tuple[str, Format | None]] = {}
        self.rows = 0
        """Written so far."""
        self._size = 0

    @property
    def full(self) -> bool:
        """Whether it takes no more rows."""
        return self._size >= FULL

    def append(self, row: Sequence[Cell], formats: Sequence[Format | None] = (), *, word: str = "") -> None:
        """Write a row.

        Args:
            row: Cells; None, NaN and empty text are empty ones.
            formats: Of numbers, by column, where they are not those of the columns.
            word: Look of texts; a verdict has its own.
        """
        self.rows += 1
        n = self.rows
        self._size += _NUMBER * len(row)
        begins, styles = self._begins, self._styles
        while len(begins) < len(row):
            begins.append(f'<c r="{self._letters(len(begins))}')
            styles.append(None)
        cells: list[str] = []
        places: list[int] = []
        for k, value in enumerate(row):
            if isinstance(value, float | int):
                if -_LARGEST <= value <= _LARGEST:
                    own = formats[k] if k < len(formats) else None
                    style = styles[k] if own is None else _style(own)
                    if style is None:
                        style = self._of_column(k)
                    if isinstance(value, bool):
                        cells.append(f'{begins[k]}{n}"{style} t="b"><v>{value:d}</v></c>')
                    else:
                        cells.append(f'{begins[k]}{n}"{style}><v>{value:.16G}</v></c>')
                    places.append(k)
                elif value == value:  # noqa: PLR0124 - a number
                    cells.append(self._text(n, k, str(value), word))
                    places.append(k)
            elif value:
                cells.append(self._text(n, k, str(value), word))
                places.append(k)
        if cells:
            for k in (places[0], places[-1]):
                self._sheet._check_dimensions(n - 1, k)
            self._sheet.fh.write(f'<row r="{n}">{"".join(cells)}</row>')

    def close(self) -> None:
        """Let go of its file, of which there would be too many open; the workbook opens it again."""
        self._sheet._opt_close()

    def _of_column(self, k: int) -> str:
        """Attribute of a cell without a format of its own."""
        found = self._styles[k]
        if found is None:
            found = self._styles[k] = _style(self._columns[k] if k < len(self._columns) else None)
        return found

    def _text(self, n: int, k: int, value: str, word: str) -> str:
        known = self._known.get((value, word))
        if known is None:
            shown = plain(value)
            look = shown if shown in WORDS else word
            known = _inline(shown), self._formats.of(look, quoted=shown.startswith(FORMULA))
            if len(self._known) < _MOST_KNOWN:
                self._known[value, word] = known
        inline, own = known
        self._size += _CHARACTER * len(value)
        return f'{self._begins[k]}{n}"{self._of_column(k) if own is None else _style(own)} {inline}'


def _style(look: Format | None) -> str:
    return "" if look is None else f' s="{look._get_xf_index()}"'


def _inline(text: str) -> str:
    """The rest of a cell with a text; what looks like an escaped character is escaped itself."""
    kept = ' xml:space="preserve"' if text != text.strip() else ""
    written = _ESCAPED.sub(r"_x005F\1", text).replace("\r", "_x000D_")
    return f't="inlineStr"><is><t{kept}>{escape(written, quote=False)}</t></is></c>'


def plain(text: str) -> str:
    """Text as a cell can hold it: what is no character is marked, what is too long ends in an ellipsis."""
    shown = _NOT_TEXT.sub("\ufffd", text)
    if 2 * len(shown) > _LONGEST_TEXT:
        units = shown.encode("utf-16-le")
        if len(units) > 2 * _LONGEST_TEXT:
            shown = units[: 2 * _LONGEST_TEXT - 2].decode("utf-16-le", errors="ignore") + "…"
    return shown
