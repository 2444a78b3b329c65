"""KUKA's Fast Robot Interface (FRI) 1.x, 2.5 and 2.7: datagrams to values and back, pure functions.

Field numbers, enumerations and framings as read in the maker's client library (branches 1.11 to 2.7)
and checked against what its example programs send. Up to 2.5 a datagram is one Protocol Buffers message;
2.7 puts its length before it and its CRC-32 behind it. Which of them a controller speaks is told by the
datagram itself.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum, StrEnum

from seerob.protocols import ProtocolError
from seerob.protocols.links.protobuf_wire import Field, Wire, double, doubles, fields, message, whole

PORT = 30200
"""Of the client: the controller sends there."""
LARGEST = 1500
"""Datagram [bytes]."""
MONITORING, COMMAND = 0x245142, 0x34001
"""Identifiers of the two messages."""
_DOUBLE = bytes([1 << 3 | Wire.FIXED64])
"""Tag of field 1 with a number of eight bytes."""
MOST_JOINTS = 16
POSE = 7
"""Elements of a pose: three of a place and four of a quaternion."""


class Edition(StrEnum):
    """Which FRI a controller speaks, as far as the answers differ."""

    V1 = "1"
    """1.11 to 1.16: repeats the commanded joints, and its answers do too."""
    V2 = "2.5"
    V2_7 = "2.7"
    """With length and checksum."""


class SessionState(IntEnum):
    """How far the session is."""

    IDLE = 0
    MONITORING_WAIT = 1
    MONITORING_READY = 2
    COMMANDING_WAIT = 3
    COMMANDING_ACTIVE = 4


class Quality(IntEnum):
    """How regularly our answers arrive, as the controller sees it."""

    POOR = 0
    FAIR = 1
    GOOD = 2
    EXCELLENT = 3


class SafetyState(IntEnum):
    """What the safety controller does."""

    NORMAL_OPERATION = 0
    SAFETY_STOP_LEVEL_0 = 1
    SAFETY_STOP_LEVEL_1 = 2
    SAFETY_STOP_LEVEL_2 = 3


class DriveState(IntEnum):
    """State of the drives."""

    OFF = 0
    TRANSITIONING = 1
    ACTIVE = 2


class OperationMode(IntEnum):
    """Chosen on the pendant."""

    T1 = 0
    T2 = 1
    AUT = 2


class ControlMode(IntEnum):
    """Control mode of the arm."""

    POSITION = 0
    CARTESIAN_IMPEDANCE = 1
    JOINT_IMPEDANCE = 2
    NO_CONTROL = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Monitoring:
    """What the controller sends."""

    edition: Edition
    sequence: int
    """Counts its messages."""
    reflected: int = 0
    """Number of our answer that it saw last."""
    session: int = 0
    """`SessionState`; a number that nobody explained stays a number, here and below."""
    quality: int = 0
    send_period: int = 0
    """[ms]"""
    receive_multiplier: int = 1
    """It wants an answer to every so many messages."""
    safety: int | None = None
    drives: tuple[int, ...] = ()
    operation: int | None = None
    control: int | None = None
    q: tuple[float, ...] = ()
    """Measured [rad]."""
    tau: tuple[float, ...] = ()
    """Measured [N·m]."""
    commanded_q: tuple[float, ...] = ()
    """[rad]; FRI 1.x only."""
    external_tau: tuple[float, ...] = ()
    """Estimated, without those of the arm's own motion [N·m]."""
    ipo_q: tuple[float, ...] = ()
    """What the controller's own interpolator wants [rad]; while commanding."""
    tcp: tuple[float, ...] = ()
    """Pose of the robot's tool centre point in its base frame: x, y, z [mm], then a quaternion, w first; FRI
    2.x only. The maker's client library says so (``getMeasuredCartesianPose``, 2.5)."""
    time: float | None = None
    """Time of the controller, since 1970 [s]."""
    io: tuple[tuple[str, float], ...] = ()
    """Values of the inputs and outputs that the robot program shares."""


# -- framing ------------------------------------------------------------------------------------


def unframed(datagram: bytes) -> tuple[bytes, bool]:
    """The message of a datagram, and whether it was framed as in 2.7.

    Raises:
        ProtocolError: Too long, or a checksum that is wrong.
    """
    if len(datagram) > LARGEST:
        raise ProtocolError(f"a datagram of {len(datagram)} bytes; FRI has {LARGEST} at most")
    if len(datagram) >= 8 and struct.unpack_from("<I", datagram)[0] + 8 == len(datagram):
        found, crc = datagram[4:-4], struct.unpack_from("<I", datagram, len(datagram) - 4)[0]
        if zlib.crc32(found) != crc:
            raise ProtocolError("the checksum of a datagram is wrong")
        return found, True
    return datagram, False


def framed(data: bytes, edition: Edition) -> bytes:
    """A datagram of a message."""
    if edition is not Edition.V2_7:
        return data
    return struct.pack("<I", len(data)) + data + struct.pack("<I", zlib.crc32(data))


# -- what the controller sends ------------------------------------------------------------------


def decode_monitoring(datagram: bytes) -> Monitoring:
    """What a datagram of the controller says.

    Raises:
        ProtocolError: It is no monitoring message.
    """
    data, with_frame = unframed(datagram)
    parts = {f.number: f for f in fields(data)}
    identifier, sequence, reflected = _header(parts.get(1))
    if identifier != MONITORING:
        raise ProtocolError(
            f"message 0x{identifier:x} where 0x{MONITORING:x} belongs: no FRI controller of an LBR"
        )
    found: dict[str, object] = {}
    joints = _robot(parts.get(2), found)
    _connection(parts.get(4), found)
    _measured(parts.get(3), found)
    _interpolated(parts.get(5), found)
    q = found.get("q", ())
    if (
        not isinstance(q, tuple)
        or not 1 <= len(q) <= MOST_JOINTS
        or (joints is not None and joints != len(q))
    ):
        n = len(q) if isinstance(q, tuple) else 0
        raise ProtocolError(f"{n} joint positions of a robot with {joints or 'an unknown number of'} joints")
    edition = Edition.V2_7 if with_frame else Edition.V1 if "commanded_q" in found else Edition.V2
    return Monitoring(edition=edition, sequence=sequence, reflected=reflected, **found)  # type: ignore[arg-type]


def _header(field: Field | None) -> tuple[int, int, int]:
    if field is None:
        raise ProtocolError("a message without a header")
    found = {f.number: f.whole() for f in fields(field.bytes())}
    try:
        return found[1], found[2], found[3]
    except KeyError as error:
        raise ProtocolError(f"a header without field {error}") from None


def _robot(field: Field | None, found: dict[str, object]) -> int | None:
    """State of the robot; returns the number of joints."""
    joints: int | None = None
    drives: list[int] = []
    for f in fields(b"" if field is None else field.bytes()):
        if f.number == 1:
            joints = f.whole()
        elif f.number == 2:
            found["safety"] = f.whole()
        elif f.number == 5:
            drives += f.wholes()
        elif f.number == 6:
            found["operation"] = f.whole()
        elif f.number == 7:
            found["control"] = f.whole()
    found["drives"] = tuple(drives[:MOST_JOINTS])
    return joints


def _connection(field: Field | None, found: dict[str, object]) -> None:
    names = {1: "session", 2: "quality", 3: "send_period", 4: "receive_multiplier"}
    for f in fields(b"" if field is None else field.bytes()):
        if f.number in names:
            found[names[f.number]] = f.whole()


def _measured(field: Field | None, found: dict[str, object]) -> None:
    names = {1: "q", 2: "tau", 3: "commanded_q", 5: "external_tau"}
    io: list[tuple[str, float]] = []
    for f in fields(b"" if field is None else field.bytes()):
        if f.number in names:
            found[names[f.number]] = _joint_values(f)
        elif f.number == 8:
            io.append(_io_value(f))
        elif f.number == 9:
            found["tcp"] = _pose(f)
        elif f.number == 15:
            stamp = {part.number: part.whole() for part in fields(f.bytes())}
            found["time"] = stamp.get(1, 0) + 1e-9 * stamp.get(2, 0)
    found["io"] = tuple(io)


def _interpolated(field: Field | None, found: dict[str, object]) -> None:
    for f in fields(b"" if field is None else field.bytes()):
        if f.number == 1:
            found["ipo_q"] = _joint_values(f)


def _joint_values(field: Field) -> tuple[float, ...]:
    data = field.bytes()
    count, rest = divmod(len(data), 9)
    if not rest and count <= MOST_JOINTS and data[::9] == _DOUBLE * count:
        # One by one, as controllers send them: most of the time of a message goes into these.
        return struct.unpack("<" + count * "xd", data)
    return tuple(x for f in fields(field.bytes()) if f.number == 1 for x in f.doubles())


def _pose(field: Field) -> tuple[float, ...]:
    """Its seven elements; none unless all are there."""
    said = tuple(x for f in fields(field.bytes()) if f.number == 2 for x in f.doubles())
    return said if len(said) == POSE else ()


def _io_value(field: Field) -> tuple[str, float]:
    name, value = "", 0.0
    for f in fields(field.bytes()):
        if f.number == 1:
            name = f.text()[:63]
        elif f.number == 4:
            value = float(f.whole())
        elif f.number == 5:
            value = next(iter(f.doubles()), value)
    return name, value


def encode_monitoring(m: Monitoring) -> bytes:
    """A datagram as the controller sends it."""
    robot = whole(1, len(m.q)) + whole(2, m.safety) + b"".join(whole(5, d) for d in m.drives)
    robot += whole(6, m.operation) + whole(7, m.control)
    stamp = None
    if m.time is not None:
        stamp = whole(1, int(m.time)) + whole(2, round(1e9 * (m.time - int(m.time))))
    measured = b"".join(
        message(number, doubles(1, values)) if values else b""
        for number, values in ((1, m.q), (2, m.tau), (3, m.commanded_q), (5, m.external_tau))
    )
    measured += b"".join(
        message(8, message(1, name.encode()) + whole(2, 2) + whole(3, 1) + double(5, value))
        for name, value in m.io
    )
    if m.tcp:
        measured += message(9, message(1, b"measuredCartesianPose") + doubles(2, m.tcp))
    measured += message(15, stamp)
    connection = whole(1, m.session) + whole(2, m.quality) + whole(3, m.send_period)
    connection += whole(4, m.receive_multiplier)
    data = message(1, whole(1, MONITORING) + whole(2, m.sequence) + whole(3, m.reflected))
    data += message(2, robot) + message(3, measured) + message(4, connection)
    if m.ipo_q:
        data += message(5, message(1, doubles(1, m.ipo_q)))
    return framed(data, m.edition)


# -- what we answer -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Answer:
    """What keeps a session alive."""

    edition: Edition
    sequence: int
    reflected: int
    """Number of the controller's message that it answers."""
    q: tuple[float, ...] = ()
    """Joints that are repeated [rad]; never others than the controller's own."""


def answer_to(m: Monitoring, sequence: int) -> Answer | None:
    """The answer that keeps a monitoring session alive and moves nothing; None while it is idle.

    An overlay that a robot program has started is answered with the controller's own joints, as the
    maker's library does: another answer would be a command, none would stop the program.
    """
    if m.session == SessionState.IDLE:
        return None
    q: tuple[float, ...] = ()
    if m.session in (SessionState.COMMANDING_WAIT, SessionState.COMMANDING_ACTIVE):
        q = m.ipo_q or m.commanded_q or m.q
    elif m.edition is Edition.V1:
        q = m.commanded_q
    return Answer(m.edition, sequence, m.sequence, q)


def encode_answer(answer: Answer) -> bytes:
    """The datagram of an answer."""
    header = whole(1, COMMAND) + whole(2, answer.sequence) + whole(3, answer.reflected)
    data = message(1, header)
    if answer.q:
        data += message(2, message(1, doubles(1, answer.q)))
    return framed(data, answer.edition)


def decode_answer(datagram: bytes, edition: Edition) -> Answer:
    """What a client answered.

    Raises:
        ProtocolError: It is no command message, or not framed as the edition has it.
    """
    data, with_frame = unframed(datagram)
    if with_frame != (edition is Edition.V2_7):
        raise ProtocolError(f"an answer that is not framed as FRI {edition} has it")
    parts = {f.number: f for f in fields(data)}
    identifier, sequence, reflected = _header(parts.get(1))
    if identifier != COMMAND:
        raise ProtocolError(f"message 0x{identifier:x} where 0x{COMMAND:x} belongs")
    q: tuple[float, ...] = ()
    if 2 in parts:
        for f in fields(parts[2].bytes()):
            q = _joint_values(f) if f.number == 1 else q
    return Answer(edition, sequence, reflected, q)
