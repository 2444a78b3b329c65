"""What bounds a stop by table that begins within a span, in closed form."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.criteria.stopping.in_span import grown, reach_of
from seerob.criteria.stopping.onset import KinematicChain


@pytest.mark.parametrize(
    ("turns", "levers", "half", "expected"),
    [
        # Each lever but the last grows by what the joints farther out can move the part.
        ((True, True, True), (2.0, 1.0, 0.5), (0.3, 0.2, 0.1), (2.26, 1.05, 0.5)),
        ((True, False, True), (2.0, 9.0, 0.5), (0.3, 0.2, 0.1), (2.25, 9.05, 0.5)),
        ((True,), (0.7,), (0.4,), (0.7,)),
    ],
)
def test_levers_grow_by_what_joints_farther_out_can_move(turns, levers, half, expected):
    k = len(turns)
    chain = KinematicChain(np.array(turns), np.arange(k), np.array(levers))
    np.testing.assert_allclose(grown(chain, np.array(half)).levers, expected, rtol=1e-12)
    np.testing.assert_array_equal(chain.levers, levers)


def test_no_pose_within_the_span_has_a_longer_lever():
    """Planar arms of three joints, each anywhere within half its way; at least once nearly as long."""
    rng, tightest = np.random.default_rng(0), 0.0
    for _ in range(300):
        lengths, half = rng.uniform(0.2, 1.0, 3), rng.uniform(0.0, 0.4, 3)
        q = rng.uniform(-np.pi, np.pi, 3)

        def far(q, lengths=lengths):
            angles = np.cumsum(q)
            steps = lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            return np.linalg.norm(np.cumsum(steps[::-1], axis=0)[::-1], axis=1)

        bound = grown(KinematicChain(np.ones(3, bool), np.arange(3), far(q)), half).levers
        met = np.max([far(q + half * rng.uniform(-1, 1, 3)) for _ in range(60)], axis=0)
        assert (met <= bound + 1e-12).all()
        tightest = max(tightest, float((met[0] - far(q)[0]) / max(bound[0] - far(q)[0], 1e-9)))
    assert tightest > 0.6


@pytest.mark.parametrize(
    ("q", "expected"), [((0.0, 0.0), 2.0), ((0.7, np.pi / 2), np.sqrt(2.0)), ((0.3, np.pi), 0.0)]
)
def test_the_flange_is_as_far_from_the_first_axis_as_the_arm_is_stretched(tmp_path, q, expected):
    text = f"{FLOATING}{TWO_R}base = {{ position = [0.5, -0.3, 0.2], rpy = [0.3, 0, 1] }}\n"
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    robot, data = station.model.robot("arm"), mujoco.MjData(station.model.mj)
    data.qpos[robot.q_address] = q
    mujoco.mj_kinematics(station.model.mj, data)
    assert reach_of(data, station.model, robot) == pytest.approx(expected, abs=1e-9)
