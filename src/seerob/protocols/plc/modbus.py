"""A Modbus TCP client, and its registers: where a value is, what its bits mean, which are asked for together.

Register maps of robots: data files that say where a controller has its joints and states.

One file per maker, here or beside a workstation; every entry says where its address comes from.
"""

from __future__ import annotations

import asyncio
import logging
import struct
from collections.abc import AsyncGenerator, Iterable, Sequence
from contextlib import asynccontextmanager
from enum import StrEnum
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
from msgspec import Meta

from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.extras import need
from seerob.core.files.toml_file import read_toml
from seerob.core.quantities import Seconds
from seerob.protocols import ProtocolError
from seerob.workstation.conversion import convert
from seerob.workstation.variables import Kind, Variable, unit

if TYPE_CHECKING:
    from pymodbus.client import AsyncModbusTcpClient


PORT = 502
MOST = 120
"""Registers of one question; the protocol allows 125."""
MOST_BITS = 1000
"""Coils or discrete inputs of one question; the protocol allows 2000."""


class Table(StrEnum):
    """Which of the four tables of a device."""

    HOLDING = "holding"
    """Registers that can be read and written; function 3."""
    INPUT = "input"
    """Registers that can only be read; function 4."""
    COIL = "coil"
    """Bits that can be read and written; function 1."""
    DISCRETE = "discrete"
    """Bits that can only be read; function 2."""

    @property
    def bits(self) -> bool:
        """Whether it has bits, not registers."""
        return self in (Table.COIL, Table.DISCRETE)


class Type(StrEnum):
    """What the registers hold."""

    I16 = "i16"
    U16 = "u16"
    I32 = "i32"
    U32 = "u32"
    I64 = "i64"
    U64 = "u64"
    F32 = "f32"
    F64 = "f64"
    BIT = "bit"
    """One bit of a register, or a coil or discrete input."""

    @property
    def size(self) -> int:
        """Registers that one value takes."""
        return 1 if self is Type.BIT else int(self[1:]) // 16


class Words(StrEnum):
    """Which register of several comes first; bytes within a register are always high first."""

    HIGH_FIRST = "high_first"
    LOW_FIRST = "low_first"


FORMATS = {
    Type.I16: ">h",
    Type.U16: ">H",
    Type.I32: ">i",
    Type.U32: ">I",
    Type.I64: ">q",
    Type.U64: ">Q",
    Type.F32: ">f",
    Type.F64: ">d",
}


class Place(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where one value is, and what its bits mean."""

    table: Table
    at: Annotated[int, Meta(ge=0, le=65535)]
    """Address as it is sent, from 0: what some manuals call 40129 is the holding register 128."""
    type: Type
    words: Words | None = None
    """Must be given for values of several registers: makers differ."""
    bit: Annotated[int, Meta(ge=0, le=15)] | None = None
    """Number of a bit in a register, 0 the lowest."""

    def __post_init__(self) -> None:
        if self.table.bits and (self.type is not Type.BIT or self.bit is not None):
            raise ValueError(f'table = "{self.table}" has single bits: type = "bit" and no bit')
        if not self.table.bits and (self.type is Type.BIT) != (self.bit is not None):
            raise ValueError('type = "bit" in a register and bit = 0 … 15 belong together')
        if (self.type.size > 1) != (self.words is not None):
            raise ValueError(
                f'{self.type} takes {self.type.size} registers: words = "high_first" or "low_first" '
                + ("must be given" if self.type.size > 1 else "belongs to values of several")
            )
        if self.at + self.type.size > 1 << 16:
            raise ValueError(f"{self.at} and {self.type.size - 1} more: the last register is 65535")


class Block(msgspec.Struct, frozen=True):
    """What is asked for in one question."""

    table: Table
    first: int
    count: int

    def covers(self, place: Place) -> bool:
        """Whether a place lies in it."""
        inside = self.first <= place.at and place.at + place.type.size <= self.first + self.count
        return place.table is self.table and inside


def decode(place: Place, words: Sequence[int | bool]) -> int | float | bool:
    """The value in its registers.

    Args:
        place: Where it is.
        words: Its registers in the order of their addresses, or its bit.
    """
    if place.table.bits:
        return bool(words[0])
    registers = [int(w) for w in words]
    if place.bit is not None:
        return bool(registers[0] >> place.bit & 1)
    if place.words is Words.LOW_FIRST:
        registers.reverse()
    value: int | float = struct.unpack(FORMATS[place.type], struct.pack(f">{len(registers)}H", *registers))[0]
    return value


def encode(place: Place, value: float) -> list[int]:
    """The registers of a number: `decode` backwards.

    Raises:
        struct.error: It does not fit.
    """
    data = struct.pack(FORMATS[place.type], value if place.type in (Type.F32, Type.F64) else round(value))
    registers = list(struct.unpack(f">{place.type.size}H", data))
    return registers[::-1] if place.words is Words.LOW_FIRST else registers


def blocks(places: Iterable[Place]) -> tuple[Block, ...]:
    """The fewest questions that ask for nothing else: a device refuses a block with a hole in it."""
    found: list[Block] = []
    order = {table: k for k, table in enumerate(Table)}
    for place in sorted(set(places), key=lambda p: (order[p.table], p.at, p.type.size)):
        end = place.at + place.type.size
        most = MOST_BITS if place.table.bits else MOST
        last = found[-1] if found else None
        if last is not None and last.table is place.table and place.at <= last.first + last.count:
            longer = max(last.first + last.count, end) - last.first
            if longer <= most:
                found[-1] = Block(last.table, last.first, longer)
                continue
        found.append(Block(place.table, place.at, place.type.size))
    return tuple(found)


MOST_SIGNALS = 200
MOST_JOINTS = 12
SUFFIX = ".toml"

Scale = Annotated[float, Meta(gt=0)]
Text = Annotated[str, Meta(min_length=1, max_length=1000)]


class Joints(msgspec.Struct, frozen=True, kw_only=True):
    """One value per joint, one after the other."""

    at: Annotated[int, Meta(ge=0, le=65535)]
    """Of the first joint."""
    type: Type
    unit: str
    scale: Scale
    """The raw number times this is in ``unit``."""
    source: Text
    table: Table = Table.HOLDING
    words: Words | None = None

    def __post_init__(self) -> None:
        if self.type is Type.BIT:
            raise ValueError("a joint is no bit")
        if unit(self.unit) is None:
            raise ValueError(f"unknown unit {self.unit!r}")

    @property
    def factor(self) -> float:
        """From the raw number to SI."""
        known = unit(self.unit)
        return self.scale * (known.factor if known is not None else float("nan"))

    def places(self, count: int) -> tuple[Place, ...]:
        """Where each joint is."""
        size = self.type.size
        return tuple(
            Place(table=self.table, at=self.at + size * k, type=self.type, words=self.words)
            for k in range(count)
        )


class SignalEntry(msgspec.Struct, frozen=True, kw_only=True):
    """One state or figure of the controller."""

    name: Annotated[
        str,
        Meta(pattern=r"^[A-Za-z_][\w.]{0,99}$", description="a letter or _, then letters, digits, _ and ."),
    ]
    at: Annotated[int, Meta(ge=0, le=65535)]
    type: Type
    source: Text
    table: Table = Table.HOLDING
    words: Words | None = None
    bit: Annotated[int, Meta(ge=0, le=15)] | None = None
    unit: str | None = None
    scale: float = 1.0
    choices: dict[str, str] = {}

    @property
    def place(self) -> Place:
        """Where it is."""
        return Place(table=self.table, at=self.at, type=self.type, words=self.words, bit=self.bit)

    @property
    def variable(self) -> Variable:
        """What it means."""
        kind = Kind.CHOICE if self.choices else Kind.BOOL if self.type is Type.BIT else Kind.NUMBER
        return Variable(
            name=self.name.replace(".", "/"),
            source="",
            address=None,
            type=kind,
            unit=self.unit,
            scale=self.scale,
            choices=self.choices,
        )


class Together(msgspec.Struct, frozen=True, kw_only=True):
    """Registers that are asked in one question, with what lies between those that are used."""

    first: Annotated[int, Meta(ge=0, le=65535)]
    count: Annotated[int, Meta(ge=1, le=MOST)]
    table: Table = Table.HOLDING


class States(msgspec.Struct, frozen=True, kw_only=True):
    """What the controller's state says of its joints."""

    signal: str
    """Name of the one of ``signals`` that has it."""
    unsure: tuple[str, ...] = ()
    """States in which it does not know its joints."""
    doubtful: tuple[str, ...] = ()
    """States in which they may be shown, not judged."""


class RegisterMap(msgspec.Struct, frozen=True, kw_only=True):
    """Where a robot's controller has what."""

    title: Text
    source: Text
    """Document that it is from."""
    joints: Annotated[int, Meta(ge=1, le=MOST_JOINTS)]
    refresh: Seconds
    """Interval at which the controller renews its values [s]."""
    position: Joints
    velocity: Joints | None = None
    torque: Joints | None = None
    tool: Joints | None = None
    """x, y and z of the tool centre point in the base frame of the controller."""
    state: States | None = None
    blocks: Annotated[tuple[Together, ...], Meta(max_length=20)] = ()
    signals: Annotated[tuple[SignalEntry, ...], Meta(max_length=MOST_SIGNALS)] = ()

    def __post_init__(self) -> None:
        for key, joints, si in (
            ("position", self.position, ("rad", "m")),
            ("velocity", self.velocity, ("rad/s", "m/s")),
            ("torque", self.torque, ("N·m", "N")),
            ("tool", self.tool, ("m",)),
        ):
            known = None if joints is None else unit(joints.unit)
            if joints is not None and (known is None or known.si not in si):
                raise ValueError(f"{key}.unit = {joints.unit!r} is not one of {' or '.join(si)}")
            if joints is not None:
                joints.places(self.joints)
        variables = {s.name: s.variable for s in self.signals}
        if len(variables) < len(self.signals):
            raise ValueError("a name in signals is there twice")
        for signal in self.signals:
            _ = signal.place
        if self.state is not None:
            words = variables[self.state.signal].choices.values() if self.state.signal in variables else ()
            unknown = {*self.state.unsure, *self.state.doubtful} - set(words)
            if not words or unknown:
                what = ", ".join(sorted(unknown)) or self.state.signal
                raise ValueError(f"state: no signal with choices has {what}")

    def places(self) -> dict[str, Place]:
        """Everything that it has: ``q0`` …, ``qd0`` …, ``tau0`` …, ``tcp0`` … and ``signal <name>``."""
        found: dict[str, Place] = {}
        groups = (("q", self.position), ("qd", self.velocity), ("tau", self.torque), ("tcp", self.tool))
        for key, joints in groups:
            count = 3 if joints is self.tool else self.joints
            for k, place in enumerate(() if joints is None else joints.places(count)):
                found[f"{key}{k}"] = place
        return found | {f"signal {s.name}": s.place for s in self.signals}

    def questions(self) -> tuple[Block, ...]:
        """What is asked for, the question with the first joint first."""
        stated = [Block(b.table, b.first, b.count) for b in self.blocks]
        alone = [p for p in self.places().values() if not any(b.covers(p) for b in stated)]
        first = self.position.places(self.joints)[0]
        return tuple(sorted((*stated, *blocks(alone)), key=lambda b: not b.covers(first)))


def names() -> tuple[str, ...]:
    """Names of the maps that ship."""
    files = (resources.files(__package__) / "modbus_maps").iterdir()
    return tuple(sorted(f.name.removesuffix(SUFFIX) for f in files if f.name.endswith(SUFFIX)))


def load(name: str, folder: Path) -> RegisterMap:
    """A map that ships, by its name, or one beside the workstation, by its file name.

    Raises:
        UnknownName: There is no such map.
        InputError: With every mistake in the file.
    """
    if name.endswith(SUFFIX):
        path = folder / name
    elif name in names():
        with resources.as_file(resources.files(__package__) / "modbus_maps" / f"{name}{SUFFIX}") as shipped:
            path = shipped
    else:
        raise UnknownName("register map", name, names())
    table, _ = read_toml(path)
    problems: list[Problem] = []
    found = convert(table, RegisterMap, file=str(path), key="", problems=problems)
    if found is None:
        raise InputError(problems)
    return found


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
    loop.set_exception_handler(_quiet)
    try:
        if not await client.connect():
            raise ConnectionError("no connection")
        yield Device(client, number)
    finally:
        client.close()
        loop.set_exception_handler(usual)


def _quiet(loop: asyncio.AbstractEventLoop, context: dict[str, object]) -> None:
    """Bytes on which pymodbus fails end the connection, which is said as a loss; no traceback beside it."""
    if not type(context.get("protocol")).__module__.startswith("pymodbus"):
        loop.default_exception_handler(context)
