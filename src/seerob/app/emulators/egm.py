"""An ABB controller that streams its positions (EGM) to a client, over a real socket."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import Callable
from typing import Annotated

from seerob.app.emulation.background import LoopEmulator
from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Ready, RobotOptions, option, port
from seerob.protocols.robots import abb_egm
from seerob.protocols.robots.abb_egm import JOINTS, Message, MotionState, MotorState, RapidState

EPOCH = 1_700_000_000.0
"""What its clock begins at [s]."""


class EgmServer(LoopEmulator):
    """A stream of positions, in a thread of its own.

    Args:
        motion: What the robot does; time counts from when this was made, also through a stop.
        to: Own address of the client, and the port that it listens on.
        host: Address to send from.
        period: Between messages [s].
        clock: Whether messages say when they were measured; else their header alone has a time.
    """

    def __init__(
        self,
        motion: Motion,
        *,
        to: tuple[str, int],
        host: str = "127.0.0.1",
        period: float = abb_egm.PERIOD,
        clock: bool = True,
    ) -> None:
        super().__init__()
        self.motion, self.to, self.host, self.period = motion, to, host, period
        self.guided = MotionState.STOPPED
        self._clock, self._sequence, self._made = clock, 0, time.monotonic()

    def message(self, t: float) -> Message:
        """What it says at a time since it was made [s]; as its clock has it, the motion is too."""
        t = round(t, 6 if self._clock else 3)
        q, _ = self.motion(t)
        return Message(
            sequence=self._sequence,
            time=(EPOCH if self._clock else 0.0) + t,
            joints=tuple(map(math.degrees, q)),
            motors=MotorState.ON,
            motion=self.guided,
            program=RapidState.RUNNING,
        )

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Send at a steady rate."""
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            asyncio.DatagramProtocol, local_addr=(self.host, 0)
        )
        ready()
        begun, k = time.monotonic(), 0
        try:
            while not over.is_set():
                message = self.message(begun - self._made + k * self.period)
                transport.sendto(abb_egm.encode(message, clock=self._clock), self.to)
                self._sequence, k = self._sequence + 1, k + 1
                wait = begun + k * self.period - time.monotonic()
                if wait < -1.0:  # this machine slept: what was not sent is not made up for
                    k = int((time.monotonic() - begun) / self.period)
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(over.wait(), max(wait, 0.0))
        finally:
            transport.abort()


# -- options ------------------------------------------------------------------------------------


class Egm(RobotOptions, frozen=True, kw_only=True):
    """An ABB controller that streams positions (EGM) to a client."""

    robot: Annotated[str, option("robot of the library, whose limits hold")] = "crb15000_5_95"
    to: Annotated[str, option("address of the client")] = "127.0.0.1"
    port: Annotated[int, port("port of the client")] = abb_egm.PORT
    period: Annotated[int, option("between messages", "ms", ge=4, le=1000)] = 4

    def ready(self) -> Ready:
        """The controller."""
        target = self.target(joints=JOINTS, whose="it")
        motion, what = self.motion(target)
        server = EgmServer(motion, to=(self.to, self.port), host=self.host, period=1e-3 * self.period)
        where = f"{self.host}, to {self.to}:{self.port}"
        return Ready(server, f"{target.name}, {what}", where, (f"seerob probe egm {self.host}{{option}}",))
