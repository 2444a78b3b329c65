"""A Dobot controller's port for real-time feedback: it plays a motion, over a real socket."""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections.abc import Callable
from typing import Annotated

from seerob.app.emulation.background import LoopEmulator
from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Ready, RobotOptions, option, port
from seerob.protocols.links.tcp_server import tcp_server
from seerob.protocols.robots.dobot import JOINTS, PERIOD, PORT, Message, RobotMode, encode

_log = logging.getLogger(__name__)

FULL = 1 << 18
"""Bytes that a client may leave unread [byte]; then it is left."""
SINCE = 60.0
"""For how long it has been switched on when it is started [s]."""


class DobotServer(LoopEmulator):
    """The port, in a thread of its own; whoever connects is sent a message each period.

    Args:
        motion: What the robot does; time counts from the start of the server.
        host: Address to listen on.
        port: 0 is any free one.
        period: [s]
        payload: What it was told that hangs at its flange [kg].
    """

    def __init__(
        self,
        motion: Motion,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        period: float = PERIOD,
        payload: float = 0.0,
    ) -> None:
        super().__init__()
        self.motion, self.host, self.port = motion, host, port
        self.mode: int = RobotMode.RUNNING
        self._period, self._payload = period, payload
        self._begun = 0.0

    def message(self, k: int) -> bytes:
        """The message number ``k``; its time is in whole milliseconds, and so is the motion."""
        t = round(k * self._period, 3)
        q, qd = self.motion(t)
        return encode(
            Message(
                mode=self.mode,
                time=SINCE + t,
                speed_scaling=100.0,
                positions=tuple(map(math.degrees, q)),
                speeds=tuple(map(math.degrees, qd)),
                tool=(0.0,) * 6,
                user_frame=1,  # in which nobody knows where the tool is
                enabled=True,
                dragged=False,
                running=True,
                alarm=False,
                collision=False,
                payload=self._payload,
            )
        )

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Listen, and serve whoever connects."""
        async with tcp_server(self._welcome, self.host, self.port) as server:
            self.port = server.sockets[0].getsockname()[1]
            self._begun = time.monotonic()
            ready()
            await over.wait()

    async def _welcome(self, _: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            k = math.ceil((time.monotonic() - self._begun) / self._period)
            while not writer.transport.is_closing():
                await asyncio.sleep(self._begun + k * self._period - time.monotonic())
                if writer.transport.get_write_buffer_size() > FULL:
                    _log.info("client does not read: connection closed")
                    return
                writer.write(self.message(k))
                k += 1
        except (OSError, asyncio.CancelledError):
            pass  # the client has left, or the server stops
        finally:
            writer.transport.abort()


# -- options ------------------------------------------------------------------------------------

HOME = (0.0, 0.3, -1.2, 0.0, 1.2, 0.0)
"""What it swings about when no motion is given [rad]."""


class Dobot(RobotOptions, frozen=True, kw_only=True):
    """A Dobot controller, its real-time feedback."""

    robot: Annotated[str, option("robot of the library, whose limits hold")] = "dobot_cr5"
    port: Annotated[int, port()] = PORT
    payload: Annotated[float, option("what it was told that hangs at its flange", "kg", ge=0, le=100)] = 0.0

    def ready(self) -> Ready:
        """The controller."""
        target = self.target(joints=JOINTS, whose="such an arm")
        motion, what = self.motion(target, HOME)
        server = DobotServer(motion, host=self.host, port=self.port, payload=self.payload)
        return Ready(server, f"{target.name}, {what}", f"{self.host}:{self.port}")
