"""The bridge of a Doosan controller without either: its messages, sent over a real socket."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from seerob.app.emulation.message_sender import MessageSender, Way
from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Ready, RobotOptions, To, option, port
from seerob.protocols.robots.doosan_drfl import JOINTS, Message, RobotMode, RobotState, encode


class DrflSender(MessageSender):
    """What the bridge sends while the robot plays a motion, in a thread of its own.

    Args:
        motion: What the robot does.
        to: Address and port that is sent to.
        rate: Messages per second [Hz].
        torques: Measured joint torques [N·m], always the same; none are sent when not given.
        way: What happens to each message on the way.
    """

    def __init__(
        self,
        motion: Motion,
        *,
        to: tuple[str, int],
        rate: float = 100.0,
        torques: tuple[float, ...] | None = None,
        way: Way | None = None,
    ) -> None:
        super().__init__(to=to, port=to[1], rate=rate, way=way)
        self.motion, self.torques = motion, torques
        self.state: int = RobotState.MOVING

    def message(self, k: int) -> bytes:
        """The message number ``k``."""
        t = self.t(k)
        q, qd = self.motion(t)
        return encode(
            Message(
                number=k & 0xFFFF_FFFF,
                time=t,
                positions=tuple(map(math.degrees, q)),
                speeds=tuple(map(math.degrees, qd)),
                torques=self.torques,
                external=(0.0,) * JOINTS,
                mode=RobotMode.AUTONOMOUS,
                state=self.state,
                control=0,
            )
        )


# -- options ------------------------------------------------------------------------------------

HOME = (0.0, 0.3, 1.2, 0.0, 1.2, 0.0)
"""What it swings about when no motion is given [rad]."""


class Drfl(RobotOptions, frozen=True, kw_only=True):
    """The bridge of a Doosan controller (DRFL), which sends to this software."""

    robot: Annotated[str, option("robot of the library, whose limits hold")] = "doosan_m1013"
    to: To = "127.0.0.1"
    port: Annotated[int, port("port to send to")] = 20128
    rate: Annotated[Literal[10, 50, 100, 200, 250, 500, 1000], option("messages per second", "Hz")] = 100

    def ready(self) -> Ready:
        """The bridge."""
        target = self.target(joints=JOINTS, whose="a Doosan arm")
        motion, what = self.motion(target, HOME)
        sender = DrflSender(motion, to=(self.to, self.port), rate=self.rate)
        return Ready(sender, f"{target.name}, {what}", f"to {self.to}:{self.port}")
