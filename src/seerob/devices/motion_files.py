"""What every trajectory file has in common: options, checks, and the way from arrays to samples.

What poses of a tool are relative to, and where that is on its robot.

The sources whose columns are told by a mapping: workbooks and delimited text.

Text logs whose format fixes the names of the columns: controllers' and simulators' own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.motion_origin import MotionOrigin, origin_finding
from seerob.core.samples import LARGEST_SPEED
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.files.tables.grid import Numbers, read_numbers
from seerob.files.tables.mapping import Mapping
from seerob.files.tables.motion import read_motion
from seerob.files.tables.table_files import BLANKS, TextGrid, encoding_of
from seerob.files.trajectories.checks import (
    Beyond,
    joint_count_check,
    larger_velocities,
    limit_check,
    sampling_findings,
)
from seerob.files.trajectories.trajectory import (
    QUIET,
    Trajectory,
    TrajectorySamples,
    derive_velocities,
    derived_noise,
)
from seerob.workstation.source import Opened, Source, Target


class PoseFrame(StrEnum):
    """What the poses of a file are relative to."""

    BASE = "base"
    """The robot's base, as controllers log them."""
    WORLD = "world"
    """The workstation."""


def fixed_links(target: Target) -> dict[str, Array]:
    """Links that the robot's joints do not move, root first: base from link, (4, 4), by full name."""
    found: dict[str, Array] = {}
    if target.description is None:
        return found
    for link in target.description.links:
        parent = None if link.parent is None else found.get(f"{target.name}/{link.parent}")
        if not link.joints and (link.parent is None or parent is not None):
            above = np.eye(4) if parent is None else parent
            found[f"{target.name}/{link.name}"] = above @ link.parent_from_link
    return found


class Velocities(StrEnum):
    """Which velocities a motion has."""

    GIVEN = "given"
    """The file's own where it has them, after a check against the positions; else derived."""
    DERIVE = "derive"
    """From the positions, whatever the file says."""


class TrajectoryFile(Source, frozen=True, kw_only=True):
    """Base of the sources that read one robot's motion from one file."""

    robot: str
    """The robot it drives; any with as many joints as the file has."""
    file: str
    """Path, from the folder of the workstation file."""
    origin: MotionOrigin = MotionOrigin.SIMULATOR
    """What the motion is a motion of; all but ``controller`` is preliminary."""
    beyond_limits: Beyond = Beyond.REFUSE
    """``report`` goes on with positions beyond a limit of the robot, with a warning."""
    velocities: Velocities = Velocities.GIVEN
    """The file's own where it has them, after a check against the positions; or derived from these."""

    def target(self) -> str:
        """The robot."""
        return self.robot

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """The motion in SI units and what is to be said of how it was read.

        Args:
            path: The file.
            target: The robot it is to drive.

        Raises:
            InputError: The file is wrong, or something in it must be confirmed.
        """
        raise NotImplementedError

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the file and check the motion against the robot.

        Raises:
            InputError: The file is missing, wrong, ambiguous, or of another robot than this could be.
        """
        if target is None:
            raise InputError.at(
                self.file, "robot", f"no robot {self.robot!r}", "name a robot of the workstation"
            )
        trajectory, findings = self.read(folder / self.file, target)
        joint_count_check(trajectory, target)
        origin = origin_finding(self.origin, target.name, self.file)
        limits = limit_check(trajectory, target, beyond=self.beyond_limits)
        qd, about_velocities = self._velocities(trajectory, target)
        error = None
        if trajectory.qd is None or self.velocities is not Velocities.GIVEN:
            known = None if trajectory.invalid is None else ~trajectory.invalid
            error = derived_noise(trajectory.t, trajectory.q, known)
        if error is not None and not (error > QUIET).any():
            error = None
        sampling = sampling_findings(trajectory, target.name, self.timeout)
        name = self.name or f"{type(self).__module__.rpartition('.')[2]} {target.name}"
        return Opened(
            samples=TrajectorySamples(trajectory, name, target.name, qd, error),
            duration=trajectory.duration,
            began=float(trajectory.t[0]),
            findings=(origin, *findings, *limits, *about_velocities, *sampling),
        )

    def _velocities(self, trajectory: Trajectory, target: Target) -> tuple[Array, tuple[Finding, ...]]:
        derived = derive_velocities(
            trajectory.t,
            trajectory.q,
            largest=np.array([LARGEST_SPEED[unit] for unit in target.units]),
            known=None if trajectory.invalid is None else ~trajectory.invalid,
        )
        if trajectory.qd is not None and self.velocities is Velocities.GIVEN:
            return larger_velocities(trajectory, target, derived.qd)
        why = "on request" if trajectory.qd is not None else "the file gives none"
        size = "too few samples to estimate their error"
        if derived.error is not None:
            size = f"largest estimated error {derived.error:.2g} rad/s or m/s"
        text = f"velocities derived by central differences of the positions ({why}); {size}"
        return derived.qd, (Finding(level="assumed", subject=target.name, text=text),)


def notes(texts: tuple[str, ...], subject: str, *, level: str = "note") -> tuple[Finding, ...]:
    """Findings of one level."""
    return tuple(Finding(level=level, subject=subject, text=text) for text in texts)


class MappedTable(TrajectoryFile, frozen=True, kw_only=True):
    """Base of `Excel` and `Csv`."""

    mapping: Mapping = Mapping()
    """Which column is what; guessed where it says nothing, and asked when in doubt."""

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """Guess what the mapping leaves open, refuse to go on when in doubt, read the columns."""
        trajectory, used, remarks = read_motion(path, self.mapping, name=self.file, target=target)
        shown = " · ".join(used.mapping.toml().splitlines()[1:])
        findings = (f"columns of {self.file}: {shown}", *(f"{self.file}: {r}" for r in remarks))
        return trajectory, notes(findings, target.name)


SEARCH = 20
"""Rows in which the header is looked for."""


class Joints(StrEnum):
    """Which joint values of a log drive the twin."""

    MEASURED = "measured"
    COMMANDED = "commanded"
    """What the controller aimed at: a cleaner signal, but not what the robot did."""


@dataclass(frozen=True, eq=False)
class Log:
    """A text log whose header was found."""

    grid: TextGrid
    header_row: int
    """From 1."""
    names: tuple[str, ...]

    def read(self, columns: Iterable[str]) -> LogValues:
        """The columns of these names, which are there."""
        wanted = list(dict.fromkeys(columns))
        indices = {name: self.names.index(name) for name in wanted}
        return LogValues(self.grid.file, read_numbers(self.grid, self.header_row + 1, indices), tuple(wanted))


@dataclass(frozen=True, eq=False)
class LogValues:
    """Columns by name."""

    file: str
    numbers: Numbers
    names: tuple[str, ...]

    @property
    def rows(self) -> NDArray[np.int64]:
        """Row numbers in the file, shape (n,)."""
        return self.numbers.rows

    def column(self, name: str) -> Array:
        """One column, shape (n,)."""
        return self.numbers.values[:, self.names.index(name)]

    def table(self, names: Iterable[str]) -> Array:
        """Several columns, shape (n, columns)."""
        return self.numbers.values[:, [self.names.index(name) for name in names]]


def open_log(path: Path, name: str, mark: str, delimiters: str, what: str, *, comment: str = "") -> Log:
    """Find the header of a log, whatever separates its columns.

    Args:
        path: The file.
        name: The file as messages name it.
        mark: A column that every file of the format has.
        delimiters: Characters that may separate columns; a blank stands for any run of blanks.
        what: The format, for messages.
        comment: A mark that a header line may start with.

    Raises:
        InputError: No row holds the mark, or a column is there twice.
    """
    base = TextGrid(path, name, encoding_of(path, name), BLANKS, comment)
    for delimiter in delimiters:
        grid = replace(base, delimiter=delimiter)
        for row, cells in enumerate(islice(grid.rows(), SEARCH), start=1):
            names = tuple(c.strip() for c in cells)
            if mark in names:
                twice = sorted({n for n in names if n and names.count(n) > 1})
                if twice:
                    raise InputError.at(name, f"row {row}", f"column {twice[0]!r} is there twice")
                return Log(grid, row, names)
    first = " ".join(next(iter(base.rows()), []))[:80]
    remedy = f'the first row reads {first!r}; for other tables use kind = "csv"'
    raise InputError.at(name, "header", f"no column {mark!r}: not {what}", remedy)


def missing(log: Log, columns: Iterable[str], remedy: str) -> InputError | None:
    """An error that names the columns that are not there; None when all are."""
    absent = [c for c in columns if c not in log.names]
    if not absent:
        return None
    return InputError(Problem(log.grid.file, f"row {log.header_row}", f"no column {absent[0]!r}", remedy))
