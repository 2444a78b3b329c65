"""Robots of ROS 2 over Zenoh, live and without ROS: nodes with ``rmw_zenoh``, or DDS behind a bridge.

Joint states, transforms, trajectories, as CDR. Only subscribed: targets are written elsewhere, where that is
allowed.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator
from typing import Annotated, ClassVar

from msgspec import Meta

from seerob.devices.ros import STATIC, RosSource
from seerob.protocols import ProtocolError
from seerob.protocols.ros import rmw_zenoh
from seerob.protocols.ros.ros_messages import Edition, decode, store
from seerob.protocols.ros.rosbridge import NONSENSE, ReceivedMessage


class Zenoh(RosSource, frozen=True, kw_only=True):
    """A robot of ROS 2 over Zenoh, live."""

    loads: ClassVar[tuple[str, ...]] = ("zenoh.ext", "rosbags.typesys")

    host: str
    """Name or address of the computer with the Zenoh router (``rmw_zenohd``, or the bridge from DDS)."""
    port: Annotated[int, Meta(ge=1, le=65535)] = rmw_zenoh.PORT
    """TCP port of the router."""
    domain: Annotated[int, Meta(ge=0, le=232)] | None = None
    """``ROS_DOMAIN_ID`` of nodes with ``rmw_zenoh``: only they are heard then. When not given those of domain
    0 are, and what a bridge from DDS publishes, whose keys have no domain."""

    def where(self) -> str:
        """The router."""
        return f"zenoh {self.host}:{self.port}"

    async def heard(self) -> AsyncGenerator[ReceivedMessage, None]:
        """Subscribe, and yield what is published."""
        own, kind = self.topics()[0], self.content.message_type
        await asyncio.to_thread(store, Edition.ROS2)
        async with rmw_zenoh.opened(self.host, self.port) as link:
            for topic in self.topics():
                keys = [rmw_zenoh.key(topic, kind, self.domain or 0)]
                if self.domain is None:
                    keys.append(rmw_zenoh.bridged(topic))
                link.subscribe(topic, keys, kept=topic == STATIC)
            origins = rmw_zenoh.Origins()
            nonsense, begun = 0, time.monotonic()
            last, silence = begun, self.silence()
            while True:
                left = None if silence is None else max(0.0, last + silence - time.monotonic())
                try:
                    put = await link.next(left)
                except TimeoutError:
                    reason = self._silent(await link.publishers(self.domain or 0), heard=last > begun)
                    raise TimeoutError(reason) from None
                try:
                    said = decode(self.content, put.payload, Edition.ROS2)
                except ProtocolError:
                    nonsense += 1
                    if nonsense >= NONSENSE:
                        raise
                    continue
                nonsense, doubt = 0, origins.take(put, stays=put.topic == STATIC)
                if put.topic == own:
                    last = put.arrived
                yield ReceivedMessage(put.arrived, put.topic, said, doubt)

    def _silent(self, there: dict[str, str], *, heard: bool) -> str:
        own, kind = self.topics()[0], self.content.message_type
        if heard or there.get(own) == kind:
            return f"connected, but nothing on {own} for {self.silence() or 0:g} s"
        if own in there:
            return f"{own} is {there[own]}, no {kind}"
        shown = ", ".join(sorted(there)[:12]) or "nothing"
        return f"connected, but nobody publishes {own} in domain {self.domain or 0}; there is: {shown}"
