"""Outlines of what a point reaches, against closed forms and places that joints put it at."""

import mujoco
import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.model.volumes.reach_outline import outline, reach_outline
from seerob.model.volumes.reachable import Screw
from seerob.session.station import load

X, Y, Z = np.eye(3)
CELL = """title = "Reaching"

[[robots]]
name = "ur5e"
model = "library:ur5e"
base = { position = [1, 2, 0.7] }

[[parts]]
name = "wall"
shape = { box = [0.1, 2, 2] }
"""


def turns(axis, anchor, low=-np.pi, high=np.pi):
    return Screw(False, np.asarray(anchor, float), axis, low, high)


def outside(found, places):
    """Largest distance of places outside of the planes of an outline [m]."""
    corners = found.points[found.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1)
    normals = normals[size > 1e-12] / size[size > 1e-12, None]
    heights = np.einsum("ij,ij->i", normals, corners[size > 1e-12, 0])
    return float((places @ normals.T - heights).max())


def test_of_an_arm_that_turns_all_around_it_is_a_ball():
    # Shoulder about z and y, elbow about y: all of 0.9 m around the shoulder can be pointed at.
    found = outline([turns(Z, [0, 0, 1]), turns(Y, [0, 0, 1]), turns(Y, [0.5, 0, 1])], np.array([0.9, 0, 1]))
    radii = np.linalg.norm(found.points - [0, 0, 1], axis=1)
    assert radii == pytest.approx(0.9, abs=1e-5)
    # As far as planes around a ball at its many directions are outside of it.
    assert 0.001 < found.beyond < 0.02


def test_limits_and_slides_are_kept_to():
    slide = Screw(True, np.zeros(3), Z, 0.0, 0.3)
    found = outline([slide, turns(Z, [0, 0, 0], 0.0, np.pi / 2)], np.array([1.0, 0, 0]))
    assert found.points[:, 2].min() == pytest.approx(0, abs=1e-9)
    assert found.points[:, 2].max() == pytest.approx(0.3, abs=1e-9)
    assert np.linalg.norm(found.points[:, :2], axis=1) == pytest.approx(1)
    assert found.points[:, :2].min() > -1e-9
    assert outline([turns(Z, [0, 0, 0])], np.array([1.0, 0, 0])) is None  # a circle has no inside


def test_no_posture_of_a_robot_is_farther_outside_than_it_says(tmp_path):
    (tmp_path / "workstation.toml").write_text(CELL)
    model = load(tmp_path).model
    arm = model.mechanisms["ur5e"]
    found = reach_outline(model, arm.tip.mj, arm.tip.body_from_frame[:3, 3])
    data, rng = mujoco.MjData(model.mj), np.random.default_rng(5)
    places = np.empty((4000, 3))
    lower, upper = (np.maximum(np.minimum(end, np.pi), -np.pi) for end in (arm.lower, arm.upper))
    for k in range(len(places)):
        data.qpos[arm.q_address] = rng.uniform(lower, upper)
        mujoco.mj_kinematics(model.mj, data)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[arm.tip.mj].reshape(3, 3), data.xpos[arm.tip.mj]
        places[k] = (pose @ arm.tip.body_from_frame)[:3, 3]
    assert outside(found.outline, places) <= found.outline.beyond
    # It is of that size, and goes along with what carries it.
    assert 0.8 < np.linalg.norm(found.outline.points - found.position, axis=1).max() < 1.2
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved = found.points(turn @ found.rotation, found.position + 0.5 * X)
    assert moved == pytest.approx((found.outline.points - found.position) @ turn.T + found.position + 0.5 * X)
    with pytest.raises(InputError, match="no joint moves it"):
        reach_outline(model, model.bodies[model.select("wall")[0]].mj, np.zeros(3))
