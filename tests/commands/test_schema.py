"""The JSON schema says what the reader does: an editor that follows it writes files that can be read."""

from __future__ import annotations

import copy
import json
import tomllib
from importlib import resources
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator
from made_cells import seerob

from seerob.app.commands.schema import schema
from seerob.core import plugin
from seerob.session.reading import convert_workstation
from seerob.workstation.workstation import PLUGINS, TABLES

"""What all of them ask is made once: it takes seconds."""

STARTER = tomllib.loads((resources.files("seerob.app.commands") / "starter" / "workstation.toml").read_text())
STATIONS = sorted((Path(__file__).parents[2] / "workstations").glob("*/workstation.toml"))


@pytest.fixture(scope="module")
def validator():
    whole = schema()
    Draft202012Validator.check_schema(whole)
    return Draft202012Validator(whole)


def changed(path, value):
    table = copy.deepcopy(STARTER)
    inner = table
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return table


def test_the_command_writes_it_whole(capsys, tmp_path, validator):
    code, out, _ = seerob(capsys, "schema")
    assert code == 0
    assert json.loads(out) == validator.schema
    seerob(capsys, "schema", "-o", tmp_path / "s.json")
    assert json.loads((tmp_path / "s.json").read_text()) == validator.schema
    seerob(capsys, "new", tmp_path / "cell")
    assert json.loads((tmp_path / "cell/workstation.schema.json").read_text()) == validator.schema


def test_every_workstation_and_the_starter_are_valid(validator):
    assert len(STATIONS) >= 1
    validator.validate(STARTER)
    for file in STATIONS:
        validator.validate(tomllib.loads(file.read_text()))


def test_every_table_and_every_kind_is_in_it(validator):
    properties = validator.schema["properties"]
    assert set(TABLES) | set(PLUGINS) <= set(properties)
    assert not {"folder", "outside", "files"} & set(properties)
    for group in PLUGINS:
        kinds = [body["properties"]["kind"].get("const") for body in properties[group]["items"]["anyOf"]]
        assert set(plugin.kinds(group)) == set(kinds) - {None}


# What both the schema and the reader refuse, and what both take.
REFUSED = [
    (("titel",), "x"),
    (("engine",), {"tik": 0.01}),
    (("engine",), {"timestep": 1.0}),
    (("robots", 0, "modle"), "x"),
    (("robots", 0, "name"), "a b"),
    (("robots", 0, "base", "positon"), [0, 0, 0]),
    (("robots", 0, "base", "position"), [0, 0]),
    (("humans", 0, "sex"), "other"),
    (("humans", 0, "stature"), "tall"),
    (("humans", 0, "mass_mm"), 75),
    (("humans", 0, "stature_mm"), 1750),  # beside stature
    (("humans", 0, "mass_g"), "heavy"),
    (("tools", 0, "at", "position_mm"), [1, 2]),
    (("sources", 0, "fil"), "x"),
    (("sources", 0, "kind"), "cvs"),
    (("safety", 0, "limit"), -1),
    (("safety", 3, "stop", "model"), "magnetic"),
    (("safety", 3, "stop"), {"stopping": 0.35}),
]
TAKEN = [
    (("engine",), {"tick_ms": 10}),
    (("robots", 0, "base"), {"position_mm": [0, 0, 750], "rpy_deg": [0, 0, 90]}),
    (("humans", 0, "joints_deg"), {"elbow_right_flexion": 90}),
    (("tools", 0, "at"), {"position_cm": [0, 0, 6]}),
    (("safety", 0, "limit_mm_s"), 250),
    (("safety", 3, "stop"), {"reaction_ms": 100, "stopping_ms": 350}),
    (("safety", 3, "intrusion_mm"), 5),
]


@pytest.mark.parametrize(("path", "value"), REFUSED)
def test_what_the_reader_refuses_the_schema_refuses(validator, path, value):
    table = changed(path, value)
    assert not validator.is_valid(table)
    assert convert_workstation(table, "w")[1]


@pytest.mark.parametrize(("path", "value"), TAKEN)
def test_what_the_reader_takes_the_schema_takes(validator, path, value):
    table = changed(path, value)
    for key in ("limit", "intrusion"):
        if path[-1].startswith(key + "_"):
            table["safety"][path[1]].pop(key, None)
    assert convert_workstation(table, "w")[1] == []
    validator.validate(table)


def test_a_dotted_kind_may_have_any_option(validator):
    validator.validate(changed(("safety", 0), {"kind": "acme.rules", "anything": 1}))


def test_lists_of_corners_are_said_to_be_polygons_and_other_pairs_are_not() -> None:
    """A form makes up a row between two of a polygon, and nowhere else."""
    marked, pairs = set(), set()

    def visit(name: str, at: object) -> None:
        if isinstance(at, list):
            for each in at:
                visit(name, each)
        if not isinstance(at, dict):
            return
        if at.get("x-polygon"):
            marked.add(name)
        if isinstance(at.get("items"), dict) and "prefixItems" in at["items"]:
            pairs.add(name)
        for key, each in at.items():
            visit(name if key in ("anyOf", "items") else key, each)

    visit("", schema())
    suffixes = ("", "_mm", "_cm", "_inch")
    assert marked == {name + suffix for name in ("corners", "polygon") for suffix in suffixes}
    assert {"torque_limits", "points"} <= pairs - marked
