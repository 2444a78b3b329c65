"""A Modbus TCP client: a connection, answers to blocks of registers, and the coils of triggers."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Any

from seerob.core.extras import need
from seerob.protocols import ProtocolError
from seerob.protocols.plc.modbus import Block, Place, Table, blocks, decode

if TYPE_CHECKING:
    from pymodbus.client import AsyncModbusTcpClient

PATIENCE = 1.0
"""With each answer [s]."""
BUSY = (5, 6)
"""Exceptions that will pass: what was refused so is there."""
TRIES, PAUSE = 5, 0.02
"""How often a busy device is asked, and how long it is left alone meanwhile [s]."""
EXCEPTIONS = {
    1: "the device does not know the function",
    2: "the device has no such register",
    3: "the device refuses the number of registers",
    4: "the device failed to read it",
    5: "the device needs longer to answer",
    6: "the device is busy",
    10: "the gateway has no way to the device",
    11: "the device behind the gateway does not answer",
}
"""Exception codes of the protocol, in words."""


class Refused(ProtocolError):
    """The device answers that it has not what is asked for."""


class Busy(ProtocolError):
    """The device answers that it has no time now."""


class Device:
    """A device that answers.

    Args:
        client: Connected.
        number: Of the device behind the address (unit identifier).
    """

    def __init__(self, client: AsyncModbusTcpClient, number: int) -> None:
        self._client, self._number = client, number
        self._split: set[Block] = set()

    async def block(self, block: Block) -> Sequence[int | bool]:
        """Registers or bits of one block.

        Raises:
            Refused: The device has them not.
            Busy: It may have them, and does not say it now.
            TimeoutError: No answer in time.
            OSError: The connection is gone.
            ProtocolError: It answers with something else.
        """
        from pymodbus.exceptions import ConnectionException, ModbusException

        ask: Any = {
            Table.HOLDING: self._client.read_holding_registers,
            Table.INPUT: self._client.read_input_registers,
            Table.COIL: self._client.read_coils,
            Table.DISCRETE: self._client.read_discrete_inputs,
        }[block.table]
        try:
            answer = await ask(block.first, count=block.count, device_id=self._number)
        except ConnectionException as error:
            raise ConnectionError("the device closed the connection") from error
        except ModbusException as error:
            if not self._client.connected:
                raise ConnectionError("the device closed the connection") from error
            raise TimeoutError(f"no answer in {PATIENCE:g} s") from error
        if answer.isError():
            code = int(getattr(answer, "exception_code", 0))
            if code in BUSY:
                raise Busy("the device is busy")
            raise Refused(EXCEPTIONS.get(code, f"exception {code}"))
        found: Sequence[int | bool] = answer.bits if block.table.bits else answer.registers
        if len(found) < block.count:
            raise ProtocolError(f"{len(found)} values where {block.count} were asked for")
        return found

    async def patient_block(self, block: Block) -> Sequence[int | bool]:
        """Read a block, and ask again while the device is busy; raises as `block` does otherwise.

        Raises:
            TimeoutError: It stays busy.
        """
        for _ in range(TRIES):
            try:
                return await self.block(block)
            except Busy:
                await asyncio.sleep(PAUSE)
        raise TimeoutError(f"busy {TRIES} times in a row")

    async def write_coil(self, at: int, value: bool) -> None:
        """Write one coil (function 5).

        Raises:
            Refused: The device does not let it be written.
            TimeoutError: No answer in time.
        """
        from pymodbus.exceptions import ModbusException

        try:
            answer = await self._client.write_coil(at, value, device_id=self._number)
        except ModbusException as error:
            raise TimeoutError(f"no answer in {PATIENCE:g} s") from error
        if answer.isError():
            code = int(getattr(answer, "exception_code", 0))
            raise Refused(EXCEPTIONS.get(code, f"exception {code}"))

    async def read(self, wanted: dict[str, Place]) -> dict[str, int | float | bool | Refused]:
        """Values by name; where the device refuses one, why.

        A block that is refused is asked for value by value from then on: one wrong address must not
        take its neighbours with it.

        Raises:
            OSError: The connection is gone, or no answer in time.
            ProtocolError: It answers with something else.
        """
        found: dict[str, int | float | bool | Refused] = {}
        for block in blocks(wanted.values()):
            inside = {name: place for name, place in wanted.items() if block.covers(place)}
            if block not in self._split:
                try:
                    found |= take(block, await self.patient_block(block), inside)
                except Refused as error:
                    if len(inside) == 1:
                        found |= dict.fromkeys(inside, error)
                        continue
                    self._split.add(block)
            if block in self._split:
                for name, place in inside.items():
                    single = Block(place.table, place.at, place.type.size)
                    try:
                        found |= take(single, await self.patient_block(single), {name: place})
                    except Refused as error:
                        found[name] = error
        return found


def take(
    block: Block, words: Sequence[int | bool], wanted: dict[str, Place]
) -> dict[str, int | float | bool]:
    """Values of places that lie in a block."""
    starts = {name: place.at - block.first for name, place in wanted.items()}
    return {
        name: decode(place, words[starts[name] : starts[name] + place.type.size])
        for name, place in wanted.items()
    }


@asynccontextmanager
async def connect(host: str, port: int, number: int) -> AsyncGenerator[Device, None]:
    """A connection, until the block ends.

    Args:
        host: Name or address.
        port: 502 of most devices.
        number: Of the device (unit identifier).

    Raises:
        OSError: There is no connection.
    """
    need("pymodbus")
    from pymodbus.client import AsyncModbusTcpClient

    logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)
    client = AsyncModbusTcpClient(host, port=port, timeout=PATIENCE, retries=0, reconnect_delay=0)
    loop = asyncio.get_running_loop()
    usual = loop.get_exception_handler()
    loop.set_exception_handler(_told_elsewhere)
    try:
        if not await client.connect():
            raise ConnectionError("no connection")
        yield Device(client, number)
    finally:
        client.close()
        loop.set_exception_handler(usual)


def _told_elsewhere(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Bytes on which pymodbus fails end the connection, which is said as a loss; no traceback beside it."""
    if not type(context.get("protocol")).__module__.startswith("pymodbus"):
        loop.default_exception_handler(context)
