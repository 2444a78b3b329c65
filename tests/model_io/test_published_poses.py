"""Kinematics of the library against what Pinocchio read from the published files: facts in a table."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seerob.description.description import base_from_links
from seerob.description.robots import library

FACTS = tomllib.loads(Path(__file__).with_name("published_poses.toml").read_text())
BEFORE = {"doosan_m1013", "iiwa14", "iiwa7", "niryo_one"} | {
    f"ur{n}" for n in ("10", "10e", "16e", "3", "3e", "5", "5e")
}
"""Compared elsewhere: with published vectors, and with the descriptions of example-robot-data."""


def test_every_arm_has_poses():
    assert set(FACTS) | BEFORE == set(library.names())


@pytest.mark.parametrize("name", FACTS)
def test_the_flange_is_where_the_published_file_has_it(name):
    robot = library.load(name)
    assert robot.tip == FACTS[name]["tip"]
    names = [joint.name for joint in robot.joints()]
    for pose in FACTS[name]["poses"]:
        found = base_from_links(robot, dict(zip(names, pose["q"], strict=True)))[robot.tip]
        np.testing.assert_allclose(found[:3, 3], pose["position"], atol=2e-8)
        w, x, y, z = pose["quaternion"]
        turned = Rotation.from_quat([x, y, z, w]).as_matrix()
        np.testing.assert_allclose(found[:3, :3], turned, atol=2e-8)


@pytest.mark.parametrize("name", sorted(set(library.names()) - BEFORE))
def test_every_figure_names_repository_commit_and_licence(name):
    entry, robot = library.entry(name), library.load(name)
    assert entry.maker
    sources = {robot.source.partition("(")[2]}
    sources |= {link.inertial.source for link in robot.links if link.inertial is not None}
    for joint in robot.joints():
        sources |= {q.source for q in (joint.velocity, joint.effort) if q is not None}
    for source in sources:
        repository, commit, rest = source.split(" ", 2)
        assert repository.count("/") == 1
        assert len(commit) == 12
        assert int(commit, 16)
        assert rest.startswith("(")
