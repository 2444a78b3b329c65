"""Azure Kinect body tracking as text: tables as in `body_table`, in the frame of the depth camera."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.core.units import LENGTHS
from seerob.description.capture.captured import Captured
from seerob.files.motion_capture import body_table
from seerob.files.motion_capture.body_table import BodyTable
from seerob.files.motion_capture.kinect_recording import Reading, recording
from seerob.protocols.tracking.kinect import JOINTS, Body, Picture, camera_body

FEWEST = 10
"""Joints of the 32 that a table of a body tracker has at least."""


def read(path: Path, reading: Reading, *, unit: str = "", time_unit: str = "") -> Captured:
    """A recording in a table.

    Args:
        path: Delimited text.
        reading: How.
        unit: Of the positions, when no header says it.
        time_unit: Of the time, when its header does not say it.

    Raises:
        InputError: It is no such table, has other joints, or its unit is not clear.
    """
    table = body_table.read(path, file=reading.file, time_unit=time_unit)
    places = _places(table, reading.file)
    told = unit or table.unit
    if told not in LENGTHS:
        what = f"positions in {told!r}" if told else "no header says the unit of the positions"
        raise InputError.at(reading.file, "unit", what, 'give unit = "mm" or "m"')
    note = Finding(level="note", subject="", text=f"{reading.file}: {len(places)} joints in {told}")
    return recording(pictures(table, places, LENGTHS[told]), reading, (note,))


def pictures(table: BodyTable, places: dict[int, int], factor: float) -> Iterator[Picture]:
    """The rows of an instant together.

    Args:
        table: Rows of persons at instants.
        places: Joint of the tracker → point of the table.
        factor: Metres per unit.
    """
    order = np.argsort(table.t, kind="stable").tolist()
    for t, rows in groupby(order, key=lambda row: float(table.t[row])):
        if np.isfinite(t):
            bodies = (_body(table, row, places, factor) for row in rows)
            yield Picture(t=t, bodies=tuple(body for body in bodies if body is not None))


def _body(table: BodyTable, row: int, places: dict[int, int], factor: float) -> Body | None:
    values = np.full((len(JOINTS), body_table.WIDTH), np.nan)
    values[list(places)] = table.values[row, list(places.values())]
    if np.isnan(values[:, :3]).all():
        return None  # an instant at which nobody is seen
    person = table.persons[row]
    levels = values[:, 7]
    return camera_body(
        int(person) if re.fullmatch(r"-?\d{1,15}", person) else 0,
        values[:, :3] * factor,
        values[:, 3:7] if "orientation" in table.has else None,
        np.where(np.isnan(levels), 0, levels) if "confidence" in table.has else None,
    )


def _places(table: BodyTable, file: str) -> dict[int, int]:
    """Joint of the tracker → point of the table: by name, or by the joint's number."""
    found: dict[int, int] = {}
    for index, name in enumerate(table.names):
        plain = re.sub(r"[^A-Z0-9]", "", name.upper().removeprefix("K4ABT_JOINT_"))
        joint = int(plain) if plain.isdecimal() and len(plain) < 3 else _NUMBERS.get(plain, -1)
        if 0 <= joint < len(JOINTS):
            found[joint] = index
    if len(found) < FEWEST:
        what = f"{len(found)} of the joints of Azure Kinect: {', '.join(table.names[:8])}"
        remedy = f'names such as {", ".join(JOINTS[:3])} are expected; for other names use kind = "body_csv"'
        raise InputError.at(file, "", what, remedy)
    return found


_NUMBERS = {name.replace("_", ""): k for k, name in enumerate(JOINTS)}
