"""Modbus registers: where a value is, what its bits mean, and which are asked for together."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import Annotated

import msgspec
from msgspec import Meta

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
