"""From pictures of a depth camera, whatever file they stood in, to the recording of one person."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.description.capture.captured import Captured
from seerob.files.motion_capture import persons
from seerob.files.motion_capture.frame_arrays import FrameArrays, check_size, checked
from seerob.files.motion_capture.upright import camera_upright
from seerob.protocols.tracking.kinect import JOINTS, LAYOUT, Body, Picture

ROWS = len(JOINTS)


@dataclass(frozen=True)
class Reading:
    """How a file of a depth camera is to be read."""

    file: str
    """As messages name it."""
    subject: str = ""
    """The tracker's numbers of the person, ``1, 5``; empty when there is only one."""
    level: bool = False
    """Whether the pose of the camera is known: positions then stay in its own frame."""


def recording(pictures: Iterable[Picture], reading: Reading, notes: tuple[Finding, ...] = ()) -> Captured:
    """One person's recording.

    Args:
        pictures: From the first to the last; read once.
        reading: How.
        notes: What is to be said of the file.

    Returns:
        Joints in metres. With ``reading.level`` in the frame of the camera, x forward, y left, z up; else
        turned upright by what is seen, with the floor at 0 and the camera above the origin.

    Raises:
        InputError: Nobody in it, several persons and nobody said which, or a file that is wrong.
    """
    kept = _bounded(pictures, reading)
    start = kept[0].t
    follower = persons.Follower(reading.subject)
    chosen = [follower.choose(picture) for picture in kept]
    frames, rate, found = checked(_arrays(kept, chosen), file=reading.file, subject="")
    said = [*notes, *found, *persons.findings(follower, file=reading.file, subject="", start=start)]
    if not reading.level:
        world_from_camera, finding = camera_upright(frames.positions, file=reading.file)
        frames, said = frames.turned(world_from_camera), [*said, finding]
    return Captured(layout=LAYOUT, frames=frames, rate=rate, count=len(frames), findings=tuple(said))


def _bounded(pictures: Iterable[Picture], reading: Reading) -> list[Picture]:
    """All pictures; asks who is meant when that is not clear."""
    kept: list[Picture] = []
    seen: dict[int, tuple[int, float, float]] = {}
    together, bodies = False, 0
    for picture in pictures:
        kept.append(picture)
        bodies += max(1, len(picture.bodies))
        check_size(reading.file, bodies, ROWS * 8)
        together |= len(picture.bodies) > 1
        since = picture.t - kept[0].t
        for body in picture.bodies:
            n, first, _ = seen.get(body.id, (0, since, 0.0))
            seen[body.id] = (n + 1, first, since)
    if not kept:
        raise InputError.at(reading.file, "", "no picture in it")
    persons.check_one(seen, together=together, subject=reading.subject, file=reading.file)
    return kept


def _arrays(pictures: list[Picture], chosen: list[Body | None]) -> FrameArrays:
    table = np.full((len(pictures), ROWS, 8), np.nan)
    # Who is not seen keeps the number: losing sight is no change of person.
    label = next((str(body.id) for body in chosen if body is not None), "")
    subjects = []
    turns = confidence = False
    for row, body in zip(table, chosen, strict=True):
        if body is not None:
            label, row[:, :3] = str(body.id), body.positions
            if body.orientations is not None:
                row[:, 3:7], turns = body.orientations, True
            if body.confidence is not None:
                row[:, 7], confidence = body.confidence, True
        subjects.append(label)
    return FrameArrays(
        t=np.array([picture.t for picture in pictures]),
        positions=table[..., :3],
        orientations=table[..., 3:7] if turns else None,
        confidence=table[..., 7] if confidence else None,
        subjects=subjects,
    )
