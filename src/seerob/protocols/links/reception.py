"""When bytes arrived, as the kernel says, and waking whoever waits for them in the call that brings them.

Linux stamps each packet as it comes in (``SO_TIMESTAMPNS``, socket(7)), datagrams and streams alike. Its
stamps are of the wall clock, which may be set while a packet waits; they are put on the monotonic clock and
never before an instant at which nothing was waiting, nor after that of reading. Elsewhere, what arrived
is stamped when it is read.

What asyncio's events and futures wake is run in the next turn of the loop, which asks the kernel for news
before: there a thread gives up the interpreter's lock and waits for it anew, behind one that computes.

A packet that comes every few milliseconds finds the processor's caches with what others have computed
meanwhile: what it costs is what is touched for the first time again, and asyncio's turn of the loop is as
much of that as decoding. `PromptLoop` calls who reads a socket where it learns that there is something.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import select
import selectors
import socket
import struct
import sys
import time
from collections.abc import Callable, Coroutine, Iterable
from contextvars import Context
from typing import Any, NamedTuple, TypeVarTuple

_NANOSECONDS = getattr(socket, "SO_TIMESTAMPNS", 35) if sys.platform == "linux" else None
"""Option, and kind of message; Python names it from 3.14 on, the number is that of most architectures."""
_TIMESPEC = struct.Struct("@ll")
_ROOM = socket.CMSG_SPACE(_TIMESPEC.size) if hasattr(socket, "CMSG_SPACE") else 0


class Received(NamedTuple):
    """What was read from a socket."""

    arrived: float
    """Host's monotonic time [s]; of a stream, when the newest of the bytes did."""
    data: bytes
    sender: Any
    """Address of a datagram's sender."""


class Reception:
    """Reads a socket that does not block.

    Args:
        link: The socket.
    """

    def __init__(self, link: socket.socket) -> None:
        self._link = link
        self._stream = link.type == socket.SOCK_STREAM
        self._empty = time.monotonic()
        """Nothing that is read from now on arrived before this [s]."""
        if _NANOSECONDS is not None:
            with contextlib.suppress(OSError):
                link.setsockopt(socket.SOL_SOCKET, _NANOSECONDS, 1)

    def read(self, size: int) -> Received:
        """Read a datagram, or what is there of a stream; no bytes when a stream has ended.

        Args:
            size: Largest number of bytes.

        Raises:
            BlockingIOError: Nothing is there.
            OSError: The other end is gone.
        """
        before = time.monotonic()
        try:
            if not _ROOM:
                data, sender = self._link.recvfrom(size)
                return Received(time.monotonic(), data, sender)
            data, said, _, sender = self._link.recvmsg(size, _ROOM)
        except BlockingIOError:
            self._empty = before
            raise
        now = time.monotonic()
        arrived = instant(stamp(said), now=now, wall=time.time_ns(), empty=self._empty)
        # What is read later arrived later; of a stream nothing was left, either.
        self._empty = max(before, arrived) if self._stream and len(data) < size else arrived
        return Received(arrived, data, sender)


def stamp(said: Iterable[tuple[int, int, bytes]]) -> int | None:
    """The kernel's time stamp among the ancillary data of a packet: wall clock [ns]; None without one."""
    for level, kind, data in said:
        if level == socket.SOL_SOCKET and kind == _NANOSECONDS and len(data) == _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack(data)
            return int(seconds) * 1_000_000_000 + int(nanoseconds)
    return None


def instant(stamped: int | None, *, now: float, wall: int, empty: float) -> float:
    """When a packet arrived, on the monotonic clock [s].

    Args:
        stamped: The kernel's time stamp, wall clock [ns].
        now: Monotonic time of reading [s].
        wall: Wall clock then [ns].
        empty: An instant at which it had not arrived [s].
    """
    if stamped is None:
        return now
    return min(max(now - 1e-9 * (wall - stamped), empty), now)


class _Wait(asyncio.Future[None]):
    """What one task awaits; it goes on within `end`, unless another task calls that."""

    _then: Callable[[Any], object] | None = None
    _context: Context | None = None

    def add_done_callback(self, fn: Callable[[Any], object], /, *, context: Context | None = None) -> None:
        """Called by the task that awaits it, and by no one else."""
        self._then, self._context = fn, context

    def cancel(self, msg: object | None = None) -> bool:
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


def run_promptly(main: Coroutine[Any, Any, None]) -> None:
    """Run what listens in a loop of its own, of which this thread has none: as `asyncio.run`, sooner read."""
    factory = PromptLoop if hasattr(select, "epoll") else None
    with asyncio.Runner(loop_factory=factory) as runner:
        runner.run(main)


_Ts = TypeVarTuple("_Ts")

if hasattr(select, "epoll"):
    _READABLE = select.EPOLLIN

    class _PromptSelector(selectors.EpollSelector):
        """Calls who reads a socket as soon as there is something, and tells asyncio of everything else."""

        def __init__(self) -> None:
            super().__init__()
            self._epoll = select.epoll.fromfd(os.dup(self.fileno()))
            self.readers: dict[int, asyncio.Handle] = {}
            """Who is called, by descriptor."""
            self.asked = False
            """Whether the loop has been asked to do something since it began to wait."""

        def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
            """Wait for what asyncio has to do itself: another socket, what a reader has begun, or the time.

            Args:
                timeout: Longest time [s]; None for no end.
            """
            self.asked = False
            end = None if timeout is None else time.monotonic() + timeout
            while True:
                events = self._epoll.poll(timeout)
                others = []
                for file, what in events:
                    reader = self.readers.get(file)
                    if reader is not None and what == _READABLE:
                        reader._run()
                    elif (key := self.get_map().get(file)) is not None:
                        mask = selectors.EVENT_WRITE * bool(what & ~select.EPOLLIN)
                        mask |= selectors.EVENT_READ * bool(what & ~select.EPOLLOUT)
                        others.append((key, mask & key.events))
                if others:
                    return others
                if self.asked or not events:
                    return []
                if end is not None:
                    timeout = end - time.monotonic()
                    if timeout <= 0:
                        return []

        def close(self) -> None:
            """Give its descriptors back."""
            self._epoll.close()
            super().close()

    class PromptLoop(asyncio.SelectorEventLoop):
        """asyncio's loop, but for what waits to read, which is called without a turn of the loop.

        Its transports, `add_reader` and `sock_recv` alike: all of them ask by what is overridden here.
        """

        def __init__(self) -> None:
            self._prompt = _PromptSelector()
            super().__init__(self._prompt)
            self._prompt.readers.clear()  # by which other threads wake the loop, to have a turn

        def _add_reader(self, fd: Any, callback: Callable[[*_Ts], Any], *args: *_Ts) -> asyncio.Handle:
            handle: asyncio.Handle = super()._add_reader(fd, callback, *args)  # type: ignore[misc]
            self._prompt.readers[_descriptor(fd)] = handle
            return handle

        def _remove_reader(self, fd: Any) -> bool:
            self._prompt.readers.pop(_descriptor(fd), None)
            return bool(super()._remove_reader(fd))  # type: ignore[misc]

        def call_soon(
            self, callback: Callable[[*_Ts], object], *args: *_Ts, context: Context | None = None
        ) -> asyncio.Handle:
            """Call in the next turn of the loop, which begins when the reader that asks has returned."""
            self._prompt.asked = True
            return super().call_soon(callback, *args, context=context)

        def call_at(
            self,
            when: float,
            callback: Callable[[*_Ts], object],
            *args: *_Ts,
            context: Context | None = None,
        ) -> asyncio.TimerHandle:
            """Call at an instant of the loop's time [s]; who waits learns of it."""
            self._prompt.asked = True
            return super().call_at(when, callback, *args, context=context)


def _descriptor(file: Any) -> int:
    return file if isinstance(file, int) else int(file.fileno())
