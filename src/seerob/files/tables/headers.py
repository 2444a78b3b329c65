"""Where a table's header is, and what its columns are: in English, German, French, or as a mapping says."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import islice
from typing import NamedTuple

from seerob.core.errors import Problem, suggestion
from seerob.files.tables.grid import Cell, Grid, blank, number, place
from seerob.files.tables.mapping import Column, Mapping, Motion


class Role(StrEnum):
    """What a column holds."""

    TIME = "time"
    JOINT = "joint position"
    VELOCITY = "joint velocity"
    ACCELERATION = "joint acceleration"
    TORQUE = "joint torque"
    TCP_POSITION = "tool position"
    TCP_ORIENTATION = "tool orientation"
    TCP_RATE = "tool velocity"
    ROBOT = "robot name"
    OTHER = "other"


class Header(NamedTuple):
    """A header, understood as far as possible."""

    text: str
    role: Role = Role.OTHER
    which: str = ""
    """Joint number, or the axis's own name: ``x``, ``rx``, ``roll``, ``qw``."""
    unit: str | None = None
    """Declared in the header; None when it is not."""
    commanded: bool = False
    """A set value rather than a measured one."""


_SPELLINGS = {
    "s": "s sec secs second seconds sekunde sekunden seconde secondes",
    "ms": "ms msec millisecond milliseconds millisekunde millisekunden milliseconde millisecondes",
    "us": "us µs μs usec",
    "min": "min minute minutes",
    # A degree in German, 0.9 of one in English: known as a word, never as a unit.
    "grad": "grad gon",
    "grad/s": "grad/s",
    "deg": "deg degs degree degrees ° degré degrés degre degres",
    "rad": "rad rads radian radians radiant",
    "mm": "mm millimeter millimetre",
    "m": "m meter metre mètre",
    "deg/s": "deg/s °/s deg/sec degree/s degrees/s deg_s degs/s",
    "rad/s": "rad/s rad/sec rad_s rads/s radian/s",
    "mm/s": "mm/s mm/sec mm_s",
    "m/s": "m/s m/sec m_s",
    "deg/s2": "deg/s2 deg/s^2 °/s2 °/s^2",
    "rad/s2": "rad/s2 rad/s^2",
    "mm/s2": "mm/s2 mm/s^2",
    "m/s2": "m/s2 m/s^2",
    "Nm": "nm n.m n*m n·m n⋅m",
}
UNITS = {spelling: unit for unit, all_of_it in _SPELLINGS.items() for spelling in all_of_it.split()}
"""Spelling, in lower case → unit."""

_BRACKET = re.compile(r"[\[({<]\s*([^\])}>]{0,40}?)\s*[\])}>]")
_SUFFIX = re.compile(
    r"(?:\s*/\s*|[\s_,]+(?:in\s+)?|(?=°))(" + "|".join(map(re.escape, sorted(UNITS, key=len)[::-1])) + r")$"
)
_CAMEL = re.compile(r"(?<=[a-zà-ÿ])(?=[A-Z])")
_TOKEN = re.compile(r"[^\W\d_]+|\d+")

_TIME = frozenset(["time", "zeit", "temps", "t", "timestamp", "zeitstempel", "horodatage", "clock"])
_TIME_EXTRA = frozenset(
    ["stamp", "elapsed", "simulation", "sim", "total", "in", "cycle", "run", "écoulé", "ecoule"]
)
_JOINT = frozenset(
    [
        "j",
        "jt",
        "jnt",
        "joint",
        "axis",
        "achse",
        "axe",
        "gelenk",
        "articulation",
        "a",
        "q",
        "theta",
        "dof",
        "qd",
        "dq",
        "qdd",
        "ddq",
        "v",
    ]
)
_VELOCITY = frozenset(
    ["velocity", "velocities", "vel", "speed", "geschwindigkeit", "vitesse", "v", "qd", "dq", "qdot", "omega"]
)
_ACCELERATION = frozenset(["acceleration", "acc", "accel", "beschleunigung", "accélération", "qdd", "ddq"])
_TORQUE = frozenset(["torque", "moment", "drehmoment", "couple", "effort", "tau"])
_ROBOT = frozenset(["robot", "roboter", "resource", "ressource", "robotname", "robotername"])
_COMMANDED = frozenset(
    ["target", "soll", "cmd", "command", "commanded", "setpoint", "desired", "consigne", "reference"]
)
_FILLER = frozenset(
    [
        "value",
        "values",
        "wert",
        "valeur",
        "angle",
        "angles",
        "winkel",
        "pos",
        "position",
        "positions",
        "actual",
        "ist",
        "act",
        "measured",
        "meas",
        "mesure",
        "mesuré",
        "msr",
        "current",
        "real",
        "of",
        "de",
        "du",
        "des",
        "la",
        "le",
        "l",
        "der",
        "the",
        "joint",
        "axis",
        "feedback",
        "name",
        "id",
        "nom",
    ]
)
_TCP = frozenset(
    [
        "tcp",
        "tool",
        "tip",
        "werkzeug",
        "outil",
        "cartesian",
        "cart",
        "kartesisch",
        "end",
        "effector",
        "eef",
        "flange",
        "p",
    ]
)
_ORIENTATION = frozenset(
    ["rx", "ry", "rz", "roll", "pitch", "yaw", "qw", "qx", "qy", "qz", "a", "b", "c", "w", "p", "r"]
)


def unit_of(text: str) -> str | None:
    """The unit a text spells, such as ``°/s``; None when it spells none."""
    return UNITS.get(unicodedata.normalize("NFKC", text).strip().casefold().strip("[](){}<>").strip())


_UR_POSE = re.compile(r"(?:actual|target)_tcp_pose_([0-5])")
"""Universal Robots' own names: x, y, z [m], then a rotation vector [rad], in the controller's base frame."""
UR_POSE = tuple(f"actual_TCP_pose_{i}" for i in range(6))
ROTATION_VECTOR = ("rotation_x", "rotation_y", "rotation_z")


def understand(text: str) -> Header:
    """What a header says; ``Role.OTHER`` when it says nothing that is known."""
    text = " ".join(text.split())
    if len(text) > 200:
        return Header(text)
    ours = _UR_POSE.fullmatch(text.casefold())
    if ours is not None:
        i = int(ours[1])
        # Known by its name alone; it takes no role from columns that a table means as its own.
        return Header(text, Role.OTHER, ("x", "y", "z", *ROTATION_VECTOR)[i], "m" if i < 3 else "rad")
    name = unicodedata.normalize("NFKC", text)
    unit: str | None = None
    for match in _BRACKET.finditer(name):
        found = unit_of(match[1])
        if found:
            unit = found
            name = name[: match.start()] + " " + name[match.end() :]
            break
    name = name.strip()
    suffix = _SUFFIX.search(name.casefold()) if unit is None else None
    if suffix is not None and suffix.start() > 0:
        unit = UNITS[suffix[1]]
        name = name[: suffix.start()]
    tokens = [token.casefold() for token in _TOKEN.findall(_CAMEL.sub(" ", name))]
    return _classify(text, tokens, unit)


def _classify(text: str, tokens: list[str], unit: str | None) -> Header:
    digits = [token for token in tokens if token.isdigit()]
    words = frozenset(token for token in tokens if not token.isdigit())
    commanded = bool(words & _COMMANDED)
    words -= _COMMANDED
    if not words and not (digits and unit):
        return Header(text, unit=unit)
    if words & _TIME and words <= _TIME | _TIME_EXTRA and not digits:
        return Header(text, Role.TIME, "", unit)
    if words & _ROBOT and words <= _ROBOT | _FILLER and not digits:
        return Header(text, Role.ROBOT, "", None)
    rate = bool(words & _VELOCITY) or unit in ("deg/s", "rad/s", "mm/s", "m/s")
    acceleration = bool(words & _ACCELERATION) or unit in ("deg/s2", "rad/s2", "mm/s2", "m/s2")
    torque = bool(words & _TORQUE) or unit == "Nm"
    kinds = _VELOCITY | _ACCELERATION | _TORQUE
    if len(digits) == 1 and words & (_JOINT | kinds) and words <= _JOINT | _FILLER | kinds:
        role = Role.JOINT
        if torque:
            role = Role.TORQUE
        elif acceleration:
            role = Role.ACCELERATION
        elif rate:
            role = Role.VELOCITY
        return Header(text, role, str(int(digits[0])), unit, commanded)
    if digits:
        return Header(text, unit=unit, commanded=commanded)
    return _tool(text, tokens, words, unit, rate=rate or acceleration, commanded=commanded)


def _tool(
    text: str, tokens: list[str], words: frozenset[str], unit: str | None, *, rate: bool, commanded: bool
) -> Header:
    rest = [t for t in tokens if t not in _COMMANDED and t not in _VELOCITY | _ACCELERATION]
    axis = [t for t in rest if t not in _TCP - {"p"} and t not in _FILLER]
    if len(axis) == 2 and axis[0] in ("r", "rot", "rotation", "q", "quat", "v") and axis[1] in "wxyz":
        axis = [axis[0][0] + axis[1]]
    elif len(axis) == 2 and axis[0] == "p" and axis[1] in "xyz":
        axis = axis[1:]
    if len(axis) != 1:
        return Header(text, unit=unit)
    name = axis[0]
    if name in ("vx", "vy", "vz"):
        return Header(text, Role.TCP_RATE, name, unit, commanded)
    if name in ("x", "y", "z") and (len(tokens) == 1 or words & (_TCP | _FILLER) or rate):
        return Header(text, Role.TCP_RATE if rate else Role.TCP_POSITION, name, unit, commanded)
    if name in _ORIENTATION:
        return Header(text, Role.TCP_RATE if rate else Role.TCP_ORIENTATION, name, unit, commanded)
    return Header(text, unit=unit)


PREVIEW = 400
"""Rows that are looked at before anything is decided."""
SEARCH = 60
"""Rows in which a header is looked for."""


@dataclass(frozen=True, eq=False)
class Layout:
    """A table whose header was found."""

    grid: Grid
    header_row: int
    """From 1; 0 when there is none."""
    group_row: int | None
    unit_row: int | None
    headers: tuple[Header, ...]
    """One per column."""
    preview: tuple[Sequence[Cell], ...]
    """The first rows of values."""

    @property
    def first_row(self) -> int:
        """First row of values, from 1."""
        return max(self.header_row, self.unit_row or 0) + 1

    def reference(self, column: int) -> Column:
        """How a mapping names a column, given its index from 0."""
        text = self.headers[column].text
        same = [h for h in self.headers if _same(h.text) == _same(text)]
        return text if text and len(same) == 1 else column + 1

    def label(self, column: int) -> str:
        """A column as messages name it."""
        text = self.headers[column].text if column < len(self.headers) else ""
        return text or str(column + 1)

    def find(self, key: str, column: Column) -> int | Problem:
        """Index, from 0, of the column that a mapping names."""
        file, where = self.grid.file, f"mapping.{key}"
        if isinstance(column, int):
            if 1 <= column <= max(len(self.headers), max(map(len, self.preview), default=0)):
                return column - 1
            return Problem(file, where, f"no column {column}", f"there are {len(self.headers)}, from 1")
        found = [i for i, h in enumerate(self.headers) if _same(h.text) == _same(column)]
        if len(found) == 1:
            return found[0]
        if found:
            numbers = " and ".join(str(i + 1) for i in found)
            return Problem(file, where, f"{len(found)} columns called {column!r}", f"write one of {numbers}")
        known = [h.text for h in self.headers if h.text]
        at = place(self.grid, self.header_row)
        return Problem(file, where, f"no column {column!r} in {at}", suggestion(column, known))

    def find_all(self, key: str, columns: str | tuple[Column, ...]) -> tuple[int, ...] | list[Problem]:
        """Indices of a list of columns, or of those whose header a regular expression matches."""
        if isinstance(columns, str):
            return self._matching(key, columns)
        found = [self.find(f"{key}[{i}]", column) for i, column in enumerate(columns)]
        problems = [f for f in found if isinstance(f, Problem)]
        indices = tuple(f for f in found if isinstance(f, int))
        if not problems and len(set(indices)) < len(indices):
            return [
                Problem(self.grid.file, f"mapping.{key}", "the same column twice", "name each column once")
            ]
        return problems or indices

    def _matching(self, key: str, pattern: str) -> tuple[int, ...] | list[Problem]:
        where = f"mapping.{key}"
        remedy = r"write a pattern such as 'J(\d+)', or the list of headers"
        try:
            expression = re.compile(pattern)
        except re.error as error:
            return [Problem(self.grid.file, where, f"{pattern!r} is not a pattern: {error}", remedy)]
        found: dict[int, int] = {}
        for i, header in enumerate(self.headers):
            match = expression.fullmatch(header.text[:200])
            if match is None:
                continue
            if not match.groups() or not (match[1] or "").isdecimal():
                what = f"{pattern!r} matches {header.text!r} but its first group is not a number"
                return [Problem(self.grid.file, where, what, remedy)]
            if int(match[1]) in found:
                what = f"{pattern!r} matches joint {match[1]} twice: {header.text!r} is the second"
                return [Problem(self.grid.file, where, what, remedy)]
            found[int(match[1])] = i
        if not found:
            return [Problem(self.grid.file, where, f"{pattern!r} matches no header", remedy)]
        return tuple(found[k] for k in sorted(found))


def find_layout(
    grid: Grid, given: Mapping, joints: tuple[str, ...] = (), motion: Motion = Motion.JOINTS
) -> Layout | None:
    """The header of a table; None when there is nothing like one.

    A row is taken when it holds every column that the mapping names; without a mapping, when it
    names a time and a joint; failing that, when it names two joints. ``joints`` are the joints of the
    robot that is to be driven: their own names in a header are understood too. For a motion of the
    tool its coordinates stand in for the joints.
    """
    role = Role.JOINT if motion is Motion.JOINTS else Role.TCP_POSITION
    names = joints if motion is Motion.JOINTS else UR_POSE
    rows = list(islice(grid.rows(), PREVIEW + SEARCH))
    if given.header_row is not None:
        if not 0 <= given.header_row <= len(rows):
            return None
        return _layout(grid, rows, given.header_row, given)
    wanted = {_same(c) for c in _named(given)}
    second: Layout | None = None
    for row in range(1, min(len(rows), SEARCH) + 1):
        if sum(isinstance(cell, str) and isinstance(number(cell), str) for cell in rows[row - 1]) < 2:
            continue
        layout = _layout(grid, rows, row, given)
        roles = [h.role for h in layout.headers]
        if wanted and wanted <= {_same(h.text) for h in layout.headers}:
            return layout
        own = bool(names) and set(map(_same, names)) <= {_same(h.text) for h in layout.headers}
        if Role.TIME in roles and (role in roles or own) and not wanted:
            return layout
        if roles.count(role) >= 2 or (wanted and role in roles):
            second = second or layout
    return second


def _layout(grid: Grid, rows: list[Sequence[Cell]], header_row: int, given: Mapping) -> Layout:
    names = [_text(c) for c in rows[header_row - 1]] if header_row else []
    filled = [_same(n) for n in names if n]
    group_row = given.group_row
    if group_row is None and header_row > 1 and len(set(filled)) < len(filled):
        group_row = header_row - 1
    if group_row is not None and 1 <= group_row <= len(rows):
        names = [f"{g} {n}".strip() if n else "" for g, n in _grouped(rows[group_row - 1], names)]
    unit_row = given.unit_row
    if unit_row is None and header_row and header_row < len(rows) and _is_units(rows[header_row]):
        unit_row = header_row + 1
    headers = [understand(n) if n else Header("") for n in names]
    if unit_row is not None and 1 <= unit_row <= len(rows):
        # A unit of its own row is a declaration like one in the header.
        for i, cell in enumerate(rows[unit_row - 1][: len(headers)]):
            if headers[i].unit is None and (unit := unit_of(_text(cell))):
                headers[i] = understand(f"{names[i]} [{unit}]")._replace(text=headers[i].text)
    first = max(header_row, unit_row or 0)
    preview = tuple(r for r in rows[first:] if not all(map(blank, r)))[:PREVIEW]
    if not header_row:
        headers = [Header("")] * max(map(len, rows), default=0)
    return Layout(grid, header_row, group_row, unit_row, tuple(headers), preview)


def _grouped(groups: Sequence[Cell], names: list[str]) -> Iterator[tuple[str, str]]:
    """Each name with the group that stands above it or, in a merged cell, left of that."""
    current = ""
    for i, name in enumerate(names):
        here = _text(groups[i]) if i < len(groups) else ""
        current = here or current
        yield current, name


def _is_units(row: Sequence[Cell]) -> bool:
    texts = [_text(c) for c in row if not blank(c)]
    return bool(texts) and all(unit_of(t) or t in ("-", "[-]") for t in texts)


def _named(given: Mapping) -> Iterator[str]:
    for name in ("robot_column", "time"):
        column = getattr(given, name)
        if isinstance(column, str):
            yield column
    for name in ("joints", "velocities", "torques", "tcp_position", "tcp_orientation"):
        columns = getattr(given, name)
        if isinstance(columns, tuple):
            yield from (c for c in columns if isinstance(c, str))


def _text(cell: Cell) -> str:
    return " ".join(cell.split()) if isinstance(cell, str) else ("" if cell is None else str(cell))


def _same(text: str) -> str:
    return " ".join(text.split()).casefold()
