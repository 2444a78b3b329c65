"""Variables of PLCs and machines through Modbus TCP: asked again and again."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator
from pathlib import Path
from typing import Annotated, ClassVar

import msgspec
from msgspec import Meta

from seerob.core.errors import InputError, Problem
from seerob.core.quantities import Seconds
from seerob.core.snapshot import Finding
from seerob.devices.variables.live_source import Change, Node, VariablesSource
from seerob.protocols.plc import modbus
from seerob.protocols.plc.modbus import Place, Refused, Table, connect
from seerob.workstation.source import Opened, Target
from seerob.workstation.variables import Variable


class Modbus(VariablesSource, frozen=True, kw_only=True):
    """Variables of a PLC or machine through Modbus TCP."""

    loads: ClassVar[tuple[str, ...]] = ("pymodbus.client",)
    by_exception: ClassVar[bool] = False

    host: str
    """Name or address of the device."""
    port: Annotated[int, Meta(ge=1, le=65535)] = modbus.PORT
    """TCP port of the device."""
    device: Annotated[int, Meta(ge=0, le=255)] = 1
    """Number of the device behind that address (unit identifier); often 1 or 255."""
    every: Seconds = 0.1
    """Interval between questions [s]."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return self.every

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Understand every address, and look whether the device is there.

        Raises:
            InputError: With every address that cannot be understood.
        """
        problems = []
        for variable in () if target is None else target.variables:
            try:
                place = msgspec.convert(variable.address, Place)
                if variable.write and place.table is not Table.COIL:
                    what = f'table = "{place.table}": a trigger is written to a coil alone'
                    problems.append(Problem(f"modbus {self.host}", f"{variable.name}.address", what))
            except msgspec.ValidationError as error:
                remedy = 'write { table = "holding", at = 128, type = "i16" }'
                problems.append(
                    Problem(f"modbus {self.host}", f"{variable.name}.address", str(error), remedy)
                )
        if problems:
            raise InputError(problems)
        return VariablesSource.open(self, folder, target)

    def sampling_gap(self) -> float:
        """Between two questions."""
        return self.every

    def times(self, variable: Variable) -> bool:
        """It is asked."""
        return True

    async def ask(self) -> tuple[Finding, ...]:
        """Connect once: the protocol has no question for what a device is."""
        async with connect(self.host, self.port, self.device):
            text = f"variables asked from {self.host}:{self.port} every {self.every:g} s"
            return (Finding(level="note", subject=self.name or "modbus", text=text),)

    async def changes(
        self, variables: tuple[Variable, ...], folder: Path
    ) -> AsyncGenerator[tuple[Change, ...], None]:
        """Every variable, asked again and again."""
        wanted = {v.name: msgspec.convert(v.address, Place) for v in variables}
        clock = asyncio.get_running_loop()
        async with connect(self.host, self.port, self.device) as device:
            due = clock.time()
            while True:
                asked = time.monotonic()
                found = await device.read(wanted)
                age = time.monotonic() - asked
                yield tuple(
                    Change(name, None, invalid_reason=str(value))
                    if isinstance(value, Refused)
                    else Change(name, value, age=age)
                    for name, value in found.items()
                )
                # What was asked late is not made up for.
                due = max(due + self.every, clock.time())
                await asyncio.sleep(due - clock.time())

    async def write(self, variable: Variable, raw: bool, folder: Path) -> None:
        """Write one coil; called by `seerob.session.writing` alone."""
        place = msgspec.convert(variable.address, Place)
        async with connect(self.host, self.port, self.device) as device:
            await device.write_coil(place.at, raw)

    async def browse(self) -> AsyncGenerator[Node, None]:
        """Nothing: the protocol has no names.

        Raises:
            InputError: Always.
        """
        what = "a Modbus device cannot be asked what it has"
        raise InputError.at(f"modbus {self.host}", "", what, "its manual lists its registers")
        yield
