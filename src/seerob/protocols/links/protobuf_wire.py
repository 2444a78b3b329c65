"""Fields of Protocol Buffers messages, without a schema compiler: for the few messages that are needed.

Encoding as in the public description of the format: a field is a tag, ``number << 3 | wire type``, and a
value. Repeated numbers come one by one or packed in one field; a reader takes both.

Read here and not by the library protobuf, which is a dependency, for two reasons. It reads a number that was
sent as another type as 0.0, without a word (a link 0 m away); here that is refused. And it needs compiled
schemas, which no package has of FRI's and Sparkplug's messages. Price, with Foxglove's schemas and equal
results, one core under load: 20 transforms took 1.4 ms here and 0.14 ms there, six joint states 140 µs here
and 3 µs there (`tests/protocols/test_foxglove_fields.py` has the first reason).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

from seerob.protocols import ProtocolError


class Wire(IntEnum):
    """How a value is written."""

    VARINT = 0
    FIXED64 = 1
    LENGTH = 2
    FIXED32 = 5


_VARINT, _FIXED64, _LENGTH = Wire.VARINT, Wire.FIXED64, Wire.LENGTH
_WIRES = {int(wire): wire for wire in Wire}
_NUMBERS = 1 << 29
"""Numbers of fields are below."""


class Field(NamedTuple):
    """One field as it stands in a message."""

    number: int
    wire: Wire
    value: int | bytes
    """A number for `Wire.VARINT`, else the bytes."""

    def whole(self) -> int:
        """An unsigned whole number.

        Raises:
            ProtocolError: It is none.
        """
        if not isinstance(self.value, int):
            raise ProtocolError(f"field {self.number} is no whole number")
        return self.value

    def signed(self) -> int:
        """A signed whole number of 32 or 64 bits (``int32``, ``int64``)."""
        value = self.whole()
        return value - (1 << 64) if value >= 1 << 63 else value

    def bytes(self) -> bytes:
        """Text or a message of its own.

        Raises:
            ProtocolError: It is a number.
        """
        if self.wire is not Wire.LENGTH or not isinstance(self.value, bytes):
            raise ProtocolError(f"field {self.number} is no text and no message")
        return self.value

    def text(self) -> str:
        """Text; what is not UTF-8 is replaced."""
        return self.bytes().decode("utf-8", "replace")

    def doubles(self) -> tuple[float, ...]:
        """One number or several packed ones.

        Raises:
            ProtocolError: The length does not fit.
        """
        if not isinstance(self.value, bytes) or self.wire is Wire.FIXED32 or len(self.value) % 8:
            raise ProtocolError(f"field {self.number} holds no doubles")
        return struct.unpack(f"<{len(self.value) // 8}d", self.value)

    def float(self) -> float:
        """A number of four bytes.

        Raises:
            ProtocolError: It has another length.
        """
        if self.wire is not Wire.FIXED32 or not isinstance(self.value, bytes):
            raise ProtocolError(f"field {self.number} holds no float")
        return float(struct.unpack("<f", self.value)[0])

    def wholes(self) -> tuple[int, ...]:
        """One whole number or several packed ones."""
        if self.wire is Wire.VARINT:
            return (self.whole(),)
        data, at, found = self.bytes(), 0, []
        while at < len(data):
            value, at = _varint(data, at)
            found.append(value)
        return tuple(found)


_field = tuple.__new__
"""A `Field` without a call of Python's."""


def fields(data: bytes) -> Iterator[Field]:
    """The fields of a message in the order in which they stand.

    Raises:
        ProtocolError: The bytes are no message.
    """
    # Live messages come hundreds of times a second, and most numbers in them are of one byte.
    at, end = 0, len(data)
    while at < end:
        tag = data[at]
        if tag < 0x80:
            at += 1
        else:
            tag, at = _varint(data, at)
        number, kind = tag >> 3, tag & 7
        if not 0 < number < _NUMBERS:
            raise ProtocolError(f"a field with the number {number}")
        wire = _WIRES.get(kind)
        if wire is None:
            raise ProtocolError(f"field {number} has the unknown wire type {kind}")
        if wire is _VARINT or wire is _LENGTH:
            if at < end and (length := data[at]) < 0x80:
                at += 1
            else:
                length, at = _varint(data, at)
            if wire is _VARINT:
                yield _field(Field, (number, _VARINT, length))
                continue
        else:
            length = 8 if wire is _FIXED64 else 4
        if length > end - at:
            raise ProtocolError(f"field {number} of {length} bytes, {end - at} are left")
        yield _field(Field, (number, wire, data[at : at + length]))
        at += length


def _varint(data: bytes, at: int) -> tuple[int, int]:
    if at < len(data) and (value := data[at]) < 0x80:
        return value, at + 1
    value = shift = 0
    while at < len(data):
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value & 0xFFFF_FFFF_FFFF_FFFF, at
        shift += 7
        if shift > 63:
            raise ProtocolError("a number of more than 64 bits")
    raise ProtocolError("ends within a number")


def varint(value: int) -> bytes:
    """A whole number, negative ones in 64 bits as ``int32`` and ``int64`` are."""
    value &= 0xFFFF_FFFF_FFFF_FFFF
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def whole(number: int, value: int | None) -> bytes:
    """A field with a whole number; nothing for None."""
    return b"" if value is None else varint(number << 3 | Wire.VARINT) + varint(value)


def double(number: int, value: float | None) -> bytes:
    """A field with a number of eight bytes; nothing for None."""
    return b"" if value is None else varint(number << 3 | Wire.FIXED64) + struct.pack("<d", value)


def doubles(number: int, values: tuple[float, ...]) -> bytes:
    """A repeated field, one by one."""
    return b"".join(double(number, value) for value in values)


def message(number: int, data: bytes | None) -> bytes:
    """A field with text or with a message; nothing for None."""
    return b"" if data is None else varint(number << 3 | Wire.LENGTH) + varint(len(data)) + data
