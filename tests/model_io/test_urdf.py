"""URDF: what is read, what is repaired and said, what is refused with which words."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Origin
from seerob.description.description import Description, Inertial, JointKind, Link
from seerob.description.formats.resolve import Resolver
from seerob.description.formats.urdf_writing import written
from seerob.description.loader import load_robot
from seerob.description.xml_values import Reader

LIMIT = '<limit lower="-1" upper="2" effort="30" velocity="3"/>'
INERTIAL = '<inertial><mass value="2"/><inertia ixx="0.01" iyy="0.02" izz="0.02"/></inertial>'


def joint(name, parent, child, *, kind="revolute", inner=LIMIT, axis="0 0 1"):
    ends = f'<parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inner}</joint>'


def robot(*parts):
    return "<robot name='r'>" + "".join(parts) + "</robot>"


def arm(link="", limit=LIMIT, kind="revolute", axis="0 0 1"):
    """A base and one moving link with the given contents."""
    link = link or INERTIAL
    moving = joint("j", "base", "arm", inner=limit, kind=kind, axis=axis)
    return robot('<link name="base"/>', f'<link name="arm">{link}</link>', moving)


def read(folder, text, model="r.urdf", **options):
    (folder / model).write_text(text)
    return load_robot(model, folder=folder, **options)


def texts(description):
    return " | ".join(f"{f.level} {f.subject}: {f.text}" for f in description.findings)


def problems(tmp_path, text, **options):
    with pytest.raises(InputError) as caught:
        read(tmp_path, text, **options)
    return caught.value.problems


def test_every_link_is_kept_in_order_with_its_numbers(tmp_path):
    text = robot(
        '<link name="tool0"/>',
        '<link name="base"><inertial><mass value="7"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>',
        f'<link name="arm">{INERTIAL}</link>',
        '<joint name="f" type="fixed"><parent link="arm"/><child link="tool0"/><origin xyz="1 2 3"/></joint>',
        joint("j", "base", "arm", inner='<origin xyz="0 0 1" rpy="0.1 0.2 0.3"/>' + LIMIT, axis="0 0 2"),
    )
    made = read(tmp_path, text, name="left")
    assert [link.name for link in made.links] == ["base", "arm", "tool0"]
    assert made.tip == "tool0"
    assert made.link("base").inertial.mass == 7
    np.testing.assert_array_equal(made.link("tool0").parent_from_link[:3, 3], [1, 2, 3])
    (only,) = made.joints()
    assert (only.kind, only.lower, only.upper) == (JointKind.REVOLUTE, -1, 2)
    assert (only.effort.value, only.velocity.value, only.effort.origin) == (30, 3, Origin.STATED)
    np.testing.assert_array_equal(only.axis, [0, 0, 1])
    assert "axis of length 2" in texts(made)
    assert "left" in {finding.subject for finding in made.findings}
    assert made.files["r.urdf"].startswith(b"<robot")


def test_inertia_is_turned_into_link_axes(tmp_path):
    inertial = '<inertial><origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/><mass value="1"/>'
    made = read(tmp_path, arm(inertial + '<inertia ixx="1" iyy="2" izz="2.5" ixy="0.1"/></inertial>'))
    np.testing.assert_allclose(
        made.link("arm").inertial.inertia, [[2, -0.1, 0], [-0.1, 1, 0], [0, 0, 2.5]], atol=1e-15
    )


def test_continuous_and_prismatic(tmp_path):
    assert read(tmp_path, arm(kind="continuous")).joints()[0].lower is None
    assert read(tmp_path, arm(kind="prismatic")).joints()[0].kind is JointKind.PRISMATIC


def test_mimic_chains_collapse(tmp_path):
    text = robot(
        *(f'<link name="l{i}"/>' for i in range(4)),
        joint("a", "l0", "l1"),
        joint("b", "l1", "l2", inner=LIMIT + '<mimic joint="a" multiplier="2" offset="0.5"/>'),
        joint("c", "l2", "l3", inner=LIMIT + '<mimic joint="b" multiplier="-3" offset="1"/>'),
    )
    made = read(tmp_path, text)
    assert [j.name for j in made.joints()] == ["a"]
    mimic = made.link("l3").joints[0].mimic
    # c = -3 (2 a + 0.5) + 1
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("a", -6, -0.5)


@pytest.mark.parametrize(
    ("inner", "words"),
    [
        ('<mimic joint="nope"/>', "no joint named 'nope'"),
        ('<mimic joint="j"/>', "mimics itself"),
        ('<dynamics damping="-1"/>', "is -1"),
    ],
)
def test_wrong_joint_contents(tmp_path, inner, words):
    assert any(words in str(problem) for problem in problems(tmp_path, arm(limit=LIMIT + inner)))


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ('<limit lower="-1" upper="1" effort="0" velocity="1"/>', "effort limit is 0"),
        ('<limit lower="-1" upper="1" effort="1e9" velocity="1"/>', "effort limit is 1e+09"),
        ('<limit lower="-1" upper="1" effort="1" velocity="-2"/>', "velocity limit is -2"),
        ('<limit lower="-1" upper="1" effort="1"/>', "velocity limit unknown: j"),
        ('<limit effort="1" velocity="1"/>', "taken as without limits"),
        ("", "effort limit unknown: j"),
        ('<limit lower="1" upper="1" effort="1" velocity="1"/>', "cannot move"),
    ],
)
def test_limits_that_are_said(tmp_path, limit, words):
    assert words in texts(read(tmp_path, arm(limit=limit)))


def test_unknown_limits_are_none_not_zero(tmp_path):
    (only,) = read(tmp_path, arm(limit='<limit lower="-1" upper="1" effort="0" velocity="0"/>')).joints()
    assert only.effort is None
    assert only.velocity is None
    assert only.armature is None


def inertial(mass, xx, yy, zz):
    return f'<inertial><mass value="{mass}"/><inertia ixx="{xx}" iyy="{yy}" izz="{zz}"/></inertial>'


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (inertial(0, 0, 0, 0), "mass is 0 kg"),
        (inertial(1, 0, 0, 0), "inertia of 0"),
        (inertial(1, 1, 1, 3), "break A + B"),
        (inertial(1, -1, 1, 1), "break A + B"),
        ("<visual><geometry><box size='1 1 1'/></geometry></visual>", "mass and inertia unknown"),
    ],
)
def test_masses_that_cannot_be_are_unknown(tmp_path, given, words):
    made = read(tmp_path, arm(given))
    assert made.link("arm").inertial is None
    assert words in texts(made)


def test_rounding_of_an_inertia_is_mended_and_said(tmp_path):
    made = read(tmp_path, arm(inertial(1, 1, 1, 2.001)))
    a, b, c = np.linalg.eigvalsh(made.link("arm").inertial.inertia)
    assert a + b > c
    np.testing.assert_allclose([a, b, c], [1, 1, 2], rtol=2e-3)
    assert "mended" in texts(made)


def test_one_inertia_for_all_links_is_a_placeholder(tmp_path):
    links = [f'<link name="l{i}">{inertial(i + 1, 0.1, 0.1, 0.1)}</link>' for i in range(4)]
    joints = [joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(3)]
    made = read(tmp_path, robot(*links, *joints))
    assert {link.inertial.origin for link in made.links} == {Origin.ASSUMED}
    assert "placeholder" in texts(made)


def test_centres_of_mass_at_every_frame_are_placeholders_where_a_shape_lies_aside(tmp_path):
    """As in a maker's files of arms of two lengths, whose upper arms would weigh nothing against gravity."""
    aside = '<collision><origin xyz="0.3 0 0"/><geometry><box size="0.6 0.1 0.1"/></geometry></collision>'
    joints = [joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(4)]

    def made(shape):
        masses = [inertial(i + 1, 0.1, 0.1 + 0.01 * i, 0.12) for i in range(5)]
        links = [f'<link name="l{i}">{mass}{shape * (i == 2)}</link>' for i, mass in enumerate(masses)]
        return read(tmp_path, robot(*links, *joints))

    found = made(aside)
    assert {link.inertial.origin for link in found.links if link.joints} == {Origin.ASSUMED}
    assert "nobody stated them" in texts(found)
    middle = made(aside.replace("0.3 0 0", "0 0 0"))
    assert {link.inertial.origin for link in middle.links} == {Origin.STATED}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot", "is not XML"),
        ("", "is not XML"),
        ("<mesh/>", "root element is <mesh>"),
        ("<robot/>", "has no <link>"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;"/>', "entities"),
        (robot('<link name="a"/><link name="a"/>'), "2 links carry this name"),
        (robot("<link/>"), "has no name"),
        (robot(f'<link name="a">{2 * INERTIAL}</link>'), "inertial: is there 2 times"),
        (arm(INERTIAL.replace("<mass", '<mass value="9"/><mass')), "mass: is there 2 times"),
        (arm().replace("<axis", '<axis xyz="1 0 0"/><axis', 1), "axis: is there 2 times"),
        (robot('<link name="a"/><link name="b"/>'), "2 links hang on nothing"),
        (robot('<link name="a"/><link name="b"/>', joint("j", "a", "b"), joint("k", "b", "a")), "loop"),
        (robot('<link name="a"/>', joint("j", "a", "bb")), "no link named 'bb'"),
        (arm(kind="floating"), "'floating'"),
        (arm(kind="planar"), "'planar'"),
        (arm(kind="revolut"), "did you mean 'revolute'"),
        (arm(axis="0 0 0"), "must not be zero"),
        (arm(axis="0 0"), "must be 3 numbers"),
        (arm(axis="0 0 nan"), "must be 3 numbers"),
        (arm(axis="0 0 1e999"), "finite"),
        (arm(inertial("1,5", 1, 1, 1)), "decimal point"),
        (arm(inertial(-1, 1, 1, 1)), "greater than 0"),
        (arm(inertial("${m}", 1, 1, 1)), "unresolved expression"),
        (arm(limit='<limit lower="2" upper="1" effort="1" velocity="1"/>'), "greater than upper"),
        (arm("<collision><geometry/></collision>"), "holds nothing"),
        (arm("<collision><geometry><box size='1 1 0'/></geometry></collision>"), "greater than 0 m"),
        (arm("<collision><geometry><cylinder radius='1'/></geometry></collision>"), "length"),
        (arm("<collision><geometry><mesh filename='a.stl' scale='1 0 1'/></geometry></collision>"), "scale"),
        (
            arm("<collision><geometry><mesh filename='http://x/a.stl'/></geometry></collision>"),
            "never fetched",
        ),
    ],
)
def test_files_that_are_refused(tmp_path, text, words):
    assert words in "\n".join(map(str, problems(tmp_path, text)))


def test_all_mistakes_at_once(tmp_path):
    text = robot(
        '<link name="base"/>',
        f'<link name="a">{inertial(-1, 1, 1, 1)}</link>',
        joint("j", "base", "a", axis="0 0 0", inner='<limit lower="2" upper="1"/>'),
        "<link name='b'><visual><geometry><mesh filename='no.stl'/></geometry></visual></link>",
        joint("k", "a", "b", kind="ball"),
    )
    keys = {problem.key for problem in problems(tmp_path, text)}
    assert keys == {
        "link[a].inertial.mass.value",
        "joint[j].axis",
        "joint[k].type",
        "link[b].visual[0].mesh",
    }


BOX = "<collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision>"


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ("<mesh filename='no.stl'/>", "no.stl: no such file"),
        ("<mesh filename='broken.stl'/>", "broken.stl:  is truncated"),
        ("<mesh filename='http://x/a.stl'/>", "never fetched"),
        ("<box size='1 1'/>", "is '1 1'"),
        ("<box size='1 1 0'/>", "is 1 1 0"),
        ("", "holds nothing"),
    ],
)
def test_what_only_the_eye_needs_is_left_out_and_said(tmp_path, shape, words):
    (tmp_path / "broken.stl").write_bytes(bytes(20))
    visual = f"<visual><geometry>{shape}</geometry></visual>"
    look = "<visual><geometry><box size='0.2 0.2 0.2'/></geometry></visual>"
    made = read(tmp_path, arm(INERTIAL + BOX + visual + look))
    assert len(made.link("arm").visual) == len(made.link("arm").solids) == 1
    (said,) = [f for f in made.findings if "left out of pictures" in f.text]
    assert words in said.text
    assert said.level == "warning"
    # It may stand out of what distances see: nobody is within by it.
    assert said.holds == ("robot",)
    # Where it is the only shape, distances need it.
    assert any(words in str(problem) for problem in problems(tmp_path, arm(INERTIAL + visual)))


def test_a_mesh_that_only_one_link_shows_is_missed_by_the_one_that_collides(tmp_path):
    mesh = "<geometry><mesh filename='no.stl'/></geometry>"
    text = robot(
        f"<link name='base'>{BOX}<visual>{mesh}</visual></link>",
        f"<link name='arm'>{INERTIAL}<collision>{mesh}</collision></link>",
        joint("j", "base", "arm"),
    )
    (problem,) = problems(tmp_path, text)
    assert problem.key == "link[arm].collision[0].mesh"


@pytest.mark.parametrize(
    "shape", ["<box size='0 0 0'/>", "<sphere radius='0.0'/>", "<cylinder radius='0' length='0'/>"]
)
def test_a_shape_of_no_size_is_none(tmp_path, shape):
    dummy = f"<{{0}}><geometry>{shape}</geometry></{{0}}>"
    made = read(tmp_path, arm(INERTIAL + dummy.format("collision") + dummy.format("visual")))
    assert made.link("arm").solids == made.link("arm").visual == ()
    assert "collision[0] has no size at all" in texts(made)
    shown = "<visual><geometry><box size='0.2 0.2 0.2'/></geometry></visual>"
    made = read(tmp_path, arm(INERTIAL + dummy.format("collision") + shown))
    assert len(made.link("arm").solids) == 1
    assert "use the visual one" in texts(made)


def mesh_link(uri, tag="collision", scale=""):
    shape = f'<mesh filename="{uri}" {scale}/>'
    return f'{INERTIAL}<{tag}><origin xyz="0 0 1"/><geometry>{shape}</geometry></{tag}>'


@pytest.fixture
def package(tmp_path):
    """``tmp/ws/src/my_robot/{urdf,meshes/Part.STL}`` with the URDF still to be written."""
    folder = tmp_path / "ws" / "src" / "my_robot"
    (folder / "urdf").mkdir(parents=True)
    (folder / "meshes").mkdir()
    trimesh.creation.box([0.1, 0.2, 0.3]).export(folder / "meshes" / "Part.STL", file_type="stl")
    return folder


@pytest.mark.parametrize(
    "uri",
    [
        "package://my_robot/meshes/Part.STL",
        "model://my_robot/meshes/Part.STL",
        "../meshes/Part.STL",
        "file://{folder}/meshes/Part.STL",
        "{folder}/meshes/Part.STL",
        "package://my_robot/Meshes/part.stl",
        "../MESHES/part.stl",
    ],
)
def test_meshes_are_found(package, uri):
    made = read(package, arm(mesh_link(uri.format(folder=package))), "urdf/r.urdf")
    (solid,) = made.link("arm").solids
    np.testing.assert_allclose(np.ptp(solid.mesh.vertices, axis=0), [0.1, 0.2, 0.3], atol=1e-7)
    np.testing.assert_allclose(solid.mesh.vertices.mean(axis=0), [0, 0, 1], atol=1e-7)
    assert ("upper and lower case differ" in texts(made)) == ("part.stl" in uri)
    assert any(name.casefold().endswith("part.stl") for name in made.files)


def test_a_package_elsewhere_is_named(package, tmp_path):
    text = arm(mesh_link("package://other/meshes/Part.STL"))
    (problem,) = problems(tmp_path, text)
    assert "no such file" in problem.what
    assert "packages = { other" in problem.remedy
    made = read(tmp_path, text, packages={"other": str(package)})
    assert len(made.link("arm").solids) == 1


def test_a_package_cannot_be_left(package, tmp_path):
    (tmp_path / "secret.stl").write_bytes((package / "meshes" / "Part.STL").read_bytes())
    text = arm(mesh_link("package://my_robot/../../../secret.stl"))
    (problem,) = problems(package / "urdf", text)
    assert "no such file" in problem.what


@pytest.mark.parametrize(
    "uri",
    ["../meshes/Part.STL", "file://{folder}/meshes/Part.STL", "package://my_robot/meshes/Part.STL", "m.STL"],
)
def test_a_mesh_outside_the_folder_is_refused_unless_allowed(package, uri):
    (package / "urdf" / "m.STL").symlink_to(package / "meshes" / "Part.STL")
    text = arm(mesh_link(uri.format(folder=package)))
    (problem,) = problems(package / "urdf", text)
    assert "outside the folders" in problem.what or "packages = { my_robot" in problem.remedy
    assert read(package / "urdf", text, outside=True).link("arm").solids


@pytest.mark.parametrize("name", [".ssh", "..", ".", "", "a b", "~", "-"])
def test_a_package_has_the_name_of_one(tmp_path, name):
    (tmp_path / name).mkdir(exist_ok=True)
    assert not list(Resolver("r.urdf", tmp_path, {name: tmp_path}, outside=True).roots(name))


def test_scale_and_mirror(package):
    made = read(package, arm(mesh_link("../meshes/Part.STL", scale='scale="-1 2 1"')), "urdf/r.urdf")
    mesh = made.link("arm").solids[0].mesh
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [0.1, 0.4, 0.3], atol=1e-7)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(0.1 * 0.4 * 0.3, rel=1e-6)


def test_without_collision_the_visual_counts_and_is_said(package):
    made = read(package, arm(mesh_link("../meshes/Part.STL", tag="visual")), "urdf/r.urdf")
    assert len(made.link("arm").solids) == 1
    assert "use the visual one" in texts(made)


def test_protrusion_of_the_visual_is_measured(tmp_path):
    def box(tag, size):
        return f"<{tag}><geometry><box size='{size}'/></geometry></{tag}>"

    made = read(tmp_path, arm(INERTIAL + box("visual", "0.2 0.2 0.206") + box("collision", "0.2 0.2 0.2")))
    assert "sticks out of the collision shape by up to 3.0 mm" in texts(made)
    made = read(tmp_path, arm(INERTIAL + box("visual", "0.2 0.2 0.2") + box("collision", "0.2 0.2 0.206")))
    assert "sticks out" not in texts(made)


def test_primitives_contain_what_they_stand_for(tmp_path):
    shapes = (
        "<sphere radius='0.1'/>",
        "<cylinder radius='0.1' length='0.4'/>",
        "<capsule radius='0.1' length='0.4'/>",
    )
    for shape in shapes:
        made = read(tmp_path, arm(f"{INERTIAL}<collision><geometry>{shape}</geometry></collision>"))
        (solid,) = made.link("arm").solids
        if solid.mesh is None:
            assert solid.radius == 0.1
            assert np.ptp(solid.points[:, 2]) == pytest.approx(0.4 if "capsule" in shape else 0)
        else:
            angles = np.linspace(0, 2 * math.pi, 1000)
            rim = np.column_stack([0.1 * np.cos(angles), 0.1 * np.sin(angles), np.full(1000, 0.2)])
            v, f = solid.mesh.vertices, solid.mesh.faces
            normals = np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]])
            assert (rim @ normals.T <= np.einsum("ij,ij->i", normals, v[f[:, 0]]) + 1e-12).all()
            assert "circumscribed" in solid.note


def test_colours_come_from_materials(tmp_path):
    look = "<visual><geometry><box size='1 1 1'/></geometry><material name='red'/></visual>"
    text = arm(INERTIAL + look).replace(
        "<link", "<material name='red'><color rgba='1 0 0 1'/></material><link", 1
    )
    assert read(tmp_path, text).link("arm").visual[0].color == (1, 0, 0, 1)


@pytest.mark.parametrize("model", ["nope.urdf", "", "r.sldasm", "package:example-robot-data/nope.urdf"])
def test_models_that_are_not_there(tmp_path, model):
    (tmp_path / "r.sldasm").write_text("x")
    with pytest.raises(InputError):
        load_robot(model, folder=tmp_path)


def test_a_distribution_that_is_not_installed(tmp_path):
    with pytest.raises(UnknownName, match="example-robot-data"):
        load_robot("package:example_robot_dat/x.urdf", folder=tmp_path)


def test_an_installed_robot_by_its_tail(tmp_path):
    made = load_robot("package:example-robot-data/robots/ur_description/urdf/ur10_robot.urdf", folder=Path())
    assert sum(link.inertial.mass for link in made.links if link.inertial) == pytest.approx(32.7)
    forearm = next(f.text for f in made.findings if "forearm" in f.subject and "sticks out" in f.text)
    assert "3.4 mm" in forearm
    # The figure travels with the shape, so that distances carry it as an interval.
    assert made.link("forearm_link").solids[0].deviation == pytest.approx(0.0034, abs=5e-5)


def test_a_missing_mesh_says_where_it_was_looked_for_only_when_it_was(tmp_path, monkeypatch):
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(variable, raising=False)
    found = Resolver("r.urdf", tmp_path).find("package://nobody_has_this/m.stl")
    assert (
        found.remedy == 'say where the package is: packages = { nobody_has_this = "folder of the package" }'
    )
    named = Resolver("r.urdf", tmp_path, {"p": tmp_path / "p"})
    assert named.find("package://p/../m.stl").remedy == "what a package names stays in the package"
    assert named.find("package://p/m.stl").remedy == f"searched {tmp_path / 'p' / 'm.stl'}"


@pytest.mark.parametrize("value", ["nan", "inf", "1 2", "heavy"])
def test_a_single_number_is_asked_for_as_one(value):
    reader = Reader("r.urdf", "r")
    reader.number(ElementTree.fromstring(f'<mass value="{value}"/>'), "value", "link[a].mass")
    assert [p.remedy for p in reader.problems] == ["must be a finite number"]


def test_a_link_larger_than_20_m_speaks_of_a_wrong_unit(tmp_path):
    shape = '<collision><geometry><box size="{} 1 1"/></geometry></collision>'
    text = f'<robot name="r"><link name="a">{shape}</link></robot>'
    for size, expected in (("19", 0), ("120", 1)):
        (tmp_path / "r.urdf").write_text(text.format(size))
        found = [f for f in load_robot("r.urdf", folder=tmp_path).findings if "largest extent" in f.text]
        assert [(f.level, f.subject) for f in found] == [("warning", "robot/a")] * expected
    assert "read as mm it would be 0.12 m" in found[0].text


# -- what only the eye needs ---------------------------------------------------------------------

SOLID = '<collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision>'
ABSENT = '<visual><geometry><mesh filename="gone.stl"/></geometry></visual>'


@pytest.mark.parametrize(
    "shown",
    [
        ABSENT,
        '<visual><geometry><box size="1 1"/></geometry></visual>',
        '<visual><geometry><mesh filename="${part}.stl"/></geometry></visual>',
        '<visual><origin xyz="${x} 0 0"/><geometry><box size="1 1 1"/></geometry></visual>',
        "<visual/>",
    ],
)
def test_an_unreadable_look_holds_a_robot_until_the_user_says_that_it_does_not_count(tmp_path, shown):
    text = arm(INERTIAL + SOLID + shown)
    held = read(tmp_path, text, name="a")
    assert [f.holds for f in held.findings if f.holds] == [("a",)]
    assert 'visuals = "ignore"' in texts(held)
    ignored = read(tmp_path, text, name="a", visuals=False)
    assert not [f for f in ignored.findings if f.holds]
    assert "assumed a: shapes for the eye are not read" in texts(ignored)
    for with_look, without in zip(held.links, ignored.links, strict=True):
        assert len(with_look.solids) == len(without.solids)
        assert without.visual == ()


def test_what_distances_need_is_refused_all_the_same(tmp_path):
    for visuals in (True, False):
        for inner in (ABSENT, SOLID.replace("0.1 0.1 0.3", "${x}"), ABSENT.replace("visual", "collision")):
            assert problems(tmp_path, arm(INERTIAL + inner), visuals=visuals)


def test_a_look_that_is_ignored_makes_no_distance_uncertain(tmp_path):
    """The one that is read, and stands out, does: by as much as it stands out."""
    shown = '<visual><geometry><box size="0.12 0.1 0.3"/></geometry></visual>'
    text = arm(INERTIAL + SOLID + shown)
    (solid,) = read(tmp_path, text).link("arm").solids
    assert solid.deviation == pytest.approx(0.01)
    (solid,) = read(tmp_path, text, visuals=False).link("arm").solids
    assert solid.deviation == 0


@pytest.mark.parametrize(
    ("kind", "look"),
    [
        ('box size="0.1 0.1 0.3"', "0.11 0.1 0.3"),
        ('sphere radius="0.1"', "0.1 0.1 0.19"),
        ('capsule radius="0.1" length="1"', "0.21 0.02 0.3"),
    ],
)
def test_a_stated_deviation_is_kept_by_every_shape(tmp_path, kind, look):
    """What is shown to stand out by less takes nothing of it away."""
    inside = f'<collision deviation="0.02"><geometry><{kind}/></geometry></collision>'
    shown = '<visual><geometry><box size="' + look + '"/></geometry></visual>'
    for more in ("", shown):
        (solid,) = read(tmp_path, arm(INERTIAL + inside + more)).link("arm").solids
        assert solid.deviation == 0.02


def test_open_halves_that_close_together_keep_their_deviation(tmp_path):
    whole = trimesh.creation.box((0.1, 0.1, 0.3))
    inside = ""
    for k, part in enumerate((whole.faces[:6], whole.faces[6:])):
        trimesh.Trimesh(whole.vertices, part).export(tmp_path / f"half_{k}.stl")
        mesh = f'<geometry><mesh filename="half_{k}.stl"/></geometry>'
        inside += f'<collision deviation="0.0{k + 1}">{mesh}</collision>'
    (solid,) = read(tmp_path, arm(INERTIAL + inside)).link("arm").solids
    assert solid.deviation == 0.02


def test_colours_and_elements_for_others_refuse_no_robot(tmp_path):
    text = robot(
        '<material name="m"><color rgba="1 0"/></material>',
        '<material name="n"><color rgba="${grey}"/></material>',
        '<gazebo reference="arm"><x y="$(arg x)"/></gazebo>',
        '<transmission name="${t}"/>',
        '<link name="base"/>',
        f'<link name="arm">{INERTIAL}{SOLID}<visual><geometry><box size=".1 .1 .3"/></geometry>'
        '<material name="m"/></visual></link>',
        joint("j", "base", "arm"),
    )
    made = read(tmp_path, text)
    assert "shown in grey" in texts(made)
    assert not [f for f in made.findings if f.holds]
    assert len(made.link("arm").visual) == 1


def test_visuals_of_an_mjcf_are_left_out_too(tmp_path):
    geoms = '<geom type="box" size=".1 .1 .1"/><geom type="box" size=".2 .1 .1" contype="0" conaffinity="0"/>'
    body = f'<body name="arm"><joint name="j" axis="0 0 1" range="-1 1"/>{geoms}</body>'
    text = f'<mujoco><compiler angle="radian"/><worldbody>{body}</worldbody></mujoco>'
    seen = read(tmp_path, text, "r.xml")
    assert seen.link("arm").visual
    ignored = read(tmp_path, text, "r.xml", visuals=False)
    assert ignored.link("arm").visual == ()
    assert len(ignored.link("arm").solids) == len(seen.link("arm").solids)
    assert "shapes for the eye are not read" in texts(ignored)


@pytest.mark.parametrize("name", ["arm", "arm.robot"])
def test_a_file_without_the_customary_ending_is_read_as_what_it_is(tmp_path, name):
    (tmp_path / name).write_text('<robot name="a"><link name="base"/></robot>')
    assert [link.name for link in load_robot(name, folder=tmp_path).links] == ["base"]
    (tmp_path / name).write_bytes(b"solid a\nendsolid a\n")
    with pytest.raises(InputError, match="is not a robot description"):
        load_robot(name, folder=tmp_path)


def test_by_how_much_a_mass_may_be_off_is_written_and_read_again(tmp_path):
    inertial = Inertial(
        2.0, np.zeros(3), np.eye(3) * 0.01, Origin.ESTIMATED, "by density", 0.02, 0.05, gyration=0.1
    )
    link = Link("one", None, np.eye(4), inertial=inertial)
    for plain, expected in ((False, (0.02, 0.05, 0.1)), (True, (0, 0, 0))):
        text, _ = written(Description("one", (link,), "one", "made here"), plain=plain)
        (tmp_path / "one.urdf").write_text(text)
        read = load_robot("one.urdf", folder=tmp_path).links[0].inertial
        assert (read.error, read.spread_error, read.gyration) == expected
    (tmp_path / "one.urdf").write_text(text.replace('value="2.0"', 'value="2.0" error="-1"'))
    with pytest.raises(InputError, match="a share from 0 up"):
        load_robot("one.urdf", folder=tmp_path)
