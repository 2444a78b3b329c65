"""Robots whose ROS topics a Foxglove bridge serves, live; any server of Foxglove's SDK too.

Joint states and transforms, as JSON, CDR, ROS 1 or Protocol Buffers. Only subscribed, nothing is written.
"""

from __future__ import annotations

import logging
import time
from collections.abc import AsyncGenerator
from typing import Annotated, ClassVar

from msgspec import Meta

from seerob.devices.ros import RosSource
from seerob.protocols import ProtocolError
from seerob.protocols.links.websocket_link import Link, linked
from seerob.protocols.ros import foxglove
from seerob.protocols.ros.foxglove import Operation, ServerChannel
from seerob.protocols.ros.rosbridge import NONSENSE, ReceivedMessage

_log = logging.getLogger(__name__)


class Foxglove(RosSource, frozen=True, kw_only=True):
    """A robot behind a Foxglove bridge, live."""

    loads: ClassVar[tuple[str, ...]] = ("websockets.asyncio.client", "rosbags.typesys")

    host: str
    """Name or address of the computer with the bridge."""
    port: Annotated[int, Meta(ge=1, le=65535)] = foxglove.PORT
    """TCP port of the bridge."""
    tls: bool = False
    """Encrypted, and the server's certificate is checked."""

    def where(self) -> str:
        """The server."""
        return f"foxglove {self.host}:{self.port}"

    async def heard(self) -> AsyncGenerator[ReceivedMessage, None]:
        """Subscribe to what is offered, and yield what comes."""
        async with linked(
            self.host,
            self.port,
            largest=2 * foxglove.MAX_MESSAGE,
            what="Foxglove server",
            protocols=foxglove.SUBPROTOCOLS,
            tls=self.tls,
        ) as link:
            taken: dict[int, ServerChannel] = {}
            offered: dict[str, str] = {}
            nonsense = 0
            begun = heard = time.monotonic()
            silence = self.silence()
            while True:
                left = None if silence is None else max(0.0, heard + silence - time.monotonic())
                try:
                    received = await link.receive(left)
                except TimeoutError:
                    raise TimeoutError(self._silent(taken, offered, heard - begun)) from None
                if received is None:
                    return
                arrived, data = received
                try:
                    if isinstance(data, str):
                        await self._receive(link, foxglove.operation(data), taken, offered)
                        continue
                    message = foxglove.message(data)
                    channel = None if message is None else taken.get(message.subscription)
                    if message is None or channel is None:
                        continue
                    said = foxglove.decode(self.content, channel, message.payload)
                except ProtocolError:
                    nonsense += 1
                    if nonsense >= NONSENSE:
                        raise
                    continue
                nonsense = 0
                if channel.topic == self.topics()[0]:
                    heard = arrived
                yield ReceivedMessage(arrived, channel.topic, said)

    async def _receive(
        self, link: Link, said: Operation, taken: dict[int, ServerChannel], offered: dict[str, str]
    ) -> None:
        """Subscribe to what is wanted of an offer; say what the server complains of."""
        if said.op == "status":
            _log.warning("%s says: %.300s", self.where(), str(said.fields.get("message", "")))
        if said.op != "advertise":
            return
        wanted: dict[int, int] = {}
        for channel in foxglove.channels(said):
            if len(offered) < foxglove.MOST_CHANNELS:
                offered[channel.topic] = f"{channel.schema} as {channel.encoding}"
            if channel.topic in self.topics() and channel.says(self.content):
                number = len(taken) + 1
                if number > foxglove.MOST_CHANNELS:
                    raise ProtocolError("offers ever more channels")
                taken[number] = channel
                wanted[number] = channel.id
        if wanted:
            await link.send(foxglove.subscribe(wanted))

    def _silent(self, taken: dict[int, ServerChannel], offered: dict[str, str], spoke: float) -> str:
        topic = self.topics()[0]
        if topic in {channel.topic for channel in taken.values()}:
            return f"connected, but nothing on {topic} for {self.silence() or 0:g} s"
        if topic in offered:
            return f"{topic} is {offered[topic]}, which is no {self.content.message_type} that can be read"
        shown = ", ".join(list(offered)[:12]) or "nothing"
        return f"connected, but {topic} is not offered; there is: {shown}"
