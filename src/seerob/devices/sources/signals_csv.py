"""Variables of machines from a table: a recording of signals, or key positions written by hand."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TextIO

from msgspec import Meta

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.files.bounded import regular
from seerob.core.samples import Sample, SignalSample
from seerob.core.snapshot import Finding
from seerob.workstation.source import Opened, Source, Target
from seerob.workstation.variables import BadValue, Kind, Value, Variable

MOST_ROWS = 1_000_000
LONGEST_LINE = 100_000
"""Characters of a row."""
SECONDS = {"s": 1.0, "ms": 1e-3}
TRUTH = {"1": True, "true": True, "0": False, "false": False}


class SignalsCsv(Source, frozen=True, kw_only=True):
    """Variables of machines from a text table: one row per instant, one column per variable."""

    reads_variables: ClassVar[bool] = True

    file: str
    """Path, from the folder of the workstation file."""
    time: str
    """Header of the column of time."""
    time_unit: Literal["s", "ms"]
    """Unit of that column."""
    delimiter: Annotated[str, Meta(min_length=1, max_length=1)] = ","
    """Between two cells."""

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the whole table.

        Raises:
            InputError: With every column that is missing, or the row that cannot be read.
        """
        variables = () if target is None else tuple(v for v in target.variables if not v.write)
        path = folder / self.file
        try:
            regular(path)
            with path.open(encoding="utf-8-sig", newline="") as table:
                began, samples = self._samples(table, variables)
        except FileNotFoundError as error:
            raise InputError.at(path, "", "no such file", "give its path from the workstation") from error
        except OSError as error:
            raise InputError.at(path, "", f"cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise InputError.at(path, "", "not UTF-8", "save it as UTF-8 text") from error
        if not samples:
            raise InputError.at(path, "", "no row of values", "give at least one")
        start = samples[0].t
        gap = max((b.t - a.t for a, b in pairwise(samples)), default=0.0)
        findings = [Finding(level="note", subject=self.name, text=f"{len(samples)} rows of {self.file}")]
        if gap > self.timeout:
            what = f"up to {gap:g} s between two rows, longer than timeout = {self.timeout:g} s"
            text = f"{self.file}: {what}: undecided in between"
            findings.append(Finding(level="warning", subject=self.name, text=text))
        duration = samples[-1].t - start
        return Opened(samples=samples, duration=duration, began=began, findings=tuple(findings))

    def _samples(self, table: TextIO, variables: tuple[Variable, ...]) -> tuple[float, list[Sample]]:
        rows = csv.reader(_lines(table, self.file), delimiter=self.delimiter, strict=True)
        try:
            header = [cell.strip() for cell in next(rows, [])]
            columns = self._columns(header, variables)
            said = list(self._read(rows, header.index(self.time), columns))
            return (said[0][0] if said else 0.0), [sample for _, sample in said]
        except csv.Error as error:
            raise InputError.at(self.file, f"row {rows.line_num}", str(error), "mend the row") from error

    def _columns(self, header: list[str], variables: tuple[Variable, ...]) -> list[tuple[Variable, int]]:
        problems = [
            Problem(self.file, key, f"no column {name!r}", suggestion(str(name), header))
            for key, name in (("time", self.time), *((f"{v.name}.address", v.address) for v in variables))
            if name not in header
        ]
        problems += [
            Problem(self.file, "header", f"{name!r} is there {header.count(name)} times", "rename one")
            for name in dict.fromkeys(header)
            if header.count(name) > 1
        ]
        if problems:
            raise InputError(problems)
        return [(v, header.index(v.address)) for v in variables]

    def _read(
        self, rows: Iterator[list[str]], time: int, columns: list[tuple[Variable, int]]
    ) -> Iterator[tuple[float, SignalSample]]:
        values: dict[str, Value] = {}
        doubts: dict[str, str] = {}
        first, last = math.nan, -math.inf
        for n, row in enumerate(rows, 2):
            if not any(cell.strip() for cell in row):
                continue
            t = _time(row, time, self.file, n) * SECONDS[self.time_unit]
            if t <= last:
                what = f"time {t:g} s does not come after {last:g} s"
                raise InputError.at(self.file, f"row {n}", what, "rows are in order of time")
            first, last = (t if math.isnan(first) else first), t
            for variable, column in columns:
                cell = row[column].strip() if column < len(row) else ""
                if not cell:
                    continue  # as it was
                try:
                    values[variable.name] = variable.value(_raw(cell, variable.type))
                    doubts.pop(variable.name, None)
                except BadValue as error:
                    doubts[variable.name] = str(error)
            yield (
                t,
                SignalSample(
                    source=self.name, seq=n - 2, t=t - first, values=dict(values), doubts=dict(doubts)
                ),
            )


def _lines(table: TextIO, file: str) -> Iterator[str]:
    for n in range(MOST_ROWS + 1):
        line = table.readline(LONGEST_LINE)
        if not line:
            return
        if len(line) == LONGEST_LINE:
            raise InputError.at(file, f"row {n + 1}", "has no end", "give a text table")
        yield line
    raise InputError.at(file, "", f"more than {MOST_ROWS} rows", "give a part of it")


def _time(row: list[str], column: int, file: str, n: int) -> float:
    cell = row[column].strip() if column < len(row) else ""
    try:
        t = float(cell)
    except ValueError:
        t = math.nan
    if not abs(t) <= 1e12:
        raise InputError.at(file, f"row {n}", f"{cell!r} is no time", "give a number, with a decimal point")
    return t


def _raw(cell: str, kind: Kind) -> object:
    """What a cell says: as the variable's type reads it, or the text itself, which is then a bad value."""
    if kind is Kind.TEXT:
        return cell
    if kind is Kind.BOOL:
        return TRUTH.get(cell.lower(), cell)
    try:
        return float(cell)
    except ValueError:
        return cell
