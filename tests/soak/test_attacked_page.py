"""A page that is attacked from another process in every way that we know: ticks and other pages go on.

``SEEROB_SOAK_ATTACK`` is how long each attack of the long form lasts [s]; figures are printed with ``-rP``.
"""

import multiprocessing
import os
import socket
import ssl
import threading
import time
import zlib
from contextlib import ExitStack
from itertools import count
from typing import NamedTuple

import msgspec
import pytest

from seerob.app.server import certificates
from seerob.app.server.access import Tokens
from seerob.app.server.connection import MOST_CONNECTIONS
from seerob.app.server.live import Live
from seerob.app.server.serving import LARGEST_MESSAGE, Server
from seerob.core.snapshot import PROTOCOL, Command, Snapshot, Tracking
from server.frames import MESHES, Visitor, scene, snapshot
from server.test_hostile_visitors import frame
from soak.test_long_runs import resident

TOKENS = Tokens.made()
HERE = "127.0.0.1"
PERIOD = 0.01
SECONDS = float(os.environ.get("SEEROB_SOAK_ATTACK", "10"))
SPARE = 128 * 2**20
"""Memory that an attack may take [byte]: asyncio keeps 256 KiB for each of 400 connections that begin TLS."""

LEAST = 1.0
"""Frames per second that another page is shown at least, however busy the machine is."""

_encode = msgspec.msgpack.encode
_COMMANDS = frame(2, _encode(Command(action="seek", value=1.0))) * 200
_POSES = frame(2, _encode(Tracking(human="anna", t=1.0, names=("viewer",), poses=bytes(28)))) * 50
_BOMB = frame(2, zlib.compress(bytes(12 * 2**20), 9)[2:-4], reserved=4)


class Attack(NamedTuple):
    """One way: what is said first on each connection, and what then without end."""

    connections: int
    first: bytes = b""
    then: bytes = b""
    pause: float = 0.0
    """Between two pieces of it [s]."""
    role: str = ""
    """Whose token the WebSocket has; no WebSocket when empty."""
    silent: bool = False
    """Nothing is read."""
    tls: bool = False


ATTACKS = {
    "66 000 commands a second": Attack(1, then=_COMMANDS, role="control"),
    "commands of a tracker": Attack(4, then=_COMMANDS, role="track"),
    "poses of a viewer": Attack(4, then=_POSES, role="view"),
    "a million pings": Attack(4, then=frame(9, b"") * 1000, role="view"),
    "compressed bombs": Attack(4, then=_BOMB, role="view"),
    "frames of 2 to the 62 bytes": Attack(
        4, then=frame(2, b"x" * LARGEST_MESSAGE, length=2**62), role="view"
    ),
    "30 that stall": Attack(30, role="view", pause=1.0, silent=True),
    "500 that are slow": Attack(500, then=frame(9, b""), role="view", pause=1.0, silent=True),
    "slowloris": Attack(500, first=b"GET / HTTP/1.1\r\nHost: localhost\r\n", then=b"X: y\r\n", pause=1.0),
    "wrong tokens from many ports": Attack(
        8, first=b"GET /?token=%s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n" % (b"0a" * 16)
    ),
    "2000 half-open handshakes of TLS": Attack(2000, first=b"\x16\x03\x01\x02\x00\x01", pause=1.0, tls=True),
}
SHORT = ("poses of a viewer", "compressed bombs", "slowloris")


def connected(port, attack, tokens):
    link = socket.create_connection((HERE, port), timeout=1.0)
    try:
        if attack.role:
            if attack.silent:
                link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            token = getattr(tokens, attack.role)
            link.sendall(
                f"GET /ws?token={token} HTTP/1.1\r\nHost: {HERE}:{port}\r\nUpgrade: websocket\r\n"
                "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Extensions: permessage-deflate\r\n"
                "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n"
                f"Sec-WebSocket-Protocol: {PROTOCOL}\r\n\r\n".encode()
            )
            if not attack.silent:
                link.recv(4096)
        link.sendall(attack.first)
        link.settimeout(0.002)
    except OSError:
        link.close()
        raise
    return link


def attacking(port, name, tokens, ready, begin, over, told):
    """In a process of its own: as many connections as there may be, each used without end."""
    attack, links, opened, sent, refused = ATTACKS[name], [], 0, 0, 0
    ready.set()
    begin.wait()
    while not over.is_set():
        if len(links) < attack.connections:
            try:
                links.append(connected(port, attack, tokens))
                opened += 1
            except OSError:
                refused += 1
                time.sleep(0.005)
        end = time.monotonic() + attack.pause
        for link in tuple(links) if attack.then or not attack.pause else ():
            try:
                sent += link.send(attack.then) if attack.then else 0
                if not attack.silent and not link.recv(1 << 16):
                    raise OSError
            except TimeoutError:
                continue
            except OSError:
                link.close()
                links.remove(link)
        if len(links) == attack.connections:
            over.wait(max(0.0, end - time.monotonic()))
    told.put((opened, refused, sent))


class Ticks(threading.Thread):
    """A run in this process that computes 2 of 10 ms; which of its ticks begin more than a period late."""

    def __init__(self, live):
        super().__init__(daemon=True)
        self._live, self.over, self.done, self.late = live, threading.Event(), 0, 0

    def run(self):
        begun = time.monotonic()
        for k in count():
            self.over.wait(max(0.0, begun + k * PERIOD - time.monotonic()))
            if self.over.is_set():
                return
            lag = time.monotonic() - begun - k * PERIOD
            if lag > PERIOD:
                self.late, begun = self.late + 1, begun + lag
            busy = time.thread_time() + 0.002
            while time.thread_time() < busy:
                pass
            self._live.publish(snapshot(k % 500))
            self.done += 1


@pytest.fixture(scope="module")
def tls(tmp_path_factory):
    return certificates.own(tmp_path_factory.mktemp("tls"), HERE)


@pytest.mark.parametrize(
    ("name", "seconds"),
    [
        *(pytest.param(name, 1.0, id=f"short-{name}") for name in SHORT),
        *(pytest.param(name, SECONDS, id=f"long-{name}", marks=pytest.mark.soak) for name in ATTACKS),
    ],
)
def test_ticks_and_other_pages_go_on(name, seconds, tls):
    attack, live = ATTACKS[name], Live()
    context = multiprocessing.get_context("spawn")
    ready, begin, over = (context.Event() for _ in range(3))
    told = context.Queue()
    with ExitStack() as stack:
        server = stack.enter_context(
            Server(
                scene=scene(),
                meshes=MESHES,
                feed=live,
                port=0,
                tokens=TOKENS,
                tls=tls if attack.tls else None,
            )
        )
        ticks = Ticks(live)
        stack.callback(ticks.over.set)
        ticks.start()
        attacker = context.Process(
            target=attacking, args=(server.port, name, TOKENS, ready, begin, over, told), daemon=True
        )
        attacker.start()
        stack.callback(attacker.kill)
        options = {}
        if attack.tls:
            options["ssl"] = ssl.create_default_context(cafile=tls.authority)
        page = stack.enter_context(Visitor(server, path=f"/ws?token={TOKENS.view}", **options))
        page.of(Snapshot)
        assert ready.wait(60)
        before = resident()

        def stretch():
            done, late, end, seen = ticks.done, ticks.late, time.monotonic() + seconds, 0
            while time.monotonic() < end:
                seen += isinstance(page.read(), Snapshot)
            return (ticks.done - done) / seconds, ticks.late - late, seen / seconds

        quiet = stretch()
        begin.set()
        attacked = stretch()
        held = len(server._uvicorn.server_state.connections)
        over.set()
        opened, refused, sent = told.get(timeout=60)
        grown = resident() - before
    print(
        f"{name}: {opened} opened, {refused} refused, {sent} bytes; {held} held, {grown / 2**20:.1f} MiB; "
        f"ticks/s {quiet[0]:.1f} → {attacked[0]:.1f}, late {quiet[1]} → {attacked[1]}, "
        f"frames/s {quiet[2]:.1f} → {attacked[2]:.1f}"
    )
    assert opened > 0
    assert held <= MOST_CONNECTIONS
    assert grown < SPARE
    assert attacked[2] > LEAST
    refusals = [v.refused for v in server.visits.take(end=True)]
    if attack.role in ("view", "track") and attack.then in (_COMMANDS, _POSES):
        assert any(said for said in refusals)
