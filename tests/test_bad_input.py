"""What cannot be evaluated is refused before the run starts, with file, key and what would be right."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest
import trimesh

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.core.errors import InputError
from seerob.session.station import load

LIMITS = files("seerob.description.norms").joinpath("iso_ts_15066_2016.toml").read_text(encoding="utf-8")
BOX = trimesh.creation.box((0.2, 0.1, 0.1))
OPEN = trimesh.Trimesh(BOX.vertices, BOX.faces[:-4], process=False).export(file_type="stl")
HOLED = trimesh.Trimesh(
    np.where(np.arange(8)[:, None] == 0, np.nan, BOX.vertices), BOX.faces, process=False
).export(file_type="stl")

OPERATOR = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
TOOL = '[[tools]]\nname = "grip"\non = "arm/tip"\n'
BALL = "shape = { sphere = 0.1 }\n"
MESH = 'mesh = "it.stl"\nunits = "m"\n'
FLAT = 'mesh = "it.obj"\nunits = "m"\n'
PART = '[[parts]]\nname = "table"\n'
ZONE = '[[areas]]\nname = "zone"\n'
FILE = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion.csv"\n'
OWN_TABLE = (
    'robot = "arm", category = 1, source = "measured", confidence = "1S", joints = ['
    "{ joint = 0, speed = [1], way = [[[0.1]]], time = [[[0.1]]] }]"
)
MJCF = (
    '<mujoco><worldbody><body><joint axis="0 0 1"/><geom type="box" size="1 1 1" mass="0"/></body>'
    "</worldbody></mujoco>"
)


HEAD = "t [s],j1 [rad],j2 [rad]\n"


def criterion(kind: str, options: str) -> str:
    return f'[[safety]]\nkind = "{kind}"\n{options}\n'


def contact(options: str) -> str:
    return criterion("power_and_force", f'robot = "arm"\n{options}')


def separation(stop: str, more: str = "") -> str:
    return OPERATOR + criterion("separation", f'between = ["arm", "op"]\nstop = {{ {stop} }}\n{more}')


def by_table(old, new):
    """A stop by a table of one's own in which something is replaced."""
    table = OWN_TABLE.replace(old, new)
    return separation(f'reaction = 1, model = "table", table = {{ {table} }}')


def joints(limit: str) -> dict[str, str]:
    return {"arm.urdf": two_r().replace("continuous", "revolute").replace("<limit", f"<limit {limit}")}


# What: workstation, files beside it, what the message names of file and key, and what would be right.
WRONG = {
    # Not a number.
    "nan limit": (
        criterion("velocity", 'at = "arm"\nlimit = nan'),
        {},
        "workstation.toml: safety[0].limit",
        "finite",
    ),
    "nan reaction time": (
        separation("reaction = nan, stopping = 1"),
        {},
        "workstation.toml: safety[0].stop.reaction",
        "finite",
    ),
    "nan uncertainty": (
        separation("reaction = 1, stopping = 1", "robot_uncertainty = nan"),
        {},
        "workstation.toml: safety[0].robot_uncertainty",
        "finite",
    ),
    "nan torque": (
        criterion("tool_force", 'at = "arm"\ntorque_uncertainty = [nan, 1]'),
        {},
        "workstation.toml: safety[0].torque_uncertainty[0]",
        "finite",
    ),
    "nan mass": (
        TOOL + "shape = { sphere = 0.1 }\nmass = nan",
        {},
        "workstation.toml: tools[0].mass",
        "finite",
    ),
    "nan mass of a link": (
        "",
        {"arm.urdf": two_r(masses=(float("nan"), 1))},
        "arm.urdf: robots[0] (link[l1].inertial.mass.value)",
        "finite",
    ),
    "nan inertia of a link": (
        "",
        {"arm.urdf": two_r().replace('ixx="0.002"', 'ixx="nan"', 1)},
        "arm.urdf: robots[0] (link[l1].inertial.inertia.ixx)",
        "finite",
    ),
    "nan axis": (
        "",
        {"arm.urdf": two_r().replace('axis xyz="0 0 1"', 'axis xyz="nan 0 1"', 1)},
        "arm.urdf: robots[0] (joint[j1].axis.xyz)",
        "3 numbers",
    ),
    "nan vertex": (PART + MESH, {"it.stl": HOLED}, "it.stl: parts[0]", "export it again"),
    "nan body limit": (
        contact('limits = "own.toml"'),
        {"own.toml": LIMITS.replace("140", "nan", 1)},
        "own.toml: regions[2] (Neck)",
        "a number above 0",
    ),
    "nan in a motion": (
        FILE,
        {"motion.csv": f"{HEAD}0,0,0\n0.1,nan,0\n0.2,0,0\n"},
        "motion.csv: row 3 column 'j1 [rad]'",
        "a number",
    ),
    # No mass.
    "zero mass": (TOOL + BALL + "mass = 0", {}, "workstation.toml: tools[0].mass", "> 0 [kg]"),
    "zero density": (
        TOOL + "shape = { sphere = 0.1 }\ndensity = 0",
        {},
        "workstation.toml: tools[0].density",
        "> 0 [kg/m³]",
    ),
    "zero mass of a link by hand": (
        "[robots.masses]\nl1 = { mass = 0 }",
        {},
        "workstation.toml: robots[0].masses.l1.mass",
        "> 0 [kg]",
    ),
    "zero mass of a link that a figure needs": (
        criterion("kinetic_energy", 'robot = "arm"'),
        {"arm.urdf": two_r(masses=(0, 1))},
        "arm.urdf: link[l1].inertial.mass.value: is 0 kg",
        "give it in masses of arm",
    ),
    "zero mass of a link that contact needs": (
        contact(""),
        {"arm.urdf": two_r(masses=(1, 0))},
        "arm.urdf: link[l2].inertial.mass.value: is 0 kg",
        "give it in masses of arm",
    ),
    "zero mass of a link that a simulated stop needs": (
        separation('reaction = 0.1, model = "simulated", brakes = [9, 9]'),
        {"arm.urdf": two_r(masses=(1, 0))},
        "arm.urdf: link[l2].inertial.mass.value: is 0 kg",
        "give it in masses of arm",
    ),
    "zero mass of a body of MuJoCo": (
        "",
        {"arm.urdf": MJCF},
        "arm.urdf: robots[0]",
        "give every moving body a mass greater than 0",
    ),
    "negative mass of a link": (
        "",
        {"arm.urdf": two_r(masses=(-1, 1))},
        "arm.urdf: robots[0] (link[l1].inertial.mass.value)",
        "greater than 0",
    ),
    "zero mass of a person": (
        OPERATOR.replace("= 75", "= 0"),
        {},
        "workstation.toml: humans[0].mass",
        ">= 10 [kg]",
    ),
    # Meshes.
    "empty file": (PART + MESH, {"it.stl": b""}, "it.stl: parts[0]", "export it again"),
    "no triangle": (PART + MESH, {"it.stl": bytes(84)}, "it.stl: parts[0]", "export surfaces"),
    "no area": (
        PART + FLAT,
        {"it.obj": "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n"},
        "it.obj: parts[0]",
        "export it again",
    ),
    "flat mesh with a density": (
        TOOL + FLAT + "density = 1000",
        {"it.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"},
        "it.obj: tools[0] (mass)",
        "by hand",
    ),
    "open mesh with a density": (
        TOOL + MESH + "density = 1000",
        {"it.stl": OPEN},
        "it.stl: tools[0] (density)",
        "give the mass, or close the mesh",
    ),
    "open mesh that sweeps a volume": (
        TOOL + MESH + "mass = 1\n" + criterion("swept_volume", 'of = "arm"'),
        {"it.stl": OPEN},
        "workstation.toml: tools[0].mesh: the mesh of grip is open",
        "close it, or give a shape",
    ),
    "open mesh of an area": (ZONE + MESH, {"it.stl": OPEN}, "it.stl: areas[0]", "close it"),
    # Limits.
    "negative limit": (
        criterion("kinetic_energy", 'robot = "arm"\nlimit = -1'),
        {},
        "workstation.toml: safety[0].limit",
        "> 0 [J]",
    ),
    "negative distance": (
        criterion("minimum_distance", 'between = ["arm", "op"]\nlimit = -0.1') + OPERATOR,
        {},
        "workstation.toml: safety[0].limit",
        ">= 0 [m]",
    ),
    "negative body limit": (
        contact('limits = "own.toml"'),
        {"own.toml": LIMITS.replace("140", "-140", 1)},
        "own.toml: regions[2] (Neck)",
        "a number above 0",
    ),
    "zero body limit": (
        contact('limits = "own.toml"'),
        {"own.toml": LIMITS.replace("140", "0", 1)},
        "own.toml: regions[2] (Neck)",
        "a number above 0",
    ),
    "negative acceleration": (
        "acceleration_limits = [-1, 1]",
        {},
        "workstation.toml: robots[0] (acceleration_limits)",
        "above 0",
    ),
    "no jerk": ("jerk_limits = [0]", {}, "workstation.toml: robots[0] (jerk_limits)", "above 0"),
    "negative stopping distance": (
        by_table("[[[0.1]]]", "[[[-1]]]"),
        {},
        "workstation.toml: safety[0].stop.table.joints[0].way[0][0][0]",
        ">= 0",
    ),
    # Body regions.
    "unknown region of a table": (
        contact('limits = "own.toml"'),
        {"own.toml": LIMITS.replace('"Chest"', '"Chets"', 1)},
        "own.toml: regions[4] (Chets)",
        "'Chest'",
    ),
    "unknown region kept out": (contact('excluded = ["Chets"]'), {}, "workstation.toml: safety", "'Chest'"),
    "unknown region with a gap": (
        contact("thickness = { Chets = 0.1 }"),
        {},
        "workstation.toml: safety[0]",
        "'Chest'",
    ),
    # Intervals.
    "inverted joint limits": (
        "",
        joints('lower="2" upper="1"'),
        "arm.urdf: robots[0] (joint[j1].limit)",
        "swap them",
    ),
    "inverted torque limits": (
        criterion("force_polytope", 'at = "arm"\ntorque_limits = [[5, -5], [-5, 5]]'),
        {},
        "torque_limits",
        "[least, largest]",
    ),
    "inverted time": (
        ZONE + 'swept = { of = "arm", start = 2, end = 1 }',
        {},
        "workstation.toml: areas[0].swept",
        "begin before the end",
    ),
    "inverted height": (
        ZONE + "shape = { polygon = [[0, 0], [1, 0], [0, 1]], height = [2, 1] }",
        {},
        "workstation.toml: areas[0].shape",
        "lower end comes first",
    ),
    "inverted phase that no rule reads": (
        OPERATOR + '[[phases]]\nhuman = "op"\nstart = 3\nend = 2',
        {},
        "workstation.toml: phases[0]",
        "let it end later",
    ),
    "phase beyond its cycle": (
        OPERATOR + "[[phases]]\nstart = 3\nend = 9\ncycle = 5",
        {},
        "workstation.toml: phases[0]",
        "beyond its cycle of 5 s",
    ),
    "stopping table whose speeds descend": (
        by_table("speed = [1]", "speed = [1, 0.5]"),
        {},
        "workstation.toml: safety[0].stop.table",
        "does not ascend",
    ),
    "time that goes back": (
        FILE,
        {"motion.csv": f"{HEAD}0.2,0,0\n0.1,0,0\n"},
        "motion.csv: row 3",
        "remove the rows",
    ),
    # More than there is.
    "voxels that fill the memory": (
        criterion("swept_volume", 'of = "arm"\nvoxel = 1e-6'),
        {},
        "workstation.toml: safety[0]",
        "use voxels of",
    ),
    "voxels of an area that fill the memory": (
        ZONE + 'swept = { of = "arm", voxel = 1e-6, reach = true }\n' + criterion(
            "safety_area", 'of = "arm"\narea = "zone"'
        ),
        {},
        "workstation.toml: areas[0].swept.voxel",
        "use voxels of",
    ),
    "voxels of no size": (
        criterion("swept_volume", 'of = "arm"\nvoxel = 0'),
        {},
        "workstation.toml: safety[0].voxel",
        "> 0 [m]",
    ),
}  # fmt: skip


def readied(folder, text, more):
    """All that happens before the run."""
    station = made(folder, FLOATING + TWO_R + text, {"arm.urdf": two_r(), **more})
    return station.bound, station.sources


@pytest.mark.parametrize("what", WRONG)
def test_what_cannot_be_evaluated_is_refused_before_the_run(tmp_path, what):
    text, more, place, remedy = WRONG[what]
    with pytest.raises(InputError) as error:
        readied(tmp_path, text, more)
    told = [str(problem) for problem in error.value.problems]
    assert any(place in text and remedy in text for text in told), told


@pytest.mark.parametrize(
    ("text", "more", "level", "words"),
    [
        ("", {"arm.urdf": two_r(masses=(0, 1))}, "warning", "mass is 0 kg, expected more than 0"),
        (PART + MESH, {"it.stl": OPEN}, "warning", "nobody says whether its openings are closed"),
        (PART + MESH + 'openings = "open"\n', {"it.stl": OPEN}, "note", "as if nothing closed its holes"),
        (PART + MESH + 'openings = "closed"\n', {"it.stl": OPEN}, "note", "each opening counts as closed"),
        (PART + MESH + "hole_depth = 0.1\n", {"it.stl": OPEN}, "note", "of its rim, and 0.1 m beyond"),
    ],
)
def test_what_only_some_figures_need_is_told_before_the_run(tmp_path, text, more, level, words):
    """Drawings are open and frames weigh nothing; what needs them closed or heavy is undecided."""
    station = made(tmp_path, FLOATING + TWO_R + text, {"arm.urdf": two_r(), **more})
    assert any(f.level == level and words in f.text for f in station.model.findings)


def test_wrong_names_of_person_and_bones_come_at_once(tmp_path):
    (tmp_path / "workstation.toml").write_text(
        'title = "x"\n[[humans]]\nname = "operator"\nstature = 1.7\nmass = 70\nsex = "male"\n'
        '[[sources]]\nkind = "bvh"\nhuman = "operater"\nfile = "x.bvh"\n'
        "weights = { bones = { haed = 0.5 } }\n"
        '[[ergonomics]]\nkind = "rula"\nhuman = "operator"\nunmeasured = ["hand"]\n'
    )
    with pytest.raises(InputError) as caught:
        load(tmp_path)
    assert [p.key for p in caught.value.problems] == [
        "sources[0].human", "sources[0].weights.bones.haed", "ergonomics[0].unmeasured[0]",
    ]  # fmt: skip
