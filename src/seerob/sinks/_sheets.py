"""Sheets of a workbook as a person reads them: widths that fit, a header that stays, units, plain text."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from seerob.figures import DECIMALS
from seerob.sinks._palette import DARK_HEX, HEX
from seerob.snapshot import Verdict

if TYPE_CHECKING:
    from openpyxl import Workbook

Cell = str | float | int | None

EXCEL_ROWS = 1_048_576
"""Rows of a sheet, header included; longer data goes on in a further sheet."""
_LONGEST_TEXT = 32_767
_NOT_TEXT = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_NOT_IN_SHEET_NAME = re.compile(r"[\[\]:*?/\\\x00-\x1f']")
_UNIT = re.compile(r"\[([^\[\]]*)\]$")
_NARROWEST, _WIDEST, _TEXT_COLUMN = 9, 60, 44
_MORE = 2
"""Places shown beyond `DECIMALS`: here the figures are for further work. The cell holds all digits."""
_OWN_UNIT = ("worst value", "limit", "value")
"""Columns whose unit stands in the row."""
_WORDS = {v.value: v for v in Verdict}


class Sheets:
    """Adds sheets to a write-only workbook; text from files stays text, whatever it begins with."""

    def __init__(self, book: Workbook) -> None:
        self._book = book
        self._names: set[str] = set()
        self._styles: dict[str, Any] = {}

    def add(
        self, name: str, head: Sequence[Cell], rows: Iterable[Sequence[Cell]], *, fit: bool = False
    ) -> None:
        """Add a sheet, and further ones when the rows do not fit.

        Args:
            name: Made unique and fit for Excel.
            head: Titles; a unit in brackets at the end of one gives its column's number format.
            rows: Cells; words of verdicts get their colour.
            fit: Whether columns are as wide as their text, which is wrapped beyond a limit; the rows
                must be a list then, with their units in a column named ``unit``, if any.
        """
        widths = _widths(head, rows if fit and isinstance(rows, list) else [])
        formats = [_format(_unit(title)) for title in head]
        unit_at = list(head).index("unit") if fit and "unit" in head else -1
        sheet: Any = None
        # A row is written when it is appended, so that one cell per format serves all numbers of a column.
        used: dict[tuple[int, str], Any] = {}
        written = EXCEL_ROWS
        for row in rows:
            if written >= EXCEL_ROWS:
                sheet = self._begin(name, head, widths)
                written = 1
                used.clear()
            if 0 <= unit_at < len(row):
                own = _format(str(row[unit_at] or ""))
                formats = [
                    own if title in ("worst value", "limit", "value") else f
                    for title, f in zip(head, formats, strict=True)
                ]
            cells = [
                self._number(sheet, value, k, formats[k] if k < len(formats) else "", used)
                if value is None or isinstance(value, float)
                else self._cell(sheet, value, formats[k] if k < len(formats) else "", wrap=fit)
                for k, value in enumerate(row)
            ]
            sheet.append(cells)
            written += 1
        if sheet is None:
            self._begin(name, head, widths)

    def close(self) -> None:
        """Close every sheet; one that is left open complains when it is collected."""
        for sheet in self._book.worksheets:
            sheet.close()

    def _begin(self, name: str, head: Sequence[Cell], widths: list[float]) -> Any:
        sheet = self._book.create_sheet(self._unique(name))
        sheet.freeze_panes = "B2"
        for k, width in enumerate(widths):
            sheet.column_dimensions[_letters(k)].width = width
        cells = [self._cell(sheet, title, "head") for title in head]
        sheet.append(cells)
        return sheet

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

    def _cell(self, sheet: Any, value: Cell, style: str, *, wrap: bool = False) -> Any:
        from openpyxl.cell import WriteOnlyCell

        if isinstance(value, float) and not math.isfinite(value):
            value = None if math.isnan(value) else str(value)
        if not isinstance(value, str):
            cell: Any = WriteOnlyCell(sheet, value)
            if style and value is not None:
                cell._style = self._style(sheet, style)
            return cell
        value = _NOT_TEXT.sub("\ufffd", value)
        if len(value) > _LONGEST_TEXT:
            value = value[: _LONGEST_TEXT - 1] + "…"
        cell = WriteOnlyCell(sheet, value)
        # openpyxl takes a leading = for a formula and error names for errors.
        cell.data_type = "s"
        quoted = value[:1] in ("=", "+", "-", "@", "\t", "\r")
        look = style if style == "head" else value if value in _WORDS else "wrap" if wrap else ""
        if look or quoted:
            cell._style = self._style(sheet, look, quoted=quoted)
        return cell

    def _number(
        self, sheet: Any, value: float | None, k: int, style: str, used: dict[tuple[int, str], Any]
    ) -> Any:
        """A cell of column ``k`` that holds a number, used again; None for an empty one."""
        if value is None or math.isnan(value):
            return None
        if math.isinf(value):
            return self._cell(sheet, value, style)
        cell = used.get((k, style))
        if cell is None:
            cell = used[k, style] = self._cell(sheet, value, style)
        cell._value = value  # the setter looks for the type each time
        return cell

    def _style(self, sheet: Any, look: str, *, quoted: bool = False) -> Any:
        """The style array of a look, made once: setting fonts cell by cell takes most of the time."""
        key = f"{look}{quoted}"
        if key not in self._styles:
            self._styles[key] = _styled(sheet, look, quoted)
        return self._styles[key]


def _styled(sheet: Any, look: str, quoted: bool) -> Any:
    from openpyxl.cell import WriteOnlyCell
    from openpyxl.styles import Alignment, Font, PatternFill

    cell: Any = WriteOnlyCell(sheet, "")
    if look == "head":
        cell.font = Font(bold=True)
        cell.alignment = Alignment(wrap_text=True, vertical="top")
    elif look == "wrap":
        cell.alignment = Alignment(wrap_text=True, vertical="top")
    elif look in _WORDS:
        verdict = _WORDS[look]
        cell.font = Font(bold=verdict is not Verdict.WITHIN, color="FF" + DARK_HEX[verdict][1:])
        if verdict is Verdict.UNDECIDED:
            cell.fill = PatternFill("solid", start_color="FF" + HEX[verdict][1:])
    elif look:
        cell.number_format = look
    cell.quotePrefix = quoted
    return cell._style


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


def _letters(k: int) -> str:
    from openpyxl.utils import get_column_letter

    return str(get_column_letter(k + 1))
