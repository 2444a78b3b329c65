"""Joint trajectories in delimited text: commas, semicolons, tabs or blanks, decimal point or comma."""

from __future__ import annotations

from pathlib import Path

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.devices.motion_files import MappedTable
from seerob.files.tables.table_files import WORKBOOKS
from seerob.files.trajectories.trajectory import Trajectory
from seerob.workstation.source import Target


class Csv(MappedTable, frozen=True, kw_only=True):
    """A robot's joint trajectory from a text file with one row per sample."""

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """Read the table; a workbook is refused."""
        if path.suffix.lower() in WORKBOOKS:
            raise InputError.at(self.file, "", "a workbook, not text", 'use kind = "excel"')
        return super().read(path, target)
