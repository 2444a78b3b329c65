"""Azure Kinect body tracking as ``offline_processor`` writes it: one JSON object with a list of frames."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec

from seerob.core.errors import InputError
from seerob.description.capture.captured import Captured
from seerob.files.motion_capture.json_array import MAX_ELEMENT, elements
from seerob.files.motion_capture.kinect_recording import Reading, recording
from seerob.files.tables.text import check_file
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.kinect import JOINTS, Picture, decode_frame


def read(path: Path, reading: Reading) -> Captured:
    """A recording of ``offline_processor``.

    Raises:
        InputError: It is no such file, of another skeleton, or nobody says which person is meant.
    """
    check_file(path, reading.file)
    _check_names(path, reading.file)
    return recording(pictures(path, reading.file), reading)


def pictures(path: Path, file: str) -> Iterator[Picture]:
    """Every frame, one after the other.

    Raises:
        InputError: A frame that cannot be read; names it.
    """
    for index, data in enumerate(elements(path, "frames", file=file)):
        try:
            yield decode_frame(data)
        except ProtocolError as error:
            raise InputError.at(file, f"frames[{index}]", str(error), "is it cut or edited?") from error


def _check_names(path: Path, file: str) -> None:
    """Refuse another skeleton; the list of names stands behind the frames, or before."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(MAX_ELEMENT)
        stream.seek(max(0, size - MAX_ELEMENT))
        tail = stream.read(MAX_ELEMENT)
    for text in (tail, head):
        at = text.rfind(b'"joint_names"')
        if at < 0:
            continue
        start, end = text.find(b"[", at), text.find(b"]", at)
        if start < 0 or end < 0:
            continue
        try:
            names = msgspec.json.decode(text[start : end + 1], type=list[str])
        except (msgspec.DecodeError, UnicodeDecodeError):
            continue
        plain = tuple(name.upper().replace(" ", "_") for name in names)
        if plain != JOINTS:
            what = f"{len(names)} joints: {', '.join(names)[:80]}"
            raise InputError.at(file, "joint_names", what, f"the {len(JOINTS)} of Azure Kinect are expected")
        return
