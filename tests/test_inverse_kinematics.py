"""Cartesian targets: reached where they can be, near the start, within the limits."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, hinge_limits, made, two_r
from seerob.core.transforms import rotation_from_rpy
from seerob.twin.control.inverse_kinematics import _rotation_vector, solve_pose


def placed(station, name, q):
    data, mechanism = mujoco.MjData(station.model.mj), station.model.mechanism(name)
    data.qpos[mechanism.q_address] = mechanism.coupling @ q + mechanism.offset
    mujoco.mj_kinematics(station.model.mj, data)
    tip = mechanism.tip
    R = data.xmat[tip.mj].reshape(3, 3)
    return R @ tip.body_from_frame[:3, :3], data.xpos[tip.mj] + R @ tip.body_from_frame[:3, 3]


def solved(station, name, rotation, position, start):
    mechanism = station.model.mechanism(name)
    scratch = mujoco.MjData(station.model.mj)
    return solve_pose(
        station.model.mj, scratch, mechanism, mechanism.tip, rotation, position, start=np.array(start)
    )


@pytest.mark.parametrize("name", ["ur10", "ur5e", "iiwa14", "doosan_m1013", "niryo_one"])
def test_poses_of_random_joint_positions_are_reached_from_nearby(tmp_path, name):
    station = made(tmp_path, f'[[robots]]\nname = "arm"\nmodel = "library:{name}"\n')
    low, high = hinge_limits(station, "arm")
    rng = np.random.default_rng(0)
    for _ in range(25):
        q = rng.uniform(0.8 * low, 0.8 * high)
        rotation, position = placed(station, "arm", q)
        start = np.clip(q + rng.uniform(-0.05, 0.05, len(q)), low, high)
        found, miss = solved(station, "arm", rotation, position, start)
        R, p = placed(station, "arm", found)
        assert miss.larger < 1e-6
        assert np.linalg.norm(p - position) < 1e-6
        assert np.abs(R - rotation).max() < 1e-6
        assert (found >= low - 1e-12).all()
        assert (found <= high + 1e-12).all()


def test_mimic_joints_follow(tmp_path):
    follow = '<mimic joint="j1" multiplier="2" offset="0.1"/>'
    station = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r(mimic=follow)})
    rotation, position = placed(station, "arm", np.array([0.7]))
    found, miss = solved(station, "arm", rotation, position, [0.5])
    assert miss.larger < 1e-9
    assert found == pytest.approx([0.7])


def test_out_of_reach_tells_how_far_off(tmp_path):
    station = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()})
    rotation, _ = placed(station, "arm", np.zeros(2))
    found, miss = solved(station, "arm", rotation, np.array([3.0, 0, 0]), [0.01, -0.01])
    assert 0.99 < miss.distance < 1.2
    assert f"{miss.distance:.3g} m and" in str(miss)
    assert np.isfinite(found).all()


def test_a_limit_is_not_passed_to_reach_a_pose(tmp_path):
    urdf = two_r().replace('type="continuous"', 'type="revolute"')
    urdf = urdf.replace('velocity="10"', 'velocity="10" lower="-1" upper="1"')
    station = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": urdf})
    rotation, position = placed(station, "arm", np.array([1.4, 0.2]))
    found, miss = solved(station, "arm", rotation, position, [0.9, 0.2])
    assert (np.abs(found) <= 1).all()
    assert miss.larger > 0.1


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.3, 3.0, np.pi - 1e-7, np.pi])
def test_rotation_vector_is_the_logarithm(angle):
    axis = np.array([2.0, -1.0, 2.0]) / 3
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    R = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    found = _rotation_vector(R)
    if angle == pytest.approx(np.pi, abs=1e-6):
        assert np.linalg.norm(found) == pytest.approx(np.pi, abs=1e-6)
        assert abs(found @ axis) == pytest.approx(np.pi, abs=1e-4)
    else:
        np.testing.assert_allclose(found, angle * axis, atol=1e-9)
    half_turn = _rotation_vector(rotation_from_rpy((np.pi, 0, 0)))
    np.testing.assert_allclose(np.abs(half_turn), [np.pi, 0, 0], atol=1e-9)
