"""Reads BVH: a tree of joints, then a table of channels, and where every joint is for a row of it.

Biovision's format has no standard. What is taken here: rotations are intrinsic in the order of the channels
[deg]; a position channel replaces that component of the joint's OFFSET, of the root and of any other joint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.orientation import about, cross, product
from seerob.core.transforms import Array

MOST_JOINTS = 1000
DEEPEST = 200
LONGEST_LINE = 1 << 20
"""[characters]"""
MOST_VALUES = 500_000_000
"""Of the whole table: 4 GB."""
PERIODS = (1e-4, 1.0)
"""Plausible frame times [s]."""
FARTHEST = 1e9
_AXES = {"x": 0, "y": 1, "z": 2}


@dataclass
class Joint:
    """One joint, or the end of a chain."""

    name: str
    parent: int
    """Index, -1 for the root."""
    offset: Array
    """From the parent's joint, in its frame, in the unit of the file."""
    translations: tuple[tuple[int, int], ...] = ()
    """(Axis, column) of position channels."""
    rotations: tuple[tuple[str, int], ...] = ()
    """(Axis, column) of rotation channels, in their order."""
    end: bool = False


@dataclass(frozen=True, eq=False)
class Bvh:
    """A file."""

    joints: tuple[Joint, ...]
    """Parents first."""
    period: float
    """Between two frames [s]."""
    values: Array
    """Channels as written, shape (frames, channels); NaN in rows that could not be read."""
    stated: int
    """Number of frames that the file says it has."""
    broken: int
    """Rows that could not be read."""
    more: int
    """Rows after the stated number, left out."""

    def whole(self) -> NDArray[np.bool_]:
        """Rows that could be read, shape (frames,)."""
        return np.asarray(np.isfinite(self.values).all(axis=1))

    def shifted_beyond(self, far: float) -> NDArray[np.bool_]:
        """Rows whose position channels are more than ``far`` together [unit of the file], shape (frames,)."""
        columns = [column for joint in self.joints for _, column in joint.translations]
        return np.asarray(np.abs(self.values[:, columns]).sum(axis=1) > far)

    def poses(self, rows: slice) -> tuple[Array, Array]:
        """Where the joints are, in the file's unit and axes.

        Returns:
            Positions, shape (n, joints, 3), and world from joint, w first, shape (n, joints, 4); NaN for
            the orientation of ends.
        """
        values = self.values[rows]
        n = len(values)
        positions, turns = np.empty((len(self.joints), n, 3)), np.empty((len(self.joints), n, 4))
        for k, joint in enumerate(self.joints):
            offset = np.repeat(joint.offset[None], n, axis=0)
            for axis, column in joint.translations:
                offset[:, axis] = values[:, column]
            turn = np.repeat(np.array([[1.0, 0.0, 0.0, 0.0]]), n, axis=0)
            for axis_name, column in joint.rotations:
                turn = product(turn, about(axis_name, np.radians(values[:, column])))
            if joint.parent < 0:
                positions[k], turns[k] = offset, turn
            else:
                base = turns[joint.parent]
                arm = 2 * cross(base[:, 1:], offset)
                positions[k] = positions[joint.parent] + offset + base[:, :1] * arm + cross(base[:, 1:], arm)
                turns[k] = product(base, turn)
        for k, joint in enumerate(self.joints):
            if joint.end:
                turns[k] = np.nan
        return np.swapaxes(positions, 0, 1), np.swapaxes(turns, 0, 1)


class _Reader:
    """Line by line, with the number of the line for messages."""

    def __init__(self, text: TextIO, file: str) -> None:
        self._text, self.file, self.number = text, file, 0
        self._held: list[str] = []

    def line(self) -> str:
        """The next line that is not empty, a brace always alone.

        Raises:
            InputError: The file ends, or the line does not.
        """
        while not self._held:
            raw = self.raw()
            if raw is None:
                raise self.wrong("the file ends before its motion", "export it again")
            parts = raw.replace("{", "\n{\n").replace("}", "\n}\n").split("\n")
            self._held = [part.strip() for part in parts if part.strip()]
        return self._held.pop(0)

    def raw(self) -> str | None:
        """The next line; None at the end of the file."""
        raw = self._text.readline(LONGEST_LINE)
        self.number += 1
        if len(raw) >= LONGEST_LINE:
            raise self.wrong(f"more than {LONGEST_LINE} characters", "is it a BVH file?")
        return raw or None

    def wrong(self, what: str, remedy: str = "") -> InputError:
        return InputError.at(self.file, f"line {self.number}", what, remedy)


def read_bvh(path: Path, file: str) -> Bvh:
    """A whole file.

    Args:
        path: The file.
        file: Its name, for messages.

    Raises:
        InputError: It is missing, or is not BVH with one root and at least one frame.
    """
    try:
        with path.open(encoding="utf-8", errors="replace") as text:
            reader = _Reader(text, file)
            joints, channels = _hierarchy(reader)
            return _motion(reader, joints, channels, path.stat().st_size)
    except FileNotFoundError as error:
        raise InputError.at(file, "", "no such file", "give the path of a .bvh file") from error
    except OSError as error:
        what = f"cannot be read: {error.strerror}"
        raise InputError.at(file, "", what, "give a .bvh file that may be read") from error


def _hierarchy(reader: _Reader) -> tuple[list[Joint], int]:
    if reader.line().upper() != "HIERARCHY":
        raise reader.wrong("a BVH file begins with HIERARCHY", "is it one?")
    joints: list[Joint] = []
    names: set[str] = set()
    open_joints: list[int] = []
    channels = 0
    pending: Joint | None = None
    while True:
        words = reader.line().split()
        keyword = words[0].upper()
        if pending is not None and keyword != "{":
            raise reader.wrong(f"{{ is expected after {pending.name!r}")
        if keyword == "{":
            if pending is None:
                raise reader.wrong("a { without a joint")
            open_joints.append(len(joints))
            joints.append(pending)
            pending = None
            if len(joints) > MOST_JOINTS or len(open_joints) > DEEPEST:
                raise reader.wrong(f"more than {MOST_JOINTS} joints, or {DEEPEST} one in another")
        elif keyword in {"ROOT", "JOINT", "END"}:
            pending = _joint(reader, words, joints, open_joints, names)
        elif keyword == "}":
            if not open_joints:
                raise reader.wrong("a } too many")
            open_joints.pop()
        elif keyword == "OFFSET" and open_joints:
            joints[open_joints[-1]].offset = _offset(reader, words)
        elif keyword == "CHANNELS" and open_joints:
            channels = _channels(reader, words, joints[open_joints[-1]], channels)
        elif keyword == "MOTION":
            if open_joints or not joints:
                raise reader.wrong("MOTION before the hierarchy is closed" if joints else "no ROOT")
            return joints, channels
        else:
            raise reader.wrong(f"{' '.join(words)[:60]!r} is not understood here")


def _joint(
    reader: _Reader, words: list[str], joints: list[Joint], open_joints: list[int], names: set[str]
) -> Joint:
    keyword, name = words[0].upper(), " ".join(words[1:])
    if keyword == "ROOT" and joints:
        raise reader.wrong(f"a second root, {name!r}", "give each person a file of its own")
    if keyword != "ROOT" and not open_joints:
        raise reader.wrong(f"{name!r} is in no joint", "every joint but ROOT is inside another")
    parent = open_joints[-1] if open_joints else -1
    if keyword == "END":
        number = sum(j.end and j.parent == parent for j in joints)
        name = f"{joints[parent].name} end" + (f" {number + 1}" if number else "")
    if not name or name in names:
        raise reader.wrong(f"a second joint {name!r}" if name else "a joint without a name", "name each once")
    names.add(name)
    return Joint(name, parent, np.zeros(3), end=keyword == "END")


def _offset(reader: _Reader, words: list[str]) -> Array:
    try:
        found = np.array(words[1:], float)
    except ValueError:
        found = np.empty(0)
    if found.shape != (3,) or not (np.abs(found) < FARTHEST).all():
        raise reader.wrong(f"{' '.join(words)[:60]!r}", "OFFSET and three numbers")
    return found


def _channels(reader: _Reader, words: list[str], joint: Joint, first: int) -> int:
    """Sets the joint's channels; the number of channels so far."""
    names = words[2:]
    if joint.end or joint.translations or joint.rotations:
        raise reader.wrong(f"{joint.name!r} has CHANNELS {'already' if not joint.end else 'at its end'}")
    if len(words) < 2 or words[1] != str(len(names)) or len(names) > 6:
        raise reader.wrong(f"{' '.join(words)[:80]!r}", "CHANNELS, how many, and as many names, six at most")
    translations, rotations = [], []
    for k, name in enumerate(names):
        axis, what = name[:1].lower(), name[1:].lower()
        if axis not in _AXES or what not in {"position", "rotation"}:
            raise reader.wrong(f"channel {name[:30]!r}", "Xposition … Zrotation are known")
        if what == "position":
            translations.append((_AXES[axis], first + k))
        else:
            rotations.append((axis, first + k))
    if len({axis for axis, _ in translations}) != len(translations):
        raise reader.wrong(f"{joint.name!r} has a position channel twice")
    joint.translations, joint.rotations = tuple(translations), tuple(rotations)
    return first + len(names)


def _motion(reader: _Reader, joints: list[Joint], channels: int, size: int) -> Bvh:
    frames = _after(reader, "FRAMES:")
    period = _after(reader, "FRAME TIME:")
    if not frames.is_integer() or frames < 1:
        raise reader.wrong(f"{frames:g} frames", "at least one is needed")
    if not PERIODS[0] <= period <= PERIODS[1]:
        raise reader.wrong(
            f"a frame time of {period:g} s", f"{PERIODS[0]:g} to {PERIODS[1]:g} s are plausible"
        )
    if not channels:
        raise reader.wrong("no joint has channels: nothing moves")
    stated = int(frames)
    # Two characters at least per value: a number of frames that cannot be there takes no memory.
    possible = min(stated, size // (2 * channels) + 1)
    if possible * channels > MOST_VALUES:
        raise reader.wrong(f"{stated} frames of {channels} channels", f"{MOST_VALUES} values at most")
    values = np.full((possible, channels), np.nan)
    row = broken = more = 0
    while (raw := reader.raw()) is not None:
        words = raw.split()
        if not words:
            continue
        if row >= stated or row >= possible:
            more += 1
            continue
        broken += not _row(values[row], words)
        row += 1
    if row == broken:
        raise reader.wrong("no frame can be read", f"a row of {channels} numbers per frame is needed")
    return Bvh(tuple(joints), period, values[:row], stated, broken, more)


def _row(into: Array, words: list[str]) -> bool:
    """Puts one row in its place; whether it is whole."""
    if len(words) != len(into):
        return False
    try:
        found = np.array([float(word) for word in words])
    except ValueError:
        return False
    if not (np.abs(found) < FARTHEST).all():
        return False
    into[:] = found
    return True


def _after(reader: _Reader, keyword: str) -> float:
    line = reader.line()
    words = " ".join(line.replace(":", ": ").split())
    if not words.upper().startswith(keyword):
        raise reader.wrong(f"{line[:40]!r} where {keyword} is expected")
    try:
        value = float(words[len(keyword) :])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise reader.wrong(f"{line[:40]!r}", f"{keyword} and a number")
    return value
