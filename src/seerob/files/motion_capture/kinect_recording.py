"""Recordings of a depth camera: pictures, whatever file they stood in, as the recording of one person.

Azure Kinect body tracking as ``offline_processor`` writes it is one JSON object with a list of frames, of any
size: its elements are read one after the other, without holding the file. As text it is a table as in
`body_table`, in the frame of the depth camera. Bags are read in `ros_bag`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import msgspec
import numpy as np

from seerob.core.errors import InputError
from seerob.core.quantities import LENGTHS
from seerob.core.snapshot import Finding
from seerob.description.capture.captured import Captured
from seerob.files.motion_capture import body_table, persons
from seerob.files.motion_capture.body_table import BodyTable
from seerob.files.motion_capture.frame_arrays import FrameArrays, check_size, checked
from seerob.files.motion_capture.upright import kinect_upright
from seerob.files.tables.table_files import check_file
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.kinect import JOINTS, LAYOUT, Body, Picture, camera_body, decode_frame

ROWS = len(JOINTS)


@dataclass(frozen=True)
class Reading:
    """How a file of a depth camera is to be read."""

    file: str
    """What messages call it."""
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
    if frames.confidence is None:
        text = f"{reading.file}: no confidences in it: joints that the tracker only predicts count as seen"
        notes = (*notes, Finding(level="assumed", subject="", text=text))
    said = [*notes, *found, *persons.findings(follower, file=reading.file, subject="", start=start)]
    if not reading.level:
        world_from_camera, finding = kinect_upright(frames.positions, file=reading.file)
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


CHUNK = 1 << 20
MAX_ELEMENT = 4 << 20
"""Bytes of one element; more is refused."""
MAX_DEPTH = 32
_STRUCTURE = re.compile(rb'["{}\[\]]')
_STRING_END = re.compile(rb'["\\]')


def elements(path: Path, key: str, *, file: str) -> Iterator[bytes]:
    """The raw text of each object in the array that stands under ``key`` of the outermost object.

    Args:
        path: The file.
        key: Name of the array.
        file: As messages name it.

    Raises:
        InputError: It is no JSON object with such an array of objects, or an element is too large.
    """
    wanted = b'"' + key.encode() + b'"'
    scan = _Scan(wanted)
    try:
        with path.open("rb") as stream:
            while chunk := stream.read(CHUNK):
                yield from scan.feed(chunk, file)
                if scan.ended:
                    return
    except OSError as error:
        what = f"cannot be read: {error.strerror}"
        raise InputError.at(file, "", what, "give the path of the recording") from error
    if scan.begun:
        raise InputError.at(file, key, f"the file ends in element {scan.count}", "was it cut short?")
    raise InputError.at(file, key, f"no list {key!r} of objects in it", "is it the file of a body tracker?")


class _Scan:
    """Where in the structure the bytes are; text inside strings does not count."""

    def __init__(self, wanted: bytes) -> None:
        self.begun = self.ended = False
        self.count = 0
        self._wanted = wanted
        self._waiting = bytearray()
        self._at = 0
        self._depth = 0
        self._inside: int | None = None
        """Depth of the elements' own braces, once the array has begun."""
        self._start: int | None = None
        self._string: int | None = None
        self._last = b""
        """The newest string at depth 1."""
        self._last_end = 0

    def feed(self, chunk: bytes, file: str) -> Iterator[bytes]:
        """Elements that end in these bytes."""
        self._waiting += chunk
        while self._step(file):
            if self._element is not None:
                yield self._element
                self.count += 1
            if self.ended:
                return
        self._drop()
        if len(self._waiting) > MAX_ELEMENT:
            raise InputError.at(file, f"element {self.count}", f"longer than {MAX_ELEMENT} bytes")

    def _step(self, file: str) -> bool:
        """Go on to the next mark; whether there was one."""
        self._element: bytes | None = None
        if self._string is not None:
            return self._through_string()
        mark = _STRUCTURE.search(self._waiting, self._at)
        if mark is None:
            self._at = len(self._waiting)
            return False
        at, sign = mark.start(), mark[0]
        self._at = at + 1
        if sign == b'"':
            self._string = at
        elif sign in b"{[":
            self._open(at, sign, file)
        else:
            self._close(at, sign, file)
        return True

    def _through_string(self) -> bool:
        assert self._string is not None
        end = _STRING_END.search(self._waiting, self._at)
        if end is None:
            self._at = len(self._waiting)
            return False
        if end[0] == b"\\":
            if end.start() + 1 >= len(self._waiting):
                self._at = end.start()
                return False
            self._at = end.start() + 2
            return True
        if self._depth == 1:
            self._last = bytes(self._waiting[self._string : end.end()])
            self._last_end = end.end()
        self._string, self._at = None, end.end()
        return True

    def _open(self, at: int, sign: bytes, file: str) -> None:
        if self._depth == 0 and sign != b"{":
            raise InputError.at(file, "", "it does not begin with {", "is it the file of a body tracker?")
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise InputError.at(file, f"element {self.count}", f"nested deeper than {MAX_DEPTH}")
        if self._inside is None and self._depth == 2 and sign == b"[" and self._named(at):
            self.begun, self._inside = True, 3
        elif self._inside == self._depth and self._start is None:
            if sign != b"{":
                raise InputError.at(file, f"element {self.count}", "not an object")
            self._start = at

    def _named(self, at: int) -> bool:
        """Whether the array that begins here is the one that is looked for."""
        between = bytes(self._waiting[self._last_end : at])
        return self._last == self._wanted and between.strip() == b":"

    def _close(self, at: int, sign: bytes, file: str) -> None:
        self._depth -= 1
        if self._depth < 0:
            raise InputError.at(file, f"element {self.count}", f"{sign.decode()} without a beginning")
        if self._inside is None:
            return
        if self._depth == self._inside - 1 and self._start is not None:
            self._element = bytes(self._waiting[self._start : at + 1])
            self._start = None
        elif self._depth == self._inside - 2:
            self.ended = True

    def _drop(self) -> None:
        """Forget what is behind; a string or an element that goes on is kept."""
        keep = [self._at]
        keep += [x for x in (self._start, self._string) if x is not None]
        if self._depth == 1 and self._last:
            keep.append(self._last_end)
        cut = min(keep)
        del self._waiting[:cut]
        self._at -= cut
        self._last_end -= cut
        self._start = None if self._start is None else self._start - cut
        self._string = None if self._string is None else self._string - cut


def read_json(path: Path, reading: Reading) -> Captured:
    """A recording of ``offline_processor``.

    Raises:
        InputError: It is no such file, of another skeleton, or nobody says which person is meant.
    """
    check_file(path, reading.file)
    _check_names(path, reading.file)
    return recording(json_pictures(path, reading.file), reading)


def json_pictures(path: Path, file: str) -> Iterator[Picture]:
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


FEWEST = 10
"""Joints of the 32 that a table of a body tracker has at least."""


def read_text(path: Path, reading: Reading, *, unit: str = "", time_unit: str = "") -> Captured:
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
    return recording(text_pictures(table, places, LENGTHS[told]), reading, (note,))


def text_pictures(table: BodyTable, places: dict[int, int], factor: float) -> Iterator[Picture]:
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
