"""A device that plays values in Modbus registers, on the server of pymodbus."""

from __future__ import annotations

import asyncio
import errno
import logging
import math
import socket
import struct
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated

from seerob.app.emulation import motions
from seerob.app.emulation.background import LoopEmulator
from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Ready, RobotOptions, option, port
from seerob.core.extras import need
from seerob.protocols.plc.modbus import (
    Joints,
    Place,
    RegisterMap,
    SignalEntry,
    Table,
    Type,
    Words,
    blocks,
    encode,
    load,
)

Program = Mapping[Place, Callable[[float], float | bool]]
"""Place → the raw value in it at a time since it was made [s]."""
Play = Callable[[float], float | bool]


def program(found: RegisterMap, motion: Motion, states: dict[str, str | bool | float]) -> Program:
    """Every register of a map: joints as the motion says, states as given, all else 0.

    Args:
        found: The map.
        motion: What the robot does.
        states: Signal → what it is, a word where the map has words, the raw number else.
    """
    played: dict[Place, Play] = {}
    for block in found.blocks:
        for k in range(block.first, block.first + block.count):
            played[Place(table=block.table, at=k, type=Type.U16)] = _nothing
    for part, joints in enumerate((found.position, found.velocity)):
        for k, place in enumerate(() if joints is None else joints.places(found.joints)):
            if joints is not None:
                played[_free(played, place)] = partial(_joint, motion, joints, part, k)
    for place in () if found.torque is None else found.torque.places(found.joints):
        played[_free(played, place)] = _nothing
    for signal in found.signals:
        raw = _raw(signal, states[signal.name]) if signal.name in states else 0.0
        played[_free(played, signal.place)] = partial(_constant, raw)
    return played


def _free(played: dict[Place, Play], place: Place) -> Place:
    """The place, once nothing else plays there."""
    for k in range(place.type.size):
        for other in [p for p in played if p.table is place.table and p.at == place.at + k]:
            if played[other] is _nothing:
                del played[other]
    return place


def _raw(signal: SignalEntry, state: str | bool | float) -> float:
    if isinstance(state, str):
        return float(next(number for number, word in signal.choices.items() if word == state))
    return float(state)


def _nothing(t: float) -> float:
    return 0.0


def _constant(value: float, t: float) -> float:
    return value


def _joint(motion: Motion, joints: Joints, part: int, k: int, t: float) -> float:
    return motion(t)[part][k] / joints.factor


IDS = {1: Table.COIL, 5: Table.COIL, 15: Table.COIL, 2: Table.DISCRETE, 4: Table.INPUT}
"""Functions of the protocol and their tables; the others are about holding registers."""


class ModbusServer(LoopEmulator):
    """The device, in a thread of its own.

    Args:
        program: What it plays; every other address is refused, and so is writing.
        host: Address to listen on.
        port: 0 is any free one.
        device: Its number (unit identifier).
        refresh: Interval at which its values change [s]; 0 for always.
    """

    def __init__(
        self,
        program: Program,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        device: int = 1,
        refresh: float = 0.0,
    ) -> None:
        super().__init__()
        self.program, self.host, self.port, self.device, self.refresh = program, host, port, device, refresh
        self._made = time.monotonic()

    def instant(self) -> float:
        """The time that its values speak of, since it was made [s]."""
        t = time.monotonic() - self._made
        return t if not self.refresh else self.refresh * math.floor(t / self.refresh)

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Listen and answer."""
        from pymodbus.constants import ExcCodes
        from pymodbus.server import ModbusTcpServer
        from pymodbus.server.requesthandler import ServerRequestHandler
        from pymodbus.simulator import DataType, SimData, SimDevice

        logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)

        async def play(
            function: int,
            start: int,
            address: int,
            count: int,
            registers: list[int],
            written: list[int] | list[bool] | None,
        ) -> ExcCodes | None:
            if written is not None:
                return ExcCodes.ILLEGAL_FUNCTION
            self._play(IDS.get(function, Table.HOLDING), start, registers)
            return None

        data: dict[Table, list[SimData]] = {}
        for table in (Table.COIL, Table.DISCRETE):
            bits = [p.at for p in self.program if p.table is table]
            whole = [False] * (16 * (max(bits, default=0) // 16 + 1))
            data[table] = [SimData(0, values=whole, datatype=DataType.BITS)]
        for table in (Table.HOLDING, Table.INPUT):
            ranges = blocks(p for p in self.program if p.table is table)
            data[table] = [
                SimData(b.first, values=[0] * b.count, datatype=DataType.REGISTERS) for b in ranges
            ] or [SimData(0, datatype=DataType.INVALID)]
        every = data[Table.COIL], data[Table.DISCRETE], data[Table.HOLDING], data[Table.INPUT]
        device = SimDevice(self.device, simdata=every, action=play)
        handlers: list[ServerRequestHandler] = []

        class Server(ModbusTcpServer):
            def callback_new_connection(self) -> ServerRequestHandler:
                handlers[:] = [known for known in handlers if not known.is_closing]
                handlers.append(super().callback_new_connection())  # type: ignore[no-untyped-call]
                return handlers[-1]

        server = Server(device, address=(self.host, self.port))
        if not await server.listen() or server.transport is None:
            socket.create_server((self.host, self.port)).close()  # says why
            raise OSError(errno.EADDRINUSE, "it was taken just now")
        self.port = server.transport.sockets[0].getsockname()[1]  # type: ignore[attr-defined]
        ready()
        try:
            await over.wait()
        finally:
            await server.shutdown()  # type: ignore[no-untyped-call]
            # One that was accepted at the last moment is not among those that it closes.
            for _ in range(3):
                await asyncio.sleep(0)
            for handler in handlers:
                if handler.transport is not None:
                    handler.transport.close()

    def _play(self, table: Table, start: int, registers: list[int]) -> None:
        """Bring the registers of a table, from an address on, up to date."""
        t = self.instant()
        for place, value in self.program.items():
            if place.table is not table:
                continue
            if table.bits:
                word, bit = divmod(place.at - start, 16)
                registers[word] = registers[word] & ~(1 << bit) | bool(value(t)) << bit
            elif place.bit is not None:
                k = place.at - start
                registers[k] = registers[k] & ~(1 << place.bit) | bool(value(t)) << place.bit
            else:
                with suppress(struct.error):  # a device's number that does not fit stays as it was
                    words = encode(place, value(t))
                    registers[place.at - start : place.at - start + len(words)] = words


# -- options ------------------------------------------------------------------------------------

HOME = (0.0, 0.3, 1.2, 0.0, 1.2, 0.0)
"""What it swings about when no motion is given [rad]."""
BELT = 128
"""Registers of the belt: speed, bits, position."""


class Modbus(RobotOptions, frozen=True, kw_only=True):
    """A controller that has a robot's joints in Modbus registers, with a belt beside them."""

    robot: Annotated[str, option("robot of the library, whose limits hold")] = "doosan_m1013"
    map: Annotated[str, option("register map, or a file of one")] = "doosan"
    port: Annotated[int, port()] = 5020

    def ready(self) -> Ready:
        """The controller."""
        need("pymodbus")
        found = load(self.map, Path())
        target = self.target(joints=found.joints, whose=f"the map {self.map}")
        home = (*HOME, *(0.0,) * found.joints)[: found.joints]
        motion, what = self.motion(target, home)
        states: dict[str, str | bool | float] = {"robot_state": "moving", "servo_on": True}
        known = {s.name for s in found.signals}
        played = {
            **program(found, motion, {name: state for name, state in states.items() if name in known}),
            Place(table=Table.HOLDING, at=BELT, type=Type.I16): motions.speed,
            Place(table=Table.HOLDING, at=BELT + 1, type=Type.BIT, bit=0): motions.running,
            Place(table=Table.HOLDING, at=BELT + 1, type=Type.BIT, bit=1): motions.clear,
            Place(table=Table.HOLDING, at=BELT + 2, type=Type.F32, words=Words.HIGH_FIRST): motions.position,
        }
        server = ModbusServer(played, host=self.host, port=self.port, refresh=found.refresh)
        belt = f"a belt in the holding registers {BELT} (i16, mm/s) to {BELT + 3}"
        chosen = "" if self.map == "doosan" else f" --set map={self.map}"
        hear = (
            f"seerob probe modbus_robot {{host}} --port {{port}}{chosen}",
            "seerob probe modbus {host} --port {port}",
        )
        return Ready(server, f"{target.name}, {what}; {belt}", f"{self.host}:{self.port}", hear)
