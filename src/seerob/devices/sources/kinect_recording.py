"""Recordings of a depth camera's body tracking: JSON of ``offline_processor``, ROS bag, or text."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from seerob.core.errors import InputError
from seerob.description.capture.captured import Captured
from seerob.devices.capture.file_source import CaptureFile
from seerob.devices.capture.options import AZURE_KINECT
from seerob.files.motion_capture import kinect_recording, ros_bag
from seerob.files.motion_capture.frame_arrays import about
from seerob.files.motion_capture.kinect_recording import Reading
from seerob.files.tables.mapping import LengthUnit, TimeUnit
from seerob.workstation.source import PostureError
from seerob.workstation.workstation import Pose

BAGS = (".bag", ".db3", ".mcap")
TEXTS = (".csv", ".txt", ".tsv")


class KinectRecording(CaptureFile, frozen=True, kw_only=True):
    """A recording of a depth camera that tracks bodies (JSON, ROS bag, text)."""

    known_error: ClassVar[PostureError | None] = AZURE_KINECT

    topic: str = ""
    """Topic that is read, of a bag with several topics of skeletons."""
    unit: LengthUnit | None = None
    """Unit of the positions in a text, when its headers do not say it."""
    time_unit: TimeUnit | None = None
    """Unit of the time in a text, when its header does not say it."""

    def read(self, path: Path) -> Captured:
        """The person, upright: as ``at`` says, or as the person stands.

        Raises:
            InputError: The file is missing or wrong, or holds several persons and nobody said which.
        """
        reading = Reading(self.file, self.subject, level=self.at != Pose())
        suffix = path.suffix.lower()
        if suffix in BAGS or path.is_dir():
            captured = ros_bag.read(path, reading, topic=self.topic)
        elif suffix == ".json":
            captured = kinect_recording.read_json(path, reading)
        elif suffix in TEXTS:
            captured = kinect_recording.read_text(
                path, reading, unit=self.unit or "", time_unit=self.time_unit or ""
            )
        else:
            what = f"{path.suffix or 'no suffix'}: unknown kind of file"
            remedy = f"known: .json, {', '.join(BAGS)}, {', '.join(TEXTS)}, the folder of a ROS 2 bag"
            raise InputError.at(self.file, "file", what, remedy)
        return replace(captured, findings=about(captured.findings, self.human))
