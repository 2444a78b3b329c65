"""Who is let in, and what every answer carries."""

import socket

import httpx
import pytest
from websockets.exceptions import InvalidStatus

from seerob.app.server.access import Tokens
from seerob.app.server.door import HEADERS
from seerob.app.server.live import Live
from seerob.app.server.player import Player
from seerob.app.server.serving import Server
from seerob.core.errors import InputError
from seerob.core.host_name import is_loopback
from seerob.core.snapshot import PROTOCOL, Snapshot
from server.frames import MESHES, PATIENCE, Remembered, Visitor, raw, scene, snapshot

TOKENS = Tokens.made()
TOKEN = TOKENS.view
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
                assert page.of(Snapshot) == snapshot(0)


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
    with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as s:
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
    "offered", [["seerob.v1.msgpack"], ["seerob.v2"], ["SEEROB.V2.MSGPACK"], ["wamp.2.json", "x"]]
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
    with serve(page, tokens=TOKENS) as server:
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
    with serve(page, tokens=TOKENS) as server, httpx.Client() as browser:
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


def test_others_can_reach_it_only_with_tokens_and_encrypted_or_told_so_in_words():
    for host in ("0.0.0.0", "192.0.2.7", "::", "cell.example"):
        with pytest.raises(InputError, match="give tokens, or listen on"):
            Server(scene=scene(), meshes={}, feed=Live(), host=host, port=0).start()
        with pytest.raises(InputError, match="not encrypted; give --certificate"):
            Server(scene=scene(), meshes={}, feed=Live(), host=host, port=0, tokens=TOKENS).start()
    with Server(
        scene=scene(), meshes={}, feed=Live(), host="0.0.0.0", port=0, tokens=TOKENS, clear_text=True
    ) as server:
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
    server = Server(
        scene=scene(), meshes={}, feed=Live(), host="198.51.100.7", tokens=TOKENS, clear_text=True, port=0
    )
    with pytest.raises(InputError, match="cannot listen on"):
        server.start()
