"""Both sides of Unity's ROS-TCP wire: an endpoint with a robot, and a Unity project that plays one."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal

from msgspec.structs import replace

from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Ready, option, port
from seerob.app.emulation.ros_robot import LATE, RosOptions, RosRobot
from seerob.protocols import ProtocolError
from seerob.protocols.links.tcp_server import tcp_server
from seerob.protocols.ros import ros_tcp
from seerob.protocols.ros.ros_messages import Edition, encode, ros1_name, same_type, store
from seerob.protocols.ros.ros_tcp import Frame, Splitter

PAUSE = 0.02
"""Before Unity tries again to connect [s]."""
KEPT = 10_000
"""Frames that are kept of what others publish."""


class _Playing(RosRobot):
    """A robot's messages on a grid of time."""

    usual: ClassVar[Edition] = Edition.ROS1

    async def play(self, writer: asyncio.StreamWriter, wanted: set[str]) -> None:
        """Send what is wanted until the other side has gone; the set may change meanwhile."""
        k = int((time.monotonic() - self._begun) * self.rate) + 1
        while not writer.is_closing():
            late = time.monotonic() - self._begun - k / self.rate
            if late < 0:
                await asyncio.sleep(-late)
            elif late > LATE:
                k += int(late * self.rate)
            for topic in sorted(wanted):
                content, says = self.topics[topic]
                writer.write(ros_tcp.pack(topic, encode(content, says(k / self.rate), self.edition)))
            await writer.drain()
            k += 1


class RosTcpEndpoint(_Playing):
    """An endpoint beside a robot's ROS: sends what is subscribed, keeps what is published to it.

    Attributes:
        received: The newest frames that were published, commands to publish included.
    """

    received: deque[Frame]

    def __init__(self, motion: Motion, names: tuple[str, ...], **more: Any) -> None:
        """Take the arguments of `_Playing`."""
        super().__init__(motion, names, **more)
        self.received = deque(maxlen=KEPT)

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Listen, and serve whoever connects."""
        store(self.edition)
        async with tcp_server(self._welcome, self.host, self.port) as server:
            self.port = server.sockets[0].getsockname()[1]
            self._begun = time.monotonic()
            ready()
            await over.wait()

    async def _welcome(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        splitter, wanted = Splitter(), set[str]()
        sending = asyncio.create_task(self._send(writer, wanted))
        try:
            writer.write(ros_tcp.handshake(self.edition))
            while data := await reader.read(1 << 16):
                for frame in splitter.feed(data):
                    if frame.destination == "__subscribe":
                        self._subscribe(writer, frame.fields(), wanted)
                    elif frame.destination == "__topic_list":
                        types = [ros1_name(content.message_type) for content, _ in self.topics.values()]
                        said = {"topics": list(self.topics), "types": types}
                        writer.write(ros_tcp.command("topic_list", said))
                    elif frame.destination == "__publish" or not frame.is_command:
                        self.received.append(frame)
        except (OSError, ProtocolError, asyncio.CancelledError):
            pass  # the client left, or the server stops: asyncio would log what is no mistake
        finally:
            sending.cancel()
            writer.transport.abort()

    async def _send(self, writer: asyncio.StreamWriter, wanted: set[str]) -> None:
        with contextlib.suppress(OSError):
            await self.play(writer, wanted)

    def _subscribe(self, writer: asyncio.StreamWriter, said: dict[str, object], wanted: set[str]) -> None:
        topic, name = str(said.get("topic", "")), str(said.get("message_name", ""))
        if topic in self.topics and same_type(name, self.topics[topic][0].message_type):
            wanted.add(topic)
        else:
            text = f"Failed to resolve message name: {name[:100]} on {topic[:100]}"
            writer.write(ros_tcp.command("error", {"text": text}))


class UnityProject(_Playing):
    """A Unity project that publishes a robot's joints: connects to an endpoint, again and again."""

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Connect and publish."""
        store(self.edition)
        self._begun = time.monotonic()
        ready()
        ended = asyncio.ensure_future(over.wait())
        while not over.is_set():
            task = asyncio.ensure_future(self._session())
            await asyncio.wait({task, ended}, return_when=asyncio.FIRST_COMPLETED)
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            if not over.is_set():
                await asyncio.sleep(PAUSE)

    async def _session(self) -> None:
        writer: asyncio.StreamWriter | None = None
        try:
            reader, writer = await asyncio.open_connection(self.host, self.port)
            splitter = Splitter()
            while not (frames := splitter.feed(await reader.read(1 << 16))):
                if reader.at_eof():
                    return
            self.edition = ros_tcp.edition_of(frames[0])
            for topic, (content, _) in self.topics.items():
                said = {"topic": topic, "message_name": ros1_name(content.message_type), "queue_size": 10}
                writer.write(ros_tcp.command("publish", {**said, "latch": False}))
            await self.play(writer, set(self.topics))
        except (OSError, ProtocolError):
            pass  # nobody listens yet
        finally:
            if writer is not None:
                writer.transport.abort()


# -- options ------------------------------------------------------------------------------------

_UNITY = "connect to an endpoint at this address, as a Unity project does; else be the endpoint"
_ROS = "edition of ROS; as a Unity project what the endpoint says"


class RosTcp(RosOptions, frozen=True, kw_only=True):
    """Unity's ROS-TCP-Endpoint with the joint states of a robot, or a Unity project that publishes them."""

    port: Annotated[int, port("port of the endpoint; 0 is any free one")] = 10000
    unity: Annotated[str, option(_UNITY)] | None = None
    ros: Annotated[Literal["1", "2"], option(_ROS)] = "1"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.unity and not self.port:
            raise ValueError("--port is 0 with --unity: name the endpoint's port")

    @property
    def listens(self) -> tuple[str, ...]:
        """The endpoint's port; a Unity project connects."""
        return () if self.unity else ("port",)

    def ready(self) -> Ready:
        """The endpoint, or the project."""
        if not self.unity:
            return self.served(RosTcpEndpoint)
        _, what, _, _ = made = replace(self, host=self.unity).served(UnityProject)
        hear = ("seerob probe ros_tcp --set side=endpoint --port {port}",)
        return made._replace(what=f"a Unity project, {what}", commands=hear)
