"""Robots of any maker, live, through OPC 40010 (OPC UA for Robotics): bound without a dictionary."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import AsyncGenerator
from pathlib import Path
from typing import Annotated, ClassVar

import msgspec
from msgspec import Meta

from seerob.core.errors import InputError, Problem
from seerob.core.extras import need
from seerob.core.motion_origin import MotionOrigin, origin_finding
from seerob.core.quantities import Seconds
from seerob.core.samples import JointSample, Quality, Sample, SignalSample
from seerob.core.snapshot import Finding
from seerob.description.robots import library_names
from seerob.devices.live.listening import LiveSource
from seerob.devices.variables.access import missing, with_absolute_paths
from seerob.devices.variables.live_source import PULSES
from seerob.protocols import ProtocolError
from seerob.protocols.plc.opcua_client import Changes, NodeValue, Security, Way, connect, not_pinned
from seerob.protocols.plc.opcua_robotics import MODES, Robot, robots
from seerob.workstation.source import Opened, Target
from seerob.workstation.variables import unit

SIGNAL_PERIOD = 0.1
"""Signals are repeated after this time, or when a state changes [s]."""
LOAD = "load"
"""The mass at the flange among the nodes that are watched."""


class OpcuaRobot(LiveSource, frozen=True, kw_only=True):
    """A robot, live, through OPC UA for Robotics (OPC 40010)."""

    links: ClassVar[bool] = False
    loads: ClassVar[tuple[str, ...]] = ("asyncua",)
    asked: ClassVar[bool] = True
    tells_changes: ClassVar[bool] = True

    robot: str
    """The robot it drives."""
    url: Annotated[
        str, Meta(pattern=r"^opc\.tcp://[^\s/]+", description="an address such as opc.tcp://192.168.0.1:4840")
    ]
    """``opc.tcp://192.168.0.1:4840``"""
    device: str | None = None
    """Name of the motion device on the server; the only one when not given."""
    axes: tuple[str, ...] = ()
    """Names of the axes in the order of the robot's joints; in natural order when not given."""
    position_unit: str | None = None
    """Unit of the positions, for servers that state none: ``deg``, ``mm``. Never guessed."""
    interval: Seconds = 0.02
    """Publishing interval that is asked for [s]; a server may grant a longer one, and says so."""
    timeout: Seconds = 0.5
    """Age at which what it said no longer counts [s]."""
    security: Security = Security.NONE
    """How the session is protected: not at all, signed, or signed and encrypted (Basic256Sha256)."""
    certificate: str | None = None
    """Own certificate beside the workstation, which the server must trust; for ``sign`` and ``encrypt``."""
    key: str | None = None
    """Its private key."""
    server_certificate: str | None = None
    """The server's certificate; another one is refused."""
    user: str | None = None
    """Name to log in with; anonymous when not given."""
    password_env: str | None = None
    """Environment variable that holds the password: a workstation file is no place for one."""
    origin: MotionOrigin = MotionOrigin.CONTROLLER
    """``vendor_emulator`` when it is the maker's emulator."""

    def target(self) -> str:
        """The robot."""
        return self.robot

    def period(self) -> float:
        """Interval between samples that is asked for [s]."""
        return self.interval

    def way(self) -> Way:
        """How to get there."""
        return msgspec.convert(self, Way, from_attributes=True)

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Bind the robot's joints to the server's axes, if it can be reached.

        Raises:
            InputError: It can be reached, and has another number of axes, other names, or no units.
        """
        need(*self.loads)
        if target is None:
            raise InputError.at("sources", "robot", f"no robot {self.robot!r}", "name a robot")
        where = f"opcua_robot {self.url}"
        if problems := missing(where, self, folder):
            raise InputError(problems)
        if self.axes and len(self.axes) != len(target.joints):
            what = f"{len(self.axes)} axes for the {len(target.joints)} joints of {target.name}"
            raise InputError.at(where, "axes", what, "name one per joint")
        if self.position_unit is not None and unit(self.position_unit) is None:
            raise InputError.at(where, "position_unit", f"unknown unit {self.position_unit!r}", 'write "deg"')
        return LiveSource.open(with_absolute_paths(self, folder), folder, target)

    async def ask(self) -> tuple[Finding, ...]:
        """What the server says of the robot; whether its axes can be bound."""
        return await self.inquire(Path(), None)

    async def inquire(self, folder: Path, target: Target | None) -> tuple[Finding, ...]:
        """What the server says of the robot, and whether its axes fit the robot that it drives."""
        async with connect(self.way(), Path()) as client:
            found = self._chosen(await robots(client))
            self._factors(found, target)
            text = ", ".join(v for v in found.about.values() if v) or "nothing of its maker"
            said = [
                f"OPC 40010 at {self.url}: {found.name}, {text}; axes {', '.join(a.name for a in found.axes)}"
            ]
            if found.load:
                said.append(
                    "load at the flange as the controller has it: "
                    + ", ".join(f"{k} {v:g} {'kg' if k == 'mass' else 'm'}" for k, v in found.load.items())
                )
            if other := another_robot(found, target):
                said.append(other)
            if any(axis.speed is None for axis in found.axes):
                said.append("no measured joint speeds: derived from the positions")
            said.append("OPC 40010 has no joint torques")
            heard = f"opcua_robot {self.url}"
            origin = (
                Finding(level="note", subject=self.robot, text=f"motion heard from the controller ({heard})")
                if self.origin is MotionOrigin.CONTROLLER
                else origin_finding(self.origin, self.robot, heard)
            )
            notes = (Finding(level="note", subject=self.robot, text=t) for t in said)
            return (origin, *notes, *not_pinned(self.way(), client, self.robot))

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Joint samples whenever an axis changes or the server shows that none has, and signals."""
        async with connect(self.way(), Path("" if target is None else target.folder)) as client:
            found = self._chosen(await robots(client))
            positions, speeds = self._factors(found, target)
            nodes = {f"q{k}": axis.position for k, axis in enumerate(found.axes)}
            if speeds is not None:
                nodes |= {f"v{k}": axis.speed for k, axis in enumerate(found.axes) if axis.speed is not None}
            nodes |= found.safety
            if found.mass is not None:
                nodes[LOAD] = found.mass[0]
            reason = another_robot(found, target)
            changes = Changes()
            if refused := await changes.watch(client, nodes, self.interval):
                raise ProtocolError(f"the server refuses to watch {', '.join(refused)}")
            newest: dict[str, NodeValue] = {}
            signals: dict[str, float | bool | str] = {}
            due = 0.0
            within, last = min(self.timeout / PULSES, SIGNAL_PERIOD), -math.inf
            async for changed, shown in changes.heard(client, within):
                newest |= changed
                now = time.monotonic()
                states = _states(newest)
                if states and (states != signals or now >= due):
                    signals, due = states, now + SIGNAL_PERIOD
                    yield SignalSample(source="", seq=0, t=now, values=states | _load(found, newest))
                moved = any(name[0] in "qv" and name[1:].isdecimal() for name in changed)
                last = now if moved else last
                if moved or (not changed and shown >= last + within):
                    sample = joint_sample(newest, positions, speeds, target=self.robot, arrived=now)
                    if sample is not None:
                        hangs = _mass(found, newest)
                        sample = msgspec.structs.replace(sample, payload=hangs, reason=reason)
                        # Of a robot that stands still a server says nothing but that it is there.
                        # It stood when it was asked.
                        yield sample if moved else msgspec.structs.replace(sample, t=shown, t_device=None)

    def _chosen(self, found: tuple[Robot, ...]) -> Robot:
        where = f"opcua_robot {self.url}"
        named = [r for r in found if self.device in (None, r.name, f"{r.system}/{r.name}")]
        if len(named) != 1:
            there = ", ".join(f"{r.system}/{r.name}" for r in found) or "none"
            what = "several robots" if named else f"no robot {self.device or ''}".strip()
            raise InputError.at(where, "device", f"{what}; the server has: {there}", "name one of them")
        (robot,) = named
        if self.axes:
            by_name = {axis.name: axis for axis in robot.axes}
            if lost := [name for name in self.axes if name not in by_name]:
                known = ", ".join(by_name)
                raise InputError.at(where, "axes", f"no axis {', '.join(lost)}", f"the server has: {known}")
            return dataclasses.replace(robot, axes=tuple(by_name[name] for name in self.axes))
        return robot

    def _factors(
        self, robot: Robot, target: Target | None
    ) -> tuple[tuple[float, ...], tuple[float, ...] | None]:
        """From the server's positions and speeds to SI; None when not every axis has a speed with a unit."""
        if target is not None and len(robot.axes) != len(target.joints):
            there = ", ".join(axis.name for axis in robot.axes) or "none"
            what = f"{robot.name} has the axes {there}, {target.name} has {len(target.joints)} joints"
            raise InputError.at(f"opcua_robot {self.url}", "axes", what, "name one per joint")
        joints = [None] * len(robot.axes) if target is None else target.units
        positions, problems = [], []
        for axis, joint in zip(robot.axes, joints, strict=True):
            known = unit(axis.unit or self.position_unit or "?")
            if axis.unit and self.position_unit is not None and known != unit(self.position_unit):
                what = f"{axis.name} states {axis.unit}, and position_unit is {self.position_unit!r}"
                problems.append(
                    Problem(
                        f"opcua_robot {self.url}", "position_unit", what, "leave it out: the server says it"
                    )
                )
                continue
            if known is None or known.si not in ("rad", "m"):
                what = f"{axis.name} states no unit of length or angle"
                problems.append(
                    Problem(f"opcua_robot {self.url}", "position_unit", what, 'write it: "deg", "mm"')
                )
                continue
            if joint not in (None, known.si):
                what = f"{axis.name} is in {known.si}, its joint in {joint}"
                remedy = "name the axes in the order of the robot's joints, or another robot"
                problems.append(Problem(f"opcua_robot {self.url}", "axes", what, remedy))
                continue
            positions.append(known.factor)
        if problems:
            raise InputError(problems)
        speeds = [
            unit(axis.speed_unit) if axis.speed is not None and axis.speed_unit else None
            for axis in robot.axes
        ]
        known_speeds = [s.factor for s in speeds if s is not None and s.si in ("rad/s", "m/s")]
        return tuple(positions), tuple(known_speeds) if len(known_speeds) == len(positions) else None


def joint_sample(
    newest: dict[str, NodeValue],
    positions: tuple[float, ...],
    speeds: tuple[float, ...] | None,
    *,
    target: str,
    arrived: float,
) -> JointSample | None:
    """The robot as its axes were last heard; None until every axis was.

    Args:
        newest: By ``q0`` …, ``v0`` ….
        positions: Factors to [rad or m].
        speeds: Factors to [rad/s or m/s]; None when there are no speeds.
        target: Robot it drives.
        arrived: Host's monotonic time [s].
    """
    n = len(positions)
    said = [newest.get(f"q{k}") for k in range(n)]
    heard = [s for s in said if s is not None and isinstance(s.value, int | float)]
    if len(heard) < n:
        return None
    moving = [newest.get(f"v{k}") for k in range(n)] if speeds is not None else []
    numbers = [float(s.value) for s in moving if s is not None and isinstance(s.value, int | float)]
    doubtful = any(s.invalid_reason for s in heard)
    stamps = [s.stamp for s in heard if s.stamp is not None]
    qd = None
    if speeds is not None and len(numbers) == n:
        qd = tuple(f * v for f, v in zip(speeds, numbers, strict=True))
    return JointSample(
        source="",
        seq=0,
        t=arrived,
        t_device=max(stamps) if len(stamps) == n else None,
        target=target,
        q=tuple(f * float(s.value) for f, s in zip(positions, heard, strict=True)),
        qd=qd,
        quality=Quality.INVALID if doubtful else Quality.GOOD,
    )


def _states(newest: dict[str, NodeValue]) -> dict[str, float | bool | str]:
    found: dict[str, float | bool | str] = {}
    for key in ("emergency_stop", "protective_stop"):
        if key in newest and isinstance(newest[key].value, bool):
            found[key] = newest[key].value
    mode = newest.get("operational_mode")
    if mode is not None and isinstance(mode.value, int):
        found["operational_mode"] = (
            MODES[mode.value] if 0 <= mode.value < len(MODES) else str(int(mode.value))
        )
    return found


def _mass(robot: Robot, newest: dict[str, NodeValue]) -> float | None:
    """What the controller has at the flange [kg]; None where it does not say, or doubts it."""
    said = newest.get(LOAD)
    if robot.mass is None or said is None or said.invalid_reason or not isinstance(said.value, int | float):
        return None
    return robot.mass[1] * float(said.value)


def _load(robot: Robot, newest: dict[str, NodeValue]) -> dict[str, float | bool | str]:
    mass = _mass(robot, newest)
    load = {key: value for key, value in robot.load.items() if key != "mass"}
    return {
        f"flange_load.{key}": value
        for key, value in (load | ({} if mass is None else {"mass": mass})).items()
    }


def another_robot(robot: Robot, target: Target | None) -> str:
    """Why a server speaks of another robot of the library than the twin; empty where it may be that one."""
    prefix, _, own = ("" if target is None else target.model).partition(":")
    said = robot.about.get("Model", "")
    names = {_spelt(name): name for name in library_names.names() if _spelt(name) in _spelt(said)}
    if prefix != "library" or not names or names[max(names, key=len)] == own:
        return ""
    return f"the server says that its robot is {said}, and the twin is library:{own}"


def _spelt(name: str) -> str:
    """Letters and digits alone, without the maker (``doosan_m1013``), whom a server names apart."""
    last = name.rpartition("_")[2]
    return "".join(c for c in (last if any(map(str.isdigit, last)) else name).casefold() if c.isalnum())
