"""The real-time data exchange (RTDE) of Universal Robots, versions 1 and 2: its messages, and a client of it.

A package is big-endian: u16 size of the whole package, u8 kind (an ASCII letter), payload. The client names
the outputs it wants (``O``), the controller answers with their types, and after ``S`` it sends their values
(``U``) at a steady rate. Messages are pure functions, for both ends. The client only listens: it registers no
inputs, ever.
"""

from __future__ import annotations

import struct
from collections.abc import AsyncGenerator, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cache

from seerob.core.samples import Quality
from seerob.protocols import ProtocolError
from seerob.protocols.links.connection import Connection, connected

PORT = 30004
LARGEST = 0xFFFF
"""Size of a package at most [B]: the field is 16 bits wide."""
MAX_FIELD_NAMES = 2048
"""Length of the list of names at most [B]; the controller's own limit."""

_HEADER = struct.Struct(">HB")
_FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}
NOT_FOUND = "NOT_FOUND"
"""Instead of a type: this controller has no such field."""
IN_USE = "IN_USE"
"""Instead of a type: another client writes this input."""


class Kind(IntEnum):
    """Kind of a package."""

    VERSION = ord("V")
    CONTROLLER = ord("v")
    TEXT = ord("M")
    OUTPUTS = ord("O")
    INPUTS = ord("I")
    START = ord("S")
    PAUSE = ord("P")
    DATA = ord("U")


class Level(IntEnum):
    """Level of a text message."""

    EXCEPTION = 0
    ERROR = 1
    WARNING = 2
    INFO = 3


@dataclass(frozen=True, slots=True)
class Package:
    """A whole package, not yet understood."""

    kind: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class VersionRequest:
    """The client would speak this version of the protocol."""

    version: int


@dataclass(frozen=True, slots=True)
class ControllerRequest:
    """The client asks for the version of the controller's software."""


@dataclass(frozen=True, slots=True)
class OutputsRequest:
    """The client wants these outputs."""

    fields: tuple[str, ...]
    frequency: float | None = None
    """[Hz]; version 1 has none and sends at the controller's own rate."""


@dataclass(frozen=True, slots=True)
class InputsRequest:
    """A client wants to write these inputs. Never sent by this package; an emulator must understand it."""

    fields: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class StartRequest:
    """The client wants data from now on."""


@dataclass(frozen=True, slots=True)
class PauseRequest:
    """The client wants no data for now."""


@dataclass(frozen=True, slots=True)
class Accepted:
    """Answer to a request that is granted or not: version, start or pause."""

    kind: Kind
    accepted: bool


@dataclass(frozen=True, slots=True)
class ControllerVersion:
    """Version of the controller's software; CB3 before 5, e-Series and later from 5 on."""

    major: int
    minor: int
    bugfix: int
    build: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.bugfix}.{self.build}"


@dataclass(frozen=True, slots=True)
class OutputsReply:
    """Types of the outputs that were asked for, `NOT_FOUND` for one that there is not."""

    recipe: int
    """Number that the data will carry; version 1 has none: 0."""
    types: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class TextMessage:
    """The controller says something, at any time."""

    text: str
    source: str = ""
    level: int = Level.INFO


@dataclass(frozen=True, slots=True)
class Data:
    """Values of the outputs, still packed; see `Recipe.unpack`."""

    recipe: int
    values: bytes


@dataclass(frozen=True, slots=True)
class InputsReply:
    """Types of inputs that a client wants to write, `NOT_FOUND` and `IN_USE` for those that it may not."""

    recipe: int
    """Number that its data will carry; 0 where it may not write."""
    types: tuple[str, ...]


Request = (
    VersionRequest | ControllerRequest | OutputsRequest | InputsRequest | StartRequest | PauseRequest | Data
)
Reply = Accepted | ControllerVersion | OutputsReply | InputsReply | TextMessage | Data
Value = bool | int | float | tuple[int, ...] | tuple[float, ...]


# -- packages out of a stream -------------------------------------------------------------------


class Splitter:
    """Cuts a stream of bytes into packages, however it was cut on the way. Holds one package at most."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> list[Package]:
        """The packages that are complete now.

        Raises:
            ProtocolError: A size that cannot be; what follows in the stream means nothing any more.
        """
        rest = self._rest
        rest += data
        packages: list[Package] = []
        start = 0
        while len(rest) - start >= _HEADER.size:
            size, kind = _HEADER.unpack_from(rest, start)
            if size < _HEADER.size:
                raise ProtocolError(f"a package of {size} bytes; the least is {_HEADER.size}")
            if len(rest) - start < size:
                break
            packages.append(Package(kind, bytes(rest[start + _HEADER.size : start + size])))
            start += size
        del rest[:start]
        return packages


def pack(kind: int, payload: bytes = b"") -> bytes:
    """A package with its header.

    Raises:
        ProtocolError: Larger than a package may be.
    """
    size = _HEADER.size + len(payload)
    if size > LARGEST:
        raise ProtocolError(f"a package of {size} bytes; the most is {LARGEST}")
    return _HEADER.pack(size, kind) + payload


# -- what the client says -----------------------------------------------------------------------


def encode_request(message: Request, version: int) -> bytes:
    """Bytes of a request in a version (1 or 2) of the protocol."""
    match message:
        case VersionRequest():
            return pack(Kind.VERSION, struct.pack(">H", message.version))
        case ControllerRequest():
            return pack(Kind.CONTROLLER)
        case OutputsRequest():
            names = ",".join(message.fields).encode("ascii")
            if version == 1:
                return pack(Kind.OUTPUTS, names)
            if message.frequency is None:
                raise ProtocolError("version 2 needs a frequency")
            return pack(Kind.OUTPUTS, struct.pack(">d", message.frequency) + names)
        case InputsRequest():
            return pack(Kind.INPUTS, ",".join(message.fields).encode("ascii"))
        case StartRequest():
            return pack(Kind.START)
        case PauseRequest():
            return pack(Kind.PAUSE)
        case Data():
            return pack(Kind.DATA, bytes([message.recipe]) + message.values)


def decode_request(package: Package, version: int) -> Request:
    """What a client asks.

    Raises:
        ProtocolError: Not a request, or one of the wrong length.
    """
    payload = package.payload
    match package.kind:
        case Kind.VERSION:
            return VersionRequest(*_unpack(">H", payload, "version request"))
        case Kind.CONTROLLER:
            return ControllerRequest()
        case Kind.OUTPUTS:
            if version == 1:
                return OutputsRequest(_names(payload))
            if len(payload) < 8:
                raise ProtocolError(
                    f"an output request of {len(payload)} bytes; it begins with 8 of frequency"
                )
            return OutputsRequest(_names(payload[8:]), struct.unpack_from(">d", payload)[0])
        case Kind.INPUTS:
            return InputsRequest(_names(payload))
        case Kind.START:
            return StartRequest()
        case Kind.PAUSE:
            return PauseRequest()
        case Kind.DATA:
            return Data(_first(payload), payload[1:])
    raise ProtocolError(f"package of kind {package.kind} is no request")


def _names(payload: bytes) -> tuple[str, ...]:
    """Names between commas; ur_rtde ends its list with a comma, so that empty names mean nothing."""
    return tuple(name for name in payload.decode("latin-1").split(",") if name)


# -- what the controller says -------------------------------------------------------------------


def encode_reply(message: Reply, version: int) -> bytes:
    """Bytes of what a controller says in a version (1 or 2) of the protocol."""
    match message:
        case Accepted():
            return pack(message.kind, bytes([message.accepted]))
        case ControllerVersion():
            numbers = message.major, message.minor, message.bugfix, message.build
            return pack(Kind.CONTROLLER, struct.pack(">4I", *numbers))
        case OutputsReply():
            types = ",".join(message.types).encode("ascii")
            return pack(Kind.OUTPUTS, types if version == 1 else bytes([message.recipe]) + types)
        case InputsReply():
            return pack(Kind.INPUTS, bytes([message.recipe]) + ",".join(message.types).encode("ascii"))
        case TextMessage():
            text = message.text.encode("utf-8")
            if version == 1:
                return pack(Kind.TEXT, bytes([message.level]) + text)
            text, source = text[:255], message.source.encode("utf-8")[:255]
            body = bytes([len(text)]) + text + bytes([len(source)]) + source + bytes([message.level])
            return pack(Kind.TEXT, body)
        case Data():
            return pack(
                Kind.DATA, message.values if version == 1 else bytes([message.recipe]) + message.values
            )


def decode_reply(package: Package, version: int) -> Reply:
    """What the controller says.

    Raises:
        ProtocolError: Nothing that it may say, or of the wrong length.
    """
    payload = package.payload
    match package.kind:
        case Kind.VERSION | Kind.START | Kind.PAUSE:
            (accepted,) = _unpack(">B", payload, "answer")
            return Accepted(Kind(package.kind), bool(accepted))
        case Kind.CONTROLLER:
            return ControllerVersion(*_unpack(">4I", payload, "controller version"))
        case Kind.OUTPUTS:
            recipe, types = (0, payload) if version == 1 else (_first(payload), payload[1:])
            return OutputsReply(recipe, tuple(types.decode("latin-1").split(",")) if types else ())
        case Kind.TEXT:
            return _text(payload, version)
        case Kind.DATA:
            return Data(0, payload) if version == 1 else Data(_first(payload), payload[1:])
    raise ProtocolError(f"package of unknown kind {package.kind}")


def _text(payload: bytes, version: int) -> TextMessage:
    if version == 1:
        return TextMessage(payload[1:].decode("utf-8", "replace"), level=_first(payload))
    end = 1 + _first(payload)
    text, rest = payload[1:end], payload[end:]
    source, level = rest[1 : 1 + _first(rest)], rest[1 + _first(rest) :]
    if len(level) != 1:
        raise ProtocolError("a text message whose lengths do not fit")
    return TextMessage(text.decode("utf-8", "replace"), source.decode("utf-8", "replace"), level[0])


def _first(payload: bytes) -> int:
    if not payload:
        raise ProtocolError("a package that ends too early")
    return payload[0]


def _unpack(form: str, payload: bytes, what: str) -> tuple[int, ...]:
    if len(payload) != struct.calcsize(form):
        raise ProtocolError(f"{what} of {len(payload)} bytes; it has {struct.calcsize(form)}")
    return struct.unpack(form, payload)


# -- values -------------------------------------------------------------------------------------


class Recipe:
    """How the values of a data package are laid out.

    Args:
        fields: Names in order.
        types: Their types.
        number: The recipe's number; data of another one is not for it.

    Raises:
        ProtocolError: Another number of types than of fields, or a type that is none.
    """

    def __init__(self, fields: tuple[str, ...], types: tuple[str, ...], number: int) -> None:
        if len(fields) != len(types):
            raise ProtocolError(f"{len(types)} types for {len(fields)} fields")
        wrong = [f"{t[:40]!r} of {f}" for f, t in zip(fields, types, strict=True) if t not in _FORMATS]
        if wrong:
            raise ProtocolError(f"types that are none: {', '.join(wrong[:4])}")
        self.fields, self.types, self.number = fields, types, number
        self._struct = struct.Struct(">" + "".join(_FORMATS[t] for t in types))
        self._slices: list[tuple[str, int, int]] = []
        at = 0
        for name, kind in zip(fields, types, strict=True):
            width = int(_FORMATS[kind][0]) if kind.startswith("VECTOR") else 1
            self._slices.append((name, at, width if kind.startswith("VECTOR") else 0))
            at += width

    @property
    def size(self) -> int:
        """Length of the values [B]."""
        return self._struct.size

    def unpack(self, values: bytes) -> dict[str, Value]:
        """Values by field.

        Raises:
            ProtocolError: Of another length than this recipe's.
        """
        if len(values) != self._struct.size:
            raise ProtocolError(f"data of {len(values)} bytes; the recipe has {self._struct.size}")
        flat = self._struct.unpack(values)
        return {name: flat[at : at + width] if width else flat[at] for name, at, width in self._slices}

    def pack(self, values: dict[str, Value]) -> bytes:
        """The values of every field, packed."""
        flat: list[bool | int | float] = []
        for name, _, width in self._slices:
            value = values[name]
            flat.extend(value if width and isinstance(value, tuple) else (value,))  # type: ignore[arg-type]
        return self._struct.pack(*flat)


ANSWER_WITHIN = 2.0
"""Of each request [s]."""
SILENCE = 1.0
"""Longest pause in the data before the connection is taken for dead [s]."""
CB3_RATE = 125.0
"""The most that a CB3 controller sends [Hz]: asked for more, some refuse."""
TALK = 64
"""Packages that may come before an answer: text messages, data of another recipe."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One data package."""

    arrived: float
    """Host's monotonic time [s]."""
    values: dict[str, Value]


@dataclass(eq=False)
class Session:
    """A connection that is set up.

    Attributes:
        version: Of the protocol, 2 or 1.
        controller: Version of its software; None when it would not say.
        recipe: Fields that it sends.
        missing: Fields that were asked for and that it does not have.
    """

    version: int
    controller: ControllerVersion | None
    recipe: Recipe
    missing: tuple[str, ...]
    _stream: _Stream

    async def receive(self) -> AsyncGenerator[Reading | TextMessage, None]:
        """What the controller sends, until it closes.

        Raises:
            ProtocolError: Bytes that are no package, or data that does not fit the recipe.
            TimeoutError: It has fallen silent.
        """
        while True:
            for reply in self._stream.waiting():
                if isinstance(reply, TextMessage):
                    yield reply
                elif isinstance(reply, Data) and (self.version == 1 or reply.recipe == self.recipe.number):
                    yield Reading(self._stream.arrived, self.recipe.unpack(reply.values))
            if not await self._stream.read(SILENCE):
                return


@asynccontextmanager
async def connect(
    host: str, port: int, fields: tuple[str, ...], frequency: float
) -> AsyncGenerator[Session, None]:
    """Connect, agree on a version and on the fields, and start.

    Args:
        host: Name or address of the controller.
        port: 30004 of a real one.
        fields: Outputs that are wanted; what the controller does not have is left out.
        frequency: [Hz]; what the controller cannot do it refuses or lowers.

    Raises:
        OSError: There is no connection.
        TimeoutError: It does not answer.
        ProtocolError: It answers nonsense, or refuses.
    """
    async with connected(host, port, ANSWER_WITHIN) as connection:
        yield await _set_up(_Stream(connection), fields, frequency)


@dataclass(eq=False)
class _Stream:
    connection: Connection
    version: int = 2
    arrived: float = 0.0
    """When the newest bytes arrived, host's monotonic time [s]."""
    _splitter: Splitter = field(default_factory=Splitter)
    _waiting: list[Package] = field(default_factory=list)

    def waiting(self) -> Iterator[Reply]:
        """What has arrived and was not looked at."""
        while self._waiting:
            yield decode_reply(self._waiting.pop(0), self.version)

    async def read(self, patience: float) -> bool:
        """Wait for more; False when the other end has closed."""
        self.arrived, data, _ = await self.connection.read(patience)
        self._waiting += self._splitter.feed(data)
        return bool(data)

    async def ask(self, request: Request, kind: Kind) -> tuple[Reply, ...]:
        """Send a request, and wait for the answer of a kind; what was said before it comes first."""
        await self.connection.write(encode_request(request, self.version))
        said: list[Reply] = []
        while True:
            while self._waiting:
                package = self._waiting.pop(0)
                said.append(decode_reply(package, self.version))
                if package.kind == kind:
                    return tuple(said)
                if len(said) > TALK:
                    raise ProtocolError(f"{TALK} packages and no answer to {type(request).__name__}")
            if not await self.read(ANSWER_WITHIN):
                raise ProtocolError(f"closed the connection instead of answering {type(request).__name__}")


def is_cb3(controller: ControllerVersion | None) -> bool:
    """Whether it is of the generation before the e-Series."""
    return controller is not None and controller.major < 5


async def _set_up(stream: _Stream, fields: tuple[str, ...], frequency: float) -> Session:
    said = list(await stream.ask(VersionRequest(2), Kind.VERSION))
    if said[-1] != Accepted(Kind.VERSION, accepted=True):
        stream.version = 1
        # Old controllers know no request for a version at all and go on with 1.
    controller = None
    answer = (await stream.ask(ControllerRequest(), Kind.CONTROLLER))[-1]
    if isinstance(answer, ControllerVersion):
        controller = answer
    if is_cb3(controller):
        frequency = min(frequency, CB3_RATE)
    recipe, missing = await _agree(stream, fields, frequency)
    (*_, started) = await stream.ask(StartRequest(), Kind.START)
    if started != Accepted(Kind.START, accepted=True):
        raise ProtocolError("refused to start sending")
    return Session(stream.version, controller, recipe, missing, stream)


async def _agree(
    stream: _Stream, fields: tuple[str, ...], frequency: float
) -> tuple[Recipe, tuple[str, ...]]:
    """The recipe without the fields that are not there, which a second request leaves out."""
    missing: tuple[str, ...] = ()
    for _ in range(3):
        wanted = tuple(name for name in fields if name not in missing)
        if not wanted:
            raise ProtocolError(f"has none of the fields {', '.join(fields)}")
        if len(",".join(wanted)) > MAX_FIELD_NAMES:
            raise ProtocolError(f"more than {MAX_FIELD_NAMES} bytes of field names")
        request = OutputsRequest(wanted, None if stream.version == 1 else frequency)
        (*_, reply) = await stream.ask(request, Kind.OUTPUTS)
        if not isinstance(reply, OutputsReply) or len(reply.types) != len(wanted):
            n = len(reply.types) if isinstance(reply, OutputsReply) else 0
            raise ProtocolError(f"{n} types for {len(wanted)} fields: {frequency:g} Hz may be refused")
        lacking = tuple(f for f, t in zip(wanted, reply.types, strict=True) if t == NOT_FOUND)
        if not lacking:
            return Recipe(wanted, reply.types, reply.recipe), missing
        missing += lacking
    raise ProtocolError(f"says that it has {missing[-1]!r} and then that it has not")


# -- what state numbers mean ----------------------------------------------------------------------


class RobotMode(IntEnum):
    """Field ``robot_mode``."""

    NO_CONTROLLER = -1
    DISCONNECTED = 0
    CONFIRM_SAFETY = 1
    BOOTING = 2
    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    BACKDRIVE = 6
    RUNNING = 7
    UPDATING_FIRMWARE = 8


class SafetyStatus(IntEnum):
    """Fields ``safety_status`` and ``safety_mode``."""

    NORMAL = 1
    REDUCED = 2
    PROTECTIVE_STOP = 3
    RECOVERY = 4
    SAFEGUARD_STOP = 5
    SYSTEM_EMERGENCY_STOP = 6
    ROBOT_EMERGENCY_STOP = 7
    VIOLATION = 8
    FAULT = 9
    VALIDATE_JOINT_ID = 10
    UNDEFINED = 11
    AUTOMATIC_MODE_SAFEGUARD_STOP = 12
    SYSTEM_THREE_POSITION_ENABLING_STOP = 13
    TP_THREE_POSITION_ENABLING_STOP = 14
    IMMI_EMERGENCY_STOP = 15
    IMMI_SAFEGUARD_STOP = 16
    PROFISAFE_WAITING_FOR_PARAMETERS = 17
    PROFISAFE_AUTOMATIC_MODE_SAFEGUARD_STOP = 18
    PROFISAFE_SAFEGUARD_STOP = 19
    PROFISAFE_EMERGENCY_STOP = 20
    SAFETY_API_SAFEGUARD_STOP = 22


LIVE_ENCODERS = frozenset({RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.BACKDRIVE, RobotMode.RUNNING})
"""Robot modes in which the joints are powered and say where they are."""
UNSURE_OF_ITSELF = frozenset({SafetyStatus.VALIDATE_JOINT_ID, SafetyStatus.UNDEFINED})
"""The controller does not know its joints."""
DOUBTFUL = frozenset({SafetyStatus.VIOLATION, SafetyStatus.FAULT})
"""Something is broken; what it says of itself may be too."""


def quality(robot_mode: int | None, safety_status: int | None) -> Quality:
    """Whether the joint positions of a sample are the truth.

    A stop, even an emergency stop, is no reason for doubt: the joints stand where they say. The way of
    speaking of an unknown number is doubt.

    Args:
        robot_mode: None when the controller has no such field, which leaves in doubt whether it is on.
        safety_status: None when it has no such field.
    """
    if safety_status in UNSURE_OF_ITSELF:
        return Quality.INVALID
    if robot_mode is None:
        return Quality.DEGRADED
    if robot_mode not in LIVE_ENCODERS:
        return Quality.INVALID
    if safety_status is not None and (safety_status in DOUBTFUL or name(SafetyStatus, safety_status) is None):
        return Quality.DEGRADED
    return Quality.GOOD


def name(numbers: type[IntEnum], number: int) -> str | None:
    """Name of a number; None for one that nobody explained."""
    return _state_names(numbers).get(number)


@cache
def _state_names(numbers: type[IntEnum]) -> dict[int, str]:
    return {int(one): one.name for one in numbers}
