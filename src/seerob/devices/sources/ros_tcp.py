"""Robots over the wire of Unity's ROS-TCP-Endpoint, live, as either side of it.

As ``client`` this reads an endpoint that runs beside a robot's ROS, as Unity would. As ``endpoint`` it is
one, without ROS: a Unity project that publishes joint states connects to it. Nothing is published.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections import deque
from collections.abc import AsyncGenerator
from contextlib import aclosing, asynccontextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, ClassVar

from msgspec import Meta

from seerob.core.errors import InputError
from seerob.devices.live.listening import Contact, contact_of
from seerob.devices.ros import RosSource
from seerob.protocols import ProtocolError
from seerob.protocols.links.connection import Connection, connected
from seerob.protocols.links.reception import Wakeup
from seerob.protocols.links.tcp_server import tcp_server
from seerob.protocols.ros import ros_tcp
from seerob.protocols.ros.ros_messages import Edition, decode, ros1_name, same_type, store
from seerob.protocols.ros.ros_tcp import Frame, Splitter
from seerob.protocols.ros.rosbridge import NONSENSE, ReceivedMessage
from seerob.workstation.source import Opened, Target

_log = logging.getLogger(__name__)

CONNECT_WITHIN = 2.0
"""[s]"""
CHUNK = 1 << 16
PATIENT = 3600.0
"""Of a source that waits for commands [s]."""


class Side(StrEnum):
    """Who connects."""

    CLIENT = "client"
    """This source, to an endpoint."""
    ENDPOINT = "endpoint"
    """Unity, to this source."""


class RosTcp(RosSource, frozen=True, kw_only=True):
    """A robot over Unity's ROS-TCP wire, live, as either side."""

    loads: ClassVar[tuple[str, ...]] = ("rosbags.typesys",)

    side: Side = Side.CLIENT
    """``client`` connects to an endpoint at ``host``; ``endpoint`` waits for Unity."""
    host: str = ""
    """With ``client``: name or address of the computer with the endpoint."""
    port: Annotated[int, Meta(ge=1, le=65535)] = ros_tcp.PORT
    """TCP port of the endpoint, or the one to listen on."""
    bind: str = "127.0.0.1"
    """With ``endpoint``: own address; when not given, only this machine can connect."""
    edition: Edition = Edition.ROS1
    """With ``endpoint``: how Unity is to serialise; an endpoint says it by itself."""

    def where(self) -> str:
        """The other side."""
        return f"ros_tcp {self.host or self.bind}:{self.port}"

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Check the options, and ask the endpoint, if it can be reached.

        Raises:
            InputError: An option or a name is wrong, or the endpoint serves another robot.
        """
        self._check()
        return RosSource.open(self, folder, target)

    def contact(self) -> Contact:
        """The other side."""
        return contact_of(self, listens=self.side is Side.ENDPOINT)

    def _check(self) -> None:
        if (self.side is Side.CLIENT) != bool(self.host):
            what = f"host = {self.host!r} with side = {self.side.value!r}"
            remedy = "a client needs the endpoint's address, an endpoint has bind instead"
            raise InputError.at("ros_tcp", "host", what, remedy)

    async def heard(self) -> AsyncGenerator[ReceivedMessage, None]:
        """Connect or wait for Unity, and yield what comes."""
        self._check()
        if self.side is Side.ENDPOINT:
            await asyncio.to_thread(store, self.edition)
            async with self._served() as frames, aclosing(self._decoded(frames, self.edition)) as messages:
                async for heard in messages:
                    yield heard
            return
        async with connected(self.host, self.port, CONNECT_WITHIN) as connection:
            edition: Edition | None = None
            async with aclosing(self._frames(connection)) as frames:
                async for _, frame in frames:
                    if frame.destination != "__handshake":
                        raise ProtocolError(f"begins with {frame.destination[:40]!r} instead of a handshake")
                    edition = ros_tcp.edition_of(frame)
                    break
                if edition is None:
                    return
                await asyncio.to_thread(store, edition)
                for topic in self.topics():
                    await connection.write(self._subscription(topic))
                async with aclosing(self._decoded(frames, edition)) as messages:
                    async for heard in messages:
                        yield heard

    def _subscription(self, topic: str) -> bytes:
        # Endpoints of both editions know the short names.
        name = ros1_name(self.content.message_type)
        return ros_tcp.command("subscribe", {"topic": topic, "message_name": name})

    async def _frames(self, connection: Connection) -> AsyncGenerator[tuple[float, Frame], None]:
        splitter, patience = Splitter(), self.silence() or PATIENT
        whole = time.monotonic()
        while True:
            arrived, data, _ = await connection.read(patience)
            if not data:
                return
            for frame in splitter.feed(data):
                whole = arrived
                yield arrived, frame
            if arrived - whole > patience:
                # A length that was damaged would be waited for much longer.
                raise TimeoutError(f"connected, but nothing that is whole for {patience:g} s")

    async def _decoded(
        self, frames: AsyncGenerator[tuple[float, Frame], None], edition: Edition
    ) -> AsyncGenerator[ReceivedMessage, None]:
        last, nonsense = time.monotonic(), 0
        silence = self.silence()
        async for arrived, frame in frames:
            if frame.is_command:
                self._take_system_message(frame)
            elif frame.destination in self.topics():
                try:
                    said = decode(self.content, frame.body, edition)
                except ProtocolError:
                    nonsense += 1
                    if nonsense >= NONSENSE:
                        raise
                    continue
                nonsense = 0
                if frame.destination == self.topics()[0]:
                    last = arrived
                yield ReceivedMessage(arrived, frame.destination, said)
            if silence is not None and arrived - last > silence:
                raise TimeoutError(f"connected, but nothing on {self.topics()[0]} for {silence:g} s")

    def _take_system_message(self, frame: Frame) -> None:
        """What the other side says of what it was asked, or that it will publish."""
        if frame.destination in ("__log", "__warn", "__error"):
            text = str(frame.fields().get("text", ""))[:300]
            if frame.destination == "__error":
                raise ProtocolError(f"the endpoint says: {text}")
            level = logging.WARNING if frame.destination == "__warn" else logging.INFO
            _log.log(level, "%s says: %s", self.where(), text)
        elif frame.destination == "__publish":
            said = frame.fields()
            name = str(said.get("message_name", ""))[:200]
            if said.get("topic") == self.topics()[0] and not same_type(name, self.content.message_type):
                raise ProtocolError(f"publishes {name} on {self.topics()[0]}, no {self.content.message_type}")

    @asynccontextmanager
    async def _served(self) -> AsyncGenerator[AsyncGenerator[tuple[float, Frame], None], None]:
        """Wait for Unity; the newest connection counts, as with an endpoint."""
        waiting: deque[tuple[float, Frame] | ProtocolError] = deque(maxlen=64)
        wakeup = Wakeup()
        newest: list[asyncio.StreamWriter] = []

        async def welcome(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            for former in newest:
                former.transport.abort()
            newest[:] = [writer]
            splitter = Splitter()
            try:
                writer.write(ros_tcp.handshake(self.edition))
                while data := await reader.read(CHUNK):
                    arrived = time.monotonic()
                    waiting.extend([(arrived, frame) for frame in splitter.feed(data)])
                    wakeup.wake()
            except OSError:
                pass
            except ProtocolError as error:
                waiting.append(error)
                wakeup.wake()
            except asyncio.CancelledError:
                pass  # the source stops; asyncio would log what is no mistake
            finally:
                writer.transport.abort()

        async def frames() -> AsyncGenerator[tuple[float, Frame], None]:
            while True:
                while not waiting:
                    try:
                        await wakeup.wait(self.silence() or math.inf)
                    except TimeoutError:
                        if waiting:
                            break
                        there = newest and not newest[0].is_closing()
                        what = "connected, but silent" if there else "nobody connects"
                        where, silence = f"{self.bind}:{self.port}", self.silence() or 0
                        raise TimeoutError(f"{what} at {where} for {silence:g} s") from None
                item = waiting.popleft()
                if isinstance(item, ProtocolError):
                    raise item
                yield item

        try:
            async with tcp_server(welcome, self.bind, self.port), aclosing(frames()) as heard:
                yield heard
        finally:
            for writer in newest:
                writer.transport.abort()
