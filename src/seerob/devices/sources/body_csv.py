"""Points or bones of a person in a table, as many programs write them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from seerob.description.capture.captured import Captured, Seen
from seerob.devices.capture.file_source import MarkerFile
from seerob.files.motion_capture import body_table
from seerob.files.motion_capture.frame_arrays import about
from seerob.files.tables.mapping import TimeUnit


class BodyCsv(MarkerFile, frozen=True, kw_only=True):
    """Points or bones of a person from delimited text, units in the headers."""

    seen: Seen = Seen.JOINTS
    """What the points are: ``joints``, ``segments``, ``markers`` or ``trackers``."""
    time_unit: TimeUnit | None = None
    """Unit of the time, when the file's header does not say it."""

    def read(self, path: Path) -> Captured:
        """The points of the person.

        Raises:
            InputError: It is no such table, or the unit, the vertical or the person is not clear.
        """
        captured = body_table.read_person(
            path, self.reading(), seen=self.seen, time_unit=self.time_unit or ""
        )
        return replace(captured, findings=about(captured.findings, self.human))
