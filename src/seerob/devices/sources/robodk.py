"""RoboDK: the joint list that ``InstructionListJoints`` saves; degrees, millimetres, seconds.

Columns ``J1…Jn, ERROR, MM_STEP, DEG_STEP, MOVE_ID, TIME, X, Y, Z``, then joint speeds (deg/s) and joint
accelerations when they were asked for. ERROR is a binary number printed in decimal digits: 10 is bit 1.
"""

from __future__ import annotations

import re
from enum import StrEnum
from itertools import islice
from math import pi
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.devices.motion_files import TrajectoryFile, notes
from seerob.files.tables.grid import Numbers, blank, number, read_numbers
from seerob.files.tables.table_files import BLANKS, TextGrid, encoding_of
from seerob.files.trajectories.trajectory import Trajectory
from seerob.workstation.source import Target

FIXED = ("ERROR", "MM_STEP", "DEG_STEP", "MOVE_ID")
MEANING = {
    0: "kinematic: no solution",
    1: "joint limit or out of reach",
    2: "singularity",
    3: "near a singularity",
    5: "collision",
    6: "turn of 180° without a direction",
    7: "target cannot be reached",
    8: "arc without a circle",
}
"""Bit of ERROR → what RoboDK says."""
INFEASIBLE = frozenset({0, 1, 2, 6, 7, 8})
"""Bits with which RoboDK itself does not perform the motion: such a row is not where a robot would be."""
INACCURATE = 20
"""Stands alone: feasible, but the time step is too large for what an axis does."""


class TimeColumn(StrEnum):
    """What the TIME column counts."""

    ELAPSED = "elapsed"
    """Since the start."""
    STEP = "step"
    """Since the row before."""


class ErrorRows(StrEnum):
    """What to do with rows that RoboDK itself could not perform."""

    REFUSE = "refuse"
    REPORT = "report"


class Robodk(TrajectoryFile, frozen=True, kw_only=True):
    """A robot's joint motion as RoboDK simulated it."""

    time: TimeColumn | None = None
    """What TIME counts; told by the file when it is not given: time that goes back is a step."""
    error_rows: ErrorRows = ErrorRows.REFUSE
    """``report`` goes on with rows that RoboDK marks as impossible, with a warning."""

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """Read joints, time and, where there are any, tool positions and joint speeds."""
        grid = _grid(path, self.file)
        first_row, columns, remarks = _columns(grid, len(target.joints))
        numbers = read_numbers(grid, first_row, columns)
        joints = [c for c in columns if re.fullmatch(r"J\d+", c)]
        speeds = [c for c in columns if re.fullmatch(r"SPEED_J\d+", c)]
        t, keep, how = _time(self.file, numbers, list(columns), joints, self.time)
        values, rows = numbers.values[keep], numbers.rows[keep]
        table = {name: values[:, i] for i, name in enumerate(columns)}
        warnings = _errors(self.file, table["ERROR"], t, rows, self.error_rows)
        trajectory = Trajectory(
            file=self.file,
            t=t,
            q=np.column_stack([table[j] for j in joints]) * (pi / 180),
            qd=np.column_stack([table[s] for s in speeds]) * (pi / 180) if speeds else None,
            tcp_position=np.column_stack([table[a] for a in "XYZ"]) * 1e-3 if "X" in table else None,
            rows=rows,
        )
        said = tuple(f"{self.file}: {r}" for r in (*remarks, *how))
        return trajectory, notes(said, target.name) + notes(warnings, target.name, level="warning")


def _grid(path: Path, name: str) -> TextGrid:
    encoding = encoding_of(path, name)
    grids = [TextGrid(path, name, encoding, d) for d in (",", ";", "\t", BLANKS)]
    # What separates the columns is what cuts the first row into most pieces.
    return max(grids, key=lambda g: len(next(iter(g.rows()), [])))


def _columns(grid: TextGrid, dof: int) -> tuple[int, dict[str, int], list[str]]:
    """First row of values and the columns by name; by position when there is no header."""
    for row, cells in enumerate(islice(grid.rows(), 20), start=1):
        names = [str(c).strip().strip("[]").upper() for c in cells]
        if "ERROR" in names and "J1" in names:
            return row + 1, _named(grid.file, row, names), []
        if cells and not any(blank(c) for c in cells) and all(isinstance(number(c), float) for c in cells):
            width = len(cells)
            if width not in (dof + 8, 2 * dof + 8, 3 * dof + 8):
                what = f"no header, and {width} columns"
                widths = f"{dof + 8}, {2 * dof + 8} or {3 * dof + 8}"
                remedy = f"{dof} joints with TIME take {widths} columns; save it with flags of at least 1"
                raise InputError.at(grid.file, f"row {row}", what, remedy)
            names = [f"J{i + 1}" for i in range(dof)] + [*FIXED, "TIME", "X", "Y", "Z"]
            names += [f"SPEED_J{i + 1}" for i in range(dof)] if width >= 2 * dof + 8 else []
            return (
                row,
                {n: i for i, n in enumerate(names)},
                [f"no header: columns taken as those of {dof} joints"],
            )
    what = "no header with J1 and ERROR, and no row of numbers"
    raise InputError.at(grid.file, "header", what, "save it with Program.InstructionListJoints of RoboDK")


def _named(file: str, row: int, names: list[str]) -> dict[str, int]:
    joints = [n for n in names if re.fullmatch(r"J\d+", n)]
    if joints != [f"J{i + 1}" for i in range(len(joints))]:
        raise InputError.at(file, f"row {row}", f"joint columns {', '.join(joints)}", "J1 to Jn, each once")
    if "TIME" not in names:
        remedy = "export with flags of at least 1, best with flags = 4 (time based)"
        raise InputError.at(file, f"row {row}", "no TIME column", remedy)
    columns = {n: names.index(n) for n in (*joints, "ERROR", "TIME")}
    tool = [f"{a}_TCP" if f"{a}_TCP" in names else a for a in "XYZ"]
    if all(t in names for t in tool):
        columns |= {a: names.index(t) for a, t in zip("XYZ", tool, strict=True)}
    speeds = [next((n for n in (f"SPEED_{j}", f"SPEED {j}") if n in names), "") for j in joints]
    if all(speeds):
        columns |= {f"SPEED_{j}": names.index(s) for j, s in zip(joints, speeds, strict=True)}
    return columns


def _time(
    file: str, numbers: Numbers, names: list[str], joints: list[str], given: TimeColumn | None
) -> tuple[Array, NDArray[np.bool_], list[str]]:
    """Elapsed time [s] of the rows that are kept, which rows, and how TIME was read."""
    raw = numbers.values[:, names.index("TIME")]
    n = len(raw)
    every = np.ones(n, bool)
    if given is None:
        if n < 4 and bool(np.all(np.diff(raw) > 0)):
            what = f"TIME of {n} rows can be elapsed time or steps"
            raise InputError.at(file, "time", what, 'set time = "elapsed" or time = "step"')
        given = TimeColumn.ELAPSED if bool(np.all(np.diff(raw) > 0)) else TimeColumn.STEP
    if given is TimeColumn.ELAPSED:
        return raw, every, ["TIME is elapsed time"]
    if (raw < 0).any():
        i = int(np.argmax(raw < 0))
        raise InputError.at(file, f"row {numbers.rows[i]}", f"TIME goes back by {-raw[i]:g} s")
    t = np.cumsum(raw) - raw[:1]
    q = numbers.values[:, [names.index(j) for j in joints]]
    still = np.zeros(n, bool)
    # RoboDK repeats the row where two moves meet; the same joints at the same time say nothing new.
    still[1:] = (raw[1:] == 0) & np.all(q[1:] == q[:-1], axis=1)
    how = ["TIME counts from row to row"]
    if still.any():
        how.append(f"{int(still.sum())} rows that repeat the one before were left out")
    return t[~still], ~still, how


def error_bits(code: float) -> tuple[int, ...]:
    """Bits of a value of ERROR: the places of its decimal digits that are not 0, from the right."""
    digits = str(round(abs(code)))
    return tuple(i for i, digit in enumerate(reversed(digits)) if digit != "0")


def _errors(file: str, codes: Array, t: Array, rows: NDArray[np.int64], choice: ErrorRows) -> tuple[str, ...]:
    """Remarks on rows with an error; InputError for those that cannot be performed.

    A row beyond reach, at a limit or in a singularity holds joint values that RoboDK made up to be
    able to go on: judging them would be judging another motion. A collision is one to be shown.
    """
    problems, remarks = [], []
    if (codes == INACCURATE).any():
        hit = codes == INACCURATE
        remarks.append(f"{file}: inaccurate (large axis motion in one step) {_where(hit, t, rows)}")
    bits = {code: error_bits(code) for code in np.unique(codes).tolist() if code not in (0, INACCURATE)}
    for bit in sorted({b for each in bits.values() for b in each}):
        hit = np.isin(codes, [code for code, each in bits.items() if bit in each])
        text = f"ERROR bit {bit} ({MEANING.get(bit, 'unknown')}) {_where(hit, t, rows)}"
        if bit in INFEASIBLE and choice is ErrorRows.REFUSE:
            remedy = 'correct the program, or set error_rows = "report"'
            problems.append(Problem(file, f"row {rows[int(np.argmax(hit))]}", text, remedy))
        remarks.append(f"{file}: {text}")
    if problems:
        raise InputError(problems)
    return tuple(remarks)


def _where(hit: NDArray[np.bool_], t: Array, rows: NDArray[np.int64]) -> str:
    first = int(np.argmax(hit))
    return f"in {int(hit.sum())} rows, first at {t[first] - t[0]:.3f} s (row {rows[first]})"
