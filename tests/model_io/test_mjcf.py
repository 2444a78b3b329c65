"""MJCF against MuJoCo itself: poses, masses and shapes of the description are those of the compiled model."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from oracles import numpy_dynamics
from seerob.core.errors import InputError
from seerob.core.snapshot import Origin
from seerob.description.formats import mjcf_compiled
from seerob.description.loader import load_robot

ARM = """
<mujoco model="m">
  <compiler angle="degree" autolimits="true"/>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="base" pos="0 0 0.1">
      <inertial mass="3" pos="0 0 0.05" diaginertia="0.01 0.02 0.02"/>
      <geom type="box" size="0.1 0.1 0.1"/>
      <body name="upper" pos="0 0 0.2" euler="10 20 30">
        <inertial mass="2" pos="0.1 0 0.05" fullinertia="0.03 0.02 0.02 0.001 0 0.002"/>
        <joint name="a" axis="0 1 1" pos="0.02 0 -0.03" range="-90 120" damping="0.5" frictionloss="0.2"
               armature="0.1" actuatorfrcrange="-50 40"/>
        <joint name="b" type="slide" axis="1 0 0" range="-0.1 0.2"/>
        <geom type="capsule" size="0.05 0.2" contype="1"/>
        <geom type="sphere" size="0.07" contype="0" conaffinity="0" rgba="1 0 0 1"/>
        <body name="fore" pos="0.3 0 0.2">
          <inertial mass="1" pos="0 0 0.1" diaginertia="0.01 0.01 0.005"/>
          <joint name="c" axis="0 0 1" ref="30" range="-60 60"/>
          <joint name="d" axis="1 0 0" {d}/>
          <geom type="cylinder" size="0.04 0.1"/>
          <geom type="ellipsoid" size="0.02 0.03 0.04" pos="0 0 0.2"/>
          <site name="attachment_site" pos="0 0 0.2" quat="0 1 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="m1" joint="b" gear="10" ctrlrange="-3 2"/>
    <position name="m2" joint="c" kp="100" forcerange="-7 7"/>
  </actuator>
  {rest}
</mujoco>
"""


def read(tmp_path, text, **options):
    (tmp_path / "m.xml").write_text(text)
    return load_robot("m.xml", folder=tmp_path, **options)


def texts(description):
    return " | ".join(f.text for f in description.findings)


def arm(d='range="-10 10"', rest="", one_ref=True):
    text = ARM.format(d=d, rest=rest)
    return text.replace(' ref="30"', "") if not one_ref else text


def test_poses_and_mass_matrix_are_mujocos(tmp_path):
    text = arm(one_ref=False)
    made = read(tmp_path, text)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(1)
    for _ in range(5):
        data.qpos[:] = q = rng.uniform(-1, 1, 4)
        mujoco.mj_forward(model, data)
        links, _ = numpy_dynamics.kinematics(made, q)
        for name in ("base", "upper", "fore"):
            np.testing.assert_allclose(links[name][0][:3, 3], data.body(name).xpos, atol=1e-12)
            np.testing.assert_allclose(links[name][0][:3, :3].ravel(), data.body(name).xmat, atol=1e-12)
        np.testing.assert_allclose(
            links["attachment_site"][0][:3, 3], data.site("attachment_site").xpos, atol=1e-12
        )
        M = np.zeros((4, 4))
        mujoco.mj_fullM(model, data, M)
        M[np.diag_indices(4)] -= model.dof_armature
        np.testing.assert_allclose(numpy_dynamics.mass_matrix(made, q), M, rtol=1e-9, atol=1e-12)


def test_a_reference_angle_moves_the_zero(tmp_path):
    text = arm().replace('<joint name="d" axis="1 0 0" range="-10 10"/>', "")
    made = read(tmp_path, text)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = q = [0.3, 0.1, -0.4]
    mujoco.mj_forward(model, data)
    links, _ = numpy_dynamics.kinematics(made, q)
    np.testing.assert_allclose(links["fore"][0][:3, 3], data.body("fore").xpos, atol=1e-12)
    np.testing.assert_allclose(links["fore"][0][:3, :3].ravel(), data.body("fore").xmat, atol=1e-12)


def test_limits_and_their_sources(tmp_path):
    made = read(tmp_path, arm(one_ref=False))
    a, b, c, d = made.joints()
    (rotor,) = (f.text for f in made.findings if "armature" in f.text)
    assert "a 0.1" in rotor
    assert (a.lower, a.upper) == pytest.approx((-np.pi / 2, 2 * np.pi / 3))
    assert (a.damping, a.friction, a.armature.value, a.effort.value) == (0.5, 0.2, 0.1, 40)
    assert b.effort.value == 20  # the weaker side of gear · control range
    assert c.effort.value == 7
    assert d.effort is None
    assert {joint.velocity for joint in (a, b, c, d)} == {None}


def test_what_collides_and_what_is_drawn(tmp_path):
    made = read(tmp_path, arm(one_ref=False))
    upper = made.link("upper")
    assert [solid.radius for solid in upper.solids] == [0.05]
    assert [mesh.color for mesh in upper.visual] == [(1, 0, 0, 1)]
    cylinder, ellipsoid = made.link("fore").solids
    assert "circumscribed" in cylinder.note
    hull = trimesh.Trimesh(ellipsoid.mesh.vertices, ellipsoid.mesh.faces).convex_hull
    points = np.random.default_rng(0).normal(size=(500, 3))
    points *= np.array([0.02, 0.03, 0.04]) / np.linalg.norm(points, axis=1)[:, None]
    points += [0, 0, 0.2]
    offsets = np.einsum("ij,ij->i", hull.face_normals, hull.triangles[:, 0])
    assert (points @ hull.face_normals.T <= offsets + 1e-9).all()
    assert "a plane cannot be part of a robot" in texts(made)


def test_an_equality_is_a_mimic_joint(tmp_path):
    rest = '<equality><joint joint1="d" joint2="c" polycoef="0.1 2 0 0 0"/></equality>'
    made = read(tmp_path, arm(d="", rest=rest, one_ref=False))
    assert [joint.name for joint in made.joints()] == ["a", "b", "c"]
    mimic = made.link("fore").joints[1].mimic
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("c", 2, 0.1)


def test_masses_that_mujoco_invents_are_assumed(tmp_path):
    body = "<body name='b'><joint type='hinge'/><geom type='box' size='0.1 0.1 0.1' {}/></body>"
    text = "<mujoco><worldbody>" + body + "</worldbody></mujoco>"
    made = read(tmp_path, text.format(""))
    assert made.link("b").inertial.origin is Origin.ASSUMED
    assert "8 kg from its shapes at MuJoCo's 1000 kg/m³" in texts(made)
    made = read(tmp_path, text.format("mass='2'"))
    assert (made.link("b").inertial.origin, made.link("b").inertial.mass) == (Origin.COMPUTED, 2)


def test_meshes_arrive_where_mujoco_puts_them(tmp_path):
    (tmp_path / "assets").mkdir()
    shape = trimesh.creation.cone(0.1, 0.3).apply_translation([0.2, 0.1, 0])
    shape.export(tmp_path / "assets" / "cone.stl")
    text = """<mujoco><compiler meshdir="assets"/><asset><mesh file="cone.stl"/></asset><worldbody>
    <body name="b" pos="0 0 1"><joint/><geom type="mesh" mesh="cone" pos="0 0 0.5"/></body></worldbody>
    </mujoco>"""
    made = read(tmp_path, text)
    mesh = made.link("b").solids[0].mesh
    np.testing.assert_allclose(mesh.vertices.min(axis=0), shape.bounds[0] + [0, 0, 0.5], atol=1e-6)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), shape.bounds[1] + [0, 0, 0.5], atol=1e-6)
    assert set(made.files) == {"m.xml", "assets/cone.stl"}


def test_includes_are_read_and_kept(tmp_path):
    (tmp_path / "part.xml").write_text(
        "<mujocoinclude><body name='b'><joint/><geom size='1'/></body></mujocoinclude>"
    )
    made = read(tmp_path, '<mujoco><worldbody><include file="part.xml"/></worldbody></mujoco>')
    assert "b" in {link.name for link in made.links}
    assert set(made.files) == {"m.xml", "part.xml"}


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("<body><freejoint/><geom size='1'/></body>", "'free'"),
        ("<body><joint type='ball'/><geom size='1'/></body>", "'ball'"),
        ("<body><joint/></body>", "MuJoCo cannot read it"),
        ("<body><nonsense/></body>", "MuJoCo cannot read it"),
        ("<include file='nope.xml'/>", "no such file"),
        ("<include file='../out.xml'/>", "outside the model's folder"),
        ("<include file='m.xml'/>", "MuJoCo cannot read it"),
    ],
)
def test_models_that_are_refused(tmp_path, body, words):
    (tmp_path / "in").mkdir()
    (tmp_path / "out.xml").write_text("<mujocoinclude/>")
    with pytest.raises(InputError, match=words):
        read(tmp_path / "in", f"<mujoco><worldbody>{body}</worldbody></mujoco>")


def test_meshes_outside_the_folder_are_refused(tmp_path):
    (tmp_path / "in").mkdir()
    trimesh.creation.box().export(tmp_path / "x.stl")
    asset = '<mujoco><compiler meshdir=".."/><asset><mesh file="x.stl"/></asset><worldbody/></mujoco>'
    with pytest.raises(InputError, match="outside the model's folder"):
        read(tmp_path / "in", asset)
    asset = '<mujoco><asset><mesh file="nope.stl"/></asset><worldbody/></mujoco>'
    with pytest.raises(InputError, match="no such file; searched"):
        read(tmp_path / "in", asset)


def test_a_urdf_named_xml_is_a_urdf(tmp_path):
    (tmp_path / "r.xml").write_text('<robot name="r"><link name="only"/></robot>')
    assert [link.name for link in load_robot("r.xml", folder=Path(tmp_path)).links] == ["only"]


def one_body(inside="", beside=""):
    return f'<mujoco><worldbody><body name="a"><geom size=".1"/>{inside}</body></worldbody>{beside}</mujoco>'


BOMBS = {
    "a model that attaches itself": (
        one_body(beside='<asset><model name="m" file="m.xml"/></asset>'),
        r"ends the process that reads it \(SIGSEGV\)",
    ),
    "more than any memory": (
        one_body(beside='<size nuser_body="2000000000"/>'),
        "takes more than 2048 MiB of memory",
    ),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_model_that_crashes_its_parser_or_is_a_bomb_is_refused_by_name(tmp_path, bomb):
    text, said = BOMBS[bomb]
    with pytest.raises(InputError, match=rf"m\.xml.*{said}"):
        read(tmp_path, text)
    assert read(tmp_path, one_body()).links[0].name == "a"


def test_what_one_line_multiplies_is_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(mjcf_compiled, "MAX_ELEMENTS", 20)
    (tmp_path / "m.xml").write_text(one_body('<replicate count="20" sep="a"><site/></replicate>'))
    with pytest.raises(InputError, match=r"has 23 bodies, joints, geoms, sites and meshes"):
        mjcf_compiled._compile(tmp_path / "m.xml", "m.xml")


def test_a_model_without_end_is_refused_in_time(tmp_path, monkeypatch):
    monkeypatch.setattr(mjcf_compiled, "SECONDS", 1.0)
    text = one_body('<replicate count="2000000000"><site/></replicate>')
    with pytest.raises(InputError, match=r"takes more than (1 s|2048 MiB of memory) to read"):
        read(tmp_path, text)


@pytest.mark.parametrize(
    "way",
    [
        '<compiler meshdir="in"/><compiler meshdir="{out}"/>',
        '<compiler assetdir="{out}"/>',
        '<compiler meshdir="in/../../out"/>',
    ],
)
def test_a_file_that_mujoco_may_take_from_outside_is_refused_though_one_inside_has_its_name(tmp_path, way):
    for folder in ("cell/in", "out"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "m.stl").write_bytes(trimesh.creation.box().export(file_type="stl"))
    mesh = '<asset><mesh file="m.stl"/></asset>'
    with pytest.raises(InputError, match="outside the model's folder"):
        read(tmp_path / "cell", one_body(beside=way.format(out=tmp_path / "out") + mesh))


def test_what_an_attached_model_names_is_looked_at_too(tmp_path):
    (tmp_path / "secret.stl").write_bytes(trimesh.creation.box().export(file_type="stl"))
    (tmp_path / "cell").mkdir()
    (tmp_path / "cell" / "hand.xml").write_text(
        one_body(beside='<asset><mesh name="s" file="../secret.stl"/></asset>')
    )
    with pytest.raises(InputError, match="outside the model's folder"):
        read(tmp_path / "cell", one_body(beside='<asset><model name="m" file="hand.xml"/></asset>'))
    (tmp_path / "cell" / "hand.xml").write_text(one_body())
    made = read(
        tmp_path / "cell",
        one_body(
            '<attach model="h" body="a" prefix="h_"/>', '<asset><model name="h" file="hand.xml"/></asset>'
        ),
    )
    assert set(made.files) == {"m.xml", "hand.xml"}
    assert "h_a" in {link.name for link in made.links}


TENDON = '<tendon><fixed name="t" {}><joint joint="a" coef="1"/><joint joint="c" coef="{}"/></fixed></tendon>'
ROTORS = {
    "a motor": '<actuator><motor joint="c" gear="10" armature="0.002"/></actuator>',
    "a motor in its parent": '<actuator><motor jointinparent="d" gear="3" armature="0.1"/></actuator>',
    "a tendon of one joint": TENDON.format('armature="0.7"', 0),
    "a tendon of two": TENDON.format('armature="0.7"', 2),
    "a motor on a tendon": TENDON.format("", 2) + '<actuator><motor tendon="t" armature="0.5"/></actuator>',
}


@pytest.mark.parametrize("what", ROTORS)
def test_every_inertia_that_mujoco_has_is_in_the_description_or_said_to_be_left_out(tmp_path, what):
    """Joints, actuators and tendons have rotors: what is one joint's is in it, what is not is told."""
    text = arm(one_ref=False).replace("</mujoco>", ROTORS[what] + "</mujoco>")
    made = read(tmp_path, text)
    model = mujoco.MjModel.from_xml_string(text)
    data, M = mujoco.MjData(model), np.zeros((4, 4))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, M)
    bodies = numpy_dynamics.mass_matrix(made, np.zeros(4))
    rotors = [joint.armature.value if joint.armature else 0.0 for joint in made.joints()]
    same = np.allclose(M, bodies + np.diag(rotors), rtol=1e-9, atol=1e-12)
    assert same != bool(made.left_out)
    assert same == ("two" not in what and "on a tendon" not in what)


@pytest.mark.parametrize(
    "option",
    ['boundmass="1.5"', 'boundinertia="0.02"', 'settotalmass="3"', 'balanceinertia="true"'],
)
def test_masses_that_mujoco_changes_are_nobodys(tmp_path, option):
    """They are not what the file gives; who is as given stays as given."""
    text = arm(one_ref=False).replace('angle="degree"', f'angle="degree" {option}')
    if "balance" in option:
        text = text.replace('diaginertia="0.01 0.01 0.005"', 'diaginertia="0.01 0.01 0.03"')
    made = read(tmp_path, text)
    assert made.link("fore").inertial is None
    assert option.partition("=")[0] in made.link("fore").refused_mass
    if "boundmass" in option:
        assert made.link("upper").inertial is not None
