"""M, J and E of descriptions against Pinocchio and against first principles, to 1e-9."""

from __future__ import annotations

from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from oracles import numpy_dynamics
from oracles import pinocchio_oracle as oracle
from seerob.description.loader import load_robot
from seerob.description.robots import library


def installed(tail: str) -> Path:
    files = metadata.distribution("example-robot-data").files or []
    return next(Path(str(f.locate())) for f in files if str(f).endswith(tail))


@cache
def robot_of(path: Path):
    return load_robot(str(path), folder=Path())


def close(a, b):
    np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * max(1e-3, float(np.abs(b).max())))


@pytest.mark.parametrize("name", library.names())
def test_library_robots(name):
    robot = library.load(name)
    model = oracle.pinocchio_model(robot)
    rng = np.random.default_rng(3)
    for _ in range(5):
        q, qd = rng.uniform(-3, 3, (2, len(robot.joints())))
        ours, _ = numpy_dynamics.kinematics(robot, q)
        for link in robot.links:
            close(ours[link.name][0], oracle.pose(model, q, link.name))
            close(ours[link.name][1], oracle.jacobian(model, q, link.name))
        if any(link.inertial for link in robot.links):
            M = numpy_dynamics.mass_matrix(robot, q)
            close(M, oracle.mass_matrix(model, q))
            close(0.5 * qd @ M @ qd, oracle.kinetic_energy(model, q, qd))


# Files of example-robot-data; the Panda without its fingers' mimic is seven joints and two fingers.
FILES = ["ur3_robot.urdf", "ur5_robot.urdf", "ur10_robot.urdf", "panda.urdf", "z1.urdf", "xarm7.urdf"]


@pytest.mark.parametrize("tail", FILES)
def test_files_against_pinocchios_own_reader(tail):
    path = installed("/" + tail)
    robot = robot_of(path)
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    joints = {joint.name: joint for link in robot.links for joint in link.joints}
    rng = np.random.default_rng(5)
    for _ in range(4):
        q, qd = rng.uniform(-1.5, 1.5, (2, len(robot.joints())))
        at = dict(zip((j.name for j in robot.joints()), zip(q, qd, strict=True), strict=True))
        theirs_q, theirs_qd, selection = pin.neutral(model), np.zeros(model.nv), np.zeros((model.nv, len(q)))
        for name in model.names[1:]:
            joint, theirs = joints[name], model.joints[model.getJointId(name)]
            follow = joint.mimic
            leader, factor, offset = (
                (follow.joint, follow.multiplier, follow.offset) if follow else (name, 1, 0)
            )
            angle, speed = factor * at[leader][0] + offset, factor * at[leader][1]
            theirs_q[theirs.idx_q : theirs.idx_q + theirs.nq] = (
                [angle] if theirs.nq == 1 else [np.cos(angle), np.sin(angle)]
            )
            theirs_qd[theirs.idx_v] = speed
            selection[theirs.idx_v, [j.name for j in robot.joints()].index(leader)] = factor
        upper = np.triu(pin.crba(model, data, theirs_q))
        close(numpy_dynamics.mass_matrix(robot, q), selection.T @ (upper + np.triu(upper, 1).T) @ selection)
        pin.framesForwardKinematics(model, data, theirs_q)
        ours, _ = numpy_dynamics.kinematics(robot, q)
        for link in robot.links:
            frame = model.getFrameId(link.name, pin.FrameType.BODY)
            close(ours[link.name][0], data.oMf[frame].homogeneous)
            J = pin.computeFrameJacobian(model, data, theirs_q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            close(ours[link.name][1], J @ selection)
        energy = pin.computeKineticEnergy(model, data, theirs_q, theirs_qd)
        close(0.5 * qd @ numpy_dynamics.mass_matrix(robot, q) @ qd, energy)


def test_limits_are_those_of_pinocchios_own_reader():
    path = installed("/ur10_robot.urdf")
    robot = robot_of(path)
    model = pin.buildModelFromUrdf(str(path))
    assert len(robot.joints()) == model.nq == 6
    for i, joint in enumerate(robot.joints()):
        assert joint.lower == model.lowerPositionLimit[i]
        assert joint.upper == model.upperPositionLimit[i]
        assert joint.velocity.value == model.velocityLimit[i]
        assert joint.effort.value == model.effortLimit[i]
