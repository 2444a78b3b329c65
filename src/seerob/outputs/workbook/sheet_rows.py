"""The rows of one sheet of a workbook: numbers are numbers, and text stays text whatever it begins with.

How cells look is made once for each look.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from seerob.core.files.no_formula import FORMULA
from seerob.core.snapshot import Verdict
from seerob.outputs.palette import DARK_HEX, HEX

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
_MOST_KNOWN = 4096
"""Texts that are kept as they are written: verdicts and reasons come again and again."""


class SheetRows:
    """Writes a sheet, row by row.

    Args:
        sheet: New.
        formats: Of its workbook.
    """

    def __init__(self, sheet: Worksheet, formats: Formats) -> None:
        self._sheet, self._formats = sheet, formats
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
        n = self.rows
        self.rows += 1
        self._size += _NUMBER * len(row)
        number = self._sheet.write_number
        for k, value in enumerate(row):
            if isinstance(value, bool):
                self._sheet.write_boolean(n, k, value)
            elif isinstance(value, float | int):
                if -_LARGEST <= value <= _LARGEST:
                    number(n, k, value, formats[k] if k < len(formats) else None)
                elif value == value:  # noqa: PLR0124 - a number
                    self._text(n, k, str(value), word)
            elif value:
                self._text(n, k, str(value), word)

    def close(self) -> None:
        """Let go of its file, of which there would be too many open; the workbook opens it again."""
        self._sheet._opt_close()

    def _text(self, n: int, k: int, value: str, word: str) -> None:
        known = self._known.get((value, word))
        if known is None:
            shown = plain(value)
            look = shown if shown in WORDS else word
            known = shown, self._formats.of(look, quoted=shown.startswith(FORMULA))
            if len(self._known) < _MOST_KNOWN:
                self._known[value, word] = known
        shown, look_ = known
        self._size += _CHARACTER * len(shown)
        if shown.startswith("<r>") and shown.endswith("</r>"):
            # XlsxWriter takes such a text for markup of its own, unless it comes in pieces.
            self._sheet.write_rich_string(n, k, shown[0], shown[1], shown[2:], *([look_] if look_ else []))
        else:
            self._sheet.write_string(n, k, shown, look_)


def plain(text: str) -> str:
    """Text as a cell can hold it: what is no character is marked, what is too long ends in an ellipsis."""
    shown = _NOT_TEXT.sub("\ufffd", text)
    if 2 * len(shown) > _LONGEST_TEXT:
        units = shown.encode("utf-16-le")
        if len(units) > 2 * _LONGEST_TEXT:
            shown = units[: 2 * _LONGEST_TEXT - 2].decode("utf-16-le", errors="ignore") + "…"
    return shown
