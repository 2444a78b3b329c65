"""Strict OPC UA servers, of asyncua alone: who is let in, and what a client is told that is not."""

from __future__ import annotations

import asyncio
import datetime
import logging

import pytest

pytest.importorskip("asyncua")

from foreign_opcua import URI, strict_opcua
from live_story import listening, wait_for
from reached import reached
from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.devices.sources.opcua import Opcua
from seerob.protocols import NotLetIn, ProtocolError
from seerob.protocols.plc.opcua_client import Security, Way, connect, endpoints, own_uri
from seerob.protocols.plc.opcua_security import (
    Endpoint,
    certificate,
    first_of,
    made,
    why_refused,
)
from seerob.workstation.source import Target
from seerob.workstation.variables import Kind, Variable


def words(text):
    return " ".join(text.split())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of a user who has made certificates by the command; the server trusts `twin`, and not `stranger`."""
    found = tmp_path_factory.mktemp("certificates")
    for name, more in (("twin", ["--uri", "urn:acme:twin"]), ("stranger", [])):
        assert cli.main(["opcua", "certificate", "-o", str(found / name), *more]) == Exit.WITHIN
    return found


@pytest.fixture(scope="module")
def server(folder):
    with strict_opcua(folder, [(folder / "twin.der").read_bytes()]) as address:
        yield address


@pytest.fixture(autouse=True)
def patience(monkeypatch, request):
    """A machine under load answers late; and the password may go to the server alone."""
    monkeypatch.setattr("seerob.devices.live.listening.ASK_WITHIN", 30.0)
    if "server" in request.fixturenames:
        address = request.getfixturevalue("server").removeprefix("opc.tcp://")
        for name, value in (("RIGHT", "right"), ("WRONG", "wrong")):
            monkeypatch.setenv(f"SEEROB_{name}", value)
            monkeypatch.setenv(f"SEEROB_{name}_HOST", address)


def way(address, who="twin", **more):
    own = {"security": Security.ENCRYPT, "certificate": f"{who}.pem", "key": f"{who}-key.pem"}
    return Way(url=address, **(own | {"user": "op", "password_env": "SEEROB_RIGHT"} | more))


def answer(way, folder):
    async def ask():
        async with connect(way, folder) as client:
            return await client.get_namespace_array()

    return asyncio.run(ask())


@pytest.mark.parametrize("security", [Security.ENCRYPT, Security.SIGN])
def test_a_strict_server_takes_a_certificate_by_the_uri_that_it_names(server, folder, security):
    assert URI in answer(way(server, security=security), folder)
    assert URI in answer(way(server, server_certificate="server.der"), folder)


def refused(way, folder):
    with pytest.raises(NotLetIn) as caught:
        answer(way, folder)
    return str(caught.value)


def test_who_is_not_let_in_is_told_why(server, folder):
    own = certificate((folder / "stranger.pem").read_bytes())
    said = refused(way(server, "stranger"), folder)
    assert f"does not take the own certificate {own}" in said
    assert own.uris == (own_uri(),)
    said = refused(way(server, password_env="SEEROB_WRONG"), folder)
    assert "refuses the login of 'op'" in said
    assert "user and password" in refused(way(server, user=None, password_env=None), folder)
    said = refused(
        way(server, security=Security.NONE, certificate=None, key=None, user=None, password_env=None), folder
    )
    assert 'does not offer security = "none"' in said
    assert 'security = "sign" with Basic256Sha256; login: user and password' in said


def test_another_server_than_the_one_that_is_pinned_is_named(server, folder):
    said = refused(way(server, server_certificate="stranger.pem"), folder)
    for file in ("server.der", "stranger.pem"):
        assert certificate((folder / file).read_bytes()).fingerprint in said
    assert "--server-certificate" in said


def test_a_listener_says_that_it_is_not_let_in(server, folder, caplog):
    lamp = Variable(name="lamp", source="plc", type=Kind.BOOL, address=f"nsu={URI};s=lamp")
    target = Target(variables=(lamp,), folder=str(folder))

    def source(password):
        return Opcua(
            name="plc", url=server, security=Security.ENCRYPT, certificate="twin.pem", key="twin-key.pem",
            user="op", password_env=password,
        )  # fmt: skip

    with listening(source("SEEROB_RIGHT").beside(folder), target) as heard:
        wait_for(lambda: heard and heard[-1].values.get("lamp") is True)
    findings = reached(source("SEEROB_RIGHT"), folder, target)
    shown = certificate((folder / "server.der").read_bytes())
    assert any(f.level == "assumed" and shown.fingerprint in f.text for f in findings)
    said = " ".join(f.text for f in reached(source("SEEROB_WRONG"), folder, target))
    assert "not let in at start: the server refuses the login of 'op'" in said
    with caplog.at_level(logging.WARNING), listening(source("SEEROB_WRONG").beside(folder), target):
        wait_for(lambda: "plc: not let in: the server refuses the login of 'op'" in caplog.text)


def probe(server, folder, *more):
    given = ["certificate=twin.pem", "key=twin-key.pem", "security=encrypt", "user=op"]
    options = [word for pair in given for word in ("--set", pair)]
    return cli.main(["probe", "opcua", server, *options, *more])


def test_probe_lists_what_is_offered_and_pins_the_certificate(server, folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    file = folder / "plc.pem"
    right = ["--set", "password_env=SEEROB_RIGHT", "--seconds", "1"]
    assert probe(server, folder, *right, "--server-certificate", str(file)) == Exit.WITHIN
    said = words(capsys.readouterr().out)
    assert 'security = "encrypt" with Basic256Sha256; login: user and password' in said
    shown = certificate((folder / "server.der").read_bytes())
    assert shown.fingerprint in said.replace(" ", "")
    assert certificate(file.read_bytes()) == shown
    assert f'server_certificate = "{file}"' in said.replace(" \n", "")
    # What is there is not written over, and a login that is refused is no machine that is switched off.
    assert probe(server, folder, *right, "--server-certificate", str(file)) == Exit.ERROR
    assert "new file" in words(capsys.readouterr().err)
    assert probe(server, folder, "--set", "password_env=SEEROB_WRONG") == Exit.ERROR
    said = words(capsys.readouterr().err)
    assert "not let in: the server refuses the login of 'op'" in said
    assert "switched on" not in said


def test_what_is_no_opc_ua_has_no_certificate_to_write(capsys, tmp_path):
    file = tmp_path / "a.pem"
    assert cli.main(["probe", "rtde", "127.0.0.1", "--server-certificate", str(file)]) == Exit.ERROR
    assert "no certificate of the server" in words(capsys.readouterr().err)
    assert not file.exists()


def test_a_certificate_is_what_the_standard_wants(folder, capsys):
    """OPC 10000-6, 6.2.2."""
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    found = x509.load_pem_x509_certificate((folder / "twin.pem").read_bytes())
    key = load_pem_private_key((folder / "twin-key.pem").read_bytes(), None)
    assert (folder / "twin-key.pem").stat().st_mode & 0o077 == 0
    assert found.public_key() == key.public_key()
    assert key.key_size >= 2048
    found.verify_directly_issued_by(found)
    names = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.UniformResourceIdentifier) == ["urn:acme:twin"]
    usage = found.extensions.get_extension_for_class(x509.KeyUsage).value
    assert all(
        (usage.digital_signature, usage.content_commitment, usage.key_encipherment, usage.data_encipherment)
    )
    assert x509.load_der_x509_certificate((folder / "twin.der").read_bytes()) == found
    assert cli.main(["opcua", "certificate", "-o", str(folder / "twin")]) == Exit.ERROR
    assert "exists already" in capsys.readouterr().err
    for more in (["--uri", "no uri"], ["--days", "0"]):
        assert cli.main(["opcua", "certificate", "-o", str(folder / "other"), *more]) == Exit.ERROR


def test_a_chain_begins_with_the_server_itself():
    first, second = (made(f"urn:a:{k}", "a", ["a"]).der for k in range(2))
    assert first_of(first + second) == first
    assert first_of(b"") == b""


def test_what_is_wrong_with_the_own_certificate_is_said_before_whether_it_is_trusted():
    offered = [Endpoint("opc.tcp://a", "encrypt", "Basic256Sha256", b"", ("anonymous",))]
    good = certificate(made("urn:a:b", "a", ["a"]).pem)
    now = datetime.datetime.now(datetime.UTC)
    late = good._replace(ends=now - datetime.timedelta(days=1))

    def said(own):
        return why_refused(offered, "encrypt", error="", own=own, user=None)

    assert "holds from" in said(late)
    assert "no application URI" in said(good._replace(uris=()))
    assert "let it be trusted" in said(good)
    # Without protection, and where a login is not what is refused, nothing speaks for a refusal.
    plain = [Endpoint("opc.tcp://a", "none", "None", b"", ("anonymous",))]
    assert why_refused(plain, "none", error="BadTooManySessions", own=None, user=None) == ""


def test_who_offers_nothing_is_no_server(unused_tcp_port_of_a_web_server):
    with pytest.raises((OSError, ProtocolError)):
        asyncio.run(endpoints(f"opc.tcp://127.0.0.1:{unused_tcp_port_of_a_web_server}"))


@pytest.fixture
def unused_tcp_port_of_a_web_server():
    from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
    from threading import Thread

    with ThreadingHTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler) as server:
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield server.server_address[1]
        server.shutdown()
