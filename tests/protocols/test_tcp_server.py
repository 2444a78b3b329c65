"""A server leaves no socket open, whatever it accepted in its last turn and whenever it is cancelled."""

import asyncio
import contextlib
import gc
import socket
import warnings

import pytest

from seerob.protocols.links.tcp_server import tcp_server


def left_open(work):
    """What says, after this was run, that a socket was left open."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        asyncio.run(work)
        gc.collect()
    return [str(w.message) for w in caught if w.category is ResourceWarning]


@pytest.mark.parametrize("turns", range(6))
def test_what_is_accepted_while_the_server_closes_is_served(turns):
    served: list[str] = []

    async def hear(_, writer):
        served.append("served")
        writer.transport.abort()

    async def work():
        async with tcp_server(hear, "127.0.0.1", 0) as server:
            with socket.create_connection(server.sockets[0].getsockname(), timeout=5):
                for _ in range(turns):  # until it is seen, accepted, and its task begun
                    await asyncio.sleep(0)
        await asyncio.sleep(0)

    assert not left_open(work())
    assert served or turns < 2


@pytest.mark.parametrize("turns", range(40))
def test_a_cancelled_server_leaves_nothing_open(turns):
    async def hear(_, writer):
        writer.transport.abort()

    async def serve(port):
        async with tcp_server(hear, "127.0.0.1", port):
            with socket.create_connection(("127.0.0.1", port), timeout=5):
                await asyncio.sleep(0)

    async def work():
        loop = asyncio.get_running_loop()
        with socket.create_server(("127.0.0.1", 0)) as probe:
            port = probe.getsockname()[1]
        loop.getaddrinfo = lambda *_, **more: asyncio.sleep(0, socket.getaddrinfo("127.0.0.1", port, **more))
        task = asyncio.create_task(serve(port))
        for _ in range(turns):
            await asyncio.sleep(0)
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
        loop_is_free = await asyncio.start_server(hear, "127.0.0.1", port)
        loop_is_free.close()

    assert not left_open(work())


def test_what_is_written_is_sent_at_once():
    said = []

    async def hear(_, writer):
        said.append(writer.get_extra_info("socket").getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
        writer.transport.abort()

    async def work():
        async with tcp_server(hear, "127.0.0.1", 0) as server:
            reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
            await reader.read()
            writer.close()

    assert not left_open(work())
    assert said == [1]
