"""VRPN over TCP, as a reader: the cookie, messages, names of senders and types, poses of trackers.

Big-endian. Each message has six 32-bit integers (length without padding, seconds, microseconds, sender,
type, padding), then its payload, padded to eight bytes. Senders and types are numbers that each side
chooses; system messages (negative types) say their names.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np

from seerob.core.transforms import Array
from seerob.protocols import ProtocolError

PORT = 3883
COOKIE = b"vrpn: ver. 07.38  0".ljust(24, b"\0")
MAJOR = b"vrpn: ver. 07."
"""What both sides' cookies must begin with; minor versions understand each other."""
HEADER = struct.Struct(">6i")
LARGEST = 1 << 20
"""Of a payload [byte]."""
MOST_NAMES = 4000
"""Senders, and types: VRPN's own bound is 2000 each."""
MOST_SENSORS = 1000
SENDER_DESCRIPTION, TYPE_DESCRIPTION = -1, -2
POSE = b"vrpn_Tracker Pos_Quat"
_POSE = struct.Struct(">ii7d")


class Message(NamedTuple):
    """One message."""

    t: float
    """On the server's clock [s]."""
    sender: int
    type: int
    payload: bytes


class TrackerPose(NamedTuple):
    """Pose of one sensor of a tracker, as on the wire."""

    t: float
    """On the server's clock [s]."""
    tracker: str
    sensor: int
    position: Array
    """Shape (3,); metres by VRPN's convention."""
    xyzw: Array
    """Shape (4,)."""


def check_cookie(cookie: bytes) -> None:
    """That the other side's first bytes are a VRPN of version 7.

    Raises:
        ProtocolError: They are something else.
    """
    if not cookie.startswith(MAJOR):
        shown = cookie[:24].rstrip(b"\0").decode("ascii", "replace")
        raise ProtocolError(f"no VRPN of version 7 answers: it begins with {shown!r}")


class Splitter:
    """Cuts the stream after the cookie into messages."""

    def __init__(self) -> None:
        self._held = bytearray()

    def feed(self, data: bytes) -> list[Message]:
        """The messages that are whole now.

        Raises:
            ProtocolError: A length that cannot be: the connection has to begin anew.
        """
        held, at, found = self._held, 0, []
        held += data
        while len(held) - at >= HEADER.size:
            length, seconds, micro, sender, kind, _ = HEADER.unpack_from(held, at)
            size = length - HEADER.size
            if not 0 <= size <= LARGEST:
                raise ProtocolError(f"a VRPN message of {length} bytes")
            padded = HEADER.size + -(-size // 8) * 8
            if len(held) - at < padded:
                break
            start = at + HEADER.size
            found.append(Message(seconds + 1e-6 * micro, sender, kind, bytes(held[start : start + size])))
            at += padded
        del held[:at]
        return found


class Reader:
    """Makes poses of messages; knows the names that the other side has told."""

    def __init__(self) -> None:
        self.senders: dict[int, str] = {}
        self._types: dict[int, bytes] = {}

    def take(self, message: Message) -> TrackerPose | None:
        """The pose of a message; None when it is none.

        Raises:
            ProtocolError: It contradicts itself.
        """
        if message.type == SENDER_DESCRIPTION:
            self._learn(self.senders, message.sender, _name(message.payload).decode("utf-8", "replace"))
        elif message.type == TYPE_DESCRIPTION:
            self._learn(self._types, message.sender, _name(message.payload))
        elif self._types.get(message.type) == POSE:
            return self._pose(message)
        return None

    def _learn(self, names: dict[int, str] | dict[int, bytes], number: int, name: str | bytes) -> None:
        if number < 0 or (number not in names and len(names) >= MOST_NAMES):
            raise ProtocolError(f"a VRPN name with the number {number}, or more than {MOST_NAMES} names")
        names[number] = name  # type: ignore[assignment]

    def _pose(self, message: Message) -> TrackerPose:
        if len(message.payload) != _POSE.size:
            raise ProtocolError(f"a VRPN pose of {len(message.payload)} bytes, not {_POSE.size}")
        sensor, _, *numbers = _POSE.unpack(message.payload)
        if not 0 <= sensor < MOST_SENSORS:
            raise ProtocolError(f"a VRPN pose of sensor {sensor}")
        tracker = self.senders.get(message.sender, f"sender {message.sender}")
        values = np.array(numbers)
        return TrackerPose(message.t, tracker, sensor, values[:3], values[3:])


def _name(payload: bytes) -> bytes:
    if len(payload) < 5:
        raise ProtocolError("a VRPN description without a name")
    (length,) = struct.unpack_from(">i", payload)
    if not 0 < length <= min(len(payload) - 4, 256):
        raise ProtocolError(f"a VRPN name of {length} bytes")
    return payload[4 : 4 + length].split(b"\0", 1)[0]


def encode(t: float, sender: int, kind: int, payload: bytes) -> bytes:
    """A message on the wire, with its padding."""
    seconds = int(t)
    head = HEADER.pack(HEADER.size + len(payload), seconds, round(1e6 * (t - seconds)), sender, kind, 0)
    return head + payload.ljust(-(-len(payload) // 8) * 8, b"\0")


def describe(kind: int, number: int, name: bytes) -> bytes:
    """The message that gives a sender or a type its name."""
    return encode(0.0, number, kind, struct.pack(">i", len(name) + 1) + name + b"\0")


def encode_pose(sensor: int, position: Array, xyzw: Array) -> bytes:
    """Payload of a pose."""
    return _POSE.pack(sensor, 0, *position.tolist(), *xyzw.tolist())
