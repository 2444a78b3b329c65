"""Machines behind a real MQTT broker, another maker's: values, ages, births, and a broker that is killed."""

from __future__ import annotations

import asyncio
import gc
import json
import logging
import socket
import threading
import time
from contextlib import asynccontextmanager

import pytest
from paho.mqtt import publish

from amqtt_broker import broker
from live_story import listening, open_files, wait_for
from reached import reached
from seerob.core.errors import InputError
from seerob.devices.sources.mqtt import Mqtt, Plain, address, plain_change
from seerob.protocols.plc.sparkplug import Metric, Payload, encode
from seerob.workstation.source import Target
from seerob.workstation.variables import Kind, Variable

pytest.importorskip("aiomqtt")

BELT = {"node": "plant/edge", "device": "belt"}
SPEED = Variable(
    name="belt/speed", source="plc", address={"topic": "belt", "pointer": "/speed"}, unit="mm/s", timeout=0.4
)
DOOR = Variable(name="door", source="plc", address="cell/door", type=Kind.BOOL, timeout=60)
COUNT = Variable(name="count", source="plc", address=BELT | {"metric": "count"}, unit="1")


@pytest.fixture
def port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def said(port, topic, payload, **more):
    publish.single(topic, payload, hostname="127.0.0.1", port=port, **more)


def listening_to(port, *variables):
    return listening(Mqtt(name="plc", host="127.0.0.1", port=port), Target(variables=variables))


def newest(heard):
    return heard[-1] if heard else None


def known(heard, name):
    sample = newest(heard)
    return None if sample is None or name in sample.doubts else sample.values.get(name)


def until(heard, true, say=lambda: None):
    """Say something again and again until it is heard: a subscription may take its time."""
    end = time.monotonic() + 120
    while not true():
        assert time.monotonic() < end, newest(heard)
        say()
        time.sleep(0.02)


def test_values_arrive_in_si_and_grow_old(port):
    with broker(port), listening_to(port, SPEED, DOOR) as heard:
        until(heard, lambda: known(heard, "belt/speed") == 0.5, lambda: said(port, "belt", '{"speed": 500}'))
        until(heard, lambda: known(heard, "door") is True, lambda: said(port, "cell/door", "true"))
        # Silence: the one that must be said often grows old, the other stands.
        wait_for(lambda: "not heard for" in newest(heard).doubts.get("belt/speed", ""))
        assert known(heard, "door") is True
        until(
            heard,
            lambda: "no number" in newest(heard).doubts.get("belt/speed", ""),
            lambda: said(port, "belt", '{"speed": "fast"}'),
        )


def test_topics_that_nobody_publishes_to_are_told_at_start(port, monkeypatch, tmp_path):
    monkeypatch.setattr("seerob.devices.live.listening.ASK_WITHIN", 30.0)
    monkeypatch.setattr("seerob.devices.variables.live_source.COVER_WITHIN", 0.2)
    target = Target(variables=(SPEED, COUNT))
    with broker(port):
        findings = reached(Mqtt(name="plc", host="127.0.0.1", port=port), tmp_path, target)
    told = {f.subject: f.text for f in findings if f.level == "warning"}
    assert told["belt/speed"] == "not heard within 0.2 s"
    assert "birth was not heard" in told["count"]


def test_a_sparkplug_device_is_known_from_birth_to_death(port):
    def send(kind, *metrics, seq, device="/belt"):
        said(port, f"spBv1.0/plant/{kind}/edge{device}", encode(Payload(seq=seq, metrics=metrics)))

    birth = Metric(name="count", alias=5, type=4, value=7.0)

    def born():
        send("NBIRTH", seq=0, device="")
        send("DBIRTH", birth, seq=1)

    with broker(port), listening_to(port, COUNT) as heard:
        wait_for(lambda: "birth was not heard" in newest(heard).doubts["count"] if heard else False)
        until(heard, lambda: known(heard, "count") == 7.0, born)
        send("DDATA", Metric(alias=5, value=-8.0, type=4), seq=2)
        wait_for(lambda: known(heard, "count") == -8.0)
        # It stands as long as the node lives, however long it says nothing.
        beats = len(heard)
        wait_for(lambda: len(heard) > beats + 15)
        assert known(heard, "count") == -8.0
        send("NDEATH", seq=0, device="")
        wait_for(lambda: "not alive" in newest(heard).doubts.get("count", ""))


def test_a_broker_that_is_killed_is_found_again(port, monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.02)
    monkeypatch.setattr("seerob.devices.live.listening.LONGEST_PAUSE", 0.1)
    files, threads = open_files(), threading.active_count()
    with listening_to(port, DOOR) as heard:
        for _ in range(3):
            with broker(port):
                heard.clear()
                until(heard, lambda: known(heard, "door") is True, lambda: said(port, "cell/door", "1"))
    wait_for(lambda: open_files() <= files and threading.active_count() <= threads)


@asynccontextmanager
async def rude(port):
    """A broker that takes clients in and falls over; how many so far."""
    clients = []

    async def serve(reader, writer):
        clients.append(await reader.read(100))
        writer.write(b"\x20\x02\x00\x00")
        await writer.drain()
        writer.close()

    async with await asyncio.start_server(serve, "127.0.0.1", port):
        yield clients


def test_why_a_broker_left_is_no_riddle_in_the_log(port, caplog):
    async def visit():
        async with rude(port), Mqtt(host="127.0.0.1", port=port)._client() as client:
            while client._client.is_connected():
                await asyncio.sleep(0.005)
        del client
        gc.collect()

    with caplog.at_level(logging.WARNING, "asyncio"):
        asyncio.run(visit())
    assert "never retrieved" not in caplog.text


def test_a_broker_that_falls_over_again_and_again_is_tried_again_and_again(port, monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.01)
    monkeypatch.setattr("seerob.devices.sources.mqtt.PATIENCE", 0.1)

    async def wait():
        async with rude(port) as clients:
            with listening_to(port, DOOR):
                async with asyncio.timeout(30):
                    while len(clients) < 4:
                        await asyncio.sleep(0.01)

    asyncio.run(wait())


# -- payloads -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pointer", "payload", "raw", "doubt"),
    [
        ("", b"1.5", 1.5, ""),
        ("", b"true", True, ""),
        ("", b"idle", "idle", ""),
        ("/a/0", b'{"a": [3]}', 3, ""),
        ("/b", b'{"a": [3]}', None, "has no 'b'"),
        ("/b", b"{", None, "no JSON"),
        ("/a", b'{"a": NaN}', None, "no JSON"),
    ],
)
def test_payloads(pointer, payload, raw, doubt):
    found = plain_change("v", Plain("t", pointer), payload, retained=False, now=0.0)
    assert found.raw == raw
    assert doubt in found.invalid_reason
    assert bool(doubt) == bool(found.invalid_reason)


def test_what_the_broker_kept_is_as_old_as_it_says_or_doubtful():
    where = Plain("t", "/v", time="/t")
    for stamp in (1000.0, "1970-01-01T00:16:40Z", "1970-01-01T00:16:40"):
        payload = json.dumps({"v": 1, "t": stamp}).encode()
        assert plain_change("v", where, payload, retained=True, now=1002.5).age == pytest.approx(2.5)
    payload = json.dumps({"v": 1, "t": 1.7e12 + 500}).encode()
    assert plain_change("v", where, payload, retained=True, now=1.7e9 + 1).age == pytest.approx(0.5)
    assert "how old" in plain_change("v", Plain("t"), b"1", retained=True, now=0.0).invalid_reason
    for stamp in (b"true", b"1e999", b"1" + b"0" * 400):
        payload = b'{"v": 1, "t": %s}' % stamp
        assert "is no time" in plain_change("v", where, payload, retained=False, now=0.0).invalid_reason


@pytest.mark.parametrize(("ahead", "doubtful"), [(-0.5, False), (0.9, False), (1.1, True), (3600.0, True)])
@pytest.mark.parametrize("retained", [False, True])
def test_a_time_that_lies_ahead_does_not_make_an_old_value_new(ahead, doubtful, retained):
    payload = json.dumps({"v": 1, "t": 1.7e9 + ahead}).encode()
    found = plain_change("v", Plain("t", "/v", time="/t"), payload, retained=retained, now=1.7e9)
    assert ("ahead of this computer's clock" in found.invalid_reason) is doubtful
    assert found.age == pytest.approx(0.0 if doubtful else max(0.0, -ahead))


@pytest.mark.parametrize(
    "wrong",
    ["a/#", "", 5, {"topic": "a", "pointer": "b"}, {"node": "a", "metric": "b"}, {"topic": "a", "x": 1}],
)
def test_addresses_that_cannot_be_are_named(tmp_path, wrong):
    bad = Variable(name="bad", source="plc", address=wrong, unit="1")
    target = Target(name="", joints=(), units=(), lower=(), upper=(), velocity=(), variables=(SPEED, bad))
    with pytest.raises(InputError, match=r"bad\.address"):
        Mqtt(name="plc", host="127.0.0.1", password_env="SEEROB_NO_SUCH").open(tmp_path, target)
    assert address(SPEED) == Plain("belt", "/speed")


STAMPED = Variable(
    name="crate",
    source="plc",
    address={"topic": "crate", "pointer": "/x", "time": "/t"},
    unit="mm",
    timeout=60,
)


def test_messages_that_are_played_again_are_a_restart_once_and_a_loop_then(port):
    """Over a real broker: by the time in the payload, and by that of a metric of Sparkplug."""
    begun, seq = time.time(), iter(range(10**6))

    def send(back):
        at = time.time() - back
        said(port, "crate", json.dumps({"x": 5.0, "t": at}))
        metric = Metric(name="count", alias=5, type=4, value=7.0, time=at)
        k = next(seq)
        kind, payload = ("DDATA", metric) if k else ("DBIRTH", metric)
        if not k:
            said(port, "spBv1.0/plant/NBIRTH/edge", encode(Payload(seq=0)))
        said(port, f"spBv1.0/plant/{kind}/edge/belt", encode(Payload(seq=(k + 1) % 256, metrics=(payload,))))

    both = "crate", "count"
    with broker(port), listening_to(port, STAMPED, COUNT, DOOR) as heard:
        until(heard, lambda: heard and known(heard, "door"), lambda: said(port, "cell/door", "true"))
        until(heard, lambda: all(known(heard, name) is not None for name in both), lambda: send(0.0))
        for back, word in ((1.0, "it seems to have started again"), (2.0, "a loop?")):
            send(back)
            wait_for(lambda: all(word in newest(heard).doubts.get(name, "") for name in both))  # noqa: B023
        assert known(heard, "door") is True
    assert time.time() - begun < 60


def test_of_what_no_time_is_said_that_is_told(port, monkeypatch, tmp_path):
    monkeypatch.setattr("seerob.devices.live.listening.ASK_WITHIN", 30.0)
    monkeypatch.setattr("seerob.devices.variables.live_source.COVER_WITHIN", 0.2)
    with broker(port):
        target = Target(variables=(SPEED, STAMPED, COUNT))
        findings = reached(Mqtt(name="plc", host="127.0.0.1", port=port), tmp_path, target)
    (told,) = [f.text for f in findings if "played again" in f.text]
    assert told.startswith("no time is said of belt/speed: ")


def test_a_broker_that_lets_nobody_in_is_no_broker_that_is_not_there(port):
    source = Mqtt(name="plc", host="127.0.0.1", port=port)
    with broker(port, anonymous=False):
        said = " ".join(f.text for f in reached(source, None, Target(variables=(SPEED,))))
    assert "not let in at start: the broker refuses: " in said
    assert "not reached at start" in " ".join(
        f.text for f in reached(source, None, Target(variables=(SPEED,)))
    )
