"""C3D: the markers of a person; what was computed from them (angles, forces) is left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seerob.core.snapshot import Finding
from seerob.description.capture.captured import Captured
from seerob.files.motion_capture import c3d_format
from seerob.files.motion_capture.c3d_format import C3d
from seerob.files.motion_capture.markers import MarkerReading, Points, recording

NO_POINTS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
"""Entries of POINT that list what stands among the points and is none (Vicon)."""


def read(path: Path, reading: MarkerReading) -> Captured:
    """The markers of one person.

    Raises:
        InputError: It is no C3D file, or the unit, the vertical or the person is not clear.
    """
    found = c3d_format.read(path, file=reading.file)
    said: list[Finding] = []

    def note(text: str, level: str = "warning") -> None:
        said.append(Finding(level=level, subject="", text=f"{reading.file}: {text}"))

    if found.missing_frames:
        note(f"it ends early: {found.missing_frames} frames are missing at the end")
    if found.zeros:
        note(f"{found.zeros} points at exactly 0, 0, 0 count as not seen")
    computed = _computed(found)
    kept = [k for k, label in enumerate(found.labels) if label not in computed]
    if len(kept) < len(found.labels):
        note(f"{len(found.labels) - len(kept)} computed quantities among the points are left out", "note")
    points = Points(
        names=tuple(found.labels[k] for k in kept),
        t=(found.first - 1 + np.arange(len(found.points))) / found.rate,
        values=found.points[:, kept],
        unit=found.units,
        up=vertical(found),
    )
    return recording(points, reading, notes=tuple(said))


def _computed(found: C3d) -> set[str]:
    point = found.groups.get("POINT", {})
    lists = (point[name].values for name in NO_POINTS if name in point)
    return {value for values in lists for value in values if isinstance(value, str)}


def vertical(found: C3d) -> str:
    """The axis that points up on the screen, ``z``; empty when the file does not say."""
    screen = found.groups.get("POINT", {}).get("Y_SCREEN")
    value = screen.values[0] if screen is not None and screen.values else ""
    text = value.strip().upper() if isinstance(value, str) else ""
    axis = text.lstrip("+-").lower()
    if axis not in ("x", "y", "z"):
        return ""
    return ("-" if text.startswith("-") else "") + axis
