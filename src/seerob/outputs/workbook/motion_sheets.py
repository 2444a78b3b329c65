"""Sheets of a workbook about motion: joints, bones and how far they are off, and what was heard.

Their table never holds more than so many rows: when it is full, every second one goes.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from seerob.core.samples import BodySample, Sample
from seerob.core.snapshot import Scene, Snapshot
from seerob.core.transforms import Array
from seerob.outputs.tables import people as _sample_cells
from seerob.outputs.tables.growing_table import Pace
from seerob.outputs.tables.people import people

Cell = str | float | int | None


class ThinnedTable:
    """Rows evenly spread over what was offered, at least half as many as may be.

    Args:
        most: Rows at most, 2 or more.
        titles: Columns that are known at the start.
    """

    def __init__(self, most: int, titles: Sequence[str] = ()) -> None:
        self.titles: list[str] = list(titles)
        self.offered = 0
        self._most, self._stride = most, 1
        self._places = {title: k for k, title in enumerate(self.titles)}
        # Rows one after the other: a row of its own each would take four times as much.
        self._numbers = array("d")
        self._texts: dict[int, dict[int, str]] = {}
        """Row → column → text."""
        self._count = 0

    @property
    def thinned(self) -> bool:
        """Whether rows were left out."""
        return self._stride > 1

    def wants(self) -> bool:
        """Offer a row: whether it is to be kept, and `keep` to be called."""
        wanted = self.offered % self._stride == 0
        self.offered += 1
        if wanted and self._count >= self._most:
            self._numbers = array("d", self._table()[::2].tobytes())
            self._texts = {row // 2: texts for row, texts in self._texts.items() if row % 2 == 0}
            self._count = (self._count + 1) // 2
            self._stride *= 2
            wanted = (self.offered - 1) % self._stride == 0
        return wanted

    def keep(self, cells: Mapping[str, str | float | bool | None]) -> None:
        """Keep a row; a column that is new goes to the end."""
        if new := [title for title in cells if title not in self._places]:
            table = np.pad(self._table(), ((0, 0), (0, len(new))), constant_values=math.nan)
            self._numbers = array("d", table.tobytes())
            self.titles += new
            self._places = {title: k for k, title in enumerate(self.titles)}
        numbers, texts = [math.nan] * len(self.titles), {}
        for title, value in cells.items():
            if isinstance(value, str):
                texts[self._places[title]] = value
            elif value is not None:
                numbers[self._places[title]] = float(value)
        if texts:
            self._texts[self._count] = texts
        self._numbers.extend(numbers)
        self._count += 1

    def keep_numbers(self, values: Sequence[float | None]) -> None:
        """Keep a row of numbers, one per column; columns that have none are NaN."""
        self._numbers.extend(math.nan if v is None else v for v in values)
        self._numbers.extend([math.nan] * (len(self.titles) - len(values)))
        self._count += 1

    def _table(self) -> Array:
        return np.array(self._numbers).reshape(self._count, len(self.titles))

    def rows(self) -> Iterator[list[Cell]]:
        """All rows, equally wide; NaN where there is nothing."""
        width = len(self.titles)
        for k in range(self._count):
            row: list[Cell] = list(self._numbers[k * width : (k + 1) * width])
            for place, text in self._texts.get(k, {}).items():
                row[place] = text
            yield row


MOST_SHEETS = 200
"""Of samples; a workbook with more is of no use."""


class MotionSheets:
    """What a workbook says of motion, thinned as it comes, so that memory is bounded.

    Args:
        scene: Of the run.
        joint_rows: Rows of a robot's joints at most.
        rows: Rows of each other sheet at most; 0 for none of these sheets.
        every: Least time between two rows of a person's joints, bones and errors [s].
        everybody: Bones also of people whom no device sees.
    """

    def __init__(self, scene: Scene, *, joint_rows: int, rows: int, every: float, everybody: bool) -> None:
        self._joint_rows, self._most, self._pace = joint_rows, rows, Pace(every, scene.period)
        self._joints = _sample_cells.joint_titles(scene)
        self.people = people(scene)
        """Of the scene."""
        self._measured = {person.name: person for person in self.people}
        self._wanted = {person.name for person in self.people} if everybody else set()
        self._tables: dict[str, ThinnedTable] = {}

    def take(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick."""
        t = snapshot.t
        due = self._most > 0 and self._pace.due(t)
        for name, q in snapshot.joints.items():
            if name in self._measured and not due:
                continue
            key = f"joints {name}"
            table = self._tables.get(key)
            if table is None:
                most = self._most if name in self._measured else self._joint_rows
                titles = _sample_cells.joint_head(self._joints, name, len(q))
                titles += self._measured[name].joint_measured_titles if name in self._measured else ()
                table = self._begin(key, most, titles)
            if table.wants():
                person = self._measured.get(name)
                measured = [] if person is None else person.joints_measured(snapshot)
                table.keep_numbers([t, *q, snapshot.tracking.get(name), *measured])
        if not self._most:
            return
        for sample in samples:
            self._heard(sample)
        for person in self.people if due else ():
            if person.name in self._wanted:
                key = f"bones {person.name}"
                titles = [*person.bone_titles, *person.measured_titles]
                table = self._tables.get(key) or self._begin(key, self._most, titles)
                if table.wants():
                    poses = person.poses(snapshot).ravel().tolist()
                    table.keep_numbers([t, *poses, *person.measured(snapshot)])
            if snapshot.bones.get(person.name):
                key = f"errors {person.name}"
                table = self._tables.get(key) or self._begin(key, self._most, person.error_titles)
                if table.wants():
                    table.keep_numbers([t, *person.errors(snapshot)])

    def _heard(self, sample: Sample) -> None:
        if isinstance(sample, BodySample):
            self._wanted.add(sample.target)
        name = f"heard {_sample_cells.title(sample)}"
        if name not in self._tables and len(self._tables) >= MOST_SHEETS:
            return
        table = self._tables.setdefault(name, ThinnedTable(self._most))
        if table.wants():
            table.keep(_sample_cells.cells(sample, self._joints))

    def _begin(self, name: str, most: int, titles: list[str]) -> ThinnedTable:
        table = self._tables[name] = ThinnedTable(most, [_sample_cells.TIME, *titles])
        return table

    def __len__(self) -> int:
        return len(self._tables)

    def sheets(self) -> Iterator[tuple[str, ThinnedTable]]:
        """Name and table of each sheet."""
        yield from sorted(self._tables.items(), key=lambda item: _ORDER.index(item[0].split(" ")[0]))


_ORDER = ("joints", "bones", "errors", "heard")
