"""An RTDE server that plays a motion: what a Universal Robots controller sends, over a real socket.

It speaks for a robot that is switched on and does what the motion says, and says of itself where its tool
centre point is, how fast that moves, and what hangs at its flange. Fields that would need physics (currents,
forces) it does not have, as an old controller does not. It moves nothing and takes no inputs.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections.abc import Callable, Mapping
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Annotated

import numpy as np

from seerob.app.emulation.background import LoopEmulator
from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Ready, RobotOptions, option, port
from seerob.core.errors import InputError
from seerob.core.transforms import transform, wxyz_from_rotation
from seerob.description.description import Description
from seerob.files.waypoints.arm import Arm
from seerob.protocols import ProtocolError
from seerob.protocols.links.tcp_server import tcp_server
from seerob.protocols.robots.rtde import (
    NOT_FOUND,
    Accepted,
    ControllerRequest,
    ControllerVersion,
    Data,
    InputsRequest,
    Kind,
    Level,
    OutputsReply,
    OutputsRequest,
    PauseRequest,
    Recipe,
    Reply,
    Request,
    RobotMode,
    SafetyStatus,
    Splitter,
    StartRequest,
    TextMessage,
    Value,
    VersionRequest,
    decode_request,
    encode_reply,
    pack,
)
from seerob.protocols.robots.ur_primary import Kinematics, encode_state

_log = logging.getLogger(__name__)

TYPES = {
    "timestamp": "DOUBLE",
    "target_q": "VECTOR6D",
    "target_qd": "VECTOR6D",
    "actual_q": "VECTOR6D",
    "actual_qd": "VECTOR6D",
    "robot_mode": "INT32",
    "safety_mode": "INT32",
    "safety_status": "INT32",
    "runtime_state": "UINT32",
    "speed_scaling": "DOUBLE",
    "target_speed_fraction": "DOUBLE",
    "actual_digital_input_bits": "UINT64",
    "actual_digital_output_bits": "UINT64",
    "robot_status_bits": "UINT32",
    "safety_status_bits": "UINT32",
}
CONTROLLER_STATE = {"actual_TCP_pose": "VECTOR6D", "actual_TCP_speed": "VECTOR6D", "payload": "DOUBLE"}
TURNED = np.diag([-1.0, -1.0, 1.0])
"""Half a turn about z: between the base that a controller speaks of and the ``base_link`` of descriptions."""
E_SERIES = ControllerVersion(5, 12, 4, 0)
PLAYING = 2
MAX_CLIENTS = 8
MAX_RECIPES = 16
FULL = 1 << 16
"""Bytes that wait for a client who does not read; then the connection is closed."""
PRIMARY_SENDS = 100
"""Packages of the primary interface to one client."""
LATE = 0.5
"""Time that is not made up for when this machine was too slow [s]."""


class ControllerState:
    """What a controller says of its arm, beside the joints.

    Args:
        description: The arm.
        tcp: How far its tool centre point is ahead of the flange [m].
        payload: What hangs at the flange, as somebody told the controller [kg].
    """

    def __init__(self, description: Description, *, tcp: float = 0.0, payload: float = 0.0) -> None:
        self._arm = Arm(description, link_from_tcp=transform(position=(0.0, 0.0, tcp)))
        self._payload = payload
        still = (0.0,) * self._arm.n
        self(still, still)  # the first is slow, and would be late

    def __call__(self, q: tuple[float, ...], qd: tuple[float, ...]) -> dict[str, Value]:
        """Its fields at joint positions [rad] and speeds [rad/s]; the tool in the controller's base."""
        posture = self._arm.posture(q)
        w, *axis = wxyz_from_rotation(TURNED @ posture.rotation).tolist()
        length = math.hypot(*axis)
        turn = 2 * math.atan2(length, w) / length if length > 0 else 0.0
        v, omega = (posture.jacobian() @ qd).reshape(2, 3)
        return {
            "actual_TCP_pose": (*(TURNED @ posture.position).tolist(), *(turn * x for x in axis)),
            "actual_TCP_speed": (*(TURNED @ v).tolist(), *(TURNED @ omega).tolist()),
            "payload": self._payload,
        }


class RtdeServer(LoopEmulator):
    """A controller's RTDE port, in a thread of its own.

    Args:
        motion: What the robot does; time counts from the start of the server.
        host: Address to listen on.
        port: 0 is any free one.
        controller: Version of the software that it says it has; CB3 sends at 125 Hz, later ones at 500.
        version: Highest version of the protocol.
        without: Fields that it does not have.
        values: Fields with another value than that of a robot at work.
        controller_state: What it says of its arm beside the joints; nothing when not given.
        messages: Said to every client that connects, before anything else.
        kinematics: What the primary interface says of how it was built; there is none when not given.
        primary_port: Of that interface; 0 is any free one.
    """

    def __init__(
        self,
        motion: Motion,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        controller: ControllerVersion = E_SERIES,
        version: int = 2,
        without: frozenset[str] = frozenset(),
        values: Mapping[str, Value] | None = None,
        controller_state: ControllerState | None = None,
        messages: tuple[str, ...] = (),
        kinematics: Kinematics | None = None,
        primary_port: int = 0,
    ) -> None:
        super().__init__()
        self.host, self.port = host, port
        self.motion, self.controller, self.version, self.messages = motion, controller, version, messages
        self.kinematics, self.primary_port = kinematics, primary_port
        self.controller_state = controller_state
        every = TYPES | (CONTROLLER_STATE if controller_state is not None else {})
        self.types = {name: kind for name, kind in every.items() if name not in without}
        self.values = dict(values or {})
        """May be changed while it runs."""
        self.rate = 125.0 if controller.major < 5 else 500.0
        """The most that it sends [Hz]."""
        self.connections = 0
        """Clients at present."""
        self._begun = 0.0

    def at(self, t: float) -> dict[str, Value]:
        """Every field at a time since the start [s]."""
        q, qd = self.motion(t)
        return {
            "timestamp": t,
            "target_q": q,
            "target_qd": qd,
            "actual_q": q,
            "actual_qd": qd,
            "robot_mode": int(RobotMode.RUNNING),
            "safety_mode": int(SafetyStatus.NORMAL),
            "safety_status": int(SafetyStatus.NORMAL),
            "runtime_state": PLAYING,
            "speed_scaling": 1.0,
            "target_speed_fraction": 1.0,
            "actual_digital_input_bits": 0,
            "actual_digital_output_bits": 0,
            "robot_status_bits": 0b11,
            "safety_status_bits": 0b1,
            **(self.controller_state(q, qd) if self.controller_state is not None else {}),
            **self.values,
        }

    def now(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self._begun

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Listen, and serve whoever connects."""
        async with AsyncExitStack() as both:
            server = await both.enter_async_context(tcp_server(self._welcome, self.host, self.port))
            self.port = server.sockets[0].getsockname()[1]
            self._begun = time.monotonic()
            if self.kinematics is not None:
                primary = tcp_server(self._say_kinematics, self.host, self.primary_port)
                self.primary_port = (await both.enter_async_context(primary)).sockets[0].getsockname()[1]
            ready()
            await over.wait()
        # What is left, the clients' tasks, asyncio.run cancels.

    async def _say_kinematics(self, _: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """The primary interface, as far as it goes: the same state ten times a second."""
        try:
            for _k in range(PRIMARY_SENDS):
                if self.kinematics is not None:
                    writer.write(encode_state(self.kinematics))
                await writer.drain()
                await asyncio.sleep(0.1)
        except (OSError, asyncio.CancelledError):
            pass
        finally:
            writer.transport.abort()

    async def _welcome(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.connections += 1
        try:
            if self.connections <= MAX_CLIENTS:
                await _Client(self, writer).serve(reader)
        except (OSError, ProtocolError) as error:
            _log.info("client left: %s", error)
        except asyncio.CancelledError:
            pass  # the server stops; asyncio would log what is no mistake
        finally:
            self.connections -= 1
            writer.transport.abort()


class _Client:
    def __init__(self, server: RtdeServer, writer: asyncio.StreamWriter) -> None:
        self._server, self._writer = server, writer
        self._version = 1
        self._recipes: list[tuple[Recipe, float]] = []
        self._sending: list[asyncio.Task[None]] = []

    async def serve(self, reader: asyncio.StreamReader) -> None:
        """Answer until the client leaves."""
        splitter = Splitter()
        try:
            while data := await reader.read(1 << 16):
                for package in splitter.feed(data):
                    for reply in self._answer(decode_request(package, self._version)):
                        self._say(reply)
                await self._writer.drain()
        finally:
            self._pause()

    def _say(self, reply: Reply) -> None:
        # The version that is asked for is granted in the version before it: both look the same.
        self._writer.write(encode_reply(reply, self._version))

    def _answer(self, request: Request) -> list[Reply]:
        match request:
            case VersionRequest():
                granted = 1 <= request.version <= self._server.version
                self._version = request.version if granted else self._version
                said = [TextMessage(text, "emulator", Level.WARNING) for text in self._server.messages]
                return [*said, Accepted(Kind.VERSION, granted)]
            case ControllerRequest():
                return [self._server.controller]
            case OutputsRequest():
                return [self._outputs(request)]
            case InputsRequest():
                self._writer.write(
                    pack(Kind.INPUTS, b"\0" + ",".join("IN_USE" for _ in request.fields).encode())
                )
                return []
            case StartRequest():
                self._pause()
                self._sending = [asyncio.create_task(self._send(*recipe)) for recipe in self._recipes]
                return [Accepted(Kind.START, bool(self._recipes))]
            case PauseRequest():
                self._pause()
                return [Accepted(Kind.PAUSE, accepted=True)]

    def _outputs(self, request: OutputsRequest) -> OutputsReply:
        types = tuple(self._server.types.get(name, NOT_FOUND) for name in request.fields)
        rate = self._server.rate if request.frequency is None else request.frequency
        known = NOT_FOUND not in types and len(self._recipes) < MAX_RECIPES
        if not (known and types and math.isfinite(rate) and rate > 0):
            return OutputsReply(0, types)
        number = len(self._recipes) + 1
        self._recipes.append((Recipe(request.fields, types, number), min(rate, self._server.rate)))
        return OutputsReply(number, types)

    def _pause(self) -> None:
        for task in self._sending:
            task.cancel()
        self._sending = []

    async def _send(self, recipe: Recipe, rate: float) -> None:
        """Data at a steady rate, on a grid of device time."""
        k = math.ceil(self._server.now() * rate)
        while not self._writer.transport.is_closing():
            late = self._server.now() - k / rate
            if late < 0:
                await asyncio.sleep(-late)
            elif late > LATE:
                k = math.ceil(self._server.now() * rate)
            if self._writer.transport.get_write_buffer_size() > FULL:
                _log.info("client does not read: connection closed")
                self._writer.transport.abort()
                return
            self._say(Data(recipe.number, recipe.pack(self._server.at(k / rate))))
            k += 1


# -- options ------------------------------------------------------------------------------------

HOME = (0.0, -1.2, 1.4, -1.5, -1.5, 0.0)
"""What it swings about when no motion is given [rad]: elbow up, tool down."""
JOINTS = 6


class Rtde(RobotOptions, frozen=True, kw_only=True):
    """A Universal Robots controller (RTDE)."""

    port: Annotated[int, port()] = 30004
    tcp: Annotated[
        float, option("how far its tool centre point is ahead of the flange", "m", ge=-2, le=2)
    ] = 0.0
    payload: Annotated[float, option("what it was told that hangs at its flange", "kg", ge=0, le=100)] = 0.0
    calibration: Annotated[str, option("kinematics it says it has: a file of seerob probe")] | None = None
    primary_port: Annotated[int, port("port where it says them; 0 is any free one")] = 30011

    def ready(self) -> Ready:
        """The controller."""
        target = self.target(joints=JOINTS, whose="a Universal Robots arm")
        motion, what = self.motion(target, HOME)
        words = None
        if target.description is not None:
            words = ControllerState(target.description, tcp=self.tcp, payload=self.payload)
        server = RtdeServer(
            motion,
            controller_state=words,
            host=self.host,
            port=self.port,
            kinematics=None if self.calibration is None else _kinematics(Path(self.calibration)),
            primary_port=self.primary_port,
        )
        return Ready(server, f"{target.name}, {what}", f"{self.host}:{self.port}")


def _kinematics(path: Path) -> Kinematics:
    from seerob.description.robots.calibration import read_calibration

    try:
        found = read_calibration(path.read_bytes(), str(path))
    except OSError as error:
        raise InputError.at(path, "", f"cannot be read: {error.strerror}", "give another file") from error
    return Kinematics(found.theta, found.a, found.d, found.alpha, found.checksum or (0,) * 6)
