"""Xsens MVN's network stream: one datagram in, numbers out, back for the emulator, and samples made whole.

MVN real-time network streaming protocol specification, MV0305P revision N (2018). Big-endian; a header of 24
bytes, then items of one size per kind. Values stay as they are on the wire, in degrees and in centimetres or
metres: `seerob.protocols.tracking.mvn_pose` turns them into a person.

The parts of a sample may come split, swapped, doubled, late or not at all. Per character and kind the newest
sample wins. A part of an older one may still come; what is older than the last whole sample is late and
dropped, and so is, as lost, what stays in pieces. A counter that goes far back is a recording that began
anew.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.protocols import ProtocolError
from seerob.protocols.links.datagrams import distrust

PORT = 9763
LARGEST = 1 << 16
"""Bytes; the payload's size has 16 bits, UDP does not carry more."""
LAST = 0x80


class Kind(IntEnum):
    """What a datagram holds, §2.4.1.1."""

    EULER = 1
    """Position and Euler angles of the segments; y up."""
    QUATERNION = 2
    """Position and quaternion of the segments; z up, or y up when MVN is set so."""
    POINTS = 3
    UNITY = 5
    """Quaternions against the parent, y up, left-handed."""
    META = 12
    SCALE = 13
    """The person in an ideal T-pose: where segments and points are."""
    ANGLES = 20
    """Joint angles [deg]."""
    LINEAR = 21
    ANGULAR = 22
    TRACKERS = 23
    MASS_CENTER = 24
    TIME_CODE = 25


LAYOUTS: dict[Kind, tuple[int, int]] = {
    Kind.EULER: (1, 6),
    Kind.QUATERNION: (1, 7),
    Kind.POINTS: (1, 3),
    Kind.UNITY: (1, 7),
    Kind.ANGLES: (2, 3),
    Kind.LINEAR: (1, 9),
    Kind.ANGULAR: (1, 10),
    Kind.TRACKERS: (1, 10),
}
"""Integers (identifiers) and floats per item, four bytes each."""
_SIZES = {kind: 4 * (integers + floats) for kind, (integers, floats) in LAYOUTS.items()}
_KINDS = {b"MXTP%02d" % kind: kind for kind in Kind}
_HEADER = struct.Struct(">6sIBBIBBBB2xH")
HEADER = _HEADER.size


class Header(NamedTuple):
    """What every datagram begins with, §2.4.1."""

    kind: Kind | None
    """None for one that is not in the specification."""
    sample: int
    """Counts the instants; may skip."""
    part: int
    """Which part of the sample this is, from 0."""
    last: bool
    """No part comes after it."""
    items: int
    time_code: int
    """Since the start of the recording [ms]."""
    character: int
    segments: int = 0
    """0 from versions before 2019, as are the next two."""
    props: int = 0
    fingers: int = 0


@dataclass(frozen=True, eq=False, slots=True)
class Items:
    """A datagram of numbers: kinds 01 to 05 and 20 to 24."""

    header: Header
    ids: NDArray[np.int32]
    """Identifiers, shape (n,); of joints (parent, child), shape (n, 2); of the centre of mass 0."""
    values: NDArray[np.floating]
    """Numbers of the wire, shape (n, k); `numbers` makes them floats to reckon with."""

    def numbers(self) -> Array:
        """The values, shape (n, k)."""
        with np.errstate(invalid="ignore"):  # a signalling NaN is one more NaN
            return self.values.astype(np.float64)


@dataclass(frozen=True, slots=True)
class Tags:
    """Kind 12: what is said of a character."""

    header: Header
    tags: Mapping[str, str]


class ScalePoint(NamedTuple):
    """One point of a segment in the T-pose."""

    segment: int
    point: int
    name: str
    flags: int
    position: tuple[float, float, float]
    """Against the origin of its segment."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Kind 13: segments' origins in the ideal T-pose, or some of the points, z up."""

    header: Header
    segments: tuple[tuple[str, tuple[float, float, float]], ...]
    points: tuple[ScalePoint, ...]


@dataclass(frozen=True, slots=True)
class TimeCode:
    """Kind 25."""

    header: Header
    seconds: float
    """Since midnight [s]."""


@dataclass(frozen=True, slots=True)
class Skipped:
    """A kind that this reader does not know: its size is known, so it does no harm."""

    header: Header


Datagram = Items | Tags | Scale | TimeCode | Skipped


# -- in ------------------------------------------------------------------------------------------


def decode(data: bytes) -> Datagram:
    """One whole datagram.

    Values may be NaN or infinite: a segment that MVN has lost is the affair of who uses it.

    Raises:
        ProtocolError: It is not one of MVN's, or cut short, or contradicts itself.
    """
    header, size = _header(data)
    if len(data) < HEADER + size:
        raise ProtocolError(f"MVN datagram cut short: {len(data)} of {HEADER + size} bytes")
    kind = header.kind
    item = _SIZES.get(kind) if kind is not None else None
    if item is not None and kind is not None:
        integers, floats = LAYOUTS[kind]
        count, rest = divmod(size, item)
        if rest:
            raise ProtocolError(f"MVN datagram {kind:02d}: {size} bytes are no multiple of {item} per item")
        table = np.frombuffer(data, ">i4", count * (integers + floats), HEADER)
        table = table.reshape(count, integers + floats)
        ids = table[:, 0] if integers == 1 else table[:, :integers]
        return Items(header, ids, table[:, integers:].view(">f4"))
    payload = data[HEADER : HEADER + size]
    if kind is Kind.META:
        return Tags(header, _tags(payload))
    if kind is Kind.SCALE:
        return _scale(header, payload)
    if kind is Kind.MASS_CENTER:
        if size not in {12, 36}:  # later versions add velocity and acceleration
            raise ProtocolError(
                f"MVN datagram 24: {size} bytes are neither a position nor one with its rates"
            )
        values = np.frombuffer(payload, ">f4")[None]
        return Items(header, np.zeros(1, np.int32), values)
    if kind is Kind.TIME_CODE:
        return TimeCode(header, _time_code(payload))
    return Skipped(header)


def _header(data: bytes) -> tuple[Header, int]:
    """The header, and the size of what follows it."""
    if len(data) < HEADER:
        raise ProtocolError(f"not an MVN datagram: {len(data)} bytes, the header alone has {HEADER}")
    name, sample, counter, items, time_code, who, segments, props, fingers, size = _HEADER.unpack_from(data)
    kind = _KINDS.get(name)
    if kind is None and not (name.startswith(b"MXTP") and name[4:].isdigit()):
        raise ProtocolError(f"not an MVN datagram: it begins with {name[:6]!r}, not with MXTP and two digits")
    # Versions before 2019 may leave these bytes at 0: then a datagram is as long as it is.
    size = size or len(data) - HEADER
    last = counter >= LAST
    return Header(kind, sample, counter & 0x7F, last, items, time_code, who, segments, props, fingers), size


def _tags(payload: bytes) -> dict[str, str]:
    """``name:``, ``xmid:``, ``color:`` and whatever else is said, a line each (§2.6.1)."""
    found = {}
    if len(payload) >= 4 and struct.unpack_from(">I", payload)[0] == len(payload) - 4:
        payload = payload[4:]  # sent as a string with its length before it (§2.5.12)
    for line in payload.decode("utf-8", "replace").rstrip("\0").split("\n"):
        tag, colon, value = line.partition(":")
        if colon:
            found[tag.strip()] = value.strip()
    return found


class _Cursor:
    """Reads on through a payload whose strings have a length each."""

    def __init__(self, payload: bytes) -> None:
        self._payload, self._at = payload, 0

    def take(self, layout: str) -> tuple[int | float, ...]:
        size = struct.calcsize(layout)
        if self._at + size > len(self._payload):
            raise ProtocolError("MVN datagram 13: ends in the middle of an item")
        self._at += size
        return struct.unpack_from(layout, self._payload, self._at - size)

    def text(self) -> str:
        length = int(self.take(">i")[0])
        if not 0 <= length <= len(self._payload) - self._at:
            raise ProtocolError(f"MVN datagram 13: a name of {length} bytes does not fit")
        self._at += length
        return self._payload[self._at - length : self._at].decode("utf-8", "replace")

    def count(self, smallest: int) -> int:
        """How many items follow, of at least so many bytes each."""
        count = int(self.take(">I")[0])
        if count * smallest > len(self._payload) - self._at:
            raise ProtocolError(f"MVN datagram 13: {count} items do not fit")
        return count

    def position(self) -> tuple[float, float, float]:
        x, y, z = self.take(">3f")
        return float(x), float(y), float(z)


def _scale(header: Header, payload: bytes) -> Scale:
    cursor = _Cursor(payload)
    segments = tuple((cursor.text(), cursor.position()) for _ in range(cursor.count(16)))
    points = []
    for _ in range(cursor.count(24)):
        segment, point = (int(x) for x in cursor.take(">HH"))
        name = cursor.text()
        flags = int(cursor.take(">I")[0])
        points.append(ScalePoint(segment, point, name, flags, cursor.position()))
    return Scale(header, segments, tuple(points))


def _time_code(payload: bytes) -> float:
    """``HH:MM:SS.mmm``, with or without its length before it [s]."""
    text = (payload[4:] if len(payload) == 16 else payload).decode("ascii", "replace")
    hours, minutes, seconds = text[0:2], text[3:5], text[6:]
    whole, point, fraction = seconds.partition(".")
    digits = all(part.isascii() and part.isdigit() for part in (hours, minutes, whole))
    if not (digits and len(text) == 12 and text[2] == text[5] == ":" and point and fraction.isdigit()):
        raise ProtocolError(f"MVN datagram 25: {text[:20]!r} is not HH:MM:SS.mmm")
    return 3600 * int(hours) + 60 * int(minutes) + int(whole) + int(fraction) / 1000


class Splitter:
    """Cuts a TCP stream into datagrams, by the payload sizes in their headers."""

    def __init__(self) -> None:
        self._held = b""

    def feed(self, data: bytes) -> list[bytes]:
        """The datagrams that are whole now.

        Raises:
            ProtocolError: What follows is no header: the connection has to begin anew.
        """
        held, at, found = self._held + data, 0, []
        while len(held) - at >= HEADER:
            header, _ = _header(held[at : at + HEADER])
            size: int = _HEADER.unpack_from(held, at)[-1]
            if not size and header.kind in _SIZES:
                size = header.items * _SIZES[header.kind]
            if len(held) - at < HEADER + size:
                break
            at += HEADER + size
            found.append(held[at - HEADER - size : at])
        self._held = held[at:]
        return found


# -- out -----------------------------------------------------------------------------------------


def encode(header: Header, payload: bytes) -> bytes:
    """One datagram.

    Raises:
        ValueError: The kind is not given, or a payload of more than 16 bits of bytes.
    """
    if header.kind is None or len(payload) >= LARGEST:
        raise ValueError(f"no kind, or {len(payload)} bytes of payload")
    counter = header.part | (LAST if header.last else 0)
    who = (header.character, header.segments, header.props, header.fingers)
    name = b"MXTP%02d" % header.kind
    fixed = (name, header.sample, counter, header.items, header.time_code, *who, len(payload))
    return _HEADER.pack(*fixed) + payload


def pack_items(ids: Sequence[int] | NDArray[np.int32], values: Array) -> bytes:
    """Payload of a datagram of numbers: identifiers (n,) or (n, 2), values (n, k)."""
    integers = np.asarray(ids).reshape(len(values), -1)
    table = np.empty((len(values), integers.shape[1] + values.shape[1]), ">i4")
    table[:, : integers.shape[1]] = integers
    table[:, integers.shape[1] :] = np.asarray(values, ">f4").view(">i4")
    return table.tobytes()


def pack_tags(tags: Mapping[str, str]) -> bytes:
    """Payload of kind 12."""
    return "".join(f"{tag}:{value}\n" for tag, value in tags.items()).encode()


def pack_scale(
    segments: Sequence[tuple[str, Sequence[float]]] = (), points: Sequence[ScalePoint] = ()
) -> bytes:
    """Payload of kind 13."""

    def text(name: str) -> bytes:
        return struct.pack(">i", len(name.encode())) + name.encode()

    parts = [struct.pack(">I", len(segments))]
    parts += [text(name) + struct.pack(">3f", *position) for name, position in segments]
    parts.append(struct.pack(">I", len(points)))
    for p in points:
        parts.append(struct.pack(">HH", p.segment, p.point) + text(p.name))
        parts.append(struct.pack(">I3f", p.flags, *p.position))
    return b"".join(parts)


LATE = 64
"""Samples back that are late; further back it is a new start."""
REORDERED = 0.25
"""What is older than the newest by more was not overtaken on the way [s]: it is played again, or of two."""
FASTEST = 240.0
"""Samples per second at most [Hz]."""
MAX_PARTS = 16
"""Of one sample: 67 segments of 44 bytes fill two."""
MAX_WAITING = 32
"""Samples in pieces, of all characters and kinds; then the oldest is given up."""
_TURN = 1 << 32


class _Key(NamedTuple):
    character: int
    kind: int


@dataclass
class Losses:
    """What did not become a whole sample."""

    late: int = 0
    """Datagrams of samples older than one that was whole already."""
    doubled: int = 0
    """Datagrams that had been heard."""
    incomplete: int = 0
    """Samples of which a part never came."""
    skipped: int = 0
    """Samples that the sender left out, or of which no part came, by their counter."""

    def __bool__(self) -> bool:
        return any((self.late, self.doubled, self.incomplete, self.skipped))


@dataclass
class _Waiting:
    parts: dict[int, Items] = field(default_factory=dict)
    count: int | None = None


class Assembly:
    """Whole samples from datagrams of numbers.

    Attributes:
        losses: Counted since the start.
    """

    def __init__(self) -> None:
        self.losses = Losses()
        self._newest: dict[_Key, Header] = {}
        self._waiting: OrderedDict[tuple[_Key, int], _Waiting] = OrderedDict()

    def feed(self, datagram: Items) -> Items | None:
        """The whole sample that this datagram completes, its items in order; None while parts lack."""
        header = datagram.header
        key = _Key(header.character, -1 if header.kind is None else int(header.kind))
        newest = self._newest.get(key)
        if newest is not None:
            back = (newest.sample - header.sample) % _TURN
            if back == 0:
                self.losses.doubled += 1
                return None
            if back <= LATE:
                self.losses.late += 1
                old = max((newest.time_code - header.time_code) / 1000, back / FASTEST)
                if old > REORDERED:
                    distrust(f"MVN says again what is {old:.2f} s old: played again, or of two senders")
                return None
        if header.last and header.part == 0:
            self._done(key, header)
            return datagram
        whole = self._part(key, datagram)
        if whole is not None:
            self._done(key, header)
        return whole

    def _part(self, key: _Key, datagram: Items) -> Items | None:
        header = datagram.header
        if header.part >= MAX_PARTS:
            self.losses.incomplete += 1
            return None
        at = (key, header.sample)
        waiting = self._waiting.setdefault(at, _Waiting())
        if header.part in waiting.parts:
            self.losses.doubled += 1
            return None
        waiting.parts[header.part] = datagram
        if header.last:
            waiting.count = header.part + 1
        if waiting.count is None or any(k not in waiting.parts for k in range(waiting.count)):
            while len(self._waiting) > MAX_WAITING:
                self._waiting.popitem(last=False)
                self.losses.incomplete += 1
            return None
        parts = [waiting.parts[k] for k in range(waiting.count)]
        whole = header._replace(part=0, last=True, items=sum(len(p.values) for p in parts) & 0xFF)
        ids, values = (np.concatenate([getattr(p, name) for p in parts]) for name in ("ids", "values"))
        return Items(whole, ids, values)

    def _done(self, key: _Key, header: Header) -> None:
        """A sample is whole: it is the newest, and what waits that is older is lost."""
        before = self._newest.get(key)
        if before is not None and (ahead := (header.sample - before.sample) % _TURN) < _TURN // 2:
            self.losses.skipped += ahead - 1
        self._newest[key] = header
        self._waiting.pop((key, header.sample), None)
        if self._waiting:
            # Further ahead are pieces of the recording before: its counter comes there again.
            old = [at for at in self._waiting if at[0] == key and (at[1] - header.sample) % _TURN > LATE]
            for at in old:
                del self._waiting[at]
                self.losses.incomplete += 1
