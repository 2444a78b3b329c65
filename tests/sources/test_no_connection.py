"""Checking and assessing connect to nothing; a run says whom it connects to, and as whom, before it does."""

from __future__ import annotations

import json
import os
import select
import socket
import subprocess
import sys

import pytest

AUDIT = """
import json, sys
names = []
sys.addaudithook(lambda name, _: names.append(name) if name.startswith("socket.") else None)
"""
EVERY = (
    AUDIT
    + """
import asyncio, contextlib, msgspec, pathlib
from seerob.core.plugin import kinds, load
from seerob.devices.live.listening import LiveSource
from seerob.workstation.source import Source, Target
GIVEN = dict(host="127.0.0.1", url="opc.tcp://127.0.0.1:9", robot="arm", human="op", user="u",
             password_env="SEEROB_P")
MORE = {"web": {"url": "ws://127.0.0.1:9/x"}, "siemens_web": {"url": "http://127.0.0.1:9"},
        "kinect": {"at": {"position": (0, 0, 1)}}, "mediapipe": {"at": {"position": (0, 0, 1)}}}
async def heard(source, target):
    with contextlib.suppress(Exception):
        await asyncio.wait_for(anext(source.listen(target)), 1)
found = {}
for name in kinds("sources"):
    kind = load("sources", name, Source)
    if not issubclass(kind, LiveSource):
        continue
    required = {f.name for f in msgspec.structs.fields(kind) if f.required}
    known = {**GIVEN, **({"port": 9} if "port" in required else {}), **MORE.get(name, {})}
    given = {k: v for k, v in known.items() if k in kind.__struct_fields__}
    source = msgspec.convert(given, kind)
    joints = 7 if name == "fri" else 6
    target = Target(name=source.target(), joints=tuple(map(str, range(joints))), units=("rad",) * joints)
    opened = source.open(pathlib.Path(), target)
    used = list(names)
    names.clear()
    opened.reach()
    if (kind.ask, kind.inquire) == (LiveSource.ask, LiveSource.inquire):  # asks nothing before it listens
        asyncio.run(heard(source, target))
    found[name] = str(source.contact()), used, list(names)
    names.clear()
print(json.dumps(found))
"""
)
COMMAND = (
    AUDIT
    + """
from seerob.app.cli import main
code = main(sys.argv[1:])
print("\\n" + json.dumps(names))
sys.exit(code)
"""
)
LOUD = """
import os, sys
sys.addaudithook(lambda name, _: os.write(1, b"#connect\\n") if name == "socket.connect" else None)
from seerob.app.cli import main
sys.exit(main(sys.argv[1:]))
"""
CELL = """
variables = "variables.toml"
[[robots]]
name = "arm"
model = "library:ur5e"
[[sources]]
kind = "rtde"
robot = "arm"
host = "127.0.0.1"
port = {port}
primary_port = 0
timeout = 1
[[sources]]
kind = "web"
name = "plc"
url = "http://127.0.0.1:{port}/x"
token_env = "SEEROB_P"
[[safety]]
kind = "velocity"
at = "arm/tool0"
limit = 1
"""
VARIABLES = '[[variables]]\nname = "belt"\nsource = "plc"\naddress = "/belt"\ntype = "bool"\n'
SECRET = {**os.environ, "SEEROB_P": "hidden", "SEEROB_P_HOST": "127.0.0.1"}
NO_SOCKET = ("socket.__new__", "socket.gethostname")
"""What libraries do when they are imported: connects to nothing."""


def test_no_live_source_connects_or_listens_when_it_is_opened():
    done = subprocess.run(
        [sys.executable, "-c", EVERY], env=SECRET, capture_output=True, text=True, check=True, timeout=120
    )
    found = json.loads(done.stdout)
    assert len(found) >= 20
    for kind, (contact, opened, reached) in found.items():
        assert not set(opened) - set(NO_SOCKET), kind
        assert contact.startswith(("connects to ", "listens on ", "takes what ")), kind
        # The way that is named is the way that is taken.
        verbs = {"c": "socket.connect", "l": "socket.bind", "t": None}
        if (verb := verbs[contact[0]]) is not None:
            assert {verb, "socket.getaddrinfo"} & set(reached), (kind, reached)
    assert found["web"][0] == "connects to ws://127.0.0.1:9/x, not encrypted"
    assert found["mqtt"][0] == "connects to 127.0.0.1:1883 as 'u' with the secret SEEROB_P, not encrypted"


@pytest.fixture
def cell(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        (tmp_path / "workstation.toml").write_text(CELL.format(port=server.getsockname()[1]))
        (tmp_path / "variables.toml").write_text(VARIABLES)
        yield tmp_path, server


@pytest.mark.parametrize("command", ["check-file", "assess"])
def test_a_workstation_of_live_sources_is_checked_and_assessed_without_a_connection(cell, command):
    folder, server = cell
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, command, str(folder)],
        env=SECRET, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    used = json.loads(done.stdout.splitlines()[-1])
    assert not set(used) - set(NO_SOCKET)
    assert not select.select([server], [], [], 0)[0]
    if command == "check-file":
        assert done.returncode == 0, done.stderr
        assert "checking connects to nothing" in done.stdout
        assert f"rtde arm: connects to 127.0.0.1:{server.getsockname()[1]}, not encrypted" in done.stdout
        assert "with the secret SEEROB_P" in done.stdout
    else:
        assert done.returncode == 3
        assert "a live source, which is heard in real time only" in done.stderr
        assert "seerob run" in done.stderr
    assert "hidden" not in done.stdout + done.stderr


def test_a_run_says_whom_it_connects_to_before_anybody_hears_of_it(cell):
    folder, server = cell
    port = server.getsockname()[1]
    words = ["run", str(folder), "--no-record", "--port", "0", "--seconds", "0.2"]
    done = subprocess.run(
        [sys.executable, "-u", "-c", LOUD, *words],
        env=SECRET, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    said = [" ".join(text.split()) for text in done.stdout.splitlines()]
    first = said.index("#connect")
    assert said[first - 2 : first] == [
        f"connects rtde arm: connects to 127.0.0.1:{port}, not encrypted",
        f"connects plc: connects to http://127.0.0.1:{port}/x with the secret SEEROB_P, not encrypted",
    ]
    assert select.select([server], [], [], 0)[0]
