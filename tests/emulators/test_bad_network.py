"""The bad network before an emulator: against plain sockets, and a foreign client behind it."""

from __future__ import annotations

import contextlib
import os
import random
import socket
import struct
import subprocess
import sys
import threading
import time

import pytest

from free_ports import free_port
from seerob.app.commands.emulate import options_of
from seerob.app.emulation.serving import with_faults
from seerob.app.emulation.wire import AGAIN, Faults, FaultyWire
from seerob.core.errors import InputError
from seerob.protocols.robots.rtde import Kind, pack

HERE = "127.0.0.1"


@pytest.fixture
def echo():
    """A device that says again what it is told, line by line."""
    listening = socket.create_server((HERE, 0))

    def serve():
        while True:
            try:
                client, _ = listening.accept()
            except OSError:
                return
            with client:
                while data := client.recv(1000):
                    client.sendall(data)

    threading.Thread(target=serve, daemon=True).start()
    yield listening.getsockname()
    listening.close()


def told(port, count):
    """What comes back of ``count`` numbers, and how long each took [s]."""
    found, took = b"", []
    with socket.create_connection((HERE, port), 30) as client:
        for k in range(count):
            begun, expected = time.monotonic(), len(found) + 4
            client.sendall(struct.pack("<I", k))
            while len(found) < expected:
                found += client.recv(1000)
            took.append(time.monotonic() - begun)
    return found, took


def whole(count):
    return b"".join(struct.pack("<I", k) for k in range(count))


def test_a_stream_comes_late_and_in_its_order_and_loses_nothing(echo):
    with FaultyWire(Faults(delay=0.05, jitter=0.05), at=(HERE, 0), to=echo, device_listens=True) as wire:
        found, took = told(wire.port, 20)
    assert found == whole(20)
    assert min(took) >= 0.05
    with FaultyWire(Faults(drop=0.2, seed=3), at=(HERE, 0), to=echo, device_listens=True) as wire:
        found, took = told(wire.port, 40)
    assert found == whole(40)
    assert 2 < sum(t >= AGAIN for t in took) < 20


def test_a_bit_of_a_packet_is_flipped_and_the_same_one_again(echo):
    seen = []
    for _ in range(2):
        with FaultyWire(Faults(garble=0.5, seed=5), at=(HERE, 0), to=echo, device_listens=True) as wire:
            seen.append(told(wire.port, 30)[0])
    assert seen[0] == seen[1]
    wrong = [(a ^ b).bit_count() for a, b in zip(seen[0], whole(30), strict=True)]
    assert set(wrong) == {0, 1}
    assert 5 < sum(wrong) < 25


def test_datagrams_are_lost_and_overtaken_and_answers_come_back():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind((HERE, 0))
        listener.settimeout(30)
        faults = Faults(drop=0.3, jitter=0.05)
        to = listener.getsockname()
        wire = FaultyWire(faults, at=(HERE, 0), to=to, device_listens=False)
        with wire, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
            for k in range(200):
                device.sendto(struct.pack("<I", k), (HERE, wire.port))
            device.sendto(b"end", (HERE, wire.port))
            found, sender = [], None
            listener.settimeout(3)
            try:
                while True:
                    data, sender = listener.recvfrom(100)
                    found.append(data)
            except TimeoutError:
                pass
            listener.sendto(b"answer", sender)
            device.settimeout(30)
            assert device.recv(100) == b"answer"
    numbers = [struct.unpack("<I", data)[0] for data in found if len(data) == 4]
    assert 90 < len(numbers) < 190
    assert sorted(numbers) != numbers
    assert len(set(numbers)) == len(numbers)


def test_an_emulator_that_listens_is_behind_it(capsys):
    port = free_port(socket.SOCK_STREAM)
    made = with_faults(options_of("rtde", ["--port", str(port), "--delay", "0.2"]))
    assert "late by 0.2 s" in made.what
    made.server.start()
    try:
        with socket.create_connection((HERE, port), 30) as client:
            begun = time.monotonic()
            client.sendall(pack(Kind.VERSION, b"\0\2"))
            assert client.recv(100) == b"\0\4V\1"
            assert time.monotonic() - begun >= 0.2
        again = with_faults(options_of("rtde", ["--port", str(port), "--drop", "1"]))
        with pytest.raises(OSError, match="in use"):
            again.server.start()
    finally:
        made.server.stop()


def test_an_emulator_that_sends_is_behind_it():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind((HERE, 0))
        listener.settimeout(30)
        port = str(listener.getsockname()[1])
        made = with_faults(options_of("drfl", ["--port", port, "--garble", "1"]))
        assert made.server.to == (HERE, int(port))
        made.server.start()
        try:
            damaged = [listener.recv(5000) for _ in range(5)]
        finally:
            made.server.stop()
    assert all(damaged)


def test_shares_are_shares():
    with pytest.raises(InputError, match=r"--drop: 2 is wrong"):
        options_of("rtde", ["--drop", "2"])


FOREIGN = """
import sys, time
from rtde_receive import RTDEReceiveInterface
robot = RTDEReceiveInterface(sys.argv[1], 125.0, ["timestamp", "actual_q"])
seen = set()
end = time.monotonic() + 60
while len(seen) < 20 and time.monotonic() < end:
    seen.add(robot.getTimestamp())
    time.sleep(0.004)
print(len(seen))
robot.disconnect()
"""


@pytest.mark.parametrize("first", ["client", "device"])
def test_who_breaks_off_is_gone_for_the_other_end_too(first):
    with socket.create_server((HERE, 0)) as listening:
        listening.settimeout(30)
        to = listening.getsockname()
        with FaultyWire(Faults(jitter=0.001), at=(HERE, 0), to=to, device_listens=True) as wire:
            client = socket.create_connection((HERE, wire.port), 30)
            ends = {"client": client, "device": listening.accept()[0]}
            for other in ends.values():
                other.settimeout(30)
            ends["device"].sendall(b"there")
            assert ends["client"].recv(5) == b"there"
            leaves = ends.pop(first)
            leaves.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            leaves.close()  # with a reset, as of a process that left something unread
            (stays,) = ends.values()
            with stays, contextlib.suppress(ConnectionResetError):
                assert stays.recv(1) == b""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a whole network of loopback addresses")
def test_ur_rtde_hears_through_a_network_that_is_late_and_loses(tmp_path):
    pytest.importorskip("rtde_receive")
    chance = random.Random(os.getpid() + 1)
    host = f"127.{chance.randrange(1, 255)}.{chance.randrange(256)}.{chance.randrange(2, 255)}"
    made = with_faults(options_of("rtde", ["--host", host, "--drop", "0.02", "--jitter", "0.02"]))
    made.server.start()
    try:
        done = subprocess.run(
            [sys.executable, "-c", FOREIGN, host], capture_output=True, text=True, timeout=120, check=True
        )
    finally:
        made.server.stop()
    assert done.stdout.splitlines()[0] == "20"
