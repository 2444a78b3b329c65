"""An Excel workbook: a summary, one sheet per criterion, joints, and what was found."""

from __future__ import annotations

import math
import os
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import mkstemp
from types import TracebackType
from typing import Annotated, Self

from msgspec import Meta

from seerob.errors import InputError
from seerob.results import ResultLog, result_named
from seerob.samples import Sample
from seerob.series import CODES, Series
from seerob.sink import Sink
from seerob.sinks._sheets import Cell, Sheets
from seerob.sinks._time_shares import HEAD, time_rows
from seerob.snapshot import Basis, Scene, Snapshot

_VERDICT_OF = {code: verdict for verdict, code in CODES.items()}


class Excel(Sink, frozen=True, kw_only=True):
    """Write results, joints and findings to an Excel workbook at the end of the run."""

    file: Annotated[str, Meta(pattern=r"^[^/\\]+\.xlsx$", description="a file name that ends in .xlsx")] = (
        "results.xlsx"
    )
    """Name in the run's folder; an earlier workbook of that name is replaced."""
    rows: Annotated[int, Meta(ge=7)] = 100_000
    """Most ticks written per criterion; beyond it they are thinned without losing an extremum or an
    exceedance, and the summary says so."""

    def open(
        self, scene: Scene, meshes: dict[str, bytes], files: dict[str, bytes], folder: Path
    ) -> ExcelWriter:
        """Start to collect; nothing is written before `ExcelWriter.close`.

        Raises:
            InputError: The file's name or the number of rows is wrong.
        """
        if self.file != Path(self.file).name or not self.file.endswith(".xlsx"):
            raise InputError.at(
                folder, "excel.file", f"{self.file!r} is not a file name", "such as results.xlsx"
            )
        if self.rows < 7:
            raise InputError.at(folder, "excel.rows", f"{self.rows} rows hold nothing", "7 or more")
        return ExcelWriter(scene, folder / self.file, rows=self.rows)


class ExcelWriter:
    """Collects results and joints."""

    def __init__(self, scene: Scene, path: Path, *, rows: int) -> None:
        """Use `Excel.open`."""
        self.path = path
        self.progress: Callable[[int, int], None] | None = None
        """Called while `close` works with how many of how many sheets are done."""
        self.log = ResultLog(scene.criteria)
        self._scene, self._rows = scene, rows
        self._bases: dict[str, Basis] = {i.name: i.basis for i in scene.criteria if i.basis is not None}
        self._t = array("d")
        self._joints: dict[str, list[array[float]]] = {}
        self._tracking: dict[str, array[float]] = {}

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick."""
        for name in self.log.add(snapshot):
            result = result_named(snapshot, name)
            if result is not None and result.basis is not None:
                self._bases[name] = result.basis
        ticks = len(self._t)
        self._t.append(snapshot.t)
        for name, q in snapshot.joints.items():
            columns = self._joints.setdefault(name, [])
            while len(columns) < len(q):
                columns.append(array("d", [math.nan] * ticks))
            for column, value in zip(columns, q, strict=False):
                column.append(value)
        for name, error in snapshot.tracking.items():
            self._tracking.setdefault(name, array("d", [math.nan] * ticks)).append(error)
        for column in (*self._tracking.values(), *(c for cs in self._joints.values() for c in cs)):
            if len(column) <= ticks:
                column.append(math.nan)

    def close(self) -> None:
        """Write the workbook, whole or not at all.

        Raises:
            InputError: It cannot be written.
        """
        try:
            handle, name = mkstemp(dir=self.path.parent, prefix=f".{self.path.name}.")
            os.close(handle)
            temporary = Path(name)
            try:
                self._fill(temporary)
                temporary.chmod(0o644)
                temporary.replace(self.path)
            finally:
                temporary.unlink(missing_ok=True)
        except OSError as error:
            what = f"cannot be written: {error.strerror}"
            raise InputError.at(self.path, "", what, "close it in Excel, or give another folder") from error

    def _fill(self, path: Path) -> None:
        from openpyxl import Workbook

        book = Workbook(write_only=True)
        sheets = Sheets(book)
        try:
            steps = len(self.log) + len(self._joints) + 1
            sheets.add("Summary", _SUMMARY, list(self._summary()), fit=True)
            for k, series in enumerate(self.log.values()):
                sheets.add(series.name, _head(series), _rows(series, self._rows))
                self._tell(k + 1, steps)
            for k, (name, columns) in enumerate(self._joints.items()):
                sheets.add(f"joints {name}", self._joint_head(name, len(columns)), self._joint_rows(name))
                self._tell(len(self.log) + k + 1, steps)
            infos = {info.name: info for info in self._scene.criteria}
            if any(info.group == "ergonomics" for info in infos.values()):
                sheets.add("Time shares", HEAD, time_rows(self.log, infos))
            sheets.add("Inputs", _INPUTS, list(self._inputs()), fit=True)
            found = [[f.level, f.subject, f.text] for f in self._scene.findings]
            sheets.add("Findings", ["level", "about", "text"], found, fit=True)
        finally:
            # A sheet that is left open complains when it is collected.
            sheets.close()
        book.save(path)
        self._tell(steps, steps)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Whoever interrupts a run a second time does not want to wait for this.
        if kind is None or not issubclass(kind, KeyboardInterrupt):
            self.close()

    def _tell(self, done: int, total: int) -> None:
        if self.progress is not None:
            self.progress(done, total)

    def _summary(self) -> Iterator[list[Cell]]:
        for series in self.log.ranked():
            basis = self._bases.get(series.name)
            formula, source = ("", "") if basis is None else (basis.formula, basis.source)
            verdict = "no limit" if series.verdict is None else series.verdict.value
            tail: list[Cell] = [formula, source, self._scene.edition]
            if not series.known:
                yield [
                    series.name,
                    verdict,
                    None,
                    series.unit,
                    None,
                    None,
                    None,
                    "never gave a result",
                    "",
                    *tail,
                ]
                continue
            worst = series.worst()
            yield [
                series.name, verdict, worst.value, series.unit, worst.limit,
                "at most" if series.at_most else "at least", worst.t, worst.reason, worst.part, *tail,
            ]  # fmt: skip
        yield []
        yield ["workstation", self._scene.title]
        yield ["inputs, SHA-256", self._scene.workstation_hash]
        yield ["seerob", self._scene.version]
        yield ["ticks", self.log.ticks]
        for series in self.log.values():
            if len(series) > self._rows:
                text = f"thinned from {len(series)} ticks to at most {self._rows}"
                yield [series.name, f"{text}; extrema and exceedances are kept"]

    def _joint_head(self, mechanism: str, n: int) -> list[Cell]:
        known = {m.name: m.joints for m in self._scene.mechanisms}.get(mechanism, ())
        names = [f"{j.name} [{j.unit}]" for j in known]
        names += [f"joint {k + 1} [rad or m]" for k in range(len(names), n)]
        return ["t [s]", *names[:n], "tracking error [rad or m]"]

    def _joint_rows(self, mechanism: str) -> Iterator[list[Cell]]:
        columns = [
            *self._joints[mechanism],
            self._tracking.get(mechanism, array("d", [math.nan] * len(self._t))),
        ]
        stride = max(1, math.ceil(len(self._t) / self._rows))
        for i in range(0, len(self._t), stride):
            yield [self._t[i], *(column[i] for column in columns)]

    def _inputs(self) -> Iterator[list[Cell]]:
        for name, basis in self._bases.items():
            for i in basis.inputs:
                yield [name, i.name, i.value, i.unit, i.origin.value, i.source]


_SUMMARY: list[Cell] = [
    "criterion", "verdict", "worst value", "unit", "limit", "limit is", "at [s]", "what governs, or why",
    "part", "formula", "source", "edition",
]  # fmt: skip


_INPUTS: list[Cell] = ["criterion", "input", "value", "unit", "origin", "source"]


def _head(series: Series) -> list[Cell]:
    unit = f" [{series.unit}]" if series.unit else ""
    parts = (
        f"{name}: {what}"
        for name, part in series.parts.items()
        for what in (f"value [{part.unit}]" if part.unit else "value", "verdict")
    )
    return ["t [s]", f"value{unit}", f"limit{unit}", "verdict", "reason", *parts]


def _rows(series: Series, most: int) -> Iterator[list[Cell]]:
    t, values, limits, codes, reasons = (
        series.t.tolist(),
        series.values.tolist(),
        series.limits.tolist(),
        series.verdicts.tolist(),
        series.reasons,
    )
    parts = [
        dict(zip(p.t.tolist(), zip(p.values.tolist(), p.verdicts.tolist(), strict=True), strict=True))
        for p in series.parts.values()
    ]
    for i in series.thinned(most).tolist():
        row: list[Cell] = [t[i], values[i], limits[i], _word(codes[i]), reasons[i]]
        for part in parts:
            value, code = part.get(t[i], (None, 255))
            row += [value, _word(code)]
        yield row


def _word(code: int) -> str:
    verdict = _VERDICT_OF[code]
    return "" if verdict is None else verdict.value
