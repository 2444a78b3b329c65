"""Xacro without ROS: macros, arguments, packages; and what is not evaluated."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.description.loader import load_robot

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
MAIN = (
    HEAD
    + """
<xacro:arg name="length" default="0.3"/>
<xacro:property name="length" value="$(arg length)"/>
<xacro:include filename="$(find my_robot)/urdf/arm.xacro"/>
<link name="base"/>
<xacro:arm name="arm" parent="base" length="${2 * length}"/>
</robot>"""
)
ARM = (
    HEAD
    + """
<xacro:macro name="arm" params="name parent length">
  <link name="${name}">
    <inertial><mass value="${2**2}"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
    <collision><geometry><box size="0.1 0.1 ${length}"/></geometry></collision>
  </link>
  <joint name="${name}_joint" type="revolute">
    <parent link="${parent}"/><child link="${name}"/><axis xyz="0 0 1"/>
    <limit lower="${-pi}" upper="${radians(90)}" effort="10" velocity="1"/>
  </joint>
</xacro:macro></robot>"""
)


@pytest.fixture
def folder(tmp_path):
    urdf = tmp_path / "my_robot" / "urdf"
    urdf.mkdir(parents=True)
    (urdf / "arm.xacro").write_text(ARM)
    (urdf / "r.urdf.xacro").write_text(MAIN)
    return urdf


@pytest.mark.parametrize(("arguments", "height"), [({}, 0.6), ({"length": "1"}, 2.0)])
def test_macros_arguments_and_packages(folder, arguments, height):
    made = load_robot("r.urdf.xacro", folder=folder, arguments=arguments)
    (joint,) = made.joints()
    assert (joint.lower, joint.upper) == (-np.pi, np.pi / 2)
    assert made.link("arm").inertial.mass == 4
    assert np.ptp(made.link("arm").solids[0].mesh.vertices[:, 2]) == pytest.approx(height)
    assert any(name.endswith("arm.xacro") for name in made.files)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('<link name="${().__class__}"/>', "'__class__'"),
        ('<link name="${(lambda: 1)()}"/>', "lambda"),
        ('<link name="${[i for i in [1]][0].__class__}"/>', "'__class__'"),
        ('<link name="${str.format(1)}"/>', "'format'"),
        ('<link name="${python.vars()}"/>', "'python'"),
        ('<link name="${9**9**9}"/>', "a power"),
        ('<link name="${1 &lt;&lt; 10**9}"/>', "a power"),
        ('<link name="$(env HOME)"/>', "not evaluated"),
        ('<link name="$(optenv HOME x)"/>', "not evaluated"),
        ('<link name="$(eval 1 + 1)"/>', "not evaluated"),
        ('<link name="$(arg nope)"/>', "arguments = "),
        ('<link name="${nope}"/>', "'nope' is not defined"),
        ("<xacro:nope/>", "unknown macro"),
        ('<xacro:include filename="nope.xacro"/>', "No such file"),
        ('<xacro:include filename="$(find nope)/x.xacro"/>', "packages = "),
        ('<xacro:property name="a" value="${a}"/><link name="${a}"/>', "circular"),
    ],
)
def test_what_cannot_be_expanded(tmp_path, body, words):
    (tmp_path / "bad.xacro").write_text(HEAD + body + "</robot>")
    with pytest.raises(InputError) as caught:
        load_robot("bad.xacro", folder=tmp_path)
    assert words in str(caught.value)
    assert "bad.xacro" in str(caught.value)


def test_an_expansion_that_failed_leaves_nothing_behind(folder):
    (folder / "bad.xacro").write_text(HEAD + '<link name="${nope}"/></robot>')
    for _ in range(2):
        with pytest.raises(InputError):
            load_robot("bad.xacro", folder=folder)
        assert len(load_robot("r.urdf.xacro", folder=folder).links) == 2


def test_an_unexpanded_file_says_so(tmp_path):
    (tmp_path / "r.urdf").write_text(MAIN)
    with pytest.raises(InputError, match=r"name the file \.xacro"):
        load_robot("r.urdf", folder=tmp_path)


def test_an_argument_that_nobody_declared(folder):
    with pytest.raises(InputError) as caught:
        load_robot("r.urdf.xacro", folder=folder, arguments={"lenght": "1"})
    (problem,) = caught.value.problems
    assert problem.key == "arguments.lenght"
    assert "did you mean 'length'? known: length" in problem.remedy


def test_an_argument_behind_a_condition_is_declared(folder):
    text = MAIN.replace("<link", '<xacro:if value="0"><xacro:arg name="b" default="1"/></xacro:if><link', 1)
    (folder / "r.urdf.xacro").write_text(text)
    assert len(load_robot("r.urdf.xacro", folder=folder, arguments={"b": "2"}).links) == 2


@pytest.mark.parametrize(
    ("arguments", "expected"), [({}, ["xacro argument length = 0.3"]), ({"length": "1"}, [])]
)
def test_an_argument_left_at_its_default_is_assumed(folder, arguments, expected):
    found = load_robot("r.urdf.xacro", folder=folder, arguments=arguments, name="arm").findings
    said = [f for f in found if "default of the file" in f.text]
    assert [f.text.removesuffix(" (default of the file)") for f in said] == expected
    assert {(f.level, f.subject) for f in said} <= {("assumed", "arm")}
