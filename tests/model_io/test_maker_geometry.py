"""The maker's shapes on the library's figures, though the two put their link frames differently."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from oracles import numpy_dynamics
from seerob.core.errors import InputError
from seerob.description.loader import load_robot
from seerob.description.robots import library

UR10 = "package:example-robot-data/robots/ur_description/urdf/ur10_robot.urdf"


@cache
def dressed_ur10():
    return load_robot("library:ur10", folder=Path(), meshes=UR10, name="left")


def test_every_vertex_is_where_the_maker_puts_it():
    dressed = dressed_ur10()
    maker = load_robot(UR10, folder=Path())
    rng = np.random.default_rng(2)
    for q in rng.uniform(-3, 3, (3, 6)):
        ours, _ = numpy_dynamics.kinematics(dressed, q)
        theirs, _ = numpy_dynamics.kinematics(maker, q)
        for link in maker.links:
            if link.name == "ee_link" or not link.solids:
                continue
            here = dressed.link(link.name).solids[0].mesh.vertices @ ours[link.name][0][:3, :3].T
            there = link.solids[0].mesh.vertices @ theirs[link.name][0][:3, :3].T
            here, there = here + ours[link.name][0][:3, 3], there + theirs[link.name][0][:3, 3]
            # The releases differ by 0.25 µm in the place of wrist_1.
            np.testing.assert_allclose(here, there, atol=1e-6)


def test_figures_stay_the_librarys_and_shapes_are_the_makers():
    dressed, plain = dressed_ur10(), library.load("ur10")
    for link, before in zip(dressed.links, plain.links, strict=True):
        assert (link.name, link.parent) == (before.name, before.parent)
        assert (link.inertial is None) == (before.inertial is None)
        assert not any("envelope" in solid.note for solid in link.solids)
    said = [f.text for f in dressed.findings]
    assert not any("envelope" in text for text in said)
    assert any("shapes of ee_link" in text for text in said)
    assert any("3.4 mm" in text for text in said)
    assert not dressed.link("base_link_inertia").solids
    assert dressed.link("base_link").solids
    assert set(plain.files) < set(dressed.files)


@pytest.mark.parametrize(
    ("meshes", "words"),
    [
        (UR10.replace("ur10", "ur5"), "differently from library:ur10"),
        ("package:example-robot-data/robots/panda_description/urdf/panda.urdf", "no joint in common"),
    ],
)
def test_another_robots_shapes_are_refused(meshes, words):
    with pytest.raises(InputError, match=words):
        load_robot("library:ur10", folder=Path(), meshes=meshes)


def test_links_without_a_namesake_keep_their_envelope(tmp_path):
    text = """<robot name="r"><link name="base_link"/><link name="shoulder_link"><visual><geometry>
    <box size="0.1 0.1 0.1"/></geometry></visual></link>
    <joint name="shoulder_pan_joint" type="continuous">
    <axis xyz="0 0 1"/>
    <parent link="base_link"/><child link="shoulder_link"/><origin xyz="0 0 0.1273"/></joint>
    </robot>"""
    (tmp_path / "r.urdf").write_text(text)
    dressed = load_robot("library:ur10", folder=tmp_path, meshes="r.urdf")
    (finding,) = [f for f in dressed.findings if "the envelope stays there" in f.text]
    assert "forearm_link" in finding.text
    assert "shoulder_link" not in finding.text
    assert any("envelope made by seerob" in f.text for f in dressed.findings)


def test_a_display_mesh_of_the_maker_that_cannot_be_read_holds_the_robot(tmp_path):
    """The envelope had room for it; the maker's collision shape, which takes its place, need not."""
    text = """<robot name="r"><link name="base_link"/><link name="shoulder_link">
    <visual><geometry><mesh filename="gone.stl"/></geometry></visual>
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
    <joint name="shoulder_pan_joint" type="continuous">
    <axis xyz="0 0 1"/>
    <parent link="base_link"/><child link="shoulder_link"/><origin xyz="0 0 0.1273"/></joint>
    </robot>"""
    (tmp_path / "r.urdf").write_text(text)
    dressed = load_robot("library:ur10", folder=tmp_path, meshes="r.urdf", name="left")
    held = [(f.subject, f.holds) for f in dressed.findings if "left out of pictures" in f.text]
    assert held == [("left/shoulder_link", ("left",))]
