"""A Foxglove bridge beside a robot of ROS: offers its joint states, and sends them to whoever subscribes."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Ready, port
from seerob.app.emulation.ros_robot import LATE, RosOptions, RosRobot
from seerob.protocols import ProtocolError
from seerob.protocols.links.tcp_server import stop_accepting
from seerob.protocols.ros import foxglove
from seerob.protocols.ros.foxglove import ServerChannel
from seerob.protocols.ros.ros_messages import Edition, encode, store

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection


class FoxgloveBridge(RosRobot):
    """The bridge, in a thread of its own; its messages are CDR, or those of ROS 1."""

    def __init__(self, motion: Motion, names: tuple[str, ...], **more: Any) -> None:
        """Take the arguments of `RosRobot`."""
        super().__init__(motion, names, **more)
        encoding = "cdr" if self.edition is Edition.ROS2 else "ros1"
        self._channels = [
            ServerChannel(k, topic, encoding, content.message_type)
            for k, (topic, (content, _)) in enumerate(self.topics.items(), start=1)
        ]

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Listen, and serve whoever connects."""
        from websockets.asyncio.server import serve
        from websockets.typing import Subprotocol

        store(self.edition)
        spoken = [Subprotocol(name) for name in foxglove.SUBPROTOCOLS]
        async with serve(
            self._welcome,
            self.host,
            self.port,
            subprotocols=spoken,
            compression=None,
            max_size=foxglove.MAX_MESSAGE,
            close_timeout=0.1,
        ) as server:
            self.port = next(iter(server.sockets)).getsockname()[1]
            self._begun = time.monotonic()
            ready()
            await over.wait()
            await stop_accepting(server.server)

    async def _welcome(self, connection: ServerConnection) -> None:
        from websockets.exceptions import ConnectionClosed

        wanted: dict[int, ServerChannel] = {}
        sending = asyncio.create_task(self._send(connection, wanted))
        try:
            await connection.send(foxglove.server_info("seerob"))
            await connection.send(foxglove.offer(self._channels))
            async for data in connection:
                with contextlib.suppress(ProtocolError):
                    self._hear(foxglove.operation(data if isinstance(data, str) else ""), wanted)
        except ConnectionClosed:
            pass
        finally:
            sending.cancel()

    def _hear(self, said: foxglove.Operation, wanted: dict[int, ServerChannel]) -> None:
        if said.op == "subscribe":
            known = {channel.id: channel for channel in self._channels}
            for own, channel in foxglove.subscriptions(said).items():
                if channel in known and len(wanted) < foxglove.MOST_CHANNELS:
                    wanted[own] = known[channel]
        elif said.op == "unsubscribe":
            listed = said.fields.get("subscriptionIds")
            for own in listed if isinstance(listed, list) else ():
                wanted.pop(own if isinstance(own, int) else -1, None)

    async def _send(self, connection: ServerConnection, wanted: dict[int, ServerChannel]) -> None:
        """Send what is subscribed, on a grid of time."""
        from websockets.exceptions import ConnectionClosed

        k = int((time.monotonic() - self._begun) * self.rate) + 1
        with contextlib.suppress(ConnectionClosed):
            while True:
                late = time.monotonic() - self._begun - k / self.rate
                if late > LATE:
                    k += int(late * self.rate)
                await asyncio.sleep(max(0.0, -late))
                for own, channel in list(wanted.items()):
                    content, says = self.topics[channel.topic]
                    payload = encode(content, says(k / self.rate), self.edition)
                    await connection.send(foxglove.pack(own, self.epoch + k / self.rate, payload))
                k += 1


# -- options ------------------------------------------------------------------------------------


class Foxglove(RosOptions, frozen=True, kw_only=True):
    """A Foxglove bridge (ROS 1 or 2) with the joint states of a robot."""

    port: Annotated[int, port()] = 8765

    def ready(self) -> Ready:
        """The bridge."""
        return self.served(FoxgloveBridge)
