"""What every emulator is: something that begins when it is started and ends when it is stopped, and again."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from threading import Event, Thread
from types import TracebackType
from typing import Self


class Emulator:
    """Works in a thread of its own; derive, and say in `begin` what it does there."""

    def __init__(self) -> None:
        self._over = Event()
        self._thread: Thread | None = None

    def begin(self) -> Callable[[], object]:
        """Take the addresses that are needed, and return what the thread does until `_over` is set.

        Raises:
            OSError: An address cannot be had.
        """
        raise NotImplementedError

    def start(self) -> Self:
        """Begin; returns when it can be reached, or has begun to send.

        Raises:
            OSError: An address cannot be had.
        """
        if self._thread is not None:
            raise RuntimeError("is already started")
        self._over.clear()
        work = self.begin()
        self._thread = Thread(target=work, name=f"seerob-{type(self).__name__}", daemon=True)
        self._thread.start()
        self.started()
        return self

    def started(self) -> None:
        """Called once the thread runs: may wait until it is ready."""

    def stop(self) -> None:
        """End, as a device does that is switched off; it may be started again."""
        if self._thread is not None:
            self._over.set()
            self.stopping()
            self._thread.join()
            self._thread = None

    def stopping(self) -> None:
        """Called before the thread is waited for: may wake it."""

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


class LoopEmulator(Emulator):
    """One whose thread runs an event loop; derive, and say in `serve` what it does there."""

    def __init__(self) -> None:
        super().__init__()
        self._ready = Event()
        self._failure: BaseException | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Serve until it is over.

        Args:
            ready: To be called when clients can connect.
            over: Set when it is stopped.

        Raises:
            OSError: An address cannot be listened on.
        """
        raise NotImplementedError

    def begin(self) -> Callable[[], object]:
        """The loop."""
        self._ready.clear()
        self._failure = None
        return self._run

    def started(self) -> None:
        """Wait until clients can connect."""
        self._ready.wait()
        if self._failure is not None:
            failure, thread, self._thread = self._failure, self._thread, None
            if thread is not None:
                thread.join()
            raise failure

    def stopping(self) -> None:
        """Wake the loop."""
        if self._loop is not None and self._stop is not None:
            with contextlib.suppress(RuntimeError):  # ended by itself
                self._loop.call_soon_threadsafe(self._stop.set)
        self._loop = self._stop = None

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception as error:
            self._failure = error
        finally:
            self._ready.set()

    async def _serve(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        await self.serve(self._ready.set, self._stop)
