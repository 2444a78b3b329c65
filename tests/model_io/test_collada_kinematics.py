"""COLLADA 1.5: robots of a foreign writer against a foreign reader and by the norm's own ways."""

import random
import tomllib
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.core.errors import InputError
from seerob.core.transforms import rotation_from_rpy, transform
from seerob.description.cad import scene
from seerob.description.description import base_from_links
from seerob.description.formats.urdf_writing import rpy_from_rotation, written
from seerob.description.loader import load_robot
from soak.mutations import mutated

FILES = Path(__file__).parent / "files"
"""``arm.dae`` is what `urdf_to_collada` of ROS makes of ``arm.urdf``."""

TURNED = """<COLLADA xmlns="http://www.collada.org/2008/03/COLLADASchema" version="1.5.0">
<asset><unit meter="0.001"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="12">
0 0 0 100 0 0 0 100 0 0 0 100</float_array><technique_common><accessor source="#a" count="4" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">
<node id="floor"><translate>5000 0 0</translate>
<instance_geometry url="#g"/></node>
<node id="post"><translate>1000 0 0</translate><instance_geometry url="#g"/>
 <node id="door"><translate>0 200 0</translate><rotate sid="hinge">0 0 1 90</rotate>
<instance_geometry url="#g"/></node>
 <node id="gear"><translate>0 0 500</translate><rotate sid="hinge">0 0 1 0</rotate>
<instance_geometry url="#g"/></node>
</node></visual_scene></library_visual_scenes>
<library_joints><joint id="turn" sid="turn"><revolute sid="axis"><axis>0 0 1</axis>
<limits><min>0</min><max>120</max></limits></revolute></joint></library_joints>
<library_kinematics_models><kinematics_model id="m" name="gate"><technique_common>
<instance_joint url="#turn" sid="one"/><instance_joint url="#turn" sid="two"/>
<link sid="post"><attachment_full joint="m/one">
<translate>0 200 0</translate><link sid="leaf"/></attachment_full>
<attachment_full joint="m/two"><translate>0 0 500</translate><link sid="wheel"/></attachment_full></link>
<formula sid="f"><target><param>m/two</param></target><technique_common><math><apply><plus/><apply><times/>
<cn>-2</cn><csymbol>m/one</csymbol></apply><cn>0.5</cn></apply></math></technique_common></formula>
</technique_common></kinematics_model></library_kinematics_models>
<library_physics_models><physics_model id="pm"><rigid_body sid="leaf"><technique_common><mass>4</mass>
<mass_frame><translate>10 0 0</translate></mass_frame>
<inertia>9e4 9e4 9e4</inertia></technique_common></rigid_body>
</physics_model></library_physics_models>
<library_kinematics_scenes><kinematics_scene id="ks">
<instance_kinematics_model url="#m" sid="mi"/></kinematics_scene>
</library_kinematics_scenes>
<scene><instance_visual_scene url="#s"/><instance_kinematics_scene url="#ks">
<bind_joint_axis target="door/hinge"><axis><param>mi/one/axis</param></axis>
<value><float>90</float></value></bind_joint_axis>
<bind_joint_axis target="gear/hinge"><axis><SIDREF>mi/two/axis</SIDREF></axis>
<value><float>0</float></value></bind_joint_axis>
</instance_kinematics_scene></scene></COLLADA>"""


def imported(file, folder):
    assert cli.main(["import", str(file), str(folder)]) == Exit.WITHIN
    assert cli.main(["check-file", str(folder)]) == Exit.WITHIN
    return tomllib.loads((folder / "workstation.toml").read_text())


def test_a_robot_of_a_foreign_writer_moves_and_weighs_as_the_one_it_was_made_of(tmp_path):
    pinocchio = pytest.importorskip("pinocchio")
    (robot,) = imported(FILES / "arm.dae", tmp_path / "cell")["robots"]
    ours = load_robot(robot["model"], folder=tmp_path / "cell")
    theirs = pinocchio.buildModelFromUrdf(str(FILES / "arm.urdf"))
    data = theirs.createData()
    assert [joint.name for joint in ours.joints()] == list(theirs.names)[1:]
    for q in np.random.default_rng(3).uniform(-0.1, 0.2, (20, 2)):
        pinocchio.framesForwardKinematics(theirs, data, q)
        poses = base_from_links(ours, dict(zip(("shoulder", "reach"), q, strict=True)))
        for name in ("upper", "slide", "flange"):
            frame = data.oMf[theirs.getFrameId(name)].homogeneous
            assert poses[name] == pytest.approx(frame, abs=1e-12)
    for number, name in ((1, "upper"), (2, "slide")):
        inertial, peer = ours.link(name).inertial, theirs.inertias[number]
        assert inertial.mass == pytest.approx(peer.mass)
        assert inertial.com == pytest.approx(peer.lever, abs=1e-12)
        assert inertial.inertia == pytest.approx(peer.inertia, abs=1e-9)
    low, high = theirs.lowerPositionLimit, theirs.upperPositionLimit
    assert [j.lower for j in ours.joints()] == pytest.approx(low)
    assert [j.upper for j in ours.joints()] == pytest.approx(high)
    assert [j.velocity.value for j in ours.joints()] == pytest.approx(list(theirs.velocityLimit))
    box = ours.link("slide").solids[0].mesh.vertices
    assert box.min(axis=0) == pytest.approx([0, -0.02, -0.02], abs=1e-6)
    assert box.max(axis=0) == pytest.approx([0.2, 0.02, 0.02], abs=1e-6)


@pytest.mark.parametrize("packed", [False, True])
def test_joints_by_the_norm_in_millimetres_shown_open_beside_parts_that_stand(tmp_path, packed):
    file = tmp_path / ("gate.zae" if packed else "gate.dae")
    file.write_text(TURNED)
    if packed:
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("inner.dae", TURNED)
    table = imported(file, tmp_path / "cell")
    (robot,), (part,) = table["robots"], table["parts"]
    assert part["name"] == "floor"
    assert part["at"]["position"] == [5, 0, 0]
    assert robot["base"]["position"] == pytest.approx([1, 0, 0])
    assert robot["q"] == pytest.approx([np.pi / 2])
    gate = load_robot(robot["model"], folder=tmp_path / "cell")
    leaf, wheel = gate.link("leaf"), gate.link("wheel")
    assert leaf.joints[0].upper == pytest.approx(np.radians(120))
    assert wheel.joints[0].mimic.multiplier == -2
    assert wheel.joints[0].mimic.offset == 0.5
    assert leaf.inertial.mass == 4
    assert leaf.inertial.com == pytest.approx([0.01, 0, 0])
    assert leaf.inertial.inertia == pytest.approx(0.09 * np.eye(3))
    # The leaf is shown turned by 90°; its own shape is that of the geometry.
    assert leaf.solids[0].mesh.vertices.max(axis=0) == pytest.approx([0.1, 0.1, 0.1])
    opened = base_from_links(gate, {leaf.joints[0].name: np.pi / 2})["leaf"]
    assert opened @ [0.1, 0, 0, 1] == pytest.approx([0, 0.3, 0, 1], abs=1e-9)


def test_angles_of_a_rotation_make_it_again_where_a_pitch_of_90_degrees_locks_two_of_them():
    rng = np.random.default_rng(5)
    for pitch in (0.3, np.pi / 2, np.pi / 2 - 1e-9, -np.pi / 2 + 1e-7, 2.5):
        for roll, yaw in rng.uniform(-3, 3, (20, 2)):
            rotation = rotation_from_rpy([roll, pitch, yaw])
            again = rotation_from_rpy(rpy_from_rotation(rotation))
            assert np.abs(again - rotation).max() < 1e-14


def test_an_axis_beside_the_origin_of_its_link_is_written_with_a_link_between(tmp_path):
    arm = load_robot("arm.urdf", folder=FILES)
    links = list(arm.links)
    shifted = replace(links[1].joints[0], anchor=np.array([0.1, 0.2, 0.3]))
    two = (shifted, replace(links[2].joints[0], name="second"))
    links[1] = replace(links[1], joints=two, parent_from_link=transform(position=[0, 0, 1]))
    made = replace(arm, links=tuple(links))
    text, files = written(made)
    (tmp_path / "meshes").mkdir()
    (tmp_path / "a.urdf").write_text(text)
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    again = load_robot("a.urdf", folder=tmp_path)
    q = {"shoulder": 0.7, "second": 0.1, "reach": -0.05}
    there, here = base_from_links(again, q), base_from_links(made, q)
    for name, pose in here.items():
        assert there[name] == pytest.approx(pose, abs=1e-12)


@pytest.mark.parametrize("count", [40, pytest.param(10_000, marks=pytest.mark.soak)])
def test_damaged_kinematics_are_links_or_a_sentence(tmp_path, count):
    rng = random.Random(count)
    path = tmp_path / "a.dae"
    read = 0
    for _ in range(count):
        path.write_bytes(mutated(TURNED.encode(), rng))
        try:
            found = scene.read(path, ".dae")
        except InputError:
            continue
        read += 1
        for moving in found.mechanisms:
            for link in moving.description.links:
                assert np.isfinite(link.parent_from_link).all()
    assert 0 < read < count
