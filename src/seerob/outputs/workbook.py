"""A workbook: its sheets as a person reads them, rows one at a time, and sheets about motion.

The file is written by XlsxWriter: a row in memory at a time, and the same bytes for the same cells. Numbers
are numbers, and text stays text whatever it begins with. A table of motion never holds more than so many
rows: when it is full, every second one goes.
"""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from html import escape
from itertools import compress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from seerob.core.figures import DECIMALS
from seerob.core.files.whole_file import hidden_folder
from seerob.core.samples import BodySample, Sample
from seerob.core.snapshot import Scene, Snapshot, Verdict
from seerob.core.transforms import Array
from seerob.outputs.palette import DARK_HEX, HEX
from seerob.outputs.tables import people as _sample_cells
from seerob.outputs.tables.growing_table import FORMULA, Pace
from seerob.outputs.tables.people import people

if TYPE_CHECKING:
    from xlsxwriter import Workbook
    from xlsxwriter.format import Format
    from xlsxwriter.worksheet import Worksheet


HEAD, WRAP = "head", "wrap"
"""Looks beside the verdicts' words and number formats such as ``0.000``."""
WORDS = {v.value: v for v in Verdict}
"""Of verdicts, which have a look each."""
_WRAPPED: dict[str, object] = {"text_wrap": True, "valign": "top"}


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


def _properties(look: str) -> dict[str, object]:
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
TOGETHER = 256
"""Rows that are written at once."""
_MOST_KINDS = 256
"""Of rows that are remembered."""
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
        self._rows_of: dict[tuple[type | None, ...], _Row] = {}
        self._waiting: list[str] = []
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
        if not formats and self._alike(n, row, word):
            return
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
                    cells.append(f'{begins[k]}{n}"{self._text(k, str(value), word)}')
                    places.append(k)
            elif value:
                cells.append(f'{begins[k]}{n}"{self._text(k, str(value), word)}')
                places.append(k)
        if cells:
            self._write(n, f'<row r="{n}">{"".join(cells)}</row>', places)

    def _alike(self, n: int, row: Sequence[Cell], word: str) -> bool:
        """Write a row of numbers and texts as the last one that had them in the same columns; whether it is.

        Most are: it takes half the time of going through the cells.
        """
        kinds = tuple([type(v) if v == v and (v or v == 0) else None for v in row])  # noqa: PLR0124 - NaN
        found = self._rows_of.get(kinds)
        if found is None:
            if len(self._rows_of) >= _MOST_KINDS:
                return False
            found = self._rows_of[kinds] = self._row_of(kinds)
        if found.text is None:
            return False
        cells = list(compress(row, kinds))
        if found.numbers and not _bounded(cells if not found.texts else list(compress(row, found.numbers))):
            return False
        for at, k in found.texts:
            cells[at] = self._text(k, cast("str", cells[at]), word)
        values: list[Cell] = [n] * (2 * len(cells) + 1)
        values[2::2] = cells
        self._write(n, found.text % tuple(values), found.places)
        return True

    def _row_of(self, kinds: tuple[type | None, ...]) -> _Row:
        places = [k for k, kind in enumerate(kinds) if kind is not None]
        if not places or not {kinds[k] for k in places} <= {float, int, str}:
            return _Row(None)
        cells = (
            f'{self._begins[k]}%d"' + ("%s" if kinds[k] is str else f"{self._of_column(k)}><v>%.16G</v></c>")
            for k in places
        )
        texts = [(at, k) for at, k in enumerate(places) if kinds[k] is str]
        numbers = [kind in _NUMBERS for kind in kinds]
        return _Row(f'<row r="%d">{"".join(cells)}</row>', places, texts, numbers if any(numbers) else [])

    def _write(self, n: int, row: str, places: Sequence[int]) -> None:
        for k in (places[0], places[-1]):
            self._sheet._check_dimensions(n - 1, k)
        self._waiting.append(row)
        if len(self._waiting) == TOGETHER:
            self._flush()

    def _flush(self) -> None:
        self._sheet.fh.write("".join(self._waiting))
        self._waiting.clear()

    def close(self) -> None:
        """Let go of its file, of which there would be too many open; the workbook opens it again."""
        self._flush()
        self._sheet._opt_close()

    def _of_column(self, k: int) -> str:
        """Attribute of a cell without a format of its own."""
        found = self._styles[k]
        if found is None:
            found = self._styles[k] = _style(self._columns[k] if k < len(self._columns) else None)
        return found

    def _text(self, k: int, value: str, word: str) -> str:
        """A cell with a text, behind its place."""
        known = self._known.get((value, word))
        if known is None:
            shown = plain(value)
            look = shown if shown in WORDS else word
            known = _inline(shown), self._formats.of(look, quoted=shown.startswith(FORMULA))
            if len(self._known) < _MOST_KNOWN:
                self._known[value, word] = known
        inline, own = known
        self._size += _CHARACTER * len(value)
        return f"{self._of_column(k) if own is None else _style(own)} {inline}"


class _Row(NamedTuple):
    """A row by the kinds of its cells."""

    text: str | None
    """With places for its number, and each cell's; None where cells are gone through one by one."""
    places: Sequence[int] = ()
    """Columns that are not empty."""
    texts: Sequence[tuple[int, int]] = ()
    """Which of those are texts, and their columns."""
    numbers: Sequence[bool] = ()
    """Which columns are numbers."""


_NUMBERS: set[type] = {float, int}


def _bounded(row: Sequence[Any]) -> bool:
    """Whether numbers, at least one, are all such as a cell can hold; NaN is not."""
    if not row or not -_LARGEST <= min(row) <= max(row) <= _LARGEST:
        return False
    total = sum(row)
    return bool(total == total)  # noqa: PLR0124 - with NaN among them it is NaN


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


class ThinnedTable:
    """Rows evenly spread over what was offered, at least half as many as may be.

    Args:
        most: Rows at most, 2 or more.
        titles: Columns that are known at the start.
    """

    def __init__(self, most: int, titles: Sequence[str] = ()) -> None:
        self.titles: list[str] = list(titles)
        self.offered = 0
        self._most, self._stride = most, 1
        self._places = {title: k for k, title in enumerate(self.titles)}
        # Rows one after the other: a row of its own each would take four times as much.
        self._numbers = array("d")
        self._texts: dict[int, dict[int, str]] = {}
        """Row → column → text."""
        self._count = 0

    @property
    def thinned(self) -> bool:
        """Whether rows were left out."""
        return self._stride > 1

    def wants(self) -> bool:
        """Offer a row: whether it is to be kept, and `keep` to be called."""
        wanted = self.offered % self._stride == 0
        self.offered += 1
        if wanted and self._count >= self._most:
            self._numbers = array("d", self._table()[::2].tobytes())
            self._texts = {row // 2: texts for row, texts in self._texts.items() if row % 2 == 0}
            self._count = (self._count + 1) // 2
            self._stride *= 2
            wanted = (self.offered - 1) % self._stride == 0
        return wanted

    def keep(self, cells: Mapping[str, str | float | bool | None]) -> None:
        """Keep a row; a column that is new goes to the end."""
        if new := [title for title in cells if title not in self._places]:
            table = np.pad(self._table(), ((0, 0), (0, len(new))), constant_values=math.nan)
            self._numbers = array("d", table.tobytes())
            self.titles += new
            self._places = {title: k for k, title in enumerate(self.titles)}
        numbers, texts = [math.nan] * len(self.titles), {}
        for title, value in cells.items():
            if isinstance(value, str):
                texts[self._places[title]] = value
            elif value is not None:
                numbers[self._places[title]] = float(value)
        if texts:
            self._texts[self._count] = texts
        self._numbers.extend(numbers)
        self._count += 1

    def keep_numbers(self, values: Sequence[float | None]) -> None:
        """Keep a row of numbers, one per column; columns that have none are NaN."""
        self._numbers.extend(math.nan if v is None else v for v in values)
        self._numbers.extend([math.nan] * (len(self.titles) - len(values)))
        self._count += 1

    def _table(self) -> Array:
        return np.array(self._numbers).reshape(self._count, len(self.titles))

    def rows(self) -> Iterator[list[Cell]]:
        """All rows, equally wide; NaN where there is nothing."""
        width = len(self.titles)
        for k in range(self._count):
            row: list[Cell] = list(self._numbers[k * width : (k + 1) * width])
            for place, text in self._texts.get(k, {}).items():
                row[place] = text
            yield row


MOST_SHEETS = 200
"""Of samples; a workbook with more is of no use."""


class MotionSheets:
    """What a workbook says of motion, thinned as it comes, so that memory is bounded.

    Args:
        scene: Of the run.
        joint_rows: Rows of a robot's joints at most.
        rows: Rows of each other sheet at most; 0 for none of these sheets.
        every: Least time between two rows of a person's joints, bones and errors [s].
        everybody: Bones also of people whom no device sees.
    """

    def __init__(self, scene: Scene, *, joint_rows: int, rows: int, every: float, everybody: bool) -> None:
        self._joint_rows, self._most, self._pace = joint_rows, rows, Pace(every, scene.period)
        self._joints = _sample_cells.joint_titles(scene)
        self.people = people(scene)
        """Of the scene."""
        self._measured = {person.name: person for person in self.people}
        self._wanted = {person.name for person in self.people} if everybody else set()
        self._tables: dict[str, ThinnedTable] = {}

    def take(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick."""
        t = snapshot.t
        due = self._most > 0 and self._pace.due(t)
        for name, q in snapshot.joints.items():
            if name in self._measured and not due:
                continue
            key = f"joints {name}"
            table = self._tables.get(key)
            if table is None:
                most = self._most if name in self._measured else self._joint_rows
                titles = _sample_cells.joint_head(self._joints, name, len(q))
                titles += self._measured[name].joint_measured_titles if name in self._measured else ()
                table = self._begin(key, most, titles)
            if table.wants():
                person = self._measured.get(name)
                measured = [] if person is None else person.joints_measured(snapshot)
                table.keep_numbers([t, *q, snapshot.tracking.get(name), *measured])
        if not self._most:
            return
        for sample in samples:
            self._heard(sample)
        for person in self.people if due else ():
            if person.name in self._wanted:
                key = f"bones {person.name}"
                titles = [*person.bone_titles, *person.measured_titles]
                table = self._tables.get(key) or self._begin(key, self._most, titles)
                if table.wants():
                    poses = person.poses(snapshot).ravel().tolist()
                    table.keep_numbers([t, *poses, *person.measured(snapshot)])
            if snapshot.bones.get(person.name):
                key = f"errors {person.name}"
                table = self._tables.get(key) or self._begin(key, self._most, person.error_titles)
                if table.wants():
                    table.keep_numbers([t, *person.errors(snapshot)])

    def _heard(self, sample: Sample) -> None:
        if isinstance(sample, BodySample):
            self._wanted.add(sample.target)
        name = f"heard {_sample_cells.title(sample)}"
        if name not in self._tables and len(self._tables) >= MOST_SHEETS:
            return
        table = self._tables.setdefault(name, ThinnedTable(self._most))
        if table.wants():
            table.keep(_sample_cells.cells(sample, self._joints))

    def _begin(self, name: str, most: int, titles: list[str]) -> ThinnedTable:
        table = self._tables[name] = ThinnedTable(most, [_sample_cells.TIME, *titles])
        return table

    def __len__(self) -> int:
        return len(self._tables)

    def sheets(self) -> Iterator[tuple[str, ThinnedTable]]:
        """Name and table of each sheet."""
        yield from sorted(self._tables.items(), key=lambda item: _ORDER.index(item[0].split(" ")[0]))


_ORDER = ("joints", "bones", "errors", "heard")
