"""The connections themselves, HTTP and WebSocket: those that uvicorn leaves open are cut, and counted.

uvicorn waits for the first request without end and takes every connection. Whoever can reach the port, with
the token or without, could so take every file descriptor of the process, and no source that was lost could
connect again. Where TLS is spoken, they are counted before it begins.
"""

from __future__ import annotations

import asyncio
import socket
import struct
from collections.abc import Callable
from typing import Any, cast
from weakref import WeakSet

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.protocol import State

from seerob.app.server.access import neighbourhood
from seerob.app.server.allowance import Allowance, Allowances
from seerob.core.host_name import is_loopback

MOST_CONNECTIONS = 400
"""Of pages and their WebSockets together; processes commonly have 1024 files."""
PROMPTNESS = 10.0
"""How long a connection may be open, or open again after an answer, without a whole request [s]."""
MOST_OF_ONE = 100
"""Connections of one address of another machine."""
CONNECTIONS = 200.0, 600.0
"""That one address may begin per second, and at once."""
AT_ONCE = 64
"""Connections that are closed before others in the loop have their turn."""
PIECE = 1024
"""Bytes of one page that are read at once."""
HANDSHAKE = 5.0
"""How long the beginning of TLS may take [s]."""
PINGS = 5.0, 20.0
"""That one page may send per second, and at once."""


class Doorstep(socket.socket):
    """A listening socket that closes at once who is one too many."""

    most = MOST_CONNECTIONS
    most_of_one = MOST_OF_ONE

    def __init__(self, listening: socket.socket) -> None:
        """Take over a socket that listens."""
        self._open: WeakSet[socket.socket] = WeakSet()
        self._allowances = Allowances(*CONNECTIONS)
        # With its protocol: asyncio sends at once (TCP_NODELAY) only where it is named.
        super().__init__(listening.family, listening.type, socket.IPPROTO_TCP, listening.detach())

    def accept(self) -> tuple[socket.socket, object]:
        """Accept somebody.

        Raises:
            BlockingIOError: Nobody waits, or who did was one too many.
        """
        for _ in range(AT_ONCE):
            connection, address = super().accept()
            who = neighbourhood(str(address[0]))
            allowance = self._allowances.of(who)
            if not allowance.wait() and self._has_room(who):
                allowance.take()
                self._open.add(connection)
                return connection, address
            connection.close()
        raise BlockingIOError

    def _has_room(self, who: str) -> bool:
        held = [other for other in self._open if other.fileno() >= 0]
        of_one = 0 if is_loopback(who) else sum(_whose(other) == who for other in held)
        self._open = WeakSet(held)
        return len(held) < self.most and of_one < self.most_of_one


def _whose(connection: socket.socket) -> str:
    try:
        return neighbourhood(str(connection.getpeername()[0]))
    except OSError:  # gone already
        return ""


class PromptLoop(asyncio.SelectorEventLoop):
    """A loop whose servers do not wait long for the beginning of TLS."""

    async def create_server(self, *arguments: Any, **options: Any) -> asyncio.Server:
        """Create one."""
        if options.get("ssl") is not None:
            options.setdefault("ssl_handshake_timeout", HANDSHAKE)
        return await super().create_server(*arguments, **options)


class PromptRequests(H11Protocol):
    """Cuts who takes too long to say what they want."""

    promptness = PROMPTNESS
    _deadline: asyncio.TimerHandle | None = None

    def connection_made(  # type: ignore[override]  # uvicorn narrows the transport likewise
        self, transport: asyncio.Transport
    ) -> None:
        """Begin to wait for a request."""
        super().connection_made(transport)
        self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        super().connection_lost(exc)
        self._wait_no_longer()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Leave the connection to the WebSocket."""
        self._wait_no_longer()
        super().handle_websocket_upgrade(event)

    def on_response_complete(self) -> None:
        """Begin to wait for the next request."""
        super().on_response_complete()
        self._wait()

    def _wait(self) -> None:
        self._wait_no_longer()
        self._deadline = self.loop.call_later(self.promptness, self._cut)

    def _wait_no_longer(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _cut(self) -> None:
        if self.cycle is None or self.cycle.response_complete:
            self.transport.abort()


def header(length: int) -> bytes:
    """Of a whole binary message that is not masked (RFC 6455 5.2)."""
    if length < 126:
        return bytes((0x82, length))
    return (
        struct.pack(">BBH", 0x82, 126, length) if length < 1 << 16 else struct.pack(">BBQ", 0x82, 127, length)
    )


AHEAD = 2
"""Messages that wait to be taken, from which on no more are read."""


class WholeBinaryFrames(WebSocketsSansIOProtocol):
    """Takes whole binary messages only, and gives up on a peer that no longer reads.

    A command fits in one small frame. Text and fragments have no use here, and uvicorn would put an
    exception in the log for text that is not UTF-8 and keep empty fragments without end.
    """

    on_read: Callable[[], None] = staticmethod(lambda: None)
    """Is called when the peer has read what was too much."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Let the application write, and cut the connection: a polite close waits for who does not read."""
        super().connection_made(transport)
        self._abort = cast(asyncio.Transport, transport).abort
        self.app_state = {**self.app_state, "abort": self._abort, "line": self}
        self._pings = Allowance(*PINGS)
        self._held = False
        self._unread = bytearray()

    def data_received(self, data: bytes) -> None:
        """Read a little at a time: a quarter of a megabyte of small frames would hold everybody up."""
        self._unread += data
        self._read_on()

    def _read_on(self) -> None:
        while self._unread and not (self._held or self.read_paused or self.transport.is_closing()):
            piece = bytes(self._unread[:PIECE])
            del self._unread[:PIECE]
            super().data_received(piece)
        if self._held or self.read_paused:
            self.transport.pause_reading()
        else:
            self.transport.resume_reading()

    def handle_ping(self) -> None:
        """Answer, and read no faster than pings may come: nothing else bounds that."""
        super().handle_ping()
        if (wait := self._pings.take()) and not self._held:
            self._held = True
            self.loop.call_later(wait, self._let_go)

    def _let_go(self) -> None:
        self._held = False
        self._read_on()

    @property
    def reads(self) -> bool:
        """Whether the peer has read so much that more may be written."""
        return self.writable.is_set()

    def write(self, messages: list[bytes]) -> None:
        """Write whole binary messages at once, without waiting.

        What a server sends is not masked, so that a frame is its header and the message (RFC 6455 5.2).
        """
        if self.conn.state is State.OPEN and not (self.close_sent or self.disconnected):
            self.transport.write(b"".join([p for m in messages for p in (header(len(m)), m)]))

    def resume_writing(self) -> None:
        """The peer has read."""
        super().resume_writing()
        self.on_read()

    async def send(self, message: Any) -> None:
        """Send; who was refused has been answered, too, which is no error for the log."""
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body", False):
            self.handshake_complete = True

    async def receive(self) -> Any:
        """Give what came to the application, which makes it read on."""
        message = await super().receive()
        if self._unread or self._held:
            self._read_on()
        return message

    def handle_text(self, event: Frame) -> None:
        """Refuse text."""
        self._refuse()

    def handle_bytes(self, event: Frame) -> None:
        """Take a message that is whole."""
        if event.fin:
            # Of a peer that says one thing at a time reading is not paused: that costs more than to read it.
            few, held = self.queue.qsize() < AHEAD, self.read_paused
            self.read_paused = held or few
            super().handle_bytes(event)
            if few:
                self.read_paused = held
        else:
            self._refuse()

    def handle_cont(self, event: Frame) -> None:
        """Refuse the rest of a message that was not whole."""
        self._refuse()

    def keepalive_timeout(self) -> None:
        """Cut the connection of a peer that answers no ping."""
        super().keepalive_timeout()
        self._abort()

    def _refuse(self) -> None:
        if self.close_sent or self.conn.state is not State.OPEN:
            return
        reason = "whole binary messages only"
        self.conn.send_close(1003, reason)
        self.transport.write(b"".join(self.conn.data_to_send()))
        self.close_sent = True
        self.queue.put_nowait({"type": "websocket.disconnect", "code": 1003, "reason": reason})
        # Not closed at once: data that arrives at a closed socket resets the connection, and the
        # peer would never read why.
        self.close_timer = self.loop.call_later(2.0, self._abort)
