"""A connection (TCP) to a device whose bytes are stamped as they arrive, for clients that mostly listen."""

from __future__ import annotations

import asyncio
import socket
import time
from collections import deque
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager

from seerob.protocols.links.reception import Received, Reception, Wakeup

CHUNK = 1 << 16
"""Read at once [byte]."""
MOST = 1 << 20
"""Bytes that wait for whoever reads; after that the other end waits."""


class Connection:
    """One that is made.

    It is read as soon as something comes, in one system call: after each a thread has to wait for the
    interpreter's lock anew, which another one holds that computes.

    Args:
        link: The connected socket, which does not block.
    """

    def __init__(self, link: socket.socket) -> None:
        self._link, self._reception = link, Reception(link)
        self._loop = asyncio.get_running_loop()
        self._waiting: deque[Received] = deque()
        self._bytes = 0
        self._wakeup = Wakeup()
        self._error: OSError | None = None
        self._ended = self._listens = False
        self._tells = True
        """Whether the loop says when there is something to read; that of Windows does not."""
        self._listen()

    async def write(self, data: bytes) -> None:
        """Send.

        Raises:
            OSError: The other end is gone.
        """
        await self._loop.sock_sendall(self._link, data)

    async def read(self, patience: float) -> Received:
        """What has come; no bytes when the other end has closed.

        Args:
            patience: Longest pause [s].

        Raises:
            TimeoutError: Nothing for so long.
            OSError: The other end is gone.
        """
        if not self._waiting and not self._ended:
            try:
                await self._more(patience)
            except TimeoutError as error:
                # On a busy machine this thread may have slept, with data waiting: look again.
                self._read()
                if not self._waiting and self._error is None:
                    raise TimeoutError(f"connected, but silent for {patience:g} s") from error
        if self._waiting:
            received = self._waiting.popleft()
            self._bytes -= len(received.data)
            self._listen()
            return received
        if self._error is not None:
            raise self._error
        return Received(time.monotonic(), b"", None)

    def close(self) -> None:
        """Read no more; the socket stays."""
        self._ended = True
        self._deafen()

    async def _more(self, patience: float) -> None:
        if self._tells:
            if self._error is None:
                await self._wakeup.wait(patience)
            return
        async with asyncio.timeout(patience):
            data = await self._loop.sock_recv(self._link, CHUNK)
        self._take(Received(time.monotonic(), data, None))

    def _take(self, received: Received) -> None:
        self._waiting.append(received)
        self._bytes += len(received.data)
        self._ended = self._ended or not received.data
        self._wakeup.wake()

    def _read(self) -> None:
        try:
            self._take(self._reception.read(CHUNK))
        except BlockingIOError:
            return
        except OSError as error:
            self._error = error
            self._wakeup.wake()
        if self._ended or self._error is not None or self._bytes > MOST:
            self._deafen()

    def _listen(self) -> None:
        if self._tells and not (self._listens or self._ended or self._error or self._bytes > MOST):
            try:
                self._loop.add_reader(self._link, self._read)
            except NotImplementedError:
                self._tells = False
            else:
                self._listens = True

    def _deafen(self) -> None:
        if self._listens:
            self._loop.remove_reader(self._link)
            self._listens = False


@asynccontextmanager
async def connected(host: str, port: int, patience: float) -> AsyncGenerator[Connection, None]:
    """Connect, to the first of the host's addresses that answers.

    Args:
        host: Name or address.
        port: Of the device.
        patience: Longest time that takes [s].

    Raises:
        OSError: There is no connection.
        TimeoutError: It does not answer.
    """
    async with asyncio.timeout(patience):
        link = await _link(host, port)
    connection = Connection(link)
    try:
        yield connection
    finally:
        connection.close()
        link.close()


async def _link(host: str, port: int) -> socket.socket:
    loop = asyncio.get_running_loop()
    refused: OSError = OSError(f"{host} has no address")
    for family, kind, _, _, address in await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM):
        try:
            link = socket.socket(family, kind)
        except OSError as error:  # a family that this machine does without, IPv6 for one
            refused = error
            continue
        try:
            link.setblocking(False)
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            await loop.sock_connect(link, address)
        except OSError as error:
            link.close()
            refused = error
        except BaseException:
            link.close()
            raise
        else:
            return link
    raise refused
