"""Who is let in, what every answer carries, and what hostile visitors can do: nothing."""

import contextlib
import logging
import random
import socket
import struct

import httpx
import msgspec
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from seerob.errors import InputError
from seerob.server.door import HEADERS, is_loopback
from seerob.server.live import Live
from seerob.server.player import Player
from seerob.server.serving import LARGEST_MESSAGE, Server
from seerob.snapshot import PROTOCOL, Snapshot
from server.frames import MESHES, Remembered, Visitor, scene, snapshot, stripped

TOKEN = "0123456789abcdef0123456789abcdef"
HASH = next(iter(MESHES))


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("built") / "page"
    (folder / "assets").mkdir(parents=True)
    (folder / "index.html").write_text("<!doctype html><title>page</title>", encoding="utf-8")
    (folder / "assets" / "main-1a2b.js").write_text("export {};", encoding="utf-8")
    (folder / ".hidden").write_text("no", encoding="utf-8")
    (folder.parent / "secret.txt").write_text("secret", encoding="utf-8")
    (folder / "link.txt").symlink_to(folder.parent / "secret.txt")
    return folder


def serve(folder, **options):
    feed = Player(Remembered([snapshot(0), snapshot(1)]))
    return Server(scene=scene(), meshes=MESHES, feed=feed, port=0, page=folder, **options)


@pytest.fixture(scope="module")
def server(page):
    with serve(page, hosts=("cell3.example",), origins=("https://line.example",)) as server:
        yield server


def raw(server, data, *, finish=False):
    """What the server answers to bytes, until it closes."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=5) as s:
        s.sendall(data)
        if finish:
            s.shutdown(socket.SHUT_WR)
        answer = b""
        while chunk := s.recv(65536):
            answer += chunk
        return answer


@pytest.mark.parametrize(
    "path", ["/", "/assets/main-1a2b.js", f"/mesh/{HASH}.glb", "/none", "/mesh/none.glb"]
)
def test_every_answer_carries_the_headers(server, path):
    answer = httpx.get(server.url.rstrip("/") + path)
    for name, value in HEADERS.items():
        assert answer.headers[name] == value
    assert answer.headers["cache-control"] == (
        "private, max-age=31536000, immutable" if HASH in path else "no-store"
    )
    assert answer.status_code == (404 if "none" in path else 200)


def test_refusals_and_wrong_methods_carry_the_headers_too(server):
    for answer in (
        httpx.get(server.url, headers={"Host": "evil.example"}),
        httpx.post(server.url),
        httpx.options(server.url),
    ):
        assert answer.status_code in (403, 405)
        assert {name: answer.headers[name] for name in HEADERS} == HEADERS


def test_pages_and_meshes_arrive_as_they_are(server):
    index = httpx.get(server.url)
    assert (index.text, index.headers["content-type"]) == (
        "<!doctype html><title>page</title>",
        "text/html; charset=utf-8",
    )
    script = httpx.get(server.url + "assets/main-1a2b.js")
    assert script.headers["content-type"] == "text/javascript; charset=utf-8"
    mesh = httpx.get(server.url + f"mesh/{HASH}.glb")
    assert (mesh.content, mesh.headers["content-type"]) == (MESHES[HASH], "model/gltf-binary")
    assert httpx.head(server.url).status_code == 200


@pytest.mark.parametrize(
    "path",
    [
        "/../secret.txt",
        "/..%2fsecret.txt",
        "/%2e%2e/secret.txt",
        "/assets/../../secret.txt",
        "/assets/..%5c..%5csecret.txt",
        "//secret.txt",
        "/link.txt",
        "/.hidden",
        "/mesh/../secret.txt",
        "/mesh/..%2f..%2fsecret.txt",
        "/%00",
        "/assets",
        "/" + "a" * 5000,
    ],
)
def test_no_path_leads_out_of_the_page(server, path):
    answer = raw(server, f"GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
    assert answer.startswith((b"HTTP/1.1 404", b"HTTP/1.1 400"))
    assert b"secret\n" not in answer.lower()
    assert not answer.endswith(b"secret")


def test_a_page_that_was_not_built_says_how(tmp_path):
    for folder in (tmp_path, tmp_path / "none"):
        with serve(folder) as server:
            for path in ("", "assets/x.js"):
                answer = httpx.get(server.url + path)
                assert answer.status_code == 503
                assert "make web" in answer.text
            with Visitor(server) as page:  # a script needs no page
                assert page.of(Snapshot) == stripped(snapshot(0))


@pytest.mark.parametrize(
    ("host", "allowed"),
    [
        ("127.0.0.1:{port}", True),
        ("localhost:9000", True),  # a forwarded port
        ("LOCALHOST", True),
        ("[::1]:80", True),
        ("192.168.0.10", True),
        ("cell3.example:80", True),
        ("Cell3.Example", True),
        ("evil.example:{port}", False),
        ("127.0.0.1.evil.example", False),
        ("localhost.evil.example", False),
        ("evil.example@127.0.0.1", False),
        ("127.0.0.1 evil", False),
        ("[evil]", False),
        ("0x7f.1", False),
        ("", False),
    ],
)
def test_only_addresses_and_known_names_are_served(server, host, allowed):
    host = host.format(port=server.port)
    head = f"GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n".encode()
    assert (b" 200 " in raw(server, head).split(b"\r\n")[0]) == allowed
    upgrade = f"GET /ws HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n".encode()
    upgrade += b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n"
    upgrade += f"Sec-WebSocket-Protocol: {PROTOCOL}\r\n\r\n".encode()
    with socket.create_connection(("127.0.0.1", server.port), timeout=5) as s:
        s.sendall(upgrade)
        first = s.recv(4096)
        assert (b" 101 " in first.split(b"\r\n")[0]) == allowed
        assert b"cross-origin-opener-policy: same-origin" in first.lower() or b" 400 " in first


def test_without_a_host_nothing_is_served(server):
    assert b" 200 " not in raw(server, b"GET / HTTP/1.0\r\n\r\n", finish=True).split(b"\r\n")[0]


def test_a_websocket_comes_from_the_page_itself(server):
    own = f"http://127.0.0.1:{server.port}"
    for origin in (None, own, "https://line.example"):
        with Visitor(server, origin=origin) as page:
            assert page.of(Snapshot)
    others = (
        "http://evil.example",
        "null",
        own + "0",
        "http://127.0.0.1",
        "file://",
        f"ftp://127.0.0.1:{server.port}",
    )
    for origin in others:
        with pytest.raises(InvalidStatus) as refused:
            Visitor(server, origin=origin)
        assert refused.value.response.status_code == 403
        assert b"origin" in refused.value.response.body


@pytest.mark.parametrize(
    "offered", [["seerob.v2.msgpack"], ["seerob.v1"], ["SEEROB.V1.MSGPACK"], ["wamp.2.json", "x"]]
)
def test_another_protocol_is_refused_in_words(server, offered):
    with Visitor(server, subprotocols=offered) as page:
        assert page.end() == (1002, f"this server speaks {PROTOCOL} only")


def test_no_protocol_is_refused_too(server):
    with Visitor(server, subprotocols=None) as page:
        assert page.end() == (1002, f"this server speaks {PROTOCOL} only")


def test_the_right_protocol_among_others_is_taken(server):
    with Visitor(server, subprotocols=["x", PROTOCOL]) as page:
        assert page.socket.subprotocol == PROTOCOL
        assert page.socket.protocol.extensions == []


# -- tokens -------------------------------------------------------------------------------------


def test_a_token_is_needed_for_everything(page):
    with serve(page, token=TOKEN) as server:
        base = f"http://127.0.0.1:{server.port}/"
        assert server.url == f"{base}?token={TOKEN}"
        for path in (
            "",
            "?token=",
            "?token=" + TOKEN[:-1],
            "assets/main-1a2b.js",
            f"mesh/{HASH}.glb",
            "?token=%ff",
        ):
            assert httpx.get(base + path).status_code == 401
        for query in ("", "?token=wrong"):
            with pytest.raises(InvalidStatus):
                Visitor(server, path="/ws" + query)
        with Visitor(server, path=f"/ws?token={TOKEN}") as visitor:
            assert visitor.of(Snapshot)


def test_the_token_moves_from_the_address_to_a_cookie(page):
    with serve(page, token=TOKEN) as server, httpx.Client() as browser:
        first = browser.get(server.url)
        assert (first.status_code, first.headers["location"]) == (303, "/")
        cookie = first.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=lax" in cookie
        base = f"http://127.0.0.1:{server.port}"
        assert browser.get(base + "/").status_code == 200
        assert browser.get(f"{base}/mesh/{HASH}.glb").status_code == 200
        cookies = "; ".join(f"{k}={v}" for k, v in browser.cookies.items())
        with Visitor(server, additional_headers={"Cookie": cookies}) as visitor:
            assert visitor.of(Snapshot)


def test_others_can_reach_it_only_with_a_token():
    for host in ("0.0.0.0", "192.0.2.7", "::", "cell.example"):
        with pytest.raises(InputError, match="give a token, or listen on"):
            Server(scene=scene(), meshes={}, feed=Live(), host=host, port=0).start()
    for token in ("", "short", "with space and more", "ü" * 20, "a;b=" * 8):
        with pytest.raises(InputError, match="token"):
            Server(scene=scene(), meshes={}, feed=Live(), token=token, port=0).start()
    with Server(scene=scene(), meshes={}, feed=Live(), host="0.0.0.0", port=0, token=TOKEN) as server:
        assert server.url == f"http://localhost:{server.port}/?token={TOKEN}"
        with Visitor(server, path=f"/ws?token={TOKEN}") as visitor:
            visitor.read()


@pytest.mark.parametrize(
    ("host", "alone"),
    [
        ("127.0.0.1", True),
        ("127.8.8.8", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
    ],
)
def test_what_only_this_machine_can_reach(host, alone):
    assert is_loopback(host) is alone


def test_an_address_that_is_not_ours_is_one_clear_error():
    server = Server(scene=scene(), meshes={}, feed=Live(), host="192.0.2.7", token=TOKEN, port=0)
    with pytest.raises(InputError, match="cannot listen on"):
        server.start()


# -- hostile visitors ---------------------------------------------------------------------------


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
            with socket.create_connection(("127.0.0.1", server.port), timeout=5) as s:
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
        assert witness.of(Snapshot) == stripped(snapshot(1))
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
