"""Reads an MVNX file from front to back without ever holding it: the head once, then frame by frame.

Files of an hour have gigabytes. Only the text of elements that are asked for is kept, and only until the
element ends; a document type, entities and anything too deep, too long or without an end are refused.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree.ElementTree import ParseError

from seerob.core.errors import InputError

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
