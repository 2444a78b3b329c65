"""Names, families and spellings of addresses: who is meant is who is heard."""

from __future__ import annotations

import asyncio
import errno
import socket
import sys
from contextlib import aclosing

import pytest

from seerob.protocols.links.connection import connected
from seerob.protocols.links.datagrams import listening, plain


async def heard(sender):
    async with listening("127.0.0.1", 0, sender=sender) as port, aclosing(port.receive(10.0)) as said:
        with socket.socket(type=socket.SOCK_DGRAM) as own, socket.socket(type=socket.SOCK_DGRAM) as other:
            own.bind(("127.0.0.1", 0))
            other.bind(("127.0.0.2", 0))
            other.sendto(b"of another", ("127.0.0.1", port.port))
            own.sendto(b"of this", ("127.0.0.1", port.port))
        return (await anext(said)).data, port.strangers


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a whole network of loopback addresses")
@pytest.mark.parametrize("sender", ["127.0.0.1", "localhost", "LocalHost"])
def test_a_sender_is_known_by_name_too(sender):
    data, strangers = asyncio.run(asyncio.wait_for(heard(sender), 30))
    assert data == b"of this"
    assert strangers == 1


def test_a_sender_whom_nobody_knows_is_an_error():
    with pytest.raises(OSError, match=r"(?i)name|known|host|address"):
        asyncio.run(asyncio.wait_for(heard("nobody.invalid"), 30))


def test_one_address_has_one_spelling():
    assert plain("::ffff:192.168.0.1") == plain("192.168.0.1")
    assert plain("FE80::1") == plain("fe80::1") != plain("fe80::2")


def test_a_machine_without_ipv6_gets_to_what_answers_there_and_here(monkeypatch):
    """``localhost`` is both addresses; on such a machine not even a socket can be made for the first."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        found = [
            (socket.AF_INET6, socket.SOCK_STREAM, 6, "", ("::1", port, 0, 0)),
            (socket.AF_INET, socket.SOCK_STREAM, 6, "", ("127.0.0.1", port)),
        ]
        real = socket.socket

        def without(family=socket.AF_INET, *rest, **more):
            if family == socket.AF_INET6:
                raise OSError(errno.EAFNOSUPPORT, "no such family")
            return real(family, *rest, **more)

        async def greeted():
            async def both(*_, **__):
                return found

            monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", both)
            monkeypatch.setattr("seerob.protocols.links.connection.socket.socket", without)
            async with connected("localhost", port, 10.0) as connection:
                monkeypatch.undo()
                there, _ = server.accept()
                with there:
                    there.sendall(b"hello")
                    return (await connection.read(10.0)).data

        assert asyncio.run(asyncio.wait_for(greeted(), 30)) == b"hello"


def test_the_last_refusal_is_told_when_nobody_answers():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]

    async def reach():
        async with connected("localhost", port, 10.0):
            pass

    with pytest.raises(ConnectionRefusedError):
        asyncio.run(asyncio.wait_for(reach(), 30))
