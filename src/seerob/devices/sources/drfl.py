"""Doosan controllers, live, through the maker's own library and the bridge in ``bridges/doosan_drfl``.

The library is the maker's and not part of this software; the bridge is a small program that its user
builds with it, and that sends what the library says to this machine. See
`seerob.protocols.robots.doosan_drfl`.
"""

from __future__ import annotations

import math
from collections.abc import AsyncGenerator
from contextlib import aclosing
from typing import Annotated, ClassVar

from msgspec import Meta

from seerob.core.motion_origin import MotionOrigin, origin_finding
from seerob.core.samples import JointSample, Quality, Sample, SignalSample
from seerob.core.snapshot import Finding
from seerob.devices.live.robot_controller import RobotController
from seerob.protocols.links.datagrams import listening
from seerob.protocols.robots import doosan_drfl
from seerob.protocols.robots.doosan_drfl import (
    DOUBTFUL,
    JOINTS,
    UNSURE,
    Message,
    RobotMode,
    RobotState,
    decode,
)
from seerob.workstation.source import Target

SILENCE = 1.0
"""Longest pause before the bridge is taken for gone [s]."""
SIGNAL_PERIOD = 0.1
"""Signals are repeated after this time, or when a state changes [s]."""
DEGREE = math.pi / 180


class Drfl(RobotController, frozen=True, kw_only=True):
    """A Doosan controller, live, through the maker's library and a bridge."""

    joints: ClassVar[int] = JOINTS
    whose: ClassVar[str] = "the bridge sends"
    host: str = "127.0.0.1"
    """Address of the machine on which the bridge runs; what others send is not listened to."""
    bind: str = "127.0.0.1"
    """Own address on the bridge's network; when not given, only this machine itself is heard."""
    port: Annotated[int, Meta(ge=0, le=65535)] = doosan_drfl.PORT
    """Own port that the bridge sends to."""
    frequency: Annotated[float, Meta(ge=10, le=1000, extra={"unit": "Hz"})] = 100.0
    """Messages per second that the bridge was told to send [Hz]."""
    origin: MotionOrigin = MotionOrigin.CONTROLLER
    """``vendor_emulator`` when it is the maker's emulator."""

    async def ask(self) -> tuple[Finding, ...]:
        """Whether it sends, and what it does not have."""
        async with (
            listening(self.bind, self.port, sender=self.host) as port,
            aclosing(port.receive(SILENCE)) as heard,
        ):
            async for datagram in heard:
                return self._remarks(decode(datagram.data))
        raise TimeoutError("nothing heard")  # pragma: no cover - receive ends by raising only

    def _remarks(self, message: Message) -> tuple[Finding, ...]:
        where = f"drfl {self.host}"
        if self.origin is MotionOrigin.CONTROLLER:
            text = f"motion heard from the controller through the maker's library ({where})"
            said = [Finding(level="note", subject=self.robot, text=text)]
        else:
            said = [origin_finding(self.origin, self.robot, where)]
        if message.torques is None:
            said.append(Finding(level="note", subject=self.robot, text="no measured joint torques"))
        return tuple(said)

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Joint samples, and signals ten times a second and whenever a state changes."""
        said: dict[str, float | bool | str] = {}
        due = 0.0
        newest: Message | None = None
        async with (
            listening(self.bind, self.port, sender=self.host) as port,
            aclosing(port.receive(SILENCE)) as heard,
        ):
            async for datagram in heard:
                message = decode(datagram.data)
                if newest is not None and is_older(message, newest):
                    continue
                newest = message
                now = states(message)
                if now != said or datagram.arrived >= due:
                    said, due = now, datagram.arrived + SIGNAL_PERIOD
                    yield SignalSample(source="", seq=0, t=datagram.arrived, values=now)
                yield joint_sample(message, target=self.robot, arrived=datagram.arrived)


LATE = 1000
"""By so many numbers a message may be overtaken on the way."""


def is_older(message: Message, newest: Message) -> bool:
    """Whether a message was overtaken on the way, or came twice; the count comes round at 2³².

    A bridge that was started anew counts from 0 again while the controller's time goes on.
    """
    behind = (newest.number - message.number) % (1 << 32)
    return behind < LATE and message.number != 0 and message.time <= newest.time


def joint_sample(message: Message, *, target: str, arrived: float) -> JointSample:
    """What a message says of the joints.

    Args:
        message: In the maker's units.
        target: Robot it drives.
        arrived: Host's monotonic time [s].
    """
    quality = Quality.GOOD
    if message.state in UNSURE or message.state not in list(RobotState):
        quality = Quality.INVALID
    elif message.state in DOUBTFUL:
        quality = Quality.DEGRADED
    return JointSample(
        source="",
        seq=0,
        t=arrived,
        t_device=message.time if math.isfinite(message.time) else None,
        target=target,
        q=tuple(DEGREE * x for x in message.positions),
        qd=tuple(DEGREE * x for x in message.speeds),
        tau=message.torques,
        quality=quality,
    )


def states(message: Message) -> dict[str, float | bool | str]:
    """State of the robot in words; a number that nobody explained as such."""
    state = message.state
    found: dict[str, float | bool | str] = {
        "robot_state": RobotState(state).name.lower() if state in list(RobotState) else str(state),
        "robot_mode": (
            RobotMode(message.mode).name.lower() if message.mode in list(RobotMode) else str(message.mode)
        ),
        "control_mode": str(message.control),
        "emergency_stop": state == RobotState.EMERGENCY_STOP,
        "protective_stop": state in (RobotState.SAFE_STOP, RobotState.SAFE_STOP2),
    }
    for k, torque in enumerate(message.external):
        if math.isfinite(torque):
            found[f"external_torque.{k + 1}"] = torque
    return found
