"""Extras of the wheel: nobody imports what only others need, and a missing package names its extra."""

from __future__ import annotations

import asyncio
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.app.emulators.modbus import Modbus as ModbusEmulator
from seerob.app.emulators.opcua import Opcua as OpcuaEmulator
from seerob.app.emulators.rosbridge import Rosbridge as RosbridgeEmulator
from seerob.core.extras import EXTRAS, MissingPackage, need
from seerob.devices.sources.modbus import Modbus
from seerob.devices.sources.mqtt import Mqtt
from seerob.devices.sources.opcua import Opcua
from seerob.devices.sources.rosbridge import Rosbridge
from seerob.devices.sources.siemens_web import SiemensWeb
from seerob.devices.sources.web import Web
from seerob.files.motion_capture.ros_bag import connections
from seerob.protocols.ros.ros_messages import Edition, store
from seerob.workstation.source import Target

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DISTRIBUTION = {
    "zenoh": "eclipse-zenoh",
    "xr": "pyopenxr",
    "OCP": "cadquery-ocp-novtk",
    "pxr": "usd-core",
    "cv2": "opencv-python-headless",
}
ARM = Target(name="arm", joints=("a",))
BLOCKED = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if any(f"{name}.".startswith(f"{p}.") for p in PACKAGES):
            raise ModuleNotFoundError(f"blocked: {name}", name=name)
PACKAGES = %r
sys.meta_path.insert(0, Blocked())
import seerob, seerob.api
from seerob.app import cli
from seerob.app.server import live
from seerob.session import run, station
assert cli.main(["kinds"]) == 0
assert cli.main(["new", sys.argv[1]]) == 0
assert cli.main(["check-file", sys.argv[1]]) in (0, 2)
print(sorted(m for m in sys.modules if any(f"{m}.".startswith(f"{p}.") for p in PACKAGES)))
"""


def names(requirements):
    return {re.match(r"[A-Za-z0-9_.-]+", text)[0] for text in requirements}


@pytest.fixture
def missing(monkeypatch):
    """Packages of extras that are as if they were not installed."""

    def of(package):
        for module in list(sys.modules):
            if f"{module}.".startswith(f"{package}."):
                monkeypatch.delitem(sys.modules, module)
        monkeypatch.setitem(sys.modules, package, None)

    store.cache_clear()
    return of


def test_each_package_is_in_its_extra_and_not_in_the_base():
    for package, extra in EXTRAS.items():
        distribution = DISTRIBUTION.get(package, package)
        assert distribution in names(PROJECT["optional-dependencies"][extra])
        assert distribution not in names(PROJECT["dependencies"])


def test_without_any_extra_the_kinds_are_listed_and_the_starter_runs(tmp_path):
    command = [sys.executable, "-c", BLOCKED % (tuple(EXTRAS),), str(tmp_path / "cell")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("package", EXTRAS)
def test_a_missing_package_names_its_extra(missing, package):
    missing(package)
    with pytest.raises(MissingPackage) as raised:
        need("seerob", f"{package}.of_it")
    assert str(raised.value) == f"this needs {package}: pip install 'seerob[{EXTRAS[package]}]'"


def connected(source):
    """What a probe asks, which opens nothing."""
    asyncio.run(source.ask())


@pytest.mark.parametrize(
    ("package", "used"),
    [
        ("asyncua", lambda: Opcua(url="opc.tcp://127.0.0.1:1").open(Path(), None)),
        ("aiomqtt", lambda: Mqtt(host="127.0.0.1").open(Path(), None)),
        ("pymodbus", lambda: Modbus(host="127.0.0.1").open(Path(), None)),
        ("pymodbus", lambda: connected(Modbus(host="127.0.0.1"))),
        ("httpx", lambda: Web(url="http://127.0.0.1:1").open(Path(), None)),
        ("httpx", lambda: connected(SiemensWeb(url="https://127.0.0.1:1", user="a", password_env="B"))),
        (
            "cbor2",
            lambda: Rosbridge(robot="arm", host="127.0.0.1").open(Path(), Target(name="arm", joints=("a",))),
        ),
        ("rosbags", lambda: store(Edition.ROS2)),
        ("rosbags", lambda: connections(Path("none.bag"), "none.bag")),
        ("asyncua", lambda: OpcuaEmulator().ready()),
        ("pymodbus", lambda: ModbusEmulator().ready()),
        ("rosbags", lambda: RosbridgeEmulator().ready()),
    ],
)
def test_what_needs_it_says_so_before_anything_is_connected(missing, package, used):
    missing(package)
    with pytest.raises(
        MissingPackage, match=rf"this needs {package}: pip install 'seerob\[{EXTRAS[package]}\]'"
    ):
        used()


def test_a_command_that_needs_one_ends_with_an_error(missing, capsys):
    missing("asyncua")
    assert cli.main(["emulate", "opcua"]) == Exit.ERROR
    missing("pymodbus")
    assert cli.main(["probe", "modbus", "127.0.0.1"]) == Exit.ERROR
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "this needs asyncua: pip install 'seerob[opcua]'"
    assert said[1] == "this needs pymodbus: pip install 'seerob[modbus]'"
