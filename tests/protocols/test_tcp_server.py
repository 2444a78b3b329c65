"""A server that closes leaves no socket open, whatever it accepted in its last turn."""

import asyncio
import gc
import socket
import warnings

import pytest

from seerob.protocols.links.tcp_server import close_server


@pytest.mark.parametrize("turns", range(6))
def test_what_is_accepted_while_the_server_closes_is_served(
    turns: int,
) -> None:
    served: list[str] = []

    async def hear(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        served.append("served")
        writer.transport.abort()

    async def work() -> None:
        server = await asyncio.start_server(hear, "127.0.0.1", 0)
        with socket.create_connection(server.sockets[0].getsockname(), timeout=5):
            for _ in range(turns):  # until it is seen, accepted, and its task begun
                await asyncio.sleep(0)
            await close_server(server)

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        asyncio.run(work())
        gc.collect()
    assert not [str(w.message) for w in caught if w.category is ResourceWarning]
    assert served or turns < 2
