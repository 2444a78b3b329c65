"""A device that plays values in Modbus registers, on the server of pymodbus."""

from __future__ import annotations

import asyncio
import logging
import math
import struct
import time
from collections.abc import Callable, Mapping
from contextlib import suppress

from seerob.app.emulators.background import LoopEmulator
from seerob.protocols.plc.modbus import Place, Table, blocks, encode

Program = Mapping[Place, Callable[[float], float | bool]]
"""Place → the raw value in it at a time since it was made [s]."""
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
            raise OSError(f"cannot listen on {self.host}:{self.port}")
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
