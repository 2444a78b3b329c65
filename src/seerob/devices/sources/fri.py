"""KUKA LBR iiwa and med controllers, live, through the Fast Robot Interface (FRI).

Joint angles [rad], measured and external torques [N·m]; state of session, safety and drives as signals.
Speeds are not on the wire and are differentiated. The answers keep a monitoring session alive and
command nothing.
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
from seerob.protocols.robots import fri
from seerob.protocols.robots.fri import Monitoring, SessionState
from seerob.workstation.source import Target

JOINTS = 7
"""Of every LBR."""
SIGNAL_PERIOD = 0.1
"""Signals are repeated after this time, or when a state changes [s]."""
SILENCE = 1.0
"""Longest pause before the controller is taken for gone [s]."""
GAP = 5.0
"""Periods after which older samples say nothing of the present speed."""


def joint_sample(
    m: Monitoring,
    *,
    target: str,
    arrived: float,
    device: float | None,
    qd: tuple[float, ...] | None,
    qd_error: tuple[float, ...] | None = None,
) -> JointSample:
    """What a message says of the joints.

    Whatever state the session and the drives are in, the encoders of an LBR say where the joints are.

    Args:
        m: The message.
        target: Robot it drives.
        arrived: Host's monotonic time [s].
        device: The controller's time [s].
        qd: Speeds [rad/s].
        qd_error: How far they may be off [rad/s].
    """
    n = len(m.q)
    return JointSample(
        source="",
        seq=0,
        t=arrived,
        t_device=device,
        target=target,
        q=m.q,
        qd=qd,
        qd_error=qd_error,
        tau=m.tau if len(m.tau) == n else None,
        tcp=(1e-3 * m.tcp[0], 1e-3 * m.tcp[1], 1e-3 * m.tcp[2]) if m.tcp else None,
    )


def states(m: Monitoring) -> dict[str, float | bool | str]:
    """State of session and robot in words; a number that nobody explained as such."""
    found: dict[str, float | bool | str] = {
        "session": state_name(SessionState, m.session),
        "quality": state_name(fri.Quality, m.quality),
    }
    for key, kind, value in (
        ("safety", fri.SafetyState, m.safety),
        ("operation_mode", fri.OperationMode, m.operation),
        ("control_mode", fri.ControlMode, m.control),
    ):
        if value is not None:
            found[key] = state_name(kind, value)
    if m.drives:
        found["drives"] = state_name(fri.DriveState, min(m.drives))
    return found


def figures(m: Monitoring) -> dict[str, float | bool | str]:
    """What else it says: estimated external torques [N·m], and what the robot program shares."""
    found: dict[str, float | bool | str] = {
        f"external_torque.{k + 1}": x for k, x in enumerate(m.external_tau)
    }
    return found | {f"io.{name}": value for name, value in m.io}


class DeviceTime:
    """The controller's time: its time stamps, or where it sends none, its count of messages."""

    def __init__(self) -> None:
        self._counted: int | None = None

    def __call__(self, m: Monitoring) -> float | None:
        """[s]; None when it says neither."""
        if m.time is not None:
            return m.time
        if not m.send_period:
            return None
        if self._counted is None:
            self._counted = m.sequence
        # The counter has 32 bits and comes round, and datagrams may overtake one another there too.
        self._counted += (m.sequence - self._counted + (1 << 31)) % (1 << 32) - (1 << 31)
        return self._counted * m.send_period * 1e-3


class _Answering:
    """Answers every so many messages, as the controller asks; reads each but once."""

    def __init__(self) -> None:
        self._sent, self._since = 0, 0
        self._read: tuple[bytes, Monitoring] | None = None

    def monitoring(self, datagram: bytes) -> Monitoring:
        """What a datagram says.

        Raises:
            ProtocolError: It is no monitoring message.
        """
        if self._read is None or self._read[0] is not datagram:
            self._read = datagram, fri.decode_monitoring(datagram)
        return self._read[1]

    def __call__(self, datagram: bytes) -> bytes | None:
        try:
            m = self.monitoring(datagram)
        except ProtocolError:
            return None  # whoever reads it will say so
        self._since += 1
        answer = fri.answer_to(m, self._sent)
        if answer is None or self._since < m.receive_multiplier:
            return None
        self._since = 0
        self._sent = (self._sent + 1) & 0xFFFF_FFFF
        return fri.encode_answer(answer)


class Fri(RobotController, frozen=True, kw_only=True):
    """A KUKA LBR controller, live, through FRI."""

    joints: ClassVar[int] = JOINTS
    whose: ClassVar[str] = "an LBR has"
    host: str
    """Name or address of the controller; what others send is not listened to."""
    bind: str = "127.0.0.1"
    """Own address on the controller's network; when not given, only this machine itself is heard."""
    port: Annotated[int, Meta(ge=0, le=65535)] = fri.PORT
    """Own port that the controller sends to; 30200 to 30209."""
    frequency: Annotated[float, Meta(ge=10, le=1000, extra={"unit": "Hz"})] = 200.0
    """Messages per second that the robot program has asked for [Hz]: 1000 / send period in ms."""
    origin: MotionOrigin = MotionOrigin.CONTROLLER
    """``vendor_emulator`` when it is KUKA.Sim or OfficeLite."""

    async def ask(self) -> tuple[Finding, ...]:
        """Which FRI it speaks, how often it sends, and what state it is in."""
        async with (
            listening(self.bind, self.port, sender=self.host, answer=_Answering()) as port,
            aclosing(port.receive(SILENCE)) as heard,
        ):
            async for datagram in heard:
                return self._remarks(fri.decode_monitoring(datagram.data))
        raise TimeoutError("nothing heard")  # pragma: no cover - receive ends by raising only

    def _remarks(self, m: Monitoring) -> tuple[Finding, ...]:
        where = f"fri {self.host}"
        if self.origin is MotionOrigin.CONTROLLER:
            text = f"motion heard from the controller, as it happens ({where})"
            said = [Finding(level="note", subject=self.robot, text=text)]
        else:
            said = [origin_finding(self.origin, self.robot, where)]
        said.append(Finding(level="note", subject=self.robot, text=f"speaks FRI {m.edition}"))
        text = f"no measured joint speeds: slope of a parabola through the last {SAMPLES} positions"
        said.append(Finding(level="assumed", subject=self.robot, text=text))
        if m.send_period and not 0.9 < m.send_period * 1e-3 * self.frequency < 1.1:
            text = f"sends every {m.send_period} ms, the file says frequency = {self.frequency:g}"
            said.append(Finding(level="warning", subject=self.robot, text=text))
        if m.session in (SessionState.COMMANDING_WAIT, SessionState.COMMANDING_ACTIVE):
            text = (
                "its program has started a motion overlay, which a twin must not steer: it is answered with "
                "the controller's own joints; end the overlay and leave the session monitoring"
            )
            said.append(Finding(level="warning", subject=self.robot, text=text))
        if not m.tau:
            said.append(Finding(level="note", subject=self.robot, text="does not send measured torques"))
        return tuple(said)

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Joint samples, and signals ten times a second and whenever a state changes."""
        device, slope = DeviceTime(), Differentiator(GAP * self.period())
        said: tuple[object, ...] = ()
        due, newest = 0.0, -math.inf
        answering = _Answering()
        async with (
            listening(self.bind, self.port, sender=self.host, answer=answering) as port,
            aclosing(port.receive(SILENCE)) as heard,
        ):
            async for datagram in heard:
                m = answering.monitoring(datagram.data)
                if len(m.q) != JOINTS:
                    raise ProtocolError(f"sends {len(m.q)} joints where an LBR has {JOINTS}")
                t = device(m)
                instant = datagram.arrived if t is None else t
                qd = error = None
                if not newest - REORDERED < instant <= newest:  # neither doubled nor overtaken
                    newest = instant
                    qd = slope.add(instant, m.q)
                    error = None if qd is None else slope.error()
                yield joint_sample(
                    m, target=self.robot, arrived=datagram.arrived, device=t, qd=qd, qd_error=error
                )
                now = m.session, m.quality, m.safety, m.operation, m.control, m.drives
                if now != said or datagram.arrived >= due:
                    said, due = now, datagram.arrived + SIGNAL_PERIOD
                    values = states(m) | figures(m)
                    yield SignalSample(source="", seq=0, t=datagram.arrived, values=values)
