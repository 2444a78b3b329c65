"""The dictionary of a workstation: read with it, checked against its sources, kept with its files."""

from __future__ import annotations

import pytest

from seerob import load
from seerob.core.errors import InputError
from seerob.session.opening import source_target

STATION = """
variables = "variables.toml"
[[sources]]
kind = "mqtt"
name = "plc"
host = "127.0.0.1"
port = 1
[[sources]]
kind = "mqtt"
name = "other"
host = "127.0.0.1"
port = 1
[[sources]]
kind = "csv"
name = "motion"
robot = "arm"
file = "motion.csv"
[[robots]]
name = "arm"
model = "library:ur10"
"""
SPEED = """
[[variables]]
name = "belt/speed"
source = "plc"
address = "line/speed"
unit = "mm/s"
"""


def made(folder, dictionary, station=STATION):
    (folder / "workstation.toml").write_text(station)
    (folder / "variables.toml").write_text(dictionary)
    return load(folder)


def test_each_source_gets_its_own_variables_and_the_file_travels_along(tmp_path):
    station = made(tmp_path, SPEED)
    model = station.model
    assert list(model.dictionary) == ["belt/speed"]
    assert model.files["variables.toml"] == SPEED.encode()
    by_name = {source.name: source_target(model, source) for source in model.workstation.sources}
    assert [v.name for v in by_name["plc"].variables] == ["belt/speed"]
    assert by_name["plc"].name == ""
    assert by_name["plc"].folder == str(model.folder)
    assert by_name["other"].variables == ()
    assert by_name["motion"].name == "arm"


def test_every_mistake_is_told_at_once(tmp_path):
    wrong = SPEED.replace('"plc"', '"plk"') + SPEED.replace('"plc"', '"motion"').replace("speed", "slow")
    with pytest.raises(InputError) as error:
        made(tmp_path, wrong, STATION.replace("library:ur10", "library:ur11"))
    text = str(error.value)
    assert "no source named 'plk'; did you mean 'plc'" in text
    assert "'motion' reads no variables" in text
    assert "ur11" in text


@pytest.mark.parametrize("path", ["../variables.toml", "/etc/passwd", "nothing.toml"])
def test_a_dictionary_lies_beside_the_workstation(tmp_path, path):
    with pytest.raises(InputError, match=r"variables|no such file|cannot be read"):
        made(tmp_path, SPEED, STATION.replace('"variables.toml"', f'"{path}"'))


def test_one_address_under_two_names_is_noticed(tmp_path):
    station = made(tmp_path, SPEED + SPEED.replace("belt/speed", "conveyor/speed"))
    texts = [f.text for f in station.model.findings]
    assert any("belt/speed, conveyor/speed are the same variable" in text for text in texts)
