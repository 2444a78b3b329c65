"""What a controller of Dobot's CR, Nova and Magician E6 arms sends at its port for real-time feedback.

TCP, the controller is the server and says the same 1440 bytes every 8 ms (port 30004), every 200 ms (30005)
or as it is set (30006), little endian. Nothing is asked and nothing answered. Places and types are those of
the maker's table (TCP/IP protocol of six-axis arms, V4), of which this is what a twin needs:

====== ====== =====================================================================
offset type   content
====== ====== =====================================================================
0      u16    length of the message, 1440
24     u64    robot mode, see `RobotMode`
40     u64    time since the controller was switched on [ms]
48     u64    a constant by which the layout is known, see `TEST_VALUE`
64     f64    speed scaling [%]
432    6 f64  measured joint positions [deg]
480    6 f64  measured joint speeds [deg/s]
624    6 f64  tool, x, y, z [mm] and turns [deg], in the user frame that is set
1012   u8     number of that user frame, 0 for the base
1026   u8     whether it is enabled; then dragged, running, in alarm
1038   u8     whether a collision was detected
1168   f64    payload that it was told [kg]
====== ====== =====================================================================

The unit of its joint torques (offset 1120) is not said, so that they are not read.
"""

from __future__ import annotations

import struct
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from enum import IntEnum
from typing import NamedTuple

from seerob.protocols import ProtocolError
from seerob.protocols.links.connection import Connection, connected

PORT = 30004
PERIOD = 0.008
"""Of that port [s]."""
LENGTH = 1440
TEST_VALUE = 0x0123_4567_89AB_CDEF
JOINTS = 6
LAYOUT = struct.Struct("<H22xQ8xQQ8xd360x6d6d96x6d340xB13x4B8xB129xd264x")
"""Every field of `Message` in order, behind the length of the whole."""
SILENCE = 1.0
"""Longest pause before the connection is taken for dead [s]."""
ANSWER_WITHIN = 2.0
"""For a connection [s]."""


class RobotMode(IntEnum):
    """What the controller says it is doing, as the maker numbers it."""

    INITIALIZING = 1
    BRAKES_OPEN = 2
    POWER_OFF = 3
    DISABLED = 4
    ENABLED = 5
    DRAGGED = 6
    RUNNING = 7
    SINGLE_MOVE = 8
    ALARM = 9
    PAUSED = 10
    COLLISION = 11


class Message(NamedTuple):
    """One message, in the maker's units."""

    mode: int
    time: float
    """Since the controller was switched on [s]."""
    speed_scaling: float
    """[%]"""
    positions: tuple[float, ...]
    """[deg]"""
    speeds: tuple[float, ...]
    """[deg/s]"""
    tool: tuple[float, ...]
    """x, y, z [mm] and turns [deg]."""
    user_frame: int
    enabled: bool
    dragged: bool
    running: bool
    alarm: bool
    collision: bool
    payload: float
    """[kg]"""


def encode(message: Message) -> bytes:
    """Bytes of a message, with zeros where a twin needs nothing."""
    m = message
    states = m.enabled, m.dragged, m.running, m.alarm
    return LAYOUT.pack(
        *(LENGTH, m.mode, round(1e3 * m.time), TEST_VALUE, m.speed_scaling, *m.positions, *m.speeds, *m.tool),
        *(m.user_frame, *states, m.collision, m.payload),
    )


def decode(data: bytes) -> Message:
    """What a message says.

    Raises:
        ProtocolError: It has another length, not the constant by which the layout is known, or no time.
    """
    if len(data) != LENGTH:
        raise ProtocolError(f"a message of {len(data)} bytes; it has {LENGTH}")
    length, mode, time, test, scaling, *rest = LAYOUT.unpack(data)
    if length != LENGTH or test != TEST_VALUE:
        raise ProtocolError(f"no message of a Dobot controller (length {length}, test value {test:#x})")
    if time == 0:
        # A controller that has just been switched on has counted some.
        raise ProtocolError("it says no time since it was switched on: is its firmware older than V4?")
    user, enabled, dragged, running, alarm, collision, payload = rest[18:]
    return Message(
        mode=mode,
        time=1e-3 * time,
        speed_scaling=scaling,
        positions=tuple(rest[:6]),
        speeds=tuple(rest[6:12]),
        tool=tuple(rest[12:18]),
        user_frame=user,
        enabled=bool(enabled),
        dragged=bool(dragged),
        running=bool(running),
        alarm=bool(alarm),
        collision=bool(collision),
        payload=payload,
    )


class Reading(NamedTuple):
    """A message, and when it arrived on the host's monotonic clock [s]."""

    arrived: float
    message: Message


@asynccontextmanager
async def connect(host: str, port: int) -> AsyncGenerator[AsyncGenerator[Reading, None], None]:
    """Connect; what is given yields what the controller says until it closes.

    Raises:
        OSError: There is no connection, or no longer.
        TimeoutError: It does not answer, or has fallen silent.
        ProtocolError: It says something else.
    """
    async with connected(host, port, ANSWER_WITHIN) as connection:
        yield _receive(connection)


async def _receive(connection: Connection) -> AsyncGenerator[Reading, None]:
    rest = b""
    while True:
        arrived, data, _ = await connection.read(SILENCE)
        if not data:
            return
        rest += data
        while len(rest) >= LENGTH:
            yield Reading(arrived, decode(rest[:LENGTH]))
            rest = rest[LENGTH:]
