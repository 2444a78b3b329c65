"""A connection (TCP) to a device whose bytes are stamped as they arrive, for clients that mostly listen."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager

from seerob.protocols.reception import Received, Reception


class Connection:
    """One that is made.

    Args:
        link: The connected socket, which does not block.
    """

    def __init__(self, link: socket.socket) -> None:
        self._link, self._reception = link, Reception(link)
        self._loop = asyncio.get_running_loop()

    async def write(self, data: bytes) -> None:
        """Send.

        Raises:
            OSError: The other end is gone.
        """
        await self._loop.sock_sendall(self._link, data)

    async def read(self, size: int, patience: float) -> Received:
        """What has come; no bytes when the other end has closed.

        Args:
            size: Most bytes at once.
            patience: Longest pause [s].

        Raises:
            TimeoutError: Nothing for so long.
            OSError: The other end is gone.
        """
        try:
            return self._reception.read(size)
        except BlockingIOError:
            pass
        try:
            async with asyncio.timeout(patience):
                data = await self._readable(size)
        except TimeoutError:
            data = None  # on a busy machine this thread may have slept, with data waiting: look again
        if data is not None:
            return Received(time.monotonic(), data, None)
        try:
            return self._reception.read(size)
        except BlockingIOError as error:
            raise TimeoutError(f"connected, but silent for {patience:g} s") from error

    async def _readable(self, size: int) -> bytes | None:
        """Wait until something can be read; what was, with a loop that does not say when."""
        readable: asyncio.Future[None] = self._loop.create_future()
        try:
            self._loop.add_reader(self._link, _resolve, readable)
        except NotImplementedError:  # a loop of Windows
            return await self._loop.sock_recv(self._link, size)
        try:
            await readable
        finally:
            self._loop.remove_reader(self._link)
        return None


def _resolve(readable: asyncio.Future[None]) -> None:
    if not readable.done():
        readable.set_result(None)


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
    try:
        yield Connection(link)
    finally:
        link.close()


async def _link(host: str, port: int) -> socket.socket:
    loop = asyncio.get_running_loop()
    refused: OSError = OSError(f"{host} has no address")
    for family, kind, _, _, address in await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM):
        link = socket.socket(family, kind)
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
