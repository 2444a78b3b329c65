"""Landmarks of a person that MediaPipe found in a video: results as JSON, or a table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar

from msgspec import Meta

from seerob.description.capture.captured import Captured
from seerob.devices.capture.file_source import CaptureFile
from seerob.devices.capture.options import MEDIAPIPE
from seerob.files.motion_capture import mediapipe
from seerob.files.motion_capture.frame_arrays import about
from seerob.files.motion_capture.mediapipe import Reading
from seerob.files.tables.mapping import TimeUnit
from seerob.workstation.source import PostureError
from seerob.workstation.workstation import Pose


class MediapipeRecording(CaptureFile, frozen=True, kw_only=True):
    """Landmarks of a person that MediaPipe found in a video (JSON, table)."""

    known_error: ClassVar[PostureError | None] = MEDIAPIPE

    frequency: Annotated[float, Meta(gt=0, le=1000, extra={"unit": "Hz"})] | None = None
    """Pictures per second of a file whose results say no time [Hz]."""
    time_unit: TimeUnit | None = None
    """Unit of the time in a table, when its header does not say it."""

    def read(self, path: Path) -> Captured:
        """The person, upright: as ``at`` says that the camera is turned, or as the person stands.

        Raises:
            InputError: The file is missing or wrong, or holds coordinates in the picture.
        """
        reading = Reading(
            self.file,
            level=self.at != Pose(),
            frequency=self.frequency,
            time_unit=self.time_unit or "",
        )
        captured = mediapipe.read(path, reading)
        return replace(captured, findings=about(captured.findings, self.human))
