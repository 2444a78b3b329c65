"""Files of MediaPipe's pose landmarks: results as JSON, one per line or in a list, or a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from seerob.core.errors import InputError
from seerob.core.files.bounded import TooLarge, content
from seerob.core.quantities import LENGTHS
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.capture.captured import Captured
from seerob.description.capture.mapping import plain
from seerob.files.motion_capture import body_table
from seerob.files.motion_capture.frame_arrays import FrameArrays, check_size, checked
from seerob.files.motion_capture.kinect_recording import elements
from seerob.files.motion_capture.upright import camera_upright
from seerob.files.tables.table_files import check_file
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.mediapipe import (
    LANDMARKS,
    LAYOUT,
    Result,
    camera_points,
    centred,
    decode,
)

MOST_BYTES = 1 << 29
"""Of a file of results: about 40 minutes at 60 pictures per second."""
FEWEST = 12
"""Landmarks of the 33 that a table has at least."""
_ANKLES, _SHOULDERS, _TOES = (
    [LANDMARKS.index(f"{side}_{part}") for side in ("left", "right")]
    for part in ("ankle", "shoulder", "foot_index")
)
_ROWS = {plain(name): row for row, name in enumerate(LANDMARKS)} | {str(k): k for k in range(len(LANDMARKS))}


@dataclass(frozen=True)
class Reading:
    """How a file of landmarks is to be read."""

    file: str
    """What messages call it."""
    level: bool = False
    """Whether the tilt of the camera is known; else it is estimated from who stands upright."""
    frequency: float | None = None
    """Pictures per second of a file whose results have no time [Hz]."""
    time_unit: str = ""
    """Of the time of a table, when its header does not say it."""


def read(path: Path, reading: Reading) -> Captured:
    """The only person of a file.

    Returns:
        Landmarks about the hips [m], in the frame of a camera of known tilt; else turned upright, feet on the
        floor. Neither says where in the room the person is.

    Raises:
        InputError: It is no such file, or holds coordinates in the picture, or nobody says when anything was.
    """
    check_file(path, reading.file)
    if path.suffix.lower() in (".csv", ".txt", ".tsv"):
        t, values, notes = _table(path, reading)
    else:
        t, values, notes = _json(path, reading)
    if not centred(values):
        what = "the middle of the hips is not the origin: no world landmarks of MediaPipe"
        remedy = "write pose_world_landmarks (worldLandmarks); landmarks in the picture are no lengths"
        raise InputError.at(reading.file, "", what, remedy)
    positions, orientations, confidence = camera_points(values)
    frames, rate, found = checked(
        FrameArrays(t=t, positions=positions, orientations=orientations, confidence=confidence),
        file=reading.file,
        subject="",
    )
    said = [*notes, *found]
    if not reading.level:
        seen = np.where(confidence[..., None] > 0, positions, np.nan)
        world_from_camera, finding = camera_upright(
            seen[:, _ANKLES].mean(axis=1), seen[:, _SHOULDERS].mean(axis=1), seen[:, _TOES], file=reading.file
        )
        frames, said = frames.turned(world_from_camera), [*said, finding]
    text = (
        f"{reading.file}: landmarks lie about the hips, wherever the person is: no place in the room is known"
    )
    said.append(Finding(level="note", subject="", text=text))
    return Captured(
        layout=LAYOUT, frames=frames, rate=rate, count=len(frames), placed=False, findings=tuple(said)
    )


def _json(path: Path, reading: Reading) -> tuple[Array, Array, list[Finding]]:
    t: list[float] = []
    rows: list[Array] = []
    crowded = 0
    for index, result in enumerate(_results(path, reading.file)):
        check_size(reading.file, index + 1, len(LANDMARKS) * 4)
        crowded += len(result.people) > 1
        t.append(result.t)
        # Persons have no numbers: of several nobody knows which is meant.
        alone = len(result.people) == 1
        rows.append(result.people[0] if alone else np.full((len(LANDMARKS), 4), np.nan))
    if not rows:
        raise InputError.at(reading.file, "", "no result in it")
    said = []
    if crowded:
        text = f"{reading.file}: several persons in {crowded} pictures, without a number: not seen there"
        said.append(Finding(level="warning", subject="", text=text))
    times = np.array(t)
    if np.isnan(times).any():
        if reading.frequency is None:
            remedy = "write timestamp_ms beside the landmarks, or give frequency, the pictures per second"
            raise InputError.at(reading.file, "timestamp_ms", "results without a time", remedy)
        times = np.arange(len(times)) / reading.frequency
    return times, np.stack(rows), said


def _results(path: Path, file: str) -> Iterator[Result]:
    """Every result: a list, an object with a list ``frames``, or one per line."""
    with path.open("rb") as stream:
        head = stream.read(4096).lstrip()
    if head.startswith(b"["):
        try:
            texts = [
                bytes(raw) for raw in msgspec.json.decode(content(path, MOST_BYTES), type=list[msgspec.Raw])
            ]
        except TooLarge as error:
            raise InputError.at(file, "", str(error), "write one result per line") from error
        except msgspec.DecodeError as error:
            raise InputError.at(file, "", f"no JSON: {error}", "was it cut short?") from error
        yield from _decoded(texts, file)
    elif _first_line_is_whole(head):
        with path.open("rb") as stream:
            yield from _decoded((line for line in stream if line.strip()), file)
    else:
        yield from _decoded(elements(path, "frames", file=file), file)


def _first_line_is_whole(head: bytes) -> bool:
    """Whether a line holds one result; results are longer than what was read of them."""
    first = head.split(b"\n", 1)[0]
    return b'"frames"' not in first and first.rstrip() != b"{"


def _decoded(texts: Iterator[bytes] | list[bytes], file: str) -> Iterator[Result]:
    for index, text in enumerate(texts):
        try:
            yield decode(text)
        except ProtocolError as error:
            raise InputError.at(file, f"result {index}", str(error)) from error


def _table(path: Path, reading: Reading) -> tuple[Array, Array, list[Finding]]:
    """Of a table as in `body_table`, with the names of landmarks or their numbers; metres unless it says."""
    table = body_table.read(path, file=reading.file, time_unit=reading.time_unit)
    columns = {_ROWS[key]: k for k, name in enumerate(table.names) if (key := plain(name)) in _ROWS}
    if len(columns) < FEWEST:
        what = f"{len(columns)} of MediaPipe's landmarks: {', '.join(table.names[:8])}"
        remedy = f"names such as {', '.join(LANDMARKS[11:14])} are expected, or numbers from 0 to 32"
        raise InputError.at(reading.file, "", what, remedy)
    if len(set(table.persons)) > 1:
        raise InputError.at(reading.file, "", "several persons", "leave one in the table")
    values = np.full((len(table.t), len(LANDMARKS), 4), np.nan)
    own = table.values[:, list(columns.values())]
    values[:, list(columns), :3] = own[..., :3] * LENGTHS[table.unit or "m"]
    values[:, list(columns), 3] = own[..., 7]
    return table.t, values, []
