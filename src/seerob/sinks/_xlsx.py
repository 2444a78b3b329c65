"""A workbook file, written row by row: Office Open XML (ECMA-376 part 1, 18: SpreadsheetML).

Sheets are made of rows of numbers by the hundred thousand, which a general library makes a cell object each
for. Here a row is one piece of text. Numbers have all their digits; texts stand in their cells.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from html import escape
from pathlib import Path
from types import TracebackType
from typing import IO, Self
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from seerob.sinks._cell_looks import WORDS, Looks

Cell = str | float | int | None

MOST_COLUMNS = 16_384
"""Of a sheet."""
FULL = 1 << 30
"""A sheet of so many bytes is full: archives of 32 bits hold no larger part."""
_LONGEST_TEXT = 32_767
_NOT_TEXT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_ESCAPE = re.compile("_(?=x[0-9A-Fa-f]{4}_)")
"""What readers would take for an escaped character (ST_Xstring, 22.9.2.19)."""
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_MOST_KNOWN = 4096
"""Texts that are kept as they are written: verdicts and reasons come again and again."""
_COMPRESSION = 3
"""Twice as fast as the usual 6, a tenth larger."""
_TIME = (1980, 1, 1, 0, 0, 0)
"""Of every part, so that the same cells are the same bytes."""

_XML = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_LINKS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_TYPE = "application/vnd.openxmlformats-officedocument.spreadsheetml"
_FLOATS = frozenset({float})


class Workbook:
    """A workbook that is being written; one sheet after the other.

    Args:
        file: Where to, open for writing bytes.
    """

    def __init__(self, file: IO[bytes] | Path) -> None:
        self._zip = ZipFile(file, "w", ZIP_DEFLATED)
        self.looks = Looks()
        self._names: list[str] = []
        self._sheet: SheetRows | None = None

    def sheet(self, name: str, widths: Sequence[float]) -> SheetRows:
        """Begin a sheet whose first row and column stay in view; the one before must be closed.

        Args:
            name: As Excel takes it, not used yet.
            widths: Of the columns, in characters.
        """
        self._names.append(name)
        part = self._zip.open(_part(f"xl/worksheets/sheet{len(self._names)}.xml"), "w")
        self._sheet = SheetRows(part, self.looks, widths, first=len(self._names) == 1)
        return self._sheet

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._abandon()

    def _abandon(self) -> None:
        """Let go of the file, which is no workbook then."""
        if self._sheet is not None:
            self._sheet.close()
        with suppress(OSError):
            self._zip.close()

    def close(self) -> None:
        """Write what holds the sheets together."""
        count = range(1, len(self._names) + 1)
        sheets = "".join(
            f'<sheet name="{escape(name)}" sheetId="{k}" r:id="rId{k}"/>'
            for k, name in zip(count, self._names, strict=True)
        )
        types = "".join(
            f'<Override PartName="/xl/{name}" ContentType="{_TYPE}.{kind}+xml"/>'
            for name, kind in (
                ("workbook.xml", "sheet.main"),
                ("styles.xml", "styles"),
                *((f"worksheets/sheet{k}.xml", "worksheet") for k in count),
            )
        )
        links = [("worksheet", f"worksheets/sheet{k}.xml") for k in count] + [("styles", "styles.xml")]
        for name, text in (
            (
                "[Content_Types].xml",
                f'<Types xmlns="{_PACKAGE}/content-types"><Default Extension="rels" ContentType='
                '"application/vnd.openxmlformats-package.relationships+xml"/>'
                f'<Default Extension="xml" ContentType="application/xml"/>{types}</Types>',
            ),
            ("_rels/.rels", _relationships([("officeDocument", "xl/workbook.xml")])),
            (
                "xl/workbook.xml",
                f'<workbook xmlns="{_MAIN}" xmlns:r="{_LINKS}"><bookViews><workbookView/></bookViews>'
                f"<sheets>{sheets}</sheets></workbook>",
            ),
            ("xl/_rels/workbook.xml.rels", _relationships(links)),
            ("xl/styles.xml", f'<styleSheet xmlns="{_MAIN}">{self.looks.xml()}</styleSheet>'),
        ):
            self._zip.writestr(_part(name), _XML + text)
        self._zip.close()


class SheetRows:
    """The rows of one sheet; made by `Workbook.sheet`."""

    def __init__(self, part: IO[bytes], looks: Looks, widths: Sequence[float], *, first: bool) -> None:
        self._part, self._looks = part, looks
        self._texts: dict[tuple[str, str], str] = {}
        self._known: tuple[int, tuple[str, ...]] = (0, ())
        self._attributes: list[str] = []
        self._template = ""
        self._letters: list[str] = []
        self.rows = 0
        """Written so far."""
        self.size = 0
        """Bytes so far."""
        columns = "".join(
            f'<col min="{k}" max="{k}" width="{width:g}" customWidth="1"/>'
            for k, width in enumerate(widths[:MOST_COLUMNS], start=1)
        )
        shown = ' tabSelected="1"' if first else ""
        self._write(
            f'{_XML}<worksheet xmlns="{_MAIN}"><sheetViews><sheetView{shown} workbookViewId="0">'
            '<pane xSplit="1" ySplit="1" topLeftCell="B2" activePane="bottomRight" state="frozen"/>'
            f"</sheetView></sheetViews>{f'<cols>{columns}</cols>' if columns else ''}<sheetData>"
        )

    @property
    def full(self) -> bool:
        """Whether it takes no more rows."""
        return self.size >= FULL

    def append(self, row: Sequence[Cell], looks: tuple[str, ...] = (), *, word: str = "") -> None:
        """Write a row.

        Args:
            row: Cells; None and NaN are empty ones, text stays text whatever it begins with.
            looks: Of the numbers, by column (`seerob.sinks._cell_looks`); plain beyond its end.
            word: Look of texts; a verdict has its own.
        """
        self.rows += 1
        n, row = str(self.rows), row[:MOST_COLUMNS]
        while len(self._letters) < len(row):
            self._letters.append(letters(len(self._letters)))
        # `math.isfinite` would take a bool, too.
        if _FLOATS.issuperset(map(type, row)) and all(map(math.isfinite, row)):  # type: ignore[arg-type]
            cells = self._numbers(len(row), looks).replace("@", n) % tuple(row)
        else:
            cells = "".join(self._cells(row, n, self._styles(len(row), looks), word))
        self._write(f'<row r="{n}">{cells}</row>')

    def close(self) -> None:
        """End the sheet."""
        if not self._part.closed:
            self._write("</sheetData></worksheet>")
            self._part.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _write(self, text: str) -> None:
        data = text.encode()
        self.size += len(data)
        self._part.write(data)

    def _styles(self, width: int, looks: tuple[str, ...]) -> list[str]:
        """Attribute that says the look of a number, by column."""
        if self._known != (width, looks):
            self._known = width, looks
            every = (*looks, *("",) * (width - len(looks)))
            self._attributes = [self._style(look) for look in every[:width]]
            self._template = "".join(
                f'<c r="{letter}@"{style}><v>%r</v></c>'
                for letter, style in zip(self._letters, self._attributes, strict=False)
            )
        return self._attributes

    def _numbers(self, width: int, looks: tuple[str, ...]) -> str:
        """A row of numbers: a place for each, and ``@`` for the number of the row."""
        self._styles(width, looks)
        return self._template

    def _cells(self, row: Sequence[Cell], n: str, styles: list[str], word: str) -> Iterator[str]:
        for letter, value, style in zip(self._letters, row, styles, strict=False):
            if type(value) is float and value - value == 0.0:
                yield f'<c r="{letter}{n}"{style}><v>{value!r}</v></c>'
            elif value is None or value != value:  # noqa: PLR0124 - not a number
                continue
            elif isinstance(value, bool):
                yield f'<c r="{letter}{n}" t="b"><v>{value:d}</v></c>'
            elif isinstance(value, int | float) and math.isfinite(value):
                # An integer, or a number of numpy's.
                text = str(value) if isinstance(value, int) else repr(float(value))
                yield f'<c r="{letter}{n}"{style}><v>{text}</v></c>'
            else:
                yield f'<c r="{letter}{n}"{self._text(str(value), word)}'

    def _text(self, value: str, word: str) -> str:
        known = self._texts.get((value, word))
        if known is None:
            shown = _NOT_TEXT.sub("\ufffd", value)
            if len(shown) > _LONGEST_TEXT:
                shown = shown[: _LONGEST_TEXT - 1] + "…"
            style = self._style(shown if shown in WORDS else word, quoted=shown.startswith(_FORMULA))
            inside = escape(_ESCAPE.sub("_x005F_", shown), quote=False).replace("\r", "&#13;")
            known = f'{style} t="inlineStr"><is><t xml:space="preserve">{inside}</t></is></c>'
            if len(self._texts) < _MOST_KNOWN:
                self._texts[value, word] = known
        return known

    def _style(self, look: str, *, quoted: bool = False) -> str:
        number = self._looks.number(look, quoted=quoted)
        return f' s="{number}"' if number else ""


def letters(k: int) -> str:
    """Name of a column: A for 0."""
    name = ""
    k += 1
    while k:
        k, rest = divmod(k - 1, 26)
        name = chr(65 + rest) + name
    return name


def _part(name: str) -> ZipInfo:
    part = ZipInfo(name, _TIME)
    part.compress_type = ZIP_DEFLATED
    part._compresslevel = _COMPRESSION  # type: ignore[attr-defined]  # public from Python 3.13 on
    part.external_attr = 0o600 << 16
    return part


def _relationships(targets: Iterable[tuple[str, str]]) -> str:
    made = "".join(
        f'<Relationship Id="rId{k}" Type="{_LINKS}/{kind}" Target="{target}"/>'
        for k, (kind, target) in enumerate(targets, start=1)
    )
    return f'<Relationships xmlns="{_PACKAGE}/relationships">{made}</Relationships>'
