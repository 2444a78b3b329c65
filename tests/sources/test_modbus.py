"""Modbus: registers and their bits, variables of machines, and robots by a register map, on real sockets."""

from __future__ import annotations

import asyncio
import socket
import struct
import threading
from contextlib import aclosing
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.client import ModbusTcpClient

from live_story import Story, listening, lived, open_files, wait_for
from made_cell import made
from reached import asked, reached
from seerob.app import cli
from seerob.app.emulators.modbus import Modbus as ModbusOptions
from seerob.app.emulators.modbus import ModbusServer, program
from seerob.core.errors import InputError, UnknownName
from seerob.core.samples import JointSample, Quality, SignalSample
from seerob.devices.sources.modbus import Modbus
from seerob.devices.sources.modbus_robot import ModbusRobot
from seerob.outputs.sinks.recorder import Recorder
from seerob.protocols.plc.modbus import (
    MOST,
    Block,
    Place,
    Table,
    Type,
    Words,
    blocks,
    decode,
    encode,
    load,
    names,
)
from seerob.recording.recording import Recording
from seerob.workstation.source import Target
from seerob.workstation.variables import Kind, Variable

HOME, AMPLITUDE = np.array([0, -1.2, 1.4, -1.5, -1.5, 0]), np.array([0.4, 0.2, 0.3, 0.2, 0.4, 0.3])
DOOSAN = load("doosan", Path())


def motion(t):
    return tuple((HOME + AMPLITUDE * np.sin(t)).tolist()), tuple((AMPLITUDE * np.cos(t)).tolist())


def holding(at, kind=Type.U16, **more):
    return Place(table=Table.HOLDING, at=at, type=kind, **more)


def robot(state="moving", **more):
    return ModbusServer(program(DOOSAN, motion, {"robot_state": state, "servo_on": True}), **more)


# -- registers ----------------------------------------------------------------------------------


@given(st.sampled_from([t for t in Type if t is not Type.BIT]), st.sampled_from(Words), st.data())
def test_numbers_survive_their_registers(kind, words, data):
    place = holding(7, kind, words=words if kind.size > 1 else None)
    if kind in (Type.F32, Type.F64):
        value = data.draw(st.floats(width=16 * kind.size, allow_nan=False))
    else:
        bits, signed = 16 * kind.size, kind[0] == "i"
        low = -(1 << bits - 1) if signed else 0
        value = data.draw(st.integers(low, low + (1 << bits) - 1))
    assert decode(place, encode(place, value)) == value


def test_bytes_are_those_of_the_protocol():
    assert decode(holding(0, Type.I16), [0xFFFE]) == -2
    high, low = struct.unpack(">2H", struct.pack(">f", 1.5))
    assert decode(holding(0, Type.F32, words=Words.HIGH_FIRST), [high, low]) == 1.5
    assert decode(holding(0, Type.F32, words=Words.LOW_FIRST), [low, high]) == 1.5
    assert [decode(holding(0, Type.BIT, bit=k), [0b1010]) for k in range(4)] == [False, True, False, True]


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"table": Table.HOLDING, "at": 0, "type": Type.F32}, "must be given"),
        ({"table": Table.HOLDING, "at": 0, "type": Type.I16, "words": Words.LOW_FIRST}, "belongs to values"),
        ({"table": Table.COIL, "at": 0, "type": Type.U16}, "single bits"),
        ({"table": Table.INPUT, "at": 0, "type": Type.BIT}, "belong together"),
        ({"table": Table.INPUT, "at": 65535, "type": Type.U32, "words": Words.LOW_FIRST}, "last register"),
    ],
)
def test_places_say_what_is_missing(wrong, says):
    with pytest.raises(ValueError, match=says):
        Place(**wrong)


@given(st.lists(st.integers(0, 400), max_size=60))
def test_questions_ask_for_every_register_once_and_for_nothing_else(ats):
    found = blocks(holding(at) for at in ats)
    asked = [k for b in found for k in range(b.first, b.first + b.count)]
    assert sorted(asked) == sorted(set(ats))
    assert all(b.count <= MOST for b in found)


# -- variables ----------------------------------------------------------------------------------

SPEED = {"table": "holding", "at": 128, "type": "i16"}
FINE = {"table": "input", "at": 10, "type": "f32", "words": "low_first"}
VARIABLES = (
    Variable(name="speed", source="plc", address=SPEED, unit="mm/s", timeout=1),
    Variable(name="position", source="plc", address=FINE, unit="mm", timeout=1),
    Variable(name="gone", source="plc", address=SPEED | {"at": 129}, unit="1", timeout=1),
    Variable(name="clear", source="plc", address={"table": "coil", "at": 18, "type": "bit"}, type=Kind.BOOL),
)
TARGET = Target(variables=VARIABLES)


def plc(**more):
    played = {"speed": -250, "position": 12.5, "clear": True}
    found = {msgspec.convert(v.address, Place): v.name for v in VARIABLES if v.name in played}
    return ModbusServer({p: (lambda t, x=played[name]: x) for p, name in found.items()}, **more)


def good(heard):
    return bool(heard) and heard[-1].values == {"speed": -0.25, "position": 0.0125, "clear": True}


def test_variables_arrive_and_a_wrong_address_takes_none_with_it():
    with plc() as server, listening(Modbus(host="127.0.0.1", port=server.port, every=0.03), TARGET) as heard:
        wait_for(lambda: good(heard))
        assert set(heard[-1].doubts) == {"gone"}
        assert "no such register" in heard[-1].doubts["gone"]


def test_at_start_it_is_told_what_the_device_does_not_have(monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.ASK_WITHIN", 30.0)
    monkeypatch.setattr("seerob.devices.variables.live_source.COVER_WITHIN", 30.0)
    with plc() as server:
        findings = reached(Modbus(host="127.0.0.1", port=server.port), Path(), TARGET)
    told = {f.subject: f.text for f in findings if f.level == "warning"}
    assert told == {"gone": "the device has no such register"}
    assert "3 of 4 variables are heard at start" in " ".join(f.text for f in findings)


def test_a_device_that_is_switched_off_and_on_is_asked_again(monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.02)
    server = plc().start()
    files, threads = open_files(), threading.active_count()
    try:
        with listening(Modbus(host="127.0.0.1", port=server.port, every=0.03), TARGET) as heard:
            for _ in range(4):
                wait_for(lambda: good(heard))
                server.stop()
                heard.clear()
                server.start()
            wait_for(lambda: good(heard))
        wait_for(lambda: open_files() <= files and threading.active_count() <= threads)
    finally:
        server.stop()


def test_addresses_that_are_none_are_said_together(tmp_path):
    wrong = tuple(
        Variable(name=f"v{k}", source="plc", address=a, unit="1")
        for k, a in enumerate((5, "holding:5", SPEED | {"type": "f32"}, SPEED | {"at": -1}))
    )
    with pytest.raises(InputError) as caught:
        Modbus(host="127.0.0.1", port=9).open(tmp_path, Target(variables=wrong))
    assert all(f"v{k}.address" in str(caught.value) for k in range(4))


def test_nobody_can_ask_a_device_what_it_has():
    async def found():
        return [node async for node in Modbus(host="127.0.0.1").browse()]

    with pytest.raises(InputError, match="its manual"):
        asyncio.run(found())


@pytest.mark.parametrize("answer", [b"", b"\x00" * 7, b"HTTP/1.1 400 Bad Request\r\n\r\n", b"\xff" * 300])
def test_an_answer_that_is_no_modbus_ends_the_connection_and_not_the_source(answer, monkeypatch):
    monkeypatch.setattr("seerob.protocols.plc.modbus.PATIENCE", 0.2)

    def serve():
        link, _ = server.accept()
        with link:
            link.recv(100)
            link.sendall(answer)
            link.recv(100)

    async def heard():
        source = Modbus(host="127.0.0.1", port=server.getsockname()[1])
        async with aclosing(source.changes(VARIABLES, Path())) as said:
            with pytest.raises(OSError, match=r"no answer|closed"):
                await anext(said)

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve)
        thread.start()
        asyncio.run(heard())
        thread.join(10)
        assert not thread.is_alive()


def test_a_foreign_client_reads_the_emulator_and_may_not_write():
    with robot() as server:
        client = ModbusTcpClient("127.0.0.1", port=server.port)
        try:
            assert client.connect()
            before = server.instant()
            raw = client.convert_from_registers(
                client.read_holding_registers(270, count=6).registers, client.DATATYPE.INT16
            )
            after = server.instant()
            far = np.abs(np.radians(0.1 * np.array(raw)) - motion(before)[0]).max()
            assert far <= np.radians(0.05) + 0.4 * (after - before) + 1e-9
            assert client.read_holding_registers(259).registers == [2]
            assert client.read_holding_registers(500).isError()
            assert client.write_register(270, 5).isError()
        finally:
            client.close()


# -- robots -------------------------------------------------------------------------------------


def cell(folder, port, *, timeout=1.0, model="ur10"):
    return made(
        folder,
        f'[[robots]]\nname = "arm"\nmodel = "library:{model}"\n'
        '[[sources]]\nkind = "modbus_robot"\nrobot = "arm"\nhost = "127.0.0.1"\n'
        f"port = {port}\nevery = 0.05\ntimeout = {timeout}\n"
        '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm"\nlimit = 1.5\n'
        '[[safety]]\nkind = "kinetic_energy"\nname = "energy"\nrobot = "arm"\nlimit = 500\n'
        '[[safety]]\nkind = "power_and_force"\nname = "contact"\nrobot = "arm"\nperson_speed = 0\n',
    )


def test_the_twin_follows_and_energies_are_undecided(tmp_path):
    with robot() as server:
        story = lived(cell(tmp_path, server.port), Story(60, lambda story: story.decided() > 5))
    late = [result for s in story.snapshots for result in s.results[1:]]
    assert {result.name for result in late} == {"energy", "contact"}
    assert {result.verdict for result in late} == {"undecided"}
    reasons = [r.reason for s in story.snapshots for r in s.results[1:] if s.results[0].verdict == "within"]
    assert all("too coarse" in reason for reason in reasons)
    assert reasons
    joints = story.joints()
    steps = np.array([s.q for s in joints]) / np.radians(0.1)
    assert np.abs(steps - np.round(steps)).max() < 1e-9
    assert np.abs(np.array([s.q for s in joints]) - HOME).max() < 0.4 + np.radians(0.05)
    assert all(s.tau == (0.0,) * 6 for s in joints)


def test_a_recording_keeps_that_it_was_coarse(tmp_path):
    with robot() as server:
        station = cell(tmp_path, server.port)
        story = Story(30, lambda story: story.decided() > 5)
        lived(station, story, folder=tmp_path, sinks=[Recorder(lossless=True)])
    (again := tmp_path / "again").mkdir()
    (tmp_path / "run.mcap").rename(again / "first.mcap")
    replayed = made(
        again,
        '[[robots]]\nname = "other"\nmodel = "library:ur10"\n'
        '[[sources]]\nkind = "recording"\ndrives = "other"\nrecorded = "arm"\nfile = "first.mcap"\n'
        'timeout = 1.0\n[[safety]]\nkind = "velocity"\nname = "speed"\nat = "other"\nlimit = 1.5\n'
        '[[safety]]\nkind = "kinetic_energy"\nname = "energy"\nrobot = "other"\nlimit = 500\n',
    )
    second = Story(1)
    replayed.run(writers=[second], folder=again, sinks=[Recorder(lossless=True)])
    assert "within" in second.verdicts()
    assert {s.results[1].verdict for s in second.snapshots} == {"undecided"}
    assert "too coarse" in second.snapshots[-1].results[1].reason
    # And a recording of the replay keeps it, too.
    (mechanism,) = Recording.open(again / "run.mcap").scene.mechanisms
    assert (mechanism.name, "too coarse" in mechanism.coarse) == ("other", True)


def test_the_controller_that_dies_is_undecided_and_followed_again(tmp_path):
    server = robot().start()
    story = Story(220, lambda story: story.decided(160) > 0, at_60=server.stop, at_160=server.start)
    try:
        lived(cell(tmp_path, server.port, timeout=0.4), story)
    finally:
        server.stop()
    assert any("not heard for" in s.results[0].reason for s in story.snapshots[60:])
    assert story.decided(160) > 0


@pytest.mark.parametrize(
    ("state", "quality"),
    [("moving", Quality.GOOD), ("safe_off", Quality.DEGRADED), ("not_ready", Quality.INVALID)],
)
def test_the_state_says_what_joints_are_worth(state, quality):
    with robot(state) as server:
        source = ModbusRobot(robot="arm", host="127.0.0.1", port=server.port, every=0.03)
        with listening(source) as heard:
            wait_for(lambda: any(isinstance(s, JointSample) for s in heard))
    assert {s.quality for s in heard if isinstance(s, JointSample)} == {quality}
    said = next(s for s in heard if isinstance(s, SignalSample))
    assert said.values["robot_state"] == state
    assert said.values["servo_on"] is True


def test_what_registers_mean_is_said_at_start(tmp_path):
    with robot() as server:
        said = " ".join(f.text for f in asked(cell(tmp_path, server.port)).scene().findings)
    for text in ("0.1°", "every 100 ms", "intervals of results do not contain this", "energies", "IO Table"):
        assert text in said


def test_old_software_without_torques_is_read_without_them(tmp_path):
    (tmp_path / "old.toml").write_text(
        'title = "old"\nsource = "made"\njoints = 2\nrefresh = 0.1\n'
        '[position]\nat = 0\ntype = "i32"\nwords = "low_first"\nunit = "deg"\nscale = 0.001\nsource = "s"\n'
        '[torque]\nat = 50\ntype = "i16"\nunit = "N.m"\nscale = 1\nsource = "s"\n'
    )
    found = load("old.toml", tmp_path)
    played = {p: (lambda t, k=k: -90_000 * (k + 1)) for k, p in enumerate(found.position.places(2))}
    target = Target(name="arm", joints=("a", "b"), folder=str(tmp_path))
    with ModbusServer(played) as server:
        source = ModbusRobot(robot="arm", host="127.0.0.1", port=server.port, every=0.03, map="old.toml")
        said = " ".join(f.text for f in reached(source, tmp_path, target))
        assert "no such register: holding 50 to 51 are left out" in said
        with listening(source, target) as heard:
            wait_for(lambda: any(isinstance(s, JointSample) for s in heard))
    (first, *_) = [s for s in heard if isinstance(s, JointSample)]
    assert first.q == pytest.approx((-np.pi / 2, -np.pi))
    assert (first.qd, first.tau) == (None, None)


def test_the_emulated_controller_can_be_probed(capsys):
    with ModbusOptions(port=0).ready().server as server:
        words = ["probe", "modbus_robot", "127.0.0.1", "--port", str(server.port), "--seconds", "2"]
        assert cli.main(words) == 0
    said = capsys.readouterr().out
    assert "robot_state = moving" in said
    assert 'kind = "modbus_robot"' in said


def test_maps_are_checked(tmp_path):
    assert names() == ("doosan",)
    assert DOOSAN.questions()[0] == Block(Table.HOLDING, 256, 60)
    with pytest.raises(UnknownName, match="doosan"):
        load("dosan", tmp_path)
    (tmp_path / "bad.toml").write_text(
        'title = "t"\nsource = "s"\njoints = 99\nspeed = 1\nrefresh = 0.1\n'
        '[position]\nat = 0\ntype = "i16"\nunit = "kg"\nscale = 0\nsource = "s"\n'
    )
    with pytest.raises(InputError) as caught:
        load("bad.toml", tmp_path)
    assert all(key in str(caught.value) for key in ("joints", "speed", "position.scale"))
    with pytest.raises(InputError, match="7 joints"):
        _ = cell(tmp_path, 9, model="iiwa14").sources
