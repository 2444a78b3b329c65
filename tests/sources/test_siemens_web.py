"""A PLC asked through its web server, over real HTTP and HTTPS."""

from __future__ import annotations

import asyncio
import datetime
import json
import socket
from contextlib import suppress
from pathlib import Path

import httpx
import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from live_story import listening, wait_for
from reached import reached
from relay import Stream
from seerob.app.emulators.siemens_web import SiemensWebServer
from seerob.core.errors import InputError
from seerob.devices.sources.siemens_web import SiemensWeb
from seerob.protocols import ProtocolError
from seerob.protocols.plc.s7_web import PATH, reading, result, results
from seerob.workstation.source import Target
from seerob.workstation.variables import Kind, Variable

SPEED = Variable(name="belt/speed", source="plc", address='"Belt".speed', unit="mm/s", timeout=1)
RUNS = Variable(name="belt/runs", source="plc", address='"Belt".runs', type=Kind.BOOL, timeout=1)
GONE = Variable(name="gone", source="plc", address='"Gone".x', unit="1", timeout=1)
PROGRAM = {'"Belt".speed': lambda t: 250.0, '"Belt".runs': lambda t: True}
TARGET = Target(variables=(SPEED, RUNS, GONE))


@pytest.fixture(autouse=True)
def password(monkeypatch):
    monkeypatch.setenv("SEEROB_PLC_PASSWORD", "secret")
    monkeypatch.setenv("SEEROB_PLC_PASSWORD_HOST", "127.0.0.1")


def plc(**more):
    return SiemensWebServer(PROGRAM, user="twin", password="secret", **more)


def source(server, **more):
    options = {
        "name": "plc",
        "url": server.url,
        "user": "twin",
        "password_env": "SEEROB_PLC_PASSWORD",
        "every": 0.05,
    }
    return SiemensWeb(**(options | more))


def good(heard):
    return bool(heard) and "belt/speed" not in heard[-1].doubts and "belt/speed" in heard[-1].values


def test_variables_arrive_and_the_session_is_given_back():
    with plc() as server:
        with listening(source(server), TARGET) as heard:
            wait_for(lambda: good(heard))
            assert heard[-1].values == {"belt/speed": 0.25, "belt/runs": True}
            assert "Address does not exist" in heard[-1].doubts["gone"]
            assert len(server.sessions) == 1
        assert not server.sessions


def test_a_plc_that_is_switched_off_and_on_is_asked_again(monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.02)
    server = plc().start()
    try:
        with listening(source(server), TARGET) as heard:
            for _ in range(3):
                wait_for(lambda: good(heard))
                server.stop()
                heard.clear()
                server.start()
            wait_for(lambda: good(heard))
            # A token that the PLC has forgotten is asked for anew.
            server.sessions.clear()
            wait_for(
                lambda: (
                    any("Permission denied" in s.doubts.get("gone", "") for s in heard) or server.sessions
                ),
                20,
            )
    finally:
        server.stop()


def signed(folder):
    """A certificate of this machine's own, as a PLC makes one for itself."""
    from ipaddress import ip_address

    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.oid.NameOID.COMMON_NAME, "plc")])
    now = datetime.datetime.now(datetime.UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(7)
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))]), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    (folder / "plc.pem").write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    (folder / "key.pem").write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return folder / "plc.pem", folder / "key.pem"


def test_only_the_certificate_that_was_given_is_trusted(tmp_path):
    with plc(certificate=signed(tmp_path)) as server:
        with listening(
            source(server, ca="plc.pem"), msgspec.structs.replace(TARGET, folder=str(tmp_path))
        ) as heard:
            wait_for(lambda: good(heard))
        said = reached(source(server, ca="plc.pem"), tmp_path, TARGET)
        assert "asked from https" in said[1].text
        said = " ".join(f.text for f in reached(source(server), tmp_path, TARGET))
        assert "not reached at start" in said
        assert "certificate verify failed" in said.lower()


def test_a_wrong_password_is_said(monkeypatch):
    monkeypatch.setenv("SEEROB_PLC_PASSWORD", "guessed")
    monkeypatch.setenv("SEEROB_PLC_PASSWORD_HOST", "127.0.0.1")
    with plc() as server:
        said = " ".join(f.text for f in reached(source(server), None, None))
        assert "Login failed" in said
        assert not server.sessions


def test_a_password_does_not_travel_unencrypted(tmp_path):
    with pytest.raises(ValueError, match="unencrypted"):
        SiemensWeb(url="http://192.168.0.1", user="a", password_env="SEEROB_PLC_PASSWORD")
    wrong = SiemensWeb(url="https://192.168.0.1", user="a", password_env="SEEROB_NONE", ca="gone.pem")
    bad = Variable(name="bad", source="plc", address=5, unit="1")
    target = Target(name="", joints=(), units=(), lower=(), upper=(), velocity=(), variables=(bad,))
    with pytest.raises(InputError) as caught:
        wrong.open(tmp_path, target)
    for part in ("bad.address", "SEEROB_NONE", "gone.pem"):
        assert part in str(caught.value)


def test_browsing_finds_what_can_be_read():
    import asyncio

    async def found(server):
        return [node.address async for node in source(server).browse()]

    with plc() as server:
        assert sorted(asyncio.run(found(server))) == sorted(PROGRAM)


def test_a_foreign_client_is_answered_as_the_standard_says():
    with plc() as server:
        url = f"{server.url}/api/jsonrpc"
        answer = httpx.post(url, content=reading(["a"])).json()
        assert answer == [{"jsonrpc": "2.0", "id": 0, "error": {"code": 2, "message": "Permission denied"}}]


# -- answers ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "no JSON"),
        (b"5", "no JSON-RPC"),
        (b"{}", "without a result"),
        (b'{"error": {"message": "no", "code": 4}}', "the PLC says: no"),
        (b'{"error": 5}', "the PLC says"),
    ],
)
def test_answers_that_are_none(data, says):
    with pytest.raises(ProtocolError, match=says):
        result(data)
    with pytest.raises(ProtocolError):
        results(data, 1)


VALUES = st.none() | st.integers(-3, 3) | st.text(max_size=3) | st.just({"message": 5}) | st.just([[]])


@given(st.lists(VALUES | st.dictionaries(st.sampled_from(["id", "result", "error"]), VALUES), max_size=5))
def test_any_batch_is_an_outcome_per_question(answers):
    found = results(json.dumps(answers).encode(), 3)
    assert len(found) == 3
    assert all(isinstance(why, str) for _, why in found)


def half_asked(server):
    """A connection on which a request has begun."""
    asking = socket.create_connection((server.host, server.port))
    head = f"POST {PATH} HTTP/1.1\r\nHost: plc\r\nContent-Length: 100\r\n\r\n"
    asking.sendall(head.encode() + b"{")
    return asking


def test_a_plc_that_is_switched_off_within_a_request_says_nothing_of_it(caplog):
    caplog.set_level("ERROR")
    with plc() as server:
        with half_asked(server):
            assert httpx.get(server.url).status_code == 404  # by now it has read the one before, too
            server.stop()
        server.start()
        half_asked(server).close()
        assert httpx.get(server.url).status_code == 404
    assert not caplog.records


@pytest.mark.parametrize(
    ("asked", "code"),
    [
        (b"{", -32700),
        (b"[" * 100_000, -32700),
        (b"[1, {}]", -32600),
        (b'{"method": 1, "id": 1, "params": 2}', 2),
    ],
)
def test_a_plc_answers_what_is_no_request(caplog, asked, code):
    with plc() as server:
        said = httpx.post(server.url + PATH, content=asked).json()
    first = said[0] if isinstance(said, list) else said
    assert first["error"]["code"] == code
    assert not [r for r in caplog.records if r.levelname == "ERROR"]


def test_sessions_that_lost_connections_have_left_are_given_back():
    """A PLC has four; ten losses in a row must not take them all."""

    async def logged_in(found, wire, *, lost):
        with suppress(ConnectionError):
            async with found._session(Path()):
                if lost:
                    wire.deaf = True
                    wire.cut()
                    raise ConnectionError

    with plc() as server:
        wire = Stream(server.port)
        found = source(server, url=f"http://127.0.0.1:{wire.port}")
        for k in range(10):
            asyncio.run(logged_in(found, wire, lost=True))
            wire.deaf = False
            assert len(server.sessions) == 1, k
        asyncio.run(logged_in(found, wire, lost=False))
        wire.close()
        assert not server.sessions
