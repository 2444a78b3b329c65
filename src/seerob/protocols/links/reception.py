"""When bytes arrived, as the kernel says: whoever reads them late does not make them look late.

Linux stamps each packet as it comes in (``SO_TIMESTAMPNS``, socket(7)), datagrams and streams alike. Its
stamps are of the wall clock, which may be set while a packet waits; they are put on the monotonic clock and
never before an instant at which nothing was waiting, nor after that of reading. Elsewhere, what arrived
is stamped when it is read.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import sys
import time
from collections.abc import Iterable
from typing import Any, NamedTuple

_NANOSECONDS = getattr(socket, "SO_TIMESTAMPNS", 35) if sys.platform == "linux" else None
"""Option, and kind of message; Python names it from 3.14 on, the number is that of most architectures."""
_TIMESPEC = struct.Struct("@ll")
_ROOM = socket.CMSG_SPACE(_TIMESPEC.size) if hasattr(socket, "CMSG_SPACE") else 0


class Received(NamedTuple):
    """What was read from a socket."""

    arrived: float
    """Host's monotonic time [s]; of a stream, when the newest of the bytes did."""
    data: bytes
    sender: Any
    """Address of a datagram's sender."""


class Reception:
    """Reads a socket that does not block.

    Args:
        link: The socket.
    """

    def __init__(self, link: socket.socket) -> None:
        self._link = link
        self._stream = link.type == socket.SOCK_STREAM
        self._empty = time.monotonic()
        """Nothing that is read from now on arrived before this [s]."""
        if _NANOSECONDS is not None:
            with contextlib.suppress(OSError):
                link.setsockopt(socket.SOL_SOCKET, _NANOSECONDS, 1)

    def read(self, size: int) -> Received:
        """Read a datagram, or what is there of a stream; no bytes when a stream has ended.

        Args:
            size: Largest number of bytes.

        Raises:
            BlockingIOError: Nothing is there.
            OSError: The other end is gone.
        """
        before = time.monotonic()
        try:
            if not _ROOM:
                data, sender = self._link.recvfrom(size)
                return Received(time.monotonic(), data, sender)
            data, said, _, sender = self._link.recvmsg(size, _ROOM)
        except BlockingIOError:
            self._empty = before
            raise
        now = time.monotonic()
        arrived = instant(stamp(said), now=now, wall=time.time_ns(), empty=self._empty)
        if self._stream and len(data) < size:
            self._empty = before  # nothing of it was left
        return Received(arrived, data, sender)


def stamp(said: Iterable[tuple[int, int, bytes]]) -> int | None:
    """The kernel's time stamp among the ancillary data of a packet: wall clock [ns]; None without one."""
    for level, kind, data in said:
        if level == socket.SOL_SOCKET and kind == _NANOSECONDS and len(data) == _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack(data)
            return int(seconds) * 1_000_000_000 + int(nanoseconds)
    return None


def instant(stamped: int | None, *, now: float, wall: int, empty: float) -> float:
    """When a packet arrived, on the monotonic clock [s].

    Args:
        stamped: The kernel's time stamp, wall clock [ns].
        now: Monotonic time of reading [s].
        wall: Wall clock then [ns].
        empty: An instant at which it had not arrived [s].
    """
    if stamped is None:
        return now
    return min(max(now - 1e-9 * (wall - stamped), empty), now)
