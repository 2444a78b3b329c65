"""The motion of people for OpenSim: what devices saw and joint centres as TRC, coordinates as MOT.

A coordinate is estimated where no device saw a bone that it speaks of.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from seerob.core.errors import InputError
from seerob.core.samples import BodySample, Sample
from seerob.core.snapshot import Scene, Snapshot
from seerob.core.transforms import Array
from seerob.description.humans.skeleton import JOINTS
from seerob.files.motion_capture import joint_angles, storage, trc
from seerob.outputs.sentences import percent
from seerob.outputs.sink import Sink
from seerob.outputs.tables.growing_table import NAME, GrowingTable, WholeFolder, checked
from seerob.outputs.tables.people import Person, people

STEP = 1e-3
"""Of a joint, to see which coordinates follow it [rad or m]."""
PER_LINE = 6


class EstimatedCoordinates:
    """Counts the rows in which each coordinate is estimated."""

    def __init__(self) -> None:
        self._rows = self._seen_rows = 0
        self._estimated: Counter[str] = Counter()

    def add(self, joints: Sequence[float | None]) -> None:
        """Take a row.

        Args:
            joints: Of `seerob.outputs.tables.people.Person.joints_measured`.
        """
        self._rows += 1
        if joints[0] is None:  # joints or keyframes move the person
            return
        self._seen_rows += 1
        lost: list[bool] = np.any(_follows()[:, [not v for v in joints]], axis=1).tolist()
        self._estimated.update(
            name for name, is_lost in zip(joint_angles.coordinates(), lost, strict=True) if is_lost
        )

    def lines(self) -> list[str]:
        """Remarks for the file's header; none when everything was measured, or no device saw the person."""
        named = [f"{name} ({percent(n / self._rows)} of the rows)" for name, n in self._estimated.items()]
        out = [
            f"estimated, no device saw the bones: {', '.join(named[k : k + PER_LINE])}\n"
            for k in range(0, len(named), PER_LINE)
        ]
        if self._seen_rows < self._rows and self._seen_rows:
            out.append(f"no device saw the person in {self._rows - self._seen_rows} of {self._rows} rows\n")
        return out


@cache
def _follows() -> Array:
    """Whether a coordinate follows a joint of ours, shape (37, 53); the pelvis' place follows its joints."""
    rest = 0.1 * np.cos(np.arange(len(JOINTS)))  # no angle is 0, where some would hide
    moved = np.vstack([rest, rest + STEP * np.eye(len(JOINTS))])
    found = joint_angles.from_joints(moved, moved[:, :3])
    return np.asarray((np.abs(found[1:] - found[0]) > STEP**2).T)


SLACK = 1e-6
"""Of a period: instants are not exact multiples of it."""
TOGETHER = 256
"""Postures that are converted at once."""
PELVIS = "pelvis"
LEAST_STEP = 1e-6
"""Rows of a file are at least so far apart, as its times are written [s]."""


class OpenSim(Sink, frozen=True, kw_only=True):
    """Write the motion of people as TRC and MOT files for OpenSim."""

    file: Annotated[str, Meta(pattern=NAME, description="a name of letters, digits, _ and -")] = "opensim"
    """Name of the folder in the run's folder; must not exist yet."""
    every: Annotated[float, Meta(ge=0, extra={"unit": "s"}, extra_json_schema={"x-unit": "s"})] = 0.0
    """Time between two rows of the person's motion [s]; 0 for every tick."""

    def open(
        self, scene: Scene, meshes: dict[str, bytes], files: dict[str, bytes], folder: Path
    ) -> OpenSimWriter:
        """Start; nothing is seen under the folder's name before `OpenSimWriter.close`.

        Raises:
            InputError: The folder's name or the period is wrong, the folder exists, or there is no person.
        """
        path = checked(folder, self.file, "opensim.file")
        if not (math.isfinite(self.every) and self.every >= 0):
            raise InputError.at(folder, "opensim.every", f"{self.every} s", "0 or more seconds")
        known = [p for p in people(scene) if PELVIS in p.bones and tuple(n for n, _ in p.joints) == JOINTS]
        if not known:
            what = "there is no person in this workstation"
            raise InputError.at(folder, "opensim", what, "add one of [[humans]], or leave this sink out")
        # Ticks are evenly spaced, and so must rows be.
        stride = max(1, round(self.every / scene.period))
        return OpenSimWriter(scene, path, known, stride=stride)


class OpenSimWriter(WholeFolder):
    """Writes rows as they come; memory does not grow with the length of the run."""

    def __init__(self, scene: Scene, path: Path, known: list[Person], *, stride: int) -> None:
        """Use `OpenSim.open`."""
        super().__init__(path)
        self._people, self._stride, self._period = known, stride, scene.period
        self._ticks = 0
        self._rates: dict[str, tuple[float, float]] = {}
        """Table → its first and last instant [s]."""
        self._heads: dict[str, Callable[[GrowingTable, float], list[str]]] = {}
        self._estimated = {person.name: EstimatedCoordinates() for person in known}
        self._waiting: dict[str, list[tuple[float, tuple[float, ...], list[float]]]] = {}

    def take(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Add the rows of one tick to the tables."""
        names = {person.name for person in self._people}
        for sample in samples:
            if isinstance(sample, BodySample) and sample.target in names:
                self._seen(sample)
        turn, self._ticks = self._ticks % self._stride, self._ticks + 1
        if turn:
            return
        for person in self._people:
            places = person.poses(snapshot)[:, :3].astype(float)
            self._markers(f"{person.name} bones", person.bones, snapshot.t, places)
            self._estimated[person.name].add(person.joints_measured(snapshot))
            waiting = self._waiting.setdefault(person.name, [])
            pelvis = places[person.bones.index(PELVIS)].tolist()
            waiting.append((snapshot.t, snapshot.joints[person.name], pelvis))
            if len(waiting) >= TOGETHER:
                self._coordinates(person.name)

    def _seen(self, sample: BodySample) -> None:
        points = [p for p in sample.points if p.position is not None]
        if points:
            names = tuple(p.name for p in points)
            places = np.array([p.position for p in points])
            self._markers(f"{sample.target} seen by {sample.source}", names, sample.t, places)

    def _markers(self, name: str, names: tuple[str, ...], t: float, places: np.ndarray) -> None:
        table = self._table(name, ".trc", lambda table, rate: list(_trc_head(table, rate)))
        if self._later(name, t):
            # In the same axes as the coordinates: OpenSim takes both files of one motion.
            cells = next(trc.cells(joint_angles.in_its_world(places)[None]))
            titles = [f"{axis}\t{marker}" for marker in names for axis in "XYZ"]
            row = {"frame": str(table.rows + 1), "time": f"{t:.6f}"}
            table.add(row | dict(zip(titles, cells, strict=True)))

    def _coordinates(self, name: str) -> None:
        waiting = self._waiting.pop(name, [])
        if not waiting:
            return
        names = joint_angles.coordinates()
        lengths = np.array([joint_angles.is_length(label) for label in names])
        found = joint_angles.from_joints(
            np.array([q for _, q, _ in waiting]), np.array([place for _, _, place in waiting])
        )
        values = np.where(lengths, found, np.degrees(found)).tolist()
        title = f"{name} coordinates"
        table = self._table(
            title,
            ".mot",
            lambda table, _: list(
                storage.head(table.columns[1:], table.rows, name=title, remarks=self._estimated[name].lines())
            ),
        )
        for (t, _, _), row in zip(waiting, values, strict=True):
            if self._later(title, t):
                cells = [f"{t:.6f}", *storage.cells(row)]
                table.add(dict(zip(("time", *names), cells, strict=True)))

    def _later(self, name: str, t: float) -> bool:
        first, last = self._rates.get(name, (t, -math.inf))
        if not t >= last + LEAST_STEP:
            return False
        self._rates[name] = first, t
        return True

    def _table(
        self, name: str, suffix: str, head: Callable[[GrowingTable, float], list[str]]
    ) -> GrowingTable:
        self._heads[name] = head
        return self.table(name, suffix, lambda path: GrowingTable(path, separator="\t", missing="NaN"))

    def finish(self) -> None:
        """Finish every table."""
        for person in self._people:
            self._coordinates(person.name)
        for k, (name, table) in enumerate(self.tables.items()):
            first, last = self._rates[name]
            period = (last - first) / (table.rows - 1) if table.rows > 1 else self._period * self._stride
            table.finish(self._heads[name](table, 1 / period))
            self._tell(k + 1, len(self.tables))


def _trc_head(table: GrowingTable, rate: float) -> list[str]:
    markers = [title.partition("\t")[2] for title in table.columns[2::3]]
    return list(trc.head(markers, table.rows, rate, name=table.path.name))
