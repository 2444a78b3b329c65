"""A table of captured motion as the recording of one person."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seerob.core.errors import InputError
from seerob.description.capture.captured import Captured, Seen
from seerob.files.motion_capture import body_table
from seerob.files.motion_capture.markers import MarkerReading, Points, recording


def read(path: Path, reading: MarkerReading, *, seen: Seen, time_unit: str = "") -> Captured:
    """The points of one person.

    Args:
        path: Delimited text.
        reading: What the user says of it; ``subject`` is a value of the column ``person``.
        seen: What the points are.
        time_unit: Of the time, when its header does not say it.

    Raises:
        InputError: It is no such table, or the unit, the vertical or the person is not clear.
    """
    from dataclasses import replace

    table = body_table.read(path, file=reading.file, time_unit=time_unit)
    persons = sorted(set(table.persons))
    rows = np.ones(len(table.t), bool)
    if len(persons) > 1:
        chosen = _person(table.persons, reading)
        rows = np.array([p == chosen for p in table.persons])
        reading = replace(reading, subject="")
    order = np.flatnonzero(rows)
    confidence = table.values[order, :, 7] if "confidence" in table.has else None
    if confidence is not None:
        confidence = np.clip(confidence, 0.0, 1.0)
    points = Points(
        names=table.names,
        t=table.t[order],
        values=table.values[order, :, :3],
        unit=table.unit,
        wxyz=table.values[order, :, 3:7] if "orientation" in table.has else None,
        confidence=confidence,
    )
    return recording(points, reading, seen=seen)


def _person(persons: tuple[str, ...], reading: MarkerReading) -> str:
    counts = {name: persons.count(name) for name in sorted(set(persons)) if name}
    if reading.subject in counts:
        return reading.subject
    if not reading.subject and len(counts) == 1:
        return next(iter(counts))
    shown = ", ".join(f"{name} ({n} rows)" for name, n in list(counts.items())[:12])
    what = f"no person {reading.subject!r}" if reading.subject else "several persons"
    raise InputError.at(reading.file, "subject", what, f"name one of: {shown}")
