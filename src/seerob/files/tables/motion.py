"""A table and its mapping → a trajectory of the joints or of the tool in SI units."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.transforms import Array, wxyz_from
from seerob.files.tables.grid import Numbers, blank, number, place, read_numbers
from seerob.files.tables.guess import Guess, guess
from seerob.files.tables.headers import Layout
from seerob.files.tables.mapping import SI, Mapping, Motion
from seerob.files.trajectories.tool_trajectory import ToolTrajectory
from seerob.files.trajectories.trajectory import Trajectory
from seerob.workstation.source import Target

KEYS = ("time", "joints", "velocities", "torques", "tcp_position", "tcp_orientation")


@dataclass(frozen=True, eq=False)
class Table:
    """A table of motion in SI units."""

    guess: Guess
    """The mapping that was used."""
    rows: NDArray[np.int64]
    """Row numbers in the file, from 1, shape (n,)."""
    blocks: dict[str, Array]
    """Values per key of the mapping, each of shape (n, columns)."""
    notes: tuple[str, ...]
    """What was left out or mended."""

    @property
    def place(self) -> str:
        """The table as messages name it."""
        return place(self.guess.layout.grid)


def read_table(
    path: Path,
    given: Mapping | None = None,
    *,
    name: str | None = None,
    target: Target | None = None,
    motion: Motion = Motion.JOINTS,
) -> Table:
    """Read the columns of a table of motion.

    Args:
        path: A workbook or delimited text.
        given: What the user says of its columns.
        name: The file as messages name it.
        target: The robot it is to drive; its joints say which are lengths.
        motion: Whether joints or the tool are read.

    Raises:
        InputError: Something must be confirmed first, or the file is wrong.
    """
    found = guess(path, given, name=name, target=target, motion=motion)
    if not found.certain:
        raise found.error()
    layout, mapping = found.layout, found.mapping
    indices = _indices(layout, mapping)
    comma = bool(mapping.decimal_comma)
    _refuse_values_above(found.file, layout, {i for group in indices.values() for i in group}, comma)
    factors = _factors(found.file, mapping, indices, target)
    columns = {
        # Two keys may name the same column; numbers keep the names apart.
        f"{layout.label(i)}" if n == 0 else f"{layout.label(i)} ({key} {n})": i
        for key, group in indices.items()
        for i in group
        for n in [_occurrence(indices, key, i)]
    }
    select = None
    if mapping.robot_column is not None:
        select = (_single(layout, "robot_column", mapping.robot_column), mapping.robot)
    numbers = read_numbers(
        layout.grid,
        layout.first_row,
        columns,
        decimal_comma=comma,
        select=select,
        width=len(layout.headers) if layout.header_row else None,
    )
    _check_selection(found.file, mapping, numbers)
    notes = list(found.notes)
    if numbers.skipped:
        notes.append(f"{numbers.skipped} blank rows between rows with values were skipped")
    if numbers.longer:
        where = place(layout.grid, numbers.first_longer)
        notes.append(
            f"rows with more cells than the header ({len(layout.headers)}): {numbers.longer}, the first is "
            f"{where}; the surplus is left out"
        )
    return Table(found, numbers.rows, _blocks(numbers, indices, factors), tuple(notes))


def _refuse_values_above(file: str, layout: Layout, used: Collection[int], comma: bool) -> None:
    """Refuse a header with values above it, or that holds values itself: nobody would judge those.

    Raises:
        InputError: A row before the first one of values has a number in every column that is used.
    """
    for row, cells in enumerate(islice(layout.grid.rows(), layout.header_row), start=1):
        found = [number(cells[i], decimal_comma=comma) if i < len(cells) else "" for i in used]
        values = [value for value in found if isinstance(value, float)]
        # Columns that are numbered, as pandas does, have numbers for names.
        numbered = all(number(cell) in (k, k + 1) for k, cell in enumerate(cells) if not blank(cell))
        if len(values) == len(found) and not numbered:
            what = f"values up to row {layout.header_row}, the header, which are judged by nobody then"
            remedy = "header_row = 0 says that no row names the columns; else take them out"
            raise InputError.at(file, place(layout.grid, row), what, remedy)


def read_motion(
    path: Path, given: Mapping | None = None, *, name: str | None = None, target: Target | None = None
) -> tuple[Trajectory, Guess, tuple[str, ...]]:
    """Read a table of joint motion; arguments and errors are those of `read_table`.

    Returns:
        The motion, the mapping that was used, and remarks on what was left out or mended.
    """
    table = read_table(path, given, name=name, target=target)
    blocks, convention = table.blocks, table.guess.mapping.tcp_convention
    wxyz = None
    if "tcp_orientation" in blocks and convention is not None:
        try:
            wxyz = wxyz_from(convention, blocks["tcp_orientation"])
        except ValueError as error:
            raise InputError.at(table.guess.file, table.place, str(error), "leave the columns out") from error
    trajectory = Trajectory(
        file=table.guess.file,
        t=blocks["time"][:, 0],
        q=blocks["joints"],
        qd=blocks.get("velocities"),
        tau=blocks.get("torques"),
        tcp_position=blocks.get("tcp_position"),
        tcp_wxyz=wxyz,
        degrees=_says_degrees(table.guess.mapping),
        rows=table.rows,
        sheet=table.guess.layout.grid.sheet,
    )
    return trajectory, table.guess, table.notes


def read_tool_motion(
    path: Path, given: Mapping | None = None, *, name: str | None = None, target: Target | None = None
) -> tuple[ToolTrajectory, Guess, tuple[str, ...]]:
    """Read a table of tool poses; it needs no joints. Arguments and errors are those of `read_table`.

    Returns:
        The motion in whatever frame the file uses, the mapping that was used, and remarks on what was
        left out or mended.
    """
    table = read_table(path, given, name=name, target=target, motion=Motion.TOOL)
    orientation, convention = table.blocks["tcp_orientation"], table.guess.mapping.tcp_convention
    # Quaternions go on as they are: one that is not of unit length is a mistake to be named.
    if convention == "xyzw":
        orientation = np.roll(orientation, 1, axis=1)
    elif convention is not None and convention != "wxyz":
        try:
            orientation = wxyz_from(convention, orientation)
        except ValueError as error:
            raise InputError.at(
                table.guess.file, table.place, str(error), "correct the row or the unit"
            ) from error
    trajectory = ToolTrajectory(
        file=table.guess.file,
        t=table.blocks["time"][:, 0],
        position=table.blocks["tcp_position"],
        wxyz=orientation,
        rows=table.rows,
        sheet=table.guess.layout.grid.sheet,
    )
    return trajectory, table.guess, table.notes


def _says_degrees(mapping: Mapping) -> bool:
    """Whether every joint that has an angle is in degrees."""
    unit = mapping.joint_unit
    each = unit if isinstance(unit, tuple) else (unit,)
    return "deg" in each and "rad" not in each


def _indices(layout: Layout, mapping: Mapping) -> dict[str, tuple[int, ...]]:
    indices: dict[str, tuple[int, ...]] = {}
    for key in KEYS:
        columns = getattr(mapping, key)
        if key == "time" and columns is not None:
            indices[key] = (_single(layout, key, columns),)
        elif columns:
            found = layout.find_all(key, columns)
            if isinstance(found, list):
                raise InputError(found)
            indices[key] = found
    return indices


def _single(layout: Layout, key: str, column: str | int) -> int:
    index = layout.find(key, column)
    if isinstance(index, Problem):
        raise InputError(index)
    return index


def _occurrence(indices: dict[str, tuple[int, ...]], key: str, index: int) -> int:
    before = KEYS[: KEYS.index(key)]
    return sum(indices.get(other, ()).count(index) for other in before)


def _factors(
    file: str, mapping: Mapping, indices: dict[str, tuple[int, ...]], target: Target | None
) -> dict[str, Array]:
    """Factor to SI per column of each key; InputError where a unit does not fit the robot's joint."""
    dof = len(indices.get("joints", ()))
    wanted = target.units if target is not None and len(target.units) == dof else None
    units = {
        "time": (mapping.time_unit,),
        "joints": mapping.joint_unit,
        "velocities": mapping.velocity_unit,
        "tcp_position": mapping.tcp_position_unit,
        "tcp_orientation": mapping.tcp_orientation_unit,
    }
    factors, problems = {}, []
    for key, group in indices.items():
        unit = units.get(key)
        each = unit if isinstance(unit, tuple) else (unit,) * len(group)
        if len(each) != len(group):
            what = f"{len(each)} units for {len(group)} columns"
            problems.append(Problem(file, f"mapping.{key}", what, "give one unit, or one per column"))
            continue
        # A quaternion and a torque have no unit to convert.
        factors[key] = np.array([1.0 if u is None else SI[u][1] for u in each])
        if wanted is None or key not in ("joints", "velocities"):
            continue
        for j, u in enumerate(each):
            si = SI[u][0].split("/")[0] if u is not None else wanted[j]
            if si != wanted[j] and target is not None:
                what = f"column {j + 1} is in {u}, but joint {target.joints[j]!r} is in {wanted[j]}"
                problems.append(Problem(file, f"mapping.{key}", what, "correct the unit or the columns"))
    if problems:
        raise InputError(problems)
    return factors


def _check_selection(file: str, mapping: Mapping, numbers: Numbers) -> None:
    if mapping.robot_column is None:
        return
    if mapping.robot is not None and mapping.robot not in numbers.selections:
        what = f"no row of robot {mapping.robot!r}"
        raise InputError.at(file, "mapping.robot", what, suggestion(mapping.robot, numbers.selections))
    if mapping.robot is None and len(numbers.selections) > 1:
        names = ", ".join(map(repr, numbers.selections[:12]))
        raise InputError.at(file, "mapping.robot", f"the rows are of several robots: {names}", "name one")


def _blocks(
    numbers: Numbers, indices: dict[str, tuple[int, ...]], factors: dict[str, Array]
) -> dict[str, Array]:
    blocks, start = {}, 0
    for key, group in indices.items():
        # What overflows is refused by the trajectory, with its place.
        with np.errstate(over="ignore"):
            blocks[key] = numbers.values[:, start : start + len(group)] * factors[key]
        start += len(group)
    return blocks
