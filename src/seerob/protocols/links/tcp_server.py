"""Closing a server of asyncio, with whatever it accepted in its last moment.

``Server.close`` leaves a connection open that was accepted but whose own task has not begun: it is made for a
server that is closed by then, and fails, or is cancelled with the loop (CPython issue 79033).
"""

from __future__ import annotations

import asyncio

TURNS = 8
"""Of the loop until an accepted connection runs: it needs three."""


async def close_server(server: asyncio.Server) -> None:
    """Accept nothing more, let what was accepted begin, and close.

    Args:
        server: Of the running loop; who serves a connection still has to end it.
    """
    loop = asyncio.get_running_loop()
    for listening in server.sockets:
        loop.remove_reader(listening.fileno())
    for _ in range(TURNS):
        await asyncio.sleep(0)
    server.close()
