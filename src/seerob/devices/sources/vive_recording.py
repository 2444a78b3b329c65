"""Recordings of worn trackers: JSON lines of our live message, or a table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from msgspec import field

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.description.capture.captured import Captured, CaptureFrame
from seerob.devices.capture import worn_trackers as _worn_trackers
from seerob.devices.capture.file_source import MOST_FRAMES, CaptureFile
from seerob.devices.capture.worn_trackers import Names, OriginWatch, remarks
from seerob.files.motion_capture import tracker_file
from seerob.protocols.tracking.vive import Device, Devices


class ViveRecording(CaptureFile, frozen=True, kw_only=True):
    """A recording of worn trackers (JSON lines or CSV)."""

    trackers: dict[str, str] = field(default_factory=dict)
    """Serial number → where it is worn (``waist``, ``left_foot`` …), in place of the recorded role."""

    def read(self, path: Path) -> Captured:
        """All devices of the recording.

        Raises:
            InputError: The file is missing or wrong.
        """
        _worn_trackers.check(self.trackers, self.file)
        names, watch = Names(self.trackers, self.mapping), OriginWatch()
        instants: list[Devices] = []
        last: dict[str, Device] = {}
        for instant in tracker_file.read(path, file=self.file):
            if len(instants) >= MOST_FRAMES:
                raise InputError.at(self.file, "", f"more than {MOST_FRAMES} instants", "cut the recording")
            names.learn(instant.devices)
            last |= {device.serial: device for device in instant.devices}
            instants.append(instant)
        if not names.of:
            raise InputError.at(self.file, "", "no device in any line", "give another recording")
        rows = {serial: row for row, serial in enumerate(names.of)}
        frames = []
        for instant in instants:
            if watch.trusted(instant):
                frames.append(_worn_trackers.frame(instant, rows))
            else:
                frames.append(CaptureFrame(t=instant.t, positions=np.full((len(rows), 3), np.nan)))
        findings = list(remarks(names, last.values(), self.human))
        if watch.moved_at is not None:
            text = (
                f"{self.file}: the origin of the tracking was set anew at "
                f"{watch.moved_at - instants[0].t:.2f} s: what follows is not used"
            )
            findings.append(Finding(level="warning", subject=self.human, text=text))
        steps = np.diff([instant.t for instant in instants])
        steps = steps[steps > 0]
        return Captured(
            layout=names.layout(),
            frames=tuple(frames),
            rate=float(1 / np.median(steps)) if len(steps) else 0.0,
            count=len(frames),
            findings=tuple(findings),
        )
