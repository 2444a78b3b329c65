"""Datagrams (UDP) that others send to this machine: received, time-stamped, bounded, and answered at once."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import time
from collections import deque
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from contextvars import ContextVar
from typing import Any, NamedTuple

from seerob.protocols.links.reception import Reception, Wakeup

WAITING = 512
"""Datagrams that wait for whoever reads; after that the oldest is dropped."""
LARGEST = 1 << 16
"""More than any datagram has [B]."""


class Datagram(NamedTuple):
    """What arrived."""

    arrived: float
    """Host's monotonic time [s]: when the kernel received it, where the platform says so."""
    data: bytes


Address = tuple[str | Any, int] | tuple[str, int, int, int]
"""Of a socket, as asyncio says it: host, port and, of IPv6, flow and scope."""
Answer = Callable[[bytes], bytes | None]
"""What is sent back to whoever sent a datagram; None for nothing."""


DISTRUST: ContextVar[Callable[[str], None]] = ContextVar("distrust")
"""Is told, by whoever listens, why what is heard may not be from whom it seems to be."""


HEARD: ContextVar[dict[int, str]] = ContextVar("heard")
"""Port → address that was heard there before a silence, for whoever listens for as long as a run."""


def distrust(reason: str) -> None:
    """Say why what is heard may not be from whom it seems to be."""
    if (callback := DISTRUST.get(None)) is not None:
        callback(reason)


class Datagrams(asyncio.DatagramProtocol):
    """What arrives at one port from the first who sends there, address and port; who else sends is told.

    After a silence it is the first from that address, whatever port it has then, as after a restart.

    Args:
        senders: Addresses whose datagrams count; None where it is whoever sends first.
        answer: What is sent back.
        one_port: Whether all of a sender's datagrams come from one port of it.
        before: Who was heard at which port before a silence.
        beside: Who reads what arrives here, too.

    Attributes:
        port: Of this machine.
        dropped: Datagrams that nobody read in time.
        strangers: Datagrams from others than the one who is listened to.
    """

    def __init__(
        self,
        senders: frozenset[str] | None,
        answer: Answer | None,
        *,
        one_port: bool = True,
        before: dict[int, str] | None = None,
        beside: Datagrams | None = None,
    ) -> None:
        self._reader = beside or self
        self._senders, self._answer, self._one_port = senders, answer, one_port
        self._before = {} if before is None else before
        self._first: tuple[str, int] | None = None
        self._loop = asyncio.get_running_loop()
        self._waiting: deque[Datagram] = deque(maxlen=WAITING)
        self._wakeup = Wakeup()
        self._error: OSError | None = None
        self._send: Callable[[bytes, Address], object] = lambda data, to: None
        self.port = 0
        self.dropped = self.strangers = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by the loop."""
        if isinstance(transport, asyncio.DatagramTransport):
            self._send = transport.sendto
        self.port = transport.get_extra_info("sockname")[1]

    def attach(self, link: socket.socket) -> Callable[[], None]:
        """Call back for a loop that says when the socket can be read."""
        reception = Reception(link)
        self.port = link.getsockname()[1]

        def send(data: bytes, to: Address) -> None:
            # An answer that cannot be delivered, or not now, is no reason to stop listening.
            with contextlib.suppress(OSError):
                link.sendto(data, to)

        def read() -> None:
            # One at a time, whoever waits for it has it first: the loop calls again while there are more.
            try:
                arrived, data, sender = reception.read(LARGEST)
            except OSError:  # all was read, or an answer was refused
                return
            self._take(arrived, data, sender)

        self._send = send
        return read

    def datagram_received(self, data: bytes, addr: Address) -> None:
        """Called by the loop."""
        self._take(time.monotonic(), data, addr)

    def _take(self, arrived: float, data: bytes, sender: Address) -> None:
        who = plain(sender[0]), int(sender[1]) if self._one_port else 0
        if self._first is None and self._may(who[0]):
            self._first, self._before[self.port] = who, who[0]
        if who != self._first:
            self.strangers += 1
            heard = _shown(self._first) if self._first else self._before.get(self.port, "nobody yet")
            distrust(f"{_shown(who)} sends to port {self.port}, too; heard is {heard}")
            return
        reader = self._reader
        reader.dropped += len(reader._waiting) == WAITING
        reader._waiting.append(Datagram(arrived, data))
        reader._wakeup.wake()
        if self._answer is not None:
            self._loop.call_soon(self._reply, data, sender)

    def _may(self, address: str) -> bool:
        """Whether it may be the first: of those who are named, else who was heard before."""
        if self._senders is None:
            return address == self._before.get(self.port, address)
        return address in self._senders

    def _reply(self, data: bytes, sender: Address) -> None:
        if self._answer is not None and (reply := self._answer(data)) is not None:
            self._send(reply, sender)

    def send(self, data: bytes, to: tuple[str, int]) -> None:
        """Send a datagram from this port."""
        self._send(data, to)

    def error_received(self, exc: Exception) -> None:
        """Called by the loop: an answer could not be delivered, which is no reason to stop listening."""

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by the loop."""
        self._reader._error = exc if isinstance(exc, OSError) else OSError("closed")
        self._reader._wakeup.wake()

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
            self._check()
            try:
                await self._wakeup.wait(silence)
            except TimeoutError as error:
                await self._look_again(silence, error)

    async def next(self, silence: float) -> Datagram:
        """The oldest that waits, or else the next one.

        Args:
            silence: Longest pause [s].

        Raises:
            TimeoutError: Nothing for so long.
            OSError: The socket is gone.
        """
        while not self._waiting:
            self._check()
            try:
                await self._wakeup.wait(silence)
            except TimeoutError as error:
                await self._look_again(silence, error)
        return self._waiting.popleft()

    def _check(self) -> None:
        if self._error is not None:
            raise self._error

    async def _look_again(self, silence: float, error: TimeoutError) -> None:
        # On a busy machine this thread may have slept, with data waiting: the loop looks twice.
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        if not self._waiting:
            raise TimeoutError(f"nothing sent to port {self.port} for {silence:g} s") from error


def _shown(who: tuple[str, int]) -> str:
    return f"{who[0]} port {who[1]}" if who[1] else who[0]


def plain(address: object) -> str:
    """An address as its sender calls it: IPv4 looks otherwise through a socket of IPv6."""
    return str(address).lower().removeprefix("::ffff:")


@asynccontextmanager
async def listening(
    bind: str,
    port: int,
    *,
    sender: str | None = None,
    answer: Answer | None = None,
    group: str | None = None,
    one_port: bool = True,
    beside: Datagrams | None = None,
) -> AsyncGenerator[Datagrams, None]:
    """Listen on a port of this machine.

    Args:
        bind: Own address to listen on.
        port: 0 is any free one.
        sender: Name or address of whose datagrams count; of whoever sends first when None.
        answer: Asked at once for each datagram that counts; must not raise.
        group: Multicast group to join, on the interface that has the address ``bind``.
        one_port: Whether all of a sender's datagrams come from one port of it.
        beside: Who reads what arrives here, too.

    Raises:
        OSError: The port is taken, the address is not of this machine, or nobody knows the sender's name.
    """
    loop = asyncio.get_running_loop()
    senders: frozenset[str] | None = None
    if sender is not None:
        known = await loop.getaddrinfo(sender, None, type=socket.SOCK_DGRAM)
        senders = frozenset(plain(address[0]) for *_, address in known)
    (found, *_) = await loop.getaddrinfo(bind, port, type=socket.SOCK_DGRAM)
    link = _bound(found[0], found[4]) if group is None else _member(bind, port, group)
    heard = Datagrams(senders, answer, one_port=one_port, before=HEARD.get(None), beside=beside)
    try:
        loop.add_reader(link, heard.attach(link))
    except NotImplementedError:  # a loop of Windows
        transport, _ = await loop.create_datagram_endpoint(lambda: heard, sock=link)
        leave: Callable[[], object] = transport.abort
    else:

        def leave() -> None:
            loop.remove_reader(link)
            link.close()

    try:
        yield heard
    finally:
        leave()


def _bound(family: int, address: Address | tuple[int, bytes]) -> socket.socket:
    """A socket with an address of this machine."""
    link = socket.socket(family, socket.SOCK_DGRAM)
    try:
        link.bind(address)
        link.setblocking(False)
    except OSError:
        link.close()
        raise
    return link


def _member(bind: str, port: int, group: str) -> socket.socket:
    """A socket that hears a multicast group, beside others on this machine that do."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        link.bind(("", port))
        membership = socket.inet_aton(group) + socket.inet_aton(bind)
        link.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        link.setblocking(False)
    except OSError:
        link.close()
        raise
    return link
