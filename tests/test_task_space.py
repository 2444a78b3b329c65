"""Poses of a tool drive the robot: reached exactly, or UNDECIDED."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pytest

from made_cell import UR10, heard, made, wave
from seerob.core.errors import Undecided
from seerob.core.samples import PoseSample
from seerob.twin.engine import Engine


@pytest.fixture(scope="module")
def ur10(tmp_path_factory):
    return made(tmp_path_factory.mktemp("ur10"), UR10)


@pytest.mark.parametrize(("target", "frame"), [("arm", "arm"), ("arm/tool0", "arm/tool0"), ("load", "load")])
def test_poses_drive_the_robot_exactly(ur10, target, frame):
    """Poses of a joint motion, made here, played back: the frame is where they say."""
    model = ur10.model
    made_by = Engine(model, controllers=False)
    frames = model.frame(frame)
    poses = []
    for k in range(31):
        made_by._put(model.robot("arm"), wave(0.01 * k)[0], np.zeros(6), np.zeros(6))
        made_by._show(0.0)
        rotation = made_by._shown.xmat[frames.mj].reshape(3, 3) @ frames.body_from_frame[:3, :3]
        position = (
            made_by._shown.xpos[frames.mj]
            + made_by._shown.xmat[frames.mj].reshape(3, 3) @ frames.body_from_frame[:3, 3]
        )
        wxyz = np.zeros(4)
        mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(rotation).ravel())
        poses.append((tuple(position.tolist()), tuple(wxyz.tolist())))
    engine = Engine(model)
    engine.take([heard("arm", -0.01, wave(-0.01)[0])])
    for k, (position, wxyz) in enumerate(poses):
        engine.take([PoseSample(source="p", seq=k, t=0.01 * k, target=target, position=position, wxyz=wxyz)])
        state = engine.tick() if k else engine.start()
    assert not state.invalid_reason("arm")
    assert np.linalg.norm(state.pose(frames)[1] - poses[-1][0]) < 2e-5
    reached = engine._references["arm"].newest
    made_by._put(model.robot("arm"), reached, np.zeros(6), np.zeros(6))
    made_by._show(0.0)
    body = made_by._shown.xmat[frames.mj].reshape(3, 3)
    at = made_by._shown.xpos[frames.mj] + body @ frames.body_from_frame[:3, 3]
    assert np.linalg.norm(at - poses[-1][0]) < 1e-6


def test_pose_out_of_reach_is_undecided(ur10):
    engine = Engine(ur10.model)
    engine.take(
        [PoseSample(source="p", seq=0, t=0.0, target="arm", position=(9.0, 0.0, 0.0), wxyz=(1.0, 0, 0, 0))]
    )
    state = engine.start()
    found = re.search(r"the nearest that was found is ([0-9.]+) m and", state.invalid_reason("arm"))
    # The UR10 reaches 1.3 m.
    assert 7.5 < float(found[1]) < 9.5
    with pytest.raises(Undecided, match="cannot reach"):
        state.q(ur10.model.robot("arm"))
