"""Packets are as old as the kernel says, whoever reads them late; and on loops that cannot say when."""

from __future__ import annotations

import asyncio
import itertools
import socket
import sys
import time
from threading import Timer

import pytest
from hypothesis import given
from hypothesis import strategies as st

from live_story import wait_for
from seerob.protocols.links import reception as module
from seerob.protocols.links.connection import CHUNK, MOST, connected
from seerob.protocols.links.datagrams import listening
from seerob.protocols.links.reception import Reception, instant

LATE = 0.2
"""How much later it is read [s]."""
CLOCKS = 5e-3
"""Between the wall clock and the monotonic one, while one is set to the time of a server [s]."""


class Windows(asyncio.SelectorEventLoop):
    """A loop that does not say when a socket can be read, as that of Windows."""

    def add_reader(self, *_):
        raise NotImplementedError


LOOPS = [asyncio.SelectorEventLoop, Windows, getattr(module, "PromptLoop", Windows)]


def run(loop, coroutine):
    with asyncio.Runner(loop_factory=loop) as runner:
        return runner.run(asyncio.wait_for(coroutine, 30))


def pair(kind):
    """Two sockets, of which what the first sends the second gets."""
    if kind == socket.SOCK_STREAM:
        with socket.create_server(("127.0.0.1", 0)) as server:
            one = socket.create_connection(server.getsockname())
            return one, server.accept()[0]
    one, other = socket.socket(type=kind), socket.socket(type=kind)
    other.bind(("127.0.0.1", 0))
    one.connect(other.getsockname())
    return one, other


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's time stamps of Linux")
@pytest.mark.parametrize("kind", [socket.SOCK_DGRAM, socket.SOCK_STREAM])
def test_a_late_reader_does_not_make_it_late(kind):
    one, other = pair(kind)
    with one, other:
        other.setblocking(False)
        reception = Reception(other)
        with pytest.raises(BlockingIOError):
            reception.read(100)

        def read_late(text):
            before = time.monotonic()
            one.send(text)
            after = time.monotonic()
            time.sleep(LATE)
            arrived, data, _ = reception.read(100)
            assert data == text
            # Where the processor is busy the kernel delivers, and stamps, a moment after it was sent.
            return before - CLOCKS, arrived, after + LATE / 2

        def stamped():
            _, arrived, latest = read_late(b"none yet")
            return arrived <= latest

        # Linux begins to stamp a moment after it was asked to; until then the time is that of reading.
        wait_for(stamped)
        for text in (b"first", b"second"):
            earliest, arrived, latest = read_late(text)
            assert earliest <= arrived <= latest


@given(
    st.none() | st.integers(-(10**12), 10**12),
    st.floats(0, 1e6),
    st.floats(0, 1e3),
)
def test_a_stamp_is_believed_between_the_last_look_and_now(age, empty, waited):
    now, wall = empty + waited, 10**18
    found = instant(None if age is None else wall - age, now=now, wall=wall, empty=empty)
    assert empty <= found <= now
    if age is None:
        assert found == now
    elif 0 <= 1e-9 * age <= waited:
        assert found == pytest.approx(now - 1e-9 * age, abs=1e-6)


@pytest.mark.parametrize("loop", LOOPS)
def test_datagrams_are_answered_and_heard_in_order(loop):
    async def talk():
        loop = asyncio.get_running_loop()
        with socket.socket(type=socket.SOCK_DGRAM) as other:
            other.bind(("127.0.0.1", 0))
            other.setblocking(False)
            async with listening("127.0.0.1", 0, answer=lambda data: data + b"!") as port:
                heard = []
                for k in range(5):
                    other.sendto(b"%d" % k, ("127.0.0.1", port.port))
                async for datagram in port.receive(10):
                    heard.append(datagram)
                    if len(heard) == 5:
                        break
                answers = []
                while len(answers) < 5:
                    try:
                        answers.append(other.recv(10))
                    except BlockingIOError:
                        await asyncio.sleep(0.001)
                assert [d.data for d in heard] == [b"%d" % k for k in range(5)]
                assert answers == [b"%d!" % k for k in range(5)]
                assert all(a.arrived <= b.arrived <= loop.time() for a, b in itertools.pairwise(heard))
                with pytest.raises(TimeoutError, match="nothing sent"):
                    await anext(port.receive(0.01))
            # The port is free again.
            async with listening("127.0.0.1", port.port):
                pass

    run(loop, talk())


@pytest.mark.parametrize("loop", LOOPS)
def test_a_connection_is_read_waited_for_and_ends(loop):
    async def talk():
        with socket.create_server(("127.0.0.1", 0)) as server:
            gone = server.getsockname()[1]
            async with connected("localhost", gone, 10) as connection:
                other, _ = server.accept()
                with other:
                    await connection.write(b"question")
                    assert other.recv(100) == b"question"
                    with pytest.raises(TimeoutError, match="silent for 0"):
                        await connection.read(0.01)
                    asyncio.get_running_loop().call_later(0.01, other.send, b"answer")
                    assert (await connection.read(10)).data == b"answer"
                assert (await connection.read(10)).data == b""
        with pytest.raises(ConnectionRefusedError):
            async with connected("127.0.0.1", gone, 10):
                pass

    run(loop, talk())


@pytest.mark.parametrize("loop", LOOPS)
def test_who_reads_late_gets_everything_and_little_waits_meanwhile(loop):
    whole = bytes(range(256)) * (1 << 14)

    async def talk():
        with socket.create_server(("127.0.0.1", 0)) as server:
            async with connected("127.0.0.1", server.getsockname()[1], 10) as connection:
                other, _ = server.accept()
                with other:
                    other.setblocking(False)
                    sending = asyncio.create_task(asyncio.get_running_loop().sock_sendall(other, whole))
                    await asyncio.sleep(0.05)
                    assert sum(len(r.data) for r in connection._waiting) <= MOST + CHUNK
                    found = bytearray()
                    while len(found) < len(whole):
                        found += (await connection.read(10)).data
                    await sending
                assert found == whole
                assert [(await connection.read(10)).data for _ in range(3)] == [b""] * 3

    run(loop, talk())


@pytest.mark.parametrize("loop", LOOPS)
def test_another_thread_and_streams_of_asyncio_wake_a_loop_that_waits(loop):
    async def echo(reader, writer):
        while data := await reader.read(100):
            writer.write(data)
        writer.close()

    async def talk():
        here, woken = asyncio.get_running_loop(), asyncio.Event()
        Timer(0.05, here.call_soon_threadsafe, (woken.set,)).start()
        await woken.wait()
        server = await asyncio.start_server(echo, "127.0.0.1", 0)
        reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
        for k in range(5):
            writer.write(b"%d" % k)
            assert await reader.read(100) == b"%d" % k
        writer.write_eof()
        assert await reader.read() == b""
        writer.close()
        server.close()
        await server.wait_closed()

    run(loop, talk())


def test_who_waits_for_a_datagram_has_it_before_it_is_answered():
    happened = []

    def answer(data):
        happened.append(("answered", data))

    async def listen(heard):
        async for datagram in heard:
            happened.append(("heard", datagram.data))

    async def talk():
        with socket.socket(type=socket.SOCK_DGRAM) as other:
            async with listening("127.0.0.1", 0, answer=answer) as port:
                waiting = asyncio.create_task(listen(port.receive(10)))
                for k in range(3):
                    await asyncio.sleep(0)
                    other.sendto(b"%d" % k, ("127.0.0.1", port.port))
                    while len(happened) < 2 * k + 2:
                        await asyncio.sleep(0.001)
                waiting.cancel()

    run(asyncio.SelectorEventLoop, talk())
    assert happened == [(what, b"%d" % k) for k in range(3) for what in ("heard", "answered")]


@pytest.mark.skipif(not hasattr(module, "PromptLoop"), reason="a loop of Linux")
def test_a_loop_whose_readers_are_called_at_once_has_time_for_everything_else():
    failed, times = [], []

    async def talk():
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, said: failed.append(said["exception"]))
        one, other = pair(socket.SOCK_STREAM)

        def answer(_, writer):
            writer.write(b"answer")
            writer.close()

        server = await asyncio.start_server(answer, "127.0.0.1")
        with one, other:
            one.send(b"is never read, and there at every look")
            turn = loop.create_future()

            def read():
                times.append(loop.time())
                if len(times) == 3:
                    loop.call_soon(turn.set_result, None)
                if len(times) == 5:
                    raise ValueError("of this reader")

            loop.add_reader(other, read)
            await turn
            begun = loop.time()
            await asyncio.sleep(0.02)
            assert loop.time() - begun >= 0.02
            reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
            assert await reader.read(10) == b"answer"
            writer.close()

            await asyncio.to_thread(time.sleep, 0.01)
            assert loop.remove_reader(other)
            count = len(times)
            await asyncio.sleep(0.01)
            assert len(times) == count
        server.close()

    run(module.PromptLoop, talk())
    assert [str(error) for error in failed] == ["of this reader"]
    assert len(times) > 10
