"""Controllers of Dobot's CR, Nova and Magician E6 arms, live, through their port for real-time feedback.

Joint angles [rad] and speeds [rad/s]; state, speed scaling and payload as signals. Nothing is sent to the
controller. See `seerob.protocols.robots.dobot`.
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
from seerob.devices.live.robot_controller import RobotController, state_name
from seerob.protocols.robots import dobot
from seerob.protocols.robots.dobot import JOINTS, Message, RobotMode
from seerob.workstation.source import Target

SIGNAL_PERIOD = 0.1
"""Signals are repeated after this time, or when a state changes [s]."""
DEGREE = math.pi / 180
UNSURE = (RobotMode.INITIALIZING, RobotMode.POWER_OFF)
"""Where the joints are not known."""
SURE = (
    *(RobotMode.ENABLED, RobotMode.DRAGGED, RobotMode.RUNNING),
    *(RobotMode.SINGLE_MOVE, RobotMode.PAUSED, RobotMode.COLLISION),
)
"""A robot that has detected a collision stands where it says, enabled or not, and may be in alarm."""


def joint_sample(message: Message, *, target: str, arrived: float) -> JointSample:
    """What a message says of the joints.

    Args:
        message: In the maker's units.
        target: Robot it drives.
        arrived: Host's monotonic time [s].
    """
    stopped = message.mode in (RobotMode.PAUSED, RobotMode.COLLISION)
    agreed = stopped or (message.enabled and not message.alarm)
    quality = Quality.GOOD if message.mode in SURE and agreed else Quality.DEGRADED
    if message.mode in UNSURE:
        quality = Quality.INVALID
    x, y, z, *_ = message.tool
    return JointSample(
        source="",
        seq=0,
        t=arrived,
        t_device=message.time,
        target=target,
        q=tuple([DEGREE * x for x in message.positions]),
        qd=tuple([DEGREE * x for x in message.speeds]),
        # In another user frame nobody knows here where that is.
        tcp=None if message.user_frame else (1e-3 * x, 1e-3 * y, 1e-3 * z),
        payload=message.payload,
        quality=quality,
    )


def states(message: Message) -> dict[str, float | bool | str]:
    """State of the robot in words; a number that nobody explained as such."""
    return {
        "robot_mode": state_name(RobotMode, message.mode).lower(),
        "enabled": message.enabled,
        "dragged": message.dragged,
        "program_running": message.running,
        "alarm": message.alarm,
        "collision": message.collision,
        "user_frame": float(message.user_frame),
    }


def figures(message: Message) -> dict[str, float | bool | str]:
    """What else it says: a share, and what it was told that hangs at its flange [kg]."""
    return {"speed_scaling": 0.01 * message.speed_scaling, "payload": message.payload}


class Dobot(RobotController, frozen=True, kw_only=True):
    """A Dobot controller (CR, Nova, Magician E6), live, through its real-time feedback."""

    joints: ClassVar[int] = JOINTS
    whose: ClassVar[str] = "the controller says those of"
    host: str
    """Name or address of the controller."""
    port: Annotated[int, Meta(ge=1, le=65535)] = dobot.PORT
    """TCP port of its real-time feedback: 30004 every 8 ms, 30005 every 200 ms."""
    frequency: Annotated[float, Meta(ge=1, le=500, extra={"unit": "Hz"})] = 1 / dobot.PERIOD
    """Messages per second that the port sends [Hz]."""
    origin: MotionOrigin = MotionOrigin.CONTROLLER
    """``vendor_emulator`` when it is the maker's virtual controller."""

    async def ask(self) -> tuple[Finding, ...]:
        """What state it is in."""
        async with dobot.connect(self.host, self.port) as heard, aclosing(heard):
            async for reading in heard:
                return self._remarks(reading.message)
        raise TimeoutError("connected, and nothing heard")

    def _remarks(self, message: Message) -> tuple[Finding, ...]:
        where = f"dobot {self.host}:{self.port}"
        if self.origin is MotionOrigin.CONTROLLER:
            text = f"motion heard from the controller, as it happens ({where})"
            said = [Finding(level="note", subject=self.robot, text=text)]
        else:
            said = [origin_finding(self.origin, self.robot, where)]
        said.append(Finding(level="note", subject=self.robot, text=f"is {states(message)['robot_mode']}"))
        text = "no measured joint torques: their unit is not published"
        return (*said, Finding(level="note", subject=self.robot, text=text))

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Joint samples, and signals ten times a second and whenever a state changes."""
        said: dict[str, float | bool | str] = {}
        due = 0.0
        async with dobot.connect(self.host, self.port) as heard, aclosing(heard):
            async for arrived, message in heard:
                yield joint_sample(message, target=self.robot, arrived=arrived)
                now = states(message)
                if now != said or arrived >= due:
                    said, due = now, arrived + SIGNAL_PERIOD
                    yield SignalSample(source="", seq=0, t=arrived, values=now | figures(message))
