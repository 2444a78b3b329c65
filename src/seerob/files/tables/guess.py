"""What a table probably means, and what has to be asked.

A unit that the header declares is known; one that only the range of the numbers suggests is a guess, and a
guess is asked, never used: `Guess.questions` says what, `Guess.toml` how to answer.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import convert, structs

from seerob.core.errors import InputError, Problem
from seerob.core.transforms import Array
from seerob.files.tables.candidates import candidates
from seerob.files.tables.columns import Columns, guess_columns
from seerob.files.tables.grid import number
from seerob.files.tables.layout import Layout, find_layout
from seerob.files.tables.mapping import Mapping, Motion
from seerob.workstation.source import Target

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
        remedy = (
            "put this below the source in the workstation file, with what is wrong corrected:\n\n"
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
    return f"name the columns in [sources.mapping]: header_row, time, {columns} and their units" + seen
