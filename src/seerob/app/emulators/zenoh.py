"""A robot's node with ``rmw_zenoh`` and its router in one: publishes joint states to whoever connects."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable
from typing import Annotated, Any

from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Rate, Ready, RobotOptions, option, port
from seerob.app.emulation.ros_robot import LATE, RosRobot
from seerob.core.extras import need
from seerob.devices.ros import STATIC
from seerob.protocols.ros import rmw_zenoh
from seerob.protocols.ros.ros_messages import Edition, encode, store


class ZenohRouter(RosRobot):
    """The node and the router, in a thread of its own; others may publish over it, too.

    Args:
        motion: As of `RosRobot`, as all others.
        names: Likewise.
        domain: ``ROS_DOMAIN_ID``.
    """

    def __init__(self, motion: Motion, names: tuple[str, ...], *, domain: int = 0, **more: Any) -> None:
        super().__init__(motion, names, **more)
        self._domain = domain

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Listen, and publish until it is over."""
        need("zenoh")
        import zenoh

        self.port = self.port or _free_port(self.host)
        _bindable(self.host, self.port)
        settings = rmw_zenoh.settings("router", listen=f"tcp/{self.host}:{self.port}")
        try:
            session = await asyncio.to_thread(zenoh.open, settings)
        except zenoh.ZError as error:
            raise OSError(str(error).partition(" at ")[0]) from None
        try:
            types = store(Edition.ROS2)
            publishers = [
                (
                    rmw_zenoh.Publisher(
                        session, topic, content.message_type, types.hash_rihs01(content.message_type),
                        self._domain, kept=topic == STATIC,
                    ),
                    content,
                    says,
                )
                for topic, (content, says) in self.topics.items()
            ]  # fmt: skip
            self._begun = time.monotonic()
            ready()
            k = 0
            while not over.is_set():
                late = time.monotonic() - self._begun - k / self.rate
                if late > LATE:
                    k += int(late * self.rate)
                try:
                    async with asyncio.timeout(max(0.0, -late)):
                        await over.wait()
                except TimeoutError:
                    t = k / self.rate
                    for publisher, content, says in publishers:
                        publisher.publish(encode(content, says(t), Edition.ROS2), self.epoch + t)
                    k += 1
        finally:
            await asyncio.to_thread(session.close)


def _free_port(host: str) -> int:
    """A port that nobody listens on; Zenoh does not say which one it took."""
    with socket.create_server((host, 0), family=_family(host)) as server:
        found: int = server.getsockname()[1]
        return found


def _bindable(host: str, port: int) -> None:
    """Raise what is wrong with an address, which Zenoh only tells in words.

    Raises:
        OSError: It cannot be listened on.
    """
    with socket.create_server((host, port), family=_family(host)):
        pass


def _family(host: str) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in host else socket.AF_INET


# -- options ------------------------------------------------------------------------------------


class Zenoh(RobotOptions, frozen=True, kw_only=True):
    """A node of ROS 2 with rmw_zenoh that publishes the joint states of a robot, and its router."""

    port: Annotated[int, port()] = rmw_zenoh.PORT
    domain: Annotated[int, option("ROS_DOMAIN_ID", ge=0, le=232)] = 0
    rate: Rate = 100.0

    def ready(self) -> Ready:
        """The node."""
        need("zenoh")
        need("rosbags")
        target = self.target()
        motion, what = self.motion(target)
        made = ZenohRouter(
            motion, target.joints, host=self.host, port=self.port, rate=self.rate, domain=self.domain
        )
        return Ready(made, f"{target.name}, {what}", f"{self.host}:{self.port}")
