"""Recordings of Xsens MVN in its XML format, MVNX 3 and 4.

Positions and orientations of the 23 segments, the calibration poses, the lengths of the segments. Joint
angles that the file has are compared with those of its segments: when both agree, file and reader mean the
same thing.

Files of an hour have gigabytes: one is read from front to back without ever holding it, the head once, then
frame by frame. Only the text of elements that are asked for is kept, and only until the element ends; a
document type, entities and anything too deep, too long or without an end are refused.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, ClassVar
from xml.etree.ElementTree import ParseError

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.files.bounded import regular
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, product
from seerob.description.capture.captured import Captured, CaptureFrame, Layout, Seen
from seerob.devices.capture.file_source import CaptureFile
from seerob.devices.capture.options import XSENS
from seerob.devices.capture.xsens import FROM_ANATOMICAL, anatomical, beside_arms, correction, differences
from seerob.protocols.tracking.mvn_pose import JOINTS, METRES, PARENTS, SEGMENTS, unit_of
from seerob.workstation.source import PostureError

CHUNK = 1 << 16
LONGEST = 1 << 20
"""Of the text of one element [bytes]: a frame's longest has 63 segments of four numbers."""
SILENCE = 1 << 24
"""Read without the end of a tag [bytes]."""
DEEPEST = 32
MOST = 4096
"""Points, segments, joints, sensors."""
WANTED = frozenset({"orientation", "position", "jointAngle"})
"""What is read of a frame."""


@dataclass
class Head:
    """What a file says before its frames."""

    version: str = ""
    software: str = ""
    rate: float | None = None
    configuration: str = ""
    subject: str = ""
    segments: list[str] = field(default_factory=list)
    sensors: list[str] = field(default_factory=list)
    joints: list[str] = field(default_factory=list)
    points: dict[tuple[str, str], str] = field(default_factory=dict)
    """(Segment, point) → coordinates, as text."""
    subjects: int = 0


@dataclass
class RawFrame:
    """One frame, as text."""

    attributes: dict[str, str]
    texts: dict[str, str] = field(default_factory=dict)


class _Target:
    """Called by the parser."""

    def __init__(self) -> None:
        self.head = Head()
        self.frames: deque[RawFrame] = deque()
        self.tags = 0
        self._path: list[str] = []
        self._text: list[str] | None = None
        self._length = 0
        self._frame: RawFrame | None = None
        self._segment = self._point = ""

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self.tags += 1
        name = tag.rpartition("}")[2]
        self._path.append(name)
        if len(self._path) > DEEPEST:
            raise ValueError(f"elements are nested more than {DEEPEST} deep")
        self._text = None
        if self._frame is not None:
            if name in WANTED and len(self._path) >= 2 and self._path[-2] == "frame":
                self._text, self._length = [], 0
        elif name == "frame":
            self._frame = RawFrame(attributes)
        else:
            self._begin(name, attributes)

    def _begin(self, name: str, attributes: dict[str, str]) -> None:
        head = self.head
        label = attributes.get("label", "")
        match name:
            case "mvnx":
                head.version = attributes.get("version", "")
            case "mvn":
                head.software = attributes.get("version", "")
            case "subject":
                head.subjects += 1
                head.subject, head.configuration = label, attributes.get("configuration", "")
                head.rate = _number(attributes.get("frameRate", ""))
            case "segment":
                self._segment = label
                head.segments.append(label)
            case "point":
                self._point = label
            case "sensor":
                head.sensors.append(label)
            case "joint":
                head.joints.append(label)
            case "pos_b" | "pos_s":
                self._text, self._length = [], 0
            case _:
                pass
        if max(len(head.segments), len(head.sensors), len(head.joints), len(head.points)) > MOST:
            raise ValueError(f"more than {MOST} segments, points, sensors or joints")

    def data(self, text: str) -> None:
        if self._text is not None:
            self._length += len(text)
            if self._length > LONGEST:
                raise ValueError(f"<{self._path[-1]}> has more than {LONGEST} characters")
            self._text.append(text)

    def end(self, tag: str) -> None:
        self.tags += 1
        name = self._path.pop()
        if self._text is not None:
            text, self._text = "".join(self._text), None
            if self._frame is not None:
                self._frame.texts.setdefault(name, text)
            else:
                self.head.points[self._segment, self._point] = text
        elif name == "frame" and self._frame is not None:
            self.frames.append(self._frame)
            self._frame = None

    def close(self) -> None:
        """Nothing is kept."""


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def stream(path: Path, file: str) -> Iterator[Head | RawFrame]:
    """The head as it is before the first frame, then every frame; the head alone when there is none.

    Args:
        path: The file.
        file: Its name, for messages.

    Raises:
        InputError: The file is missing, is not XML, or is more than these bounds allow.
    """
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import XMLParser

    target = _Target()
    parser: Any = XMLParser(target=target, forbid_dtd=True)
    told = False
    try:
        regular(path)
        with path.open("rb") as opened:
            for _ in _fed(opened, parser, target):
                if target.frames and not told:
                    told = True
                    yield target.head
                while target.frames:
                    yield target.frames.popleft()
        parser.close()
    except FileNotFoundError as error:
        raise InputError.at(file, "", "no such file", "give the path of an .mvnx file") from error
    except OSError as error:
        what = f"cannot be read: {error.strerror}"
        raise InputError.at(file, "", what, "give an .mvnx file that may be read") from error
    except ParseError as error:
        raise InputError.at(
            file, f"line {error.position[0]}", f"not XML: {error}", "export it again"
        ) from error
    except (DefusedXmlException, ValueError, LookupError) as error:
        raise InputError.at(file, "", str(error), "export it from MVN as MVNX") from error
    if not told:
        yield target.head


def _fed(file: BinaryIO, parser: Any, target: _Target) -> Iterator[None]:
    silent, tags = 0, 0
    while chunk := file.read(CHUNK):
        parser.feed(chunk)
        silent = 0 if target.tags != tags else silent + len(chunk)
        tags = target.tags
        if silent > SILENCE:
            raise ValueError(f"{silent} bytes without the end of an element")
        yield


_ENDS = {"Head": "pTopOfHead", "RightHand": "pRightTopOfHand", "LeftHand": "pLeftTopOfHand"}
_LIMBS = {
    "legs": tuple(f"{side}{part}" for side in ("Right", "Left") for part in ("UpperLeg", "LowerLeg", "Foot")),
    "arms": tuple(f"{side}{part}" for side in ("Right", "Left") for part in ("UpperArm", "ForeArm", "Hand")),
    "head": ("Head",),
}


def numbers(text: str, count: int) -> Array:
    """So many numbers [as written], shape (count,).

    Raises:
        ValueError: There are more or fewer, or one is none.
    """
    words = text.split()
    if len(words) != count:
        raise ValueError(f"{len(words)} numbers, {count} are expected")
    return np.array([float(word) for word in words])


def unmeasured(head: Head) -> tuple[str, ...]:
    """Segments that no sensor says anything of: they follow a neighbour stiffly."""
    sensors = set(head.sensors)
    if sensors:
        lost = {name for limb in _LIMBS.values() for name in limb if name not in sensors}
        for side in ("Right", "Left"):
            if f"{side}Foot" in lost:
                lost.add(f"{side}Toe")
        return tuple(name for name in SEGMENTS if name in lost)
    configuration = head.configuration.lower()
    if "upperbody" in configuration:
        return SEGMENTS[SEGMENTS.index("RightUpperLeg") :]
    return SEGMENTS[1 : SEGMENTS.index("RightUpperLeg")] if "lowerbody" in configuration else ()


def lengths(head: Head) -> dict[str, float]:
    """Segment lengths [m] from the points of the head: from the origin to where the next segment begins."""
    found = {}
    for name in SEGMENTS[1:]:
        following = [label for label, parent, child in JOINTS if parent == name and child[:4] != "Righ"]
        following = following or [label for label, parent, _ in JOINTS if parent == name]
        text = head.points.get((name, following[0] if following else _ENDS.get(name, "")))
        try:
            length = 0.0 if text is None else float(np.linalg.norm(numbers(text, 3)))
        except ValueError:
            continue
        if 0.0 < length < 1.0:
            found[name] = length
    return found


KEPT = 50_000
"""Frames that are kept in memory, 65 MB; a longer file is read again whenever it is needed."""
CHECKED = 200
"""Frames at most by which it is decided how segments are turned."""
TOGETHER = 512
"""Frames whose joint angles are compared at once."""
AGREE = math.radians(0.1)
"""Angles that are no further apart are the same."""
CONTRADICTION = math.radians(5.0)
"""Joint angles that are farther from those of the segments are of other segments; a choice, about as far as
MVN itself may be off."""
BESIDE = math.radians(20.0)
"""An arm's segment that points farther beside its arm has other axes; a choice, hypotheses are a quarter turn
apart."""
NO_TURN = math.radians(0.05)
"""Rounding of the numbers in a file."""
ROUNDING = 1.1e-3
"""A frame's time is written in whole milliseconds [s]."""
RATES = (1.0, 1000.0)
ARMS_DOWN = 0.7
"""Share of the way from shoulder to wrist that goes down: arms hang."""


# -- the file ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _File:
    """A file and what its head says; its frames can be iterated again and again."""

    path: Path
    name: str
    """For messages."""
    rows: NDArray[np.intp]
    """Place in the file of each of `SEGMENTS`, shape (23,)."""
    count: int
    """Segments in the file."""
    rate: float
    confidence: Array | None
    subject: str
    metres: float = 1.0
    kept: tuple[CaptureFrame, ...] | None = None
    """All frames, when they are few; else they are read anew each time."""
    turn: Array | None = None
    """Ideal segment in each of the file's, w first, shape (23, 4); None when they are the same."""

    def __iter__(self) -> Iterator[CaptureFrame]:
        if self.kept is not None:
            yield from self.kept
            return
        last = -math.inf
        for number, raw in enumerate(_motion(self.path, self.name)):
            frame = self.frame(raw, number)
            if frame is not None and frame.t > last:
                last = frame.t
                yield frame

    def frame(self, raw: RawFrame, number: int, pose: str = "") -> CaptureFrame | None:
        """One frame; None when it has no position and orientation, or others than it should."""
        try:
            p = self.metres * numbers(raw.texts["position"], 3 * self.count).reshape(-1, 3)
            q = numbers(raw.texts["orientation"], 4 * self.count).reshape(-1, 4)
        except (KeyError, ValueError):
            return None
        p, q = p[self.rows], q[self.rows]
        with np.errstate(invalid="ignore", over="ignore"):
            length = np.linalg.norm(q, axis=1)
            q = np.where(
                (np.abs(length - 1) < 0.05)[:, None], q / np.where(length == 0, 1, length)[:, None], np.nan
            )
            if self.turn is not None:
                q = product(q, self.turn)
            p = np.where((np.abs(p).max(axis=1) < 1e4)[:, None], p, np.nan)
        return CaptureFrame(
            t=self._time(raw, number),
            positions=p,
            orientations=q,
            confidence=self.confidence,
            subject=self.subject,
            pose=pose,
        )

    def _time(self, raw: RawFrame, number: int) -> float:
        """From the index when the time says the same, free of its rounding; else the time [s]."""
        by_number = number / self.rate
        try:
            by_index = int(raw.attributes.get("index", "")) / self.rate
        except ValueError:
            by_index = by_number
        try:
            time = float(raw.attributes["time"]) / 1000
        except (KeyError, ValueError):
            return by_index
        if not math.isfinite(time):
            return by_index
        return by_index if abs(by_index - time) < ROUNDING else time


def _motion(path: Path, file: str) -> Iterator[RawFrame]:
    return (item for item in stream(path, file) if isinstance(item, RawFrame) and _kind(item) == "normal")


def _kind(raw: RawFrame) -> str:
    return raw.attributes.get("type", "normal")


@dataclass
class _Survey:
    """What one reading of the whole file finds."""

    frames: int = 0
    broken: int = 0
    backward: int = 0
    first: float = 0.0
    last: float = -math.inf
    special: dict[str, CaptureFrame] = field(default_factory=dict)
    unit: str | None = None
    kept: list[CaptureFrame] | None = field(default_factory=list)
    angles: list[Array | None] = field(default_factory=list)
    """Joint angles of the frames that are kept [rad]."""
    checked: list[tuple[Array, Array, Array | None]] = field(default_factory=list)
    """Positions, orientations and joint angles of frames spread over the file."""


def read(path: Path, *, file: str = "", human: str = "") -> Captured:
    """A whole recording.

    Args:
        path: The file.
        file: Its name, for messages.
        human: Of whom nothing is within while joint angles and segments of the file contradict each other.

    Raises:
        InputError: The file is missing, is no MVNX with segments, a frame rate and frames, or its segments
            are turned in no way that is known.
    """
    name = file or str(path)
    items = stream(path, name)
    head = next(items)
    assert isinstance(head, Head)  # stream says it first
    opened = _file(path, name, head)
    found = _survey(opened, head, items)
    if not found.frames:
        what = f"{found.broken} frames of motion, none with" if found.broken else "no frame of motion with"
        what = f"{what} positions and orientations of all segments"
        raise InputError.at(name, "frames", what, 'export frames of type "normal" with both')
    if found.unit is None:
        what = "the trunk of the first frame is not as long as a person's in any unit"
        raise InputError.at(name, "position", what, "is it an export of MVN, in metres?")
    turn, turned = _turn(opened, found, human)
    metres = METRES[found.unit]
    kept = None
    if found.kept is not None:
        kept = tuple(
            replace(f, positions=metres * f.positions, orientations=_corrected(f.orientations, turn))
            for f in found.kept
        )
    scaled = replace(opened, metres=metres, turn=turn, kept=kept)
    findings = _findings(name, head, found)
    poses, more = _calibration(name, found.special, metres, turn)
    return Captured(
        layout=Layout(Seen.SEGMENTS, SEGMENTS, "xsens", PARENTS),
        frames=scaled,
        rate=opened.rate,
        count=found.frames,
        calibration=poses,
        lengths=lengths(head),
        findings=(*findings, *more, *turned),
    )


def _file(path: Path, name: str, head: Head) -> _File:
    if not head.subjects:
        raise InputError.at(name, "", "no <subject>", "is it an MVNX file, of version 3 or 4?")
    problems = []
    if head.subjects > 1:
        problems.append(Problem(name, "subject", "more than one subject", "export each person alone"))
    if head.rate is None or not RATES[0] <= head.rate <= RATES[1]:
        what = f"frameRate is {head.rate}" if head.rate is not None else "no frameRate"
        problems.append(Problem(name, "subject", what, f"{RATES[0]:g} to {RATES[1]:g} Hz"))
    if double := sorted({name for name in head.segments if head.segments.count(name) > 1}):
        problems.append(Problem(name, "segments", f"twice: {', '.join(double)[:120]}", "export it again"))
    missing = [name for name in SEGMENTS if name not in head.segments]
    if missing:
        what = f"no segment {', '.join(missing[:4])}{' …' if len(missing) > 4 else ''}"
        problems.append(Problem(name, "segments", what, "MVN's 23 segments are needed"))
    if problems:
        raise InputError(problems)
    lost = unmeasured(head)
    confidence = np.array([0.0 if name in lost else 1.0 for name in SEGMENTS]) if lost else None
    rows = np.array([head.segments.index(name) for name in SEGMENTS])
    assert head.rate is not None  # checked above
    return _File(path, name, rows, len(head.segments), head.rate, confidence, head.subject)


def _survey(file: _File, head: Head, items: Iterator[Head | RawFrame]) -> _Survey:
    found = _Survey()
    number = 0
    every = 1
    for raw in items:
        assert isinstance(raw, RawFrame)  # the head comes once
        if (kind := _kind(raw)) != "normal":
            frame = file.frame(raw, 0)
            if frame is not None:
                found.special.setdefault(kind, frame)
            continue
        frame = file.frame(raw, number)
        number += 1
        if frame is None:
            found.broken += 1
        elif frame.t <= found.last:
            found.backward += 1
        else:
            found.first = frame.t if not found.frames else found.first
            found.frames, found.last = found.frames + 1, frame.t
            found.unit = found.unit or unit_of(frame.positions)
            looked_at = found.frames % every == 0
            has_angles = len(head.joints) == len(JOINTS) and (looked_at or found.kept is not None)
            angles = _joint_angles(raw) if has_angles else None
            if found.kept is not None:
                found.kept.append(frame)
                found.angles.append(angles)
                if len(found.kept) > KEPT:
                    found.kept, found.angles = None, []
            if looked_at:
                assert frame.orientations is not None  # every frame of this format has them
                found.checked.append((frame.positions, frame.orientations, angles))
                if len(found.checked) > CHECKED:
                    found.checked, every = found.checked[::2], 2 * every
    return found


def _joint_angles(raw: RawFrame) -> Array | None:
    """[rad], shape (22, 3); None when there are none, or not so many."""
    try:
        return np.radians(numbers(raw.texts["jointAngle"], 3 * len(JOINTS)).reshape(-1, 3))
    except (KeyError, ValueError):
        return None


def _calibration(
    name: str, special: dict[str, CaptureFrame], metres: float, turn: Array | None
) -> tuple[tuple[CaptureFrame, ...], list[Finding]]:
    """Poses by what they look like: a frame that is called npose may have its arms to the sides."""
    poses, findings = [], []
    for kind in ("tpose", "npose", "identity"):
        frame = special.get(kind)
        if frame is None or (kind == "identity" and "tpose" in special):
            continue
        p = metres * frame.positions
        way = p[SEGMENTS.index("RightHand")] - p[SEGMENTS.index("RightUpperArm")]
        length = float(np.linalg.norm(way))
        seen = "npose" if length > 0 and -way[2] / length > ARMS_DOWN else "tpose"
        if kind in {"tpose", "npose"} and seen != kind:
            arms = "hanging" if seen == "npose" else "to the sides"
            text = f"its frame {kind} shows the arms {arms}: taken as {seen}"
            findings.append(Finding(level="note", subject=name, text=text))
        poses.append(
            CaptureFrame(
                t=0.0,
                positions=p,
                orientations=_corrected(frame.orientations, turn),
                confidence=frame.confidence,
                subject=frame.subject,
                pose=seen,
            )
        )
    return tuple(poses), findings


def _corrected(wxyz: Array | None, turn: Array | None) -> Array | None:
    return wxyz if wxyz is None or turn is None else product(wxyz, turn)


def _findings(name: str, head: Head, found: _Survey) -> list[Finding]:
    def say(level: str, text: str) -> Finding:
        return Finding(level=level, subject=name, text=text)

    said = [
        say(
            "note", f"MVN {head.software or 'of unknown version'}, MVNX {head.version or '?'}: {head.subject}"
        )
    ]
    if found.unit != "m":
        said.append(say("assumed", f"positions are in {found.unit}: else the trunk would not be a person's"))
    if lost := unmeasured(head):
        text = f"configuration {head.configuration or 'unknown'}: no sensor for {', '.join(lost)}"
        said.append(say("warning", f"{text}; MVN moves them stiffly with their neighbours: not measured"))
    if found.broken:
        said.append(say("warning", f"{found.broken} frames without position and orientation left out"))
    if found.backward:
        said.append(say("warning", f"{found.backward} frames that are not after the one before left out"))
    span = found.last - found.first
    expected = round(span * (head.rate or 0.0)) + 1
    if expected > found.frames + 1:
        said.append(say("warning", f"{expected - found.frames} of {expected} frames are missing"))
    if extra := [s for s in head.segments if s not in SEGMENTS]:
        said.append(say("note", f"segments that are not used: {', '.join(extra[:6])}"))
    return said


def _turn(file: _File, found: _Survey, human: str) -> tuple[Array | None, list[Finding]]:
    """What turns the file's segments into those that have the world's axes in the T-pose.

    Files differ in what a segment's axes are. Which it is the file's own joint angles say; without them the
    frames tpose and tpose-isb, if the arms' segments then lie along the arms, or the arms alone.

    Raises:
        InputError: No hypothesis fits.
    """
    name = file.name

    def say(level: str, text: str) -> Finding:
        return Finding(level=level, subject=name, text=text)

    hypotheses = _hypotheses(found.special)
    both = [(q, angles) for _, q, angles in found.checked]
    off = [_off(both, turn) for turn, _ in hypotheses]
    if not len(off[0]):
        beside = [_beside(found, turn) for turn, _ in hypotheses]
        fits = [k for k, angle in enumerate(beside) if angle < BESIDE]
        if not fits:
            what = f"the arms' segments point {_degrees(min(beside))} beside the arms, whatever their axes"
            raise InputError.at(name, "orientation", what, "is it an export of MVN? export it again")
        turn, text = hypotheses[fits[0]]
        return turn, [say("assumed", f"{text}: the arms' segments point along the arms then")]
    best = min(range(len(off)), key=lambda k: float(np.median(off[k])))
    turn, text = hypotheses[best]
    usual = float(np.median(off[best]))
    if usual > CONTRADICTION:
        what = f"its joint angles are {_degrees(usual)} from those of its segments, whatever their axes"
        raise InputError.at(name, "jointAngle", what, "was it edited? export it again, or without jointAngle")
    largest = _largest(file, found, turn)
    said = [say("note", f"{text}; its joint angles agree")]
    differ = f"its joint angles differ from those of its segments by at most {_degrees(largest)}"
    if largest <= AGREE:
        return turn, [*said, say("note", differ)]
    differ += ": it is not clear which are right; the segments are used"
    held = (human,) if human and largest > CONTRADICTION else ()
    return turn, [*said, Finding(level="warning", subject=name, text=differ, holds=held)]


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.2f}°"


def _hypotheses(special: dict[str, CaptureFrame]) -> list[tuple[Array | None, str]]:
    """What turns segments into those of the ideal T-pose, and what they are then; the likeliest first."""
    found: list[tuple[Array | None, str]] = []
    tpose, isb = (special.get(kind) for kind in ("tpose", "tpose-isb"))
    if tpose is not None and isb is not None and tpose.orientations is not None:
        assert isb.orientations is not None  # every frame of this format has them
        turn, largest = correction(tpose.orientations, isb.orientations)
        if np.isfinite(largest):
            turned = f"are turned by up to {_degrees(largest)}" if largest > NO_TURN else "are not turned"
            text = f"segments {turned}, as its tpose and tpose-isb say"
            found.append((turn if largest > NO_TURN else None, text))
    return [
        *found,
        (None, "segments have the world's axes in the T-pose"),
        (FROM_ANATOMICAL, "segments have the axes of the anatomical frames, z along an arm"),
    ]


def _largest(file: _File, found: _Survey, turn: Array | None) -> float:
    """Largest angle between joints by the file and by its segments [rad], of every frame of the motion."""
    every = _with_angles(file, found)
    largest = 0.0
    while block := list(islice(every, TOGETHER)):
        largest = max(largest, float(_off(block, turn).max(initial=0.0)))
    return largest


def _with_angles(file: _File, found: _Survey) -> Iterator[tuple[Array, Array | None]]:
    """Orientations of the segments, w first, and joint angles [rad], of every frame that has any."""
    if found.kept is not None:
        for frame, angles in zip(found.kept, found.angles, strict=True):
            if frame.orientations is not None:
                yield frame.orientations, angles
        return
    for number, raw in enumerate(_motion(file.path, file.name)):
        read_again = file.frame(raw, number)
        if read_again is not None and read_again.orientations is not None:
            yield read_again.orientations, _joint_angles(raw)


def _off(frames: Iterable[tuple[Array, Array | None]], turn: Array | None) -> Array:
    """Largest angle between joints by the file and by its segments of each frame [rad], shape (frames,).

    Args:
        frames: Orientations of the segments, w first, and joint angles [rad].
        turn: What turns them into those of the ideal T-pose.
    """
    both = [(q, angles) for q, angles in frames if angles is not None]
    if not both:
        return np.empty(0)
    q, angles = (np.stack(columns) for columns in zip(*both, strict=True))
    with np.errstate(invalid="ignore"):
        off = differences(anatomical(_every(q, turn)), angles)
    known = np.isfinite(off)
    return np.asarray(np.where(known, off, 0.0).max(axis=1)[known.any(axis=1)])


def _beside(found: _Survey, turn: Array | None) -> float:
    """Largest of the arms' segments' usual angles beside the arms [rad]; infinite when none is known."""
    p, q = (np.stack(columns) for columns in zip(*((p, q) for p, q, _ in found.checked), strict=True))
    with np.errstate(invalid="ignore"):
        angles = beside_arms(p, _every(q, turn))
    known = angles[np.isfinite(angles).all(axis=1)]
    return float(np.median(known, axis=0).max()) if len(known) else math.inf


def _every(q: Array, turn: Array | None) -> Array:
    return q if turn is None else product(q.reshape(-1, 4), np.tile(turn, (len(q), 1))).reshape(q.shape)


class Mvnx(CaptureFile, frozen=True, kw_only=True):
    """A person moved by a recording of Xsens MVN (MVNX 3 or 4)."""

    known_error: ClassVar[PostureError | None] = XSENS

    def read(self, path: Path) -> Captured:
        """The file's 23 segments, and its calibration poses."""
        found = read(path, file=self.file, human=self.human)
        first = next(iter(found.frames)).subject
        if self.subject and self.subject != first:
            raise InputError.at(self.file, "subject", f"no {self.subject!r} in it", f"it has {first!r}")
        return found
