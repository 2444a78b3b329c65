"""What a dictionary covers, what is heard of it, and a skeleton that says what it does not know."""

from __future__ import annotations

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.app import cli
from seerob.app.commands.variables import skeleton
from seerob.app.console.terminal import Exit
from seerob.app.emulators.siemens_web import SiemensWeb
from seerob.core.errors import InputError
from seerob.devices.variables.live_source import Node
from seerob.workstation.variables import read

STATION = """
variables = "variables.toml"
[[sources]]
kind = "siemens_web"
name = "plc"
url = "URL"
user = "seerob"
password_env = "SEEROB_PLC_PASSWORD"
every = 0.1
timeout = 1.0
[[machines]]
name = "door"
shape = { box = [0.05, 1.0, 2.0] }
slide = { open = "door/open", lower = 0.0, upper = 1.0, travel = 1.5 }
"""
VARIABLES = """
[[variables]]
name = "door/open"
source = "plc"
address = '"Door".open'
type = "bool"
timeout = 1
[[variables]]
name = "belt/speed"
source = "plc"
address = '"Belt".speed'
unit = "mm/s"
timeout = 1
"""


@pytest.fixture
def cell(tmp_path, monkeypatch):
    """A cell with a door, and its PLC."""
    monkeypatch.setenv("SEEROB_PLC_PASSWORD", "seerob")
    monkeypatch.setenv("SEEROB_PLC_PASSWORD_HOST", "127.0.0.1")
    with SiemensWeb(port=0).ready().server as plc:
        (tmp_path / "workstation.toml").write_text(STATION.replace("URL", plc.url), encoding="utf-8")
        (tmp_path / "variables.toml").write_text(VARIABLES, encoding="utf-8")
        yield tmp_path, plc


def test_coverage_says_what_uses_each_variable_and_what_is_heard(cell, capsys):
    folder, _ = cell
    assert cli.main(["variables", str(folder), "--listen", "2"]) == Exit.WITHIN
    said = capsys.readouterr().out
    assert 'door/open = "Door".open, bool; used by machines[0] (door)' in said
    assert said.count("heard: ") == 2
    assert 'belt/speed = "Belt".speed, [mm/s]; used by nothing' in said


def test_what_a_dead_plc_does_not_say_is_undecided(cell, capsys):
    folder, plc = cell
    plc.stop()
    assert cli.main(["variables", str(folder), "--listen", "0.2"]) == Exit.UNDECIDED
    assert "nothing heard from plc" in capsys.readouterr().out
    assert cli.main(["variables", str(folder), "--browse", "plc"]) == Exit.ERROR
    assert cli.main(["variables", str(folder), "--browse", "plk"]) == Exit.ERROR
    assert "did you mean 'plc'" in capsys.readouterr().err


def test_a_skeleton_has_every_variable_and_guesses_no_unit(cell, capsys, tmp_path):
    folder, _ = cell
    assert cli.main(["variables", str(folder), "--browse", "plc"]) == Exit.WITHIN
    file = tmp_path / "skeleton.toml"
    file.write_text(capsys.readouterr().out, encoding="utf-8")
    addresses = [v["address"] for v in tomllib.loads(file.read_text(encoding="utf-8"))["variables"]]
    assert sorted(addresses) == sorted(
        ['"Belt".running', '"Belt".speed', '"Belt".position', '"Curtain".clear', '"Door".open']
    )
    with pytest.raises(InputError, match="unit is missing"):
        read(file)


NODES = st.builds(
    Node,
    address=st.text(min_size=1, max_size=40).filter(lambda a: not a.startswith("{")),
    type=st.sampled_from(["", "Bool", "Real", "String"]),
    unit=st.sampled_from(["", "mm", "furlong", 'q"\n']),
    value=st.text(max_size=20),
)


@given(nodes=st.lists(NODES, max_size=5, unique_by=lambda node: node.address))
def test_whatever_a_device_is_called_the_skeleton_is_toml(nodes):
    entries = tomllib.loads(skeleton(nodes, "plc")).get("variables", [])
    assert [e["address"] for e in entries] == [node.address for node in nodes]
    assert len({e["name"] for e in entries}) == len(nodes)
