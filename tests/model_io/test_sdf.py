"""SDF: worlds with frames, includes, static and moving models, whose places are known by construction."""

import random
import tomllib

import numpy as np
import pytest

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.core.errors import InputError
from seerob.description.cad import sdf
from seerob.description.description import base_from_links
from seerob.description.loader import load_robot
from seerob.description.mesh_files import MeshSource
from soak.mutations import mutated

BOX = "<geometry><box><size>0.2 0.4 0.6</size></box></geometry>"
WORLD = f"""<sdf version="1.9"><world name="w">
<model name="table"><static>true</static><pose degrees="true">1 2 0.3 0 0 90</pose>
 <link name="link"><visual name="v">
 {BOX}<material><diffuse>1 0 0 1</diffuse></material></visual></link></model>
<include><uri>model://bin</uri><name>bin_7</name><pose>5 0 0 0 0 0</pose><static>1</static></include>
<include><uri>model://nowhere</uri></include>
<model name="door"><pose>0 3 0 0 0 0</pose>
 <frame name="hinge_frame" attached_to="post"><pose>0.1 0 0 0 0 0</pose></frame>
 <link name="post"><pose>0 0 1 0 0 0</pose><collision name="c">{BOX}</collision></link>
 <link name="leaf"><pose relative_to="hinge_frame">0.5 0 0 0 0 0.5</pose>
  <inertial><pose>0.1 0 0 0 0 0</pose><mass>12</mass>
  <inertia><ixx>1</ixx><iyy>2</iyy><izz>2.5</izz></inertia></inertial>
  <collision name="c">{BOX}</collision></link>
 <joint name="hinge" type="revolute"><pose relative_to="hinge_frame"/><parent>post</parent><child>leaf</child>
  <axis><xyz>0 0 2</xyz><limit><lower>0</lower><upper>1.5</upper><velocity>3</velocity></limit></axis></joint>
</model></world></sdf>"""
BIN = f"""<sdf version="1.6"><model name="bin"><pose>9 9 9 0 0 0</pose><link name="shell">
<pose>0 0 0.5 0 0 0</pose><visual name="v">{BOX}</visual></link></model></sdf>"""


def world(folder):
    (folder / "bin").mkdir(parents=True)
    (folder / "bin/model.sdf").write_text(BIN)
    (folder / "w.sdf").write_text(WORLD)
    return folder / "w.sdf"


def read(path):
    return sdf.read(MeshSource(path, path.read_bytes(), 1 << 26, 10**6))


def test_places_follow_frames_and_includes(tmp_path):
    file = world(tmp_path / "in")
    assert cli.main(["import", str(file), str(tmp_path / "cell")]) == Exit.WITHIN
    assert cli.main(["check-file", str(tmp_path / "cell")]) == Exit.WITHIN
    table = tomllib.loads((tmp_path / "cell/workstation.toml").read_text())
    places = {part["name"]: part["at"]["position"] for part in table["parts"]}
    assert places == {"table": [1, 2, 0.3], "bin_7/shell": [5, 0, 0.5]}
    (robot,) = table["robots"]
    assert robot["base"]["position"] == pytest.approx([0, 3, 1])
    door = load_robot(robot["model"], folder=tmp_path / "cell")
    (hinge,) = door.joints()
    assert (hinge.lower, hinge.upper, hinge.velocity.value) == (0, 1.5, 3)
    closed = base_from_links(door, {})["leaf"]
    assert closed[:3, 3] == pytest.approx([0.6, 0, 0])
    # A quarter turn about the hinge at x = 0.1.
    opened = base_from_links(door, {"hinge": np.pi / 2})["leaf"]
    assert opened[:3, 3] == pytest.approx([0.1, 0.5, 0])
    assert door.link("leaf").inertial.mass == 12
    assert door.link("leaf").inertial.com == pytest.approx([0.1, 0, 0])
    assert any(name == "model://nowhere" for name, _ in read(file).left_out)


@pytest.mark.parametrize("version", ["1.4", "1.6", "1.9"])
def test_axes_are_in_the_frame_that_each_edition_means(tmp_path, version):
    text = f"""<sdf version="{version}"><model name="m">
    <link name="a"><collision name="c">{BOX}</collision></link>
    <link name="b"><pose>0 0 1 0 0 1.5707963267948966</pose><collision name="c">{BOX}</collision></link>
    <joint name="j" type="prismatic"><parent>a</parent><child>b</child><axis><xyz>1 0 0</xyz>
    <limit><lower>0</lower><upper>1</upper></limit></axis></joint></model></sdf>"""
    (tmp_path / "a.sdf").write_text(text)
    (moving,) = read(tmp_path / "a.sdf").mechanisms
    moved = base_from_links(moving.description, {"j": 0.25})["b"][:3, 3]
    along = [0.25, 0, 1] if version == "1.4" else [0, 0.25, 1]
    assert moved == pytest.approx(along, abs=1e-12)


def test_frames_in_a_circle_and_files_elsewhere_are_refused_or_named(tmp_path):
    (tmp_path / "secret").mkdir()
    (tmp_path / "secret/model.sdf").write_text(BIN)
    file = world(tmp_path / "in")
    file.write_text(WORLD.replace("model://bin", "../secret"))
    assert ("../secret", "a model that is not beside it or below") in read(file).left_out
    file.write_text(WORLD.replace('attached_to="post"', 'attached_to="leaf"'))
    with pytest.raises(InputError, match="relative to itself"):
        read(file)
    file.write_text('<!DOCTYPE a [<!ENTITY b "b">]>' + WORLD)
    with pytest.raises(InputError, match="entities"):
        read(file)


@pytest.mark.parametrize("count", [60, pytest.param(10_000, marks=pytest.mark.soak)])
def test_damaged_worlds_are_parts_or_a_sentence(tmp_path, count):
    rng, file = random.Random(count), world(tmp_path / "in")
    outcomes = set()
    for _ in range(count):
        file.write_bytes(mutated(WORLD.encode(), rng))
        try:
            found = read(file)
        except InputError:
            outcomes.add("refused")
            continue
        outcomes.add("read")
        for instance in found.instances:
            assert np.isfinite(instance.world_from_shape).all()
    assert outcomes == {"read", "refused"}
