"""An ABB controller that streams its positions (EGM) to a client, over a real socket."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated

from seerob.app.emulation.message_sender import MessageSender, Way
from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Ready, RobotOptions, To, option, port
from seerob.protocols.robots import abb_egm
from seerob.protocols.robots.abb_egm import JOINTS, Message, MotionState, MotorState, RapidState

EPOCH = 1_700_000_000.0
"""What its clock begins at [s]."""


class EgmServer(MessageSender):
    """A stream of positions, in a thread of its own.

    Args:
        motion: What the robot does; time counts from when this was made, also through a stop.
        to: Own address of the client, and the port that it listens on.
        rate: Messages per second [Hz].
        clock: Whether messages say when they were measured; else their header alone has a time.
        way: What happens to each message on the way.
    """

    def __init__(
        self,
        motion: Motion,
        *,
        to: tuple[str, int],
        rate: float = 1 / abb_egm.PERIOD,
        clock: bool = True,
        way: Way | None = None,
    ) -> None:
        super().__init__(to=to, port=to[1], rate=rate, way=way)
        self.motion, self.guided = motion, MotionState.STOPPED
        self._clock, self._made, self._since = clock, time.monotonic(), 0.0

    def begin(self) -> Callable[[], object]:
        """Its clock went on meanwhile, as that of a controller whose program pauses."""
        self._since = time.monotonic() - self._made
        return super().begin()

    def t(self, k: int) -> float:
        """When the message number ``k`` is [s]."""
        return self._since + super().t(k)

    def message(self, k: int) -> bytes:
        """The message number ``k``; as its clock has the time, the motion has it too."""
        t = round(self.t(k), 6 if self._clock else 3)
        q, _ = self.motion(t)
        said = Message(
            sequence=k & 0xFFFF_FFFF,
            time=(EPOCH if self._clock else 0.0) + t,
            joints=tuple(map(math.degrees, q)),
            motors=MotorState.ON,
            motion=self.guided,
            program=RapidState.RUNNING,
        )
        return abb_egm.encode(said, clock=self._clock)


# -- options ------------------------------------------------------------------------------------


class Egm(RobotOptions, frozen=True, kw_only=True):
    """An ABB controller that streams positions (EGM) to a client."""

    robot: Annotated[str, option("robot of the library, whose limits hold")] = "crb15000_5_95"
    to: To = "127.0.0.1"
    port: Annotated[int, port("port to send to")] = abb_egm.PORT
    period: Annotated[int, option("between messages", "ms", ge=4, le=1000)] = 4

    def ready(self) -> Ready:
        """The controller."""
        target = self.target(joints=JOINTS, whose="it")
        motion, what = self.motion(target)
        said, where = f"{target.name}, {what}", f"to {self.to}:{self.port}"
        sender = EgmServer(motion, to=(self.to, self.port), rate=1e3 / self.period)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link, suppress(OSError):
            link.connect((self.to, self.port))
            own = link.getsockname()[0]  # by which the client knows it
            return Ready(sender, said, where, (f"seerob probe egm {own}{{option}}",))
        return Ready(sender, said, where)
