"""The HTTP connection itself: one on which nobody asks for anything is cut, and there are only so many.

uvicorn waits for the first request without end and takes every connection. Whoever can reach the
port, with the token or without, could so take every file descriptor of the process, and no source
that was lost could connect again.
"""

from __future__ import annotations

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

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
