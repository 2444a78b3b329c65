"""An RTDE server that plays a motion: what a Universal Robots controller sends, over a real socket.

It speaks for a robot that is switched on and does what the motion says. Where its arm is described it has all
fields of the interface: where its tool and its elbow are, what torques the motion needs by the masses of its
links, and plausible values of what no motion tells (`seerob.app.emulation.ur_fields`). A client may write its
inputs: registers and digital outputs are said again, and the speed slider slows its motion down.
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

from seerob.app.emulation.background import CannotListen, LoopEmulator
from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Ready, RobotOptions, option, port
from seerob.app.emulation.ur_fields import INPUTS, MADE_UP, OUTPUTS, ControllerState, defaults
from seerob.core.errors import InputError
from seerob.protocols import ProtocolError
from seerob.protocols.links.tcp_server import tcp_server
from seerob.protocols.robots.rtde import (
    IN_USE,
    NOT_FOUND,
    Accepted,
    ControllerRequest,
    ControllerVersion,
    Data,
    InputsReply,
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
)
from seerob.protocols.robots.ur_primary import Kinematics, encode_state

_log = logging.getLogger(__name__)

BASIC = {
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
"""Outputs of a controller of whose arm nothing is known but the motion."""
E_SERIES = ControllerVersion(5, 12, 4, 0)
PLAYING, PAUSED = 2, 4
MAX_CLIENTS = 8
MAX_RECIPES = 16
FULL = 1 << 16
"""Bytes that wait for a client who does not read; then the connection is closed."""
PRIMARY_SENDS = 100
"""Packages of the primary interface to one client."""
PROTECTIVE = "protective stop"
STEP = 1e-3
"""Within which speeds are compared for an acceleration [s]."""
DIGITAL = {"standard_digital_output": 0, "configurable_digital_output": 8, "tool_digital_output": 16}
"""Inputs that set digital outputs, and the first of their bits."""
LATE = 0.5
"""Time that is not made up for when this machine was too slow [s]."""


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
        holds: When it holds by itself, by why it does (`hold`) [s]; never where that is None.
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
        holds: Mapping[str, float | None] | None = None,
    ) -> None:
        super().__init__()
        self.host, self.port = host, port
        self.motion, self.controller, self.version, self.messages = motion, controller, version, messages
        self.kinematics, self.primary_port = kinematics, primary_port
        self.controller_state = controller_state
        every = OUTPUTS if controller_state is not None else BASIC
        self.types = {name: kind for name, kind in every.items() if name not in without}
        self.inputs: dict[str, Value] = {}
        """What clients wrote, by name."""
        self.writers: dict[str, object] = {}
        """Which client writes an input."""
        self._rest = defaults(self.types)
        self._clock, self._pace = (0.0, 0.0), 1.0
        self._held = ""
        self._holds = sorted((t, why) for why, t in (holds or {}).items() if t is not None)
        self.values = dict(values or {})
        """May be changed while it runs."""
        self.rate = 125.0 if controller.major < 5 else 500.0
        """The most that it sends [Hz]."""
        self.connections = 0
        """Clients at present."""
        self._begun = 0.0

    def at(self, t: float) -> dict[str, Value]:
        """Every field at a time since the start [s]."""
        moved, pace = self._motion_time(t), self._pace
        q, qd = self.motion(moved)
        qd = tuple(pace * v for v in qd)
        stopped = self._held == PROTECTIVE
        safety = int(SafetyStatus.PROTECTIVE_STOP if stopped else SafetyStatus.NORMAL)
        more: dict[str, Value] = {}
        if self.controller_state is not None:
            after = self.motion(moved + STEP)[1], self.motion(moved - STEP)[1]
            qdd = tuple(pace**2 * (b - a) / (2 * STEP) for b, a in zip(*after, strict=True))
            more = self._rest | self.controller_state(q, qd, qdd) | self._said_again()
        return {
            "actual_digital_output_bits": 0,
            **more,
            "timestamp": t,
            "target_q": q,
            "target_qd": qd,
            "actual_q": q,
            "actual_qd": qd,
            "robot_mode": int(RobotMode.RUNNING),
            "safety_mode": safety,
            "safety_status": safety,
            "runtime_state": PAUSED if self._held else PLAYING,
            "speed_scaling": pace,
            "target_speed_fraction": self._slider(),
            "actual_digital_input_bits": 0,
            "robot_status_bits": 0b01 if self._held else 0b11,
            "safety_status_bits": 0b100 if stopped else 0b1,
            **self.values,
        }

    def hold(self, why: str = "paused") -> None:
        """Stand still from now on: as a program that pauses, or for a protective stop; at once, unlike arms.

        Args:
            why: ``paused`` or `PROTECTIVE`.
        """
        self._held = why
        self._set_pace()

    def release(self) -> None:
        """Go on."""
        self._held = ""
        self._set_pace()

    def write(self, said: Mapping[str, Value]) -> None:
        """Take inputs."""
        self.inputs.update(said)
        self._set_pace()

    def _slider(self) -> float:
        """Where the speed slider is, 0…1."""
        if not int(self.inputs.get("speed_slider_mask", 0)) & 1:  # type: ignore[arg-type]
            return 1.0
        return min(max(float(self.inputs.get("speed_slider_fraction", 1.0)), 0.0), 1.0)  # type: ignore[arg-type]

    def _set_pace(self) -> None:
        now = self.now() if self._begun else 0.0
        self._clock = now, self._motion_time(now)
        self._pace = 0.0 if self._held else self._slider()

    def _motion_time(self, t: float) -> float:
        """How far the motion has come at a time since the start [s]."""
        since, moved = self._clock
        return moved + self._pace * (t - since)

    def _said_again(self) -> dict[str, Value]:
        """Outputs that inputs set: registers, and digital outputs under their masks."""
        found = {name: value for name, value in self.inputs.items() if name in self.types}
        bits = 0
        for name, first in DIGITAL.items():
            mask = int(self.inputs.get(f"{name}_mask", 0))  # type: ignore[arg-type]
            bits |= (int(self.inputs.get(name, 0)) & mask) << first  # type: ignore[arg-type]
        return found | {"actual_digital_output_bits": bits}

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
                try:
                    said = await both.enter_async_context(primary)
                except OSError as error:
                    where = f"{self.host}:{self.primary_port}"
                    raise CannotListen(error, "primary_port", where) from error
                self.primary_port = said.sockets[0].getsockname()[1]
            ready()
            loop = asyncio.get_running_loop()
            for t, why in self._holds:
                loop.call_later(t, self.hold, why)
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
        self._written: dict[int, Recipe] = {}
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
            for name in [name for name, who in self._server.writers.items() if who is self]:
                del self._server.writers[name]

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
                return [self._inputs(request)]
            case Data():
                recipe = self._written.get(request.recipe)
                if recipe is not None:
                    self._server.write(recipe.unpack(request.values))
                return []
            case StartRequest():
                self._pause()
                self._sending = [asyncio.create_task(self._send(*recipe)) for recipe in self._recipes]
                return [Accepted(Kind.START, bool(self._recipes))]
            case PauseRequest():
                self._pause()
                return [Accepted(Kind.PAUSE, accepted=True)]

    def _inputs(self, request: InputsRequest) -> InputsReply:
        """Let it write, where each of them is an input that nobody else writes."""
        server = self._server
        known = INPUTS if server.controller_state is not None else {}
        types = tuple(
            IN_USE if server.writers.get(name, self) is not self else known.get(name, NOT_FOUND)
            for name in request.fields
        )
        number = len(self._written) + 1
        if not types or {IN_USE, NOT_FOUND} & set(types) or number > MAX_RECIPES:
            return InputsReply(0, types)
        self._written[number] = Recipe(request.fields, types, number)
        server.writers.update(dict.fromkeys(request.fields, self))
        return InputsReply(number, types)

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
    pause_at: Annotated[float, option("its program pauses then", "s", ge=0)] | None = None
    protective_stop_at: Annotated[float, option("it stops protectively then", "s", ge=0)] | None = None
    calibration: Annotated[str, option("kinematics it says it has: a file of seerob probe")] | None = None
    primary_port: Annotated[int, port("port where it says them; 0 is any free one")] = 30011

    @property
    def listens(self) -> tuple[str, ...]:
        """Its port, and that where it says its kinematics."""
        return ("port",) if self.calibration is None else ("port", "primary_port")

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
            holds={"paused": self.pause_at, PROTECTIVE: self.protective_stop_at},
        )
        made_up = f"; made up: {', '.join(MADE_UP)}, and currents" if words is not None else ""
        return Ready(server, f"{target.name}, {what}{made_up}", f"{self.host}:{self.port}")


def _kinematics(path: Path) -> Kinematics:
    from seerob.description.robots.calibration import read_calibration

    try:
        found = read_calibration(path.read_bytes(), str(path))
    except OSError as error:
        raise InputError.at(path, "", f"cannot be read: {error.strerror}", "give another file") from error
    return Kinematics(found.theta, found.a, found.d, found.alpha, found.checksum or (0,) * 6)
