"""A client of rosbridge that only listens: it subscribes, and surfaces what the server says of that."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncGenerator, Sequence
from typing import NamedTuple

from seerob.protocols import ProtocolError
from seerob.protocols.links.websocket_link import Link
from seerob.protocols.ros import rosbridge
from seerob.protocols.ros.ros_messages import Content, Said
from seerob.protocols.ros.ros_serialised import Edition, store
from seerob.protocols.ros.rosbridge import Compression, Published, Status

_log = logging.getLogger(__name__)

SILENCE = 2.0
"""A topic without a message for so long is taken for dead [s]."""
NONSENSE = 50
"""Messages in a row that cannot be read before the connection is given up."""


class Heard(NamedTuple):
    """One message."""

    arrived: float
    """Host's monotonic time [s]."""
    topic: str
    said: Said


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
) -> AsyncGenerator[Heard, None]:
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
    reader, nonsense = rosbridge.Reader(), 0
    said_last = ""

    async def ask(way: Compression) -> None:
        for topic in topics:
            # Frames that never change are said once: a least time between messages would lose some.
            least = interval if topic == topics[0] and content is not Content.TF else 0.0
            await link.send(rosbridge.subscribe(topic, type_name, interval=least, compression=way))

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
                await link.send(rosbridge.unsubscribe(topic))
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
            said = rosbridge.message(content, frame, edition)
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
        yield Heard(arrived, frame.topic, said)


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
