"""Files of waypoints: which reader one is for, told by its name; waypoints as tables, in TOML, YAML and CSV.

A waypoint as a table, `Point`, is written by hand in the workstation file, in a list ``waypoints`` of a TOML
or YAML file, optionally with ``tcp``, and as a row of a CSV file or workbook.

Columns of a sheet: ``name``, ``move``; ``q1_deg`` … (or ``_rad``, ``_m``, ``_mm``); ``x_m y_m z_m`` (or
``_mm``) with ``roll_deg pitch_deg yaw_deg`` (or ``_rad``), ``rx_rad ry_rad rz_rad`` (a rotation vector) or
``qw qx qy qz``; ``via_x_m via_y_m via_z_m``; ``speed``, ``acceleration`` (in the unit of the move: rad/s or
m/s, and so on); ``duration_s``, ``pause_s``, ``blend_m`` or ``blend_mm``. Units are never guessed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from seerob.core.errors import InputError, Problem
from seerob.core.extras import need
from seerob.core.files.bounded import TooLarge, content
from seerob.core.printable import printable_table
from seerob.core.quantities import Metres3, Pose, Radians, Table, unit
from seerob.core.samples import Vec4
from seerob.core.transforms import rotation_from_rpy, wxyz_from, wxyz_from_rotation
from seerob.files.tables.grid import Grid, blank, number, place
from seerob.files.tables.mapping import SI
from seerob.files.tables.table_files import (
    DELIMITERS,
    WORKBOOKS,
    SheetGrid,
    TextGrid,
    check_file,
    encoding_of,
    sheets,
)
from seerob.files.waypoints.fanuc import read_fanuc
from seerob.files.waypoints.krl import read_krl
from seerob.files.waypoints.rapid import read_rapid
from seerob.files.waypoints.urp import read_urp
from seerob.files.waypoints.urscript import read_urscript
from seerob.files.waypoints.waypoint import MAX_WAYPOINTS, Move, Program, ToolPose, Waypoint

TEXTS = ("name", "move")
BARE = ("speed", "acceleration", "qw", "qx", "qy", "qz")
WITH_UNIT = re.compile(
    r"(?P<stem>q\d{1,2}|(?:via_)?[xyz]|roll|pitch|yaw|r[xyz]|blend|duration|pause)_(?P<unit>deg|rad|mm|m|s|ms)"
)
KIND = {"x": "m", "y": "m", "z": "m", "blend": "m", "duration": "s", "pause": "s"}
CALCULATE = "open it in Excel or LibreOffice and save it: what wrote it does not calculate"
REMEDY = "columns are named in docs/sources/waypoints.md: q1_deg, x_mm, roll_deg, blend_mm …"


def read_sheet(path: Path, file: str) -> Program:
    """The waypoints of a table.

    Args:
        path: A workbook (its first sheet) or delimited text.
        file: Its name, for messages.

    Raises:
        InputError: With every wrong column, or every wrong row.
    """
    grid: Grid
    if path.suffix.lower() in WORKBOOKS:
        grid, *_ = sheets(path, file)
        _check_formulas(grid)
    else:
        encoding = encoding_of(path, file)
        grids = [TextGrid(path, file, encoding, d) for d in DELIMITERS]
        # What separates the columns is what cuts the first row into most pieces.
        grid = max(grids, key=lambda g: len(next(iter(g.rows()), [])))
    rows = iter(grid.rows())
    names = [str(c).strip().lower() if not blank(c) else "" for c in next(rows, [])]
    factors = _columns(names, file)
    comma = isinstance(grid, TextGrid) and grid.delimiter not in (",", " ")
    problems: list[Problem] = []
    tables = list(_tables(grid, islice(rows, MAX_WAYPOINTS + 1), names, factors, comma, problems))
    if problems:
        raise InputError(problems[:20])
    return program_of(tables, file)


def _check_formulas(grid: SheetGrid) -> None:
    """A speed or pause that looks empty would be taken as not given."""
    problems = [
        Problem(grid.file, place(grid, row), f"cell {column}: a formula without its result", CALCULATE)
        for row, column in islice(grid.uncalculated(), 20)
    ]
    if problems:
        raise InputError(problems)


def _columns(names: Sequence[str], file: str) -> list[float]:
    """Factor to SI of each column."""
    factors, problems = [], []
    for i, name in enumerate(names):
        match = WITH_UNIT.fullmatch(name)
        if name and names.index(name) != i:
            problems.append(Problem(file, f"column {i + 1}", f"{name!r} is there twice", "name each once"))
        if match is not None:
            si, factor = SI[match["unit"]]
            stem = match["stem"].removeprefix("via_")
            wanted = KIND.get(stem, "" if stem[0] == "q" else "rad")
            if wanted not in ("", si) or (si == "s" and wanted != "s"):
                problems.append(Problem(file, f"column {name!r}", f"{match['unit']} does not fit", REMEDY))
            factors.append(factor)
        elif name in (*TEXTS, *BARE, ""):
            factors.append(1.0)
        else:
            problems.append(Problem(file, f"column {name!r}", "is no column of waypoints", REMEDY))
            factors.append(1.0)
    if not names:
        problems.append(Problem(file, "row 1", "no header", REMEDY))
    if problems:
        raise InputError(problems)
    return factors


def _tables(
    grid: Grid,
    rows: Iterator[Sequence[object]],
    names: Sequence[str],
    factors: Sequence[float],
    comma: bool,
    problems: list[Problem],
) -> Iterator[tuple[str, dict[str, Any]]]:
    for row, cells in enumerate(rows, start=2):
        values: dict[str, Any] = {}
        if not all(blank(cell) for cell in cells[len(names) :]):
            what = f"{len(cells)} cells, the header names {len(names)} columns"
            remedy = "was a decimal comma taken for a separator? put ; between the cells"
            problems.append(Problem(grid.file, place(grid, row), what, remedy))
            continue
        for name, factor, cell in zip(names, factors, cells, strict=False):
            if blank(cell) or not name:
                continue
            if name in TEXTS:
                values[name] = str(cell).strip()
                continue
            value = number(cell, decimal_comma=comma)
            if isinstance(value, str):
                problems.append(Problem(grid.file, place(grid, row, name), value, "give a number"))
            else:
                stem = match["stem"] if (match := WITH_UNIT.fullmatch(name)) else name
                values[stem] = value * factor
        if values:
            try:
                yield place(grid, row), _table(values)
            except ValueError as error:
                problems.append(
                    Problem(grid.file, place(grid, row), str(error), "fill them, or leave all empty")
                )


def _table(values: dict[str, Any]) -> dict[str, Any]:
    """A row as the table of a `Point`."""
    table = {
        k: values[k] for k in (*TEXTS, "speed", "acceleration", "duration", "blend", "pause") if k in values
    }
    joints = sorted((k for k in values if re.fullmatch(r"q\d+", k)), key=lambda k: int(k[1:]))
    if joints:
        if joints != [f"q{i + 1}" for i in range(len(joints))]:
            raise ValueError(f"joints {', '.join(joints)}, but some before them are empty")
        table["q"] = [values[k] for k in joints]
    position = _all(values, ("x", "y", "z"))
    if position is not None:
        table["at"] = {"position": position}
        rpy = _all(values, ("roll", "pitch", "yaw"))
        wxyz = _all(values, ("qw", "qx", "qy", "qz"))
        vector = _all(values, ("rx", "ry", "rz"))
        if vector is not None:
            wxyz = wxyz_from("rotation_vector", np.array([vector]))[0].tolist()
        table["at"] |= {k: v for k, v in (("rpy", rpy), ("wxyz", wxyz)) if v is not None}
    via = _all(values, ("via_x", "via_y", "via_z"))
    return table | ({} if via is None else {"via": via})


def _all(values: dict[str, Any], keys: Sequence[str]) -> list[float] | None:
    there = [k for k in keys if k in values]
    if there and len(there) < len(keys):
        raise ValueError(f"only {', '.join(there)} of {', '.join(keys)}")
    return [values[k] for k in keys] if there else None


Positive = Annotated[float, Meta(gt=0, le=1e4)]


class Point(Table, frozen=True, kw_only=True):
    """One waypoint: joint positions ``q`` or a tool pose ``at``."""

    name: str = ""
    move: Move | None = None
    """``joint``, ``linear``, ``process`` or ``circular``; ``joint`` for joint positions, and to be given
    for a pose."""
    q: Radians | None = None
    """Joint positions [rad or m]; ``q_deg`` for degrees."""
    at: Pose | None = None
    """Pose of the tool point, in the frame that the source says."""
    via: Metres3 | None = None
    """A point on the way of a circular move [m]."""
    speed: Positive | None = None
    """Speed of the leading joint [rad/s or m/s], or of the tool point [m/s]."""
    acceleration: Positive | None = None
    """Acceleration of the leading joint [rad/s² or m/s²], or of the tool point [m/s²]."""
    duration: Annotated[float, unit("s", gt=0, le=1e5)] | None = None
    """Duration of the move [s], instead of speed and acceleration."""
    blend: Annotated[float, unit("m", ge=0, le=10)] = 0.0
    """Radius in which the path is rounded off [m]."""
    pause: Annotated[float, unit("s", ge=0, le=1e5)] = 0.0
    """Time that the robot stands there [s]."""

    def __post_init__(self) -> None:
        if (self.q is None) == (self.at is None):
            raise ValueError("give either q or at")
        if self.at is not None and self.move is None:
            raise ValueError("a pose needs its move: joint, linear, process or circular")
        if (self.via is not None) != (self.move is Move.CIRCULAR):
            raise ValueError("via belongs to a circular move, and a circular move needs it")
        if self.at is not None and self.at.rpy is None and self.at.wxyz is None:
            raise ValueError("a tool pose needs its orientation: rpy (or rpy_deg) or wxyz")

    def waypoint(self, place: str) -> Waypoint:
        """Return the waypoint that the readers of programs give."""
        pose = None if self.at is None else ToolPose(self.at.position, _wxyz(self.at))
        return Waypoint(
            place=place,
            move=self.move or Move.JOINT,
            name=self.name,
            q=self.q,
            pose=pose,
            via=None if self.via is None else ToolPose(self.via, (1.0, 0.0, 0.0, 0.0)),
            speed=self.speed,
            acceleration=self.acceleration,
            duration=self.duration,
            blend=self.blend,
            pause=self.pause,
        )


def program_of(tables: Iterable[tuple[str, Mapping[str, Any]]], file: str) -> Program:
    """A program of waypoints that are tables, each with its place in the file.

    Raises:
        InputError: With every mistake in every one of them.
    """
    from seerob.workstation.conversion import convert

    problems: list[Problem] = []
    found: list[Waypoint] = []
    for key, table in tables:
        point = convert(table, Point, file=file, key=key, problems=problems)
        if point is not None:
            found.append(point.waypoint(key))
        if len(found) > MAX_WAYPOINTS:
            raise InputError.at(file, key, f"more than {MAX_WAYPOINTS} waypoints", "split the file")
    if problems:
        raise InputError(problems)
    return Program(file, tuple(found))


def _wxyz(pose: Pose) -> Vec4:
    if pose.wxyz is not None:
        w, x, y, z = pose.wxyz
        length = (w * w + x * x + y * y + z * z) ** 0.5
        return w / length, x / length, y / length, z / length
    w, x, y, z = wxyz_from_rotation(rotation_from_rpy(pose.rpy or (0.0, 0.0, 0.0))).tolist()
    return w, x, y, z


MAX_BYTES = 16 << 20
MAX_DEPTH = 12


def read_structured(content: bytes, file: str, *, yaml: bool) -> Program:
    """The waypoints of a TOML or YAML file.

    Args:
        content: The file.
        file: Its name, for messages.
        yaml: Whether it is YAML.

    Raises:
        InputError: Not such a file, aliases in YAML (which hostile files use to grow), or wrong waypoints.
    """
    if len(content) > MAX_BYTES:
        raise InputError.at(file, "", f"{len(content)} bytes", f"at most {MAX_BYTES} are read")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError.at(file, "", f"is not text: {error}") from error
    table = printable_table(_yaml(text, file) if yaml else _toml(text, file))
    unknown = [key for key in table if key != "waypoints"]
    points = table.get("waypoints")
    if not isinstance(points, list) or unknown:
        what = f"unknown key {unknown[0]!r}" if unknown else "no list `waypoints`"
        raise InputError.at(file, "", what, "write a list `waypoints` of tables and nothing else")
    wrong = next((i for i, point in enumerate(points) if not isinstance(point, Mapping)), None)
    if wrong is not None:
        raise InputError.at(file, f"waypoints[{wrong}]", "is no table", "write keys and values")
    return program_of(((f"waypoints[{i}]", point) for i, point in enumerate(points)), file)


def _toml(text: str, file: str) -> Mapping[str, Any]:
    from seerob.core.files.toml_file import loads

    try:
        return loads(text)
    except (ValueError, RecursionError) as error:
        # Also what tomllib lets through: a number of 10 000 digits.
        raise InputError.at(file, "", f"is not TOML: {error}") from error


def _yaml(text: str, file: str) -> Mapping[str, Any]:
    need("ruamel.yaml")
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError
    from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

    try:
        depth = 0
        for event in YAML(typ="safe", pure=True).parse(text):
            depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
            # An anchor is what an alias refers to; a second one of the name is only warned of.
            named = isinstance(event, AliasEvent) or getattr(event, "anchor", None) is not None
            if named or depth > MAX_DEPTH:
                what = "holds aliases" if depth <= MAX_DEPTH else f"is nested deeper than {MAX_DEPTH}"
                raise InputError.at(file, "", what, "write every waypoint out")
        table = YAML(typ="safe", pure=True).load(text)
    except (YAMLError, ValueError, RecursionError) as error:
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError.at(file, "", f"is not YAML: {first}") from error
    if not isinstance(table, Mapping):
        raise InputError.at(file, "", "is no table", "write a list `waypoints`")
    _check_keys(table, file)
    return table


def _check_keys(value: Any, file: str) -> None:
    """Only texts may be keys: YAML also has numbers, lists and nothing for one."""
    if isinstance(value, Mapping):
        for key, below in value.items():
            if not isinstance(key, str):
                raise InputError.at(file, "", f"{str(key)[:40]} is no key", "write texts for keys")
            _check_keys(below, file)
    elif isinstance(value, list):
        for below in value:
            _check_keys(below, file)


TABLES = (".csv", ".tsv", ".txt", *WORKBOOKS)
KNOWN = ".script .urp .src .mod .prg .ls .toml .yaml .yml .csv .tsv .txt .xlsx"


def read_program(path: Path, file: str, values: Mapping[str, float | bool | str] | None = None) -> Program:
    """The waypoints of a file.

    Args:
        path: Where it is.
        file: Its name, for messages.
        values: What a program needs and does not give; see `Waypoints.values` of the source.

    Raises:
        InputError: It is missing, too large, of no known kind, or wrong.
    """
    check_file(path, file, MAX_BYTES)
    suffix = path.suffix.lower()
    if suffix in TABLES:
        return read_sheet(path, file)
    if suffix not in KNOWN.split():
        raise InputError.at(file, "", f"{suffix or 'no'} extension", f"waypoints are read from {KNOWN}")
    try:
        held = content(path, MAX_BYTES)
    except TooLarge as error:
        raise InputError.at(file, "", str(error), "split the file") from None
    given = values or {}
    if suffix == ".src":
        return read_krl(held, file, given, beside=_beside(path))
    reader = {
        ".script": read_urscript, ".urp": read_urp,
        ".mod": read_rapid, ".prg": read_rapid, ".ls": read_fanuc,
    }.get(suffix)  # fmt: skip
    if reader is not None:
        return reader(held, file, given)
    return read_structured(held, file, yaml=suffix != ".toml")


def _beside(path: Path) -> list[bytes]:
    """What KUKA's programs have their data in, what all share first: ``$config.dat``, ``<name>.dat``."""
    wanted = ("$config.dat", f"{path.stem}.dat".lower())
    there = {f.name.lower(): f for f in islice(path.parent.iterdir(), 10_000) if f.suffix.lower() == ".dat"}
    return [content(there[name], MAX_BYTES) for name in wanted if name in there]
