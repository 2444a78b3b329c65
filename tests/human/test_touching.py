"""A captured person in physics: a table stops the hand, a workpiece is carried, both ways of pulling hold."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from made_capture import PERSON, captured, frames_of, play, source, walking, workstation

from seerob.core.samples import JointSample
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses
from seerob.session import run as road
from seerob.session.station import Station
from seerob.twin.engine import Engine
from seerob.twin.joint_torques import gravity

DESK_TOP = 1.08
SHOULDER, ELBOW = JOINTS.index("right_shoulder_flexion"), JOINTS.index("right_elbow_flexion")


def desk(top=DESK_TOP):
    return {
        "parts": [
            {"name": "desk", "at": {"position": [0.55, -0.2, top - 0.5]}, "shape": {"box": [0.6, 0.8, 1.0]}}
        ],
        "contacts": [
            {"between": ["operator/right_forearm", "desk"]},
            {"between": ["operator/right_hand", "desk"]},
        ],
    }


def pressing(depth=0.7, seconds=1.5):
    """A forearm that starts over the desk and sinks by ``depth`` [rad] of the shoulder."""
    t = np.arange(round(seconds * 60)) / 60.0
    q = np.tile(walking(0.1)[1][0], (len(t), 1))
    q[:, ELBOW] = 1.4
    q[:, SHOULDER] = np.interp(t, [0.2, 0.9], [0.75, 0.75 - depth])
    return t, q


def contacts(*sources, **tables):
    """Per tick the deepest penetration [m], the normal force [N] and the largest joint speed [rad/s]."""
    station = Station(workstation(*sources, **tables))
    engine = Engine(station.model, driven={"operator": 0.2})
    v = station.model.mechanisms["operator"].v_address
    told, force = [], np.zeros(6)
    for seq, samples in enumerate(road.pump(station.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        data, total = engine._data, 0.0
        for k in range(data.ncon):
            mujoco.mj_contactForce(engine._mj, data, k, force)
            total += force[0]
        told.append(
            (max((-c.dist for c in data.contact), default=0.0), total, np.abs(state.data.qvel[v]).max())
        )
    return np.array(told)


def test_a_hand_pushed_into_a_table_lies_on_it():
    t, q = pressing()
    deep, force, speed = contacts(source(captured(frames_of(t, q))), **desk()).T
    assert deep[0] == 0
    assert 0 < deep.max() < 0.015
    assert deep[-20:].max() < 0.008
    # What pushes is bounded: the arm's torque limits and the controllers, not the depth of the capture.
    assert 10 < force[-1] < 1000
    assert speed.max() < 20.0


def test_the_obstacle_shows_as_tracking_error_of_the_bones_that_it_stops():
    t, q = pressing()
    told = play(source(captured(frames_of(t, q))), **desk())
    assert {doubt for s, doubt, *_ in told if s < 0.2} == {""}
    assert "the twin is off" in told[-1][1]
    bones = told[-1][2]
    assert bones["right_hand"][0] > 0.05
    assert bones["left_hand"][0] < 0.01


@pytest.mark.parametrize("follow", ["posture", "task"])
def test_joints_and_bones_can_be_pulled(follow):
    told = play(source(captured(frames_of(*walking(1.0)))), person={"follow": follow})
    assert {doubt for _, doubt, *_ in told} == {""}
    away = [e[0] for _, _, bones, *_ in told for e in bones.values()]
    assert np.median(away) < 1.5e-3
    assert max(away) < 0.012


def test_pulling_bones_is_pulling_with_the_mass_matrix():
    r"""To first order the torques of small errors are :math:`\omega^2 M(q) \Delta q`."""
    station = Station(workstation(person={"follow": "task"}))
    engine = Engine(station.model, driven={"operator": 0.2})
    mechanism = station.model.mechanisms["operator"]
    v, q0 = mechanism.v_address, walking()[1][10]
    random = np.random.default_rng(0)
    delta = 1e-5 * random.standard_normal(len(q0))
    engine.take([JointSample(source="s", target="operator", seq=0, t=0.0, q=tuple(q0 + delta))])
    engine.start()
    engine._aim(0.0, station.workstation.engine.tick)
    engine._data.qpos[mechanism.q_address] = q0
    engine._pull(0, 0.0)
    found = engine._task_pulls[0]._torques[v]
    data, matrix = mujoco.MjData(engine._mj), np.zeros((engine._mj.nv, engine._mj.nv))
    data.qpos[mechanism.q_address] = q0
    mujoco.mj_kinematics(engine._mj, data)
    mujoco.mj_comPos(engine._mj, data)
    mujoco.mj_makeM(engine._mj, data)
    mujoco.mj_fullM(engine._mj, data, matrix)
    omega = 2 * np.pi * 10.0
    wanted = omega**2 * (matrix[np.ix_(v, v)] - np.diag(engine._mj.dof_armature[v])) @ delta
    assert found == pytest.approx(wanted, abs=1e-3 * np.abs(wanted).max())


def test_a_workpiece_in_the_hand_moves_with_it_and_weighs():
    t, q = pressing(depth=0.3)
    held = {
        "workpieces": [
            {
                "name": "box",
                "on": "operator/right_hand",
                "at": {"position": [0.06, -0.08, 0.0]},
                "shape": {"box": [0.08, 0.1, 0.1]},
                "mass": 4.0,
            }
        ]
    }
    stations = [Station(workstation(source(captured(frames_of(t, q))), **more)) for more in ({}, held)]
    weights = []
    for station in stations:
        engine = Engine(station.model, driven={"operator": 0.2})
        for seq, samples in enumerate(road.pump(station.sources, 0.01)):
            engine.take(samples)
            state = engine.tick() if seq else engine.start()
        weights.append(gravity(state, station.model.mechanisms["operator"]))
        assert state.invalid_reason("operator") == ""
    box, hand = (station.model.frames[name] for name in ("box", "operator/right_hand"))
    (R, p), (Rh, ph) = state.pose(box), state.pose(hand)
    assert p == pytest.approx(ph + Rh @ [0.06, -0.08, 0.0], abs=1e-9)
    assert pytest.approx(Rh, abs=1e-9) == R
    # Four kilograms more are held up by the pelvis.
    more = weights[1] - weights[0]
    assert more[JOINTS.index("pelvis_z")] == pytest.approx(4.0 * 9.81, rel=1e-6)
    shoulder = bone_poses(PERSON, q[-1])[1][BONES.index("right_upper_arm")]
    assert abs(more[SHOULDER]) == pytest.approx(4.0 * 9.81 * abs(p[0] - shoulder[0]), rel=0.05)


def test_a_shoulder_whose_axes_fall_together_does_not_spin():
    """Without inertia of its own (`actuation.REGULAR`) it turned at 200 rad/s and the step failed."""
    random = np.random.default_rng(1)
    t = np.arange(45) / 30.0
    q = np.tile(walking(0.1)[1][0], (len(t), 1))
    for name, value in (
        ("right_shoulder_internal_rotation", -1.45),
        ("left_shoulder_external_rotation", 1.45),
        ("right_elbow_flexion", 1.2),
        ("left_elbow_flexion", 1.2),
    ):
        q[:, JOINTS.index(name)] = value
    for side in ("right", "left"):
        q[:, JOINTS.index(f"{side}_shoulder_flexion")] = 0.9 + 0.9 * np.sin(4 * t)
    frames = frames_of(t, q, turned=False)
    for frame in frames:
        frame.positions[:] += 0.02 * random.standard_normal(frame.positions.shape)
    told = play(source(captured(frames)))
    assert max(speed for *_, speed, _ in told) < 40.0
    assert not any("could not follow" in doubt for _, doubt, *_ in told)
