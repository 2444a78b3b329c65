"""The rosbridge protocol, version 2: operations as JSON in text frames or as CBOR in binary ones.

Source: rosbridge_suite, ROSBRIDGE_PROTOCOL.md. A server answers a mistake with ``status``, cuts what is long
into ``fragment``, and sends what was subscribed as ``publish``. Pictures of messages (``png``) are refused:
nobody asks for them here.

A client of rosbridge that only listens: it subscribes, and surfaces what the server says of that.
"""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections.abc import AsyncGenerator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

from seerob.core.extras import need
from seerob.protocols import ProtocolError
from seerob.protocols.links.websocket_link import Link
from seerob.protocols.ros.ros_messages import Content, Edition, RosMessage, read, store
from seerob.protocols.ros.ros_messages import decode as deserialise

PORT = 9090
MAX_MESSAGE = 1 << 20
"""[byte]"""
MOST_FRAGMENTS = 256
MOST_UNFINISHED = 8
"""Messages of which fragments are kept at once."""
TYPED = {64: "<u1", 69: "<u2", 70: "<u4", 71: "<u8", 72: "<i1", 77: "<i2", 78: "<i4", 79: "<i8"} | {
    85: "<f4",
    86: "<f8",
}
"""Tags of typed arrays (RFC 8746), little-endian."""


class Compression(StrEnum):
    """How messages are to come."""

    NONE = "none"
    """JSON."""
    CBOR = "cbor"
    """CBOR. ROS 1 servers fail at it for messages with lists of texts, which joints have."""
    CBOR_RAW = "cbor-raw"
    """Bytes that ROS serialises, in CBOR."""


@dataclass(frozen=True, slots=True)
class Published:
    """A message of a topic."""

    topic: str
    message: Any
    """Fields by name; for `Compression.CBOR_RAW` a table with ``bytes``."""


@dataclass(frozen=True, slots=True)
class Status:
    """What the server says of what it was asked."""

    level: str
    text: str
    id: str = ""


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer of a service."""

    id: str
    values: Any
    good: bool


Operation = Published | Status | Answer


def subscribe(topic: str, message_type: str, *, interval: float, compression: Compression) -> str:
    """Ask for a topic; only the newest message waits at the server.

    Args:
        topic: Its name.
        message_type: Empty to take the topic as it is.
        interval: Least time between two messages [s].
        compression: How they are to come.
    """
    asked: dict[str, object] = {"op": "subscribe", "id": topic, "topic": topic}
    if message_type:
        asked["type"] = message_type
    milliseconds = int(1000 * interval)
    asked |= {"throttle_rate": milliseconds, "queue_length": 1, "compression": str(compression)}
    return json.dumps(asked)


def unsubscribe(topic: str) -> str:
    """Take it back."""
    return json.dumps({"op": "unsubscribe", "id": topic, "topic": topic})


def advertise(topic: str, message_type: str) -> str:
    """Say that messages will be published."""
    return json.dumps({"op": "advertise", "id": topic, "topic": topic, "type": message_type})


def publish(topic: str, message: dict[str, object]) -> str:
    """Publish a message; numbers must be finite."""
    return json.dumps({"op": "publish", "topic": topic, "msg": message}, allow_nan=False)


def unadvertise(topic: str) -> str:
    """Say that no more will come."""
    return json.dumps({"op": "unadvertise", "id": topic, "topic": topic})


def call(service: str, id_: str) -> str:
    """Ask a service without arguments."""
    return json.dumps({"op": "call_service", "id": id_, "service": service, "args": {}})


class Reader:
    """Reads what a server sends, and puts fragments together."""

    def __init__(self) -> None:
        self._parts: dict[str, dict[int, str]] = {}

    def take(self, data: bytes | str) -> Operation | None:
        """What a frame says; None for a fragment of more to come and for what is of no interest.

        Args:
            data: Text of a text frame, bytes of a binary one.

        Raises:
            ProtocolError: It cannot be understood.
        """
        if len(data) > MAX_MESSAGE:
            raise ProtocolError(f"a message of {len(data)} bytes; at most {MAX_MESSAGE} are read")
        frame = _json(data) if isinstance(data, str) else _cbor(data)
        if not isinstance(frame, dict):
            raise ProtocolError("an operation that is no table")
        if frame.get("op") == "fragment":
            whole = self._put(frame)
            if whole is None:
                return None
            frame = _json(whole)
            if not isinstance(frame, dict) or frame.get("op") == "fragment":
                raise ProtocolError("fragments of no operation")
        return _operation(frame)

    def _put(self, frame: dict[object, object]) -> str | None:
        name, number, total, data = (frame.get(key) for key in ("id", "num", "total", "data"))
        if not isinstance(number, int) or not isinstance(total, int) or not isinstance(data, str):
            raise ProtocolError("a fragment without its place or its data")
        if not 0 <= number < total <= MOST_FRAGMENTS or not isinstance(name, str | int):
            raise ProtocolError("a fragment without its place")
        parts = self._parts.setdefault(str(name)[:200], {})
        if len(self._parts) > MOST_UNFINISHED:
            del self._parts[next(iter(self._parts))]
        parts[number] = data
        if sum(map(len, parts.values())) > MAX_MESSAGE:
            self._parts.clear()
            raise ProtocolError(f"fragments of more than {MAX_MESSAGE} bytes")
        if len(parts) < total:
            return None
        self._parts.pop(str(name)[:200], None)
        try:
            return "".join(parts[k] for k in range(total))
        except KeyError:
            raise ProtocolError("fragments that do not fit together") from None


def _operation(frame: dict[object, object]) -> Operation | None:
    op = frame.get("op")
    if op == "publish":
        topic = frame.get("topic")
        if not isinstance(topic, str):
            raise ProtocolError("a message without a topic")
        return Published(topic, frame.get("msg"))
    if op == "status":
        level, text, name = (str(frame.get(key, ""))[:1000] for key in ("level", "msg", "id"))
        return Status(level, text, name)
    if op == "service_response":
        return Answer(str(frame.get("id", ""))[:200], frame.get("values"), frame.get("result") is not False)
    if op == "png":
        raise ProtocolError("sends messages as pictures (png), which nobody asked for")
    return None


def message(content: Content, published: Published, edition: Edition) -> RosMessage:
    """What a published message says.

    Args:
        content: What it is a message of.
        published: The message.
        edition: Of ROS, for messages that come serialised.

    Raises:
        ProtocolError: It cannot be understood.
    """
    said = published.message
    if isinstance(said, dict) and isinstance(said.get("bytes"), bytes):
        return deserialise(content, said["bytes"], edition)
    return read(content, said)


def _json(text: str) -> object:
    # Some servers write NaN as such, which is no JSON, and others as null: both come out as not finite.
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ProtocolError(f"no JSON: {str(error)[:100]}") from None


def _cbor(data: bytes) -> object:
    need("cbor2")
    import cbor2

    try:
        return cbor2.loads(data, tag_hook=_typed)
    except ProtocolError:
        raise
    except Exception as error:  # of many kinds, by what the bytes are
        raise ProtocolError(f"no CBOR: {type(error).__name__} {str(error)[:100]}") from None


def _typed(*said: Any) -> Any:
    import numpy as np

    tag = said[-1] if hasattr(said[-1], "tag") else said[0]
    kind = TYPED.get(tag.tag)
    if kind is None or not isinstance(tag.value, bytes):
        raise ProtocolError(f"a value with the unknown tag {tag.tag}")
    if len(tag.value) % np.dtype(kind).itemsize:
        raise ProtocolError(f"an array of {len(tag.value)} bytes of {kind}")
    return np.frombuffer(tag.value, kind).tolist()


_log = logging.getLogger(__name__)

SILENCE = 2.0
"""A topic without a message for so long is taken for dead [s]."""
NONSENSE = 50
"""Messages in a row that cannot be read before the connection is given up."""


class ReceivedMessage(NamedTuple):
    """One message."""

    arrived: float
    """Host's monotonic time [s]."""
    topic: str
    said: RosMessage
    doubt: str = ""
    """Why it may be of another robot; empty where it may not."""


async def hear(
    link: Link,
    content: Content,
    topics: Sequence[str],
    *,
    interval: float,
    compression: Compression,
    edition: Edition,
    type_name: str = "",
    silence: float | None = SILENCE,
) -> AsyncGenerator[ReceivedMessage, None]:
    """What is published on topics of one type.

    A compression that brings nothing is given up once for JSON: servers of ROS 1 fail at CBOR without a word.

    Args:
        link: The connection.
        content: What the messages say.
        topics: The first is watched; what is said on the others may be said once only.
        interval: Least time between two messages [s].
        compression: How they are to come.
        edition: Of ROS, for serialised messages.
        type_name: Of the messages, as the server knows it; empty to take the topics as they are.
        silence: Longest pause of the first topic [s]; None for any.

    Raises:
        TimeoutError: Nothing for so long.
        ProtocolError: The server refuses, sends nonsense, or breaks the connection.
    """
    reader, nonsense = Reader(), 0
    said_last = ""

    async def ask(way: Compression) -> None:
        for topic in topics:
            # Frames that never change are said once: a least time between messages would lose some.
            least = interval if topic == topics[0] and content is not Content.TF else 0.0
            await link.send(subscribe(topic, type_name, interval=least, compression=way))

    if compression is Compression.CBOR_RAW:
        await asyncio.to_thread(store, edition)  # takes a second, which is no silence of the server's
    await ask(compression)
    heard = time.monotonic()
    while True:
        left = None if silence is None else max(0.0, heard + silence - time.monotonic())
        try:
            received = await link.receive(left)
        except TimeoutError:
            if compression is Compression.NONE:
                raise TimeoutError(_silent(topics[0], silence, said_last)) from None
            _log.warning("%s: nothing comes as %s; asked for as JSON", topics[0], compression)
            compression = Compression.NONE
            for topic in topics:
                await link.send(unsubscribe(topic))
            await ask(compression)
            heard = time.monotonic()
            continue
        if received is None:
            return
        arrived, data = received
        try:
            frame = reader.take(data)
            if isinstance(frame, Status):
                said_last = frame.text[:300]
                _surface(frame)
            if not isinstance(frame, Published) or frame.topic not in topics:
                continue
            said = message(content, frame, edition)
        except _Refused:
            raise
        except ProtocolError:
            nonsense += 1
            if nonsense >= NONSENSE:
                raise
            continue
        nonsense = 0
        if frame.topic == topics[0]:
            heard = arrived
        yield ReceivedMessage(arrived, frame.topic, said)


class _Refused(ProtocolError):
    """The server says that it will not."""


def _surface(status: Status) -> None:
    if status.level == "error":
        raise _Refused(f"the server says: {status.text[:300]}")
    if status.level == "warning":
        _log.warning("rosbridge says: %.300s", status.text)


def _silent(topic: str, silence: float | None, said: str) -> str:
    told = f"; the server said last: {said}" if said else ""
    return f"connected, but nothing on {topic} for {silence or 0:g} s: does anybody publish it?{told}"
