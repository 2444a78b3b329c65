"""Whoever gives up connecting to an OPC UA server hangs up."""

import asyncio
from pathlib import Path

import pytest

from seerob.protocols.plc.opcua_client import Way, connect


def test_a_server_that_never_answers_is_hung_up_on():
    async def scene():
        said, gone = asyncio.Event(), asyncio.Event()

        async def silent(reader, writer):
            while await reader.read(1 << 16):
                said.set()
            gone.set()
            writer.close()

        server = await asyncio.start_server(silent, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]

        async def ask():
            async with connect(Way(url=f"opc.tcp://127.0.0.1:{port}"), Path()):
                pytest.fail("it never answered")

        asking = asyncio.create_task(ask())
        async with asyncio.timeout(30):
            await said.wait()
            asking.cancel()
            with pytest.raises(asyncio.CancelledError):
                await asking
            await gone.wait()
            server.close()
            await server.wait_closed()

    asyncio.run(scene())
