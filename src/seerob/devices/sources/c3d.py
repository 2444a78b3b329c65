"""Markers of a person in C3D, the common format of optical motion capture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from seerob.description.capture.captured import Captured
from seerob.devices.capture.file_source import MarkerFile
from seerob.files.motion_capture import c3d
from seerob.files.motion_capture.frame_arrays import about


class C3d(MarkerFile, frozen=True, kw_only=True):
    """Markers of a person from a C3D file (Vicon, Qualisys, OptiTrack …)."""

    def read(self, path: Path) -> Captured:
        """The markers of the person.

        Raises:
            InputError: It is no C3D file, or the unit, the vertical or the person is not clear.
        """
        captured = c3d.read(path, self.reading())
        return replace(captured, findings=about(captured.findings, self.human))
