"""Triggers reach machines of other makers, and nothing but a bool that the file names is written."""

from __future__ import annotations

import socket
import threading
from contextlib import contextmanager
from dataclasses import replace

import pytest
from made_trigger import said, triggering
from msgspec.structs import replace as changed

from amqtt_broker import broker
from foreign_opcua import URI, foreign_opcua
from free_ports import free_port
from in_a_loop import in_a_loop
from live_story import wait_for
from seerob.core.errors import InputError
from seerob.core.snapshot import Verdict
from seerob.session.writing import Triggers, allowed


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """A machine under load answers late."""
    monkeypatch.setattr("seerob.session.writing.WITHIN", 20.0)


def edges(station, *verdicts):
    """A run in which a verdict comes and goes, each once it was written."""
    with Triggers(station.model, on_command_line=True) as triggers:
        for seq, (verdict, written) in enumerate(verdicts):
            triggers.write(said(verdict, seq), ())
            wait_for(written, 60)


# -- Modbus -------------------------------------------------------------------------------------


@contextmanager
def modbus_device(port):
    """A device of pymodbus with sixteen coils; what is written to them."""
    from pymodbus.server import ModbusTcpServer
    from pymodbus.simulator import DataType, SimData, SimDevice

    written = []

    async def note(function, start, address, count, registers, values):
        if values is not None:
            written.append((function, address, list(values)))

    bits, words = (
        SimData(0, values=[False] * 16, datatype=DataType.BITS),
        SimData(0, values=[0], datatype=DataType.REGISTERS),
    )
    device = SimDevice(1, simdata=([bits], [bits], [words], [words]), action=note)

    async def serve(ready, over):
        server = ModbusTcpServer(device, address=("127.0.0.1", port))
        assert await server.listen()
        ready.set()
        await over.wait()
        await server.shutdown()

    with in_a_loop(serve):
        yield written


def coil(port):
    return f'kind = "modbus"\nhost = "127.0.0.1"\nport = {port}'


def test_a_coil_of_a_modbus_device_is_written(tmp_path):
    port = free_port(socket.SOCK_STREAM)
    station = triggering(tmp_path, coil(port), '{ table = "coil", at = 5, type = "bit" }')
    with modbus_device(port) as written:
        edges(
            station,
            (Verdict.WITHIN, lambda: True),
            (Verdict.EXCEEDED, lambda: written == [(5, 5, [True])]),
            (Verdict.WITHIN, lambda: written == [(5, 5, [True]), (5, 5, [False])]),
        )


def test_registers_are_not_written(tmp_path):
    station = triggering(tmp_path, coil(1), '{ table = "holding", at = 5, type = "bit", bit = 0 }')
    with pytest.raises(InputError, match="a trigger is written to a coil alone"):
        _ = station.sources


# -- OPC UA -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def server():
    """One for all: it takes seconds to start."""
    with foreign_opcua(dict.fromkeys(("fast", "kept", "other"), False), writable=("fast", "other")) as found:
        yield found


def node_of(url, name):
    return f'kind = "opcua"\nurl = "{url}"', f'"nsu={URI};s={name}"'


def test_a_node_of_another_makers_server_is_written(tmp_path, server):
    url, node = server
    edges(
        triggering(tmp_path, *node_of(url, "fast")),
        (Verdict.WITHIN, lambda: True),
        (Verdict.EXCEEDED, lambda: node["fast"].read_value() is True),
        (Verdict.WITHIN, lambda: node["fast"].read_value() is False),
    )
    assert node["other"].read_value() is False


def test_a_node_that_its_server_protects_stays_as_it_is(tmp_path, server, caplog):
    url, node = server
    edges(
        triggering(tmp_path, *node_of(url, "kept")),
        (Verdict.WITHIN, lambda: True),
        (Verdict.EXCEEDED, lambda: "twin/fast" in caplog.text),
    )
    assert node["kept"].read_value() is False


# -- MQTT ---------------------------------------------------------------------------------------


def test_a_topic_is_published(tmp_path):
    from paho.mqtt.client import CallbackAPIVersion, Client

    port, heard = free_port(socket.SOCK_STREAM), []
    station = triggering(tmp_path, f'kind = "mqtt"\nhost = "127.0.0.1"\nport = {port}', '"twin/fast"')
    with broker(port):
        machine, up = Client(CallbackAPIVersion.VERSION2), threading.Event()
        machine.on_message = lambda _client, _data, message: heard.append((message.topic, message.payload))
        machine.on_subscribe = lambda *_: up.set()
        machine.connect("127.0.0.1", port)
        machine.subscribe("#", qos=1)
        machine.loop_start()
        try:
            assert up.wait(30)
            edges(
                station,
                (Verdict.WITHIN, lambda: True),
                (Verdict.EXCEEDED, lambda: heard == [("twin/fast", b"true")]),
                (Verdict.WITHIN, lambda: heard[1:] == [("twin/fast", b"false")]),
            )
        finally:
            machine.disconnect()
            machine.loop_stop()


@pytest.mark.parametrize("address", ['{ topic = "a", pointer = "/b" }', '{ node = "g/n", metric = "m" }'])
def test_what_is_no_plain_topic_is_not_published(tmp_path, address):
    station = triggering(tmp_path, 'kind = "mqtt"\nhost = "127.0.0.1"\nport = 1', address)
    with pytest.raises(InputError, match="on a topic of its own"):
        _ = station.sources


# -- all of them --------------------------------------------------------------------------------


def test_each_takes_the_file_and_the_command_line(tmp_path):
    model = triggering(
        tmp_path, 'kind = "opcua"\nurl = "opc.tcp://127.0.0.1:1"', '"nsu=urn:cell;s=fast"'
    ).model
    assert allowed(model, on_command_line=True)
    with pytest.raises(InputError, match="not allowed"):
        Triggers(model, on_command_line=False)
    forbidden = replace(model, workstation=changed(model.workstation, allow_writing=False))
    with pytest.raises(InputError, match="not allowed"):
        Triggers(forbidden, on_command_line=True)


def test_a_source_that_cannot_write_says_which_can(tmp_path):
    source = 'kind = "web"\nurl = "http://127.0.0.1:1/"'
    with pytest.raises(InputError, match="modbus, mqtt, opcua, siemens_web"):
        Triggers(triggering(tmp_path, source, '"/x"').model, on_command_line=True)
