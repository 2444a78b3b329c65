"""Robots of ROS 1 and 2, live, through rosbridge: joint states, transforms, trajectories.

Only subscribed, nothing is published: Cartesian targets are written elsewhere, where that is allowed.
"""

from __future__ import annotations

from collections.abc import AsyncGenerator
from contextlib import aclosing
from typing import Annotated, ClassVar

from msgspec import Meta

from seerob.devices.ros import RosSource
from seerob.protocols.links.websocket_link import linked
from seerob.protocols.ros import rosbridge
from seerob.protocols.ros.ros_messages import Edition, ros1_name
from seerob.protocols.ros.rosbridge import Compression, ReceivedMessage, hear


class Rosbridge(RosSource, frozen=True, kw_only=True):
    """A robot of ROS 1 or 2, live, through rosbridge."""

    loads: ClassVar[tuple[str, ...]] = ("websockets.asyncio.client", "cbor2", "rosbags.typesys")

    host: str
    """Name or address of the computer with the rosbridge server."""
    port: Annotated[int, Meta(ge=1, le=65535)] = rosbridge.PORT
    """TCP port of the server."""
    tls: bool = False
    """Encrypted, and the server's certificate is checked."""
    edition: Edition = Edition.ROS2
    """``ros1`` for a server of ROS 1."""
    compression: Compression = Compression.NONE
    """``none`` is JSON; ``cbor-raw`` is less for the network; ``cbor`` fails on servers of ROS 1."""

    def where(self) -> str:
        """The server."""
        return f"rosbridge {self.host}:{self.port}"

    async def heard(self) -> AsyncGenerator[ReceivedMessage, None]:
        """Subscribe, and yield what is published."""
        name = self.content.message_type
        largest = 2 * rosbridge.MAX_MESSAGE
        async with linked(
            self.host, self.port, largest=largest, what="rosbridge server", tls=self.tls
        ) as link:
            messages = hear(
                link,
                self.content,
                self.topics(),
                interval=1e-3 * int(500 / self.frequency),
                compression=self.compression,
                edition=self.edition,
                type_name=ros1_name(name) if self.edition is Edition.ROS1 else name,
                silence=self.silence(),
            )
            async with aclosing(messages):
                async for heard in messages:
                    yield heard
