"""The permissible-speed map: as a file, which `seerob permissible` writes, and drawn in the room."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.markers import Polyline, Vec3
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict

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


# -- drawn in the room ----------------------------------------------------------------------------

LABELLED = 8
"""Stretches that say their speeds, those above what is permitted first; more would hide the picture."""


class Place(NamedTuple):
    """A place of the way of the tool point; speeds are those of the tool point."""

    point: Vec3
    """[m], world."""
    permissible: float
    """[m/s]; NaN where it cannot be told."""
    given: float
    """[m/s]"""

    @property
    def verdict(self) -> Verdict:
        """Whether the given motion keeps to what is permitted here."""
        if math.isnan(self.permissible):
            return Verdict.UNDECIDED
        kept = self.given <= self.permissible * (1 + 1e-9) and (self.permissible > 0 or self.given == 0)
        return Verdict.WITHIN if kept else Verdict.EXCEEDED


def path_markers(pieces: Iterable[Sequence[Place]]) -> tuple[Polyline, ...]:
    """Lines along a path: within, exceeded or undecided against the given motion; the worst first."""
    stretches = [stretch for piece in pieces for stretch in _stretches(piece)]
    urgent = sorted((s for s in stretches if s[0].verdict is not Verdict.WITHIN), key=_urgency)
    # Where all is within, one label says how near it comes.
    shown = urgent[:LABELLED] or sorted(stretches, key=_urgency)[:1]
    chosen = {id(stretch) for stretch in shown}
    return tuple(
        Polyline(
            points=tuple(place.point for place in stretch),
            label=_label(stretch) if id(stretch) in chosen else "",
            verdict=stretch[0].verdict,
        )
        for stretch in sorted(stretches, key=_urgency)
    )


def _stretches(piece: Sequence[Place]) -> Iterator[Sequence[Place]]:
    for _, group in groupby(range(len(piece)), key=lambda k: piece[k].verdict):
        inside = list(group)
        # The first place of the next one too: no gap is left between two colours.
        stretch = piece[inside[0] : inside[-1] + 2]
        if len(stretch) > 1:
            yield stretch


def _own(stretch: Sequence[Place]) -> list[Place]:
    return [place for place in stretch if place.verdict is stretch[0].verdict]


def _slowest(stretch: Sequence[Place]) -> Place:
    return min(_own(stretch), key=lambda place: place.permissible - place.given)


def _urgency(stretch: Sequence[Place]) -> tuple[int, float]:
    order = (Verdict.EXCEEDED, Verdict.UNDECIDED, Verdict.WITHIN)
    place = _slowest(stretch)
    return order.index(place.verdict), place.permissible - place.given


def _label(stretch: Sequence[Place]) -> str:
    place = _slowest(stretch)
    if math.isnan(place.permissible):
        return "undecided"
    return f"{place.permissible:.2f} m/s permitted, {place.given:.2f} given"
