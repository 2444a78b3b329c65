"""OptiTrack's NatNet, versions 2.0 to 4.x: the messages around and the frames of what is tracked.

Little-endian, over UDP: a 16-bit number, the payload's 16-bit size, the payload. From 4.1 on every list has
its size in bytes after its count, so that lists nobody here needs are skipped; before that they are read.
Values stay as on the wire (metres, y up unless Motive is set otherwise, quaternions x, y, z, w).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from seerob.core.transforms import Array
from seerob.protocols import ProtocolError
from seerob.protocols.links.little_endian import Cursor

COMMAND_PORT, DATA_PORT = 1510, 1511
GROUP = "239.255.42.99"
HEADER = struct.Struct("<HH")
MOST = 4096
"""Items of one list."""
MOST_BONES = 256
"""Rigid bodies of one skeleton; Motive's own have 21, or 51 with fingers."""
TRACKED = 0x01
"""Bit of a rigid body's parameters: it was seen in this frame."""
MODELS_CHANGED = 0x02
"""Bit of a frame's parameters: the names are to be asked for again."""

Version = tuple[int, int]


class Message(IntEnum):
    """What a datagram is."""

    CONNECT = 0
    SERVER_INFO = 1
    REQUEST = 2
    RESPONSE = 3
    REQUEST_MODELS = 4
    MODELS = 5
    REQUEST_FRAME = 6
    FRAME = 7
    TEXT = 8
    DISCONNECT = 9
    KEEP_ALIVE = 10
    UNRECOGNIZED = 100


class ServerInfo(NamedTuple):
    """Who answers."""

    application: str
    version: tuple[int, int, int, int]
    """Version of the application."""
    natnet: tuple[int, int, int, int]
    """Version of the protocol, which frames are of."""
    data_port: int | None = None
    group: str | None = None
    """Multicast group; None when unicast, or when the version does not say."""
    multicast: bool | None = None


class Body(NamedTuple):
    """A rigid body, or a bone of a skeleton, as on the wire."""

    id: int
    position: Array
    """[m], shape (3,)."""
    xyzw: Array
    """World from body, shape (4,)."""
    error: float
    """Mean error of its markers [m]; NaN when the version does not say."""
    tracked: bool


class Skeleton(NamedTuple):
    """One person."""

    id: int
    bones: tuple[Body, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Frame:
    """One instant."""

    number: int
    t: float
    """Motive's time since it was started [s]."""
    bodies: tuple[Body, ...]
    skeletons: tuple[Skeleton, ...]
    models_changed: bool
    recording: bool


def message(kind: Message, payload: bytes = b"") -> bytes:
    """A datagram.

    Raises:
        ValueError: The payload's size has more than 16 bits.
    """
    if len(payload) >= 1 << 16:
        raise ValueError(f"{len(payload)} bytes of payload")
    return HEADER.pack(kind, len(payload)) + payload


def split(data: bytes) -> tuple[int, bytes]:
    """Number and payload of a datagram.

    Raises:
        ProtocolError: It is none of NatNet's, or cut short.
    """
    if len(data) < HEADER.size:
        raise ProtocolError(f"not a NatNet datagram: {len(data)} bytes")
    kind, size = HEADER.unpack_from(data)
    if len(data) < HEADER.size + size:
        raise ProtocolError(f"NatNet datagram cut short: {len(data)} of {HEADER.size + size} bytes")
    return kind, data[HEADER.size : HEADER.size + size]


def server_info(payload: bytes) -> ServerInfo:
    """The answer to `Message.CONNECT`.

    Raises:
        ProtocolError: It is too short.
    """
    if len(payload) < 264:
        raise ProtocolError(f"NatNet server info of {len(payload)} bytes, 264 at least are expected")
    name = payload[:256].split(b"\0", 1)[0].decode("utf-8", "replace")
    versions = tuple(payload[256:260]), tuple(payload[260:264])
    info = ServerInfo(name, versions[0], versions[1])  # type: ignore[arg-type]
    if len(payload) < 279:  # from 3.0 on: clock's frequency, port, whether multicast, group
        return info
    port, multicast = struct.unpack_from("<H?", payload, 272)
    group = ".".join(map(str, payload[275:279]))
    return info._replace(
        data_port=port or None, group=group if multicast else None, multicast=bool(multicast)
    )


def frame(payload: bytes, version: Version) -> Frame:
    """A frame of tracked things.

    Args:
        payload: Of a datagram `Message.FRAME`.
        version: Of NatNet, as the server says.

    Raises:
        ProtocolError: It contradicts itself or ends too early.
    """
    cursor = Cursor(payload, "NatNet frame")
    number = cursor.whole()
    _skip(cursor, version, 5, _marker_set)
    _skip(cursor, version, 12, lambda c: c.skip(12))
    bodies = tuple(_body(cursor, version) for _ in range(_counted(cursor, version, 32)))
    skeletons: tuple[Skeleton, ...] = ()
    if version >= (2, 1):
        skeletons = tuple(_skeleton(cursor, version) for _ in range(_counted(cursor, version, 8)))
    if version >= (4, 1):
        _skip(cursor, version, 12, None)
    if version >= (2, 3):
        labeled = 20 + (2 if version >= (2, 6) else 0) + (4 if version >= (3, 0) else 0)
        _skip(cursor, version, labeled, lambda c: c.skip(labeled))
    for since in ((2, 9), (2, 11)):  # force plates, devices
        if version >= since:
            _skip(cursor, version, 8, _channels)
    return _ended(cursor, version, number, bodies, skeletons)


def _ended(
    cursor: Cursor, version: Version, number: int, bodies: tuple[Body, ...], skeletons: tuple[Skeleton, ...]
) -> Frame:
    cursor.skip(8)  # time code
    t = float(cursor.take(_F64 if version >= (2, 7) else _F32)[0])
    if version >= (3, 0):
        cursor.skip(24)
    if version >= (4, 1) and cursor.left >= 10:  # a time stamp more, which not every 4.1 has
        cursor.skip(8)
    parameters = cursor.short()
    return Frame(
        number=number,
        t=t,
        bodies=bodies,
        skeletons=skeletons,
        models_changed=bool(parameters & MODELS_CHANGED),
        recording=bool(parameters & 1),
    )


def _counted(cursor: Cursor, version: Version, smallest: int) -> int:
    """How many items of a list follow, whose size in bytes is read over."""
    if version >= (4, 1):
        count = cursor.count(0, MOST)
        size = cursor.whole()
        if not 0 <= size <= cursor.left or count * smallest > size:
            raise ProtocolError(f"NatNet frame: a list of {count} items in {size} bytes")
        return count
    return cursor.count(smallest, MOST)


def _skip(cursor: Cursor, version: Version, smallest: int, item: Callable[[Cursor], None] | None) -> None:
    """Read over a list: by its size, or item by item."""
    if version >= (4, 1):
        cursor.count(0, MOST * 16)
        cursor.skip(cursor.whole())
        return
    assert item is not None  # lists that came with 4.1 have a size
    for _ in range(cursor.count(smallest, MOST * 16)):
        item(cursor)


def _marker_set(cursor: Cursor) -> None:
    cursor.name()
    cursor.skip(12 * cursor.count(12, MOST))


def _channels(cursor: Cursor) -> None:
    cursor.whole()
    for _ in range(cursor.count(4, MOST)):
        cursor.skip(4 * cursor.count(4, MOST))


def _body(cursor: Cursor, version: Version) -> Body:
    number = cursor.whole()
    values = cursor.floats(7)
    if version < (3, 0):
        # Position, identifier and size of each marker.
        cursor.skip(20 * cursor.count(20, MOST))
    error = float(cursor.floats(1)[0])
    # Before 2.6 an unseen body keeps its last pose or has none, and nothing says so.
    tracked = bool(cursor.short() & TRACKED) if version >= (2, 6) else bool(values.any())
    return Body(number, values[:3], values[3:], error, tracked)


def _skeleton(cursor: Cursor, version: Version) -> Skeleton:
    number = cursor.whole()
    return Skeleton(number, tuple(_body(cursor, version) for _ in range(cursor.count(32, MOST_BONES))))


_F64, _F32 = struct.Struct("<d"), struct.Struct("<f")
