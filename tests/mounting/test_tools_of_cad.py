"""Tools from every format that is imported: where the file has them, and as uncertain as their triangles."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import trimesh

from seerob.core.errors import InputError
from seerob.model.mounting.things import TOOL_COLOR, load_thing
from seerob.workstation.workstation import Tool

ROOT = Path(__file__).parents[2]
BOX = [[0.01, -0.02, 0.0], [0.05, 0.02, 0.12]]
"""Corners of a gripper [m]."""
URDF = """<robot name="g"><link name="base"><collision><origin xyz="0.03 0 0.03"/><geometry>
<box size="0.04 0.04 0.06"/></geometry></collision></link><link name="finger"><collision>
<origin xyz="0.03 0 0.03"/><geometry><box size="0.04 0.01 0.06"/></geometry></collision></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="finger"/><origin xyz="0 0 0.06"/>
<axis xyz="0 1 0"/><limit lower="0" upper="0.01" effort="1" velocity="1"/></joint></robot>"""
MJCF = """<mujoco model="g"><worldbody><body name="base"><geom type="box" pos="0.03 0 0.06"
size="0.02 0.02 0.06"/></body></worldbody></mujoco>"""
SDF = """<sdf version="1.9"><model name="g"><link name="l"><collision name="c"><pose>0.03 0 0.06 0 0 0</pose>
<geometry><box><size>0.04 0.04 0.12</size></box></geometry></collision></link></model></sdf>"""
USD = """#usda 1.0
( metersPerUnit = 1.0
  upAxis = "Z" )
def Cube "g"
{
 double size = 1
 double3 xformOp:scale = (0.04, 0.04, 0.12)
 double3 xformOp:translate = (0.03, 0, 0.06)
 uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
"""


def _threedxml(folder):
    box = trimesh.creation.box(bounds=1e3 * np.array(BOX))
    points = ",".join(" ".join(f"{x:g}" for x in row) for row in box.vertices)
    kind = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:type'
    corners = " ".join(map(str, box.faces.ravel()))
    (folder / "g.3DRep").write_text(
        f'<X><Rep {kind}="PolygonalRepType"><Faces><Face triangles="{corners}"/>'
        f"</Faces><VertexBuffer><Positions>{points}</Positions></VertexBuffer></Rep></X>"
    )
    return (
        '<Model_3dxml><ProductStructure root="1"><Reference3D id="1" name="g"/>'
        '<ReferenceRep id="5" associatedFile="urn:3DXML:g.3DRep"/><InstanceRep id="6"><IsAggregatedBy>1'
        "</IsAggregatedBy><IsInstanceOf>5</IsInstanceOf></InstanceRep></ProductStructure></Model_3dxml>"
    )


def _step(_):
    pytest.importorskip("OCP")
    step = runpy.run_path(str(ROOT / "scripts/make-imported-line"))["Step"]()
    (x, y, _), (far, other, high) = (1e3 * np.array(corner) for corner in BOX)
    step.prism("g", [(x, y), (far, y), (far, other), (x, other)], high)
    return step.text()


MADE = {
    "g.step": _step,
    "g.3dxml": _threedxml,
    "g.urdf": lambda _: URDF,
    "g.xml": lambda _: MJCF,
    "g.sdf": lambda _: SDF,
    "g.usda": lambda _: USD,
}


def loaded(folder, name, **keys):
    tool = Tool(name="gripper", on="r/tool0", mesh=name, **keys)
    return load_thing(tool, folder, TOOL_COLOR, needs_mass=True)


@pytest.mark.parametrize("name", MADE)
def test_a_tool_is_where_its_file_has_it(tmp_path, name):
    if name.endswith("usda"):
        pytest.importorskip("pxr")
    (tmp_path / name).write_text(MADE[name](tmp_path))
    found = loaded(tmp_path, name)
    corners = np.vstack([s.mesh.vertices for piece in found.pieces for s in piece.solids])
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], BOX, atol=1e-8)
    # Nobody said what it weighs.
    assert found.inertial is None
    assert loaded(tmp_path, name, mass=1.5).inertial.mass == 1.5
    assert ("do not move" in " ".join(f.text for f in found.findings)) == (name == "g.urdf")


def test_a_round_tool_is_as_uncertain_as_its_triangles(tmp_path):
    pytest.importorskip("OCP")
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    writer = STEPControl_Writer()
    writer.Transfer(BRepPrimAPI_MakeCylinder(30.0, 100.0).Shape(), STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(tmp_path / "g.stp"))
    for cache in (None, tmp_path / "cache", tmp_path / "cache"):
        tool = Tool(name="g", on="r/tool0", mesh="g.stp")
        (piece,) = load_thing(tool, tmp_path, TOOL_COLOR, needs_mass=True, cache=cache).pieces
        assert all(1e-4 <= solid.deviation < 1.1e-4 for solid in piece.solids)


def test_what_cannot_be_brought_whole_is_refused(tmp_path):
    (tmp_path / "g.3dxml").write_text(
        _threedxml(tmp_path).replace(
            "</Pro",
            '<Reference3D id="7" name="pin"/>'
            '<Instance3D id="8" name="pin"><IsAggregatedBy>1</IsAggregatedBy><IsInstanceOf>9</IsInstanceOf>'
            "</Instance3D></Pro",
        )
    )
    with pytest.raises(InputError, match="cannot be brought whole: g/pin"):
        loaded(tmp_path, "g.3dxml")
    (tmp_path / "g.sldprt").write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"SwDocContentMgr" * 99)
    with pytest.raises(InputError, match="STEP"):
        loaded(tmp_path, "g.sldprt")


MOTOR = """<robot name="g"><link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry>
</collision></link><link name="motor"><inertial><origin xyz="0 0 0"/><mass value="{mass}"/>
<inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="s" type="{kind}"><origin xyz="0 0 0.4"/><parent link="base"/><child link="motor"/>
<axis xyz="0 1 0"/><limit lower="0" upper="0.01" effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize("kind", ["fixed", "prismatic"])
def test_what_has_a_mass_and_no_shape_is_missing(tmp_path, kind):
    (tmp_path / "g.urdf").write_text(MOTOR.format(mass=0.9, kind=kind))
    with pytest.raises(InputError, match=r"brought whole: motor: has a mass of 0\.9 kg but no shape"):
        loaded(tmp_path, "g.urdf")
    # Up to a gram it is a frame.
    (tmp_path / "g.urdf").write_text(MOTOR.format(mass=0.001, kind=kind))
    assert len(loaded(tmp_path, "g.urdf").pieces) == 1


def test_a_link_of_sdf_or_usd_with_a_mass_and_no_shape_is_missing(tmp_path):
    motor = '<link name="motor"><inertial><mass>0.9</mass></inertial></link>'
    (tmp_path / "g.sdf").write_text(SDF.replace("</model>", f"{motor}</model>"))
    with pytest.raises(InputError, match=r"cannot be brought whole: .*mass of 0\.9 kg but no shape"):
        loaded(tmp_path, "g.sdf")
    pytest.importorskip("pxr")
    schemas = 'prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]'
    body = f'def Xform "motor" ( {schemas} )\n{{\n float physics:mass = 0.9\n}}\n'
    (tmp_path / "g.usda").write_text(USD + body)
    with pytest.raises(InputError, match=r"cannot be brought whole: .*mass of 0\.9 kg but no shape"):
        loaded(tmp_path, "g.usda")


def test_pictures_that_cannot_be_read_make_it_missing(tmp_path):
    lost = '<visual><geometry><mesh filename="gone.stl"/></geometry></visual><collision>'
    (tmp_path / "g.urdf").write_text(URDF.replace("<collision>", lost, 1))
    with pytest.raises(InputError, match=r"cannot be brought whole: .*left out of pictures"):
        loaded(tmp_path, "g.urdf")


def test_a_plane_or_a_height_field_of_mjcf_is_missing(tmp_path):
    (tmp_path / "g.xml").write_text(MJCF.replace("<body", '<geom type="plane" size="1 1 1"/><body'))
    with pytest.raises(InputError, match=r"cannot be brought whole: .*a plane cannot be part"):
        loaded(tmp_path, "g.xml")


@pytest.mark.parametrize(("key", "value"), [("units", "mm"), ("up", "y")])
def test_a_unit_or_axis_that_the_format_says_is_told_by_file_and_key(tmp_path, key, value):
    (tmp_path / "g.urdf").write_text(URDF)
    with pytest.raises(InputError) as refused:
        loaded(tmp_path, "g.urdf", **{key: value})
    (problem,) = refused.value.problems
    assert (problem.file, problem.key) == (str(tmp_path / "g.urdf"), key)


def test_pieces_of_one_name_are_told_apart(tmp_path):
    (tmp_path / "g.sdf").write_text(
        SDF.replace("</model>", "").replace("</sdf>", "")
        + '<link name="m"><collision name="c"><geometry><sphere><radius>0.01</radius></sphere></geometry>'
        '</collision></link><joint name="j" type="revolute"><parent>l</parent><child>m</child><axis>'
        '<xyz>0 0 1</xyz></axis></joint></model><model name="l"><link name="link"><collision name="c">'
        "<geometry><sphere><radius>0.01</radius></sphere></geometry></collision></link></model></sdf>"
    )
    names = [piece.name for piece in loaded(tmp_path, "g.sdf").pieces]
    assert len(names) == len(set(names)) == 3
