"""What hostile visitors can do: nothing."""

import contextlib
import logging
import random
import socket
import struct

import httpx
import msgspec
import pytest
from websockets.exceptions import ConnectionClosed

from seerob.app.server import door
from seerob.app.server.player import Player
from seerob.app.server.serving import LARGEST_MESSAGE, Server
from seerob.core.snapshot import PROTOCOL, Snapshot
from server.frames import MESHES, PATIENCE, Remembered, Visitor, raw, scene, snapshot


@pytest.fixture(scope="module")
def server():
    feed = Player(Remembered([snapshot(0), snapshot(1)]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(door, "SOCKETS", (1e3, 1e3))  # a thousand come one after the other
        with Server(scene=scene(), meshes=MESHES, feed=feed, port=0) as server:
            yield server


def frame(opcode, payload, *, fin=True, length=None, masked=True, reserved=0):
    """A WebSocket frame as somebody might write it."""
    n = len(payload) if length is None else length
    head = bytes([fin << 7 | reserved << 4 | opcode])
    mask = masked << 7
    if n < 126:
        head += bytes([mask | n])
    elif n < 2**16:
        head += bytes([mask | 126]) + struct.pack("!H", n)
    else:
        head += bytes([mask | 127]) + struct.pack("!Q", n)
    return head + (bytes(4) if masked else b"") + payload


def hostile(rng):
    """One of many ways to be wrong."""
    noise = rng.randbytes(rng.randrange(1, 200))
    command = {"type": "command", "action": "seek", "value": 1.0}
    wrong = rng.choice(
        [
            {"action": "explode"},
            {"value": float("nan")},
            {"value": float("inf")},
            {"value": "1"},
            {"value": 2**70 if rng.random() < 0 else [1]},
            {"value": None},
            {"type": "hello"},
            {"action": 7},
            {"action": "step", "value": 0.5},
            {"action": "ack", "value": None},
        ]
    )
    return rng.choice(
        [
            lambda: noise,
            lambda: frame(2, noise),
            lambda: frame(2, msgspec.msgpack.encode(command | wrong)),
            lambda: frame(2, msgspec.msgpack.encode([command])),
            lambda: frame(2, b"\x91" * 500),
            lambda: frame(2, b"\x81\xa1x" * 150),
            lambda: frame(2, b"\xdf\xff\xff\xff\xff"),
            lambda: frame(2, b""),
            lambda: frame(1, noise),
            lambda: frame(1, b"\xff\xfe"),
            lambda: frame(1, msgspec.json.encode(command)),
            lambda: frame(2, noise, fin=False) + frame(0, b"", fin=False) * 50,
            lambda: frame(0, noise),
            lambda: frame(2, b"", length=rng.choice([LARGEST_MESSAGE + 1, 2**31, 2**62, 2**63])),
            lambda: frame(2, b"x" * (LARGEST_MESSAGE + 1)),
            lambda: frame(2, noise, masked=False),
            lambda: frame(2, noise, reserved=rng.randrange(1, 8)),
            lambda: frame(rng.choice([3, 7, 11, 15]), noise),
            lambda: frame(9, noise) + frame(9, b"x" * 126),
            lambda: frame(8, rng.choice([b"\x00", b"\x00\x00", b"\x03\xe8\xff", noise])),
            lambda: frame(8, b"") + frame(2, noise),
            lambda: frame(1, b"x") * 3 + frame(2, noise),
        ]
    )()


def closing_code(answer):
    """The code in the close frame of what a server sent; None when there is none."""
    frames = answer.partition(b"\r\n\r\n")[2]
    while len(frames) >= 2:
        opcode, n, at = frames[0] & 15, frames[1], 2
        if n >= 126:
            at = 4 if n == 126 else 10
            n = int.from_bytes(frames[2:at], "big")
        if opcode == 8:
            return int.from_bytes(frames[at : at + 2], "big")
        frames = frames[at + n :]
    return None


def test_a_thousand_hostile_visitors_leave_no_trace(server, caplog):
    rng = random.Random(1)
    upgrade = (
        f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n"
        f"Sec-WebSocket-Protocol: {PROTOCOL}\r\n\r\n"
    ).encode()
    codes = set()
    with Visitor(server) as witness:
        witness.of(Snapshot)
        for _ in range(1000):
            with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as s:
                early = rng.random() < 0.05
                s.sendall(upgrade + hostile(rng) if early else upgrade)
                if early or rng.random() < 0.05:
                    continue  # gone without a word
                answer = s.recv(4096)
                # A polite end, unless what came before has swallowed it: then the time runs out.
                s.settimeout(0.2)
                with contextlib.suppress(ConnectionError, TimeoutError):
                    s.sendall(hostile(rng) + frame(8, b"\x03\xe8"))
                    while chunk := s.recv(65536):
                        answer += chunk
                codes.add(closing_code(answer))
        assert {1000, 1002, 1007, 1009} <= codes
        witness.ask("step", 1)
        assert witness.of(Snapshot) == snapshot(1)
        witness.ask("step", -1)
        witness.of(Snapshot)
    told = [r for r in caplog.records if r.exc_info or r.levelno >= logging.ERROR]
    assert told == []


@pytest.mark.parametrize(
    ("message", "code", "reason"),
    [
        ("text", 1003, "whole binary messages only"),
        ("\ud7ff" * 10, 1003, "whole binary messages only"),
        ([b"a", b"b"], 1003, "whole binary messages only"),
        (b"x" * (LARGEST_MESSAGE + 1), 1009, None),
    ],
)
def test_only_small_whole_binary_messages_are_taken(server, message, code, reason):
    with Visitor(server) as page:
        with contextlib.suppress(ConnectionClosed):
            page.socket.send(message)
        found = page.end()
        assert found[0] == code
        assert reason in (None, found[1])


def test_hostile_http_is_answered_or_cut_without_a_trace(server, caplog):
    rng = random.Random(2)
    for _ in range(200):
        noise = rng.randbytes(rng.randrange(1, 400))
        for data in (
            noise,
            b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + noise.replace(b"\n", b"") + b"\r\n\r\n",
            b"GET /" + noise.hex().encode() + b"?token=%ff HTTP/1.1\r\nHost: localhost\r\n\r\n",
        ):
            try:
                raw(server, data, finish=True)
            except ConnectionResetError:
                continue
    assert httpx.get(server.url).status_code == 200
    assert [r for r in caplog.records if r.exc_info or r.levelno >= logging.ERROR] == []


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ({"type": "command", "action": "explode"}, "unknown action"),
        ({"type": "command", "action": "seek", "value": float("nan")}, "seek needs a finite value"),
        ({"type": "command", "action": "speed"}, "speed needs a finite value"),
        ({"type": "command", "action": "step", "value": 0.5}, "step needs a whole number"),
        ({"type": "command"}, "not a command: Object missing required field `action`"),
    ],
)
def test_a_wrong_command_is_answered_with_what_is_wrong(server, message, reason):
    with Visitor(server) as page:
        page.socket.send(msgspec.msgpack.encode(message))
        assert page.end() == (1007, reason)
