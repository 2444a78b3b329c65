"""Connections on which nobody asks for anything: they end, and there are never more than so many."""

import contextlib
import socket
import time

import httpx
import pytest
from websockets.exceptions import WebSocketException

from seerob.app.server.connection import Doorstep, PromptRequests
from seerob.app.server.player import Player
from seerob.app.server.serving import Server
from seerob.core.snapshot import Snapshot
from server.frames import MESHES, Remembered, Visitor, scene, snapshot

DEADLINE = 30.0


@pytest.fixture
def server():
    feed = Player(Remembered([snapshot(0), snapshot(1)]))
    with Server(scene=scene(), meshes=MESHES, feed=feed, port=0) as server:
        yield server


def ended(connection):
    """Whether the other side has ended a connection, after what it had to say."""
    with contextlib.suppress(ConnectionError):
        while connection.recv(65536):
            pass
    return True


def persistent(attempt):
    """What an attempt gives at last; a machine that is slow is cut as well."""
    until = time.monotonic() + DEADLINE
    while True:
        try:
            return attempt()
        except (OSError, EOFError, httpx.TransportError, WebSocketException):
            assert time.monotonic() < until


@pytest.mark.parametrize(
    "said",
    [
        b"",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nX",
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\nGET / HTTP/1.1\r\nX",
        b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\nslow",
    ],
    ids=["silent", "half a request", "half a second request", "half a body"],
)
def test_who_does_not_ask_is_cut_and_who_looks_on_is_not(server, monkeypatch, said):
    monkeypatch.setattr(PromptRequests, "promptness", 0.2)
    with persistent(lambda: Visitor(server)) as page:
        page.of(Snapshot)
        with socket.create_connection(("127.0.0.1", server.port), timeout=DEADLINE) as slow:
            slow.sendall(said)
            assert ended(slow)
        page.ask("step", 1)
        assert page.of(Snapshot, timeout=DEADLINE) == snapshot(1)


def test_there_are_only_so_many_connections(server, monkeypatch):
    monkeypatch.setattr(Doorstep, "most", 5)
    with contextlib.ExitStack() as held:
        for _ in range(5):
            silent = socket.create_connection(("127.0.0.1", server.port), timeout=DEADLINE)
            held.enter_context(silent)
        for _ in range(20):
            with socket.create_connection(("127.0.0.1", server.port), timeout=DEADLINE) as more:
                assert ended(more)
    # The server learns in its own time that they are gone.
    assert persistent(lambda: httpx.get(server.url)).status_code in (200, 503)  # 503: not built


def test_one_address_of_another_machine_does_not_take_all_connections(monkeypatch):
    monkeypatch.setattr(Doorstep, "most_of_one", 3)
    monkeypatch.setattr("seerob.app.server.connection.is_loopback", lambda host: host == "127.0.0.2")
    with contextlib.ExitStack() as held, socket.create_server(("127.0.0.1", 0)) as listening:
        doorstep = held.enter_context(Doorstep(listening))
        doorstep.setblocking(False)
        clients = []
        taken = 0

        def come(address):
            client = held.enter_context(
                socket.create_connection(doorstep.getsockname(), source_address=(address, 0))
            )
            try:
                clients.append((client, held.enter_context(doorstep.accept()[0])))
            except BlockingIOError:
                return False
            return True

        for _ in range(10):
            taken += come("127.0.0.3")
        assert taken == 3
        assert come("127.0.0.4")  # another address
        assert all(come("127.0.0.2") for _ in range(10))  # this machine itself
        clients[0][1].close()
        assert come("127.0.0.3")
