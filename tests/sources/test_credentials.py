"""A secret goes to the host that the user allowed, and to nobody else."""

import select
import socket

import pytest

from seerob.core.errors import InputError
from seerob.devices.sources.mqtt import Mqtt
from seerob.devices.sources.opcua import Opcua
from seerob.devices.sources.siemens_web import SiemensWeb
from seerob.devices.sources.web import Web
from seerob.protocols.links.credentials import Server, refusal, secret

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


FILE = '[SEEROB_FILED]\nsecret = "hidden"\nhost = "plc:443"\n'


@pytest.fixture
def filed(tmp_path, monkeypatch):
    monkeypatch.setattr("platformdirs.user_config_path", lambda *_, **__: tmp_path)
    path = tmp_path / "credentials.toml"
    path.write_text(FILE)
    path.chmod(0o600)
    return path


def test_the_users_file_holds_secrets_for_the_hosts_that_it_names(filed, monkeypatch):
    assert secret("token_env", "SEEROB_FILED", Server("plc", 443, True)) == "hidden"
    for server in (Server("plc", 444, True), Server("evil", 443, True), Server("plc", 443, False)):
        assert refusal("SEEROB_FILED", server) is not None
    assert "none of that name" in refusal("SEEROB_OTHER", Server("plc", 443, True))[0]
    filed.write_text(FILE + "clear_text = true\n")
    assert refusal("SEEROB_FILED", Server("plc", 443, False)) is None
    monkeypatch.setenv("SEEROB_FILED", "of the environment")  # which says nothing of a host
    assert refusal("SEEROB_FILED", Server("plc", 443, True)) is not None


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o644])
def test_a_file_of_secrets_that_others_may_read_or_change_is_refused(filed, mode):
    filed.chmod(mode)
    with pytest.raises(InputError, match=f"chmod 600 {filed}"):
        secret("token_env", "SEEROB_FILED", Server("plc", 443, True))


@pytest.mark.parametrize("text", ['SEEROB_FILED = "x"', "[SEEROB_FILED]", '[SEEROB_FILED]\nsecrets = "x"'])
def test_a_file_of_secrets_that_is_wrong_says_where(filed, text):
    filed.write_text(text)
    with pytest.raises(InputError, match="SEEROB_FILED"):
        refusal("SEEROB_FILED", Server("plc", 443, True))


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
