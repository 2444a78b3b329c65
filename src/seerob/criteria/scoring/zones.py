"""Tables of angle zones: rows of an angle, a range and a score, with how long or how often it must be met.

The angle zones of norms and the rules of companies are tables of this one sort, written in a spreadsheet,
a text file or TOML. What is not known (an angle
that nobody measures, its accuracy, a hold that began before the run) makes a span of the score, never 0.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from itertools import islice, pairwise
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta, Struct

from seerob.core.errors import InputError, Problem, UnknownName, suggestion
from seerob.core.files.toml_file import read_toml
from seerob.criteria.scoring.held_work import GAP, QUICK, WINDOW, Hidden
from seerob.criteria.scoring.measured import Accuracy, Measured
from seerob.criteria.scoring.spans import ROUNDING
from seerob.description.humans.angles import NEEDS, SIDED, Angles
from seerob.description.humans.skeleton import SIDES
from seerob.files.tables.grid import Cell, Grid, blank, number, place
from seerob.files.tables.mapping import Mapping as TableMapping
from seerob.files.tables.table_files import candidates
from seerob.workstation.conversion import convert, tables
from seerob.workstation.tables.task_phase import Period, Seconds

_ROUNDING = 1e-9
ZoneAngle = Annotated[
    float,
    Meta(ge=-2 * math.pi, le=2 * math.pi, extra={"unit": "rad"}, extra_json_schema={"x-unit": "rad"}),
]
DERIVED = {"head_inclination": ("trunk_flexion", "neck_flexion")}
"""Sums of angles: the head against the vertical, as ISO 11226 relates it to neck and trunk."""
MEASURES = (*NEEDS, *DERIVED)
"""Every angle that a row may name."""
RANGES = {"trunk_flexion": (-math.pi, math.pi), "shoulder_flexion": (-math.pi / 2, 1.5 * math.pi)}
"""Least and greatest value [rad] where it is not ±π."""
NEUTRAL = {"elbow_flexion": math.radians(80), "arm_rise": math.radians(-80)}
"""Where a posture is neutral [rad], where that is not at 0."""


class ZoneRow(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One row of a table of zones: the score of an angle within a range."""

    angle: str
    """Which angle: ``trunk_flexion``, ``shoulder_elevation``, …"""
    low: ZoneAngle | None = None
    """Begin of the range [rad]; without end when not given. Where two rows meet, the higher score counts."""
    high: ZoneAngle | None = None
    """End of the range [rad], which belongs to it but at 0; without end when not given."""
    score: Annotated[float, Meta(ge=0, le=1000)]
    """Points, or the zone: 0 is nothing to be said against."""
    either_way: bool = False
    """The range is of the size of the angle: to the left as to the right."""
    side: Literal["right", "left"] | None = None
    """Only of this side; of each side when not given."""
    hold: Seconds | None = None
    """The row counts once the angle stayed in the range for so long [s]."""
    per_minute: Annotated[float, Meta(gt=0, le=1000)] | None = None
    """The row counts once the range was entered so often within the last minute."""
    allowed: Period | None = None
    """The row counts once the angle stayed longer than this [s], which is so at the begin of the range …"""
    allowed_at_end: Period | None = None
    """… and this at its end [s], linear in between."""
    support: Literal["with", "without"] | None = None
    """Only with, or only without, support of the trunk or arm; whatever the support when not given."""
    colour: str = ""
    """Colour of the zone, for reports: ``yellow``, ``#ffcc00``."""
    label: str = ""
    """What the zone is called: ``conditional``."""
    confidence: str = ""
    """How sure the figures are: ``2+`` sources, ``1``, ``M`` from memory."""

    @property
    def timed(self) -> bool:
        """Whether it counts only after a while or after several times."""
        return any(x is not None for x in (self.hold, self.per_minute, self.allowed))

    def within(self, angle: float) -> bool:
        """Whether an angle [rad] lies in the range."""
        x = abs(angle) if self.either_way else angle
        at_end = -ROUNDING if self.high == 0 else ROUNDING
        return (self.low is None or x >= self.low - ROUNDING) and (
            self.high is None or x <= self.high + at_end
        )

    def edges(self) -> list[float]:
        """Where the range begins and ends [rad], on both sides when it is of the size."""
        ends = [x for x in (self.low, self.high) if x is not None]
        return [*ends, *(-x for x in ends)] if self.either_way else ends

    def longest(self, angle: float) -> float:
        """Longest admissible stay at an angle [rad] in the range [s]."""
        assert self.allowed is not None
        if self.allowed_at_end is None or self.low is None or self.high is None:
            return self.allowed
        x = abs(angle) if self.either_way else angle
        return float(np.interp(x, [self.low, self.high], [self.allowed, self.allowed_at_end]))


def mistakes(row: ZoneRow) -> list[tuple[str, str, str]]:
    """What cannot be in a row: column, what is wrong, what would be right."""
    found = []
    if row.angle not in MEASURES:
        found.append(
            (
                "angle",
                str(UnknownName("angle", row.angle, MEASURES)),
                "docs/ergonomics/posture_table.md lists all of them",
            )
        )
    elif row.side is not None and not sided(row.angle):
        found.append(("side", f"{row.angle} has no side", "leave it empty"))
    if row.low is not None and row.high is not None and row.high <= row.low:
        what = f"the range ends at {_deg(row.high)}, not after its begin at {_deg(row.low)}"
        found.append(("high", what, "let it end later"))
    least, most = RANGES.get(row.angle, (-math.pi, math.pi))
    if row.low is not None and row.low >= most:
        found.append(("low", f"{row.angle} never is {_deg(row.low)}", "give degrees in the columns …_deg"))
    if row.high is not None and row.high <= least:
        found.append(("high", f"{row.angle} never is {_deg(row.high)}", "give degrees in the columns …_deg"))
    if row.either_way and row.low is not None and row.low < 0:
        found.append(("low", f"{_deg(row.low)} is no size", "give 0 or more, or drop either_way"))
    if row.allowed_at_end is not None and (row.allowed is None or row.low is None or row.high is None):
        found.append(("allowed_at_end", "needs allowed, low and high", "give them"))
    if row.allowed is not None and (row.hold is not None or row.per_minute is not None):
        found.append(("allowed", "stands beside hold or per_minute", "give two rows"))
    return found


def falls(rows: Sequence[ZoneRow]) -> list[tuple[str, str]]:
    """Where an angle that grows away from neutral leaves a row with points for none: what, and the remedy.

    Nothing would be said against it there.
    """
    found: dict[tuple[str, str], None] = {}
    for name, side in {
        (row.angle, at): None for row in rows for at in (SIDES if sided(row.angle) else ("",))
    }:
        own = [row for row in rows if row.angle == name and row.side in (None, side)]
        least, most = RANGES.get(name, (-math.pi, math.pi))
        edges = sorted({least, most, *(e for row in own for e in row.edges() if least < e < most)})
        parts = [(a, b, [r.score for r in own if r.within((a + b) / 2)]) for a, b in pairwise(edges)]
        middle = NEUTRAL.get(name, 0.0)
        for (a, b, scores), (c, d, others) in (*pairwise(parts), *pairwise(parts[::-1])):
            away = c >= middle - ROUNDING if c > a else d <= middle + ROUNDING
            if away and not others and max(scores, default=0.0) > 0:
                what = (
                    f"{name} has points from {_deg(a)} to {_deg(b)}, and no row from {_deg(c)} to {_deg(d)}"
                )
                found[what, "let the row go on, or give one with a score of 0"] = None
    return list(found)


def sided(angle: str) -> bool:
    """Whether an angle is of a side."""
    return angle in SIDED


def _deg(angle: float) -> str:
    return f"{math.degrees(angle):g}°"


class Stay:
    """How long and how often one angle is in one range. Absences shorter than a second do not count."""

    def __init__(self) -> None:
        self.since = math.nan
        self.entries: deque[float] = deque()
        self.peak = 0.0
        """Angle of the largest size in this stay [rad]."""
        self._left = math.nan

    def add(self, t: float, inside: bool, angle: float) -> None:
        """Whether the angle [rad] is inside at an instant [s]."""
        if inside:
            if math.isnan(self.since):
                self.since, self.peak = t, angle
                self.entries.append(t)
            self.peak = max(self.peak, angle, key=abs)
            self._left = math.nan
        elif not math.isnan(self.since):
            self._left = t if math.isnan(self._left) else self._left
            if t - self._left >= GAP - _ROUNDING:
                self.since = self._left = math.nan
        while self.entries and self.entries[0] <= t - WINDOW + _ROUNDING:
            self.entries.popleft()

    def met(self, row: ZoneRow, t: float, *, more: float = 0.0, hidden: int = 0) -> bool:
        """Whether a row's time or number is reached.

        Args:
            row: The row.
            t: Now [s].
            more: How much larger the angle may have been [rad].
            hidden: How many entries nobody may have seen.
        """
        if not row.timed:
            return True
        held = -1.0 if math.isnan(self.since) else t - self.since
        if row.allowed is not None:
            return held > _ROUNDING + row.longest(
                abs(self.peak) + more if self.peak >= 0 else self.peak - more
            )
        long = row.hold is not None and held >= row.hold - _ROUNDING
        often = row.per_minute is not None and len(self.entries) + hidden >= row.per_minute - _ROUNDING
        return long or often


STEP = math.radians(2.5)
"""Errors of an angle that are tried are no further apart [rad], a choice: entries by less are trembling."""


class ZoneMonitor:
    """The rows of one table over time, for one person.

    Args:
        rows: Of the table.
        from_rest: Whether nothing was held or repeated before the first instant.
    """

    def __init__(self, rows: Sequence[ZoneRow], *, from_rest: bool) -> None:
        self._rows = tuple(rows)
        self._from_rest = from_rest
        self._t = -math.inf
        self._begin(from_rest)

    def _begin(self, known_before: bool) -> None:
        self._known_before, self._start = known_before, math.nan
        # Surely and possibly.
        self._stays = {(i, side): (Stay(), Stay()) for i in range(len(self._rows)) for side in range(2)}
        self._off: dict[tuple[int, int], list[Stay]] = {}
        """Of rows that count entries, by number and side: as many as there are errors that are tried."""
        self._seen: dict[tuple[str, int], float] = {}
        self._hidden: dict[tuple[str, int], Hidden] = {}

    def add(
        self,
        t: float,
        angles: Angles,
        accuracy: Accuracy,
        supported: Mapping[tuple[str, int], bool | None],
    ) -> dict[tuple[str, int], tuple[float, float]]:
        """Least and greatest score of each angle and side at an instant [s].

        Args:
            t: After the instant before; an earlier one begins anew.
            angles: Of the posture; NaN is not measured.
            accuracy: Of each angle [rad].
            supported: Whether each angle and side has its weight supported; None when nobody said.
        """
        if t < self._t - _ROUNDING:
            self._begin(self._from_rest)
        elif math.isfinite(self._t) and t - self._t > GAP + _ROUNDING:
            self._begin(False)
        self._t = t
        if math.isnan(self._start):
            self._start = t
        found = {}
        for name in dict.fromkeys(row.angle for row in self._rows):
            for side in range(2 if sided(name) else 1):
                value, error = value_of(name, side, angles, accuracy)
                found[name, side] = self._score(t, name, side, value, error, supported.get((name, side)))
        return found

    def _score(
        self, t: float, name: str, side: int, value: float, error: float, supported: bool | None
    ) -> tuple[float, float]:
        least, most = RANGES.get(name, (-math.pi, math.pi))
        missing = math.isnan(value)
        if not missing:
            hidden = self._hidden.setdefault((name, side), Hidden(QUICK))
            hidden.add(t, t - self._seen.get((name, side), self._start))
            self._seen[name, side] = t
        first, last = (least, most) if missing else (value - error, value + error)
        rows = [
            (i, row)
            for i, row in enumerate(self._rows)
            if row.angle == name and row.side in (None, ("right", "left")[side])
        ]
        points = sorted({first, last, *(e for _, r in rows for e in r.edges() if first < e < last)})
        points += [(a + b) / 2 for a, b in pairwise(points)]
        meets: dict[int, tuple[bool, bool]] = {}
        for i, row in rows:
            inside = [row.within(x) for x in points]
            meets[i] = self._met(i, row, side, t, (all(inside), any(inside)), value, error)
        low = high = math.nan
        for x in points:
            here = [(row.score, *meets[i], _fits(row, supported)) for i, row in rows if row.within(x)]
            sure = max((score for score, yes, _, (fits, _) in here if yes and fits), default=0.0)
            may = max((score for score, _, maybe, (_, fits) in here if maybe and fits), default=0.0)
            low, high = np.fmin(low, sure), np.fmax(high, may)
        return float(low), float(high)

    def _met(
        self,
        i: int,
        row: ZoneRow,
        side: int,
        t: float,
        inside: tuple[bool, bool],
        value: float,
        error: float,
    ) -> tuple[bool, bool]:
        sure, possible = self._stays[i, side]
        angle = 0.0 if math.isnan(value) else value
        sure.add(t, inside[0], angle)
        possible.add(t, inside[1], angle)
        begun = self._known_before or not row.timed
        if not begun:
            # What lasts since the first instant may have begun before it; a count needs a whole minute.
            whole = possible.since <= self._start + _ROUNDING
            short = row.per_minute is not None and t - self._start < WINDOW - _ROUNDING
            lasting = row.per_minute is None or row.hold is not None
            begun = not ((lasting and whole) or short)
        hidden = self._hidden[row.angle, side].at(t) if (row.angle, side) in self._hidden else 0
        may = possible.met(row, t, more=error, hidden=hidden) or not begun or math.isnan(value)
        if row.per_minute is None or not error:
            return sure.met(row, t, more=-error), may
        # An angle that may be inside all the while entered once, whatever its error; with one of them it
        # may have come and gone.
        off = self._off.setdefault((i, side), [Stay() for _ in range(2 * math.ceil(error / STEP) + 1)])
        for stay, by in zip(off, np.linspace(-error, error, len(off)).tolist(), strict=True):
            stay.add(t, row.within(value + by), angle)
        every = all(stay.met(row, t) for stay in off)
        return every, may or any(stay.met(row, t, hidden=hidden) for stay in off)


def value_of(name: str, side: int, angles: Angles, accuracy: Accuracy) -> tuple[float, float]:
    """An angle by its name and how far it may be off [rad]."""
    parts = DERIVED.get(name, (name,))
    measured = Measured(angles, accuracy)
    values = [getattr(angles, part) for part in parts]
    total = sum(float(value[side] if sided(name) else value) for value in values)
    return total, sum(measured.error(part) for part in parts)


def _fits(row: ZoneRow, supported: bool | None) -> tuple[bool, bool]:
    if row.support is None:
        return True, True
    if supported is None:
        return False, True
    fits = supported == (row.support == "with")
    return fits, fits


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


def zones_of(table: Mapping[str, object], name: str) -> ZoneTable:
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
    if not problems:
        problems += [Problem(name, "rows", what, remedy) for what, remedy in falls(rows)]
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
    if not problems:
        problems += [Problem(grid.file, place(grid, header), what, remedy) for what, remedy in falls(rows)]
    if problems:
        raise InputError(problems)
    return tuple(rows)


def _row(
    grid: Grid, count: int, cells: Sequence[Cell], names: Mapping[int, str], problems: list[Problem]
) -> ZoneRow | None:
    def wrong(column: str, what: str, remedy: str = "") -> None:
        problems.append(Problem(grid.file, place(grid, count, column), what, remedy))

    before = len(problems)
    values: dict[str, object] = {}
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
