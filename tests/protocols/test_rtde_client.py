"""The RTDE client and the emulator over real sockets, and a foreign client on the emulator."""

from __future__ import annotations

import asyncio
import itertools
import json
import os
import random
import socket
import struct
import subprocess
import sys
from contextlib import aclosing, contextmanager, suppress
from threading import Thread

import pytest

from live_story import wait_for
from seerob.app.emulation.motions import swing
from seerob.app.emulators.rtde import RtdeServer
from seerob.devices.sources.rtde import FIELDS, NEEDED
from seerob.protocols import ProtocolError
from seerob.protocols.robots.rtde import (
    ControllerVersion,
    Kind,
    Reading,
    Splitter,
    TextMessage,
    connect,
    pack,
)

MOTION = swing((0.0, -1.2, 1.4, -1.5, -1.5, 0.0))
FOREIGN = """
import json, sys, time
from rtde_receive import RTDEReceiveInterface
robot = RTDEReceiveInterface(sys.argv[1], 125.0, sys.argv[2].split(","))
heard = []
while len(heard) < 30:
    said = [robot.getTimestamp(), robot.getActualQ(), robot.getActualQd(), robot.getRobotMode()]
    # Its getters are not of one instant: the next package may come between two of them.
    if robot.getTimestamp() == said[0]:
        heard.append(said)
    time.sleep(0.01)
print(json.dumps(heard))
robot.disconnect()
"""


def heard(port, count, fields=FIELDS, frequency=500.0):
    """The session, and what it said until there were enough readings."""

    async def listen():
        said = []
        async with connect("127.0.0.1", port, fields, frequency) as session:
            async with aclosing(session.receive()) as received:
                async for thing in received:
                    said.append(thing)
                    if sum(isinstance(s, Reading) for s in said) >= count:
                        break
            return session, said

    return asyncio.run(asyncio.wait_for(listen(), 60))


def test_what_is_played_is_what_is_heard():
    with RtdeServer(MOTION) as server:
        session, said = heard(server.port, 100)
    assert session.version == 2
    assert str(session.controller) == "5.12.4.0"
    assert set(session.recipe.fields) | set(session.missing) == set(FIELDS)
    times = [reading.values["timestamp"] for reading in said]
    assert [b - a for a, b in itertools.pairwise(times)] == pytest.approx([0.002] * 99)
    for reading in said:
        q, qd = MOTION(reading.values["timestamp"])
        assert (reading.values["actual_q"], reading.values["actual_qd"]) == (q, qd)


@pytest.mark.parametrize(("frequency", "step"), [(500.0, 0.008), (50.0, 0.02)])
def test_a_cb3_sends_125_hz_at_most(frequency, step):
    with RtdeServer(MOTION, controller=ControllerVersion(3, 15, 0, 0)) as server:
        _, said = heard(server.port, 5, NEEDED, frequency)
    assert said[-1].values["timestamp"] - said[0].values["timestamp"] == pytest.approx(4 * step)


def test_fields_that_are_not_there_are_left_out_one_by_one():
    gone = {"actual_qd", "safety_status"}
    with RtdeServer(MOTION, without=frozenset(gone)) as server:
        session, said = heard(server.port, 2)
    assert gone <= set(session.missing)
    assert not gone & set(said[0].values)
    assert {"actual_q", "robot_mode", "safety_mode"} <= set(said[0].values)


def test_nothing_that_was_asked_for_is_an_error():
    with RtdeServer(MOTION) as server, pytest.raises(ProtocolError, match="has none of the fields"):
        heard(server.port, 1, ("wrist_colour",))


def test_an_old_controller_is_spoken_to_in_version_1():
    with RtdeServer(MOTION, version=1, controller=ControllerVersion(3, 2, 0, 0)) as server:
        session, said = heard(server.port, 3)
    assert session.version == 1
    assert said[-1].values["actual_q"] == MOTION(said[-1].values["timestamp"])[0]


def test_a_text_message_may_come_before_the_answer_to_anything():
    with RtdeServer(MOTION, messages=("SafetySetup has not been confirmed yet",) * 3) as server:
        session, _ = heard(server.port, 3)
    assert session.version == 2


def test_several_clients_are_served_at_once_and_leave_nothing():
    with RtdeServer(MOTION) as server:

        async def several():
            async def one():
                async with (
                    connect("127.0.0.1", server.port, NEEDED, 500) as session,
                    aclosing(session.receive()) as received,
                ):
                    return [(await anext(received)).values["timestamp"] for _ in range(20)]

            return await asyncio.gather(*(one() for _ in range(4)))

        for times in asyncio.run(several()):
            assert times == sorted(set(times))
        wait_for(lambda: server.connections == 0)


@contextmanager
def answering(*chunks):
    """A server that answers each thing it hears with the next of some bytes, and then says no more.

    Instead of bytes there may be a function that makes them of what was heard.
    """
    listening = socket.create_server(("127.0.0.1", 0))

    def serve():
        connection, _ = listening.accept()
        with connection, suppress(ConnectionError):
            for chunk in chunks:
                asked = connection.recv(4096)
                connection.sendall(chunk(asked) if callable(chunk) else chunk)
            while connection.recv(4096):
                pass

    thread = Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield listening.getsockname()[1]
    finally:
        thread.join(60)
        listening.close()


YES = pack(Kind.VERSION, b"\1")
CONTROLLER = pack(Kind.CONTROLLER, bytes(16))


@pytest.mark.parametrize(
    ("chunks", "message"),
    [
        ([b"\0\0V"], "a package of 0 bytes"),
        ([b"HTTP/1.1 400 Bad Request\r\n\r\n" * 4000], "package"),
        ([YES, CONTROLLER, pack(Kind.OUTPUTS, b"\1DOUBLE")], "1 types for 2 fields"),
        ([YES, CONTROLLER, pack(Kind.OUTPUTS, b"\1DOUBLE,MATRIX")], "types that are none: 'MATRIX'"),
        ([YES, CONTROLLER, pack(Kind.OUTPUTS, b"\1DOUBLE,VECTOR6D"), pack(Kind.START, b"\0")], "refused"),
        ([YES, pack(Kind.TEXT, b"\1x\0\3") * 100], "no answer to ControllerRequest"),
    ],
)
def test_a_server_that_talks_nonsense_is_an_error_that_says_what(chunks, message):
    with answering(*chunks) as port, pytest.raises(ProtocolError, match=message):
        heard(port, 1, NEEDED)


def test_a_cb3_that_refuses_what_it_cannot_do_is_asked_for_what_it_can():
    asked = []

    def agree(request):
        (frequency,) = struct.unpack_from(">d", request, 3)
        asked.append(frequency)
        return pack(Kind.OUTPUTS, b"\1DOUBLE,VECTOR6D" if frequency <= 125 else b"\0")

    old = pack(Kind.CONTROLLER, struct.pack(">4I", 3, 15, 8, 0))
    data = pack(Kind.START, b"\1") + pack(Kind.DATA, b"\1" + bytes(56))
    with answering(YES, old, agree, data) as port:
        _, said = heard(port, 1, NEEDED, 500.0)
    assert asked == [125.0]
    assert isinstance(said[0], Reading)


def test_a_server_that_says_nothing_is_given_up(monkeypatch):
    monkeypatch.setattr("seerob.protocols.robots.rtde.ANSWER_WITHIN", 0.2)
    with answering(YES, b"") as port, pytest.raises(TimeoutError, match=r"silent for 0\.2 s"):
        heard(port, 1, NEEDED)


def test_data_that_stops_is_noticed(monkeypatch):
    monkeypatch.setattr("seerob.protocols.robots.rtde.SILENCE", 0.2)
    reply = pack(Kind.OUTPUTS, b"\1DOUBLE,VECTOR6D")
    chunks = YES, CONTROLLER, reply, pack(Kind.START, b"\1")
    with answering(*chunks) as port, pytest.raises(TimeoutError, match=r"silent for 0\.2 s"):
        heard(port, 1, NEEDED)


def test_a_hostile_client_ends_its_own_connection_only():
    chance = random.Random(3)
    with RtdeServer(MOTION) as server:
        for data in (b"\0\0\0", b"\xff" * 10, pack(Kind.OUTPUTS, b"\x7f"), pack(99), chance.randbytes(5000)):
            with socket.create_connection(("127.0.0.1", server.port)) as hostile:
                hostile.sendall(data)
                hostile.shutdown(socket.SHUT_WR)
                hostile.settimeout(60)
                with suppress(ConnectionError, ProtocolError):
                    assert b"U" not in {bytes([p.kind]) for p in Splitter().feed(hostile.recv(1000))}
        _, said = heard(server.port, 3)
    assert len(said) == 3


def test_a_client_that_wants_to_write_is_told_that_it_cannot():
    with RtdeServer(MOTION) as server, socket.create_connection(("127.0.0.1", server.port)) as client:
        client.sendall(pack(Kind.VERSION, b"\0\2") + pack(Kind.INPUTS, b"speed_slider_mask"))
        data = b""
        while len(data) < 4 + 13:
            data += client.recv(100)
    assert data == YES + pack(Kind.INPUTS, b"\0NOT_FOUND")


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a whole network of loopback addresses")
def test_a_foreign_client_hears_what_is_played(tmp_path):
    """ur_rtde, whose port is fixed: hence an address of our own."""
    pytest.importorskip("rtde_receive")
    chance = random.Random(os.getpid())
    host = f"127.{chance.randrange(1, 255)}.{chance.randrange(256)}.{chance.randrange(2, 255)}"
    fields = "timestamp,actual_q,actual_qd,robot_mode,safety_mode,safety_status_bits,runtime_state"
    with RtdeServer(MOTION, host=host, port=30004) as server:
        done = subprocess.run(
            [sys.executable, "-c", FOREIGN, host, fields],
            capture_output=True,
            text=True,
            timeout=120,
            check=True,
        )
    said = json.loads(done.stdout)
    assert len({t for t, *_ in said}) > 5
    for t, q, qd, mode in said:
        assert mode == 7
        # While it takes a package, one value may be of that and another of the last one.
        assert q == pytest.approx(server.motion(t)[0], abs=0.005)
        assert qd == pytest.approx(server.motion(t)[1], abs=0.005)
    assert sum(tuple(q) == server.motion(t)[0] for t, q, *_ in said) > len(said) // 2


def test_messages_are_what_the_controller_said():
    reply = pack(Kind.OUTPUTS, b"\1DOUBLE,VECTOR6D")
    text = pack(Kind.TEXT, b"\4stop\4rtde\1")
    with answering(
        YES, CONTROLLER, reply, pack(Kind.START, b"\1") + text + pack(Kind.DATA, b"\1" + bytes(56))
    ) as port:
        _, said = heard(port, 1, NEEDED)
    assert said[0] == TextMessage("stop", "rtde", 1)
