"""Datagrams (UDP) that others send to this machine: received, time-stamped, bounded, and answered at once."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

WAITING = 512
"""Datagrams that wait for whoever reads; after that the oldest is dropped."""


class Datagram(NamedTuple):
    """What arrived."""

    arrived: float
    """Host's monotonic time [s]."""
    data: bytes


Answer = Callable[[bytes], bytes | None]
"""What is sent back to whoever sent a datagram; None for nothing."""


class Datagrams(asyncio.DatagramProtocol):
    """What arrives at one port.

    Attributes:
        port: Of this machine.
        dropped: Datagrams that nobody read in time.
        strangers: Datagrams from other addresses than the one that is listened to.
    """

    def __init__(self, sender: str | None, answer: Answer | None) -> None:
        self._sender, self._answer = sender, answer
        self._waiting: deque[Datagram] = deque(maxlen=WAITING)
        self._arrived = asyncio.Event()
        self._error: OSError | None = None
        self._transport: Any = None
        self.port = 0
        self.dropped = self.strangers = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by the loop."""
        self._transport = transport
        self.port = transport.get_extra_info("sockname")[1]

    def datagram_received(self, data: bytes, addr: tuple[str | Any, int]) -> None:
        """Called by the loop."""
        now = time.monotonic()
        if self._sender is not None and addr[0] != self._sender:
            self.strangers += 1
            return
        if self._answer is not None and (reply := self._answer(data)) is not None:
            self._transport.sendto(reply, addr)
        self.dropped += len(self._waiting) == WAITING
        self._waiting.append(Datagram(now, data))
        self._arrived.set()

    def error_received(self, exc: Exception) -> None:
        """Called by the loop: an answer could not be delivered, which is no reason to stop listening."""

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by the loop."""
        self._error = exc if isinstance(exc, OSError) else OSError("closed")
        self._arrived.set()

    async def receive(self, silence: float) -> AsyncGenerator[Datagram, None]:
        """What arrives, oldest first.

        Args:
            silence: Longest pause [s].

        Raises:
            TimeoutError: Nothing for so long.
            OSError: The socket is gone.
        """
        while True:
            while self._waiting:
                yield self._waiting.popleft()
            if self._error is not None:
                raise self._error
            self._arrived.clear()
            try:
                async with asyncio.timeout(silence):
                    await self._arrived.wait()
            except TimeoutError as error:
                # On a busy machine this thread may have slept, with data waiting.
                await asyncio.sleep(0)
                if not self._waiting:
                    raise TimeoutError(f"nothing sent to port {self.port} for {silence:g} s") from error


@asynccontextmanager
async def listening(
    bind: str, port: int, *, sender: str | None = None, answer: Answer | None = None
) -> AsyncGenerator[Datagrams, None]:
    """Listen on a port of this machine.

    Args:
        bind: Own address to listen on.
        port: 0 is any free one.
        sender: Address whose datagrams count; anyone's when None.
        answer: Asked at once for each datagram that counts; must not raise.

    Raises:
        OSError: The port is taken, or the address is not of this machine.
    """
    loop = asyncio.get_running_loop()
    transport, protocol = await loop.create_datagram_endpoint(
        lambda: Datagrams(sender, answer), local_addr=(bind, port)
    )
    try:
        yield protocol
    finally:
        transport.abort()
