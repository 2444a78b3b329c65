"""BVH files: a skeleton and its joint angles, as many capture systems and animation programs write them.

A file is a tree of joints, then a table of channels; what is made of it is where every joint is for a row,
and the turns of the bones between them. The format says neither a unit nor which way is up: both may be
given, else they are guessed from the skeleton, and said.

Biovision's format has no standard. What is taken here: rotations are intrinsic in the order of the channels
[deg]; a position channel replaces that component of the joint's OFFSET, of the root and of any other joint.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.files.bounded import regular
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, about, cross, product
from seerob.description.capture.captured import Captured, CaptureFrame, Layout, Seen
from seerob.devices.capture.file_source import CaptureFile
from seerob.files.motion_capture.frame_arrays import FAR

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
class BvhFile:
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


def read_bvh(path: Path, file: str) -> BvhFile:
    """A whole file.

    Args:
        path: The file.
        file: Its name, for messages.

    Raises:
        InputError: It is missing, or is not BVH with one root and at least one frame.
    """
    try:
        regular(path)
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


def _motion(reader: _Reader, joints: list[Joint], channels: int, size: int) -> BvhFile:
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
    return BvhFile(tuple(joints), period, values[:row], stated, broken, more)


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


CHUNK = 256
"""Frames that are worked out together."""
LONGEST_CHAIN = (0.9, 1.9)
"""From the root to the most distant end along the bones, for adults and most skeletons [m]."""
LOOKED_AT = 200
"""Frames from which the direction up is guessed."""
CLEARLY = 1.5
"""Who extends farther along one axis by this factor is upright along it."""
SHIFTING = 0.02
"""Share of the longest chain; joints that shift by less are where their OFFSET has them."""
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


def chain(file: BvhFile) -> float:
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


def guess_up(file: BvhFile) -> tuple[Up, bool]:
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


def _turned_up(positions: Array, turns: Array, up: Up) -> tuple[Array, Array]:
    """Into axes with z up: who looks along z in a file with y up looks along x here."""
    return (positions[..., [2, 0, 1]], turns[..., [0, 3, 1, 2]]) if up is Up.Y else (positions, turns)


def shifting(file: BvhFile) -> list[str]:
    """Joints, but the root, whose channels of position put them farther from their OFFSET than `SHIFTING`."""
    far = SHIFTING * chain(file)
    return [
        joint.name
        for joint in file.joints
        if joint.parent >= 0
        and any(
            np.nanmax(np.abs(file.values[:, k] - joint.offset[axis])) > far for axis, k in joint.translations
        )
    ]


@dataclass(frozen=True, eq=False)
class _Frames:
    """Can be iterated again and again; a chunk at a time is in memory."""

    file: BvhFile
    metres: float
    up: Up

    def __iter__(self) -> Iterator[CaptureFrame]:
        whole = self.file.whole()
        for start in range(0, len(whole), CHUNK):
            positions, turns = self.file.poses(slice(start, start + CHUNK))
            positions, turns = _turned_up(self.metres * positions, turns, self.up)
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
        joints_known=False,
        rest=None if shifting(found) else _rest(found, METRES[unit], up),
        lengths=_lengths(found, METRES[unit]),
        findings=tuple(said),
    )


def _rest(file: BvhFile, metres: float, up: Up) -> CaptureFrame:
    """The skeleton with nothing turned."""
    values = np.zeros((1, file.values.shape[1]))
    for joint in file.joints:
        for axis, column in joint.translations:
            values[0, column] = joint.offset[axis]
    positions, turns = replace(file, values=values).poses(slice(0, 1))
    positions, turns = _turned_up(metres * positions[0], turns[0], up)
    return CaptureFrame(t=0.0, positions=positions, orientations=turns, pose="rest")


def _lengths(file: BvhFile, metres: float) -> dict[str, float]:
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
