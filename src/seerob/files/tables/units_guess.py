"""Units of columns: declared in the header, or suggested by the range of the numbers and asked."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from math import pi
from typing import Any

import numpy as np

from seerob.core.transforms import Array
from seerob.files.tables.columns import Columns
from seerob.files.tables.grid import number
from seerob.files.tables.layout import Layout
from seerob.files.tables.mapping import Mapping

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
