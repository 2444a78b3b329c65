"""The sources whose columns are told by a mapping: workbooks and delimited text."""

from __future__ import annotations

from pathlib import Path

from seerob.core.snapshot import Finding
from seerob.devices.motion_files.trajectory_file import TrajectoryFile, notes
from seerob.files.tables.mapping import Mapping
from seerob.files.tables.motion import read_motion
from seerob.files.trajectories.trajectory import Trajectory
from seerob.workstation.source import Target


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
