"""What an ABB controller sends through Externally Guided Motion (EGM), and streams of positions with it.

UDP: the controller sends to the address of a "UCdevice" in its configuration, one message of Protocol Buffers
each 4 ms or a multiple of that. Who streams positions (``EGMStreamStart``) expects no answer; who lets itself
be guided (``EGMRunJoint``, ``EGMRunPose``) stops without one. Fields that a twin needs, by number, as in the
maker's ``egm.proto``:

=================================== =====================================================================
1 header                            1 number, 2 time [ms], 3 kind, of which `DATA` is the controller's
2 feedBack                          1 joints {1 [deg], repeated}, 2 pose {1 position {1 x, 2 y, 3 z [mm]}},
                                    3 external joints {1}, 4 time {1 [s], 2 [µs]}
4, 5, 8                             {1}: `MotorState`, `MotionState`, `RapidState`
9 measuredForce                     1 whether force control is on, 2 [N and N·m], repeated
10                                  how much of it the motion uses [%]
=================================== =====================================================================

Read here and not by the library protobuf: see `seerob.protocols.links.protobuf_wire`.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from seerob.protocols import ProtocolError
from seerob.protocols.links import protobuf_wire as wire
from seerob.protocols.links.protobuf_wire import Field, fields

PORT = 6510
PERIOD = 0.004
"""The shortest [s]."""
JOINTS = 6
MOST = 32
"""Numbers in a repeated field."""
LARGEST = 4096
"""[byte]"""
DATA = 2
"""Kind of what a controller sends."""


class MotorState(IntEnum):
    """Of the motors, as the maker numbers it."""

    UNDEFINED = 0
    ON = 1
    OFF = 2


class MotionState(IntEnum):
    """Of the interface that guides the motion."""

    UNDEFINED = 0
    ERROR = 1
    STOPPED = 2
    RUNNING = 3


class RapidState(IntEnum):
    """Of the program."""

    UNDEFINED = 0
    STOPPED = 1
    RUNNING = 2


class Message(NamedTuple):
    """What a controller says of one instant."""

    sequence: int
    time: float
    """Its clock [s]: of the measurement, where it says that, else of sending."""
    joints: tuple[float, ...]
    """Measured [deg]."""
    external: tuple[float, ...] = ()
    """Of further axes [deg or mm]."""
    tool: tuple[float, float, float] | None = None
    """Position of the tool in the frame that the program chose [mm]."""
    motors: int = MotorState.UNDEFINED
    motion: int = MotionState.UNDEFINED
    program: int = RapidState.UNDEFINED
    force: tuple[float, ...] = ()
    """Measured [N and N·m], while force control is on."""
    utilization: float | None = None
    """How much of the permitted guidance the motion uses [%]."""


def decode(data: bytes) -> Message:
    """What a datagram says.

    Raises:
        ProtocolError: It is no message of a controller, or says no measured joints.
    """
    if len(data) > LARGEST:
        raise ProtocolError(f"a message of {len(data)} bytes; at most {LARGEST} are read")
    parts = _parts(data)
    header, measured = _parts(_one(parts, 1, "header")), _parts(_one(parts, 2, "feedBack"))
    kind = header[3][-1].whole() if 3 in header else 0
    if kind != DATA:
        raise ProtocolError(f"a message of kind {kind}, not what a controller sends ({DATA})")
    joints = _numbers(measured, 1)
    if not joints:
        raise ProtocolError("says no measured joints")
    sequence = header[1][-1].whole() if 1 in header else 0
    about = _parts(parts[9][-1].bytes()) if 9 in parts else {}
    active = 1 not in about or bool(about[1][-1].whole())
    return Message(
        sequence=sequence,
        time=_time(measured, header),
        joints=joints,
        external=_numbers(measured, 3),
        tool=_position(measured),
        motors=_state(parts, 4),
        motion=_state(parts, 5),
        program=_state(parts, 8),
        force=_repeated(about, 2) if active else (),
        utilization=_number(parts[10][-1]) if 10 in parts else None,
    )


def _parts(data: bytes) -> dict[int, list[Field]]:
    found: dict[int, list[Field]] = {}
    for field in fields(data):
        found.setdefault(field.number, []).append(field)
    return found


def _one(parts: dict[int, list[Field]], number: int, name: str) -> bytes:
    if number not in parts:
        raise ProtocolError(f"no message of a controller: without {name}")
    return parts[number][-1].bytes()


def _repeated(parts: dict[int, list[Field]], number: int) -> tuple[float, ...]:
    found = tuple(x for field in parts.get(number, ()) for x in field.doubles())
    if len(found) > MOST:
        raise ProtocolError(f"{len(found)} numbers; at most {MOST} are read")
    return found


def _number(field: Field) -> float:
    found = field.doubles()
    if len(found) != 1:
        raise ProtocolError(f"field {field.number} holds {len(found)} numbers instead of one")
    return found[0]


def _numbers(parts: dict[int, list[Field]], number: int) -> tuple[float, ...]:
    """Of joints, which are a message of their own."""
    return _repeated(_parts(parts[number][-1].bytes()), 1) if number in parts else ()


def _position(measured: dict[int, list[Field]]) -> tuple[float, float, float] | None:
    pose = _parts(measured[2][-1].bytes()) if 2 in measured else {}
    place = _parts(pose[1][-1].bytes()) if 1 in pose else {}
    if not all(k in place for k in (1, 2, 3)):
        return None
    x, y, z = (_number(place[k][-1]) for k in (1, 2, 3))
    return x, y, z


def _state(parts: dict[int, list[Field]], number: int) -> int:
    said = _parts(parts[number][-1].bytes()) if number in parts else {}
    return said[1][-1].whole() if 1 in said else 0


def _time(measured: dict[int, list[Field]], header: dict[int, list[Field]]) -> float:
    clock = _parts(measured[4][-1].bytes()) if 4 in measured else {}
    if 1 in clock and (seconds := clock[1][-1].whole()):
        return seconds + 1e-6 * (clock[2][-1].whole() if 2 in clock else 0)
    if 2 not in header:
        raise ProtocolError("says no time")
    return 1e-3 * header[2][-1].whole()


def encode(said: Message, *, clock: bool = True) -> bytes:
    """A datagram, as a controller sends it.

    Args:
        said: What it says.
        clock: Whether it says when it measured; else its header alone has a time, in milliseconds.
    """
    header = wire.whole(1, said.sequence) + wire.whole(2, round(1e3 * said.time) & 0xFFFF_FFFF)
    measured = wire.message(1, wire.doubles(1, said.joints))
    if said.tool is not None:
        place = b"".join(wire.double(k, x) for k, x in enumerate(said.tool, start=1))
        measured += wire.message(2, wire.message(1, place))
    if said.external:
        measured += wire.message(3, wire.doubles(1, said.external))
    if clock:
        whole, part = divmod(round(1e6 * said.time), 1_000_000)
        measured += wire.message(4, wire.whole(1, whole) + wire.whole(2, part))
    out = wire.message(1, header + wire.whole(3, DATA)) + wire.message(2, measured)
    for number, state in ((4, said.motors), (5, said.motion), (8, said.program)):
        out += wire.message(number, wire.whole(1, state))
    if said.force:
        out += wire.message(9, wire.whole(1, 1) + wire.doubles(2, said.force))
    return out + wire.double(10, said.utilization)
