"""BVH files: a skeleton and its joint angles, as many capture systems and animation programs write them.

Joint centres and the turns of the bones between them. The format says neither a unit nor which way is up:
both may be given, else they are guessed from the skeleton, and said.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.description.capture.captured import Captured, CaptureFrame, Layout, Seen
from seerob.devices.capture.bvh_file import Bvh as File
from seerob.devices.capture.bvh_file import read_bvh
from seerob.devices.capture.file_source import CaptureFile
from seerob.files.motion_capture.frame_arrays import FAR

CHUNK = 256
"""Frames that are worked out together."""
LONGEST_CHAIN = (0.9, 1.9)
"""From the root to the most distant end along the bones, for adults and most skeletons [m]."""
LOOKED_AT = 200
"""Frames from which the direction up is guessed."""
CLEARLY = 1.5
"""Who extends farther along one axis by this factor is upright along it."""
HEAD, FEET = ("head", "neck"), ("foot", "ankle", "toe")
"""Parts of joints' names."""


class Unit(StrEnum):
    """Unit of the lengths in a file."""

    GUESS = "guess"
    """From the size of the skeleton."""
    M = "m"
    CM = "cm"
    MM = "mm"
    INCH = "in"
    CMU = "cmu"
    """Unit of the CMU motion capture database and what was made of it: 1/0.45 inch."""


METRES = {Unit.M: 1.0, Unit.CM: 0.01, Unit.MM: 0.001, Unit.INCH: 0.0254, Unit.CMU: 0.0254 / 0.45}
"""Metres per unit."""


class Up(StrEnum):
    """Axis of the file that points up."""

    GUESS = "guess"
    """From the person, who mostly is upright."""
    Y = "y"
    Z = "z"


def chain(file: File) -> float:
    """From the root to the most distant end along the bones, in the file's unit."""
    reach: list[float] = []
    for joint in file.joints:
        length = float(np.linalg.norm(joint.offset)) if joint.parent >= 0 else 0.0
        reach.append(length + (reach[joint.parent] if joint.parent >= 0 else 0.0))
    return max(reach)


def guess_unit(length: float) -> Unit | None:
    """The unit in which a chain of bones is as long as a person's; None when in none."""
    low, high = LONGEST_CHAIN
    return next((unit for unit, metres in METRES.items() if low <= metres * length <= high), None)


def guess_up(file: File) -> tuple[Up, bool]:
    """The axis along which the person mostly extends from the feet to the head, and whether that is clear.

    Where no joint is called so, the axis along which the whole skeleton is longest.
    """
    step = max(1, len(file.values) // LOOKED_AT)
    positions, _ = file.poses(slice(0, None, step))
    rows = [
        [k for k, joint in enumerate(file.joints) if any(word in joint.name.lower() for word in words)]
        for words in (HEAD, FEET)
    ]
    if all(rows):
        head, feet = (positions[:, own].mean(axis=1) for own in rows)
        spread = np.nanmedian(np.abs(head - feet), axis=0)
    else:
        spread = np.nanmedian(np.ptp(positions, axis=1), axis=0)
    y, z = float(spread[1]), float(spread[2])
    return (Up.Z if z > y else Up.Y), max(y, z) > CLEARLY * min(y, z)


@dataclass(frozen=True, eq=False)
class _Frames:
    """Can be iterated again and again; a chunk at a time is in memory."""

    file: File
    metres: float
    up: Up

    def __iter__(self) -> Iterator[CaptureFrame]:
        whole = self.file.whole()
        for start in range(0, len(whole), CHUNK):
            positions, turns = self.file.poses(slice(start, start + CHUNK))
            positions = self.metres * positions
            if self.up is Up.Y:  # who looks along z there looks along x here
                positions, turns = positions[..., [2, 0, 1]], turns[..., [0, 3, 1, 2]]
            for k, (p, q) in enumerate(zip(positions, turns, strict=True), start):
                if whole[k]:
                    yield CaptureFrame(t=k * self.file.period, positions=p, orientations=q)


def read(path: Path, *, unit: Unit = Unit.GUESS, up: Up = Up.GUESS, file: str = "") -> Captured:
    """A whole recording.

    Args:
        path: The file.
        unit: Of its lengths.
        up: Its axis that points up.
        file: Its name, for messages.

    Raises:
        InputError: The file is missing or wrong, or no unit makes a person of it.
    """
    name = file or str(path)
    found = read_bvh(path, name)

    def say(level: str, text: str) -> Finding:
        return Finding(level=level, subject=name, text=text)

    said: list[Finding] = []
    length = chain(found)
    guessed = guess_unit(length)
    if unit is Unit.GUESS:
        if guessed is None:
            what = (
                f"the longest chain of bones is {length:g} long, which is a person's in no unit that is known"
            )
            raise InputError.at(name, "unit", what, 'give unit = "m", "cm", "mm", "in" or "cmu"')
        unit = guessed
        text = f"unit {unit} assumed: the longest chain of bones is {METRES[unit] * length:.2f} m then"
        said.append(say("assumed", text))
    elif guessed is not None and guessed is not unit:
        text = f"in {unit} the longest chain of bones is {METRES[unit] * length:.3g} m"
        said.append(say("warning", f"{text}; in {guessed} it is a person's"))
    if (far := found.shifted_beyond(FAR / METRES[unit])).any():
        found.values[far] = np.nan
        if not found.whole().any():
            what = f"every frame shifts joints by more than {FAR:g} m"
            raise InputError.at(name, "unit", what, "is the unit right?")
        said.append(say("warning", f"{far.sum()} frames that shift joints by more than {FAR:g} m left out"))
    if up is Up.GUESS:
        up, clear = guess_up(found)
        text = f"{up} is taken as up: " + (
            "the person extends along it" if clear else "it is not clear which is"
        )
        said.append(say("assumed" if clear else "warning", text))
    if found.broken:
        said.append(say("warning", f"{found.broken} frames are no rows of numbers and left out"))
    if len(found.values) < found.stated:
        said.append(say("warning", f"{len(found.values)} frames are there, {found.stated} are announced"))
    if found.more:
        said.append(say("warning", f"{found.more} rows after the announced {found.stated} frames left out"))
    if moved := [j.name for j in found.joints if j.parent >= 0 and j.translations]:
        shown = ", ".join(moved[:4]) + (" …" if len(moved) > 4 else "")
        said.append(say("note", f"joints that also shift: {shown}; their channels replace the OFFSET"))
    if np.any(found.joints[0].offset):
        said.append(say("assumed", "the root's position is that of its channels, its OFFSET is not added"))
    placed = len(found.joints[0].translations) == 3
    if not placed:
        said.append(say("warning", "its root has no position channels: nobody says where the person stands"))
    names = tuple(joint.name for joint in found.joints)
    parents = tuple(joint.parent for joint in found.joints)
    return Captured(
        layout=Layout(Seen.JOINTS, names, "", parents),
        frames=_Frames(found, METRES[unit], up),
        rate=1 / found.period,
        count=int(found.whole().sum()),
        placed=placed,
        lengths=_lengths(found, METRES[unit]),
        findings=tuple(said),
    )


def _lengths(file: File, metres: float) -> dict[str, float]:
    """Of the bones that have one other end."""
    lengths: dict[str, list[float]] = {}
    for joint in file.joints:
        if joint.parent >= 0 and not joint.translations:
            lengths.setdefault(file.joints[joint.parent].name, []).append(float(np.linalg.norm(joint.offset)))
    return {name: metres * own[0] for name, own in lengths.items() if len(own) == 1 and own[0] > 0}


class Bvh(CaptureFile, frozen=True, kw_only=True):
    """A person moved by a BVH file."""

    unit: Unit = Unit.GUESS
    """Unit of the lengths: ``m``, ``cm``, ``mm``, ``in``, ``cmu`` (1/0.45 inch), or guessed from the
    skeleton."""
    up: Up = Up.GUESS
    """Its axis that points up: ``y``, ``z``, or guessed from the person."""

    def read(self, path: Path) -> Captured:
        """The file's skeleton and its frames."""
        return read(path, unit=self.unit, up=self.up, file=self.file)
