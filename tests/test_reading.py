"""Tables to typed structs: every mistake in one error, each with file, key, value and remedy."""

from __future__ import annotations

import math
import tomllib
from importlib import resources
from typing import get_args, get_type_hints

import msgspec
import pytest

from seerob.core import plugin
from seerob.core.errors import InputError
from seerob.core.files.toml_file import MAX_FILE_SIZE
from seerob.session.reading import BASES, convert_workstation, read, readable
from seerob.workstation.workstation import Workstation

ROBOT = '[[robots]]\nname = "ur10"\nmodel = "library:ur10"\n'
HUMAN = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
SOLID = "shape = { sphere = 0.1 }\n"
STARTER = (resources.files("seerob.app.commands") / "starter" / "workstation.toml").read_text()


def mistakes(text):
    """Place → what and remedy of every mistake in a text."""
    station, problems = convert_workstation(tomllib.loads(text), "w.toml")
    assert (station is None) == bool(problems)
    assert {p.file for p in problems} <= {"w.toml"}
    return {p.key: f"{p.what}; {p.remedy}" for p in problems}


def thing(group, name, more):
    return f'[[{group}]]\nname = "{name}"\n{more}'


# What is wrong, the place it is in, and what the message must contain.
WRONG = {
    "unknown at the top": ('titel = "x"', "titel", "'title'"),
    "unknown group": ("[[saftey]]\nkind='velocity'", "saftey", "'safety'"),
    "unknown in a table": (ROBOT + "modle = 1", "robots[0].modle", "'model'"),
    "other key beside a missing one": (
        HUMAN.replace("stature", "height").replace("mass = 75\n", ""),
        "humans[0].height",
        "did you mean 'stature', which is missing?",
    ),
    "what is missing, under another name": (
        HUMAN.replace("stature", "height"),
        "humans[0].height",
        "'stature'",
    ),
    "unknown two levels down": (
        ROBOT + "base = { positon = [0, 0, 0] }",
        "robots[0].base.positon",
        "'position'",
    ),
    "unknown in a plug-in": ("[[safety]]\nkind='velocity'\nat='x'\nlimt=1", "safety[0].limt", "'limit'"),
    "unknown in a plug-in's table": (
        "[[safety]]\nkind='separation'\nbetween=['a','b']\nstop={reaction=1,stoping=1}",
        "safety[0].stop.stoping",
        "'stopping'",
    ),
    "text for a number": (
        HUMAN.replace("mass = 75", "mass = '75 kg'"),
        "humans[0].mass",
        "'75 kg' is wrong; expected a number",
    ),
    "text for a number or a percentile": (
        HUMAN.replace("1.75", "'tall'"),
        "humans[0].stature",
        "'tall' is wrong; expected metres, or a population and percentile",
    ),
    "number for text": ("title = 3", "title", "3 is wrong; expected text"),
    "true for a number": (
        ROBOT + "q = [0, true]",
        "robots[0].q[1]",
        "true is wrong; expected a number [rad]",
    ),
    "list for a table": ("engine = [1]", "engine", "expected a table"),
    "table for a list": ("[robots]\nname='x'", "robots", "write [[robots]]"),
    "table for a plug-in list": ("[safety]\nkind='x'", "safety", "write [[safety]]"),
    "numbers for tables": ("sources = [1, 2]", "sources", "write [[sources]]"),
    "not a number": (ROBOT + "base = { position = [0, nan, 0] }", "robots[0].base.position[1]", "nan"),
    "infinite": ("[[safety]]\nkind='velocity'\nat='x'\nlimit=inf", "safety[0].limit", "finite"),
    "astronomic": (
        ROBOT + "base={position=[0,0,1" + "0" * 400 + "]}",
        "robots[0].base.position[2]",
        "finite",
    ),
    "astronomic in mm": (
        ROBOT + "base={position_mm=[0,0,1" + "0" * 400 + "]}",
        "robots[0].base.position_mm[2]",
        "finite",
    ),
    "too far": (ROBOT + "base = { position = [0, 0, 1e7] }", "robots[0].base.position[2]", "<= 1000"),
    "below a range": (
        HUMAN.replace("1.75", "0.5"),
        "humans[0].stature",
        "0.5 is wrong; expected a number >= 0.8 [m]",
    ),
    "no choice": (HUMAN.replace("male", "other"), "humans[0].sex", "one of: male, female"),
    "missing": ("[[humans]]\nname='h'\nmass=75\nsex='male'", "humans[0].stature", "missing; give it [m]"),
    "missing choice": ("[[humans]]\nname='h'\nmass=75\nstature=1.8", "humans[0].sex", "one of: male, female"),
    "missing kind": ("[[safety]]\nlimit = 1", "safety[0].kind", "kinetic_energy"),
    "kind that is none": ("[[safety]]\nkind = 'seperation'", "safety[0].kind", "'separation'"),
    "kind of another table": ("[[safety]]\nkind = 'csv'", "safety[0].kind", "no kind of [[safety]]"),
    "kind that is no text": ("[[sources]]\nkind = 3", "sources[0].kind", "3 is not text"),
    "module that is not there": ("[[safety]]\nkind = 'acme.rules'", "safety[0].kind", "--allow-plugins"),
    "module without a criterion": (
        "[[safety]]\nkind = 'os.path'",
        "safety[0].kind",
        "modules are not imported by their names",
    ),
    "kind with an odd name": ("[[safety]]\nkind = '.velocity'", "safety[0].kind", "velocity"),
    "wrong unit": (HUMAN + "mass_mm = 1", "humans[0].mass_mm", "'mass' is in kg: write mass or mass_g"),
    "unit of what has none": (HUMAN + "sex_mm = 1", "humans[0].sex_mm", "no quantity"),
    "two units": (ROBOT + "base = { rpy=[0,0,1], rpy_deg=[0,0,90] }", "robots[0].base.rpy_deg", "keep one"),
    "two orientations": (ROBOT + "base = { rpy=[0,0,1], wxyz=[1,0,0,0] }", "robots[0].base", "keep one"),
    "no rotation": (ROBOT + "base = { wxyz=[1,1,0,0] }", "robots[0].base", "unit quaternion"),
    "bad name": (ROBOT.replace('"ur10"', '"ur 10/x"', 1), "robots[0].name", "letters, digits"),
    "name twice": (ROBOT + thing("parts", "ur10", SOLID), "parts[0].name", "taken by robots[0].name"),
    "result twice": (
        ROBOT + "[[safety]]\nkind='kinetic_energy'\nrobot='ur10'\nname='a'\n" * 2,
        "safety[1].name",
        "taken by safety[0]",
    ),
    "file twice": ("[[sinks]]\nkind='recorder'\n" * 2, "sinks[1].file", "sinks[0] too"),
    "file elsewhere": ("[[sinks]]\nkind='recorder'\nfile='../x.mcap'", "sinks[0].file", "ends in .mcap"),
    "mount that is not there": (
        ROBOT + thing("tools", "t", SOLID + 'on = "ur1O/tool0"'),
        "tools[0].on",
        "ur10/<link>",
    ),
    "mount on itself": (ROBOT + thing("tools", "t", SOLID + 'on = "t"'), "tools[0].on", "in a circle"),
    "area on nothing": (
        ROBOT + thing("areas", "a", SOLID + 'on = "zz"'),
        "areas[0].on",
        "nothing named 'zz'",
    ),
    "source of nobody": (
        ROBOT + "[[sources]]\nkind='csv'\nrobot='u'\nfile='x'",
        "sources[0].robot",
        "known: ur10",
    ),
    "robot's source for a person": (
        ROBOT + HUMAN + "[[sources]]\nkind='csv'\nrobot='op'\nfile='x'",
        "sources[0].robot",
        "'op' is a human, this source drives a robot; known: ur10",
    ),
    "person's source for a robot": (
        ROBOT + HUMAN + "[[sources]]\nkind='keyframes'\nhuman='ur10'\nfile='x'",
        "sources[0].human",
        "'ur10' is a robot, this source drives a human; known: op",
    ),
    "driven twice": (
        ROBOT + "[[sources]]\nkind='csv'\nrobot='ur10'\nfile='x'\n" * 2,
        "sources[1].robot",
        "driven by",
    ),
    "criterion of nobody": (
        ROBOT + "[[safety]]\nkind='kinetic_energy'\nrobot='u1'",
        "safety[0].robot",
        "'u1'",
    ),
    "criterion between nobody": (
        ROBOT + "[[safety]]\nkind='minimum_distance'\nbetween=['ur10','oper']",
        "safety[0].between[1]",
        "nothing named 'oper'",
    ),
    "criterion of no sensor": (
        ROBOT + "[[safety]]\nkind='scanner_field'\nsensor='scan'\nfield='f'\nof='ur10'",
        "safety[0].sensor",
        "no sensor named 'scan'; known: none",
    ),
    "contact of nothing": (
        ROBOT + "[[contacts]]\nbetween=['zz','ur10']",
        "contacts[0].between[0]",
        "known: ur10",
    ),
    "negative energy": (
        "[[safety]]\nkind='kinetic_energy'\nrobot='x'\nlimit=-1",
        "safety[0].limit",
        "-1 is wrong",
    ),
    "negative distance": (
        "[[safety]]\nkind='minimum_distance'\nbetween=['a','b']\nlimit_mm=-1",
        "safety[0].limit_mm",
        "-1 is wrong; expected a number >= 0 [mm]",
    ),
    "period of nothing": ("[[safety]]\nkind='velocity'\nat='x'\nevery=0", "safety[0].every", "> 0 [s]"),
    "reacts at once": (
        "[[safety]]\nkind='separation'\nbetween=['a','b']\nstop={reaction=0,stopping=1}",
        "safety[0].stop.reaction",
        "> 0 [s]",
    ),
    "stop model of the future": (
        "[[safety]]\nkind='separation'\nbetween=['a','b']\nstop={model='magnetic',reaction=1,stopping=1}",
        "safety[0].stop.model",
        "'magnetic' is wrong; one of: bound, constant_deceleration, table, simulated",
    ),
    "time-out of nothing": (
        "[[sources]]\nkind='csv'\nrobot='x'\nfile='y'\ntimeout=0",
        "sources[0].timeout",
        "> 0",
    ),
    "ticks between steps": ("[engine]\ntick = 0.005", "engine", "whole number"),
    "slow physics": ("[engine]\ntimestep = 0.1", "engine.timestep", "<= 0.002 [s]"),
    "no shape": (thing("parts", "p", ""), "parts[0]", "give either mesh or shape"),
    "flat box": (thing("parts", "p", "shape = { box = [1, 1, 0] }"), "parts[0].shape", "larger than 0 m"),
    "two shapes": (thing("parts", "p", "shape = { box=[1,1,1], sphere=1 }"), "parts[0].shape", "exactly one"),
    "mass and density": (thing("parts", "p", SOLID + "mass=1\ndensity=1"), "parts[0]", "keep one"),
    "colour": (thing("parts", "p", SOLID + "color=[0, 2, 0]"), "parts[0].color[1]", "<= 1"),
    "heavy area": (thing("areas", "a", SOLID + "mass = 1"), "areas[0]", "no mass"),
    "date": ("title = 2020-01-01", "title", "expected text"),
    "hidden field": ("folder = 'x'", "folder", "unknown key"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_names_its_key_and_what_would_be_right(name):
    text, key, words = WRONG[name]
    found = mistakes(text)
    assert key in found
    assert words in found[key]


def test_all_mistakes_come_at_once():
    """A mistake of every sort in one file: none hides another."""
    text = (
        "titel = 'x'\n[engine]\ntick = 0.005\n"
        + (ROBOT + "base = { positon = [0, 0, 0] }\n")
        + HUMAN.replace("1.75", "'tall'").replace("mass = 75", "mass = [75]")
        + thing("parts", "p", "")
        + thing("tools", "t", SOLID + "on = 't'\n")
        + "[[safety]]\nkind = 'seperation'\n[[safety]]\nlimit = 1\n"
        + "[[safety]]\nkind = 'kinetic_energy'\nrobot = 'ur1O'\n"
        + "[[sources]]\nkind = 'csv'\nrobot = 'ur10'\nfile = 'x'\n" * 2
    )
    assert set(mistakes(text)) == {
        "titel",
        "engine",
        "robots[0].base.positon",
        "humans[0].stature",
        "humans[0].mass",
        "parts[0]",
        "tools[0].on",
        "safety[0].kind",
        "safety[1].kind",
        "safety[2].robot",
        "sources[1].robot",
    }


def test_a_name_that_stands_in_a_broken_table_is_still_known():
    found = mistakes(ROBOT + "q = 'x'\n[[safety]]\nkind='kinetic_energy'\nrobot='ur10'")
    assert list(found) == ["robots[0].q"]


def test_what_cannot_be_decided_without_models_is_left_to_binding():
    text = ROBOT + thing("parts", "line/fixture/pin", SOLID)
    for subject in ("line", "line/fixture", "line/fixture/pin/hole", "ur10/tool0", "ur10/*", "l*"):
        assert mistakes(text + f"[[safety]]\nkind='minimum_distance'\nbetween=['ur10','{subject}']") == {}


def test_a_thousand_mistakes_are_cut_short():
    _, problems = convert_workstation({f"key{i}": 1 for i in range(1000)}, "w.toml")
    assert len(problems) == 201
    assert "800 mistakes more" in problems[-1].what


def test_quantities_are_converted_where_the_key_says_so():
    text = ROBOT + "base = { position_mm = [1, 2, 3], rpy_deg = [0, 0, 180] }\n" + HUMAN
    station, _ = convert_workstation(tomllib.loads(text + "joints_deg = { elbow_right = 90 }"), "w.toml")
    base = station.robots[0].base
    assert base.position == (0.001, 0.002, 0.003)
    assert base.rpy == (0, 0, math.pi)
    assert station.humans[0].joints == {"elbow_right": math.pi / 2}


def test_unnamed_entries_get_names_that_say_what_they_are_and_never_collide():
    energy = "[[safety]]\nkind='kinetic_energy'\nrobot='ur10'\n"
    text = ROBOT + energy * 2 + energy + "name = 'kinetic energy ur10'\n"
    station, _ = convert_workstation(tomllib.loads(text), "w.toml")
    assert [c.name for c in station.safety] == [
        "kinetic energy ur10 2",
        "kinetic energy ur10 3",
        "kinetic energy ur10",
    ]


# -- files --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"title = 'x'\n[[robots]\n", "line 2"),
        (b"a = 1\na = 2\n", "line 2"),
        (b"title = 'x'\nname = '\xff\xfe'\n", "line 2: not UTF-8"),
        (b"title = '\x00'\n", "not TOML"),
        (b"a = " + b"[" * 100_000, "nested too deeply"),
        (b"a = 1979-13-45\n", "not TOML"),
        (b"#" * (MAX_FILE_SIZE + 1), "larger than 4 MiB"),
        (b"PK\x03\x04\x14\x00\x00\x00\x08\x00\x9c\xff", "not UTF-8"),
    ],
)
def test_a_file_that_is_not_one_says_why_and_where(tmp_path, content, words):
    file = tmp_path / "workstation.toml"
    file.write_bytes(content)
    with pytest.raises(InputError) as error:
        read(file)
    assert len(error.value.problems) == 1
    assert str(file) in str(error.value)
    assert words in str(error.value)


def test_what_is_wrong_at_the_top_hides_nothing_else_there(tmp_path):
    (tmp_path / "workstation.toml").write_text("title = 'x'\nedition = 7\n[engine]\ntick = 1\n" + ROBOT)
    found = readable(tmp_path)
    assert {p.key for p in found.problems} == {"edition", "engine.tick"}
    assert found.head.title == "x"
    assert found.entries["robots"][0].name == "ur10"


def test_what_is_right_in_a_robot_of_the_library_can_be_looked_at(tmp_path):
    wrong = "q = [0]\nbase = { positon = [0, 0, 0] }\nargumnts = {}\n"
    of_a_file = ROBOT.replace("ur10", "b").replace("library:b", "b.urdf")
    (tmp_path / "workstation.toml").write_text(ROBOT + wrong + of_a_file + wrong)
    found = readable(tmp_path)
    assert len(found.problems) == 4
    assert {i: robot.q for i, robot in found.entries["robots"].items()} == {0: (0.0,)}


def test_windows_line_ends_and_a_byte_order_mark_are_read(tmp_path):
    (tmp_path / "workstation.toml").write_bytes(
        b"\xef\xbb\xbf" + ("title = 'x'\n" + ROBOT).replace("\n", "\r\n").encode()
    )
    assert read(tmp_path).robots[0].name == "ur10"


@pytest.mark.parametrize("path", ["nowhere", "a" * 5000, "nul\0byte"])
def test_no_file_says_how_to_make_one(tmp_path, path):
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / path)


def test_the_starter_and_its_folder_read_the_same(tmp_path):
    file = tmp_path / "workstation.toml"
    file.write_text(STARTER)
    assert read(file) == read(str(tmp_path))


def _patterns(wanted, seen):
    """Every metadata with a pattern in a type, at any depth."""
    yield from (m for m in getattr(wanted, "__metadata__", ()) if getattr(m, "pattern", None))
    inner = [getattr(wanted, "__origin__", None), *get_args(wanted)]
    if isinstance(wanted, type) and issubclass(wanted, msgspec.Struct) and wanted not in seen:
        seen.add(wanted)
        inner += get_type_hints(wanted, include_extras=True).values()
    for item in inner:
        if item is not None:
            yield from _patterns(item, seen)


@pytest.mark.parametrize("group", BASES)
def test_no_user_reads_a_regular_expression(group):
    kinds = [plugin.load(group, kind, BASES[group]) for kind in plugin.kinds(group)]
    silent = [
        m.pattern for kind in (*kinds, Workstation) for m in _patterns(kind, set()) if not m.description
    ]
    assert not silent
