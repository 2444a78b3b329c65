"""A server of asyncio that leaves no socket open, whenever it is cancelled and whatever it accepted last.

``asyncio.start_server`` forgets its listening socket when it is cancelled in its last turn: the port stays
taken. ``Server.close`` leaves a connection open that was accepted but whose own task has not begun: it is
made for a server that is closed by then, and fails, or is cancelled with the loop (CPython issue 79033).
"""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import asynccontextmanager

TURNS = 8
"""Of the loop until an accepted connection runs: it needs three."""

Welcome = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


@asynccontextmanager
async def tcp_server(welcome: Welcome, bind: str, port: int) -> AsyncGenerator[asyncio.Server, None]:
    """Listen on a port of this machine; at the end nothing more is accepted.

    Args:
        welcome: Serves a connection, which it ends itself.
        bind: Own address to listen on.
        port: 0 is any free one.

    Raises:
        OSError: The port is taken, or the address is not of this machine.
    """
    loop = asyncio.get_running_loop()
    found = await loop.getaddrinfo(bind, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    family, kind, protocol, _, address = found[0]
    # With its protocol: asyncio sends at once (TCP_NODELAY) only where it is named.
    with socket.socket(family, kind, protocol) as listening:
        if os.name == "posix":  # elsewhere it lets others take the port
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        server = await asyncio.start_server(welcome, sock=listening, start_serving=False)
        try:
            await server.start_serving()
            yield server
        finally:
            await close_server(server)


async def close_server(server: asyncio.Server) -> None:
    """Let what was accepted begin, and close.

    Args:
        server: Of the running loop; who serves a connection still has to end it.

    Raises:
        CancelledError: It was cancelled meanwhile, and has closed all the same.
    """
    try:
        await stop_accepting(server)
    finally:
        server.close()


async def stop_accepting(server: asyncio.Server) -> None:
    """Accept nothing more, and let what was accepted begin; the server can then be closed by whoever made it.

    Args:
        server: Of the running loop.

    Raises:
        CancelledError: It was cancelled meanwhile, and has waited all the same.
    """
    loop = asyncio.get_running_loop()
    for listening in server.sockets:
        loop.remove_reader(listening.fileno())
    cancelled = None
    for _ in range(TURNS):
        try:
            await asyncio.sleep(0)
        except asyncio.CancelledError as error:
            cancelled = error
    if cancelled is not None:
        raise cancelled
