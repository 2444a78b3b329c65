"""Joint trajectories in Excel workbooks, as offline programming tools export them (.xlsx, .xlsm)."""

from __future__ import annotations

from pathlib import Path

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.devices.motion_files import MappedTable
from seerob.files.tables.table_files import WORKBOOKS
from seerob.files.trajectories.trajectory import Trajectory
from seerob.workstation.source import Target


class Excel(MappedTable, frozen=True, kw_only=True):
    """A robot's joint trajectory from a sheet of a workbook."""

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """Read one sheet; a file that is no workbook is refused."""
        if path.suffix.lower() not in WORKBOOKS:
            what = f"{path.suffix or 'no'} extension, not .xlsx or .xlsm"
            raise InputError.at(self.file, "", what, 'for delimited text use kind = "csv"')
        return super().read(path, target)
