"""Reads on through a payload of little-endian numbers and zero-terminated names, and never past its end."""

from __future__ import annotations

import struct

import numpy as np

from seerob.core.transforms import Array
from seerob.protocols import ProtocolError


class Cursor:
    """Where one is in a payload.

    Args:
        data: The payload.
        what: Whose, for messages.
        longest: Of a name [byte].
    """

    def __init__(self, data: bytes, what: str, *, longest: int = 256) -> None:
        self._data, self._what, self._longest = data, what, longest
        self.at = 0
        """Bytes read so far."""

    @property
    def left(self) -> int:
        """Bytes that follow."""
        return len(self._data) - self.at

    def skip(self, size: int) -> None:
        """Leave bytes out.

        Raises:
            ProtocolError: There are not so many.
        """
        if not 0 <= size <= self.left:
            raise ProtocolError(f"{self._what}: {size} bytes to skip, {self.left} are left")
        self.at += size

    def take(self, layout: struct.Struct) -> tuple[int | float, ...]:
        """The next numbers.

        Raises:
            ProtocolError: It ends before.
        """
        self.skip(layout.size)
        return layout.unpack_from(self._data, self.at - layout.size)

    def whole(self) -> int:
        """A signed integer of 32 bits."""
        return int(self.take(_I32)[0])

    def short(self) -> int:
        """An unsigned integer of 16 bits."""
        return int(self.take(_U16)[0])

    def floats(self, count: int) -> Array:
        """Numbers of 32 bits, shape (count,)."""
        self.skip(4 * count)
        # For a few numbers faster than numpy's own, and quiet about a signalling NaN.
        return np.array(struct.unpack_from(f"<{count}f", self._data, self.at - 4 * count))

    def count(self, smallest: int, most: int) -> int:
        """How many items follow.

        Args:
            smallest: Bytes that each has at least.
            most: There are never more.

        Raises:
            ProtocolError: They cannot be there.
        """
        count = self.whole()
        if not 0 <= count <= most or count * smallest > self.left:
            raise ProtocolError(f"{self._what}: {count} items do not fit")
        return count

    def name(self) -> str:
        """Text up to a zero.

        Raises:
            ProtocolError: There is none, or it is too long.
        """
        end = self._data.find(b"\0", self.at, self.at + self._longest)
        if end < 0:
            raise ProtocolError(f"{self._what}: a name without an end, or of more than {self._longest} bytes")
        text = self._data[self.at : end].decode("utf-8", "replace")
        self.at = end + 1
        return text


_I32, _U16 = struct.Struct("<i"), struct.Struct("<H")
