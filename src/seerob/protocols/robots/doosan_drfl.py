"""The message that ``bridges/doosan_drfl`` sends for every sample of a Doosan controller.

One UDP datagram of 128 bytes, little endian, in the units of the maker's library: the bridge converts
nothing, so that what a number means is decided, and tested, in one place.

====== ====== ===========================================================
offset type   content
====== ====== ===========================================================
0      4 byte ``SRDF``
4      u16    version of this layout, 1
6      u16    length of the message, 128
8      u32    number of the message, counts up by one from 0
12     u32    of what follows, which is valid: bit 0 measured joint torques
16     f64    the controller's time [s]
24     6 f32  measured joint positions [deg]
48     6 f32  measured joint speeds [deg/s]
72     6 f32  measured joint torques [N·m]
96     6 f32  external joint torques as the controller estimates them [N·m]
120    u8     robot mode: 0 manual, 1 automatic, 2 measuring
121    u8     robot state, see `RobotState`
122    u16    control mode, as it is
124    u32    CRC-32 (IEEE 802.3, as zlib's) of the 124 bytes before it
====== ====== ===========================================================
"""

from __future__ import annotations

import struct
import zlib
from enum import IntEnum
from typing import NamedTuple

from seerob.protocols import ProtocolError

MAGIC = b"SRDF"
VERSION = 1
LAYOUT = struct.Struct("<4sHHIId6f6f6f6fBBHI")
LENGTH = LAYOUT.size
PORT = 20128
"""That the bridge sends to when none is given."""
TORQUES = 1
"""Flag: measured joint torques."""
JOINTS = 6


class RobotState(IntEnum):
    """What the controller says it is doing, as the maker's headers number it."""

    INITIALIZING = 0
    STANDBY = 1
    MOVING = 2
    SAFE_OFF = 3
    TEACHING = 4
    SAFE_STOP = 5
    EMERGENCY_STOP = 6
    HOMING = 7
    RECOVERY = 8
    SAFE_STOP2 = 9
    SAFE_OFF2 = 10
    NOT_READY = 15


class RobotMode(IntEnum):
    """Who moves the robot."""

    MANUAL = 0
    AUTONOMOUS = 1
    MEASURE = 2


UNSURE = frozenset({RobotState.INITIALIZING, RobotState.NOT_READY})
"""The controller does not know its joints."""
DOUBTFUL = frozenset({RobotState.SAFE_OFF, RobotState.SAFE_OFF2})
"""The drives are off."""


class Message(NamedTuple):
    """One sample, in the units of the maker's library."""

    number: int
    time: float
    """The controller's [s]."""
    positions: tuple[float, ...]
    """[deg]"""
    speeds: tuple[float, ...]
    """[deg/s]"""
    torques: tuple[float, ...] | None
    """[N·m]; None when the message says that they are not valid."""
    external: tuple[float, ...]
    """[N·m]"""
    mode: int
    state: int
    control: int


def encode(message: Message) -> bytes:
    """The datagram of a message."""
    data = LAYOUT.pack(
        MAGIC,
        VERSION,
        LENGTH,
        message.number,
        0 if message.torques is None else TORQUES,
        message.time,
        *message.positions,
        *message.speeds,
        *(message.torques or (0.0,) * JOINTS),
        *message.external,
        message.mode,
        message.state,
        message.control,
        0,
    )[:-4]
    return data + struct.pack("<I", zlib.crc32(data))


def decode(data: bytes) -> Message:
    """What a datagram says.

    Raises:
        ProtocolError: It is no such message, of another version, or damaged.
    """
    if data[:4] != MAGIC:
        raise ProtocolError("not a message of the Doosan bridge")
    if len(data) >= 6 and (version := int.from_bytes(data[4:6], "little")) != VERSION:
        raise ProtocolError(f"the bridge sends version {version}, understood is {VERSION}: build it anew")
    if len(data) != LENGTH or int.from_bytes(data[6:8], "little") != LENGTH:
        raise ProtocolError(f"{len(data)} bytes where a message has {LENGTH}")
    _, _, _, number, flags, time, *values, mode, state, control, check = LAYOUT.unpack(data)
    if check != zlib.crc32(data[:-4]):
        raise ProtocolError("the checksum does not fit: the message is damaged")
    parts = [tuple(values[k : k + JOINTS]) for k in range(0, 4 * JOINTS, JOINTS)]
    positions, speeds, torques, external = parts
    return Message(
        number, time, positions, speeds, torques if flags & TORQUES else None, external, mode, state, control
    )
