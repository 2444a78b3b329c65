"""The page over TLS, as foreign clients see it: Python's ssl, websockets, curl and openssl."""

import argparse
import contextlib
import re
import shutil
import socket
import ssl
import subprocess
import time
from datetime import timedelta

import httpx
import pytest
import segno
from cryptography import x509
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from websockets.sync.client import connect

from seerob.app.console import visiting
from seerob.app.console.visiting import add_page, qr_code, reverse_port
from seerob.app.server import certificates, connection
from seerob.app.server.access import Tokens
from seerob.app.server.player import Player
from seerob.app.server.serving import Server
from seerob.core.errors import InputError
from seerob.core.snapshot import PROTOCOL, Snapshot
from server.frames import MESHES, PATIENCE, Remembered, Visitor, scene, snapshot

TOKENS = Tokens.made()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tls") / "made"


@pytest.fixture(scope="module")
def tls(folder):
    return certificates.own(folder, "0.0.0.0")


@pytest.fixture(scope="module")
def server(tls):
    feed = Player(Remembered([snapshot(0), snapshot(1)]))
    with pytest.MonkeyPatch.context() as patch:
        # A machine that is held up for seconds cuts who is not meant.
        patch.setattr(connection, "HANDSHAKE", PATIENCE)
        patch.setattr(connection.PromptRequests, "promptness", PATIENCE)
        with Server(
            scene=scene(), meshes=MESHES, feed=feed, host="0.0.0.0", port=0, tokens=TOKENS, tls=tls
        ) as server:
            yield server


@pytest.fixture(scope="module")
def trusting(tls):
    return ssl.create_default_context(cafile=tls.authority)


def test_a_client_that_trusts_the_authority_is_served_under_every_name(server, tls, trusting):
    assert server.url.startswith("https://localhost:")
    for name in {"localhost", "127.0.0.1", *(n for n in tls.names if n.count(".") == 3)}:
        with httpx.Client(verify=trusting, timeout=PATIENCE) as browser:
            first = browser.get(f"https://{name}:{server.port}/?token={TOKENS.view}")
            assert (first.status_code, first.headers["location"]) == (303, "/")
            assert "secure" in first.headers["set-cookie"].lower()
            assert browser.get(f"https://{name}:{server.port}/").status_code in (200, 503)
    with Visitor(server, path=f"/ws?token={TOKENS.view}", ssl=trusting) as page:
        assert page.of(Snapshot) == snapshot(0)


def test_a_client_that_does_not_know_the_authority_refuses(server):
    with pytest.raises(httpx.ConnectError, match="CERTIFICATE_VERIFY_FAILED"):
        httpx.get(server.url)
    with pytest.raises(ssl.SSLCertVerificationError):
        connect(f"wss://localhost:{server.port}/ws", subprotocols=[PROTOCOL])


def test_a_name_that_is_not_this_machines_is_not_believed(server, trusting):
    link = socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE)
    with link, pytest.raises(ssl.SSLCertVerificationError, match="match"):
        trusting.wrap_socket(link, server_hostname="cell.example")


@pytest.mark.filterwarnings("ignore:ssl.TLSVersion:DeprecationWarning")
def test_old_tls_and_clear_text_are_refused(server, tls):
    old = ssl.create_default_context(cafile=tls.authority)
    old.set_ciphers("ALL:@SECLEVEL=0")
    old.minimum_version, old.maximum_version = ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1
    link = socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE)
    with link, pytest.raises(ssl.SSLError, match=r"PROTOCOL_VERSION|EOF"):
        old.wrap_socket(link, server_hostname="localhost")
    with pytest.raises(httpx.RemoteProtocolError):
        httpx.get(f"http://127.0.0.1:{server.port}/?token={TOKENS.view}")


def test_a_page_that_is_not_encrypted_opens_no_socket_of_one_that_is(server, trusting):
    for origin, known in (
        (f"http://127.0.0.1:{server.port}", 403),
        (f"https://127.0.0.1:{server.port}", 101),
    ):
        # In one thread: two that write to and read from one ssl.SSLSocket may wait for each other for ever.
        link = socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE)
        with link, trusting.wrap_socket(link, server_hostname="127.0.0.1") as page:
            lines = (
                f"GET /ws?token={TOKENS.view} HTTP/1.1",
                f"Host: 127.0.0.1:{server.port}",
                f"Origin: {origin}",
                "Connection: Upgrade",
                "Upgrade: websocket",
                "Sec-WebSocket-Version: 13",
                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
                f"Sec-WebSocket-Protocol: {PROTOCOL}",
            )
            page.sendall("\r\n".join((*lines, "", "")).encode())
            with page.makefile("rb") as answer:
                assert int(answer.readline().split()[1]) == known


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_curl_is_served(server, tls):
    command = ["curl", "--silent", "--show-error", "--output", "/dev/null", "--write-out", "%{http_code}"]
    url = f"https://localhost:{server.port}/?token={TOKENS.view}"
    said = subprocess.run([*command, "--cacert", tls.authority, url], capture_output=True, text=True)
    assert (said.returncode, said.stdout) == (0, "303"), said.stderr
    assert subprocess.run([*command, url], capture_output=True).returncode == 60  # nobody it knows


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not installed")
def test_openssl_finds_the_chain_whole_and_the_authority_bound_to_this_machine(folder):
    said = subprocess.run(
        ["openssl", "verify", "-x509_strict", "-CAfile", folder / "authority.pem", folder / "server.pem"],
        capture_output=True,
        text=True,
    )
    assert said.returncode == 0, said.stderr
    text = subprocess.run(
        ["openssl", "x509", "-in", folder / "authority.pem", "-noout", "-text"],
        capture_output=True,
        text=True,
    ).stdout
    for part in (
        "CA:TRUE, pathlen:0",
        "Name Constraints: critical",
        "IP:192.168.0.0/255.255.0.0",
        "DNS:localhost",
    ):
        assert part in text


def shake_hands(*ends):
    """Two ends of TLS that talk to each other: who they are, and what they read and write."""
    for _ in range(5):
        for end, said, heard in ends:
            with contextlib.suppress(ssl.SSLWantReadError):
                end.do_handshake()
            heard.write(said.read())


@pytest.mark.parametrize(
    ("name", "believed"), [("bank.example", False), ("8.8.8.8", False), ("10.0.0.5", True)]
)
def test_the_authority_cannot_speak_for_others(folder, name, believed):
    forged = folder.parent / "forged.pem"
    forged.write_bytes(certificates._issue((name,), *certificates._authority(folder)))
    context = certificates._context()
    context.load_cert_chain(forged)
    client = ssl.create_default_context(cafile=folder / "authority.pem")
    to_client, from_client, to_server, from_server = (ssl.MemoryBIO() for _ in range(4))
    ours = client.wrap_bio(to_client, from_client, server_hostname=name), from_client, to_server
    theirs = context.wrap_bio(to_server, from_server, server_side=True), from_server, to_client
    if believed:
        shake_hands(ours, theirs)
        assert ours[0].version() == "TLSv1.3"
    else:
        with pytest.raises(ssl.SSLCertVerificationError, match="permitted subtree violation"):
            shake_hands(ours, theirs)


def test_it_is_made_once_kept_to_its_owner_and_renewed(folder, tls, monkeypatch):
    assert {file.stat().st_mode & 0o777 for file in folder.iterdir()} == {0o600}
    assert folder.stat().st_mode & 0o777 == 0o700
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    again = certificates.own(folder, "0.0.0.0")
    assert again.fingerprint == tls.fingerprint
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    moved = certificates.own(folder, "192.168.77.7")  # an address that it does not name yet
    assert "192.168.77.7" in moved.names
    assert (folder / "server.pem").read_bytes() != before["server.pem"]
    assert (folder / "authority.pem").read_bytes() == before["authority.pem"]
    monkeypatch.setattr(certificates, "RENEWED", timedelta(days=400))
    renewed = (folder / "server.pem").read_bytes()
    certificates.own(folder, "192.168.77.7")
    assert (folder / "server.pem").read_bytes() != renewed


def test_what_is_no_certificate_is_one_clear_error(tmp_path, folder):
    wrong = tmp_path / "wrong.pem"
    for text in (b"", b"no", (folder / "authority.pem").read_bytes()):
        wrong.write_bytes(text)
        with pytest.raises(InputError, match="--certificate and --key"):
            certificates.given(wrong, None)
    with pytest.raises(InputError, match="--certificate and --key"):
        certificates.given(tmp_path / "none.pem", None)
    with pytest.raises(InputError, match="--certificate and --key"):
        certificates.given(folder / "server.pem", folder / "authority.key")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "authority.pem").write_text("no")
    (tmp_path / "broken" / "authority.key").write_text("no")
    with pytest.raises(InputError, match="remove its files"):
        certificates.own(tmp_path / "broken", "0.0.0.0")


def test_a_certificate_of_ones_own_serves(folder, trusting):
    feed = Player(Remembered([snapshot(0)]))
    given = certificates.given(folder / "server.pem", None)
    with Server(scene=scene(), meshes={}, feed=feed, port=0, tls=given) as server:
        assert httpx.get(server.url, verify=trusting).status_code in (200, 503)


def test_a_certificate_s_own_name_is_what_others_ask_for(folder, tmp_path, monkeypatch):
    authority = x509.load_pem_x509_certificate((folder / "authority.pem").read_bytes())
    key = load_pem_private_key((folder / "authority.key").read_bytes(), None)
    file = tmp_path / "cell.pem"
    names = ["*.plant.example", "cell.plant.example", "localhost"]
    file.write_bytes(certificates._issue(names, authority, key))
    given = certificates.given(file, None)
    assert given.names == ("cell.plant.example", "localhost")
    with Server(
        scene=scene(), meshes={}, feed=Player(Remembered([snapshot(0)])), port=0, tls=given
    ) as server:
        for host, codes in (("cell.plant.example", (200, 503)), ("other.plant.example", (403,))):
            headers = {"Host": f"{host}:{server.port}"}
            assert httpx.get(server.url, verify=False, headers=headers).status_code in codes
    monkeypatch.setattr(visiting, "address_for_others", lambda: "192.0.2.7")
    assert visiting.name_for_others(given.names) == "cell.plant.example"
    assert visiting.name_for_others(("192.0.2.7", "cell.plant.example")) == "192.0.2.7"
    assert visiting.name_for_others(("localhost", "127.0.0.1")) == "192.0.2.7"


def test_who_begins_tls_and_does_not_go_on_is_counted_and_cut(tls, monkeypatch):
    monkeypatch.setattr(connection, "HANDSHAKE", 0.3)
    monkeypatch.setattr(connection.Doorstep, "most", 5)
    feed = Player(Remembered([snapshot(0)]))
    with (
        contextlib.ExitStack() as held,
        Server(scene=scene(), meshes={}, feed=feed, port=0, tls=tls) as server,
    ):
        begun = time.monotonic()
        silent = [socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) for _ in range(8)]
        for one in silent:
            held.enter_context(one)
            with contextlib.suppress(ConnectionError):
                assert one.recv(1) == b""
        assert time.monotonic() - begun < PATIENCE / 2


# -- whom to trust ------------------------------------------------------------------------------


def test_a_device_that_knows_nothing_is_told_whom_to_trust_and_of_nothing_else(server, tls, folder, tmp_path):
    base = f"https://localhost:{server.port}"
    with httpx.Client(verify=False, timeout=PATIENCE) as stranger:
        told = stranger.get(f"{base}/trust")
        assert told.status_code == 200
        assert tls.fingerprint in told.text
        assert told.headers["content-security-policy"].startswith("default-src 'none'")
        pem, der = (stranger.get(f"{base}/trust/authority.{kind}") for kind in ("pem", "cer"))
        assert pem.content == (folder / "authority.pem").read_bytes()
        for path in (
            "/",
            "/trust/authority.key",
            "/trust/server.pem",
            "/trust/..%2fserver.pem",
            "/mesh/x.glb",
        ):
            assert stranger.get(f"{base}{path}").status_code == 401
    # Whoever trusts that and nothing else is served.
    trusting = ssl.create_default_context(cadata=der.content)
    assert [c["subject"] for c in trusting.get_ca_certs()]
    with connect(
        f"wss://localhost:{server.port}/ws?token={TOKENS.view}", ssl=trusting, subprotocols=[PROTOCOL]
    ) as page:
        assert b"hello" in page.recv()[:20]
    kept = tmp_path / "kept.pem"
    kept.write_bytes(pem.content)
    for program in (
        ["curl", "-sf", "--cacert", kept, f"{base}/trust"],
        ["openssl", "x509", "-in", kept, "-noout", "-fingerprint", "-sha256"],
    ):
        if shutil.which(program[0]):
            said = subprocess.run(program, capture_output=True, text=True, check=True).stdout
            assert tls.fingerprint in said


def test_where_no_authority_was_made_nobody_is_told_to_trust_one():
    feed = Player(Remembered([snapshot(0)]))
    with Server(scene=scene(), meshes=MESHES, feed=feed, port=0, tokens=TOKENS) as server:
        assert httpx.get(f"http://localhost:{server.port}/trust").status_code == 404
        with httpx.Client() as stranger:
            asked = [stranger.get(f"http://localhost:{server.port}/trust").status_code for _ in range(60)]
        assert set(asked) <= {404, 429}


def test_the_qr_code_on_a_terminal_is_the_address_with_its_token():
    address = f"https://192.0.2.7:8080/?token={TOKENS.track}"
    rows = [line for line in qr_code(address).splitlines() if line.strip()]
    bits = []
    for line in rows:  # two modules above one another per character
        text = re.sub(r"\x1b\[[0-9;]*m", "", line)
        bits.append([char in "█▀" for char in text])
        bits.append([char in "█▄" for char in text])
    expected = [
        list(map(bool, row)) for row in segno.make(address, error="l", micro=False).matrix_iter(border=2)
    ]
    n = len(expected)
    light = [[not b for b in row[:n]] for row in bits[:n]]
    assert light == expected or [row[:n] for row in bits[:n]] == expected
    # Another token is another picture.
    assert qr_code(address) != qr_code(address.replace(TOKENS.track, TOKENS.view))


@pytest.mark.parametrize(("lan", "qr"), [("--lan", "track"), ("--lan=view", "view")])
def test_lan_listens_everywhere_with_tokens_and_tls_and_another_host_is_kept(lan, qr):
    parser = argparse.ArgumentParser()
    add_page(parser)
    assert parser.parse_args([]).host == "127.0.0.1"
    assert (parser.parse_args([lan]).host, parser.parse_args([lan]).lan) == ("0.0.0.0", qr)
    assert parser.parse_args(["--host", "192.0.2.7", lan]).host == "192.0.2.7"


def test_without_adb_it_is_said_what_to_install():
    with pytest.raises(InputError, match="there is no program"):
        reverse_port(8080, adb="no-such-adb")
    assert reverse_port(8080, adb="false") == "adb ended with 1"
