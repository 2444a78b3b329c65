"""Markers of a person in the text format of OpenSim."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from seerob.description.capture.captured import Captured
from seerob.devices.capture.file_source import MarkerFile
from seerob.files.motion_capture import trc
from seerob.files.motion_capture.frame_arrays import about


class Trc(MarkerFile, frozen=True, kw_only=True):
    """Markers of a person from a TRC file (OpenSim)."""

    def read(self, path: Path) -> Captured:
        """The markers of the person.

        Raises:
            InputError: It is no TRC file, or the unit, the vertical or the person is not clear.
        """
        captured = trc.read(path, self.reading())
        return replace(captured, findings=about(captured.findings, self.human))
