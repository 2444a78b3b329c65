"""One connected page: what waits for it, and how far behind it may be.

Of each kind of message only the newest waits, so a page that stalls costs a bounded amount of
memory and nobody else's time. Frames in flight (sent, not acknowledged) are counted, not ticks:
comparing with a tick counter deadlocks after one stall.
"""

from __future__ import annotations

import asyncio
from collections import deque
from math import inf
from time import monotonic
from typing import NamedTuple

from starlette.websockets import WebSocket, WebSocketDisconnect

WINDOW = 32
"""Frames in flight at most."""
TOGETHER = 4
"""Messages that are written at once at most."""
FRAME = "snapshot"
PRESENCES = "presences"
"""Where visitors are; like a frame, it waits while too many are in flight."""


class Closing(NamedTuple):
    """Why a connection ends."""

    code: int
    reason: str


class Client:
    """What one page has been sent, has acknowledged and still waits for.

    Args:
        socket: Its accepted WebSocket.
        patience: How long a frame may wait for it before the connection is closed [s].
    """

    def __init__(self, socket: WebSocket, *, patience: float) -> None:
        self._socket, self._patience = socket, patience
        self._waiting: dict[str, bytes] = {}
        self._seq, self._until = 0, inf
        self._in_flight: deque[int] = deque(maxlen=WINDOW)
        self._waiting_since: float | None = None
        self._wake = asyncio.Event()
        self._over: asyncio.Future[Closing] = asyncio.get_running_loop().create_future()
        self.sent = 0
        """Frames sent."""
        self.skipped = 0
        """Frames that a newer one replaced, or that got too old, before they could be sent."""

    @property
    def over(self) -> asyncio.Future[Closing]:
        """Done when the server has decided to end the connection."""
        return self._over

    def offer(self, kind: str, payload: bytes) -> None:
        """Let a message wait; it replaces an earlier one of its kind."""
        self._waiting[kind] = payload
        self._wake.set()

    def begin(self, scene: bytes) -> None:
        """Let another scene wait; a frame of the one before it is dropped."""
        self._waiting.pop(FRAME, None)
        self._waiting_since = None
        self.offer("Scene", scene)

    def offer_frame(self, seq: int, payload: bytes, until: float = inf) -> None:
        """Let a frame wait; it replaces an earlier one, and patience ends here.

        Args:
            seq: Its number.
            payload: It.
            until: Monotonic time after which it is not sent any more [s].
        """
        now = monotonic()
        if FRAME in self._waiting:
            self.skipped += 1
        if self._waiting_since is None:
            self._waiting_since = now
        elif now - self._waiting_since > self._patience:
            self.end(Closing(1013, f"nothing acknowledged for {self._patience:g} s"))
        self._seq, self._until = seq, until
        self.offer(FRAME, payload)

    def acknowledge(self, seq: int) -> None:
        """The page has the frame ``seq``, and therefore all that were sent before it."""
        # Not by comparing: in a replay, numbers go back. An unknown one acknowledges nothing.
        for i in reversed(range(len(self._in_flight))):
            if self._in_flight[i] == seq:
                for _ in range(i + 1):
                    self._in_flight.popleft()
                self._wake.set()
                return

    def end(self, closing: Closing) -> None:
        """Decide to end the connection; the first reason counts."""
        if not self._over.done():
            self._over.set_result(closing)

    def _next(self) -> bytes | None:
        for kind in self._waiting:
            if kind not in (FRAME, PRESENCES):
                return self._waiting.pop(kind)
            if len(self._in_flight) < WINDOW:
                if kind == PRESENCES:
                    return self._waiting.pop(kind)
                if monotonic() > self._until:
                    # The process was stopped, or held up: what it had begun to send is no longer the present.
                    del self._waiting[kind]
                    self._waiting_since = None
                    self.skipped += 1
                    return self._next()
                self._in_flight.append(self._seq)
                self._waiting_since = None
                self.sent += 1
                return self._waiting.pop(kind)
        return None

    async def send(self) -> None:
        """Send what waits until the connection ends."""
        try:
            while True:
                self._wake.clear()
                while (payload := self._next()) is not None:
                    together = [payload]
                    while len(together) < TOGETHER and (payload := self._next()) is not None:
                        together.append(payload)
                    # Several at once: each write of its own costs more than all they hold.
                    await self._socket.send({"type": "websocket.send", "every": together})
                    # A turn of the loop, in which it may learn that the page is gone.
                    await asyncio.sleep(0)
                await self._wake.wait()
        except (WebSocketDisconnect, RuntimeError):
            # RuntimeError is what Starlette raises when the connection was closed meanwhile.
            self.end(Closing(1006, "gone"))
