"""OptiTrack's NatNet, versions 2.0 to 4.x: messages, frames, models, and a conversation with a server.

Little-endian, over UDP: a 16-bit number, the payload's 16-bit size, the payload. From 4.1 on every list has
its size in bytes after its count, so that lists nobody here needs are skipped; before that they are read.
Values stay as on the wire (metres, y up unless Motive is set otherwise, quaternions x, y, z, w). Model
definitions say which number is which rigid body, which person, which bone.
"""

from __future__ import annotations

import asyncio
import socket
import struct
import time
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.protocols import ProtocolError
from seerob.protocols.links.datagrams import Datagram, Datagrams, listening
from seerob.protocols.links.live_messages import NONSENSE


class Cursor:
    """Where one is in a payload.

    Args:
        data: The payload.
        what: Whose, for messages.
        longest: Of a name [byte].
    """

    def __init__(self, data: bytes, what: str, *, longest: int = 256) -> None:
        self._data, self._what, self._longest = data, what, longest
        self.at = 0
        """Bytes read so far."""

    @property
    def left(self) -> int:
        """Bytes that follow."""
        return len(self._data) - self.at

    def skip(self, size: int) -> None:
        """Leave bytes out.

        Raises:
            ProtocolError: There are not so many.
        """
        if not 0 <= size <= self.left:
            raise ProtocolError(f"{self._what}: {size} bytes to skip, {self.left} are left")
        self.at += size

    def take(self, layout: struct.Struct) -> tuple[int | float, ...]:
        """The next numbers.

        Raises:
            ProtocolError: It ends before.
        """
        self.skip(layout.size)
        return layout.unpack_from(self._data, self.at - layout.size)

    def whole(self) -> int:
        """A signed integer of 32 bits."""
        return int(self.take(_I32)[0])

    def short(self) -> int:
        """An unsigned integer of 16 bits."""
        return int(self.take(_U16)[0])

    def floats(self, count: int) -> Array:
        """Numbers of 32 bits, shape (count,)."""
        self.skip(4 * count)
        # For a few numbers faster than numpy's own, and quiet about a signalling NaN.
        return np.array(struct.unpack_from(f"<{count}f", self._data, self.at - 4 * count))

    def rows(self, kind: np.dtype[np.void], count: int) -> NDArray[np.void]:
        """So many items of one size.

        Raises:
            ProtocolError: There are not so many.
        """
        self.skip(kind.itemsize * count)
        return np.frombuffer(self._data, kind, count, self.at - kind.itemsize * count)

    def count(self, smallest: int, most: int) -> int:
        """How many items follow.

        Args:
            smallest: Bytes that each has at least.
            most: There are never more.

        Raises:
            ProtocolError: They cannot be there.
        """
        count = self.whole()
        if not 0 <= count <= most or count * smallest > self.left:
            raise ProtocolError(f"{self._what}: {count} items do not fit")
        return count

    def name(self) -> str:
        """Text up to a zero.

        Raises:
            ProtocolError: There is none, or it is too long.
        """
        end = self._data.find(b"\0", self.at, self.at + self._longest)
        if end < 0:
            raise ProtocolError(f"{self._what}: a name without an end, or of more than {self._longest} bytes")
        text = self._data[self.at : end].decode("utf-8", "replace")
        self.at = end + 1
        return text


_I32, _U16 = struct.Struct("<i"), struct.Struct("<H")


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


@dataclass(frozen=True, eq=False, slots=True)
class Bodies(Sequence[Body]):
    """Rigid bodies, or bones, as columns: of a person there are many."""

    numbers: tuple[int, ...]
    poses: Array
    """Positions [m], then x, y, z, w of world from body, shape (n, 7)."""
    errors: tuple[float, ...]
    """Mean errors of their markers [m]."""
    tracked: tuple[bool, ...]

    @classmethod
    def of(cls, bodies: Sequence[Body]) -> Bodies:
        """Columns of bodies one by one."""
        poses = np.array([[*body.position, *body.xyzw] for body in bodies], float).reshape(-1, 7)
        numbers, errors = tuple(body.id for body in bodies), tuple(body.error for body in bodies)
        return cls(numbers, poses, errors, tuple(body.tracked for body in bodies))

    def __len__(self) -> int:
        return len(self.numbers)

    @overload
    def __getitem__(self, index: int) -> Body: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Body]: ...
    def __getitem__(self, index: int | slice) -> Body | Sequence[Body]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        pose = self.poses[index]
        return Body(self.numbers[index], pose[:3], pose[3:], self.errors[index], self.tracked[index])


class Skeleton(NamedTuple):
    """One person."""

    id: int
    bones: Bodies


@dataclass(frozen=True, eq=False, slots=True)
class Frame:
    """One instant."""

    number: int
    t: float
    """Motive's time since it was started [s]."""
    bodies: Bodies
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
    bodies = _bodies(cursor, version, _counted(cursor, version, 32))
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
    cursor: Cursor, version: Version, number: int, bodies: Bodies, skeletons: tuple[Skeleton, ...]
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


def _bodies(cursor: Cursor, version: Version, count: int) -> Bodies:
    if version < (3, 0):
        return Bodies.of([_body(cursor, version) for _ in range(count)])
    rows = cursor.rows(_BODY, count)
    with np.errstate(invalid="ignore"):  # a signalling NaN
        poses = rows["pose"].astype(float)
    tracked = [bool(said & TRACKED) for said in rows["parameters"].tolist()]
    return Bodies(tuple(rows["id"].tolist()), poses, tuple(rows["error"].tolist()), tuple(tracked))


def _body(cursor: Cursor, version: Version) -> Body:
    """Of a version before 3.0, each of a size of its own."""
    number = cursor.whole()
    values = cursor.floats(7)
    # Position, identifier and size of each marker.
    cursor.skip(20 * cursor.count(20, MOST))
    error = float(cursor.floats(1)[0])
    # Before 2.6 an unseen body keeps its last pose or has none, and nothing says so.
    tracked = bool(cursor.short() & TRACKED) if version >= (2, 6) else bool(values.any())
    return Body(number, values[:3], values[3:], error, tracked)


def _skeleton(cursor: Cursor, version: Version) -> Skeleton:
    number = cursor.whole()
    return Skeleton(number, _bodies(cursor, version, cursor.count(32, MOST_BONES)))


_F64, _F32 = struct.Struct("<d"), struct.Struct("<f")
_BODY = np.dtype([("id", "<i4"), ("pose", "<f4", 7), ("error", "<f4"), ("parameters", "<u2")])

MARKER_SET, RIGID_BODY, SKELETON, FORCE_PLATE, DEVICE, CAMERA, ASSET = range(7)


class BoneModel(NamedTuple):
    """A rigid body, or a bone of a skeleton."""

    id: int
    name: str
    parent: int
    """Number of the parent; -1 or 0 for none."""


class SkeletonModel(NamedTuple):
    """One person."""

    id: int
    name: str
    bones: tuple[BoneModel, ...]


class Models(NamedTuple):
    """Everything that has a name and is followed here."""

    bodies: tuple[BoneModel, ...] = ()
    skeletons: tuple[SkeletonModel, ...] = ()


def models(payload: bytes, version: Version) -> Models:
    """Definitions of the rigid bodies and skeletons.

    Args:
        payload: Of a datagram `Message.MODELS`.
        version: Of NatNet, as the server says.

    Raises:
        ProtocolError: It contradicts itself or ends too early, or has a kind whose size is not known.
    """
    cursor = Cursor(payload, "NatNet model definitions")
    bodies, skeletons = [], []
    for _ in range(cursor.count(4, MOST)):
        kind = cursor.whole()
        end = None
        if version >= (4, 1):
            size = cursor.whole()
            if not 0 <= size <= cursor.left:
                raise ProtocolError(f"NatNet model definitions: one of {size} bytes, {cursor.left} are left")
            end = cursor.at + size
        if kind == RIGID_BODY:
            bodies.append(_bone(cursor, version))
        elif kind == SKELETON:
            skeletons.append(_skeleton_model(cursor, version))
        elif end is None:
            _over(cursor, kind, version)
        if end is not None:
            cursor.skip(end - cursor.at)
    return Models(tuple(bodies), tuple(skeletons))


def _bone(cursor: Cursor, version: Version) -> BoneModel:
    name = cursor.name()
    number, parent = cursor.whole(), cursor.whole()
    cursor.skip(12)
    if version >= (4, 2):
        cursor.skip(16)
    if version >= (3, 0):
        markers = cursor.count(16, MOST)
        cursor.skip(16 * markers)
        if version >= (4, 0):
            for _ in range(markers):
                cursor.name()
    return BoneModel(number, name, parent)


def _skeleton_model(cursor: Cursor, version: Version) -> SkeletonModel:
    name, number = cursor.name(), cursor.whole()
    bones = tuple(_bone(cursor, version) for _ in range(cursor.count(21, MOST_BONES)))
    return SkeletonModel(number, name, bones)


def _over(cursor: Cursor, kind: int, version: Version) -> None:
    """Read over a kind that is not needed, in versions that do not say its size."""
    if kind == MARKER_SET:
        cursor.name()
        for _ in range(cursor.count(1, MOST)):
            cursor.name()
    elif kind == FORCE_PLATE:
        cursor.whole()
        cursor.name()
        # Width, length, origin, calibration matrix 12 x 12, four corners, two kinds.
        cursor.skip(4 * (2 + 3 + 144 + 12 + 2))
        for _ in range(cursor.count(1, MOST)):
            cursor.name()
    elif kind == DEVICE:
        cursor.whole()
        cursor.name()
        cursor.name()
        cursor.skip(8)
        for _ in range(cursor.count(1, MOST)):
            cursor.name()
    elif kind == CAMERA:
        cursor.name()
        cursor.skip(28)
    else:
        raise ProtocolError(f"NatNet model definitions: kind {kind} in version {version[0]}.{version[1]}")


SILENCE = 1.0
"""Without a datagram the connection counts as lost [s]."""
ASK_AGAIN = 0.5
"""A question that was not answered is asked again after this [s]."""
PATIENCE = 2.0
"""For the answers at the begin [s]."""
KEEP_ALIVE = 0.5
"""Motive stops a unicast stream to whom it does not hear from for some seconds [s]."""


@dataclass(frozen=True, eq=False, slots=True)
class ReceivedFrame:
    """A frame, and what its numbers mean."""

    arrived: float
    """Host's monotonic time [s]."""
    frame: Frame
    models: Models
    """What the numbers of the frame stand for; this object stays the same one until something changes."""
    server: ServerInfo


class Session:
    """What is known of a server.

    Args:
        port: To ask from.
        server: Address and command port.
        unicast: Whether it has to be told that somebody still listens.
    """

    def __init__(self, port: Datagrams, server: tuple[str, int], *, unicast: bool) -> None:
        self._port, self._server, self._unicast = port, server, unicast
        self.info: ServerInfo | None = None
        self.models: Models | None = None
        self._asked = self._kept = -1e9
        self._stale = False
        self._nonsense = 0

    def tick(self, now: float) -> None:
        """Ask for what is not known yet, and say that somebody listens."""
        if now - self._asked >= ASK_AGAIN and (self.models is None or self._stale):
            self._asked = now
            if self.info is None:
                self._port.send(message(Message.CONNECT, b"Ping\0"), self._server)
            else:
                self._port.send(message(Message.REQUEST_MODELS), self._server)
        if self._unicast and now - self._kept >= KEEP_ALIVE:
            self._kept = now
            self._port.send(message(Message.KEEP_ALIVE), self._server)

    def take(self, datagram: Datagram) -> ReceivedFrame | None:
        """What a datagram says; None when it is no frame, or not understood yet.

        Raises:
            ProtocolError: Too much nonsense in a row.
        """
        try:
            found = self._take(datagram)
        except ProtocolError:
            self._nonsense += 1
            if self._nonsense >= NONSENSE:
                raise
            return None
        self._nonsense = 0
        return found

    def _take(self, datagram: Datagram) -> ReceivedFrame | None:
        kind, payload = split(datagram.data)
        if kind == Message.SERVER_INFO:
            self.info = server_info(payload)
            self._asked = -1e9
            return None
        if self.info is None:
            return None
        version = self.info.natnet[:2]
        if kind == Message.MODELS:
            fresh = models(payload, version)
            self._stale = False
            if fresh != self.models:
                self.models = fresh
        elif kind == Message.FRAME and self.models is not None:
            heard = frame(payload, version)
            known = {s.id for s in self.models.skeletons}, {b.id for b in self.models.bodies}
            self._stale = self._stale or heard.models_changed
            self._stale |= not all(s.id in known[0] for s in heard.skeletons)
            self._stale |= not known[1].issuperset(heard.bodies.numbers)
            return ReceivedFrame(datagram.arrived, heard, self.models, self.info)
        return None


async def frames(
    host: str,
    *,
    bind: str,
    command_port: int = COMMAND_PORT,
    data_port: int = DATA_PORT,
    group: str | None = GROUP,
) -> AsyncGenerator[ReceivedFrame, None]:
    """Frames of a server.

    Args:
        host: Its name or address.
        bind: Own address on its network.
        command_port: Its port for questions.
        data_port: Port of the multicast group.
        group: Multicast group; None for unicast.

    Raises:
        OSError: No such host, or a port is taken.
        TimeoutError: No answer, or nothing for `SILENCE`.
        ProtocolError: Only nonsense, or a version that is not known.
    """
    loop = asyncio.get_running_loop()
    found = await loop.getaddrinfo(host, command_port, family=socket.AF_INET, type=socket.SOCK_DGRAM)
    address = found[0][4][0]
    async with AsyncExitStack() as stack:
        port = await stack.enter_async_context(listening(bind, 0, sender=str(address), one_port=False))
        if group is not None:
            joined = listening(bind, data_port, sender=str(address), group=group, one_port=False, beside=port)
            await stack.enter_async_context(joined)
        session = Session(port, (str(address), command_port), unicast=group is None)
        begun = spoken = time.monotonic()
        while True:
            now = time.monotonic()
            session.tick(now)
            try:
                datagram = await port.next(0.1)
            except TimeoutError:
                waited = time.monotonic() - spoken
                if session.models is None and time.monotonic() - begun > PATIENCE:
                    raise TimeoutError(_unanswered(session, host, command_port)) from None
                if session.models is not None and waited > SILENCE:
                    raise TimeoutError(f"no frame from {host} for {SILENCE:g} s") from None
                continue
            heard = session.take(datagram)
            _check(session.info)
            if heard is not None:
                spoken = time.monotonic()
                yield heard
            elif session.models is not None and time.monotonic() - spoken > PATIENCE:
                raise TimeoutError(f"{host} answers, but sends no frames: is it in Live, is it playing?")


def _check(info: ServerInfo | None) -> None:
    if info is not None and not (2, 0) <= info.natnet[:2] < (5, 0):
        shown = ".".join(map(str, info.natnet))
        raise ProtocolError(f"{info.application} speaks NatNet {shown}; 2.0 to 4.x are understood")


def _unanswered(session: Session, host: str, port: int) -> str:
    if session.info is None:
        return f"no answer from {host}:{port} within {PATIENCE:g} s"
    return f"{session.info.application} at {host} does not say its models within {PATIENCE:g} s"
