"""M, J, E and Λ of ten robots, as the criteria have them, against Pinocchio, its reader and algorithms.

Six axes, seven axes, a sliding axis before and after turning ones; a tool with a payload on each, at a point
beside its working point.
"""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from made_cell import FLOATING, hinge_limits, made, state_at
from oracles import pinocchio_oracle as oracle
from seerob.criteria.safety.effective_mass import inverse_effective_mass, principal_masses, projected_mass
from seerob.criteria.safety.kinetic_energy import kinetic_energy

GANTRY = "".join(
    f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/>'
    f'<origin xyz="{xyz}" rpy="0.1 -0.2 0.3"/><axis xyz="{axis}"/>'
    '<limit lower="-1" upper="1" effort="500" velocity="2"/></joint>'
    f'<link name="{name}_link"><inertial><origin xyz="0.05 -0.02 0.1" rpy="0.2 0.1 0"/><mass value="{mass}"/>'
    '<inertia ixx="0.05" iyy="0.06" izz="0.04" ixy="0.001" ixz="-0.002" iyz="0.003"/></inertial>'
    '<collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision></link>'
    for name, kind, parent, xyz, axis, mass in (
        ("x", "prismatic", "base", "0 0 1", "1 0 0", 12),
        ("turn", "revolute", "x_link", "0.1 0 0.2", "0 0 1", 6),
        ("lift", "prismatic", "turn_link", "0.3 0.1 0", "0 0.6 0.8", 4),
        ("wrist", "revolute", "lift_link", "0.2 0 0", "0 1 0", 1.5),
    )
)
LOAD = """
[[tools]]
name = "grip"
on = "arm/{tip}"
shape = {{ box = [0.1, 0.05, 0.2] }}
at = {{ position = [0.01, 0.02, 0.1], rpy_deg = [0, 30, 0] }}
mass = 1.3
com = [0.005, 0.0, 0.02]
inertia = [0.004, 0.005, 0.006, 0.0001, 0.0002, -0.0001]
tcp = {{ position = [0, 0, 0.1] }}
[[workpieces]]
name = "cube"
on = "grip"
shape = {{ box = [0.1, 0.1, 0.1] }}
at = {{ position = [0, 0, 0.15] }}
mass = 2.5
com = [0, 0, 0]
inertia = [0.005, 0.006, 0.007, 0, 0, 0]
"""
BESIDE = np.array([0.03, -0.02, 0.05])
"""The point, from the tool's working point [m]."""
ROBOTS = {
    "library:iiwa14": ("lbr_link_ee", "", 7, 0),
    "library:iiwa7": ("lbr_link_ee", "", 7, 0),
    "library:ur3e": ("tool0", "", 6, 0),
    "library:ur5e": ("tool0", "", 6, 0),
    "library:ur10": ("tool0", "", 6, 0),
    "library:ur10e": ("tool0", "", 6, 0),
    "library:ur16e": ("tool0", "", 6, 0),
    "gantry.urdf": ("wrist_link", f'<robot name="gantry"><link name="base"/>{GANTRY}</robot>', 2, 2),
    "panda": ("panda_hand", "panda_description/urdf/panda.urdf", 7, 1),
    "xarm7": ("link_eef", "xarm_description/urdf/xarm7.urdf", 7, 0),
}
"""Model: the link that the tool is on, its file, and how many axes turn and slide."""


def installed(tail: str) -> Path:
    found = metadata.distribution("example-robot-data").files or []
    return next(Path(str(file.locate())) for file in found if str(file).endswith(tail))


def theirs(path: Path | None, description) -> tuple[pin.Model, np.ndarray]:
    """Pinocchio's model, and its joints from ours, (nv, n)."""
    if path is None:
        return oracle.pinocchio_model(description), np.eye(len(description.joints()))
    model = pin.buildModelFromUrdf(str(path))
    mine = {joint.name: i for i, joint in enumerate(description.joints())}
    columns = np.zeros((model.nv, len(mine)))
    for joint in (joint for link in description.links for joint in link.joints):
        leader, factor = (joint.mimic.joint, joint.mimic.multiplier) if joint.mimic else (joint.name, 1.0)
        columns[model.joints[model.getJointId(joint.name)].idx_v, mine[leader]] = factor
    return model, columns


def with_load(model: pin.Model, tip: str) -> tuple[int, pin.SE3]:
    """Bolt the load on; the joint that carries it, and where on it the point is."""
    frame = model.frames[model.getFrameId(tip, pin.FrameType.BODY)]
    placed = pin.SE3(pin.rpy.rpyToMatrix(0, np.radians(30), 0), np.array([0.01, 0.02, 0.1]))
    tool = frame.placement * placed
    grip = np.array([[0.004, 0.0001, 0.0002], [0.0001, 0.005, -0.0001], [0.0002, -0.0001, 0.006]])
    model.appendBodyToJoint(frame.parentJoint, pin.Inertia(1.3, np.array([0.005, 0, 0.02]), grip), tool)
    cube = pin.Inertia(2.5, np.zeros(3), np.diag([0.005, 0.006, 0.007]))
    model.appendBodyToJoint(frame.parentJoint, cube, tool * pin.SE3(np.eye(3), np.array([0, 0, 0.15])))
    return frame.parentJoint, tool * pin.SE3(np.eye(3), np.array([0, 0, 0.1]) + BESIDE)


def close(a, b):
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * max(1.0, float(np.abs(b).max())))


@pytest.mark.parametrize("name", ROBOTS)
def test_mass_jacobian_energy_and_effective_mass_are_pinocchios(tmp_path, name):
    tip, content, turning, sliding = ROBOTS[name]
    path = None
    if not name.startswith("library:"):
        path = tmp_path / name if name.endswith(".urdf") else installed(content)
    reference = name if path is None else name if name.endswith(".urdf") else str(path)
    text = f'{FLOATING}[[robots]]\nname = "arm"\nmodel = "{reference}"\n{LOAD.format(tip=tip)}'
    station = made(tmp_path, text, {name: content} if name.endswith(".urdf") else {}, allow_outside=True)
    robot = station.model.robot("arm")
    assert (robot.units.count("rad"), robot.units.count("m")) == (turning, sliding)
    model, columns = theirs(path, robot.description)
    joint, point = with_load(model, tip)
    model.addFrame(pin.Frame("point", joint, 0, point, pin.FrameType.OP_FRAME), False)
    low, high = hinge_limits(station, "arm")
    rng = np.random.default_rng(3)
    for _ in range(3):
        q, qd, u = rng.uniform(low, high), rng.normal(size=len(low)), rng.normal(size=3)
        u /= np.linalg.norm(u)
        state, data = state_at(station, arm=(q, qd)), model.createData()
        J = (
            pin.computeFrameJacobian(
                model, data, columns @ q, model.getFrameId("point"), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            @ columns
        )
        upper = np.triu(pin.crba(model, data, columns @ q))
        M = columns.T @ (upper + np.triu(upper, 1).T) @ columns
        close(state.jacobian(robot.tip, robot, BESIDE), J)
        close(state.mass_matrix(robot), M)
        energy = kinetic_energy(state.mass_matrix(robot), state.qd(robot))
        close(energy, pin.computeKineticEnergy(model, data, columns @ q, columns @ qd))
        mobility = J[:3] @ np.linalg.inv(M) @ J[:3].T
        if np.array_equal(columns, np.eye(len(low))):
            # Articulated bodies, without forming M.
            inverse = pin.computeMinverse(model, model.createData(), q)
            mobility = J[:3] @ (np.triu(inverse) + np.triu(inverse, 1).T) @ J[:3].T
        ours = inverse_effective_mass(state.jacobian(robot.tip, robot, BESIDE)[:3], state.mass_matrix(robot))
        close(ours, mobility)
        assert float(projected_mass(ours, u)) == pytest.approx(1 / (u @ mobility @ u), rel=1e-9)
        masses, axes = principal_masses(ours)
        Lambda = np.linalg.inv(mobility)
        close(axes @ np.diag(masses) @ axes.T, Lambda)


@pytest.mark.parametrize(
    ("name", "mass"),
    [
        ("ur5e", 17.7),
        ("ur10e", 29.104),
        ("ur5", 17.0489),
        ("ur10", 28.435),
        ("ur3e", 8.7985),
        ("ur16e", 27.26),
    ],
)
def test_moving_masses_of_the_maker(tmp_path, name, mass):
    """Sums of the maker's files without the base; half of it is what Annex A counts of a bare arm."""
    from seerob.criteria.contact.impact_mass import moving_masses, simplified_mass

    model = made(tmp_path, f'[[robots]]\nname = "arm"\nmodel = "library:{name}"\n').model
    assert moving_masses(model, model.robot("arm")) == pytest.approx((mass, 0), abs=5e-5)
    assert simplified_mass(model, model.robot("arm")) == pytest.approx(mass / 2, abs=5e-5)
