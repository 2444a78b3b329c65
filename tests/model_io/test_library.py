"""The library against independent dynamics and published vectors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from oracles import pinocchio_oracle as oracle
from seerob.core.errors import UnknownName
from seerob.core.snapshot import Origin
from seerob.core.transforms import transform
from seerob.description.description import Description, Joint, JointKind, Link, base_from_links
from seerob.description.loader import load_robot
from seerob.description.robots import library
from seerob.description.robots.farthest import farthest

RNG = np.random.default_rng(7)


def test_an_unknown_robot_names_the_known_ones():
    with pytest.raises(UnknownName, match="did you mean 'ur10'"):
        library.load("ur1O")


@pytest.mark.parametrize("name", library.names())
def test_every_robot_is_a_tree_with_sourced_figures(name):
    robot = load_robot(f"library:{name}", folder=Path(), name="r")
    seen: set[str] = set()
    for link in robot.links:
        assert (link.parent is None) == (not seen)
        assert link.parent is None or link.parent in seen
        assert link.name not in seen
        seen.add(link.name)
        np.testing.assert_allclose(
            link.parent_from_link[:3, :3] @ link.parent_from_link[:3, :3].T, np.eye(3), atol=1e-12
        )
    assert robot.tip in seen
    for link in robot.links:
        if link.inertial:
            rough = link.inertial.error > 0 and link.inertial.within > 0  # told by intervals alone
            assert link.inertial.origin is (Origin.ESTIMATED if rough else Origin.STATED)
            assert link.inertial.source
            moments = np.linalg.eigvalsh(link.inertial.inertia)
            assert moments[0] > 0
            assert moments[0] + moments[1] >= moments[2]
    assert all(joint.armature is None for joint in robot.joints())
    assert any("envelope made by seerob" in finding.text for finding in robot.findings)
    assert all("envelope made by seerob" in solid.note for link in robot.links for solid in link.solids)


# Facts: sums of the moving links of the source's physical_parameters, no payload.
MOVING_MASS = {"ur5e": 17.7, "ur10e": 29.104, "ur5": 17.0489, "ur10": 28.435, "ur3e": 8.7985, "ur16e": 27.26}


@pytest.mark.parametrize(("name", "mass"), MOVING_MASS.items())
def test_moving_mass_of_universal_robots(name, mass):
    robot = library.load(name)
    moving = {
        "shoulder_link",
        "upper_arm_link",
        "forearm_link",
        "wrist_1_link",
        "wrist_2_link",
        "wrist_3_link",
    }
    assert sum(link.inertial.mass for link in robot.links if link.name in moving) == pytest.approx(
        mass, abs=1e-9
    )


def test_ur5e_reference_vectors():
    """Two independent codes agree on these (iso_15066 facts, 7.3), in the controller's ``base`` frame."""
    robot = library.load("ur5e")
    model = oracle.pinocchio_model(robot)
    q = np.radians([0, -90, 90, -90, -90, 0])
    base_from_tip = np.linalg.inv(oracle.pose(model, q, "base")) @ oracle.pose(model, q, "wrist_3_link")
    np.testing.assert_allclose(base_from_tip[:3, 3], [-0.4919, -0.1333, 0.4879], atol=5e-5)
    J = oracle.jacobian(model, q, "wrist_3_link")
    J_v = J[:3]
    np.testing.assert_allclose(
        np.linalg.svd(J_v, compute_uv=False), [0.722549, 0.525229, 0.302173], atol=5e-7
    )
    assert np.sqrt(np.linalg.det(J_v @ J_v.T)) == pytest.approx(0.114676, abs=5e-7)
    assert abs(np.linalg.det(J)) == pytest.approx(0.081992, abs=5e-7)
    M = oracle.mass_matrix(model, q)
    np.testing.assert_allclose(np.diag(M), [1.01325, 2.34754, 0.83613, 0.02519, 0.00618, 0.00013], atol=5e-6)
    inverse_Lambda = J_v @ np.linalg.solve(M, J_v.T)
    np.testing.assert_allclose(1 / np.diag(inverse_Lambda), [1.5858, 0.6219, 2.3674], atol=5e-5)
    np.testing.assert_allclose(
        np.linalg.eigvalsh(np.linalg.inv(inverse_Lambda)), [0.6219, 1.1672, 5.0954], atol=5e-5
    )
    qd = np.radians([30, -20, 40, 10, 0, 0])
    assert oracle.kinetic_energy(model, q, qd) == pytest.approx(0.370339, abs=5e-7)
    assert np.linalg.norm(J_v @ qd) == pytest.approx(0.418520, abs=5e-7)


@pytest.mark.parametrize("name", [name for name in library.names() if name.startswith("lbr_iisy")])
def test_a_reach_that_is_computed_is_that_of_a_maker_who_measures_to_the_flange(name):
    robot, said = library.load(name), library.entry(name).reach
    assert farthest(robot) == pytest.approx(said.value, abs=1e-3)


def test_no_position_reaches_farther_than_what_is_computed_nor_one_of_a_plane_arm_less():
    rng = np.random.default_rng(2)
    for name in ("ur10", "fr3", "niryo_one"):
        robot = library.load(name)
        joints, most = robot.joints(), 0.0
        for _ in range(200):
            q = {joint.name: rng.uniform(joint.lower, joint.upper) for joint in joints}
            poses = base_from_links(robot, q)
            x, y, _ = poses[robot.tip][:3, 3]
            most = max(most, np.hypot(x, y))
        assert 0.5 * farthest(robot) < most < farthest(robot)
    # Three links of 0.4, 0.3 and 0.2 m about parallel axes; the second elbow may not be straighter than 90°.
    links = [Link("base", None, np.eye(4))]
    for k, (length, low) in enumerate([(0.0, -3.0), (0.4, -3.0), (0.3, 0.5 * np.pi)]):
        joint = Joint(f"j{k}", JointKind.REVOLUTE, np.array([0, 0, 1.0]), lower=low, upper=3.0)
        links.append(Link(f"l{k}", links[-1].name, transform(position=(length, 0, 0)), (joint,)))
    links.append(Link("tip", "l2", transform(position=(0.2, 0, 0))))
    arm = Description("plane", tuple(links), tip="tip", source="made here")
    assert farthest(arm) == pytest.approx(0.4 + np.hypot(0.3, 0.2), abs=1e-6)
