"""Ports of emulators that somebody else has: which is named, what is had instead, and who follows."""

from __future__ import annotations

import socket
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import pytest

from free_ports import free_port
from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.app.emulation.options import EmulatorOptions
from seerob.app.emulation.ports import Move, at_ports, held
from seerob.app.emulation.processes import served_anywhere
from seerob.app.emulators.camera import Camera
from seerob.app.emulators.kinect import Kinect
from seerob.app.emulators.modbus import Modbus
from seerob.app.emulators.natnet import Natnet
from seerob.app.emulators.opcua import Opcua
from seerob.app.emulators.ros_tcp import RosTcp
from seerob.app.emulators.rosbridge import Rosbridge
from seerob.app.emulators.rtde import Rtde
from seerob.app.emulators.vive import Vive
from seerob.app.emulators.vrpn import Vrpn
from seerob.app.emulators.web import Web
from seerob.core.errors import InputError
from seerob.session.reading import read

HERE = "127.0.0.1"
CELL_WITH_A_CAMERA = str(Path(__file__).parents[2] / "workstations/motor_station")
KEYS = ("theta", "a", "d", "alpha")


@pytest.fixture
def calibration(tmp_path):
    file = tmp_path / "own.toml"
    file.write_text("".join(f"{key} = [0, 0, 0, 0, 0, 0]\n" for key in KEYS), encoding="utf-8")
    return str(file)


@pytest.fixture
def taken():
    """A port that somebody has: of TCP, or of what is asked for."""
    with ExitStack() as stack:

        def take(kind=socket.SOCK_STREAM):
            other = stack.enter_context(socket.socket(socket.AF_INET, kind))
            other.bind((HERE, 0))
            if kind == socket.SOCK_STREAM:
                other.listen()
            return other.getsockname()[1]

        yield take


@pytest.mark.parametrize("more", [(), ("--delay", "0.01")], ids=["", "behind a bad network"])
def test_the_one_that_is_taken_is_named_of_two(calibration, taken, capsys, more):
    port = str(taken())
    for option, other in (("--port", "--primary-port"), ("--primary-port", "--port")):
        told = [option, port, other, "0", "--calibration", calibration, *more]
        assert cli.main(["emulate", "rtde", *told]) == Exit.ERROR
        said = capsys.readouterr().err
        assert f"{option}: cannot listen on 127.0.0.1:{port}: Address already in use" in said


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("rosbridge", Rosbridge),
        ("modbus", Modbus),
        ("opcua", Opcua),
        ("vrpn", Vrpn),
        ("web", Web),
        ("camera", lambda port: Camera(port=port, cell=CELL_WITH_A_CAMERA)),
        ("natnet", Natnet),
        ("kinect", lambda port: Kinect(port=port, websocket=True)),
        ("ros_tcp", RosTcp),
        ("rtde", lambda port: Rtde(port=port, delay=0.01)),
    ],
)
def test_each_kind_that_listens_has_a_free_one_instead(taken, kind, options):
    protocol = socket.SOCK_DGRAM if kind == "natnet" else socket.SOCK_STREAM
    port = taken(protocol)
    with served_anywhere(kind, options(port=port)) as device:
        assert device.ports["port"] not in (0, port)
        assert device.at == f"listens at {HERE}:{device.ports['port']}"
        with socket.socket(socket.AF_INET, protocol) as other, pytest.raises(OSError, match="in use"):
            other.bind((HERE, device.ports["port"]))


def test_both_ports_of_a_controller(calibration, taken):
    options = Rtde(port=taken(), primary_port=taken(), calibration=calibration)
    with served_anywhere("rtde", options) as device:
        for name, port in device.ports.items():
            assert port != getattr(options, name)
            with socket.create_connection((HERE, port), 60):
                pass
    assert set(device.ports) == {"port", "primary_port"}


def test_what_is_wrong_otherwise_is_said_and_not_tried_again():
    away = served_anywhere("rtde", Rtde(host="192.0.2.1", port=5020))
    with pytest.raises(InputError, match=r"cannot listen on 192\.0\.2\.1:5020"), away:
        pass


CELL = """
[[robots]]
name = "arm"
model = "library:ur10"

[[robots]]
name = "other"
model = "library:ur10"

[[humans]]
name = "person"
stature = 1.7
mass = 70
sex = "male"
"""


def cell(folder, *sources):
    file = folder / "workstation.toml"
    file.write_text(CELL + "".join(sources), encoding="utf-8")
    return SimpleNamespace(
        workstation=read(file), with_addresses=lambda moved: SimpleNamespace(workstation=moved)
    )


def source(kind, *lines):
    return "\n".join((f"[[sources]]\nkind = '{kind}'", *lines, ""))


def camera(name, address):
    return f'[[cameras]]\nname = "{name}"\ncalibration = "lens.toml"\naddress = "{address}"\n'


def test_sources_targets_and_cameras_follow_those_that_they_would_reach(tmp_path):
    target = "[[targets]]\nat = 'arm'\nhost = 'localhost'\ntopic = '/pose'\n"
    asked = cell(
        tmp_path,
        source("rtde", "robot = 'arm'\nhost = 'localhost'\nprimary_port = 30011"),
        source("opcua", "name = 'usual'\nurl = 'opc.tcp://localhost/a'"),
        source("opcua", "name = 'said'\nurl = 'opc.tcp://127.0.0.1:4840/b'"),
        source("modbus", "name = 'away'\nhost = '192.0.2.7'\nport = 5020"),
        source("modbus", "name = 'another'\nhost = '127.0.0.2'\nport = 5020"),
        source("modbus", "name = 'here'\nhost = '127.0.0.1'\nport = 5020"),
        source("vive", "human = 'person'\nport = 5020"),
        target,
        camera("near", "http://localhost:8081/a?b=1"),
        camera("away", "http://192.0.2.7:8081/"),
    )
    moves = [(8081, 7), (30004, 1), (30011, 2), (4840, 3), (5020, 4), (9090, 5)]
    found = at_ports(asked, [Move(HERE, *each) for each in moves]).workstation
    arm, usual, said, *others = found.sources
    assert (arm.port, arm.primary_port) == (1, 2)
    assert (usual.url, said.url) == ("opc.tcp://localhost:3/a", "opc.tcp://127.0.0.1:3/b")
    assert [each.port for each in others] == [5020, 5020, 4, 5020]
    assert found.targets[0].port == 5
    addresses = [each.address for each in found.cameras]
    assert addresses == ["http://localhost:7/a?b=1", "http://192.0.2.7:8081/"]
    (_, *_, vive) = at_ports(asked, [Move("", 5020, 6)]).workstation.sources
    assert vive.port == 6
    assert at_ports(asked, []) is asked


LISTENING = {
    "vive": (Vive, "human = 'person'", socket.SOCK_DGRAM),
    "ros_tcp": (
        lambda port: RosTcp(unity=HERE, port=port),
        "robot = 'arm'\nside = 'endpoint'",
        socket.SOCK_STREAM,
    ),
}


@pytest.mark.parametrize("kind", LISTENING)
def test_where_a_source_listens_both_move_together(tmp_path, taken, kind):
    """Of two runs at once, too, before a source of either listens."""
    emulator, line, protocol = LISTENING[kind]

    def moved(port):
        sources = cell(tmp_path, source(kind, line, f"port = {port}")).workstation.sources
        return held([emulator(port=port)], sources)

    port = taken(protocol)
    with moved(port) as ((options, move),):
        assert move == Move("", port, options.port)
        with socket.socket(socket.AF_INET, protocol) as listening:
            listening.bind((HERE, options.port))
    port = free_port(protocol)
    with moved(port) as ((one, move),):
        assert (one.port, move) == (port, None)
        with moved(port) as ((other, move),):
            assert (move.taken, move.port) == (port, other.port)
            assert port != other.port
    with moved(port) as ((_, move),):
        assert move is None


def test_who_sends_to_another_program_is_left_alone(taken):
    options: EmulatorOptions = Vive(port=taken(socket.SOCK_DGRAM))
    with held([options], []) as found:
        assert found == [(options, None)]
