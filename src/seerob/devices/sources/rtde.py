"""Universal Robots controllers, live, through their real-time data exchange (RTDE).

Joint angles [rad], speeds [rad/s] and, from controllers that have it, measured torques [N·m]; state,
speed scaling, payload and tool pose as signals. What a controller does not have is left out and said.
Nothing is written to the robot: no inputs are registered.
"""

from __future__ import annotations

import logging
import math
from collections.abc import AsyncGenerator, Mapping
from contextlib import aclosing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from msgspec import Meta

from seerob.core.errors import InputError
from seerob.core.motion_origin import MotionOrigin, origin_finding
from seerob.core.samples import JointSample, Sample, SignalSample
from seerob.core.snapshot import Finding
from seerob.devices.live.listening import Contact, at_start, because
from seerob.devices.live.robot_controller import RobotController
from seerob.protocols import ProtocolError
from seerob.protocols.robots import rtde, ur_primary
from seerob.protocols.robots.rtde import (
    CB3_RATE,
    Level,
    RobotMode,
    SafetyStatus,
    TextMessage,
    Value,
    is_cb3,
    name,
    quality,
)
from seerob.workstation.source import Target

if TYPE_CHECKING:
    from seerob.description.robots.calibration import Calibration

_log = logging.getLogger(__name__)

NEEDED = ("timestamp", "actual_q")
WANTED = (
    "actual_qd",
    "actual_current_as_torque",
    "robot_mode",
    "safety_status",
    "safety_mode",
    "runtime_state",
    "speed_scaling",
    "payload",
    "actual_TCP_pose",
    "actual_TCP_speed",
)
FIELDS = (*NEEDED, *WANTED)
STATES = ("robot_mode", "safety_status", "safety_mode", "runtime_state")
"""Fields whose change is told at once."""
SIGNAL_PERIOD = 0.1
"""Signals are repeated after this time, or when a state changes [s]."""
SAME_TOOL = 2e-4
"""A tool that is nearer to where it should be is there [m]: a fraction of what such arms repeat to."""
ANOTHER = 0.010
"""A tool that is farther from where it should be leaves what rests on the robot undecided [m]: as far as a
tool centre point may be from the twin's by default, see `seerob.twin.controller_check`."""
PRIMARY_WITHIN = 1.4
"""The primary interface says everything at least once a second [s]."""
LEVELS = {Level.EXCEPTION: logging.ERROR, Level.ERROR: logging.ERROR, Level.WARNING: logging.WARNING}
AXES = ("x", "y", "z", "rx", "ry", "rz")


# -- values to samples --------------------------------------------------------------------------


def joint_sample(values: Mapping[str, Value], *, target: str, arrived: float) -> JointSample:
    """What a data package says of the joints.

    Args:
        values: By field; those of `NEEDED` at least.
        target: Robot it drives.
        arrived: Host's monotonic time [s].
    """
    return JointSample(
        source="",
        seq=0,
        t=arrived,
        t_device=_number(values["timestamp"]),
        target=target,
        q=_vector(values["actual_q"]),
        qd=_vector(values["actual_qd"]) if "actual_qd" in values else None,
        tau=_vector(values["actual_current_as_torque"]) if "actual_current_as_torque" in values else None,
        tcp=_place(values["actual_TCP_pose"]) if "actual_TCP_pose" in values else None,
        tcp_speed=math.hypot(*_place(values["actual_TCP_speed"])) if "actual_TCP_speed" in values else None,
        payload=_number(values["payload"]) if "payload" in values else None,
        quality=quality(_whole(values.get("robot_mode")), _safety(values)),
    )


def states(values: Mapping[str, Value]) -> dict[str, float | bool | str]:
    """State of the robot in words, for signals; a number that nobody explained as such."""
    found: dict[str, float | bool | str] = {}
    mode, safety = _whole(values.get("robot_mode")), _safety(values)
    if mode is not None:
        found["robot_mode"] = name(RobotMode, mode) or str(mode)
    if safety is not None:
        found["safety_status"] = name(SafetyStatus, safety) or str(safety)
    if "runtime_state" in values:
        found["program_running"] = values["runtime_state"] == 2
    return found


def figures(values: Mapping[str, Value]) -> dict[str, float | bool | str]:
    """What else it says, for signals: SI, the tool in the robot's base frame, as rotation vector."""
    found: dict[str, float | bool | str] = {
        key: _number(values[key]) for key in ("speed_scaling", "payload") if key in values
    }
    for key in ("actual_TCP_pose", "actual_TCP_speed"):
        if key in values:
            vector = _vector(values[key])
            found |= {f"{key}.{axis}": x for axis, x in zip(AXES, vector, strict=True)}
    return found


def _number(value: Value) -> float:
    if isinstance(value, tuple):
        raise ProtocolError(f"a vector where a number belongs: {value}")
    return float(value)


def _vector(value: Value) -> tuple[float, ...]:
    if not isinstance(value, tuple) or len(value) != 6:
        raise ProtocolError(f"not six values: {value}")
    return tuple(map(float, value))


def _place(value: Value) -> tuple[float, float, float]:
    x, y, z, *_ = _vector(value)
    return x, y, z


def _whole(value: Value | None) -> int | None:
    if value is None:
        return None
    number = _number(value)
    if not number.is_integer():
        raise ProtocolError(f"{number} where a whole number belongs")
    return int(number)


def _safety(values: Mapping[str, Value]) -> int | None:
    return _whole(values.get("safety_status", values.get("safety_mode")))


# -- the source ---------------------------------------------------------------------------------


class Rtde(RobotController, frozen=True, kw_only=True):
    """A Universal Robots controller, live, through RTDE."""

    joints: ClassVar[int] = 6
    whose: ClassVar[str] = "a Universal Robots arm has"
    host: str
    """Name or address of the controller."""
    port: Annotated[int, Meta(ge=1, le=65535)] = rtde.PORT
    """TCP port of the controller's real-time data exchange."""
    frequency: Annotated[float, Meta(ge=1, le=500, extra={"unit": "Hz"})] = 125.0
    """Samples per second [Hz]; e-Series and later can do 500."""
    primary_port: Annotated[int, Meta(ge=0, le=65535)] = ur_primary.PORT
    """Port of the primary interface, which is read once for the kinematics of this very robot; 0 leaves it
    out."""
    origin: MotionOrigin = MotionOrigin.CONTROLLER
    """``vendor_emulator`` when it is URSim."""

    def reach(self, folder: Path, target: Target | None) -> tuple[Finding, ...]:
        """Ask the controller what it has, and for the kinematics of this very robot, if it can be reached.

        Raises:
            InputError: The controller does not say where the joints are.
        """
        said = super().reach(folder, target)
        if target is None or not self.primary_port or any("not reached" in f.text for f in said):
            return said
        return (*said, self._kinematics(target))

    def contact(self) -> Contact:
        """The controller, on the port of RTDE and on that of its kinematics."""
        found = super().contact()
        more = f" and :{self.primary_port}" if self.primary_port else ""
        return found._replace(where=f"{found.where}{more}")

    def _kinematics(self, target: Target) -> Finding:
        """Whether the model has the kinematics of this very robot."""
        other = False
        try:
            found = at_start(self.calibration())
            if target.description is None:
                raise ProtocolError("there is no model to compare it with")
            from seerob.description.robots.calibration import off_by

            off = off_by(target.description, found, f"rtde {self.host}")
        except InputError as error:
            level, text, other = "warning", f"its kinematics are {error.problems[0].what}", True
        except (OSError, EOFError, ProtocolError) as error:
            level = "assumed"
            text = (
                "kinematics as the model has them: those of this very robot could not be read "
                f"(port {self.primary_port}: {because(error)})"
            )
        else:
            level, text = "note", f"the model's tool is where this very robot's is, to {1e3 * off:.2f} mm"
            if off > SAME_TOOL:
                level = "warning"
                text = (
                    f"the model's tool is up to {1e3 * off:.1f} mm from where this very robot's is: "
                    f"seerob probe rtde {self.host} --calibration FILE, and name it in the robot's table: "
                    'calibration = "FILE"'
                )
            other = off > ANOTHER
        return Finding(level=level, subject=self.robot, text=text, holds=(self.robot,) * other)

    async def calibration(self) -> Calibration:
        """The kinematics of this very robot, from the primary interface.

        Raises:
            OSError: There is no connection.
            ProtocolError: It says something else.
        """
        from seerob.description.robots.calibration import Calibration

        k = await ur_primary.read_kinematics(self.host, self.primary_port, PRIMARY_WITHIN)
        return Calibration(theta=k.theta, a=k.a, d=k.d, alpha=k.alpha, checksum=k.checksum)

    async def ask(self) -> tuple[Finding, ...]:
        """Software, protocol, and what the controller does not have."""
        async with rtde.connect(self.host, self.port, FIELDS, self.frequency) as session:
            if lacking := self._lacking(session):
                raise InputError.at(f"rtde {self.host}", "host", lacking, "is it a robot's controller?")
            where = f"rtde {self.host}:{self.port}"
            if self.origin is MotionOrigin.CONTROLLER:
                text = f"motion heard from the controller, as it happens ({where})"
                heard = Finding(level="note", subject=self.robot, text=text)
            else:
                heard = origin_finding(self.origin, self.robot, where)
            said = remarks(session, self.frequency)
            return (heard, *(Finding(level=level, subject=self.robot, text=text) for level, text in said))

    @staticmethod
    def _lacking(session: rtde.Session) -> str:
        """What the controller has to have and has not; empty when it has everything."""
        lacking = [f for f in NEEDED if f in session.missing]
        return f"the controller has no {' and no '.join(lacking)}" if lacking else ""

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Joint samples, and signals ten times a second and whenever a state changes."""
        async with rtde.connect(self.host, self.port, FIELDS, self.frequency) as session:
            if lacking := self._lacking(session):
                raise ProtocolError(lacking)
            said: tuple[Value | None, ...] = ()
            due = 0.0
            async with aclosing(session.receive()) as heard:
                async for reading in heard:
                    if isinstance(reading, TextMessage):
                        _tell(self.name or f"rtde {self.robot}", reading)
                        continue
                    yield joint_sample(reading.values, target=self.robot, arrived=reading.arrived)
                    now = tuple([reading.values.get(field) for field in STATES])
                    if now != said or reading.arrived >= due:
                        said, due = now, reading.arrived + SIGNAL_PERIOD
                        values = states(reading.values) | figures(reading.values)
                        yield SignalSample(source="", seq=0, t=reading.arrived, values=values)


def remarks(session: rtde.Session, frequency: float) -> list[tuple[str, str]]:
    """What is to be said of a controller, as level and text."""
    said = [("note", f"controller software {session.controller or 'unknown'}, RTDE {session.version}")]
    if session.missing:
        said.append(("note", f"does not have {', '.join(session.missing)}"))
    if "actual_qd" in session.missing:
        said.append(("assumed", "no measured joint speeds: derived from the positions"))
    if "actual_current_as_torque" in session.missing:
        said.append(("note", "no measured joint torques: a factor from current to torque is not published"))
    if "robot_mode" in session.missing:
        said.append(("warning", "does not say whether the robot is on: what depends on it is undecided"))
    if {"safety_status", "safety_mode"} <= set(session.missing):
        said.append(("warning", "does not say its safety status"))
    if session.version == 1:
        said.append(("note", "version 1 sends at the controller's own rate, whatever frequency is asked for"))
    if is_cb3(session.controller) and frequency > CB3_RATE:
        said.append(("warning", f"a CB3 controller sends {CB3_RATE:g} Hz at most, not {frequency:g}"))
    return said


def _tell(who: str, message: TextMessage) -> None:
    level = LEVELS.get(Level(message.level), logging.INFO) if message.level in list(Level) else logging.INFO
    _log.log(level, "%s: the controller says: %.300s", who, f"{message.text} ({message.source})")
