"""A secret goes to the host that the user allowed, and to nobody else."""

import select
import socket

import pytest

from seerob.core.errors import InputError
from seerob.devices.sources.mqtt import Mqtt
from seerob.devices.sources.opcua import Opcua
from seerob.devices.sources.siemens_web import SiemensWeb
from seerob.devices.sources.web import Web
from seerob.protocols.links.credentials import Server, refusal

KINDS = {
    "web": lambda port, env: Web(name="a", url=f"http://127.0.0.1:{port}/x", token_env=env),
    "mqtt": lambda port, env: Mqtt(name="a", host="127.0.0.1", port=port, user="u", password_env=env),
    "opcua": lambda port, env: Opcua(name="a", url=f"opc.tcp://127.0.0.1:{port}", user="u", password_env=env),
    "siemens_web": lambda port, env: SiemensWeb(
        name="a", url=f"http://127.0.0.1:{port}", user="u", password_env=env
    ),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("env", ["AWS_SECRET_ACCESS_KEY", "SEEROB_OTHER"])
def test_a_stranger_sees_no_connection(kind, env, tmp_path, monkeypatch):
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "hidden")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY_HOST", "127.0.0.1")
    monkeypatch.setenv("SEEROB_OTHER", "hidden")
    monkeypatch.setenv("SEEROB_OTHER_HOST", "plc.example")
    with socket.create_server(("127.0.0.1", 0)) as server:
        with pytest.raises(InputError) as caught:
            KINDS[kind](server.getsockname()[1], env).open(tmp_path, None)
        assert env in str(caught.value)
        assert "SEEROB_" in str(caught.value)
        assert "hidden" not in str(caught.value)
        assert not select.select([server], [], [], 0)[0]


@pytest.mark.parametrize(
    ("allowed", "clear", "server", "sent"),
    [
        ("plc", "", Server("plc", 443, True), True),
        ("plc:443", "", Server("PLC", 443, True), True),
        ("plc:443", "", Server("plc", 8443, True), False),
        ("plc", "", Server("plc.evil", 443, True), False),
        ("", "", Server("", 443, True), False),
        ("plc", "", Server("plc", 1883, False), False),
        ("plc", "yes", Server("plc", 1883, False), True),
        ("::1", "", Server("::1", 1883, False), True),
    ],
)
def test_host_port_and_encryption_decide(allowed, clear, server, sent, monkeypatch):
    monkeypatch.setenv("SEEROB_A", "x")
    monkeypatch.setenv("SEEROB_A_HOST", allowed)
    monkeypatch.setenv("SEEROB_A_CLEAR_TEXT", clear)
    assert (refusal("SEEROB_A", server) is None) is sent
