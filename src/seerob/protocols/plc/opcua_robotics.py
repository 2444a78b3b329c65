"""OPC 40010 (OPC UA for Robotics): where a server keeps the axes, safety states and loads of its robots.

Found by the types of the nodes, not by their names, which every maker chooses. ``ParameterSet`` is in the
namespace of Devices (DI), what it contains in that of Robotics.
"""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from seerob.protocols import ProtocolError
from seerob.protocols.plc import opcua_client
from seerob.protocols.plc.opcua_client import stated_unit
from seerob.workstation.variables import unit

if TYPE_CHECKING:
    from asyncua.client.client import Client
    from asyncua.common.node import Node

ROBOTICS = "http://opcfoundation.org/UA/Robotics/"
DEVICES = "http://opcfoundation.org/UA/DI/"
SYSTEM, DEVICE, AXIS, SAFETY = 1002, 1004, 16601, 1013
"""Types: MotionDeviceSystemType, MotionDeviceType, AxisType, SafetyStateType."""
MOST = 200
"""Nodes below one folder."""
HAS_SUBTYPE = 45
DEEPEST = 8
"""Types that are derived from one another."""
MODES = ("OTHER", "MANUAL_REDUCED_SPEED", "MANUAL_HIGH_SPEED", "AUTOMATIC", "AUTOMATIC_EXTERNAL")


@dataclass(frozen=True)
class Axis:
    """One axis."""

    name: str
    position: Node
    unit: str
    """That the server states; empty when it does not."""
    speed: Node | None
    speed_unit: str


@dataclass(frozen=True)
class Robot:
    """One motion device."""

    name: str
    system: str
    axes: tuple[Axis, ...]
    """In natural order of their names."""
    about: dict[str, str] = field(default_factory=dict)
    """Manufacturer, model, serial number, as the server says."""
    load: dict[str, float] = field(default_factory=dict)
    """``mass`` [kg] and ``x``, ``y``, ``z`` of its centre [m] at the flange, where the server says so."""
    mass: tuple[Node, float] | None = None
    """Where it says that mass, and what its unit is in kg; None where it has none, or no unit of mass."""
    safety: dict[str, Node] = field(default_factory=dict)
    """``emergency_stop``, ``protective_stop``, ``operational_mode``."""


async def robots(client: Client) -> tuple[Robot, ...]:
    """Every robot of a server.

    Raises:
        ProtocolError: The server does not know OPC 40010.
    """
    try:
        own = int(await client.get_namespace_index(ROBOTICS))
        di = int(await client.get_namespace_index(DEVICES))
    except ValueError:
        raise ProtocolError("the server has no OPC 40010: read its variables through a dictionary") from None
    found: list[Robot] = []
    device_set = await _child(client.nodes.objects, di, "DeviceSet")
    if device_set is None:
        raise ProtocolError("the server has no DeviceSet")
    async for system in _of_type(device_set, own, SYSTEM):
        safety = await _safety(system, own, di)
        devices = await _child(system, own, "MotionDevices")
        if devices is None:
            continue
        name = (await system.read_browse_name()).Name
        async for device in _of_type(devices, own, DEVICE):
            found.append(await _robot(device, name, own, di, safety))
    return tuple(found)


async def _robot(device: Node, system: str, own: int, di: int, safety: dict[str, Node]) -> Robot:
    folder = await _child(device, own, "Axes")
    axes = []
    if folder is not None:
        async for node in _of_type(folder, own, AXIS):
            if (axis := await _axis(node, own, di)) is not None:
                axes.append(axis)
    about = {}
    for key in ("Manufacturer", "Model", "SerialNumber"):
        if (said := await _child(device, di, key)) is not None:
            value = await _value(said)
            about[key] = str(getattr(value, "Text", value) or "")[:80]
    load, mass = await _load(await _child(device, own, "FlangeLoad"), own)
    name = (await device.read_browse_name()).Name
    ordered = tuple(sorted(axes, key=lambda a: natural(a.name)))
    return Robot(name, system, ordered, about, load, mass, safety)


async def _axis(node: Node, own: int, di: int) -> Axis | None:
    parameters = await _child(node, di, "ParameterSet")
    position = None if parameters is None else await _child(parameters, own, "ActualPosition")
    if parameters is None or position is None:
        return None
    speed = await _child(parameters, own, "ActualSpeed")
    name = (await node.read_browse_name()).Name
    speed_unit = "" if speed is None else await stated_unit(speed)
    return Axis(name, position, await stated_unit(position), speed, speed_unit)


async def _load(node: Node | None, own: int) -> tuple[dict[str, float], tuple[Node, float] | None]:
    """What hangs at the flange now, and where its mass is said."""
    if node is None:
        return {}, None
    found: dict[str, float] = {}
    said = await _child(node, own, "Mass")
    stated = None if said is None else unit(await stated_unit(said))
    mass = None if said is None or stated is None or stated.si != "kg" else (said, stated.factor)
    if mass is not None and isinstance(value := await _value(mass[0]), int | float):
        found["mass"] = mass[1] * value
    center = await _child(node, own, "CenterOfMass")
    point = getattr(None if center is None else await _value(center), "CartesianCoordinates", None)
    known = None if point is None or center is None else await _length_unit(center)
    if known is not None:
        found |= {axis: known * float(getattr(point, axis.upper())) for axis in ("x", "y", "z")}
    return found, mass


async def _length_unit(frame: Node) -> float | None:
    """What a length of a frame is in metres; None where the server does not say it: it is never guessed."""
    for owner in (await _child(frame, 0, "CartesianCoordinates"), frame):
        said = None if owner is None else await _child(owner, 0, "LengthUnit")
        stated = (
            None if said is None else unit(opcua_client.unit(getattr(await _value(said), "UnitId", 0) or 0))
        )
        if stated is not None and stated.si == "m":
            return stated.factor
    return None


async def _safety(system: Node, own: int, di: int) -> dict[str, Node]:
    folder = await _child(system, own, "SafetyStates")
    found: dict[str, Node] = {}
    if folder is None:
        return found
    async for state in _of_type(folder, own, SAFETY):
        parameters = await _child(state, di, "ParameterSet")
        if parameters is None:
            continue
        for key, name in (
            ("emergency_stop", "EmergencyStop"),
            ("protective_stop", "ProtectiveStop"),
            ("operational_mode", "OperationalMode"),
        ):
            if (node := await _child(parameters, own, name)) is not None:
                found.setdefault(key, node)
    return found


async def _of_type(folder: Node, namespace: int, number: int) -> AsyncIterator[Node]:
    """Children of a type, or of one that a maker has derived from it."""
    for child in (await folder.get_children())[:MOST]:
        kind = await child.read_type_definition()
        for _ in range(DEEPEST):
            if kind is None or (kind.NamespaceIndex == namespace and kind.Identifier == number):
                break
            kind = await _derived_from(child, kind)
        else:
            kind = None
        if kind is not None and not _is_template((await child.read_browse_name()).Name):
            yield child


def _is_template(name: str) -> bool:
    """Whether a node stands for those that there may be: some servers keep ``<AxisIdentifier>`` too."""
    return name.startswith("<") and name.endswith(">")


async def _derived_from(node: Node, kind: Any) -> Any:
    """The type that a type is derived from; None where the server does not say."""
    from asyncua import ua
    from asyncua.ua.uaerrors import UaError

    try:
        parents = await type(node)(node.session, kind).get_references(
            refs=HAS_SUBTYPE, direction=ua.BrowseDirection.Inverse
        )
    except UaError:
        return None
    return parents[0].NodeId if parents else None


async def _child(node: Node, namespace: int, name: str) -> Node | None:
    from asyncua.ua.uaerrors import UaError

    try:
        return await node.get_child(f"{namespace}:{name}")
    except UaError:
        return None


async def _value(node: Node) -> object:
    from asyncua.ua.uaerrors import UaError

    try:
        return await node.read_value()
    except UaError:
        return None


def natural(name: str) -> list[tuple[int, str]]:
    """A key that puts ``Axis_10`` after ``Axis_9``."""
    return [(int(part) if part.isdecimal() else -1, part) for part in re.split(r"(\d+)", name)]
