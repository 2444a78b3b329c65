"""Machines that tell JSON documents over real HTTP and WebSockets: who may ask, and what is wrong."""

from __future__ import annotations

import asyncio
import json
import time

import pytest

from live_story import listening, open_files, wait_for
from reached import reached
from seerob.app import cli
from seerob.app.emulators.web import STATE, WebServer
from seerob.app.emulators.web import Web as WebOptions
from seerob.core.errors import InputError
from seerob.devices.sources.web import Web, leaves
from seerob.workstation.source import Target
from seerob.workstation.variables import Kind, Variable

SPEED = Variable(name="speed", source="plc", address="/belt/speed", unit="mm/s", timeout=5)
RUNS = Variable(name="runs", source="plc", address="/belt/runs", type=Kind.BOOL, timeout=5)
GONE = Variable(name="gone", source="plc", address="/belt/gone", unit="1", timeout=5)
OLD = Variable(name="old", source="plc", address={"pointer": "/old", "time": "/at"}, unit="1", timeout=0.5)
ALL = Target(variables=(SPEED, RUNS, GONE, OLD))


def told(t):
    return {"belt": {"speed": 250, "runs": True}, "old": 1, "at": time.time() - 60}


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """A machine under load answers late."""
    monkeypatch.setattr("seerob.devices.live.listening.ASK_WITHIN", 30.0)
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.02)
    monkeypatch.setenv("SEEROB_PLC_TOKEN", "secret")
    monkeypatch.setenv("SEEROB_PLC_TOKEN_HOST", "127.0.0.1")


def good(heard):
    return bool(heard) and heard[-1].values.get("speed") == 0.25 and heard[-1].values["runs"] is True


def polled(server, **more):
    return Web(name="plc", url=server.url + STATE, every=0.05, **more)


def pushed(server, **more):
    return Web(name="plc", url=server.live, **more)


@pytest.mark.parametrize("way", [polled, pushed])
def test_values_arrive_and_what_is_not_there_is_doubted(way):
    files = open_files()
    with WebServer(told) as server, listening(way(server), ALL) as heard:
        wait_for(lambda: good(heard))
        doubts = heard[-1].doubts
        assert "not heard for" in doubts["old"]
        assert "gone" in doubts["gone"] or "nothing heard" in doubts["gone"]
        server.stop()
        heard.clear()
        server.start()
        wait_for(lambda: good(heard))
    wait_for(lambda: open_files() <= files)


@pytest.mark.parametrize("way", [polled, pushed])
def test_only_who_has_the_token_is_answered(way):
    with WebServer(told, token="secret") as server:
        with listening(way(server, token_env="SEEROB_PLC_TOKEN"), ALL) as heard:
            wait_for(lambda: good(heard))
        said = " ".join(f.text for f in reached(way(server), None, ALL))
        assert "not let in at start" in said
        assert "401" in said or "403" in said


def test_at_start_it_is_told_what_the_machine_does_not_have():
    with WebServer(told) as server:
        found = {f.subject: f.text for f in reached(polled(server), None, ALL) if f.level == "warning"}
    assert found["gone"] == "the document has no 'gone' (/belt/gone)"
    assert set(found) == {"gone"}


def test_several_documents_of_one_server_and_none_of_another(tmp_path):
    other = Variable(name="other", source="plc", address={"pointer": "/x", "path": "none"}, unit="1")
    with (
        WebServer(told) as server,
        listening(polled(server), Target(variables=(SPEED, RUNS, other))) as heard,
    ):
        wait_for(lambda: good(heard) and "HTTP 404" in heard[-1].doubts.get("other", ""))
    for path in ("http://elsewhere/x", "//elsewhere/x", "https://127.0.0.1/x"):
        away = Variable(name="away", source="plc", address={"pointer": "", "path": path}, unit="1")
        with pytest.raises(InputError, match="leads to another server"):
            polled(server).open(tmp_path, Target(variables=(away,)))


@pytest.mark.parametrize(
    ("document", "says"),
    [
        ({"belt": [1]}, "the document has no 'speed'"),
        ({"belt": {"speed": "fast", "runs": True}}, "is no number"),
        ({"belt": {"speed": True}}, "is no number"),
        ({"x": "y" * (1 << 20)}, "more than 1 MiB"),
    ],
)
def test_a_document_that_is_another_gives_no_value(document, says):
    with WebServer(lambda t: document) as server:
        found = " ".join(f.text for f in reached(polled(server), None, Target(variables=(SPEED,))))
        assert says in found


def test_secrets_do_not_travel_unencrypted_and_mistakes_are_told(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="unencrypted"):
        Web(url="http://192.168.0.7/state", token_env="SEEROB_PLC_TOKEN")
    with pytest.raises(ValueError, match="holds a password"):
        Web(url="https://user:word@192.168.0.7/state")
    with pytest.raises(ValueError, match="hello is sent to a WebSocket"):
        Web(url="https://192.168.0.7/state", hello="all")
    monkeypatch.delenv("SEEROB_PLC_TOKEN")
    wrong = (
        Variable(name="a", source="plc", address=5, unit="1"),
        Variable(name="b", source="plc", address="belt/speed", unit="1"),
        Variable(name="c", source="plc", address={"pointer": "/x", "path": "y"}, unit="1"),
    )
    source = Web(url="wss://192.168.0.7/live", token_env="SEEROB_PLC_TOKEN", ca="gone.pem")
    with pytest.raises(InputError) as caught:
        source.open(tmp_path, Target(variables=wrong))
    for part in ("a.address", "b.address", "no JSON pointer", "has no paths", "SEEROB_PLC_TOKEN", "gone.pem"):
        assert part in str(caught.value)


def test_browsing_names_every_value():
    async def found(source):
        return {node.address: node async for node in source.browse()}

    with WebServer(told) as server:
        nodes = asyncio.run(found(polled(server)))
    assert set(nodes) == {"/belt/speed", "/belt/runs", "/old", "/at"}
    assert (nodes["/belt/runs"].type, nodes["/belt/runs"].value) == ("bool", "true")
    assert [n.address for n in leaves({"a/b": [{"~": 1}]})] == ["/a~1b/0/~0"]
    deep = json.loads("[" * 500 + "]" * 500)
    assert list(leaves(deep)) == []
    assert len(list(leaves(list(range(9000))))) == 5000


def test_the_emulated_machine_can_be_probed(capsys):
    with WebOptions(port=0).ready().server as server:
        for url in (server.url + STATE, server.live):
            assert cli.main(["probe", "web", url, "--seconds", "0.3"]) == 0
    said = capsys.readouterr().out
    assert said.count('kind = "web"') == 2
    assert said.count("/belt/speed = 250.0") + said.count("/belt/speed = 0.0") == 2
