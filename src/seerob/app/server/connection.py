"""The connections themselves, HTTP and WebSocket: those that uvicorn leaves open are cut, and counted.

uvicorn waits for the first request without end and takes every connection. Whoever can reach the port, with
the token or without, could so take every file descriptor of the process, and no source that was lost could
connect again.
"""

from __future__ import annotations

import asyncio
from typing import cast

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.protocol import State

MOST_CONNECTIONS = 400
"""Of pages and their WebSockets together; processes commonly have 1024 files."""
PROMPTNESS = 10.0
"""How long a connection may be open, or open again after an answer, without a whole request [s]."""


class PromptRequests(H11Protocol):
    """Cuts who is one too many, and who takes too long to say what they want."""

    most = MOST_CONNECTIONS
    promptness = PROMPTNESS
    _deadline: asyncio.TimerHandle | None = None

    def connection_made(  # type: ignore[override]  # uvicorn narrows the transport likewise
        self, transport: asyncio.Transport
    ) -> None:
        """Begin to wait for a request."""
        super().connection_made(transport)
        if len(self.connections) > self.most:
            transport.abort()
        else:
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


class WholeBinaryFrames(WebSocketsSansIOProtocol):
    """Takes whole binary messages only, and gives up on a peer that no longer reads.

    A command fits in one small frame. Text and fragments have no use here, and uvicorn would put an
    exception in the log for text that is not UTF-8 and keep empty fragments without end.
    """

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Let the application cut the connection: a polite close waits for whoever does not read."""
        super().connection_made(transport)
        self._abort = cast(asyncio.Transport, transport).abort
        self.app_state = {**self.app_state, "abort": self._abort}

    def handle_text(self, event: Frame) -> None:
        """Refuse text."""
        self._refuse()

    def handle_bytes(self, event: Frame) -> None:
        """Take a message that is whole."""
        if event.fin:
            super().handle_bytes(event)
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
