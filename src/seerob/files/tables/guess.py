"""What a table probably means, and what has to be asked.

A unit that the header declares is known; one that only the range of the numbers suggests is a guess, and a
guess is asked, never used: `Guess.questions` says what, `Guess.toml` how to answer.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import convert, structs

from seerob.core.errors import InputError, Problem
from seerob.core.transforms import CONVENTIONS, Array, columns_of, is_convention
from seerob.files.tables.grid import Cell, blank, number
from seerob.files.tables.headers import PREVIEW, ROTATION_VECTOR, SEARCH, UR_POSE, Layout, Role, find_layout
from seerob.files.tables.mapping import Mapping, Motion
from seerob.files.tables.table_files import candidates
from seerob.workstation.source import Target

ORIENTATIONS: dict[tuple[str, ...], str] = {
    ("qw", "qx", "qy", "qz"): "wxyz",
    ("a", "b", "c"): "ZYX",
    ("roll", "pitch", "yaw"): "rpy",
    ("w", "p", "r"): "rpy",
    ("rx", "ry", "rz"): "XYZ",
    ROTATION_VECTOR: "rotation_vector",
}
"""Names of orientation columns → the convention they most often mean."""
CERTAIN = (("qw", "qx", "qy", "qz"), ROTATION_VECTOR)
"""Those that mean nothing else."""


@dataclass(eq=False)
class Columns:
    """Columns of a layout; indices from 0."""

    mapping: dict[str, Any] = field(default_factory=dict)
    questions: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    indices: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Key of the mapping → columns."""


def guess_columns(
    layout: Layout, given: Mapping, target: Target | None, motion: Motion = Motion.JOINTS
) -> Columns:
    """The columns of every role, given or found; questions where several could be meant."""
    found = Columns()
    _single(layout, given, found, "time", Role.TIME)
    _single(layout, given, found, "robot_column", Role.ROBOT)
    _robots(layout, given, found, target)
    needed = {"time": "time"}
    if motion is Motion.JOINTS:
        needed["joints"] = "joint"
        if not _joints_by_name(layout, given, found, target):
            _joints(layout, given, found, "joints", Role.JOINT)
        count = len(found.indices.get("joints", ()))
        _joints(layout, given, found, "velocities", Role.VELOCITY, count)
        _joints(layout, given, found, "torques", Role.TORQUE, count)
    else:
        needed |= {"tcp_position": "tool position", "tcp_orientation": "tool orientation"}
        _tool_by_name(layout, given, found)
    _tool(layout, given, found)
    file, header = layout.grid.file, f"row {layout.header_row}"
    for key, what in needed.items():
        if not found.problems and not found.indices.get(key):
            names = ", ".join(repr(h.text) for h in layout.headers[:12] if h.text)
            remedy = f"name it in [sources.mapping]: {key} = …"
            found.problems.append(Problem(file, header, f"no {what} column among {names or 'none'}", remedy))
    used = {i for indices in found.indices.values() for i in indices}
    left = [h.text for i, h in enumerate(layout.headers) if h.text and i not in used]
    if left:
        more = f" and {len(left) - 12} more" if len(left) > 12 else ""
        found.notes.append("columns not used: " + ", ".join(left[:12]) + more)
    return found


def _single(layout: Layout, given: Mapping, found: Columns, key: str, role: Role) -> None:
    column = getattr(given, key)
    if column is not None:
        index = layout.find(key, column)
        if isinstance(index, Problem):
            found.problems.append(index)
        else:
            found.indices[key] = (index,)
        return
    fits = [i for i, h in enumerate(layout.headers) if h.role is role]
    if not fits:
        return
    found.indices[key] = (fits[0],)
    found.mapping[key] = layout.reference(fits[0])
    if len(fits) > 1:
        names = ", ".join(repr(layout.label(i)) for i in fits)
        found.questions[key] = f"{len(fits)} columns could be meant: {names}"


def _robots(layout: Layout, given: Mapping, found: Columns, target: Target | None) -> None:
    if given.robot is not None or "robot_column" not in found.indices:
        return
    (column,) = found.indices["robot_column"]
    names = {str(r[column]).strip(): None for r in layout.preview if column < len(r) and not blank(r[column])}
    if not names:
        return
    own = target is not None and target.name in names
    found.mapping["robot"] = target.name if target is not None and own else next(iter(names))
    if len(names) > 1 and not own:
        shown = ", ".join(map(repr, list(names)[:12]))
        found.questions["robot"] = f"the rows are of {len(names)} robots: {shown}"


def _joints_by_name(layout: Layout, given: Mapping, found: Columns, target: Target | None) -> bool:
    """Whether the headers are the names of the robot's own joints, as ROS writes them."""
    if target is None or given.joints is not None:
        return False
    indices = layout.find_all("joints", target.joints)
    if isinstance(indices, list):
        return False
    found.indices["joints"] = indices
    found.mapping["joints"] = tuple(layout.reference(i) for i in indices)
    return True


def _joints(
    layout: Layout, given: Mapping, found: Columns, key: str, role: Role, count: int | None = None
) -> None:
    columns = getattr(given, key)
    if columns is not None:
        indices = layout.find_all(key, columns)
        if isinstance(indices, list):
            found.problems += indices
            return
        found.indices[key] = indices
        if count and indices and len(indices) != count:
            what = f"{len(indices)} columns for {count} joints"
            found.problems.append(
                Problem(layout.grid.file, f"mapping.{key}", what, "name one per joint, or []")
            )
        return
    fits = [(int(h.which), i) for i, h in enumerate(layout.headers) if h.role is role]
    measured = [(n, i) for n, i in fits if not layout.headers[i].commanded]
    both = bool(measured) and len(measured) < len(fits)
    fits = sorted(measured or fits)
    if not fits:
        return
    numbers = [n for n, _ in fits]
    chosen = dict(reversed(fits))
    question = ""
    if both:
        question = "there are measured and commanded columns; these are the measured ones"
    if len(chosen) < len(numbers):
        twice = sorted({n for n in numbers if numbers.count(n) > 1})
        question = f"several columns could be joint {', '.join(map(str, twice))}; these are the first ones"
    elif numbers[0] not in (0, 1) or numbers[-1] - numbers[0] != len(numbers) - 1:
        question = f"the columns are numbered {', '.join(map(str, numbers))}"
    indices = tuple(chosen[n] for n in sorted(chosen))
    if count is not None and len(indices) != count:
        found.notes.append(f"{len(indices)} {role} columns for {count} joints: left out")
        return
    if key == "torques" and any(layout.headers[i].unit != "Nm" for i in indices):
        found.notes.append("torque columns whose header does not say Nm: left out")
        return
    found.indices[key] = indices
    found.mapping[key] = tuple(layout.reference(i) for i in indices)
    if question:
        found.questions[key] = question


def _tool_by_name(layout: Layout, given: Mapping, found: Columns) -> None:
    """Take the columns of a controller's own log, when the mapping names none."""
    indices = layout.find_all("tcp_position", UR_POSE)
    if given.tcp_position is not None or given.tcp_orientation is not None or isinstance(indices, list):
        return
    for key, group in (("tcp_position", indices[:3]), ("tcp_orientation", indices[3:])):
        found.indices[key] = group
        found.mapping[key] = tuple(layout.reference(i) for i in group)


def _tool(layout: Layout, given: Mapping, found: Columns) -> None:
    _axes(layout, given, found, "tcp_position", Role.TCP_POSITION, (("x", "y", "z"),))
    _axes(layout, given, found, "tcp_orientation", Role.TCP_ORIENTATION, tuple(ORIENTATIONS))
    file, indices = layout.grid.file, found.indices.get("tcp_orientation", ())
    if given.tcp_position and len(given.tcp_position) != 3:
        what = f"{len(given.tcp_position)} columns"
        found.problems.append(Problem(file, "mapping.tcp_position", what, "name x, y and z, or []"))
    if given.tcp_convention is not None:
        if not is_convention(given.tcp_convention):
            what = f"{given.tcp_convention!r} is not a convention"
            found.problems.append(Problem(file, "mapping.tcp_convention", what, f"write {CONVENTIONS}"))
        elif indices and len(indices) != columns_of(given.tcp_convention):
            what = (
                f"{len(indices)} columns, but {given.tcp_convention!r} has {columns_of(given.tcp_convention)}"
            )
            found.problems.append(Problem(file, "mapping.tcp_orientation", what))
        return
    if not indices:
        return
    which = tuple(layout.headers[i].which if i < len(layout.headers) else "" for i in indices)
    convention = ORIENTATIONS.get(which, "wxyz" if len(indices) == 4 else "ZYX")
    found.mapping["tcp_convention"] = convention
    if which not in CERTAIN:
        names = ", ".join(layout.label(i) for i in indices)
        found.questions["tcp_convention"] = f"{names} can be several conventions, {convention} among them"


def _axes(
    layout: Layout, given: Mapping, found: Columns, key: str, role: Role, sets: tuple[tuple[str, ...], ...]
) -> None:
    columns = getattr(given, key)
    if columns is not None:
        indices = layout.find_all(key, columns)
        if isinstance(indices, list):
            found.problems += indices
        elif indices:
            found.indices[key] = indices
        return
    if key in found.indices:
        return
    named: dict[str, list[int]] = {}
    for i, header in enumerate(layout.headers):
        if header.role is role:
            named.setdefault(header.which, []).append(i)
    complete = [s for s in sets if all(axis in named for axis in s)]
    if not complete:
        return
    if len(complete) > 1 or any(len(named[axis]) > 1 for axis in complete[0]):
        found.questions[key] = "several columns could be meant; these are the first ones"
    found.indices[key] = tuple(named[axis][0] for axis in complete[0])
    found.mapping[key] = tuple(layout.reference(i) for i in found.indices[key])


RATES = ("deg/s", "rad/s", "mm/s", "m/s")

_COMMA = re.compile(r"\s*[+-]?\d*,(\d+)(?:[eE][+-]?\d+)?\s*")
_THOUSANDS = re.compile(r"\s*[+-]?[1-9]\d{0,2},\d{3}\s*")


@dataclass(eq=False)
class Units:
    """Units per key of the mapping."""

    mapping: dict[str, Any] = field(default_factory=dict)
    questions: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    thousands: bool = False
    """Whether every comma in a number could separate thousands."""


def guess_units(layout: Layout, columns: Columns, given: Mapping) -> Units:
    """The unit of every column that was found.

    Args:
        layout: The table.
        columns: Its columns.
        given: What the user says; a contradiction with the header becomes a note.
    """
    found = Units()
    _decimal_comma(layout, columns, found)
    comma = (
        given.decimal_comma if given.decimal_comma is not None else bool(found.mapping.get("decimal_comma"))
    )
    # What to do without a declaration: unit by range, and the range in words.
    time = _values(layout, columns.indices.get("time", ()), comma)
    with np.errstate(over="ignore"):  # instants that nothing has, which are refused where they are read
        step = float(np.median(np.abs(np.diff(time)))) if time.size > 1 else 0.0
    _unit(
        layout,
        columns,
        given,
        found,
        "time",
        "time_unit",
        ("s", "ms", "us", "min"),
        "ms" if step >= 0.5 else "s",
        f"steps of {step:g}",
    )
    joints = _largest(layout, columns.indices.get("joints", ()), comma)
    angle = "deg" if joints > 4 * pi else "rad"
    _unit(
        layout,
        columns,
        given,
        found,
        "joints",
        "joint_unit",
        ("deg", "rad", "mm", "m"),
        angle,
        _range(joints),
    )
    declared = found.mapping.get("joint_unit") or given.joint_unit or angle
    rate = tuple(f"{u}/s" for u in declared) if isinstance(declared, tuple) else f"{declared}/s"
    speed = _largest(layout, columns.indices.get("velocities", ()), comma)
    _unit(
        layout,
        columns,
        given,
        found,
        "velocities",
        "velocity_unit",
        RATES,
        rate,
        f"values reach {speed:g}, the positions are in {declared}",
    )
    reach = _largest(layout, columns.indices.get("tcp_position", ()), comma)
    _unit(
        layout,
        columns,
        given,
        found,
        "tcp_position",
        "tcp_position_unit",
        ("mm", "m"),
        "mm" if reach > 10 else "m",
        f"values reach {reach:g}",
    )
    convention = given.tcp_convention or columns.mapping.get("tcp_convention")
    if convention not in ("wxyz", "xyzw"):
        turn = _largest(layout, columns.indices.get("tcp_orientation", ()), comma)
        _unit(
            layout,
            columns,
            given,
            found,
            "tcp_orientation",
            "tcp_orientation_unit",
            ("deg", "rad"),
            "deg" if turn > 2 * pi + 0.1 else "rad",
            _range(turn),
        )
    return found


def _unit(
    layout: Layout,
    columns: Columns,
    given: Mapping,
    found: Units,
    key: str,
    unit_key: str,
    allowed: tuple[str, ...],
    fallback: str | tuple[str, ...],
    evidence: str,
) -> None:
    indices = columns.indices.get(key, ())
    if not indices:
        return
    declared = [layout.headers[i].unit if i < len(layout.headers) else None for i in indices]
    odd = [u for u in declared if u is not None and u not in allowed]
    said = getattr(given, unit_key)
    if said is not None:
        each = said if isinstance(said, tuple) else (said,) * len(indices)
        for i, d, s in zip(indices, declared, each, strict=False):
            if d is not None and d != s:
                found.notes.append(f"header {layout.label(i)!r} says {d}, the mapping says {s}: {s} is used")
                break
        return
    if all(d in allowed for d in declared):
        found.mapping[unit_key] = declared[0] if len(set(declared)) == 1 else tuple(map(str, declared))
        return
    found.mapping[unit_key] = fallback
    names = ", ".join(repr(layout.label(i)) for i in indices[:3]) + (", …" if len(indices) > 3 else "")
    reason = f"header says {odd[0]}" if odd else "no unit in the header"
    found.questions[unit_key] = f"{reason} of {names}; {evidence}"


def _range(largest: float) -> str:
    if largest > 4 * pi:
        return f"values reach {largest:g}, too much for rad"
    return f"values reach {largest:g}, which could be rad or deg"


def _values(layout: Layout, indices: tuple[int, ...], comma: bool) -> Array:
    numbers = [
        value
        for row in layout.preview
        for i in indices
        if i < len(row) and isinstance(value := number(row[i], decimal_comma=comma), float)
    ]
    return np.array(numbers, float)


def _largest(layout: Layout, indices: tuple[int, ...], comma: bool) -> float:
    return float(np.abs(_values(layout, indices, comma)).max(initial=0.0))


def _decimal_comma(layout: Layout, columns: Columns, found: Units) -> None:
    used = {i for key, indices in columns.indices.items() if key != "robot_column" for i in indices}
    cells = [row[i] for row in layout.preview for i in used if i < len(row)]
    commas = [c for c in cells if isinstance(c, str) and _COMMA.fullmatch(c)]
    if commas:
        found.mapping["decimal_comma"] = True
        found.thousands = all(_THOUSANDS.fullmatch(c) for c in commas)


@dataclass(frozen=True, eq=False)
class Guess:
    """A mapping, as far as it can be told from the file, and how sure it is."""

    file: str
    mapping: Mapping
    """What was given, completed with what was found and guessed."""
    questions: dict[str, str]
    """Key of the mapping → why it is not certain; empty when everything is."""
    notes: tuple[str, ...]
    """What whoever reads a result should know: columns left out, units that contradict the header."""
    layout: Layout = field(repr=False)

    @property
    def certain(self) -> bool:
        """Whether nothing needs to be confirmed."""
        return not self.questions

    def toml(self) -> str:
        """The table to put below the source in the workstation file, doubtful lines with the reason."""
        return self.mapping.toml({key: f"please confirm: {text}" for key, text in self.questions.items()})

    def error(self) -> InputError:
        """The questions as an error whose remedy is the text to paste."""
        problems = [Problem(self.file, f"mapping.{key}", text) for key, text in self.questions.items()]
        log = {"timestamp", "actual_q_0"} <= {h.text for h in self.layout.headers}
        remedy = (
            ('it is a log of RTDE, which kind = "ur_record" reads without asking; or ' if log else "")
            + "put this below the source in the workstation file, with what is wrong corrected:\n\n"
            + self.toml()
        )
        problems[-1] = problems[-1]._replace(remedy=remedy)
        return InputError(problems)


def guess(
    path: Path,
    given: Mapping | None = None,
    *,
    name: str | None = None,
    target: Target | None = None,
    motion: Motion = Motion.JOINTS,
) -> Guess:
    """Look at a table of motion and say what its columns mean.

    Args:
        path: A workbook (.xlsx, .xlsm) or delimited text.
        given: What the user says; it is never overridden.
        name: The file as messages name it.
        target: The robot it is to drive; tells which rows are its own when several share the table.
        motion: Whether joints or the tool are looked for; joints may be missing beside the tool.

    Raises:
        InputError: No table, no header, no time, no joints, or a mapping that does not fit the file.
    """
    given = given or Mapping()
    if motion is Motion.TOOL:
        given = given.without_joints()
    name = name or path.name
    fitting = [
        (layout, base)
        for grid, base in candidates(path, name, given)
        if (layout := find_layout(grid, given, () if target is None else target.joints, motion)) is not None
    ]
    if not fitting and motion is Motion.JOINTS and given.header_row is None:
        proposed = _proposed(path, name, given, target)
        if proposed is not None:
            return proposed
    if not fitting:
        what = f"no row names a time and {motion}"
        raise InputError.at(name, "header", what, _remedy(path, name, given, motion))
    # Of several ways to cut the same text into columns, the one with the most joints is meant.
    guesses = [_one(name, layout, base, given, target, motion) for layout, base in fitting]
    usable = [g for g in guesses if not isinstance(g, InputError)]
    if not usable:
        raise next(g for g in guesses if isinstance(g, InputError))
    best = max(usable, key=lambda g: _width(g.mapping, motion))
    others = [g.mapping.sheet for g in usable if g.mapping.sheet != best.mapping.sheet]
    if others:
        names = ", ".join(repr(g.mapping.sheet) for g in usable)
        questions = {"sheet": f"{len(usable)} sheets hold {motion} over time: {names}", **best.questions}
        best = Guess(best.file, best.mapping, questions, best.notes, best.layout)
    return best


FEWEST = 3
"""Numbers in a row that may be a table of motion: an instant and two joints."""


def _proposed(path: Path, name: str, given: Mapping, target: Target | None) -> Guess | None:
    """What columns of numbers may be where no header says it, all of it to be confirmed; None without any.

    The first column that always grows is taken for the time, those after it for the joints. A table whose
    first row holds numbers has no header.
    """
    found: tuple[int, Guess] | None = None
    for grid, base in candidates(path, name, given):
        rows = list(islice(grid.rows(), PREVIEW + SEARCH))
        numbers = [_numbers(row) for row in rows]
        first = next((k for k, row in enumerate(numbers[:SEARCH]) if len(row) >= FEWEST), None)
        if first is None:
            continue
        whole = [row for row in numbers[first:] if row]
        columns = [i for i in whole[0] if all(i in row for row in whole)]
        time = next((i for i in columns if _grows([row[i] for row in whole])), None)
        joints = [i for i in columns if time is not None and i > time]
        wanted = len(target.joints) if target is not None else len(joints)
        if time is None or len(joints) < max(1, wanted) or (found and found[0] >= len(columns)):
            continue
        header = next((k for k in range(first, 0, -1) if len(list(_filled(rows[k - 1]))) >= FEWEST), 0)
        layout = find_layout(grid, structs.replace(given, header_row=header))
        if layout is None:
            continue
        names = [layout.reference(i) for i in (time, *joints[:wanted])]
        proposal = structs.replace(
            given,
            header_row=header,
            time=names[0] if given.time is None else given.time,
            joints=tuple(names[1:]) if given.joints is None else given.joints,
        )
        one = _one(name, layout, base, proposal, target, Motion.JOINTS)
        if isinstance(one, Guess):
            none = "the first row holds numbers: header_row = 0 says that no row names the columns"
            said = f"row {header} reads: " + " | ".join(h.text for h in layout.headers[:12] if h.text)
            asked = {
                "header_row": f"no row names a time and joints; {said if header else none}",
                "time": "the first column that always grows",
                "joints": "the columns after it, in their order",
            }
            asked = {key: text for key, text in asked.items() if getattr(given, key) is None}
            found = len(columns), Guess(name, one.mapping, asked | one.questions, one.notes, layout)
    return None if found is None else found[1]


def _numbers(row: Sequence[Cell]) -> dict[int, float]:
    """Numbers by column, from 0; none where a cell is something else."""
    found = {}
    for i, cell in enumerate(row):
        if blank(cell):
            continue
        value = number(cell)
        value = number(cell, decimal_comma=True) if isinstance(value, str) else value
        if isinstance(value, str):
            return {}
        found[i] = value
    return found


def _filled(row: Sequence[Cell]) -> Iterator[Cell]:
    """Cells with something in them."""
    return (cell for cell in row if not blank(cell))


def _grows(values: list[float]) -> bool:
    return len(values) > 1 and all(a < b for a, b in pairwise(values))


def _one(
    name: str, layout: Layout, base: Mapping, given: Mapping, target: Target | None, motion: Motion
) -> Guess | InputError:
    found = guess_columns(layout, given, target, motion)
    if found.problems:
        return InputError(found.problems)
    units = guess_units(layout, found, given)
    mapping = structs.replace(
        base,
        header_row=layout.header_row,
        group_row=layout.group_row,
        unit_row=layout.unit_row,
        **{k: v for k, v in (*found.mapping.items(), *units.mapping.items()) if v is not None},
    )
    questions = {**found.questions, **units.questions}
    if given.decimal_comma is None and mapping.decimal_comma and units.thousands:
        questions["decimal_comma"] = "every comma is followed by three digits: decimal comma or thousands?"
    asked = {k: v for k, v in questions.items() if getattr(given, k) is None}
    notes = (*found.notes, *units.notes)
    whole = convert(structs.asdict(given.over(mapping)), Mapping)
    return Guess(name, whole, asked, notes, layout)


def _width(mapping: Mapping, motion: Motion) -> int:
    if motion is Motion.TOOL:
        return len(mapping.tcp_position or ()) + len(mapping.tcp_orientation or ())
    return len(mapping.joints) if isinstance(mapping.joints, tuple) else 1000


def _remedy(path: Path, name: str, given: Mapping, motion: Motion) -> str:
    if given.header_row is not None:
        return f"header_row = {given.header_row} is beyond the table"
    shown = []
    for grid, _ in candidates(path, name, given):
        for row in grid.rows():
            text = [str(c) for c in row if c is not None and str(c).strip()]
            if text:
                shown.append(" | ".join(text)[:120])
                break
    seen = f" (the first row reads: {shown[0]})" if shown else " (the table is empty)"
    columns = "joints" if motion is Motion.JOINTS else "tcp_position, tcp_orientation, tcp_convention"
    rows = "header_row (0 where no row names the columns)"
    return f"name the columns in [sources.mapping]: {rows}, time, {columns} and their units" + seen
