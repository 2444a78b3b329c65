"""An Excel workbook: a summary, one sheet per criterion, motion, what was heard, and what was found."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta

from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_file
from seerob.core.samples import Sample
from seerob.core.snapshot import Basis, Scene, Snapshot
from seerob.description.norms.editions import editions
from seerob.outputs.report import posture_safety as _posture_safety
from seerob.outputs.report.evidence import BONE_HEAD as ERRORS
from seerob.outputs.report.evidence import bone_rows
from seerob.outputs.report.time_shares import HEAD, time_rows
from seerob.outputs.sink import AtEndWithResults, Sink
from seerob.outputs.workbook import Cell, MotionSheets, workbook
from seerob.recording.series import CODES, Series

_VERDICT_OF = {code: verdict for verdict, code in CODES.items()}


class Excel(Sink, frozen=True, kw_only=True):
    """Write results, joints and findings to an Excel workbook at the end of the run, in 16 digits."""

    file: Annotated[str, Meta(pattern=r"^[^/\\]+\.xlsx$", description="a file name that ends in .xlsx")] = (
        "results.xlsx"
    )
    """Name in the run's folder; an earlier workbook of that name is replaced."""
    rows: Annotated[int, Meta(ge=7)] = 100_000
    """Most ticks written per criterion and of a robot's joints; beyond it they are thinned, of a criterion
    without losing an extremum or an exceedance, and the summary says so."""
    every: Annotated[float, Meta(ge=0, extra={"unit": "s"}, extra_json_schema={"x-unit": "s"})] = 0.04
    """Least time between two rows of a person's joints and bones, and of tracking errors [s]; 0 for every
    tick. Criteria, joints of robots and samples are not thinned by it."""
    motion_rows: Annotated[int, Meta(ge=0)] = 3_000
    """Most rows of each sheet of a person's joints and bones, of tracking errors, samples, and of posture
    against safety; beyond it they are thinned evenly, and the summary says so. 0 leaves these sheets out.
    The sink ``csv`` writes all of them."""
    bones: Literal["captured", "all"] = "captured"
    """Whose bones have a sheet: of people whom devices see, or of all."""

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
        if self.motion_rows == 1 or self.motion_rows < 0:
            what = f"{self.motion_rows} rows hold no motion"
            raise InputError.at(folder, "excel.motion_rows", what, "2 or more, or 0 for no sheets of motion")
        if not (math.isfinite(self.every) and self.every >= 0):
            raise InputError.at(folder, "excel.every", f"{self.every} s", "0 or more seconds")
        motion = MotionSheets(
            scene,
            joint_rows=self.rows,
            rows=self.motion_rows,
            every=self.every,
            everybody=self.bones == "all",
        )
        return ExcelWriter(scene, folder / self.file, motion, self)


class ExcelWriter(AtEndWithResults):
    """Collects results and motion."""

    def __init__(self, scene: Scene, path: Path, motion: MotionSheets, options: Excel) -> None:
        """Use `Excel.open`."""
        super().__init__(scene.criteria)
        self.path = path
        self._scene, self._motion = scene, motion
        self._rows, self._motion_rows, self._every = options.rows, options.motion_rows, options.every
        self._bases: dict[str, Basis] = {i.name: i.basis for i in scene.criteria if i.basis is not None}

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick."""
        self.log.add(snapshot)
        self._motion.take(snapshot, samples)

    def close(self) -> None:
        """Write the workbook, whole or not at all.

        Raises:
            InputError: It cannot be written.
        """
        try:
            with whole_file(self.path) as hidden:
                self._fill(hidden)
        except OSError as error:
            what = f"cannot be written: {error.strerror}"
            raise InputError.at(self.path, "", what, "close it in Excel, or give another folder") from error

    def _fill(self, path: Path) -> None:
        with workbook(path) as sheets:
            steps = len(self.log) + len(self._motion) + 1
            sheets.add("Summary", _SUMMARY, list(self._summary()), fit=True)
            for k, series in enumerate(self.log.values()):
                sheets.add(series.name, _head(series), _rows(series, self._rows))
                self._tell(k + 1, steps)
            for one in _posture_safety.sides(self._scene, self.log) if self._motion_rows else ():
                head, instants = _posture_safety.head(one), _posture_safety.rows(one, self._motion_rows)
                sheets.add(_beside(one), head, instants)
            for k, (name, table) in enumerate(self._motion.sheets()):
                sheets.add(name, table.titles, table.rows())
                self._tell(len(self.log) + k + 1, steps)
            if self.log.bones:
                sheets.add("Bone errors", ERRORS, list(bone_rows(self.log.bones)), fit=True)
            infos = {info.name: info for info in self._scene.criteria}
            if any(info.group == "ergonomics" for info in infos.values()):
                sheets.add("Time shares", HEAD, time_rows(self.log, infos))
            sheets.add("Inputs", _INPUTS, list(self._inputs()), fit=True)
            found = [[f.level, f.subject, f.text] for f in self._scene.findings]
            sheets.add("Findings", ["level", "about", "text"], found, fit=True)
        self._tell(steps, steps)

    def _summary(self) -> Iterator[list[Cell]]:
        for series in self.log.ranked():
            basis = self._bases.get(series.name)
            formula, source = ("", "") if basis is None else (basis.formula, basis.source)
            verdict = "no limit" if series.verdict is None else series.verdict.value
            tail: list[Cell] = [formula, source, ", ".join(editions([basis]))]
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
        if self._every > self._scene.period and self._motion_rows and self._motion.people:
            text = "joints, bones and errors have a row"
            yield ["motion of people", f"{text} every {self._every:g} s; the sink csv has every tick"]
        for one in _posture_safety.sides(self._scene, self.log) if self._motion_rows else ():
            text = f"at most about {self._motion_rows} instants; extrema of every score and measure are kept"
            yield [_beside(one), text]
        for name, table in self._motion.sheets():
            if table.thinned:
                yield [name, f"thinned evenly from {table.offered} rows"]

    def _inputs(self) -> Iterator[list[Cell]]:
        for name, basis in self._bases.items():
            for i in basis.inputs:
                yield [name, i.name, i.value, i.unit, i.origin.value, i.source]


def _beside(one: _posture_safety.Sides) -> str:
    """Name of the sheet of a person's posture and safety."""
    return f"posture, safety {one.person}"


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
