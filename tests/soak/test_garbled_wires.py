"""Live sources behind a wire that garbles what the device says: no crash, no hang, heard again after it."""

from __future__ import annotations

import logging
import socket
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest
from msgspec.structs import replace

from free_ports import free_port
from live_story import wait_for
from relay import Datagrams, Garbled, Stream
from seerob.core.samples import Quality, SignalSample
from seerob.devices.live.listening import Listener
from soak.device_kinds import KINDS

SENDERS = {"fri", "egm", "drfl", "mvn", "rokoko"}
"""Devices that send datagrams to a port of ours."""
WIRED = [kind for kind in KINDS if kind != "headset"]
STREAMS = [kind for kind in WIRED if kind not in SENDERS and kind != "natnet"]
GARBLED = [how for how in Garbled if how is not Garbled.NOT]


def wired(kind, made):
    """A wire to put between, and the source that listens at its other end."""
    source = made.source
    if kind in SENDERS:
        port = free_port()
        return Datagrams(port, port=source.port), replace(source, port=port)
    if kind == "natnet":
        wire = Datagrams(source.port, back=True)
        return wire, replace(source, port=wire.port)
    if kind == "ros_tcp_endpoint":
        port = free_port(socket.SOCK_STREAM)
        return Stream(port, port=source.port, back=True), replace(source, port=port)
    if hasattr(source, "url"):
        port = urlsplit(source.url).port
        wire = Stream(port)
        return wire, replace(source, url=source.url.replace(f":{port}", f":{wire.port}"))
    wire = Stream(source.port)
    return wire, replace(source, port=wire.port)


@contextmanager
def heard_through(monkeypatch, kind):
    """The wire, and how many good samples were heard."""
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.002)
    monkeypatch.setattr("seerob.devices.live.listening.LONGEST_PAUSE", 0.05)
    monkeypatch.setattr("seerob.app.emulators.siemens_web.IDLE", 1.0)
    made = KINDS[kind](monkeypatch)
    wire, source = wired(kind, made)
    good = []

    def hear(sample):
        signal = isinstance(sample, SignalSample)
        if (sample.values and not sample.doubts) if signal else sample.quality is Quality.GOOD:
            good.append(sample.t)

    listener = Listener(source, made.target, hear)
    listener.start()
    try:
        wait_for(lambda: len(good) > 2)
        yield wire, good
    finally:
        listener.ask_to_stop()
        assert listener.join(20.0)
        made.server.stop()
        getattr(made.server, "close", lambda: None)()
        wire.close()


def garble(wire, good, how, pieces):
    """Garble some pieces; the device is heard again, and of no mistake of ours."""
    wire.how, wire.passed = how, 0
    wait_for(lambda: wire.passed > pieces)
    wire.how = Garbled.NOT
    known = len(good)
    wait_for(lambda: len(good) > known + 2)


@pytest.fixture(autouse=True)
def no_mistake(caplog):
    caplog.set_level(logging.ERROR)
    yield
    said = [r for r in caplog.get_records("call") if r.name.startswith(("seerob", "asyncio"))]
    assert not [r.getMessage() for r in said if r.levelno >= logging.ERROR or r.exc_info]


@pytest.mark.parametrize("how", [Garbled.SPLIT, Garbled.MERGED])
@pytest.mark.parametrize("kind", ["rtde", "ros_tcp", "rosbridge"])
def test_where_packets_end_does_not_matter(monkeypatch, kind, how):
    with heard_through(monkeypatch, kind) as (wire, good):
        known, wire.how = len(good), how
        wait_for(lambda: len(good) > known + 10)


def test_what_is_cut_or_damaged_is_a_loss_and_no_mistake(monkeypatch):
    monkeypatch.setattr("seerob.protocols.plc.modbus.PATIENCE", 0.3)
    with heard_through(monkeypatch, "modbus") as (wire, good):
        for how in (Garbled.CUT, Garbled.NOISE):
            garble(wire, good, how, 5)


@pytest.mark.soak
@pytest.mark.parametrize("kind", STREAMS)
def test_streams_in_other_pieces_are_the_same(monkeypatch, kind):
    with heard_through(monkeypatch, kind) as (wire, good):
        for how in (Garbled.SPLIT, Garbled.MERGED):
            known, wire.how = len(good), how
            wait_for(lambda known=known: len(good) > known + 20)


@pytest.mark.soak
@pytest.mark.parametrize("kind", WIRED)
def test_every_kind_is_heard_again_after_its_wire_was_garbled(monkeypatch, kind):
    with heard_through(monkeypatch, kind) as (wire, good):
        for how in GARBLED:
            garble(wire, good, how, 30)
