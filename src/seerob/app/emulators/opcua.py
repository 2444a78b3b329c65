"""An OPC UA server that plays a cell: variables of a PLC, and robots as OPC 40010 has them; real sockets.

The address space is built by hand: the companion specification's own node set is not needed for a client
that goes by types and names.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Self

from seerob.app.emulation import motions
from seerob.app.emulation.background import LoopEmulator
from seerob.app.emulation.motions import Motion, swing
from seerob.app.emulation.options import EmulatorOptions, Ready, option, port
from seerob.core.extras import need
from seerob.protocols.plc.opcua_client import CODES, NAMESPACE, SILENT, content, number
from seerob.protocols.plc.opcua_robotics import AXIS, DEVICE, DEVICES, ROBOTICS, SAFETY, SYSTEM

if TYPE_CHECKING:
    from asyncua.common.node import Node
    from asyncua.server.server import Server
    from cryptography import x509

URI = "urn:seerob:emulator"


class Emulated(NamedTuple):
    """A variable of the PLC."""

    value: Callable[[float], object]
    """At a time since the start [s]."""
    unit: str = ""
    """That the server states; nothing for none."""


class OpcuaServer(LoopEmulator):
    """A server in a thread of its own.

    Args:
        variables: Of the PLC, by path: ``Belt/speed``.
        robots: Motions of robots, by name; their axes turn, in degrees.
        host: Address to listen on.
        port: 0 is any free one.
        period: Between updates [s].
        axis_unit: Unit of the axes that is stated; nothing is, where it is empty.
        certificate: Own certificate and key; then only protected sessions are taken.
        trusted: Certificates of clients that may come in; all may when empty.
        outputs: Paths of bools that may be written; `written` keeps what was.
    """

    def __init__(
        self,
        variables: Mapping[str, Emulated] | None = None,
        robots: Mapping[str, Motion] | None = None,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        period: float = 0.02,
        axis_unit: str = "deg",
        certificate: tuple[Path, Path] | None = None,
        trusted: tuple[Path, ...] = (),
        outputs: tuple[str, ...] = (),
    ) -> None:
        super().__init__()
        self.host, self.port, self.period, self.axis_unit = host, port, period, axis_unit
        self._variables, self._robots = dict(variables or {}), dict(robots or {})
        self._certificate, self._trusted = certificate, trusted
        self.safety = {"EmergencyStop": False, "ProtectiveStop": False, "OperationalMode": 3}
        """May be changed while it runs."""
        self.written: dict[str, list[bool]] = {path: [] for path in outputs}
        self.model = "emulated"
        """What its robots are, as it says; may be changed before it starts."""
        self.load: float | None = None
        """What it has at their flanges [kg], not said when None at start; may be changed while it
        runs."""
        self.bad: set[str] = set()
        """Paths of variables that are called bad; may be changed while it runs."""
        self.clock: Callable[[], float] = time.time
        """What its variables are stamped with [s since 1970]; may be changed while it runs."""
        self._made = time.monotonic()
        self._built: tuple[Server, _Cell] | None = None

    @property
    def url(self) -> str:
        """Where it is."""
        return f"opc.tcp://{self.host}:{self.port}"

    def begin(self) -> Callable[[], object]:
        """The loop, at a port that is free: to build what it shows for one that is not takes long.

        Raises:
            OSError: It is taken.
        """
        self.port = _free(self.host, self.port)
        return super().begin()

    def now(self) -> float:
        """Time since it was made [s]."""
        return time.monotonic() - self._made

    def prepare(self) -> Self:
        """Build now what it shows, which takes a second: the next start, or one in each fork, saves it."""
        self._built = asyncio.run(self._build())
        return self

    async def _build(self) -> tuple[Server, _Cell]:
        from asyncua.server.server import Server

        for name in (*SILENT, "asyncua.server"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        server = Server()
        await server.init()
        await self._protect(server)
        cell = _Cell(server, self)
        await cell.build()
        return server, cell

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Listen, and play."""
        server, cell = self._built or await self._build()
        self._built = None
        server.set_endpoint(self.url)
        async with server:
            ready()
            while not over.is_set():
                await cell.update(self.now())
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(over.wait(), self.period)

    async def _protect(self, server: Server) -> None:
        from asyncua import ua

        if self._certificate is None:
            server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
            return
        certificate, key = (content(path) for path in self._certificate)
        await server.load_certificate(certificate.path_or_content, certificate.extension)
        await server.load_private_key(key.path_or_content, format=key.extension)
        policy = [
            ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
            ua.SecurityPolicyType.Basic256Sha256_Sign,
        ]
        if self._trusted:
            from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions

            known = [path.read_bytes() for path in self._trusted]
            server.set_certificate_validator(
                _Known(known, CertificateValidator, CertificateValidatorOptions.BASIC_VALIDATION)
            )
        server.set_security_policy(policy)

    def motion(self, name: str) -> Motion:
        """Of a robot."""
        return self._robots[name]

    @property
    def paths(self) -> dict[str, Emulated]:
        """The PLC's variables."""
        return self._variables

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots."""
        return tuple(self._robots)


class _Known:
    """Lets in whoever shows one of the certificates that were given."""

    def __init__(self, known: list[bytes], *_: object) -> None:
        from cryptography import x509
        from cryptography.hazmat.primitives.serialization import Encoding

        self._known = {x509.load_pem_x509_certificate(k).public_bytes(Encoding.DER) for k in known}

    async def __call__(self, certificate: x509.Certificate, _: object) -> None:
        from asyncua.ua.uaerrors import BadCertificateUntrusted
        from cryptography.hazmat.primitives.serialization import Encoding

        if certificate.public_bytes(Encoding.DER) not in self._known:
            raise BadCertificateUntrusted


class _Cell:
    def __init__(self, server: Server, emulator: OpcuaServer) -> None:
        self._server, self._emulator = server, emulator
        self._variables: dict[str, Node] = {}
        self._outputs: dict[str, Node] = {}
        self._axes: dict[str, list[tuple[Node, Node]]] = {}
        self._safety: dict[str, Node] = {}
        self._loads: list[Node] = []

    async def build(self) -> None:
        """Make the address space."""
        own = await self._server.register_namespace(URI)
        for path, variable in self._emulator.paths.items():
            self._variables[path] = await self._add(own, path, variable.value(0.0))
            await self._state_unit(self._variables[path], variable.unit)
        for path in self._emulator.written:
            self._outputs[path] = await self._add(own, path, False)
            await self._outputs[path].set_writable()
        if self._emulator.robots:
            await self._build_robots(own)

    async def _add(self, own: int, path: str, value: object) -> Node:
        *folders, name = path.split("/")
        node = self._server.nodes.objects
        for folder in folders:
            node = await self._below(node, own, folder)
        made: Node = await node.add_variable(f"ns={own};s={path}", f"{own}:{name}", value)
        return made

    async def _below(self, node: Node, own: int, name: str) -> Node:
        from asyncua.ua.uaerrors import UaError

        try:
            return await node.get_child(f"{own}:{name}")
        except UaError:
            return await node.add_object(own, name)

    async def _build_robots(self, own: int) -> None:
        from asyncua import ua

        robotics = await self._server.register_namespace(ROBOTICS)
        di = await self._server.register_namespace(DEVICES)

        async def typed(number: int, name: str) -> ua.NodeId:
            kind = ua.NodeId(ua.Int32(number), ua.Int16(robotics))
            await self._server.nodes.base_object_type.add_object_type(kind, ua.QualifiedName(name, robotics))
            return kind

        system_type = await typed(SYSTEM, "MotionDeviceSystemType")
        device_type = await typed(DEVICE, "MotionDeviceType")
        axis_type = await typed(AXIS, "AxisType")
        safety_type = await typed(SAFETY, "SafetyStateType")
        device_set = await self._server.nodes.objects.add_object(di, "DeviceSet")
        system = await device_set.add_object(own, "Cell", objecttype=system_type)
        devices = await system.add_object(robotics, "MotionDevices")
        for name in self._emulator.robots:
            device = await devices.add_object(own, name, objecttype=device_type)
            await device.add_property(di, "Manufacturer", ua.LocalizedText("seerob"))
            await device.add_property(di, "Model", ua.LocalizedText(self._emulator.model))
            if self._emulator.load is not None:
                load = await device.add_object(robotics, "FlangeLoad")
                self._loads.append(await load.add_variable(robotics, "Mass", self._emulator.load))
                await self._state_unit(self._loads[-1], "kg")
            axes = await device.add_object(robotics, "Axes")
            q, _ = self._emulator.motion(name)(0.0)
            made = []
            for k in range(len(q)):
                axis = await axes.add_object(own, f"Axis_{k + 1}", objecttype=axis_type)
                parameters = await axis.add_object(di, "ParameterSet")
                position = await parameters.add_variable(robotics, "ActualPosition", 0.0)
                speed = await parameters.add_variable(robotics, "ActualSpeed", 0.0)
                if self._emulator.axis_unit:
                    await self._state_unit(position, self._emulator.axis_unit)
                    await self._state_unit(speed, f"{self._emulator.axis_unit}/s")
                made.append((position, speed))
            self._axes[name] = made
        states = await system.add_object(robotics, "SafetyStates")
        state = await states.add_object(own, "SafetyState", objecttype=safety_type)
        parameters = await state.add_object(di, "ParameterSet")
        for key, value in self._emulator.safety.items():
            self._safety[key] = await parameters.add_variable(robotics, key, value)

    async def _state_unit(self, node: Node, unit: str) -> None:
        from asyncua import ua

        if not unit:
            return
        code = next(code for code, spelling in CODES.items() if spelling == unit)
        stated = ua.EUInformation(NAMESPACE, number(code), ua.LocalizedText(unit), ua.LocalizedText(unit))
        await node.add_property(0, "EngineeringUnits", stated)

    async def update(self, t: float) -> None:
        """What everything is at a time since the start [s]."""
        from asyncua import ua
        from asyncua.ua.status_codes import StatusCodes

        stamp: Any = datetime.fromtimestamp(self._emulator.clock(), UTC).replace(tzinfo=None)
        for path, node in self._variables.items():
            bad = path in self._emulator.bad
            code = ua.StatusCode(ua.UInt32(StatusCodes.BadSensorFailure if bad else StatusCodes.Good))
            said = ua.Variant(self._emulator.paths[path].value(t))
            value = ua.DataValue(said, code, SourceTimestamp=stamp)
            await self._server.write_attribute_value(node.nodeid, value)
        for path, node in self._outputs.items():
            written, now = self._emulator.written[path], bool(await node.read_value())
            if now != (written[-1] if written else False):
                written.append(now)
        degrees = 180 / math.pi if self._emulator.axis_unit in ("deg", "") else 1.0
        for name, nodes in self._axes.items():
            for (position, speed), q, qd in zip(nodes, *self._emulator.motion(name)(t), strict=True):
                await self._write(position, degrees * q)
                await self._write(speed, degrees * qd)
        for node in self._loads:
            await self._write(node, self._emulator.load)
        for key, node in self._safety.items():
            await self._write(node, self._emulator.safety[key])

    async def _write(self, node: Node, value: object) -> None:
        from asyncua import ua

        now: Any = datetime.now(UTC).replace(tzinfo=None)
        stamped = ua.DataValue(ua.Variant(value), SourceTimestamp=now)
        await self._server.write_attribute_value(node.nodeid, stamped)


def _free(host: str, port: int) -> int:
    import socket

    with socket.create_server((host, port)) as probe:
        return int(probe.getsockname()[1])


# -- options ------------------------------------------------------------------------------------

HOME = (0.0, -1.2, 1.4, -1.5, -1.5, 0.0)
"""What the robot swings about [rad]."""
OUTPUT = "Twin/warning"
"""A bool that a trigger may write."""


VALUES = "table of values to play round and round (.csv): t [s],Belt/speed [mm/s],Gripper/open [bool]"


class Opcua(EmulatorOptions, frozen=True, kw_only=True):
    """An OPC UA server: a PLC with a belt, a light curtain and a door, and a robot by OPC 40010."""

    port: Annotated[int, port()] = 4840
    values: Annotated[str, option(VALUES)] | None = None
    in_step: Annotated[bool, option("rounds of values begin at whole multiples by this machine's clock")] = (
        False
    )

    def ready(self) -> Ready:
        """The server."""
        need("asyncua")
        if self.values is not None:
            return self._playing(Path(self.values))
        variables = {
            "Belt/running": Emulated(motions.running),
            "Belt/speed": Emulated(motions.speed, "mm/s"),
            "Belt/position": Emulated(motions.position, "mm"),
            "Curtain/clear": Emulated(motions.clear),
            "Door/open": Emulated(motions.door_open),
        }
        server = OpcuaServer(
            variables, {"Robot": swing(HOME)}, host=self.host, port=self.port, outputs=(OUTPUT,)
        )
        what = f"variables {', '.join(variables)}; one robot; {OUTPUT} may be written"
        hear = ("seerob probe opcua_robot opc.tcp://{at}", "seerob probe opcua opc.tcp://{at}")
        return Ready(server, what, f"{self.host}:{self.port}", hear)

    def _playing(self, path: Path) -> Ready:
        table = motions.values(path)
        ahead = time.time() if self.in_step else 0.0

        def at(name: str) -> Callable[[float], object]:
            return lambda t: table.value(name, t + ahead)

        variables = {
            name: Emulated(at(name), "" if unit == "bool" else unit)
            for name, (unit, _) in table.columns.items()
        }
        server = OpcuaServer(variables, host=self.host, port=self.port, outputs=(OUTPUT,))
        what = f"variables {', '.join(variables)} of {path}; {OUTPUT} may be written"
        return Ready(server, what, f"{self.host}:{self.port}", ("seerob probe opcua opc.tcp://{at}",))
