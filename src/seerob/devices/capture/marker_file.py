"""What files of markers are told alike: unit and vertical, where the file does not say them."""

from __future__ import annotations

from enum import StrEnum

from seerob.devices.capture.file_source import CaptureFile
from seerob.files.motion_capture.markers import MarkerReading
from seerob.files.motion_capture.upright import Up


class Length(StrEnum):
    """Unit of coordinates."""

    M = "m"
    CM = "cm"
    MM = "mm"
    INCH = "inch"


class MarkerFile(CaptureFile, frozen=True, kw_only=True):
    """Base of the files of points whose unit or vertical may be open."""

    up: Up | None = None
    """Axis of the file that points up; what the file says, or told by heads being above feet."""
    unit: Length | None = None
    """Unit of the coordinates; what the file says when not given."""

    def reading(self) -> MarkerReading:
        """How the file is to be read."""
        return MarkerReading(
            file=self.file,
            subject=self.subject,
            up=self.up,
            unit=self.unit or "",
            convention=self.convention,
        )
