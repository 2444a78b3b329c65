"""Everything of a run as CSV files: what was heard, joints, bones, how far they are off, and results.

A result is cells with a title each: the figure, its parts, and its rows about places of a body.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from seerob.core.errors import InputError
from seerob.core.samples import Sample
from seerob.core.snapshot import Result, Row, Scene, Snapshot, Verdict
from seerob.outputs.report.evidence import BONE_HEAD, bone_rows
from seerob.outputs.sink import Sink
from seerob.outputs.tables import people as _sample_cells
from seerob.outputs.tables.growing_table import NAME, GrowingTable, Pace, WholeFolder, checked, no_formula
from seerob.outputs.tables.people import people
from seerob.recording.bone_errors import BoneErrors

Cell = str | float | None


def result_cells(result: Result) -> dict[str, Cell]:
    """Title with unit → value."""
    unit = f" [{result.unit}]" if result.unit else ""
    found: dict[str, Cell] = {
        f"value{unit}": result.value,
        f"limit{unit}": result.limit,
        "verdict": _word(result.verdict),
        "reason": result.reason,
    }
    if result.interval is not None:
        found |= {f"least{unit}": result.interval[0], f"largest{unit}": result.interval[1]}
    for part in result.parts:
        found[_titled(f"{part.name}: value", part.unit)] = part.value
        found[f"{part.name}: verdict"] = _word(part.verdict)
    for row in result.rows:
        found |= _row_cells(row)
    return found


def _row_cells(row: Row) -> dict[str, Cell]:
    name = " ".join(filter(None, (row.group, row.side, row.name)))
    found: dict[str, Cell] = {_titled(name, row.unit): row.value}
    if row.scale is not None:
        # Of a score, what it was made from.
        found |= {_titled(f"{name}, {a.name}", a.unit): a.value for a in row.aspects}
    elif row.limit is not None or row.verdict is not None:
        found |= {_titled(f"{name}, limit", row.unit): row.limit, f"{name}, verdict": _word(row.verdict)}
    return found


def _titled(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _word(verdict: Verdict | None) -> str:
    return "" if verdict is None else verdict.value


Value = str | float | bool | None
_LINE_ENDS = str.maketrans("\r\n\x00", "   ")


class Separator(StrEnum):
    """Between cells."""

    COMMA = "comma"
    SEMICOLON = "semicolon"
    TAB = "tab"


class Decimal(StrEnum):
    """Decimal mark of numbers."""

    POINT = "point"
    COMMA = "comma"


_MARKS = {"comma": ",", "semicolon": ";", "tab": "\t", "point": "."}


class CsvFiles(Sink, frozen=True, kw_only=True):
    """Write samples, joints, bones, tracking errors and results to a folder of CSV files.

    Bones and joints of people have a column ``… measured`` each: 1 where a device sees the bone, or both
    bones of the joint; 0 where it is estimated; empty where no device sees the person.
    """

    file: Annotated[str, Meta(pattern=NAME, description="a name of letters, digits, _ and -")] = "csv"
    """Name of the folder in the run's folder; must not exist yet."""
    every: Annotated[float, Meta(ge=0, extra={"unit": "s"}, extra_json_schema={"x-unit": "s"})] = 0.0
    """Least time between two rows of joints, bones, errors and results [s]; 0 for every tick. Samples are
    always all there."""
    separator: Separator = Separator.COMMA
    """Between cells: ``comma``, ``semicolon`` or ``tab``."""
    decimal: Decimal = Decimal.POINT
    """Decimal mark: ``point`` or ``comma``."""

    def open(
        self, scene: Scene, meshes: dict[str, bytes], files: dict[str, bytes], folder: Path
    ) -> CsvWriter:
        """Start; nothing is seen under the folder's name before `CsvWriter.close`.

        Raises:
            InputError: The folder's name, the period or the marks are wrong, or the folder exists.
        """
        path = checked(folder, self.file, "csv.file")
        if not (math.isfinite(self.every) and self.every >= 0):
            raise InputError.at(folder, "csv.every", f"{self.every} s", "0 or more seconds")
        if self.separator == "comma" and self.decimal == "comma":
            what = "the decimal mark and the separator are both a comma"
            raise InputError.at(folder, "csv.separator", what, 'take "semicolon" or "tab"')
        return CsvWriter(scene, path, self)


class CsvWriter(WholeFolder):
    """Writes rows as they come; memory does not grow with the length of the run."""

    def __init__(self, scene: Scene, path: Path, options: CsvFiles) -> None:
        """Use `CsvFiles.open`."""
        super().__init__(path)
        self._scene, self._pace = scene, Pace(options.every, scene.period)
        self._separator, self._decimal = _MARKS[options.separator], _MARKS[options.decimal]
        self._people = people(scene)
        self._measured = {person.name: person for person in self._people}
        self._joints = _sample_cells.joint_titles(scene)
        self._errors: dict[str, BoneErrors] = {}
        self._spoke: dict[str, float] = {}

    def take(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Add the rows of one tick to the tables."""
        for sample in samples:
            heard = self._row(_sample_cells.cells(sample, self._joints))
            self._table(f"samples {_sample_cells.title(sample)}").add(heard)
        for name, bones in snapshot.bones.items():
            self._errors.setdefault(name, BoneErrors()).add(bones, snapshot.t)
        if not self._pace.due(snapshot.t):
            return
        time = self._text(snapshot.t)
        for name, q in snapshot.joints.items():
            table = self.tables.get(f"joints {name}")
            if table is None:
                titles = _sample_cells.joint_head(self._joints, name, len(q))
                titles += self._measured[name].joint_measured_titles if name in self._measured else ()
                table = self._table(f"joints {name}", [_sample_cells.TIME, *titles])
            row = [time, *map(self._text, q), self._text(snapshot.tracking.get(name))]
            if name in self._measured:
                row += map(_flag, self._measured[name].joints_measured(snapshot))
            table.append(row)
        for person in self._people:
            # Nine digits are all that the snapshot's numbers have.
            shown = (self._marked(f"{value:.9g}") for value in person.poses(snapshot).ravel().tolist())
            head = [_sample_cells.TIME, *person.bone_titles, *person.measured_titles]
            measured = map(_flag, person.measured(snapshot))
            self._table(f"bones {person.name}", head).append([time, *shown, *measured])
            if snapshot.bones.get(person.name):
                head = [_sample_cells.TIME, *person.error_titles]
                row = [time, *map(self._text, person.errors(snapshot))]
                self._table(f"tracking errors {person.name}", head).append(row)
        self._results(snapshot)

    def _results(self, snapshot: Snapshot) -> None:
        for result in snapshot.results:
            # A criterion with a period shows its last result again.
            if result.t is not None and self._spoke.get(result.name) == result.t:
                continue
            if result.t is not None:
                self._spoke[result.name] = result.t
            cells = {_sample_cells.TIME: snapshot.t, **result_cells(result)}
            self._table(f"results {result.name}").add(self._row(cells))

    def finish(self) -> None:
        """Finish every table."""
        rows = [list(row) for row in bone_rows(self._errors)]
        if rows:
            head = [str(title) for title in BONE_HEAD]
            summary = self._table("tracking errors over the run", head)
            for row in rows:
                summary.append([self._text(cell) for cell in row])
        about = self._table("about", ["what", "value"])
        for what, value in self._about():
            about.append([self._text(what), self._text(value)])
        for k, table in enumerate(self.tables.values()):
            table.finish([self._separator.join(map(self._text, table.columns)) + "\n"])
            self._tell(k + 1, len(self.tables))

    def _about(self) -> list[tuple[str, Value]]:
        scene = self._scene
        found: list[tuple[str, Value]] = [
            ("workstation", scene.title),
            ("editions of the figures", scene.edition),
            ("inputs, SHA-256", scene.workstation_hash),
            ("seerob", scene.version),
            ("period of the ticks [s]", scene.period),
            ("frame", "world of the workstation, z up; orientations world from bone, w first"),
            (
                "measured",
                "1: a device sees the bone (both of a joint); 0: estimated; empty: no device",
            ),
        ]
        found += [(f"{f.level}: {f.subject}", f.text) for f in scene.findings]
        for name, table in self.tables.items():
            if table.left_out:
                found.append((f"warning: {name}", f"{len(table.left_out)} columns too many were left out"))
        return found

    def _table(self, name: str, columns: list[str] | None = None) -> GrowingTable:
        def make(path: Path) -> GrowingTable:
            return GrowingTable(path, separator=self._separator, missing="", columns=columns or ())

        return self.table(name, ".csv", make)

    def _row(self, cells: Mapping[str, Value]) -> dict[str, str]:
        return {name: self._text(value) for name, value in cells.items()}

    def _text(self, value: Value) -> str:
        if isinstance(value, float):
            return "" if math.isnan(value) else self._marked(repr(value))
        if value is None or isinstance(value, bool | int):
            return "" if value is None else str(value)
        text = no_formula(value.translate(_LINE_ENDS))
        if self._separator in text or '"' in text or text != text.strip():
            text = '"' + text.replace('"', '""') + '"'
        return text

    def _marked(self, number: str) -> str:
        return number if self._decimal == "." else number.replace(".", self._decimal)


def _flag(measured: float | None) -> str:
    return "" if measured is None else f"{measured:.0f}"
