"""A bad network between an emulator and whoever hears it: packets that are lost, late, unsteady or damaged.

One for all of them: the emulator listens at, or sends to, an address of this machine, and what it says is
passed on from there, over TCP and UDP alike; what it is told is passed on as it is. A stream loses nothing:
what is lost comes again `AGAIN` later, and everything behind it waits.
"""

from __future__ import annotations

import asyncio
import random
import socket
from collections.abc import Callable
from contextlib import AsyncExitStack, suppress
from typing import Any, NamedTuple

from seerob.app.emulation.background import LoopEmulator
from seerob.protocols.links.tcp_server import tcp_server

AGAIN = 0.2
"""After which what a stream lost is sent again [s]: as Linux does at the earliest."""
ATTEMPTS = 20
"""Of a number that is free by TCP: by UDP somebody may have it."""
LARGEST = 1 << 16
"""Most that is passed on at once [byte]."""


class Faults(NamedTuple):
    """What happens on the way."""

    drop: float = 0.0
    """Share of packets that are lost."""
    delay: float = 0.0
    """By which all come late [s]."""
    jitter: float = 0.0
    """By up to which each comes later [s]."""
    garble: float = 0.0
    """Share of packets in which a bit is flipped."""
    seed: int = 1

    @property
    def any(self) -> bool:
        """Whether anything happens."""
        return any(self[:4])


class FaultyWire(LoopEmulator):
    """Passes on what comes to an address.

    Args:
        faults: What happens on the way.
        at: Address and port that it listens on; port 0 is any free one.
        to: Where it is passed on to.
        device_listens: Whether the device is at ``to``; else it is the one who comes to ``at``.
    """

    def __init__(
        self, faults: Faults, *, at: tuple[str, int], to: tuple[str, int], device_listens: bool
    ) -> None:
        super().__init__()
        self.host, self.port = at
        self.to = to
        self._faults, self.device_listens = faults, device_listens
        self._random = random.Random(faults.seed)  # noqa: S311 - no secret

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Pass on until it is over."""
        async with AsyncExitStack() as both:
            self.port = await self._listen(both)
            ready()
            await over.wait()

    async def _listen(self, both: AsyncExitStack) -> int:
        """By TCP and by UDP, at one number.

        Raises:
            OSError: One of them is taken.
        """
        loop = asyncio.get_running_loop()
        for left in reversed(range(1 if self.port else ATTEMPTS)):
            async with AsyncExitStack() as own:
                server = await own.enter_async_context(tcp_server(self._join, self.host, self.port))
                port: int = server.sockets[0].getsockname()[1]
                try:
                    near = await loop.create_datagram_endpoint(
                        lambda: _Ends(self), local_addr=(self.host, port), family=socket.AF_UNSPEC
                    )
                except OSError:
                    if left:
                        continue
                    raise
                own.callback(near[0].close)
                both.push_async_exit(own.pop_all())
                return port
        raise AssertionError

    def late(self) -> tuple[bool, float]:
        """Whether the next packet is lost, and how late it is [s]."""
        chance = self._random
        lost = chance.random() < self._faults.drop
        return lost, self._faults.delay + chance.uniform(0.0, self._faults.jitter)

    def damaged(self, data: bytes) -> bytes:
        """The packet as it arrives."""
        if not data or self._random.random() >= self._faults.garble:
            return data
        at = self._random.randrange(len(data))
        return data[:at] + bytes([data[at] ^ 1 << self._random.randrange(8)]) + data[at + 1 :]

    async def _join(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            there, back = await asyncio.open_connection(*self.to)
        except OSError:
            writer.transport.abort()
            return
        try:
            ways = (
                self._carry(reader, back, said=not self.device_listens),
                self._carry(there, writer, said=self.device_listens),
            )
            tasks = [asyncio.ensure_future(way) for way in ways]
            try:
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
        except asyncio.CancelledError:
            pass  # the wire ends
        finally:
            for each in (writer, back):
                each.transport.abort()

    async def _carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, *, said: bool) -> None:
        """Pass a stream on, in its order."""
        waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()
        loop = asyncio.get_running_loop()

        async def read() -> None:
            last = 0.0
            with suppress(OSError):  # who breaks off has ended, too
                while data := await reader.read(LARGEST):
                    due = loop.time()
                    if said:
                        lost, late = self.late()
                        due = last = max(last, due + late + AGAIN * lost)
                        data = self.damaged(data)
                    waiting.put_nowait((due, data))
            waiting.put_nowait((last, b""))

        task = asyncio.ensure_future(read())
        try:
            while True:
                due, data = await waiting.get()
                await asyncio.sleep(max(0.0, due - loop.time()))
                if not data:
                    return
                writer.write(data)
                with suppress(OSError):
                    await writer.drain()
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


class _Ends(asyncio.DatagramProtocol):
    """Datagrams of whoever comes to the wire; answers go back to who came last."""

    def __init__(self, wire: FaultyWire) -> None:
        self._wire = wire
        self._near: Any = None
        self._far = socket.socket(_family(wire.to), socket.SOCK_DGRAM)
        self._far.setblocking(False)
        self._came: Any = None

    def connection_made(self, transport: Any) -> None:
        """Listen to answers, too."""
        self._near = transport
        self._far.connect(self._wire.to)
        asyncio.get_running_loop().add_reader(self._far, self._answered)

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        with suppress(RuntimeError, ValueError):
            asyncio.get_running_loop().remove_reader(self._far)
        self._far.close()

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Pass it on."""
        self._came = addr
        self._pass(data, self._onward, said=not self._wire.device_listens)

    def _answered(self) -> None:
        with suppress(OSError):
            data = self._far.recv(LARGEST)
            if self._came is not None:
                came = self._came
                self._pass(data, lambda d: self._near.sendto(d, came), said=self._wire.device_listens)

    def _onward(self, data: bytes) -> None:
        with suppress(OSError):  # nobody listens yet
            self._far.send(data)

    def _pass(self, data: bytes, send: Callable[[bytes], object], *, said: bool) -> None:
        if not said:
            send(data)
            return
        lost, late = self._wire.late()
        if not lost:
            asyncio.get_running_loop().call_later(late, send, self._wire.damaged(data))


def _family(to: tuple[str, int]) -> socket.AddressFamily:
    return socket.getaddrinfo(*to, type=socket.SOCK_DGRAM)[0][0]
