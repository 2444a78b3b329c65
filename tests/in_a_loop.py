"""A server of another library in an event loop of its own: tests import it as ``from in_a_loop import …``."""

from __future__ import annotations

import asyncio
import threading
from contextlib import contextmanager


@contextmanager
def in_a_loop(serve):
    """Something that serves until it is told to stop.

    Args:
        serve: Coroutine function of two events: it sets the first (of threads) once it is ready, and ends
            when the second (of its loop) is set.
    """
    ready, ends = threading.Event(), []

    async def main():
        over = asyncio.Event()
        ends.append((asyncio.get_running_loop(), over))
        await serve(ready, over)

    thread = threading.Thread(target=lambda: asyncio.run(main()), daemon=True)
    thread.start()
    assert ready.wait(60)
    try:
        yield
    finally:
        loop, over = ends[0]
        loop.call_soon_threadsafe(over.set)
        thread.join(30)
        assert not thread.is_alive()
