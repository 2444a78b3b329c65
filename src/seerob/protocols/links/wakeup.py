"""Waking whoever waits for bytes in the very call that brings them.

What asyncio's events and futures wake is run in the next turn of the loop, which asks the kernel for news
before: there a thread gives up the interpreter's lock and waits for it anew, behind one that computes.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextvars import Context
from typing import Any


class _Wait(asyncio.Future[None]):
    """What one task awaits; it goes on within `end`, unless another task calls that."""

    _then: Callable[[Any], object] | None = None
    _context: Context | None = None

    def add_done_callback(self, fn: Callable[[Any], object], /, *, context: Context | None = None) -> None:
        """Called by the task that awaits it, and by no one else."""
        self._then, self._context = fn, context

    def cancel(self, msg: Any | None = None) -> bool:
        """Called by whoever cancels the task, from within a task of their own."""
        if not super().cancel(msg):
            return False
        self._go_on_later()
        return True

    def end(self, error: BaseException | None = None) -> None:
        """Nothing is waited for any more."""
        if self.done():
            return
        if error is None:
            self.set_result(None)
        else:
            self.set_exception(error)
        if asyncio.current_task(self.get_loop()) is not None:
            self._go_on_later()  # a task does not run within another
        elif self._then is not None:
            then, self._then = self._then, None
            if self._context is None:
                then(self)
            else:
                self._context.run(then, self)

    def _go_on_later(self) -> None:
        if self._then is not None:
            then, self._then = self._then, None
            self.get_loop().call_soon(then, self, context=self._context)


class Wakeup:
    """Rung by callbacks of the running loop; one task at a time waits for it.

    It remembers nothing: whoever waits looks first whether something is there.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._wait: _Wait | None = None
        self._due = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def wake(self) -> None:
        """Whoever waits goes on, and has done with what there is when this returns."""
        if self._wait is not None:
            self._wait.end()

    async def wait(self, patience: float) -> None:
        """Until it rings.

        Args:
            patience: Longest time that takes [s].

        Raises:
            TimeoutError: It took longer.
        """
        # One timer for many waits: packets come hundreds of times in the time of one.
        self._due = self._loop.time() + patience
        if self._timer is None or self._timer.when() > self._due:
            self._set()
        self._wait = _Wait(loop=self._loop)
        try:
            await self._wait
        finally:
            self._wait = None

    def _set(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_at(self._due, self._look)

    def _look(self) -> None:
        self._timer = None
        if self._wait is None:
            return
        if self._loop.time() < self._due:
            self._set()
        else:
            self._wait.end(TimeoutError())
