"""Robots whose controllers have their joints in Modbus registers, live, by a register map.

A controller renews these registers ten times a second and rounds them, to a tenth of a degree for one:
enough for distances and speeds with a tolerance, too coarse for what grows with the square of a speed.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator, Mapping
from math import degrees
from pathlib import Path
from typing import Annotated, ClassVar

from msgspec import Meta
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.core.motion_origin import MotionOrigin, origin_finding
from seerob.core.quantities import Seconds
from seerob.core.samples import JointSample, Quality, Sample, SignalSample
from seerob.core.snapshot import Finding
from seerob.devices.live.listening import LiveSource
from seerob.protocols import ProtocolError
from seerob.protocols.plc import modbus
from seerob.protocols.plc.modbus import (
    SUFFIX,
    Block,
    Device,
    Joints,
    Place,
    Refused,
    RegisterMap,
    blocks,
    connect,
    load,
    take,
)
from seerob.workstation.source import Opened, Target
from seerob.workstation.variables import BadValue

Values = Mapping[str, int | float | bool]
COARSE = "its registers are too coarse for energies, impact and measured torques"


class ModbusRobot(LiveSource, frozen=True, kw_only=True):
    """A robot whose controller has its joints in Modbus registers."""

    links: ClassVar[bool] = False
    loads: ClassVar[tuple[str, ...]] = ("pymodbus.client",)
    asked: ClassVar[bool] = True

    robot: str
    """The robot it drives."""
    host: str
    """Name or address of the controller."""
    map: str = "doosan"
    """Register map: one that ships, or a file (``.toml``) beside the workstation."""
    port: Annotated[int, Meta(ge=1, le=65535)] = modbus.PORT
    """TCP port of the controller."""
    device: Annotated[int, Meta(ge=0, le=255)] = 1
    """Number of the device behind that address (unit identifier); often 1 or 255."""
    every: Seconds = 0.1
    """Interval between questions [s]; asking more often than the controller renews its values says
    nothing new."""
    timeout: Seconds = 0.5
    """Age at which what it said no longer counts [s]."""
    origin: MotionOrigin = MotionOrigin.CONTROLLER
    """``vendor_emulator`` when it is the maker's emulator."""

    def target(self) -> str:
        """The robot."""
        return self.robot

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return self.every

    def coarse(self, folder: Path) -> str:
        """Energies and forces are undecided with what it says."""
        return COARSE

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the map, and ask the controller for its registers, if it can be reached.

        Raises:
            InputError: No such map, a mistake in it, or another number of joints than the robot's.
        """
        if target is None:
            raise InputError.at("sources", "robot", f"no robot {self.robot!r}", "name a robot")
        found = load(self.map, folder)
        if len(target.joints) != found.joints:
            what = f"{target.name} has {len(target.joints)} joints, the map {self.map} has {found.joints}"
            raise InputError.at(f"modbus_robot {self.host}", "robot", what, "name another robot or map")
        with_absolute_paths = (
            self if not self.map.endswith(SUFFIX) else replace(self, map=str(folder / self.map))
        )
        opened = LiveSource.open(with_absolute_paths, folder, target)
        about = (Finding(level=level, subject=self.robot, text=text) for level, text in remarks(found))
        return replace(opened, findings=(*opened.findings, *about))

    async def ask(self) -> tuple[Finding, ...]:
        """Read everything once: what the controller has not is said."""
        found = load(self.map, Path())
        async with connect(self.host, self.port, self.device) as device:
            answers = await _understood(device, found)
        values = {
            name: value
            for _, said in answers
            if not isinstance(said, Refused)
            for name, value in said.items()
        }
        refused = [(str(said), block) for block, said in answers if isinstance(said, Refused)]
        if "q0" not in values:
            what = f"has no joint positions in {found.position.table} registers from {found.position.at} on"
            raise InputError.at(f"modbus_robot {self.host}", "map", what, "is it this maker's controller?")
        where = f"modbus_robot {self.host}:{self.port}"
        if self.origin is MotionOrigin.CONTROLLER:
            text = f"motion heard from the controller ({where}, {found.title})"
            said = [Finding(level="note", subject=self.robot, text=text)]
        else:
            said = [origin_finding(self.origin, self.robot, where)]
        for why, block in refused:
            text = f"{why}: {block.table} {block.first} to {block.first + block.count - 1} are left out"
            said.append(Finding(level="warning", subject=self.robot, text=text))
        return tuple(said)

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """A joint sample and the signals, at every question."""
        found = load(self.map, Path("" if target is None else target.folder))
        clock = asyncio.get_running_loop()
        async with connect(self.host, self.port, self.device) as device:
            answers = await _understood(device, found)
            questions = [(b, _wanted(found, b)) for b, said in answers if not isinstance(said, Refused)]
            due, before = clock.time(), None
            while True:
                asked = time.monotonic()
                values: dict[str, int | float | bool] = {}
                for block, wanted in questions:
                    values |= take(block, await device.patient_block(block), wanted)
                states, doubts = signals(found, values)
                # As old as the question: when in between it was so, nobody says.
                sample = joint_sample(found, values, states, target=self.robot, arrived=asked)
                before, sample = sample, standing(before, sample)
                yield SignalSample(source="", seq=0, t=asked, values=states, doubts=doubts)
                yield sample
                # What was asked late is not made up for.
                due = max(due + self.every, clock.time())
                await asyncio.sleep(due - clock.time())


async def _understood(
    device: Device, found: RegisterMap
) -> list[tuple[Block, dict[str, int | float | bool] | Refused]]:
    """Every question once, with what it says, or why the controller refuses it.

    Of a question with registers between the values that this controller may not have, only the values are
    asked for.
    """
    waiting = list(found.questions())
    answers: list[tuple[Block, dict[str, int | float | bool] | Refused]] = []
    while waiting:
        block = waiting.pop(0)
        try:
            said = take(block, await device.patient_block(block), _wanted(found, block))
            answers.append((block, said))
        except Refused as error:
            alone = blocks(_wanted(found, block).values())
            if alone == (block,):
                answers.append((block, error))
            waiting[:0] = () if alone == (block,) else alone
    return answers


def _wanted(found: RegisterMap, block: Block) -> dict[str, Place]:
    """What lies in one block, by name."""
    return {name: place for name, place in found.places().items() if block.covers(place)}


def standing(before: JointSample | None, sample: JointSample) -> JointSample:
    """The sample, with where it has its tool only while it stands.

    Joints and tool are asked for one after the other, and renewed in between: in motion they are of two
    instants.
    """
    stands = before is not None and (before.q, before.tcp) == (sample.q, sample.tcp)
    return sample if stands and not any(sample.qd or ()) else replace(sample, tcp=None)


def joint_sample(
    found: RegisterMap,
    values: Values,
    states: Mapping[str, float | bool | str],
    *,
    target: str,
    arrived: float,
) -> JointSample:
    """What the registers say of the joints.

    Args:
        found: Their map.
        values: Raw, by name in the map.
        states: The signals.
        target: Robot it drives.
        arrived: Host's monotonic time [s].

    Raises:
        ProtocolError: No positions.
    """
    q = _joints(found, "q", found.position, values)
    if q is None:
        raise ProtocolError("the controller has no joint positions")
    tool = _numbers(values, "tcp", 3)
    tcp = None
    if tool is not None and found.tool is not None:
        tcp = tool[0] * found.tool.factor, tool[1] * found.tool.factor, tool[2] * found.tool.factor
    quality = Quality.GOOD
    if found.state is not None:
        state = states.get(found.state.signal)
        if state is None or state in found.state.unsure:
            quality = Quality.INVALID
        elif state in found.state.doubtful:
            quality = Quality.DEGRADED
    return JointSample(
        source="",
        seq=0,
        t=arrived,
        target=target,
        q=q,
        qd=_joints(found, "qd", found.velocity, values),
        tau=_joints(found, "tau", found.torque, values),
        tcp=tcp,
        quality=quality,
    )


def _joints(found: RegisterMap, key: str, joints: Joints | None, values: Values) -> tuple[float, ...] | None:
    raw = _numbers(values, key, found.joints)
    return None if joints is None or raw is None else tuple(joints.factor * x for x in raw)


def _numbers(values: Values, key: str, count: int) -> tuple[float, ...] | None:
    """Raw numbers ``key0`` … ; None unless all are there."""
    raw = [values.get(f"{key}{k}") for k in range(count)]
    numbers = tuple(float(x) for x in raw if x is not None)
    return numbers if len(numbers) == count else None


def signals(found: RegisterMap, values: Values) -> tuple[dict[str, float | bool | str], dict[str, str]]:
    """States and figures in SI, and why some are none."""
    good: dict[str, float | bool | str] = {}
    bad: dict[str, str] = {}
    for signal in found.signals:
        raw = values.get(f"signal {signal.name}")
        if raw is None:
            continue
        try:
            good[signal.name] = signal.variable.value(raw)
        except BadValue as error:
            bad[signal.name] = str(error)
    return good, bad


def remarks(found: RegisterMap) -> tuple[tuple[str, str], ...]:
    """What a map means for results, as level and text."""
    step = found.position.factor
    said = [("note", f"register map {found.title}: {found.source}")]
    words = f"{degrees(step):.3g}°" if found.position.unit == "deg" else f"{step:.3g} rad or m"
    text = (
        f"joint positions come in steps of {words}, renewed every {1e3 * found.refresh:.0f} ms and without "
        f"a time of the controller's: distances are off by up to {0.5e3 * step:.1f} mm per joint and metre "
        f"of reach, and what is shown may be {1e3 * found.refresh:.0f} ms older than it seems; "
        "intervals of results do not contain this"
    )
    said.append(("assumed", text))
    if found.velocity is None:
        said.append(("assumed", "no joint speeds in the map: derived from the positions"))
    else:
        text = f"joint speeds come in steps of {found.velocity.factor:.2g} rad/s or m/s"
        said.append(("assumed", f"{text}; a peak between two readings is not seen"))
    said.append(("warning", f"energies, impact and measured torques are undecided: {COARSE}"))
    return tuple(said)
