"""Tables of captured motion: a row per instant with three columns per point, or a row per point.

Delimited text. Headers say which point, which coordinate, in which unit: ``PELVIS_X [mm]``, ``LeftHand
position y (m)``, ``head qw``, ``wrist confidence``; with a row per point ``time [s], joint, x [mm], y, z, qw
…``. A cell that is empty or ``NaN`` was not seen.

Numbers with a decimal comma, as spreadsheets of many countries write them.

A table of captured motion as the recording of one person.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.capture.captured import Captured, Seen
from seerob.files.motion_capture.frame_arrays import MAX_VALUES, check_size
from seerob.files.motion_capture.markers import MarkerReading, Points, recording
from seerob.files.tables.grid import MAX_COLUMNS, MAX_PROBLEMS, Grid
from seerob.files.tables.headers import Role, understand
from seerob.files.tables.mapping import Mapping
from seerob.files.tables.table_files import candidates

_WITH_COMMA = re.compile(r"[+-]?(\d+),(\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_GROUP = 3
"""Digits between the separators of thousands."""


class Commas:
    """Reads the cells of one file and finds out whether its commas can be taken for decimal ones.

    Args:
        file: For messages.
    """

    def __init__(self, file: str) -> None:
        self._file = file
        self._seen = ""
        self._sure = False

    def number(self, text: str) -> float:
        """The number in a cell.

        Raises:
            ValueError: It is none.
        """
        if "," not in text:
            return float(text)
        match = _WITH_COMMA.fullmatch(text)
        if match is None:
            raise ValueError(f"{text[:40]!r} is no number")
        whole, after = match.groups()
        self._seen = self._seen or text
        # Thousands come in groups of three and do not begin with 0.
        self._sure = self._sure or len(after) != _GROUP or len(whole) > _GROUP or whole[0] == "0"
        return float(text.replace(",", "."))

    def check(self) -> None:
        """Refuse a file whose commas may as well separate thousands.

        Raises:
            InputError: Every comma in it is followed by three digits.
        """
        if self._seen and not self._sure:
            what = (
                f"every comma is followed by three digits, as in {self._seen[:40]!r}: decimals or thousands?"
            )
            raise InputError.at(self._file, "", what, "write numbers with a decimal point")


def read_person(path: Path, reading: MarkerReading, *, seen: Seen, time_unit: str = "") -> Captured:
    """The points of one person.

    Args:
        path: Delimited text.
        reading: What the user says of it; ``subject`` is a value of the column ``person``.
        seen: What the points are.
        time_unit: Of the time, when its header does not say it.

    Raises:
        InputError: It is no such table, or the unit, the vertical or the person is not clear.
    """
    from dataclasses import replace

    table = read(path, file=reading.file, time_unit=time_unit)
    persons = sorted(set(table.persons))
    rows = np.ones(len(table.t), bool)
    if len(persons) > 1:
        chosen = _chosen_person(table.persons, reading)
        rows = np.array([p == chosen for p in table.persons])
        reading = replace(reading, subject="")
    order = np.flatnonzero(rows)
    confidence: Array | None = None
    notes: tuple[Finding, ...] = ()
    if "confidence" in table.has:
        confidence, notes = _shares(table, reading.file)
        confidence = confidence[order]
    points = Points(
        names=table.names,
        t=table.t[order],
        values=table.values[order, :, :3],
        unit=table.unit,
        wxyz=table.values[order, :, 3:7] if "orientation" in table.has else None,
        confidence=confidence,
    )
    return recording(points, reading, seen=seen, notes=notes)


def _shares(table: BodyTable, file: str) -> tuple[Array, tuple[Finding, ...]]:
    """Confidences from 0 to 1, shape (n, k), and what is to be said of them.

    A tracker's level 1 is of a joint that it predicts behind something else, and no share.

    Raises:
        InputError: They are neither shares nor levels.
    """
    said = table.values[..., 7]
    largest = float(np.nanmax(said, initial=0.0))
    if "level" not in table.has and largest <= 1.0:
        return np.maximum(said, 0.0), ()
    known = said[~np.isnan(said)]
    if largest > HIGHEST_LEVEL or (known != np.floor(known)).any():
        remedy = f"give shares from 0 to 1, or a tracker's levels 0 to {HIGHEST_LEVEL}"
        raise InputError.at(file, "confidence", f"confidences up to {largest:g}", remedy)
    text = f"{file}: confidences are levels of a tracker: from 2 on a joint is seen, below it is predicted"
    return np.where(said >= 2.0, 1.0, 0.0), (Finding(level="assumed", subject="", text=text),)


def _chosen_person(persons: tuple[str, ...], reading: MarkerReading) -> str:
    counts = {name: persons.count(name) for name in sorted(set(persons)) if name}
    if reading.subject in counts:
        return reading.subject
    if not reading.subject and len(counts) == 1:
        return next(iter(counts))
    shown = ", ".join(f"{name} ({n} rows)" for name, n in list(counts.items())[:12])
    what = f"no person {reading.subject!r}" if reading.subject else "several persons"
    raise InputError.at(reading.file, "subject", what, f"name one of: {shown}")


MAX_HEADER = 200
_BRACKET = re.compile(r"\s*[\[(]\s*([^\])]{0,20}?)\s*[\])]\s*")
_SPLIT = r"(?:[\s_.:/\-]+|(?<=[a-z0-9])(?=[A-Z]))"
_TURN = re.compile(
    rf"^(?P<name>.+?){_SPLIT}(?:q|quat|quaternion|rot|rotation|ori|orientation|Rotation|Quat|Q)"
    rf"[\s_.:/\-]*(?P<axis>[wxyzWXYZ])$"
)
_PLACE = re.compile(
    rf"^(?P<name>.+?)(?:{_SPLIT}(?:pos|position|Position|Pos|loc|location|translation|coord))?"
    rf"{_SPLIT}(?P<axis>[xyzXYZ])$"
)
_SURE = re.compile(
    rf"^(?P<name>.+?){_SPLIT}(?:conf|confidence|Confidence|visibility|(?P<state>[tT]racking_?[sS]tate)|quality)$"
)
UNITS = {"mm": "mm", "cm": "cm", "m": "m", "millimeter": "mm", "meter": "m", "millimetre": "mm", "metre": "m"}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
"""Unit of time → seconds."""


class Column(NamedTuple):
    """What one column holds."""

    name: str
    """Name of the point, as the file has it; empty in a table with a row per point."""
    what: str
    """``position``, ``orientation``, ``confidence``, ``level``, ``time``, ``person`` or ``point``."""
    axis: int = 0
    """0…2 for x, y, z; 0…3 for w, x, y, z."""
    unit: str = ""
    """Declared in the header; empty when it is not."""


def column(header: str) -> Column | None:
    """What a header says; None when it says nothing of captured motion."""
    text = " ".join(header.split())
    if not text or len(text) > MAX_HEADER:
        return None
    unit = ""
    bracket = _BRACKET.search(text)
    if bracket is not None:
        unit = bracket[1].lower()
        text = f"{text[: bracket.start()]} {text[bracket.end() :]}".strip()
    plain = re.sub(r"[\s_\-.]+", "_", text.lower())
    if (time := _time(plain, text, unit)) is not None:
        return time
    if plain in ("body", "body_id", "person", "person_id", "user", "user_id", "subject", "skeleton_id"):
        return Column("", "person")
    if plain in (
        "joint",
        "joint_name",
        "joint_id",
        "point",
        "marker",
        "segment",
        "bone",
        "name",
        "landmark",
        "landmark_id",
        "landmark_name",
    ):
        return Column("", "point")
    if plain in ("confidence", "conf", "joint_confidence", "visibility"):
        return Column("", "confidence")
    if plain in ("tracking_state", "trackingstate"):
        return Column("", "level")
    return _of_a_point(text, plain, UNITS.get(unit, unit))


def _time(plain: str, text: str, unit: str) -> Column | None:
    match = re.fullmatch(r"(?:device_)?(?:time|timestamp|time_stamp|t)(?:_(s|ms|us|usec|msec|sec))?", plain)
    if match is not None:
        found = {"usec": "us", "msec": "ms", "sec": "s"}.get(match[1] or "", match[1] or "")
        return Column("", "time", unit=found or {"µs": "us", "usec": "us", "sec": "s"}.get(unit, unit))
    header = understand(f"{text} [{unit}]" if unit else text)
    return Column("", "time", unit=header.unit or "") if header.role is Role.TIME else None


def _of_a_point(text: str, plain: str, unit: str) -> Column | None:
    if plain in ("x", "y", "z") or re.fullmatch(r"(?:pos|position)_?[xyz]", plain):
        return Column("", "position", "xyz".index(plain[-1]), unit)
    if re.fullmatch(r"(?:q|quat|rot|ori|orientation)_?[wxyz]", plain):
        return Column("", "orientation", "wxyz".index(plain[-1]))
    if (match := _SURE.match(text)) is not None:
        return Column(match["name"], "level" if match["state"] else "confidence")
    if (match := _TURN.match(text)) is not None:
        return Column(match["name"], "orientation", "wxyz".index(match["axis"].lower()))
    if (match := _PLACE.match(text)) is not None:
        return Column(match["name"], "position", "xyz".index(match["axis"].lower()), unit)
    return None


SEARCH = 60
"""Rows in which a header is looked for."""
MAX_POINTS = 2000
FIRST = {"position": 0, "orientation": 3, "confidence": 7, "level": 7}
WIDTH = 8
"""x, y, z, then w, x, y, z, then confidence."""
HIGHEST_LEVEL = 3
"""Trackers say 0 for none, 1 for predicted, 2 for seen, and 3 where they are sure."""
_EMPTY = frozenset(["", "nan", "none", "null", "na", "n/a", "-"])


@dataclass(frozen=True, eq=False)
class BodyTable:
    """What a table holds, in its own unit and axes."""

    names: tuple[str, ...]
    t: Array
    """[s], shape (n,)."""
    persons: tuple[str, ...]
    """Person of each row, as the file has it; empty texts when it has none."""
    values: Array
    """Shape (n, k, 8): x, y, z, quaternion w, x, y, z, confidence; NaN where the file has nothing."""
    unit: str
    """Unit of the positions; empty when no header says it."""
    has: frozenset[str]
    """Which of ``position``, ``orientation``, ``confidence`` there are; ``level`` where a header says that
    confidences are a tracker's levels."""


def read(path: Path, *, file: str, time_unit: str = "") -> BodyTable:
    """A table of captured motion.

    Args:
        path: Delimited text.
        file: As messages name it.
        time_unit: Of the time column, when its header does not say it: ``s``, ``ms``, ``us``.

    Raises:
        InputError: It has no such header, a cell that is no number, or nobody says the unit of time.
    """
    grid, row, columns = _header(path, file)
    scale = _time_scale(columns, file, time_unit)
    if any(c.what == "point" for c in columns.values()):
        return _by_point(grid, row, columns, scale)
    return _by_instant(grid, row, columns, scale)


def _header(path: Path, file: str) -> tuple[Grid, int, dict[int, Column]]:
    """The table, its header's row from 1, and what its columns hold, by index."""
    for grid, _ in candidates(path, file, Mapping()):
        for number, row in enumerate(islice(grid.rows(), SEARCH), start=1):
            if len(row) > MAX_COLUMNS:
                break
            found = {i: c for i, cell in enumerate(row) if (c := column(str(cell))) is not None}
            kinds = [c.what for c in found.values()]
            if "time" in kinds and kinds.count("position") + kinds.count("orientation") >= 3:
                _check_columns(found, file, number)
                return grid, number, found
    what = "no row names a time and coordinates"
    remedy = "name the columns: time [s], PELVIS_X [mm], PELVIS_Y [mm], PELVIS_Z [mm], …"
    raise InputError.at(file, "", what, remedy)


def _check_columns(columns: dict[int, Column], file: str, row: int) -> None:
    problems: list[Problem] = []
    seen: dict[tuple[str, str, int], int] = {}
    for index, c in columns.items():
        key = (c.name, "confidence" if c.what == "level" else c.what, c.axis)
        if key in seen:
            what = f"columns {seen[key] + 1} and {index + 1} are both {c.name} {c.what} {c.axis}".replace(
                "  ", " "
            )
            problems.append(Problem(file, f"row {row}", what, "rename or remove one"))
        seen[key] = index
    for name in dict.fromkeys(c.name for c in columns.values()):
        for what, count in (("position", 3), ("orientation", 4)):
            own = sum(c.name == name and c.what == what for c in columns.values())
            if own not in (0, count):
                text = f"{own} columns for the {what} of {name or 'a point'}, {count} are needed"
                problems.append(Problem(file, f"row {row}", text, "name all of them, or none"))
    if problems:
        raise InputError(problems[:MAX_PROBLEMS])


def _time_scale(columns: dict[int, Column], file: str, given: str) -> float:
    stated = next(c.unit for c in columns.values() if c.what == "time")
    unit = given or stated
    if unit not in TIMES:
        what = f"the time is in {unit!r}" if unit else "no unit in the header of the time"
        raise InputError.at(file, "time_unit", what, 'give time_unit = "s", "ms" or "us"')
    return TIMES[unit]


def _unit(columns: dict[int, Column], file: str) -> str:
    stated = {c.unit for c in columns.values() if c.what == "position" and c.unit}
    if len(stated) > 1:
        raise InputError.at(file, "unit", f"positions in several units: {', '.join(sorted(stated))}")
    return next(iter(stated), "")


@dataclass(eq=False)
class _Numbers:
    """Cells as numbers, with every mistake up to a bound."""

    file: str
    problems: list[Problem] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._commas = Commas(self.file)

    def row(self, cells: list[object], number: int) -> list[float]:
        """Numbers; NaN for what is empty."""
        try:
            return list(map(float, cells))  # type: ignore[arg-type]
        except (TypeError, ValueError):
            return [self._one(cell, number) for cell in cells]

    def _one(self, cell: object, number: int) -> float:
        text = str(cell).strip()
        if cell is None or text.lower() in _EMPTY:
            return float("nan")
        try:
            return self._commas.number(text)
        except ValueError:
            self.problems.append(Problem(self.file, f"row {number}", f"{text[:40]!r} is no number"))
            if len(self.problems) >= MAX_PROBLEMS:
                raise InputError(self.problems) from None
            return float("nan")

    def check(self) -> None:
        """Raise what was wrong."""
        if self.problems:
            raise InputError(self.problems)
        self._commas.check()


def _has(wanted: dict[int, Column]) -> frozenset[str]:
    found = frozenset(c.what for c in wanted.values())
    return found | {"confidence"} if "level" in found else found


def _rows(grid: Grid, header: int) -> Iterator[tuple[int, Sequence[object]]]:
    for number, row in enumerate(grid.rows(), start=1):
        if number > header and any(str(cell).strip() for cell in row if cell is not None):
            yield number, row


def _by_instant(grid: Grid, header: int, columns: dict[int, Column], scale: float) -> BodyTable:
    names = tuple(dict.fromkeys(c.name for c in columns.values() if c.name))
    if not names or len(names) > MAX_POINTS:
        raise InputError.at(
            grid.file, f"row {header}", f"{len(names)} points", f"1…{MAX_POINTS} are expected"
        )
    wanted = {i: c for i, c in columns.items() if c.what in FIRST and c.name}
    place = [names.index(c.name) * WIDTH + FIRST[c.what] + c.axis for c in wanted.values()]
    time = next(i for i, c in columns.items() if c.what == "time")
    person = next((i for i, c in columns.items() if c.what == "person"), None)
    t, flat, persons = array("d"), array("d"), []
    numbers = _Numbers(grid.file)
    for number, row in _rows(grid, header):
        cells = [row[i] if i < len(row) else None for i in (time, *wanted)]
        first, *values = numbers.row(cells, number)
        t.append(first * scale)
        flat.extend(values)
        persons.append(_person(row, person))
        check_size(grid.file, len(t), len(names) * WIDTH)
    numbers.check()
    table = np.full((len(t), len(names) * WIDTH), np.nan)
    if len(t):
        table[:, place] = np.frombuffer(flat, float).reshape(len(t), -1)
    return BodyTable(
        names=names,
        t=np.array(t),
        persons=tuple(persons),
        values=table.reshape(len(t), len(names), WIDTH),
        unit=_unit(columns, grid.file),
        has=_has(wanted),
    )


def _by_point(grid: Grid, header: int, columns: dict[int, Column], scale: float) -> BodyTable:
    index = {c.what: i for i, c in columns.items() if c.what in ("time", "person", "point")}
    wanted = {i: c for i, c in columns.items() if c.what in FIRST and not c.name}
    place = [FIRST[c.what] + c.axis for c in wanted.values()]
    numbers = _Numbers(grid.file)
    names: dict[str, int] = {}
    instants: dict[tuple[float, str], int] = {}
    rows, flat = array("q"), array("d")
    for number, row in _rows(grid, header):
        cells = [row[i] if i < len(row) else None for i in (index["time"], *wanted)]
        t, *values = numbers.row(cells, number)
        name = str(row[index["point"]]).strip() if index["point"] < len(row) else ""
        at = names.setdefault(name, len(names))
        if len(names) > MAX_POINTS:
            raise InputError.at(grid.file, f"row {number}", f"more than {MAX_POINTS} points")
        instant = instants.setdefault((t * scale, _person(row, index.get("person"))), len(instants))
        rows.extend((instant, at))
        flat.extend(values)
        if len(flat) > MAX_VALUES:
            raise InputError.at(
                grid.file, f"row {number}", f"more than {MAX_VALUES} numbers", "split the file"
            )
    numbers.check()
    check_size(grid.file, len(instants), len(names) * WIDTH)
    table = np.full((len(instants), len(names), WIDTH), np.nan)
    if len(rows):
        which = np.frombuffer(rows, np.int64).reshape(-1, 2)
        given = np.full((len(which), WIDTH), np.nan)
        given[:, place] = np.frombuffer(flat, float).reshape(len(which), -1)
        table[which[:, 0], which[:, 1]] = given
        kept = table[which[:, 0], which[:, 1]]
        other = ((kept != given) & ~(np.isnan(kept) & np.isnan(given))).any(axis=1)
        if other.any():
            twice = [list(names)[at] for at in sorted(set(which[other, 1].tolist()))]
            shown = ", ".join(twice)[:120]
            what = f"{other.sum()} rows of an instant that has another of the same point: {shown}"
            remedy = "name the person of each row in a column person, write times in full, or remove one"
            raise InputError.at(grid.file, "", what, remedy)
    return BodyTable(
        names=tuple(names),
        t=np.array([t for t, _ in instants]),
        persons=tuple(person for _, person in instants),
        values=table,
        unit=_unit(columns, grid.file),
        has=_has(wanted),
    )


def _person(row: Sequence[object], index: int | None) -> str:
    if index is None or index >= len(row):
        return ""
    text = str(row[index]).strip()
    return "" if text.lower() in _EMPTY else text
