"""The WebSocket connection itself: what uvicorn leaves open is closed here."""

from __future__ import annotations

import asyncio
from typing import cast

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.protocol import State


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
