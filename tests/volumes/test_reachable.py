"""Reachable volumes: nothing in the limits is missed, closed forms."""

import mujoco
import numpy as np
import pytest

from made_cell import TWO_R, made, two_r
from made_sweep import inside, outside, points_of
from seerob.core.errors import InputError
from seerob.model.volumes.reachable import reachable_volume

SLIDE = """<robot name="arm"><link name="base"/><link name="a"><collision><geometry><box size="1 1 1"/></geometry>
</collision></link><joint name="j" type="prismatic"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
<limit effort="1" velocity="1"/></joint></robot>"""
# ruff: noqa: E501
LIMITED = """<robot name="arm"><link name="base"/>
<link name="a"><collision><origin xyz="0.3 0 0"/><geometry><box size="0.6 0.08 0.08"/></geometry></collision></link>
<link name="b"><collision><origin xyz="0.2 0 0" rpy="0 1.5708 0"/><geometry><cylinder radius="0.05" length="0.4"/>
</geometry></collision></link>
<link name="c"><collision><origin xyz="0.1 0 0.03"/><geometry><sphere radius="0.06"/></geometry></collision></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
<limit lower="-0.6" upper="1.1" effort="1" velocity="1"/></joint>
<joint name="j2" type="{kind}"><parent link="a"/><child link="b"/><origin xyz="0.6 0 0" rpy="0 0.2 0"/>
<axis xyz="0 1 0"/>{range}</joint>
<joint name="j3" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0.4 0 0"/><axis xyz="1 0 0"/>
<limit lower="-0.05" upper="0.15" effort="1" velocity="1"/></joint></robot>"""


def limited(folder, kind="revolute", limits='<limit lower="-1" upper="0.7" effort="1" velocity="1"/>'):
    text = LIMITED.replace("{kind}", kind).replace("{range}", limits)
    return made(folder, TWO_R, {"arm.urdf": text}).model


@pytest.mark.parametrize(
    "more", [(), ("continuous", '<limit effort="1" velocity="1"/>')], ids=["limits", "whole turn"]
)
def test_nothing_within_the_limits_is_outside(tmp_path, more):
    model = limited(tmp_path, *more)
    reach = reachable_volume(model, model.select("arm"), voxel=0.04)
    rng = np.random.default_rng(0)
    assert outside(model, reach.grid.contains, 60, rng) == 0
    mesh = reach.mesh()
    assert outside(model, lambda p: inside(mesh, p), 2, rng) == 0


def test_joint_that_is_not_there_yet_is_not_reached(tmp_path):
    """Behind the base, opposite to the limits of the first joint, is free."""
    model = limited(tmp_path)
    reach = reachable_volume(model, model.select("arm"), voxel=0.02)
    behind = np.column_stack([np.full(50, -0.3), np.linspace(-1, 1, 50), np.zeros(50)])
    assert not reach.grid.contains(behind).any()


def test_planar_arm_reaches_a_disc_and_finer_voxels_come_nearer(tmp_path):
    """Two links of 1 m × 0.1 m × 0.1 m that turn freely: a disc of 2 m, and the rims of the corners."""
    model = made(tmp_path, TWO_R, {"arm.urdf": two_r()}).model
    disc = np.pi * (1 + np.hypot(1, 0.05)) ** 2 * 0.1
    volumes = [reachable_volume(model, model.select("arm"), voxel=v).volume for v in (0.06, 0.03)]
    assert disc < volumes[1] < volumes[0]
    assert volumes[1] < np.pi * (2 + 5 * 0.03) ** 2 * (0.1 + 5 * 0.03)


def test_whole_ur10_with_its_tool_is_within_the_sum_of_its_lengths(tmp_path):
    model = made(tmp_path, '[[robots]]\nname = "arm"\nmodel = "library:ur10"\n').model
    shares = []
    reach = reachable_volume(model, model.select("arm"), voxel=0.06, progress=shares.append)
    assert outside(model, reach.grid.contains, 100, np.random.default_rng(2)) == 0
    _, high = reach.grid.bounds()
    assert 1.1 < (high[0] + 1) * 0.06 < 2.2
    assert shares == sorted(shares)
    assert shares[-1] == 1


def farthest_from_reach(model, points, count, rng):
    """Distance of points to the nearest of many random points that the arm does reach, shape (n,) [m]."""
    from scipy.spatial import cKDTree

    mechanism = model.mechanism("arm")
    data, found = mujoco.MjData(model.mj), []
    low, high = np.maximum(mechanism.lower, -np.pi), np.minimum(mechanism.upper, np.pi)
    for _ in range(count):
        data.qpos[mechanism.q_address] = mechanism.coupling @ rng.uniform(low, high) + mechanism.offset
        mujoco.mj_kinematics(model.mj, data)
        for i in model.select("arm"):
            body = model.bodies[i]
            for solid in body.solids:
                found.append(
                    points_of(solid, 20, rng) @ data.xmat[body.mj].reshape(3, 3).T + data.xpos[body.mj]
                )
    return cKDTree(np.vstack(found)).query(points)[0]


def nearest_pose(model, point, rng):
    """Distance of a point to the arm in the best of many poses, each a small step from the best so far [m]."""
    mechanism, data = model.mechanism("arm"), mujoco.MjData(model.mj)
    low, high = np.maximum(mechanism.lower, -np.pi), np.minimum(mechanism.upper, np.pi)
    bodies = [model.bodies[i] for i in model.select("arm")]
    clouds = [np.vstack([points_of(solid, 1500, rng) for solid in body.solids]) for body in bodies]

    def distance(q):
        data.qpos[mechanism.q_address] = mechanism.coupling @ q + mechanism.offset
        mujoco.mj_kinematics(model.mj, data)
        at = [(point - data.xpos[b.mj]) @ data.xmat[b.mj].reshape(3, 3) for b in bodies]
        return min(np.linalg.norm(c - x, axis=1).min() for c, x in zip(clouds, at, strict=True))

    poses = rng.uniform(low, high, (150, len(low)))
    best, q = min((distance(q), tuple(q)) for q in poses)
    for step in np.geomspace(0.5, 0.01, 200):
        tried = np.clip(q + rng.normal(size=len(q)) * step, low, high)
        best, q = min((best, tuple(q)), (distance(tried), tuple(tried)))
    return best


@pytest.mark.parametrize(
    "more", [(), ("continuous", '<limit effort="1" velocity="1"/>')], ids=["limits", "whole turn"]
)
def test_no_voxel_is_farther_from_the_reach_than_the_excess_says(tmp_path, more):
    model = limited(tmp_path, *more)
    reach = reachable_volume(model, model.select("arm"), voxel=0.04)
    rng, centres = np.random.default_rng(3), reach.grid.centres()
    farthest = farthest_from_reach(model, centres, 150, rng)
    # Random poses are sparse at the border: for the worst voxels the nearest pose is looked for.
    found = [nearest_pose(model, centres[k], rng) for k in farthest.argsort()[-2:]]
    assert max(found) < reach.excess < 4 * 0.04


def test_whole_ur10_is_as_wide_as_random_poses_reach_and_a_voxel_or_two(tmp_path):
    """Within 0.1 m, where sweeping all joints in voxels of the size asked for is off by 0.6 m."""
    model = made(tmp_path, '[[robots]]\nname = "arm"\nmodel = "library:ur10"\n').model
    reach = reachable_volume(model, model.select("arm"), voxel=0.05)
    low, high = reach.grid.bounds()
    # Stretched out level: 0.612 + 0.572 m and the wrist's 0.116 m, at right angles to them 0.115 m and more.
    assert 1.3 < (high[0] + 1) * 0.05 < 1.56
    assert -1.56 < low[1] * 0.05 < -1.3


def test_slide_without_limits_is_refused(tmp_path):
    text = SLIDE
    model = made(tmp_path, TWO_R, {"arm.urdf": text}).model
    with pytest.raises(InputError, match="slides has no limits"):
        reachable_volume(model, model.select("arm"), voxel=0.05)


def test_stopped_is_nothing(tmp_path):
    model = limited(tmp_path)
    assert reachable_volume(model, model.select("arm"), voxel=0.05, stop=lambda: True) is None


def turned(points, anchor, axis, angle):
    """Points (n, 3) turned about an axis by an angle each, Rodrigues' formula."""
    x, c, s = points - anchor, np.cos(angle)[:, None], np.sin(angle)[:, None]
    return anchor + x * c + np.cross(axis, x) * s + axis * ((x @ axis)[:, None] * (1 - c))


def test_a_hundred_thousand_poses_of_a_ur10_are_inside_and_the_excess_is_a_few_voxels(tmp_path):
    """Points of every link, posed by products of screws; no voxel is said to be farther than 0.21 m off."""
    model = made(tmp_path, '[[robots]]\nname = "arm"\nmodel = "library:ur10"\n').model
    reach = reachable_volume(model, model.select("arm"), voxel=0.05)
    assert reach.excess < 0.21
    rng = np.random.default_rng(11)
    robot, data = model.robot("arm"), mujoco.MjData(model.mj)
    mujoco.mj_kinematics(model.mj, data)
    count = 100_000 // len(robot.moving)
    joints = [int(np.flatnonzero(model.mj.jnt_qposadr == a)[0]) for a in robot.q_address]
    for index in robot.moving:
        body = model.bodies[index]
        solid = body.solids[rng.integers(len(body.solids))]
        points = points_of(solid, count, rng) @ data.xmat[body.mj].reshape(3, 3).T + data.xpos[body.mj]
        chain = [j for j in joints if body.mj in descendants(model.mj, int(model.mj.jnt_bodyid[j]))]
        for j in reversed(chain):
            points = turned(points, data.xanchor[j], data.xaxis[j], rng.uniform(-np.pi, np.pi, count))
        assert reach.grid.contains(points).all()


def descendants(mj, body):
    """A body and all that hangs on it."""
    found = {body}
    for i in range(body + 1, mj.nbody):
        if int(mj.body_parentid[i]) in found:
            found.add(i)
    return found
