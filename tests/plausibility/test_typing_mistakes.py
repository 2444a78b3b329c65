"""A value that nobody would mean keeps verdicts undecided until the file confirms it."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, get_args

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from made_sensible import CELL, STANDS, cell, doubted, station_of, verdicts

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.core import plugin
from seerob.core.snapshot import Verdict
from seerob.criteria.safety.velocity import Velocity
from seerob.devices.live.listening import LiveSource
from seerob.model.mounting.in_place import implausible
from seerob.session.reading import BASES, read
from seerob.session.station import load
from seerob.workstation.conversion import is_struct, members, unit_of
from seerob.workstation.plausibility.ranges import (
    FOLLOWS,
    LISTS,
    PLUGINS,
    data,
    entries_of,
    findings,
    listed,
    unknown,
)
from seerob.workstation.workstation import TABLES, Confirmed, Engine, Workstation

ROOT = Path(__file__).parents[2]


def test_a_sensible_cell_is_within_and_nothing_of_it_is_implausible(tmp_path: Path) -> None:
    station = station_of(tmp_path, cell(stop=f"{CELL['stop']}, acceleration = 2"))
    assert doubted(station) == []
    assert {r.verdict for r in results_at(station, ur5=STANDS).values()} == {Verdict.WITHIN}


INCH = 'units = "mm"\nmesh = "tool.stl"\n'
STOPS = "{{ joint = {j}, full_speed = 180, way = [[[0.3]]], time = [[[0.3]]] }}"
TABLED = (
    'reaction = 0.1, model = "table", table_for = "ur5", table = { robot = "ur5", '
    'category = 0, source = "s", confidence = "1S", rated_payload = 5, joints = ['
)


def tabled(figures: str) -> dict[str, str]:
    """Stopping tables of six joints, the first as it is typed."""
    right = "full_speed = 3, way = [[[0.4]]], time = [[[0.3]]]"
    joints = ", ".join(f"{{ joint = {j}, {right if j else figures} }}" for j in range(6))
    return {"stop": f"{TABLED}{joints}] }}"}


MISTAKES: dict[str, tuple[dict[str, str], str, set[str]]] = {
    # what is typed, the key that is named, the criteria that may still be within
    "degrees in rpy": ({"base": "position = [0, 0, 0.75], rpy = [0, 0, 90]"}, "robots[0].base.rpy", set()),
    "base at 75 m": ({"base": "position = [75, 0, 0.75]"}, "robots[0].base.position", set()),
    "mm for m in a base": ({"base": "position = [30, 0, 0.75]"}, "robots[0].nobody_within", set()),
    "reaction of 100 s": (
        {"stop": "reaction = 100, stopping = 0.35"},
        "safety[2].stop.reaction",
        {"speed", "distance"},
    ),
    "m/s in mm/s": ({"separation": "human_speed_mm_s = 1.6"}, "safety[2].human_speed", {"speed", "distance"}),
    "radians in rpy_deg": (
        {"at": "at = { position = [1.75, 0, 0], rpy_deg = [0, 0, 3.14159] }"},
        "humans[0].at.rpy",
        {"speed"},
    ),
    "metres in position_mm of a tool": (
        {"tool": CELL["tool"] + "\nat = { position_mm = [0, 0, 0.06] }"},
        "tools[0].at.position",
        set(),
    ),
    "a tool in the air": (
        {"tool": CELL["tool"] + "\nat = { position = [0, 0, 0.6] }"},
        "tools[0].apart",
        set(),
    ),
    "kg·mm² for kg·m² divided once more": (
        {"tool": CELL["tool"] + "\ncom = [0, 0, 0]\ninertia = [3e-9, 3e-9, 3e-9, 0, 0, 0]"},
        "tools[0].gyration",
        set(),
    ),
    "g·cm² for kg·m²": (
        {"tool": CELL["tool"] + "\ncom = [0, 0, 0]\ninertia = [3e4, 3e4, 3e4, 0, 0, 0]"},
        "tools[0].gyration",
        set(),
    ),
    "a centre of mass ten times as far out": (
        {"tool": CELL["tool"] + "\ncom = [0, 0, 0.2]"},
        "tools[0].com_outside",
        set(),
    ),
    "an area of a third of a millimetre": (
        {
            "more": '[[areas]]\nname = "side"\nshape = { box = [3e-4, 3e-4, 3e-4] }\n'
            "at = { position = [1.75, 0.5, 1] }\n"
        },
        "areas[0].extent",
        {"speed", "distance", "separation"},
    ),
    "an area below the floor": (
        {
            "more": '[[areas]]\nname = "side"\nshape = { box = [0.5, 0.5, 0.5] }\n'
            "at = { position = [1.75, 0.5, -1] }\n"
            '[[safety]]\nkind = "safety_area"\nname = "clear"\narea = "side"\nof = ["ur5"]\n'
        },
        "areas[0].below_floor",
        {"speed", "distance", "separation"},
    ),
    "a scanner below the floor": (
        {
            "more": '[[sensors]]\nname = "s"\nresponse = 0.1\ncapability = 0.07\nsource = "data sheet"\n'
            "at = { position = [1.75, 1, -0.3] }\n[sensors.laser_scanner]\nrange = 5\nangle = 3\n"
            "resolution = 0.01\n"
            'fields = [{ name = "warn", corners = [[0, -1], [1, -1], [1, 1], [0, 1]] }]\n'
            '[[safety]]\nkind = "scanner_field"\nname = "clear"\nsensor = "s"\nfield = "warn"\n'
            'of = ["operator"]\n'
        },
        "sensors[0].below_floor",
        {"speed", "distance", "separation"},
    ),
    "a drive force in kN": (
        {
            "more": '[[safety]]\nkind = "power_and_force"\nname = "contact"\nrobot = "ur5"\n'
            'human = "operator"\ndrive_force = 0.15\n'
        },
        "safety[3].drive_force",
        {"speed", "distance", "separation"},
    ),
    "inside the table": (
        {"table": "at = { position = [2.0, 0, 0.37] }"},
        "humans[0].inside.table",
        {"speed"},
    ),
    "a metre above the floor": ({"at": "at = { position = [1.75, 0, 1.0] }"}, "humans[0].feet", {"speed"}),
    "below the floor": ({"at": "at = { position = [1.75, 0, -0.3] }"}, "humans[0].feet", {"speed"}),
    "robot inside the table": ({"base": "position = [0.8, 0, 0.4]"}, "robots[0].inside.table", set()),
    "robot on the floor in the table that stands there": (
        {"base": "position = [0.8, 0, 0]"},
        "robots[0].inside.table",
        set(),
    ),
    "two robots in one place": (
        {
            "more": '[[robots]]\nname = "b"\nmodel = "library:ur5"\nbase = { position = [0, 0, 0.75] }\n'
            "q = [0, 0, 0, 0, 0, 0]\n"
        },
        "robots[0].inside.b",
        set(),
    ),
    "inch mesh in mm": ({"tool": INCH + "density = 7850"}, "tools[0].mass", set()),
    "inch mesh in mm, weighed": ({"tool": INCH + "mass = 3"}, "tools[0].bulk_density", set()),
    "tool in mm": ({"tool": "shape = { box = [80, 100, 120] }\nmass = 1.2"}, "tools[0].extent", set()),
    "grams for kilograms": (
        {"tool": "shape = { box = [0.08, 0.1, 0.12] }\nmass = 800"},
        "tools[0].mass",
        set(),
    ),
    "base under a roof": ({"base": "position = [0, 0, 9]"}, "robots[0].height", set()),
    "x of the base with the other sign": (
        {"base": "position = [-0.8, 0, 0.74]"},
        "robots[0].stands_on_nothing",
        set(),
    ),
    "y of the base with the other sign": (
        {"base": "position = [0.8, -1.6, 0.74]", "table": "at = { position = [0.8, 1.6, 0.37] }"},
        "robots[0].stands_on_nothing",
        set(),
    ),
    "above the payload": (
        {"tool": "shape = { box = [0.08, 0.1, 0.12] }\nmass = 8"},
        "robots[0].payload",
        set(),
    ),
    "tcp at 120 m": (
        {"tool": CELL["tool"] + "\ntcp = { position = [0, 0, 4] }"},
        "tools[0].tcp.position",
        set(),
    ),
    "limit in mm/s": ({"limit": "limit = 250"}, "safety[0].limit", {"distance", "separation"}),
    "a person placed in mm": (
        {"at": "at = { position_mm = [1.75, 0, 0], rpy_deg = [0, 0, 180] }"},
        "humans[0].at.position",
        set(),
    ),
    "an area placed in mm": (
        {
            "more": '[[areas]]\nname = "side"\nshape = { box = [1, 1, 2] }\n'
            "at = { position_mm = [1.75, 0.5, 1] }\n"
        },
        "areas[0].at.position",
        {"speed", "distance", "separation"},
    ),
    "limit in mJ": (
        {"more": '[[safety]]\nkind = "kinetic_energy"\nrobot = "ur5"\nlimit = 300\n'},
        "safety[3].limit",
        {"speed", "distance", "separation"},
    ),
    "a quaternion with w last": (
        {"base": "position = [0, 0, 0.75], wxyz = [0, 0, 0.70710678, 0.70710678]"},
        "robots[0].base.wxyz",
        set(),
    ),
    "no turn with w last": (
        {"tool": CELL["tool"] + "\ntcp = { position = [0, 0, 0.12], wxyz = [0, 0, 0, 1] }"},
        "tools[0].tcp.wxyz",
        set(),
    ),
    "a working point on the other side of the flange": (
        {"tool": CELL["tool"] + "\ntcp = { position = [0, 0, -0.2] }"},
        "tools[0].tcp_outside",
        set(),
    ),
    "a tool that stands out of the flange sideways": (
        {"tool": CELL["tool"] + "\nat = { rpy_deg = [0, 90, 0] }\ntcp = { position = [0, 0, 0.1] }"},
        "tools[0].across",
        set(),
    ),
    "a gripper of the library on a flange whose x points out": (
        {"tool": 'model = "library:onrobot_rg2"\nat = { rpy_deg = [0, -90, 0] }'},
        "tools[0].across",
        set(),
    ),
    "metres in offset_mm": (
        {"limit": "limit = 1.0\noffset_mm = [0, 0, 0.13]"},
        "safety[0].offset",
        {"distance", "separation"},
    ),
    "a door's travel in milliseconds": (
        {
            "more": '[[machines]]\nname = "door"\nshape = { box = [0.05, 1, 2] }\n'
            "at = { position = [-2, 0, 1] }\n"
            'slide = { along = [0, 1, 0], open = "o", lower = 0, upper = 1, travel = 1500 }\n'
        },
        "machines[0].slide.travel",
        {"speed", "distance", "separation"},
    ),
    "kilograms in load_g": (
        {"more": '[[phases]]\ntitle = "lifts"\nload_g = 8\n'},
        "phases[0].load",
        set(),
    ),
    "hours of lifting as seconds": (
        {
            "more": '[[ergonomics]]\nkind = "niosh"\nname = "lift"\nhuman = "operator"\nwork = 4\n'
            "recovery = 600\nexclusions = []\nlifts = [{ load = 18, heaviest = 20, per_minute = 3, "
            'control = false, coupling = "fair", origin = { horizontal = 0.5, vertical = 0.3, '
            "asymmetry_deg = 40 }, destination = { horizontal = 0.5, vertical = 1.2, asymmetry = 0 } }]\n"
        },
        "ergonomics[0].work",
        {"speed", "distance", "separation"},
    ),
    "radians in a threshold in degrees": (
        {
            "more": '[[ergonomics]]\nkind = "rula"\nname = "posture"\nhuman = "operator"\n'
            "thresholds = { trunk_twist_deg = 0.17 }\n"
        },
        "ergonomics[0].thresholds.trunk_twist",
        {"speed", "distance", "separation"},
    ),
    "degrees in a threshold in radians": (
        {
            "more": '[[ergonomics]]\nkind = "rula"\nname = "posture"\nhuman = "operator"\n'
            "thresholds = { trunk_twist = 3 }\n"
        },
        "ergonomics[0].thresholds.trunk_twist",
        {"speed", "distance", "separation"},
    ),
    "degrees in a threshold of OWAS": (
        {
            "more": '[[ergonomics]]\nkind = "owas"\nname = "posture"\nhuman = "operator"\n'
            "thresholds = { bent = 2 }\n"
        },
        "ergonomics[0].thresholds.bent",
        {"speed", "distance", "separation"},
    ),
    "degrees in a movement": (
        {
            "more": '[[ergonomics]]\nkind = "reba"\nname = "posture"\nhuman = "operator"\n'
            "detect = { movement = 3 }\n"
        },
        "ergonomics[0].detect.movement",
        {"speed", "distance", "separation"},
    ),
    "radians in a tolerance in degrees": (
        {
            "more": '[[ergonomics]]\nkind = "rula"\nname = "posture"\nhuman = "operator"\n'
            "detect = { tolerance_deg = 0.0873 }\n"
        },
        "ergonomics[0].detect.tolerance",
        {"speed", "distance", "separation"},
    ),
    "an action level that nothing exceeds": (
        {"more": '[[ergonomics]]\nkind = "rula"\nname = "posture"\nhuman = "operator"\naction_level = 4\n'},
        "ergonomics[0].action_level",
        {"speed", "distance", "separation"},
    ),
    "a category that nothing exceeds": (
        {
            "more": '[[ergonomics]]\nkind = "owas"\nname = "posture"\nhuman = "operator"\n'
            "action_category = 4\n"
        },
        "ergonomics[0].action_category",
        {"speed", "distance", "separation"},
    ),
    "points in another scale": (
        {
            "more": '[[ergonomics]]\nkind = "eaws_posture"\nname = "posture"\nhuman = "operator"\n'
            "cycle = 60\nlimit = 100\n"
        },
        "ergonomics[0].limit",
        {"speed", "distance", "separation"},
    ),
    "a radius of a body's size": (
        {
            "more": '[[safety]]\nkind = "power_and_force"\nname = "contact"\nrobot = "ur5"\n'
            'human = "operator"\ncontact_radius = { ur5 = 0.57 }\n'
        },
        "safety[3].contact_radius.ur5",
        {"speed", "distance", "separation"},
    ),
    "limit in g": (
        {"more": '[[safety]]\nkind = "effective_mass"\nat = "ur5"\nlimit = 300\n'},
        "safety[3].limit",
        {"speed", "distance", "separation"},
    ),
    "limit of 1.2 mm": (
        {"more": '[[safety]]\nkind = "minimum_distance"\nbetween = ["ur5", "operator"]\nlimit_mm = 1.2\n'},
        "safety[3].limit",
        {"speed", "distance", "separation"},
    ),
    "a time-out of 10 s": (
        {"more": '[[sources]]\nkind = "csv"\nrobot = "ur5"\nfile = "m.csv"\ntimeout = 10\n'},
        "sources[0].timeout",
        set(),
    ),
    "gravity upwards": ({"more": "[engine]\ngravity = [0, 0, 9.81]\n"}, "engine.gravity.turned", set()),
    "gravity along x": ({"more": "[engine]\ngravity = [9.81, 0, 0]\n"}, "engine.gravity.turned", set()),
    "a base below the floor": ({"base": "position = [0, 0, -0.75]"}, "robots[0].below_floor", set()),
    "an acceleration in another unit": (
        {"stop": f"{CELL['stop']}, acceleration = 0.002"},
        "safety[2].stop.acceleration",
        {"speed", "distance"},
    ),
    "no gravity": ({"more": "[engine]\ngravity = [0, 0, -981]\n"}, "engine.gravity", set()),
    "a tracking limit of 3 rad": ({"more": "[engine]\ntracking_limit = 3\n"}, "engine.tracking_limit", set()),
    "pounds": ({"person": "stature = 1.75\nmass = 200"}, "humans[0].mass", {"speed"}),
    "light for the stature": ({"person": "stature = 2.05\nmass = 45"}, "humans[0].bmi", {"speed"}),
    "a deceleration of 9810": (
        {"stop": 'model = "constant_deceleration", reaction = 0.1, deceleration = 9810'},
        "safety[2].stop.deceleration",
        {"speed", "distance"},
    ),
    "°/s in a table of stops": (
        {
            "stop": 'reaction = 0.1, model = "table", table_for = "ur5", table = { robot = "ur5", '
            'category = 0, source = "s", confidence = "1S", rated_payload = 5, joints = ['
            + ", ".join(STOPS.format(j=j) for j in range(6))
            + "] }"
        },
        "safety[2].stop.table.joints[0].full_speed",
        {"speed", "distance"},
    ),
    "ways in turns in a table of stops": (
        tabled("full_speed = 3, way = [[[0.064]]], time = [[[0.3]]]"),
        "safety[2].stop.table.joints[0].share",
        {"speed", "distance"},
    ),
    "cells of a table of stops that were left empty": (
        tabled("full_speed = 3, speed = [0.5, 1], way = [[[0.2]], [[0]]], time = [[[0.3]], [[0.3]]]"),
        "safety[2].stop.table.joints[0].way",
        {"speed", "distance"},
    ),
    "asked once in an hour": (
        {"limit": "limit = 1.0\nevery = 3600"},
        "safety[0].every",
        {"distance", "separation"},
    ),
    "180 for 180°/s": (
        {"more": ""},
        "robots[0].velocity_limits",
        set(),
    ),
}


def _typed(folder: Path, changed: Mapping[str, str], key: str, how: Callable[[Path], Any] = load) -> Any:
    import trimesh

    trimesh.creation.box((6.0, 5.0, 15.0)).export(folder / "tool.stl")
    (folder / "m.csv").write_text(
        "t [s],J1 [deg],J2 [deg],J3 [deg],J4 [deg],J5 [deg],J6 [deg]\n"
        "0,180,-90,-90,-90,90,0\n1,180,-90,-90,-90,90,0\n"
    )
    text = cell(**changed)
    if key.endswith("velocity_limits"):
        text = text.replace("q_deg", "velocity_limits = [180, 180, 180, 180, 180, 180]\nq_deg", 1)
    (folder / "workstation.toml").write_text(text)
    return how(folder)


# Of one mistake of each sort the verdicts are looked at, and of all that follow from the compiled model.
WHOLE = [
    name
    for name, (_, key, _) in MISTAKES.items()
    if key.rpartition(".")[2] in ("reaction", "rpy", "timeout", "full_speed", "tracking_limit")
    or any(key.partition(".")[2].startswith(what) for whats in FOLLOWS.values() for what in whats)
]


@pytest.mark.parametrize("name", [name for name in MISTAKES if name not in WHOLE])
def test_a_mistake_is_found_in_the_file(name: str, tmp_path: Path) -> None:
    changed, key, _ = MISTAKES[name]
    read_ = _typed(tmp_path, changed, key, read)
    assert isinstance(read_, Workstation)
    (found,) = findings(listed(entries_of(read_), read_.engine), ())
    assert found.text.startswith(f"{key} = ")
    assert found.holds


@pytest.mark.parametrize("name", WHOLE)
def test_a_mistake_is_found_and_what_rests_on_it_is_not_within(name: str, tmp_path: Path) -> None:
    changed, key, rest = MISTAKES[name]
    station = _typed(tmp_path, changed, key)
    found = [f for f in doubted(station) if f.text.startswith(f"{key} = ")]
    assert len(found) == 1, [f.text for f in station.model.findings]
    assert found[0].level == "warning"
    within = {name for name, verdict in verdicts(station).items() if verdict is Verdict.WITHIN}
    assert within <= rest
    # As the message says, so it is confirmed, and only then.
    line = re.search(r"\[\[confirmed\]\] key = .*, value = .*, why = \"…\"", found[0].text)
    assert line
    written = line[0].replace("]] ", "]]\n").replace("…", "meant")
    table = tomllib.loads(re.sub(r", (of|value|why) =", r"\n\1 =", written))
    one = msgspec.convert(table["confirmed"][0], Confirmed)
    workstation = msgspec.structs.replace(station.workstation, confirmed=(one,))
    again = implausible(dataclasses.replace(station.model, workstation=workstation))
    (said,) = (f for f in again if f.text.startswith(f"{key} = "))
    assert (said.holds, said.level) == ((), "note")
    assert said.text.endswith("; confirmed: meant")
    assert not unknown({0: one}, entries_of(station.workstation), station.workstation.engine, "file")


@pytest.mark.parametrize(
    ("header", "factor", "key"),
    [
        ("t [s],J1 [deg]", (0.01, 50.0), None),
        ("t [s],J1 [deg]", (10.0, 50.0), "sources[0].step"),  # ms
        ("t [s],J1 [deg]", (0.01, 1.0), "sources[0].degrees"),  # rad
        ("t [s],J1 [rad]", (0.01, 5.0), "sources[0].speed"),
    ],
)
def test_units_of_a_motion(tmp_path: Path, header: str, factor: tuple[float, float], key: str | None) -> None:
    unit = header[-5:].strip("1 ")
    names = ",".join(["t [s]", *(f"J{i + 1} {unit}" for i in range(6))])
    k = np.arange(40)
    q = factor[1] * 0.02 * np.column_stack([k, *[np.zeros(40)] * 5])
    np.savetxt(
        tmp_path / "m.csv", np.column_stack([k * factor[0], q]), header=names, comments="", delimiter=","
    )
    mapping = f'[sources.mapping]\njoint_unit = "{unit[1:4]}"\ntime_unit = "s"\n'
    more = f'[[sources]]\nkind = "csv"\nrobot = "ur5"\nfile = "m.csv"\n{mapping}'
    station = station_of(tmp_path, cell(more=more))
    held = [f for _, o in station.sources for f in o.findings if f.holds]
    assert [f.text.partition(" = ")[0] for f in held] == [key] * (key is not None)
    assert all(f.holds == ("ur5",) for f in held)


WALK = """
[[sources]]
kind = "keyframes"
human = "operator"
file = "library:reach"
"""


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({}, None),
        ({"base": "position = [30, 0, 0.75]"}, "robots[0].nobody_within"),
        ({"at": "at = { position = [1.75, 0, 1.0] }"}, "humans[0].feet"),
        ({"table": "at = { position = [1.75, 0, 0.37] }"}, "humans[0].inside.table"),
    ],
)
def test_where_a_recorded_motion_begins_is_looked_at(
    tmp_path: Path, changed: dict[str, str], key: str | None
) -> None:
    station = station_of(tmp_path, cell(**changed, more=WALK))
    assert doubted(station) == []
    held = [f for _, o in station.sources for f in o.findings if f.holds]
    assert {f.text.partition(" = ")[0] for f in held} == ({key} if key else set())


def test_a_robot_that_a_file_moves_in_a_table_that_stands_on_its_floor_is_found(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(
        "t [s],J1 [deg],J2 [deg],J3 [deg],J4 [deg],J5 [deg],J6 [deg]\n"
        "0,180,-90,-90,-90,90,0\n1,180,-80,-90,-90,90,0\n"
    )
    more = '[[sources]]\nkind = "csv"\nrobot = "ur5"\nfile = "m.csv"\n'
    station = station_of(tmp_path, cell(base="position = [0.8, 0, 0]", more=more))
    held = [f for _, o in station.sources for f in o.findings if f.holds]
    assert [f.text.partition(" = ")[0] for f in held] == ["robots[0].inside.table"]


def test_two_things_that_stand_on_one_floor_in_one_place_are_found(tmp_path: Path) -> None:
    more = '[[parts]]\nname = "b"\nshape = { box = [0.6, 0.6, 0.6] }\nat = { position = [0.8, 0, 0.3] }\n'
    (found,) = doubted(station_of(tmp_path, cell(more=more)))
    assert found.text.startswith("parts[1].inside.table = ")


VARIABLES = """
[[variables]]
name = "muted"
source = "plc"
address = "ns=2;s=muted"
type = "bool"
timeout = {timeout}
"""
PLC = '[[sources]]\nkind = "opcua"\nname = "plc"\nurl = "opc.tcp://127.0.0.1:1"\n'


@pytest.mark.parametrize(("timeout", "holds"), [(0.5, []), (10.0, [("variable muted",)])])
def test_a_time_out_of_a_variable_is_looked_at(
    tmp_path: Path, timeout: float, holds: list[tuple[str, ...]]
) -> None:
    (tmp_path / "variables.toml").write_text(VARIABLES.format(timeout=timeout))
    text = cell(limit='limit = 1.0\nactive = "muted"', more=PLC)
    station = station_of(tmp_path, 'variables = "variables.toml"\n' + text)
    assert [f.holds for f in doubted(station)] == holds


OWN = '''
from typing import Annotated, ClassVar
from msgspec import Meta
from seerob.criteria.criterion import Criterion
from seerob.core.snapshot import Basis, Result, Verdict

class Own(Criterion, frozen=True, kw_only=True):
    """Always within."""
    unit: ClassVar[str] = "m"
    robot: str
    reach: Annotated[float, Meta(extra={"unit": "m"})]
    def bind(self, model):
        return lambda state: Result(name=self.name, value=1.0, verdict=Verdict.WITHIN)
    def basis(self, model):
        return Basis(formula="1", source="none")
'''


def test_a_quantity_of_somebody_elses_criterion_is_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed, folder = tmp_path / "installed", tmp_path / "cell"
    (installed / "rules_of_mine").mkdir(parents=True)
    (installed / "rules_of_mine/own.py").write_text(OWN)
    monkeypatch.syspath_prepend(installed)
    folder.mkdir()
    more = '[[safety]]\nkind = "rules_of_mine.own"\nname = "own"\nrobot = "ur5"\nreach = 1300\n'
    station = station_of(folder, cell(more=more))
    assert [f.holds for f in doubted(station)] == [("own",)]
    assert verdicts(station)["own"] is Verdict.UNDECIDED


def test_a_criterion_that_is_added_in_python_is_looked_at(tmp_path: Path) -> None:
    station = station_of(tmp_path, cell())
    added = [
        Velocity(name=name, at="ur5", limit=limit) for name, limit in (("sensible", 0.25), ("in mm/s", 250.0))
    ]
    other = station.with_criteria(*added)
    assert [f.holds for f in doubted(other)] == [("in mm/s",)]
    assert verdicts(other)["in mm/s"] is Verdict.UNDECIDED
    assert results_at(other, ur5=STANDS)["sensible"].verdict is Verdict.WITHIN


SHIPPED = sorted(p.parent for p in ROOT.glob("workstations/*/workstation.toml"))


@pytest.mark.parametrize("folder", [*SHIPPED, ROOT / "src/seerob/app/commands/starter"], ids=lambda p: p.name)
def test_nothing_that_ships_is_implausible(folder: Path) -> None:
    station = load(folder)
    live = any(isinstance(source, LiveSource) for source in station.workstation.sources)
    held = [] if live else [f for _, o in station.sources for f in o.findings if f.holds]
    assert doubted(station) + held == []
    assert station.workstation.confirmed == ()


_position = st.tuples(st.floats(-4, 4), st.floats(-4, 4)).filter(lambda p: np.hypot(*p) > 1.6)


@settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    where=_position,
    yaw=st.floats(-360, 360),
    base=st.floats(0.0, 1.2),
    stature=st.floats(1.5, 1.95),
    bmi=st.floats(18, 35),
    load=st.floats(0.05, 4),
    reaction=st.floats(0.02, 0.5),
    stopping=st.floats(0.1, 1.5),
    walk=st.floats(1.0, 2.5),
)
def test_sensible_cells_are_plausible(
    tmp_path: Path, where: tuple[float, float], yaw: float, base: float, stature: float, bmi: float,
    load: float, reaction: float, stopping: float, walk: float,
) -> None:  # fmt: skip
    text = cell(
        base=f"position = [0, 0, {base + 0.0}]",
        at=f"at = {{ position = [{where[0]}, {where[1]}, 0], rpy_deg = [0, 0, {yaw}] }}",
        table="at = { position = [0, 7, 0.37] }",
        tool=f"shape = {{ box = [0.08, 0.1, 0.12] }}\nmass = {load}",
        person=f"stature = {stature}\nmass = {bmi * stature**2}",
        stop=f"reaction = {reaction}, stopping = {stopping}",
        separation=f"human_speed = {walk}",
    )
    assert doubted(station_of(tmp_path, text)) == []


def test_every_row_of_the_data_is_of_something() -> None:
    from fnmatch import fnmatchcase

    kinds: set[tuple[str, str]] = set()

    def walk(table: Any, key: str, depth: int = 0) -> None:
        for field in msgspec.structs.fields(table):
            name = f"{key}.{field.encode_name}"
            kinds.add((name, unit_of(field.type) or ""))
            kinds.add((f"{name}.x", unit_of(field.type) or ""))
            for member in members(field.type):
                for one in (member, *get_args(member)):
                    if is_struct(one) and depth < 4:
                        walk(one, name, depth + 1)
                        walk(one, f"{name}.x", depth + 1)

    for group in LISTS:
        walk(TABLES[group], group)
        for what in FOLLOWS.get(group, ()):
            kinds |= {(f"{group}.{what}x" if what.endswith(".") else f"{group}.{what}", unit)
                      for unit in ("m", "rad", "kg", "kg/m²", "kg/m³", "")}  # fmt: skip
    walk(Engine, "engine")
    kinds.add(("engine.gravity.turned", "rad"))
    kinds.add(("safety.separation.stop.table.joints.share", ""))
    kinds |= {("measurements.spring_N_mm", "N/mm"), ("measurements.contact_area", "m²")}
    for group in PLUGINS:
        kinds |= {(f"{group}.{what}", unit) for what in FOLLOWS.get(group, ()) for unit in ("s", "°", "")}
        for kind in plugin.kinds(group):
            walk(plugin.load(group, kind, BASES[group]), f"{group}.{kind}")
    for row in data().ranges:
        if row.key != "*":
            assert any(unit == row.unit and fnmatchcase(kind, row.key) for kind, unit in kinds), row.key
        assert row.low <= row.high
        assert all((row.because, row.right, row.source))
        assert row.confidence in ("stated", "field", "choice")
    units = {unit for _, unit in kinds}
    fallbacks = {row.unit for row in data().ranges if row.key == "*"}
    assert {"m", "rad", "s", "kg", "N", "m/s"} <= fallbacks <= units | {"N·m", "m³", "m²", "m/s²", "rad/s²"}


@pytest.mark.parametrize("sure", [True, False])
def test_a_link_that_its_table_makes_lighter_than_a_frame_of_rods(tmp_path: Path, sure: bool) -> None:
    """2 g in the box of 10 litres around a link, as 2 kg come out in tonnes: nothing is within by that."""
    word = '[[confirmed]]\nkey = "robots[0].masses.l1.bulk_density"\nof = "arm"\nvalue = 0.2\nwhy = "gas"\n'
    text = (
        f"{FLOATING}{TWO_R}[robots.masses]\nl1 = {{ mass = 0.002 }}\n"
        '[[safety]]\nkind = "kinetic_energy"\nname = "energy"\nrobot = "arm"\nlimit = 5\n'
    )
    station = made(tmp_path, text + word * sure, {"arm.urdf": two_r()})
    found = results_at(station, arm=((0, 0), (0.5, 0)))["energy"]
    assert found.verdict is (Verdict.WITHIN if sure else Verdict.UNDECIDED)
    assert ("robots[0].masses.l1.bulk_density" in found.reason) is not sure


@pytest.mark.parametrize(("height", "told"), [(0.8, False), (0.3, True)])
def test_two_parts_do_not_fill_one_place(height: float, told: bool, tmp_path: Path) -> None:
    """A crate of half a metre on a table, and one that sits half a metre deep in it."""
    text = f"""
[[parts]]
name = "table"
shape = {{ box = [0.8, 1.4, 0.74] }}
at = {{ position = [0, 0, 0.37] }}
[[parts]]
name = "crate"
shape = {{ box = [0.5, 0.5, 0.3] }}
at = {{ position = [0, 0, {height + 0.15 - 0.06}] }}
[[safety]]
kind = "minimum_distance"
name = "about them"
between = ["crate", "table"]
limit = 0.2
"""
    found = doubted(station_of(tmp_path, text))
    assert [f.holds for f in found] == ([("crate", "table")] if told else [])
    if told:
        value = found[0].text.split("value = ")[1].split(",")[0]
        own = (
            f'[[confirmed]]\nkey = "parts[1].inside.table"\nof = "crate"\nvalue = {value}\nwhy = "built in"\n'
        )
        assert not doubted(station_of(tmp_path, text + own))


@pytest.mark.parametrize("by", ['sensor = "curtain"', ""])
def test_what_is_implausible_of_a_sensor_is_of_criteria_that_name_it(tmp_path: Path, by: str) -> None:
    curtain = "light_curtain = { ends = [[-0.5, 0, 0], [0.5, 0, 0]], height = 1, pitch = 0.1 }"
    text = cell(more=f'[[sensors]]\nname = "curtain"\nresponse = 100\nsource = "data sheet"\n{curtain}\n')
    asked = f"human_speed = 1.6\n{by}"
    (tmp_path / "workstation.toml").write_text(text.replace("human_speed = 1.6", asked))
    station = read(tmp_path)
    (found,) = findings(listed(entries_of(station), station.engine), ())
    assert found.text.startswith("sensors[0].response = 100")
    assert set(found.holds) == {"curtain", *(["separation"] if by else [])}


@pytest.mark.parametrize(("on", "said"), [('on = "arm/tool0"\n', True), ("", False)])
def test_what_lies_in_the_cell_may_be_farther_away_than_what_a_tool_holds(tmp_path, on, said):
    piece = '[[workpieces]]\nname = "casting"\nshape = { box = [0.1, 0.1, 0.1] }\nmass = 1\n'
    arm = '[[robots]]\nname = "arm"\nmodel = "library:ur10"\n'
    (tmp_path / "workstation.toml").write_text(f"{arm}{piece}{on}at = {{ position = [-1.4, 2.4, 0.7] }}\n")
    station = read(tmp_path)
    found = list(findings(listed(entries_of(station), station.engine), ()))
    assert [f.subject for f in found] == ["casting"] * said
