"""Tools, workpieces and parts of files, judged: never farther away than they are, nor than as a robot."""

import re

import numpy as np
import pytest
import trimesh

from made_cell import made, results_at
from seerob.core.snapshot import Origin
from seerob.core.transforms import rotation_from_rpy
from seerob.core.verdict import Verdict

ARM = """<robot name="arm"><link name="base"/><link name="flange"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="flange"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
TIP = """<link name="tip"/><joint name="s" type="revolute"><parent link="{}"/><child link="tip"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
AT = "position = [0.05, -0.02, 0.06], rpy = [0.3, -0.4, 0.5]"
TURN, PLACE = rotation_from_rpy([0.3, -0.4, 0.5]), np.array([0.05, -0.02, 0.06])
RADIUS = 0.05
"""Of the ball that distances are taken to [m]."""
USES = {
    "tool": '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n'
    '[[tools]]\nname = "thing"\non = "arm/flange"\nmesh = "{file}"\nat = {{ {at} }}\nmass = 1.5\n',
    "workpiece": '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n'
    '[[workpieces]]\nname = "thing"\non = "arm/flange"\nmesh = "{file}"\nat = {{ {at} }}\nmass = 1.5\n',
    "part": '[[parts]]\nname = "thing"\nmesh = "{file}"\nat = {{ {at} }}\n',
    "robot": '[[robots]]\nname = "thing"\nmodel = "{file}"\nbase = {{ {at} }}\n',
}
END = """[[parts]]
name = "ball"
shape = {{ sphere = 0.05 }}
at = {{ position = {ball} }}
[[safety]]
kind = "minimum_distance"
name = "clear"
between = ["thing", "ball"]
limit = {limit}
"""


def judged(folder, use, file, ball, *, limit=0.1, joints=0, more=""):
    """What is said of the distance between the thing of a file and a ball, in the thing's frame [m]."""
    at = (PLACE + TURN @ np.array(ball)).tolist()
    text = (USES[use] + more + END).format(file=file, at=AT, ball=at, limit=limit)
    station = made(folder, text, {"arm.urdf": ARM})
    heard = {"arm": ([0.0], [0.0])} if use in ("tool", "workpiece") else {}
    if use == "robot" and joints:
        heard = {"thing": ([0.0] * joints, [0.0] * joints)}
    return results_at(station, **heard)["clear"]


def ends(result):
    """Between which the distance lies [m]."""
    return result.interval or (result.value, result.value)


# -- one shape in every format ----------------------------------------------------------------------

SIZES = {"box": (0.2, 0.3, 0.1), "sphere": (0.2,), "cylinder": (0.15, 0.3), "capsule": (0.1, 0.25)}
"""Edges; radius; radius and length [m]."""


def outside(kind, sizes, point):
    """How far a point is from a simple shape about the origin [m]."""
    if kind == "box":
        return float(np.linalg.norm(np.maximum(np.abs(point) - np.array(sizes) / 2, 0)))
    x, z = float(np.hypot(*point[:2])), abs(float(point[2]))
    if kind == "cylinder":
        return float(np.hypot(max(x - sizes[0], 0), max(z - sizes[1] / 2, 0)))
    return float(np.hypot(x, max(z - (sizes[1] / 2 if kind == "capsule" else 0), 0))) - sizes[0]


def _urdf_shape(kind, sizes):
    if kind == "box":
        said = f'size="{sizes[0]} {sizes[1]} {sizes[2]}"'
    else:
        said = f'radius="{sizes[0]}"' + (f' length="{sizes[1]}"' if sizes[1:] else "")
    return f"<geometry><{kind} {said}/></geometry>"


def _urdf(kind, sizes, joint=False, visual="", said=""):
    link = f'<link name="base">{visual}<collision {said}>{_urdf_shape(kind, sizes)}</collision></link>'
    return f'<robot name="thing">{link}{TIP.format("base") if joint else ""}</robot>'


def _mjcf(kind, sizes):
    half = [x / 2 for x in sizes] if kind == "box" else [sizes[0], *(x / 2 for x in sizes[1:])]
    size = " ".join(map(repr, half))
    return (
        f'<mujoco model="thing"><worldbody><body name="b"><geom type="{kind}" size="{size}"/></body>'
        "</worldbody></mujoco>"
    )


def _sdf(kind, sizes):
    named = (
        f"<size>{sizes[0]} {sizes[1]} {sizes[2]}</size>"
        if kind == "box"
        else f"<radius>{sizes[0]}</radius>" + (f"<length>{sizes[1]}</length>" if sizes[1:] else "")
    )
    shape = f"<geometry><{kind}>{named}</{kind}></geometry>"
    return (
        f'<sdf version="1.9"><model name="thing"><link name="l"><collision name="c">{shape}</collision>'
        "</link></model></sdf>"
    )


def _usd(kind, sizes):
    if kind == "box":
        inside = f"double size = 1\n double3 xformOp:scale = ({sizes[0]}, {sizes[1]}, {sizes[2]})\n"
        inside += ' uniform token[] xformOpOrder = ["xformOp:scale"]'
    else:
        inside = f"double radius = {sizes[0]}\n" + (
            f' double height = {sizes[1]}\n uniform token axis = "Z"' if sizes[1:] else ""
        )
    prim = {"box": "Cube"}.get(kind, kind.capitalize())
    return f'#usda 1.0\n( metersPerUnit = 1.0\n upAxis = "Z" )\ndef {prim} "thing"\n{{\n {inside}\n}}\n'


def _step(file, kind, sizes):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    mm = [1e3 * x for x in sizes]
    if kind == "box":
        made_ = BRepPrimAPI_MakeBox(gp_Pnt(*(-x / 2 for x in mm)), *mm)
    elif kind == "sphere":
        made_ = BRepPrimAPI_MakeSphere(*mm)
    else:
        made_ = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0, 0, -mm[1] / 2), gp_Dir(0, 0, 1)), *mm)
    writer = STEPControl_Writer()
    writer.Transfer(made_.Shape(), STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(file))


TEXTS = {"g.urdf": _urdf, "g.xml": _mjcf, "g.sdf": _sdf, "g.usda": _usd}


def written(folder, name, kind):
    if name == "g.stp":
        pytest.importorskip("OCP")
        _step(folder / name, kind, SIZES[kind])
    else:
        if name == "g.usda":
            pytest.importorskip("pxr")
        (folder / name).write_text(TEXTS[name](kind, SIZES[kind]))
    return name


CASES = [(name, kind) for name in TEXTS for kind in SIZES]
CASES += [("g.stp", kind) for kind in SIZES if kind != "capsule"]  # OpenCASCADE has none


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_no_shape_is_farther_away_than_it_is(tmp_path, name, kind):
    file = written(tmp_path, name, kind)
    rng = np.random.default_rng(len(name) + len(kind))
    for use in ("tool", "part") if kind == "sphere" else ("tool",):
        point = rng.normal(size=3)
        point *= 0.45 / np.linalg.norm(point)
        truth = outside(kind, SIZES[kind], point) - RADIUS
        low, high = ends(judged(tmp_path, use, file, point, limit=truth * 0.5))
        # Meshes go around the shape, by 2 % of its radius at most; STEP says how far it may be off.
        assert low <= truth + 1e-7
        assert truth - 0.005 <= high
        assert low > truth - 0.005


@pytest.mark.parametrize("use", ["tool", "workpiece", "part"])
def test_a_ball_that_is_too_near_is_not_within(tmp_path, use):
    file = written(tmp_path, "g.urdf", "sphere")
    # Along this direction a mesh with its corners on the ball would be 4 mm too far.
    worst = np.array([np.cos(np.pi / 20) * np.cos(np.pi / 20), np.sin(np.pi / 20), np.sin(np.pi / 20)])
    worst *= 0.45 / np.linalg.norm(worst)
    assert judged(tmp_path, use, file, worst, limit=0.201).verdict is Verdict.EXCEEDED
    assert judged(tmp_path, use, file, worst, limit=0.19).verdict is Verdict.WITHIN


# -- what is shown and what is measured --------------------------------------------------------------


def _ball(folder, radius):
    trimesh.creation.icosphere(subdivisions=2, radius=radius).export(folder / "ball.stl")
    return '<visual><geometry><mesh filename="ball.stl"/></geometry></visual>'


@pytest.mark.parametrize("joint", [False, True])
@pytest.mark.parametrize("use", ["tool", "workpiece", "part"])
def test_what_is_shown_outside_of_what_is_measured_counts_with_a_joint_or_without(tmp_path, use, joint):
    """A box of 0.1 m in a ball of 0.15 m: a ball at 0.4 m is 0.2 m away, not 0.3 m."""
    (tmp_path / "g.urdf").write_text(_urdf("box", (0.1, 0.1, 0.1), joint, _ball(tmp_path, 0.15)))
    found = judged(tmp_path, use, "g.urdf", (0.4, 0, 0), limit=0.25)
    assert found.verdict is Verdict.UNDECIDED
    assert ends(found)[0] <= 0.2


@pytest.mark.parametrize("joint", [False, True])
def test_a_stated_deviation_counts_with_a_joint_or_without(tmp_path, joint):
    for kind in ("box", "sphere"):
        text = _urdf(kind, SIZES[kind], joint, said='deviation="0.02"')
        (tmp_path / "g.urdf").write_text(text)
        truth = outside(kind, SIZES[kind], np.array([0, 0, 0.4])) - RADIUS
        found = judged(tmp_path, "tool", "g.urdf", (0, 0, 0.4), limit=truth - 0.01)
        assert found.verdict is Verdict.UNDECIDED
        assert ends(found)[0] <= truth - 0.02


@pytest.mark.parametrize("joint", [False, True])
@pytest.mark.parametrize("form", ["urdf", "sdf"])
def test_a_finer_shape_that_is_shown_does_not_stand_for_a_larger_one_that_is_measured(tmp_path, form, joint):
    visual = _ball(tmp_path, 0.1)
    if form == "urdf":
        text = _urdf("box", (0.3, 0.3, 0.3), joint, visual)
    else:
        box = "<geometry><box><size>0.3 0.3 0.3</size></box></geometry>"
        ball = "<geometry><mesh><uri>ball.stl</uri></mesh></geometry>"
        tip = (
            '<link name="tip"/><joint name="j" type="revolute"><parent>l</parent><child>tip</child>'
            "<axis><xyz>0 0 1</xyz></axis></joint>"
        )
        text = (
            f'<sdf version="1.9"><model name="g"><link name="l"><visual name="v">{ball}</visual>'
            f'<collision name="c">{box}</collision></link>{tip if joint else ""}</model></sdf>'
        )
    (tmp_path / f"g.{form}").write_text(text)
    found = judged(tmp_path, "tool", f"g.{form}", (0.4, 0, 0), limit=0.21)
    assert found.verdict is Verdict.EXCEEDED
    assert ends(found)[0] == pytest.approx(0.2, abs=1e-6)


def test_a_shape_of_sdf_that_is_shown_outside_of_what_is_measured_counts(tmp_path):
    _ball(tmp_path, 0.15)
    shapes = (
        '<visual name="v"><geometry><mesh><uri>ball.stl</uri></mesh></geometry></visual><collision name="c">'
        "<geometry><box><size>0.1 0.1 0.1</size></box></geometry></collision>"
    )
    tip = (
        '<link name="tip"/><joint name="j" type="revolute"><parent>l</parent><child>tip</child>'
        "<axis><xyz>0 0 1</xyz></axis></joint>"
    )
    for more in ("", tip):
        (tmp_path / "g.sdf").write_text(
            f'<sdf version="1.9"><model name="g"><link name="l">{shapes}</link>{more}</model></sdf>'
        )
        found = judged(tmp_path, "tool", "g.sdf", (0.4, 0, 0), limit=0.25)
        assert found.verdict is not Verdict.WITHIN
        assert ends(found)[0] <= 0.2


# -- as a robot and as a tool -------------------------------------------------------------------------


def test_as_a_tool_nothing_is_farther_away_than_as_a_robot(tmp_path):
    """Random shapes, seen and measured, some with a joint, as robot, tool and part at one place."""
    rng = np.random.default_rng(7)
    for trial in range(8):
        kind = list(SIZES)[trial % 4]
        sizes = tuple((np.array(SIZES[kind]) * rng.uniform(0.5, 1.0)).round(4).tolist())
        visual = _ball(tmp_path, rng.uniform(0.05, 0.25)) if trial >= 4 else ""
        said = 'deviation="0.01"' if trial % 3 == 0 else ""
        (tmp_path / "g.urdf").write_text(_urdf(kind, sizes, True, visual, said))
        point = rng.normal(size=3)
        point *= rng.uniform(0.5, 0.8) / np.linalg.norm(point)
        truth = outside(kind, sizes, point) - RADIUS
        robot = ends(judged(tmp_path, "robot", "g.urdf", point, joints=1))
        for use in ("tool", "part"):
            low, high = ends(judged(tmp_path, use, "g.urdf", point))
            assert low <= min(truth, robot[0]) + 1e-7, (trial, use)
            assert high >= robot[0] - 0.02 * max(sizes)


# -- several pieces, and what they weigh --------------------------------------------------------------


def _two(folder):
    scene = trimesh.Scene()
    for k, name in enumerate(("left", "right")):
        box = trimesh.creation.box((0.1, 0.1, 0.1))
        box.apply_translation((0, 0, -0.2 * k))  # y of what has z up
        scene.add_geometry(box, node_name=name, geom_name=name)
    scene.export(folder / "two.glb")
    return "two.glb"


def _two_links(folder):
    link = '<link name="{}"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>'
    joint = (
        '<joint name="f" type="prismatic"><origin xyz="0 0.2 0"/><parent link="left"/><child link="right"/>'
        '<axis xyz="0 1 0"/><limit lower="0" upper="0.01" effort="1" velocity="1"/></joint>'
    )
    (folder / "two.urdf").write_text(
        f'<robot name="two">{link.format("left")}{link.format("right")}{joint}</robot>'
    )
    return "two.urdf"


@pytest.mark.parametrize("write", [_two, _two_links])
@pytest.mark.parametrize("use", ["tool", "workpiece"])
def test_a_thing_of_several_pieces_weighs_what_is_given(tmp_path, write, use):
    file = write(tmp_path)
    found = judged(tmp_path, use, file, (0, 0.5, 0), limit=0.1)
    assert found.verdict is Verdict.WITHIN, found.reason
    assert found.value == pytest.approx(0.5 - 0.25 - RADIUS, abs=1e-6)
    # A tool whose mass nobody gave stays unweighed.
    text = (USES[use] + END).format(file=file, at=AT, ball=[1, 1, 1], limit=0.1)
    for known in (True, False):
        given = text if known else re.sub("mass = 1.5\n", "", text)
        rows = made(tmp_path, given, {"arm.urdf": ARM}).model.mechanisms["arm"].masses
        (row,) = (row for row in rows if row.name == "thing")
        assert (row.mass, row.origin) == ((1.5, Origin.GIVEN) if known else (None, Origin.MISSING))


def test_two_solids_of_a_link_are_both_there(tmp_path):
    shape = '<collision><origin xyz="0 {} 0"/><geometry><sphere radius="0.05"/></geometry></collision>'
    link = f'<link name="base">{shape.format(0)}{shape.format(0.2)}</link>'
    (tmp_path / "g.urdf").write_text(f'<robot name="g">{link}{TIP.format("base")}</robot>')
    for end in (-0.3, 0.5):
        found = judged(tmp_path, "tool", "g.urdf", (0, end, 0))
        assert found.verdict is Verdict.WITHIN
        assert 0.198 <= ends(found)[0] <= 0.2 + 1e-7
