"""The permissible-speed map as a file: what `seerob permissible` writes and ``path_speed`` reads."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.transforms import Array

PIECE = "piece"
PERMISSIBLE = "permissible path speed [rad/s or m/s]"
GIVEN = "path speed of the given motion [rad/s or m/s]"
TOOL_PERMISSIBLE = "permissible speed of the tool point [m/s]"
TOOL_GIVEN = "speed of the tool point as given [m/s]"
TOOL = ("tool x [m]", "tool y [m]", "tool z [m]")
WHO = ("criterion", "body region", "contact", "governed by")
WHY = "why undecided, or why none"
MOST_ROWS = 200_000
MAX_SIZE = 256 << 20
LARGEST = 1e6
"""No joint position, speed or coordinate of a cell is beyond."""


def joint_columns(units: Sequence[str]) -> list[str]:
    """``J1 [rad]`` … for the joints of a robot."""
    return [f"J{j + 1} [{unit}]" for j, unit in enumerate(units)]


@dataclass(frozen=True, eq=False)
class PathMap:
    """The places of a map in the order of the path; n places, d joints."""

    piece: NDArray[np.int64]
    """Between two pieces the robot stands or turns back, shape (n,)."""
    q: Array
    """[rad or m], shape (n, d)."""
    permissible: Array
    """Path speed [rad/s or m/s], NaN where undecided, shape (n,)."""
    tool: Array
    """Positions of the tool point [m], world, shape (n, 3)."""
    tool_permissible: Array
    """[m/s], NaN where undecided, shape (n,)."""
    tool_given: Array
    """[m/s], shape (n,)."""
    words: tuple[str, ...]
    """What governs at each place."""


def read_map(data: bytes, *, name: str, units: Sequence[str]) -> PathMap:
    """Read a map.

    Args:
        data: Of the file.
        name: Of the file, for messages.
        units: Of the robot's joints.

    Raises:
        InputError: Not a map, or not of this robot; the first mistakes.
    """
    if len(data) > MAX_SIZE:
        raise InputError.at(name, "", f"{len(data)} bytes", f"at most {MAX_SIZE}")
    try:
        reader = csv.DictReader(io.StringIO(data.decode("utf-8-sig"), newline=""), strict=True)
        columns = _columns(reader.fieldnames or (), name, units)
        rows = []
        for row in reader:
            rows.append(row)
            if len(rows) > MOST_ROWS:
                raise InputError.at(name, "", "too many rows", f"at most {MOST_ROWS}")
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError.at(name, "", f"is no table: {error}", _REMEDY) from error
    problems: list[Problem] = []

    def numbers(column: str, *, empty: bool = False) -> list[float]:
        return [_number(row.get(column), f"row {i}, {column}", name, empty, problems.append)
                for i, row in enumerate(rows, 2)]  # fmt: skip

    table = {column: numbers(column, empty=column in (PERMISSIBLE, TOOL_PERMISSIBLE)) for column in columns}
    if len(rows) < 2:
        problems.append(Problem(name, "", f"{len(rows)} places", "give two or more"))
    if problems:
        raise InputError(problems[:20])
    return PathMap(
        np.array(table[PIECE]).astype(np.int64),
        np.array([table[column] for column in joint_columns(units)]).T,
        np.array(table[PERMISSIBLE]),
        np.array([table[column] for column in TOOL]).T,
        np.array(table[TOOL_PERMISSIBLE]),
        np.array(table[TOOL_GIVEN]),
        tuple(_words(row) for row in rows),
    )


_REMEDY = "give a map.csv that `seerob permissible` wrote for this robot"


def _columns(head: Sequence[str], name: str, units: Sequence[str]) -> list[str]:
    joints = joint_columns(units)
    wanted = [PIECE, PERMISSIBLE, TOOL_PERMISSIBLE, TOOL_GIVEN, *TOOL, *joints]
    missing = [column for column in wanted if column not in head]
    more = [column for column in head if re.fullmatch(r"J\d+ \[\w+\]", column) and column not in joints]
    if missing or more or len(set(head)) != len(head):
        what = (
            f"columns missing: {', '.join(missing) or 'none'}; not of this robot: {', '.join(more) or 'none'}"
        )
        raise InputError.at(name, "header", what[:500], _REMEDY)
    return wanted


def _number(text: str | None, key: str, name: str, empty: bool, tell: Callable[[Problem], None]) -> float:
    if empty and text == "":
        return math.nan
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    negative = key.endswith("/s]") and value < 0
    if not abs(value) <= LARGEST or negative:
        tell(Problem(name, key, f"{(text or '')[:40]!r} cannot be", _REMEDY))
    return value


def _words(row: dict[str, str]) -> str:
    who, *what = (row.get(column) or "" for column in WHO)
    text = ", ".join(part for part in (*what, row.get(WHY) or "") if part)
    return (f"{who}: {text}" if text else who)[:300]
