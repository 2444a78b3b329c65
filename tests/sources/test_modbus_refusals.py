"""Controllers that refuse some registers, or are busy: byte for byte, by the protocol's own description."""

from __future__ import annotations

import asyncio
import socket
import struct
from contextlib import contextmanager, suppress
from threading import Thread

import pytest

from live_story import wait_for
from seerob.core.samples import JointSample
from seerob.devices.live.listening import Listener
from seerob.devices.sources.modbus_robot import ModbusRobot
from seerob.protocols.plc.modbus import TRIES

POSITION, VELOCITY = 270, 280
REGISTERS = {259: 2, 260: 1} | {POSITION + k: 100 * k for k in range(6)}


@contextmanager
def controller(*, lacks=range(0), busy=lambda question: False):
    """A server of holding registers; yields its port and the questions that it was asked."""
    asked = []

    def answered(connection):
        def take(count):
            data = b""
            while len(data) < count:
                data += connection.recv(count - len(data)) or (_ for _ in ()).throw(OSError())
            return data

        while True:
            transaction, _, _, unit, function, at, count = struct.unpack(">HHHBBHH", take(12))
            assert function == 3
            asked.append((at, count))
            if busy(len(asked)):
                said = struct.pack(">BB", function | 0x80, 6)
            elif set(lacks) & set(range(at, at + count)):
                said = struct.pack(">BB", function | 0x80, 2)
            else:
                words = [REGISTERS.get(k, 0) for k in range(at, at + count)]
                said = struct.pack(f">BB{count}H", function, 2 * count, *words)
            connection.sendall(struct.pack(">HHHB", transaction, 0, len(said) + 1, unit) + said)

    def serve():
        with suppress(OSError):
            while True:
                connection, _ = listening.accept()
                with connection, suppress(OSError):
                    answered(connection)

    with socket.create_server(("127.0.0.1", 0)) as listening:
        Thread(target=serve, daemon=True).start()
        yield listening.getsockname()[1], asked
        listening.shutdown(socket.SHUT_RDWR)


def robot(port):
    return ModbusRobot(name="arm", robot="arm", host="127.0.0.1", port=port, every=0.02)


def heard(port):
    """The first joint samples."""
    samples = []
    listener = Listener(robot(port), None, samples.append)
    listener.start()
    try:
        wait_for(lambda: sum(isinstance(s, JointSample) for s in samples) >= 3)
    finally:
        listener.ask_to_stop()
        assert listener.join(10)
    return [s for s in samples if isinstance(s, JointSample)]


def test_a_register_that_is_not_there_takes_no_others_with_it():
    with controller(lacks=range(VELOCITY, VELOCITY + 6)) as (port, asked):
        said = " ".join(f.text for f in asyncio.run(robot(port).ask()))
        sample = heard(port)[-1]
    assert sample.q == pytest.approx([0.17453292519943295 * k for k in range(6)])
    assert sample.qd is None
    assert sample.tau == (0.0,) * 6
    assert "has no such register: holding 280 to 285 are left out" in said
    assert said.count("left out") == 1
    # What was refused is not asked for again.
    assert asked.count((VELOCITY, 6)) == 2  # once by each connection


def test_who_is_busy_is_asked_again():
    with controller(busy=lambda question: question % TRIES) as (port, asked):
        assert len(heard(port)) >= 3
    assert len(asked) >= 3 * TRIES


def test_who_stays_busy_is_one_line_of_the_log(monkeypatch, caplog):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.005)
    monkeypatch.setattr("seerob.protocols.plc.modbus.PAUSE", 0.001)
    with controller(busy=lambda question: True) as (port, asked):
        listener = Listener(robot(port), None, lambda sample: pytest.fail("nothing was said"))
        listener.start()
        wait_for(lambda: len(asked) > 3 * TRIES)
        listener.ask_to_stop()
        assert listener.join(10)
    (line,) = [r.getMessage() for r in caplog.records if r.name == "seerob.devices.live.listening"]
    assert line == f"arm: not heard: busy {TRIES} times in a row"
