"""A small program that sends messages at a steady rate, over datagrams or to whoever connects."""

from __future__ import annotations

import asyncio
import random
import socket
import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from seerob.app.emulation.background import LoopEmulator
from seerob.protocols.links.tcp_server import stop_accepting

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection

LATE = 0.5
"""Time that is not made up for when this machine was too slow [s]."""

Way = Callable[[bytes], Sequence[bytes]]
"""What a network does to a message: loses, doubles, damages it."""


class MessageSender(LoopEmulator):
    """The sender, in a thread of its own.

    Args:
        to: Address and port that datagrams go to; None for a WebSocket that others connect to.
        host: Own address to listen on, with a WebSocket.
        port: Own port to listen on, with a WebSocket; 0 is any free one.
        rate: Messages per second [Hz].
        way: What happens to each message on the way.
    """

    def __init__(
        self,
        *,
        to: tuple[str, int] | None,
        host: str = "127.0.0.1",
        port: int = 0,
        rate: float,
        way: Way | None = None,
    ) -> None:
        super().__init__()
        self.to, self.host, self.port, self.rate, self.way = to, host, port, rate, way
        self.sent = 0
        """Messages so far."""
        self.phase = 0.0
        """Of its clock [s]: one that starts again says nothing that it said before to the last bit."""

    def t(self, k: int) -> float:
        """When the message number ``k`` is, on the sender's own clock [s]."""
        return self.phase + k / self.rate

    def message(self, k: int) -> bytes:
        """The message number ``k``."""
        raise NotImplementedError

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Send to whom it is told to, or listen for whoever wants to hear.

        Raises:
            OSError: The address cannot be listened on, or is none.
        """
        self.phase = random.uniform(0.0, 0.25 / self.rate)  # noqa: S311 - no secret
        if self.to is not None:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
                link.setblocking(False)
                link.connect(self.to)

                async def send(data: bytes) -> None:
                    # Nobody listens yet, or the network is busy: a sender does not mind.
                    with suppress(ConnectionRefusedError, BlockingIOError):
                        link.send(data)

                ready()
                await self._until(over, self._play(send))
            return
        from websockets.asyncio.server import serve

        listening = serve(self._speak, self.host, self.port, compression=None, close_timeout=0.2)
        async with listening as server:
            self.port = next(iter(server.sockets)).getsockname()[1]
            ready()
            await over.wait()
            await stop_accepting(server.server)

    async def _until(self, over: asyncio.Event, work: Awaitable[None]) -> None:
        task, ended = asyncio.ensure_future(work), asyncio.ensure_future(over.wait())
        try:
            await asyncio.wait({task, ended}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for each in (task, ended):
                each.cancel()
            await asyncio.gather(task, ended, return_exceptions=True)

    async def _speak(self, connection: ServerConnection) -> None:
        """Until whoever listens has gone."""
        await self._play(lambda data: connection.send(data, text=True))

    async def _play(self, send: Callable[[bytes], Awaitable[None]]) -> None:
        from websockets.exceptions import ConnectionClosed

        begun, k = time.monotonic(), 0
        while True:
            await asyncio.sleep(max(0.0, begun + k / self.rate - time.monotonic()))
            message = self.message(k)
            try:
                for data in (message,) if self.way is None else self.way(message):
                    await send(data)
            except (OSError, ConnectionClosed):
                return
            self.sent += 1
            late = time.monotonic() - begun - k / self.rate
            k += 1 + (int(late * self.rate) if late > LATE else 0)
