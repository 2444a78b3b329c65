"""Xacro without ROS: macros, arguments, packages; and what is not evaluated."""

from __future__ import annotations

import os

import numpy as np
import pytest

from seerob.app.cli import main
from seerob.core.errors import InputError
from seerob.core.files import parser_process
from seerob.core.files.parser_process import parsed
from seerob.description.formats import xacro_files
from seerob.description.loader import load_robot

R = "my_robot/urdf/r.urdf.xacro"
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
    return tmp_path


@pytest.mark.parametrize(("arguments", "height"), [({}, 0.6), ({"length": "1"}, 2.0)])
def test_macros_arguments_and_packages(folder, arguments, height):
    made = load_robot(R, folder=folder, arguments=arguments)
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
        ('<link name="$(cwd)"/>', "not evaluated"),
        ('<link name="${str([0]*1000000000)}"/>', "takes more than 1024 MiB of memory"),
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
        assert len(load_robot(R, folder=folder).links) == 2


def test_an_unexpanded_file_says_so(tmp_path):
    (tmp_path / "r.urdf").write_text(MAIN)
    with pytest.raises(InputError, match=r"name the file \.xacro"):
        load_robot("r.urdf", folder=tmp_path)


def test_an_argument_that_nobody_declared(folder):
    with pytest.raises(InputError) as caught:
        load_robot(R, folder=folder, arguments={"lenght": "1"})
    (problem,) = caught.value.problems
    assert problem.key == "arguments.lenght"
    assert "did you mean 'length'? known: length" in problem.remedy


def test_an_argument_behind_a_condition_is_declared(folder):
    text = MAIN.replace("<link", '<xacro:if value="0"><xacro:arg name="b" default="1"/></xacro:if><link', 1)
    (folder / R).write_text(text)
    assert len(load_robot(R, folder=folder, arguments={"b": "2"}).links) == 2


@pytest.mark.parametrize(
    ("arguments", "expected"), [({}, ["xacro argument length = 0.3"]), ({"length": "1"}, [])]
)
def test_an_argument_left_at_its_default_is_assumed(folder, arguments, expected):
    found = load_robot(R, folder=folder, arguments=arguments, name="arm").findings
    said = [f for f in found if "default of the file" in f.text]
    assert [f.text.removesuffix(" (default of the file)") for f in said] == expected
    assert {(f.level, f.subject) for f in said} <= {("assumed", "arm")}


@pytest.fixture
def home(tmp_path):
    """A home folder with a secret and a cell, which is returned."""
    for folder in (".ssh", "notes", "alice"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "secret.yaml").write_text("PLANTED: PLANTED")
        (tmp_path / folder / "secret.xacro").write_text(HEAD + '<link name="PLANTED"/></robot>')
    cell = tmp_path / "cell"
    cell.mkdir()
    (cell / "link").symlink_to(tmp_path / "notes")
    (cell / "round").symlink_to("round")
    os.mkfifo(cell / "pipe")
    return cell


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("<link name=\"${xacro.load_yaml('/etc/hostname')}\"/>", "outside the folders"),
        ("<link name=\"${load_yaml('../notes/secret.yaml')}\"/>", "outside the folders"),
        ("<link name=\"${load_yaml('link/secret.yaml')}\"/>", r"it leads to .*/notes/secret.yaml"),
        ("<link name=\"${load_yaml('round')}\"/>", "symbolic links"),
        ("<link name=\"${load_yaml('pipe')}\"/>", "is no file"),
        ("<link name=\"${load_yaml('/dev/zero')}\"/>", "outside the folders"),
        ('<xacro:include filename="HOME/notes/secret.xacro"/>', "outside the folders"),
        ('<xacro:include filename="../notes/secret.xacro" optional="true"/>', "outside the folders"),
        ('<xacro:include filename="../*/secret.xacro"/>', "outside the folders"),
        ('<xacro:include filename="link/*.xacro"/>', "outside the folders"),
        ('<xacro:include filename="$(find .ssh)/secret.xacro"/>', "no package '.ssh'"),
        ('<xacro:include filename="$(find notes)/secret.xacro"/>', "no package 'notes'"),
        ('<xacro:include filename="$(find ..)/notes/secret.xacro"/>', "no package '..'"),
        ('<xacro:include filename="$(find cell)/../notes/secret.xacro"/>', "outside the folders"),
        ('<xacro:include filename="$(find .)/secret.xacro"/>', "no package"),
    ],
)
def test_no_file_outside_its_folder_is_read(home, body, words):
    (home / "a.xacro").write_text(HEAD + body.replace("HOME", str(home.parent)) + "</robot>")
    with pytest.raises(InputError, match=words) as caught:
        load_robot("a.xacro", folder=home)
    assert caught.value.problems[0].file == "a.xacro"
    assert caught.value.problems[0].remedy
    assert "PLANTED" not in str(caught.value)


def test_the_environment_is_not_in_the_process_that_expands(monkeypatch):
    monkeypatch.setenv("SEEROB_PLANTED", "PLANTED")
    assert parsed(os.getenv, "SEEROB_PLANTED", file="a") is None


@pytest.mark.parametrize("body", ["${list(range(10**9)) + list(range(10**9))}", "${'a' * 2000000000}"])
def test_what_takes_all_memory_is_refused_by_name_and_the_next_file_is_read(folder, body):
    (folder / "bad.xacro").write_text(HEAD + f'<link name="{body}"/></robot>')
    with pytest.raises(InputError, match=r"^bad\.xacro: takes more than 1024 MiB .*; mend its expressions"):
        load_robot("bad.xacro", folder=folder)
    assert len(load_robot(R, folder=folder).links) == 2


def test_many_files_are_expanded_by_one_process(folder, monkeypatch):
    started = []
    monkeypatch.setattr(
        parser_process, "_Child", lambda made=parser_process._Child: started.append(1) or made()
    )
    for _ in range(5):
        load_robot(R, folder=folder)
    assert len(started) <= 1


def test_packages_beside_the_cell_need_to_be_allowed(tmp_path, folder):
    (tmp_path / "cell").mkdir()
    (tmp_path / "cell" / "a.xacro").write_text(MAIN)
    with pytest.raises(InputError, match="no package 'my_robot' was found; say where it is"):
        load_robot("a.xacro", folder=tmp_path / "cell")
    assert len(load_robot("a.xacro", folder=tmp_path / "cell", outside=True).links) == 2


def test_checking_says_that_it_ran(folder, capsys):
    (folder / "workstation.toml").write_text(f'[[robots]]\nname = "a"\nmodel = "{R}"\n')
    assert main(["check-file", str(folder)]) == 0
    said = "note         a: xacro ran: it evaluated the expressions of arm.xacro, r.urdf.xacro"
    assert said in capsys.readouterr().out


def test_what_computes_without_end_is_ended(folder, monkeypatch):
    monkeypatch.setattr(xacro_files, "SECONDS", 0.3)
    (folder / "bad.xacro").write_text(HEAD + '<link name="${max(range(10**11))}"/></robot>')
    with pytest.raises(InputError, match=r"^bad\.xacro: takes more than 0\.3 s to read; mend"):
        load_robot("bad.xacro", folder=folder)
