"""Sheets of a workbook about motion: joints, bones and how far they are off, and what was heard."""

from __future__ import annotations

from collections.abc import Iterator

from seerob.core.samples import BodySample, Sample
from seerob.core.snapshot import Scene, Snapshot
from seerob.outputs.tables import sample_cells as _sample_cells
from seerob.outputs.tables.pace import Pace
from seerob.outputs.tables.people import people
from seerob.outputs.tables.thinning import ThinnedTable

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
