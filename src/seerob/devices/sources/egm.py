"""ABB controllers, live, through Externally Guided Motion (EGM): what they stream of their positions.

Joint angles [rad]; state, measured force and utilization as signals. Speeds are not on the wire and are
differentiated. Nothing is sent to the controller. See `seerob.protocols.robots.abb_egm`.
"""

from __future__ import annotations

import math
from collections.abc import AsyncGenerator
from contextlib import aclosing
from typing import Annotated, ClassVar

from msgspec import Meta

from seerob.core.motion_origin import MotionOrigin, origin_finding
from seerob.core.samples import JointSample, Sample, SignalSample
from seerob.core.snapshot import Finding
from seerob.devices.live.device_clock import REORDERED
from seerob.devices.live.differentiation import SAMPLES, Differentiator
from seerob.devices.live.robot_controller import RobotController, state_name
from seerob.protocols import ProtocolError
from seerob.protocols.links.datagrams import listening
from seerob.protocols.robots import abb_egm
from seerob.protocols.robots.abb_egm import JOINTS, Message, MotionState, MotorState, RapidState
from seerob.workstation.source import Target

SIGNAL_PERIOD = 0.1
"""Signals are repeated after this time, or when a state changes [s]."""
SILENCE = 1.0
"""Longest pause before the controller is taken for gone [s]."""
GAP = 5.0
"""Periods after which older samples say nothing of the present speed."""
DEGREE = math.pi / 180
GUIDED = (
    "its program has begun externally guided motion, which stops when nobody answers, and a twin must not: "
    "end EGMRunJoint and EGMRunPose, and stream positions (EGMStreamStart)"
)


def states(message: Message) -> dict[str, float | bool | str]:
    """State of motors, motion and program in words; a number that nobody explained as such."""
    return {
        "motors": state_name(MotorState, message.motors).lower(),
        "guided_motion": state_name(MotionState, message.motion).lower(),
        "program": state_name(RapidState, message.program).lower(),
    }


def figures(message: Message) -> dict[str, float | bool | str]:
    """What else it says: measured forces [N and N·m], further axes as they are, and a share."""
    found: dict[str, float | bool | str] = {f"force.{k + 1}": x for k, x in enumerate(message.force)}
    found |= {f"external_axis.{k + 1}": x for k, x in enumerate(message.external)}
    return found if message.utilization is None else {**found, "utilization": 0.01 * message.utilization}


class Egm(RobotController, frozen=True, kw_only=True):
    """An ABB controller, live, through the positions that it streams (EGM)."""

    joints: ClassVar[int] = JOINTS
    whose: ClassVar[str] = "the controller says those of"
    host: str
    """Name or address of the controller; what others send is not listened to."""
    bind: str = "127.0.0.1"
    """Own address on the controller's network; when not given, only this machine itself is heard."""
    port: Annotated[int, Meta(ge=0, le=65535)] = abb_egm.PORT
    """Own port that the controller sends to: that of its UCdevice."""
    frequency: Annotated[float, Meta(ge=1, le=250, extra={"unit": "Hz"})] = 1 / abb_egm.PERIOD
    """Messages per second that the program has asked for [Hz]: 1000 / SampleRate in ms."""
    origin: MotionOrigin = MotionOrigin.CONTROLLER
    """``vendor_emulator`` when it is RobotStudio."""

    async def ask(self) -> tuple[Finding, ...]:
        """Whose motion it is, and what state it is in."""
        async with (
            listening(self.bind, self.port, sender=self.host) as port,
            aclosing(port.receive(SILENCE)) as heard,
        ):
            async for datagram in heard:
                return self._remarks(abb_egm.decode(datagram.data))
        raise TimeoutError("nothing heard")  # pragma: no cover - receive ends by raising only

    def _remarks(self, message: Message) -> tuple[Finding, ...]:
        where = f"egm {self.host}"
        if self.origin is MotionOrigin.CONTROLLER:
            text = f"motion heard from the controller, as it happens ({where})"
            said = [Finding(level="note", subject=self.robot, text=text)]
        else:
            said = [origin_finding(self.origin, self.robot, where)]
        text = f"no measured joint speeds: slope of a parabola through the last {SAMPLES} positions"
        said.append(Finding(level="assumed", subject=self.robot, text=text))
        if message.motion == MotionState.RUNNING:
            said.append(Finding(level="warning", subject=self.robot, text=GUIDED))
        return tuple(said)

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Joint samples, and signals ten times a second and whenever a state changes."""
        slope = Differentiator(GAP * self.period())
        said: tuple[int, ...] = ()
        due, newest = 0.0, -math.inf
        async with (
            listening(self.bind, self.port, sender=self.host) as port,
            aclosing(port.receive(SILENCE)) as heard,
        ):
            async for datagram in heard:
                message = abb_egm.decode(datagram.data)
                if len(message.joints) != JOINTS:
                    raise ProtocolError(f"sends {len(message.joints)} joints; those of {JOINTS} are read")
                q = tuple([DEGREE * x for x in message.joints])
                qd = error = None
                if not newest - REORDERED < message.time <= newest:  # neither doubled nor overtaken
                    newest = message.time
                    qd = slope.add(newest, q)
                    error = None if qd is None else slope.error()
                yield JointSample(
                    source="", seq=0, t=datagram.arrived, t_device=message.time, target=self.robot,
                    q=q, qd=qd, qd_error=error,
                )  # fmt: skip
                now = message.motors, message.motion, message.program
                if now != said or datagram.arrived >= due:
                    said, due = now, datagram.arrived + SIGNAL_PERIOD
                    values = states(message) | figures(message)
                    yield SignalSample(source="", seq=0, t=datagram.arrived, values=values)
