"""Messages of a small program beside a device, as they arrive: by datagrams, or over a WebSocket."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from typing import Generic, Protocol, TypeVar

from seerob.protocols import ProtocolError
from seerob.protocols.links.datagrams import distrust, listening

MAX_MESSAGE = 1 << 20
SILENCE = 2.0
"""Longest pause before the sender is taken for gone [s]."""
NONSENSE = 50
"""Messages in a row that cannot be read before the connection is given up."""
RESTART = 1.0
"""A device whose time goes back by more has started again [s]."""
REORDERED = 0.25
"""What is older than the newest by more was not overtaken on the way [s]: it is played again, or of two."""
CONNECT_WITHIN = 2.0
"""[s]"""


class Timed(Protocol):
    """What a message says of one instant."""

    @property
    def t(self) -> float:
        """On the device's clock [s]."""


T = TypeVar("T", bound=Timed)


class Sieve(Generic[T]):
    """Lets through what is newer, and gives up when nothing can be understood.

    Args:
        decode: Reads a message, or raises `ProtocolError`.
        what: The device, for messages.
    """

    def __init__(self, decode: Callable[[bytes | str], T], what: str) -> None:
        self._decode, self._what = decode, what
        self._last = -1.0
        self._nonsense = 0

    def take(self, data: bytes | str) -> T | None:
        """What a message says; None when it is late, doubled or cannot be read.

        Raises:
            ProtocolError: Too much nonsense in a row, or a clock that has gone back.
        """
        try:
            said = self._decode(data)
        except ProtocolError:
            self._nonsense += 1
            if self._nonsense >= NONSENSE:
                raise
            return None
        self._nonsense = 0
        if said.t < self._last - RESTART:
            raise ProtocolError(f"{self._what} has started again")
        if said.t < self._last - REORDERED:
            old = f"says again what is {self._last - said.t:.2f} s old"
            distrust(f"{self._what} {old}: played again, or of two senders")
        if said.t <= self._last:
            return None
        self._last = said.t
        return said


async def from_datagrams(
    sieve: Sieve[T], bind: str, port: int, sender: str | None, silence: float = SILENCE
) -> AsyncGenerator[tuple[float, T], None]:
    """What somebody sends to this machine, each newer than the one before.

    Args:
        sieve: Reads the messages.
        bind: Own address to listen on.
        port: 0 is any free one.
        sender: Address whose messages count; of whoever sends first when None.
        silence: Longest pause [s].

    Yields:
        Host's monotonic time of arrival [s], and what was said.

    Raises:
        OSError: The port is taken.
        TimeoutError: Nothing for so long.
        ProtocolError: Only nonsense, or a device that has started again.
    """
    async with (
        listening(bind, port, sender=sender) as datagrams,
        aclosing(datagrams.receive(silence)) as heard,
    ):
        async for datagram in heard:
            said = sieve.take(datagram.data)
            if said is not None:
                yield datagram.arrived, said


async def from_websocket(
    sieve: Sieve[T], host: str, port: int, silence: float = SILENCE
) -> AsyncGenerator[tuple[float, T], None]:
    """What comes over a connection to the sender; of what waits, only the newest counts.

    Args:
        sieve: Reads the messages.
        host: Name or address of the PC with the device.
        port: Of its sender.
        silence: Longest pause [s].

    Yields:
        Host's monotonic time of arrival [s], and what was said.

    Raises:
        OSError: There is no connection, or no longer.
        TimeoutError: Nothing for so long.
        ProtocolError: Only nonsense, no WebSocket, or a device that has started again.
    """
    from websockets.asyncio.client import connect
    from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI

    shown = f"[{host}]" if ":" in host else host
    waiting, over = deque[tuple[float, bytes | str]](maxlen=1), asyncio.Event()
    try:
        async with (
            asyncio.timeout(None) as patience,
            connect(
                f"ws://{shown}:{port}/",
                max_size=MAX_MESSAGE,
                open_timeout=CONNECT_WITHIN,
                close_timeout=0.2,
                compression=None,
                proxy=None,
            ) as socket,
        ):

            async def listen() -> None:
                try:
                    async for message in socket:
                        waiting.append((time.monotonic(), message))
                        over.set()
                finally:
                    over.set()

            task = asyncio.create_task(listen())
            try:
                while True:
                    patience.reschedule(asyncio.get_running_loop().time() + silence)
                    await over.wait()
                    over.clear()
                    while waiting:
                        arrived, data = waiting.popleft()
                        said = sieve.take(data)
                        if said is not None:
                            patience.reschedule(None)
                            yield arrived, said
                    if task.done():
                        task.result()
                        return
            finally:
                task.cancel()
    except (InvalidHandshake, InvalidURI) as error:
        raise ProtocolError(f"no WebSocket of ours answers at {host}:{port}: {error}") from error
    except ConnectionClosed as error:
        raise ProtocolError(f"the sender closed the connection: {error}") from error
    except TimeoutError as error:
        raise TimeoutError(f"connected, but silent for {silence:g} s") from error
