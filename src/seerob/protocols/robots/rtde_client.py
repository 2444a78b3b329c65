"""A client of the real-time data exchange that only listens: it registers no inputs, ever."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

from seerob.protocols import ProtocolError
from seerob.protocols.links.connection import Connection, connected
from seerob.protocols.robots.rtde import (
    MAX_FIELD_NAMES,
    NOT_FOUND,
    Accepted,
    ControllerRequest,
    ControllerVersion,
    Data,
    Kind,
    OutputsReply,
    OutputsRequest,
    Package,
    Recipe,
    Reply,
    Request,
    Splitter,
    StartRequest,
    TextMessage,
    Value,
    VersionRequest,
    decode_reply,
    encode_request,
)

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
