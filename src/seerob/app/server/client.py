"""One connected page: what waits for it, and how far behind it may be.

Of each kind of message only the newest waits, so a page that stalls costs a bounded amount of
memory and nobody else's time. Frames in flight (sent, not acknowledged) are counted, not ticks:
comparing with a tick counter deadlocks after one stall.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from math import inf
from time import monotonic
from typing import NamedTuple, Protocol

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


class Line(Protocol):
    """A connection that takes messages at once."""

    on_read: Callable[[], None]
    """Is called when the page has read what was too much."""

    @property
    def reads(self) -> bool:
        """Whether the page has read so much that more may be written."""
        ...

    def write(self, messages: list[bytes]) -> None:
        """Write messages at once."""
        ...


class Client:
    """What one page has been sent, has acknowledged and still waits for.

    What is offered is written in the same turn of the loop: no task is woken for it.

    Args:
        line: To it.
        patience: How long a frame may wait for it before the connection is closed [s].
    """

    def __init__(self, line: Line, *, patience: float) -> None:
        self._line, self._patience = line, patience
        line.on_read = self.flush
        self._waiting: dict[str, bytes] = {}
        self._seq, self._until = 0, inf
        self._in_flight: deque[int] = deque(maxlen=WINDOW)
        self._waiting_since: float | None = None
        self._loop = asyncio.get_running_loop()
        self._due: asyncio.Handle | None = None
        self._over: asyncio.Future[Closing] = self._loop.create_future()
        self.sent = 0
        """Frames sent."""
        self.skipped = 0
        """Frames that a newer one replaced, or that got too old, before they could be sent."""

    @property
    def over(self) -> asyncio.Future[Closing]:
        """Done when the server has decided to end the connection."""
        return self._over

    def put(self, kind: str, payload: bytes) -> None:
        """Let a message wait for what comes with it; it replaces an earlier one of its kind."""
        self._waiting[kind] = payload

    def offer(self, kind: str, payload: bytes) -> None:
        """Let a message wait until this turn of the loop is over; it replaces an earlier one of its kind."""
        self._waiting[kind] = payload
        if self._due is None:
            self._due = self._loop.call_soon(self.flush)

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
        self._waiting[FRAME] = payload
        self.flush()

    def acknowledge(self, seq: int) -> None:
        """The page has the frame ``seq``, and therefore all that were sent before it."""
        # Not by comparing: in a replay, numbers go back. An unknown one acknowledges nothing.
        for i in reversed(range(len(self._in_flight))):
            if self._in_flight[i] == seq:
                for _ in range(i + 1):
                    self._in_flight.popleft()
                if self._waiting:
                    self.flush()
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

    def flush(self) -> None:
        """Write what waits, as far as the page reads."""
        if self._due is not None:
            self._due.cancel()
            self._due = None
        together: list[bytes] = []
        while self._line.reads and (payload := self._next()) is not None:
            together.append(payload)
            # Several at once: each write of its own costs more than all they hold.
            if not self._waiting or len(together) == TOGETHER:
                self._line.write(together)
                together = []
        if together:
            self._line.write(together)
