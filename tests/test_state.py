"""M, J, E and speeds of the twin against Pinocchio, finite differences and by hand."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import trimesh

from made_cell import FLOATING, TWO_R, hinge_limits, made, state_at, two_r
from oracles import pinocchio_oracle as oracle
from seerob.core.errors import Undecided
from seerob.core.transforms import rotation_from_rpy
from seerob.criteria.safety.kinetic_energy import kinetic_energy
from seerob.description.robots import library
from seerob.twin.state import State

LIBRARY = library.names()
BASE = "base = { position = [0.3, -0.2, 0.9], rpy_deg = [10, -20, 130] }\n"
WORLD_FROM_BASE = pin.SE3(rotation_from_rpy(np.radians([10, -20, 130])), np.array([0.3, -0.2, 0.9]))
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
density = 2500
"""


def close(a, b):
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * max(1.0, float(np.abs(b).max())))


def with_load(model: pin.Model, tip: str) -> pin.SE3:
    """Bolt the tool and the cube of `LOAD` to a Pinocchio model; returns tip_from_tool."""
    frame = model.frames[model.getFrameId(tip, pin.FrameType.BODY)]
    tip_from_tool = pin.SE3(rotation_from_rpy(np.radians([0, 30, 0])), np.array([0.01, 0.02, 0.1]))
    tool = pin.Inertia(
        1.3,
        np.array([0.005, 0, 0.02]),
        np.array([[0.004, 0.0001, 0.0002], [0.0001, 0.005, -0.0001], [0.0002, -0.0001, 0.006]]),
    )
    cube = pin.Inertia(2.5, np.zeros(3), np.eye(3) * 2.5 * 0.01 / 6)
    joint_from_tool = frame.placement * tip_from_tool
    model.appendBodyToJoint(frame.parentJoint, tool, joint_from_tool)
    model.appendBodyToJoint(
        frame.parentJoint, cube, joint_from_tool * pin.SE3(np.eye(3), np.array([0, 0, 0.15]))
    )
    return tip_from_tool


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("name", LIBRARY)
def test_library_robot_is_pinocchios(tmp_path, name, loaded):
    description = library.load(name)
    text = f'{FLOATING}[[robots]]\nname = "arm"\nmodel = "library:{name}"\n{BASE}'
    station = made(tmp_path, text + (LOAD.format(tip=description.tip) if loaded else ""))
    model = oracle.pinocchio_model(description)
    tip_from_tool = with_load(model, description.tip) if loaded else pin.SE3.Identity()
    if loaded:
        tip_from_tool = tip_from_tool * pin.SE3(np.eye(3), np.array([0, 0, 0.1]))
    robot = station.model.robot("arm")
    low, high = hinge_limits(station, "arm")
    rng = np.random.default_rng(1)
    for _ in range(3):
        q, qd = rng.uniform(low, high), rng.normal(size=len(low))
        state = state_at(station, arm=(q, qd))
        J = state.jacobian(robot.tip, robot)
        tip = oracle.pose(model, q, description.tip)
        R = WORLD_FROM_BASE.rotation
        arm = R @ tip[:3, :3] @ tip_from_tool.translation
        theirs = oracle.jacobian(model, q, description.tip)
        theirs = np.vstack([R @ theirs[:3], R @ theirs[3:]])
        theirs[:3] += np.cross(theirs[3:].T, arm).T
        close(J, theirs)
        close(state.pose(robot.tip)[1], WORLD_FROM_BASE.act(tip[:3, 3]) + arm)
        if robot.unknown_masses:
            with pytest.raises(Undecided, match="nobody gave"):
                state.mass_matrix(robot)
            continue
        M = state.mass_matrix(robot)
        close(M, oracle.mass_matrix(model, q))
        close(kinetic_energy(M, qd), oracle.kinetic_energy(model, q, qd))


@pytest.mark.parametrize("name", LIBRARY)
def test_no_two_axes_of_a_library_robot_that_follow_one_another_lie_in_one_line(name):
    """Files of makers have had that for a while: an arm that cannot rise."""
    poses: dict[str | None, np.ndarray] = {None: np.eye(4)}
    before = None
    for link in library.load(name).links:
        at = poses[link.name] = poses[link.parent] @ link.parent_from_link
        for joint in link.joints:
            axis = at[:3, :3] @ np.asarray(joint.axis)
            through = at[:3, 3] + at[:3, :3] @ np.asarray(joint.anchor)
            if before is not None:
                apart = through - before[1]
                assert np.linalg.norm(np.cross(axis, before[0])) > 0.1 or (
                    np.linalg.norm(np.cross(apart, axis)) > 0.01
                ), joint.name
            before = axis, through


def test_some_library_robot_has_unknown_masses_and_most_have_not(tmp_path):
    without = [n for n in LIBRARY if not any(k.inertial for k in library.load(n).links)]
    for name in without:
        station = made(tmp_path, f'[[robots]]\nname = "arm"\nmodel = "library:{name}"\n')
        assert station.model.robot("arm").unknown_masses
    assert len(LIBRARY) - len(without) >= 8


def installed(tail: str) -> Path:
    files = metadata.distribution("example-robot-data").files or []
    return next(Path(str(f.locate())) for f in files if str(f).endswith("/" + tail))


@pytest.mark.parametrize("by", ["package", "path"])
@pytest.mark.parametrize("tail", ["ur10_robot.urdf", "panda.urdf"])
def test_file_robot_is_what_pinocchio_reads(tmp_path, tail, by):
    path = installed(tail)
    reference = (
        f"package:example-robot-data/{path.parent.parent.name}/urdf/{tail}" if by == "package" else str(path)
    )
    text = f'{FLOATING}[[robots]]\nname = "arm"\nmodel = "{reference}"\n{BASE}'
    station = made(tmp_path, text, allow_outside=by == "path")
    robot = station.model.robot("arm")
    model = pin.buildModelFromUrdf(str(path))
    columns = np.zeros((model.nv, len(robot.joints)))
    every = [joint for link in robot.description.links for joint in link.joints]
    mine = {joint.name: i for i, joint in enumerate(robot.joints)}
    for joint in every:
        leader, factor = (joint.mimic.joint, joint.mimic.multiplier) if joint.mimic else (joint.name, 1.0)
        columns[model.joints[model.getJointId(joint.name)].idx_v, mine[leader]] = factor
    assert all(not j.mimic or j.mimic.offset == 0 for j in every)
    link = robot.description.tip
    rng = np.random.default_rng(2)
    low, high = hinge_limits(station, "arm")
    for _ in range(5):
        q, qd = rng.uniform(low, high), rng.normal(size=len(low))
        state = state_at(station, arm=(q, qd))
        data, theirs_q = model.createData(), columns @ q
        upper = np.triu(pin.crba(model, data, theirs_q))
        M = columns.T @ (upper + np.triu(upper, 1).T) @ columns
        close(state.mass_matrix(robot), M)
        frame = model.getFrameId(link, pin.FrameType.BODY)
        J = pin.computeFrameJacobian(model, data, theirs_q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        R = np.kron(np.eye(2), WORLD_FROM_BASE.rotation)
        close(state.jacobian(station.model.frame(f"arm/{link}"), robot), R @ J @ columns)
        energy = kinetic_energy(state.mass_matrix(robot), state.qd(robot))
        close(energy, pin.computeKineticEnergy(model, data, theirs_q, columns @ qd))


def test_ur5e_published_vectors(tmp_path):
    """Inertials and kinematics of UniversalRobots/Universal_Robots_ROS2_Description 2.4.5."""
    cell = '[[robots]]\nname = "arm"\nmodel = "library:ur5e"\n'
    station = made(tmp_path, cell)
    robot = station.model.robot("arm")
    q, qd = np.radians([0, -90, 90, -90, -90, 0]), np.radians([30, -20, 40, 10, 0, 0])
    state = state_at(station, arm=(q, qd))
    M = state.mass_matrix(robot)
    np.testing.assert_allclose(np.diag(M), [1.01325, 2.34754, 0.83613, 0.02519, 0.00618, 0.00013], atol=1e-5)
    assert kinetic_energy(M, qd) == pytest.approx(0.370339, abs=1e-6)
    J = state.jacobian(robot.tip, robot)
    assert np.linalg.norm(J[:3] @ qd) == pytest.approx(0.418520, abs=1e-6)
    assert abs(np.linalg.det(J)) == pytest.approx(0.081992, abs=1e-6)
    position = state.pose(robot.tip)[1]
    # base_link of the ROS description is turned by half a turn against the base of the DH table.
    assert np.abs(position) == pytest.approx([0.4919, 0.1333, 0.4879], abs=5e-5)


def test_mimic_joint_moves_with_its_factor_and_offset(tmp_path):
    """q2 = 3 q1 + 0.2: M, J and the pose are those of the arm with both joints driven."""
    folder = tmp_path / "mimic"
    follow = '<mimic joint="j1" multiplier="3" offset="0.2"/>'
    one = made(folder, FLOATING + TWO_R, {"arm.urdf": two_r(mimic=follow)})
    two = made(tmp_path / "free", FLOATING + TWO_R, {"arm.urdf": two_r()})
    q, qd, C = 0.4, -0.7, np.array([[1.0], [3.0]])
    a = state_at(one, arm=((q,), (qd,)))
    b = state_at(two, arm=((q, 3 * q + 0.2), (qd, 3 * qd)))
    robot, both = one.model.robot("arm"), two.model.robot("arm")
    assert a.q(robot) == pytest.approx([q])
    assert a.qd(robot) == pytest.approx([qd])
    close(a.mass_matrix(robot), C.T @ b.mass_matrix(both) @ C)
    close(a.jacobian(robot.tip, robot), b.jacobian(both.tip, both) @ C)
    close(a.pose(robot.tip)[1], b.pose(both.tip)[1])


SLIDER = """<robot name="s"><link name="base"/>
<link name="cart"><inertial><mass value="4"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
</inertial>
<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
<link name="pole"><inertial><origin xyz="0 0 0.5"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.05"/></geometry></collision></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-2" upper="2" effort="500" velocity="3"/></joint>
<joint name="turn" type="continuous"><parent link="cart"/><child link="pole"/><axis xyz="0 1 0"/>
<limit effort="100" velocity="3"/></joint></robot>"""


def test_prismatic_joint_by_hand(tmp_path):
    """Cart and pole: M = [[m + mp, mp l cos], [mp l cos, I + mp l²]]."""
    station = made(tmp_path, TWO_R, {"arm.urdf": SLIDER})
    robot = station.model.robot("arm")
    state = state_at(station, arm=((0.7, 0.3), (1.0, 2.0)))
    c = 2 * 0.5 * np.cos(0.3)
    close(state.mass_matrix(robot), np.array([[6.0, c], [c, 0.1 + 2 * 0.25]]))
    assert robot.units == ("m", "rad")


def test_rotor_inertia_adds_to_the_diagonal(tmp_path):
    plain = made(tmp_path / "a", TWO_R, {"arm.urdf": two_r()})
    geared = made(tmp_path / "b", TWO_R + "rotor_inertia = [0.5, 0.25]\n", {"arm.urdf": two_r()})
    pose = ((0.3, 1.0), (0.0, 0.0))
    a, b = (state_at(s, arm=pose).mass_matrix(s.model.robot("arm")) for s in (plain, geared))
    close(b - a, np.diag([0.5, 0.25]))


@pytest.mark.parametrize("shape", ["<collision><geometry><box size='1 1 1'/></geometry></collision>", ""])
def test_robot_without_masses_has_no_mass_matrix(tmp_path, shape):
    import re

    bare = re.sub(r"<inertial>.*?</inertial>", "", two_r())
    bare = re.sub(r"<collision>.*?</collision>", shape, bare)
    station = made(tmp_path, TWO_R, {"arm.urdf": bare})
    state = state_at(station, arm=((0, 1), (1, 1)))
    with pytest.raises(Undecided, match="nobody gave the mass of arm/l"):
        state.mass_matrix(station.model.robot("arm"))


def test_tool_without_mass_makes_energies_unknown_only_while_it_is_mounted(tmp_path):
    tool = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = { box = [0.1, 0.1, 0.1] }\n'
    station = made(tmp_path, TWO_R + tool, {"arm.urdf": two_r()})
    state = state_at(station, arm=((0, 1), (1, 1)))
    with pytest.raises(Undecided, match="mass of grip is unknown: nobody gave its mass or its density"):
        state.mass_matrix(station.model.robot("arm"))
    assert state.jacobian(station.model.robot("arm").tip, station.model.robot("arm")).shape == (6, 2)


@pytest.mark.parametrize("table", ["tools", "machines"])
def test_of_a_mesh_with_holes_whose_density_is_given_it_is_the_depth_of_holes_that_is_missing(
    tmp_path, table
):
    box = trimesh.creation.box((0.1, 0.1, 0.1)).subdivide()
    stl = trimesh.Trimesh(box.vertices, box.faces[1:]).export(file_type="stl")
    thing = f'[[{table}]]\nname = "grip"\non = "arm/tip"\nmesh = "grip.stl"\nunits = "m"\ndensity = 800\n'
    thing += "" if table == "tools" else "slide = { along = [1, 0, 0], lower = 0, upper = 0.1 }\n"
    files = {"arm.urdf": two_r(), "grip.stl": stl}
    station = made(tmp_path, TWO_R + thing, files)
    state = state_at(station, arm=((0, 1), (1, 1)))
    with pytest.raises(Undecided, match=r"mass of grip.* is unknown: its mesh has holes.*give hole_depth"):
        state.mass_matrix(station.model.robot("arm"))
    station = made(tmp_path / "deep", TWO_R + f"{thing}hole_depth = 0\n", files)
    state = state_at(station, arm=((0, 1), (1, 1)))
    assert state.mass_matrix(station.model.robot("arm")).shape == (2, 2)


def test_tool_and_its_working_point_are_different_points(tmp_path):
    tool = (
        '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = { box = [0.1, 0.1, 0.1] }\nmass = 1\n'
        "tcp = { position = [0.5, 0, 0] }\n"
    )
    station = made(tmp_path, TWO_R + tool, {"arm.urdf": two_r()})
    model, state = station.model, state_at(station, arm=((0, 0), (1, 0)))
    robot = model.robot("arm")
    for name, reach in (("arm", 2.5), ("grip", 2.0), ("arm", 2.5)):
        close(state.jacobian(model.frame(name), robot)[:3] @ [1.0, 0.0], np.array([0, reach, 0]))


def test_two_robots_do_not_touch_each_others_matrices(tmp_path):
    second = TWO_R.replace('"arm"', '"other"')
    both = made(tmp_path / "both", second + TWO_R, {"arm.urdf": two_r()})
    alone = made(tmp_path / "alone", TWO_R, {"arm.urdf": two_r()})
    pose = ((0.1, 0.9), (0.5, -0.5))
    a = state_at(both, arm=pose, other=((1.0, 2.0), (3.0, 3.0)))
    b = state_at(alone, arm=pose)
    close(a.mass_matrix(both.model.robot("arm")), b.mass_matrix(alone.model.robot("arm")))
    close(
        a.jacobian(both.model.frame("arm"), both.model.robot("arm")),
        b.jacobian(alone.model.frame("arm"), alone.model.robot("arm")),
    )


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    text = f"""
[[robots]]
name = "arm"
model = "library:ur5e"
{BASE}
{LOAD.format(tip="tool0")}
[[humans]]
name = "op"
stature = 1.8
mass = 80
sex = "female"
at = {{ position = [1, 0, 0] }}
"""
    return made(tmp_path_factory.mktemp("cell"), text)


def moved(cell, h):
    rng = np.random.default_rng(4)
    motion = {}
    for name in ("arm", "op"):
        low, high = hinge_limits(cell, name)
        q, qd = rng.uniform(0.5 * low, 0.5 * high), rng.normal(size=len(low))
        motion[name] = (q + h * qd, qd)
    return state_at(cell, **motion)


@pytest.mark.parametrize("name", ["arm", "op"])
def test_a_mass_matrix_has_what_mujoco_has_of_all_joints_bit_for_bit(cell, name):
    # Arms and legs of a person do not move each other: nothing is kept of them.
    state, mechanism = moved(cell, 0.0), cell.model.mechanisms[name]
    full = np.zeros((cell.model.mj.nv, cell.model.mj.nv))
    mujoco.mj_makeM(cell.model.mj, state.data)
    mujoco.mj_fullM(cell.model.mj, state.data, full)
    block = full[np.ix_(mechanism.v_address, mechanism.v_address)]
    found = state.columns[name].of_mass_matrix(state.data.M)
    if state.columns[name].coupling is not None:
        block = mechanism.coupling.T @ block @ mechanism.coupling
    assert found.tobytes() == block.tobytes()
    assert (block == 0).any() == (name == "op")


def test_velocities_are_finite_differences_of_positions(cell):
    h = 1e-6
    before, now, after = (moved(cell, x) for x in (-h, 0.0, h))
    for body in cell.model.bodies:
        linear, angular = (of_all[body.index] for of_all in now.body_velocities((body.index,)))
        np.testing.assert_allclose(
            linear, (after.positions - before.positions)[body.index] / (2 * h), atol=1e-6
        )
        R, dR = now.rotations[body.index], (after.rotations - before.rotations)[body.index] / (2 * h)
        spin = dR @ R.T
        np.testing.assert_allclose(angular, [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-6)


def test_fastest_point_bounds_every_point_of_the_shape_and_is_one_of_them(cell):
    h = 1e-6
    before, now, after = (moved(cell, x) for x in (-h, 0.0, h))
    moving = [b for b in cell.model.bodies if b.carrier]
    assert len(moving) > 20
    rng = np.random.default_rng(0)
    for body in moving:
        bound, point, velocity = now.fastest_point(body.index)
        points = [solid.mesh.vertices for solid in body.solids if solid.mesh is not None]
        for solid in body.solids:
            if solid.points is None:
                continue
            directions = rng.normal(size=(400, 3))
            directions *= solid.radius / np.linalg.norm(directions, axis=1, keepdims=True)
            weights = rng.dirichlet(np.ones(len(solid.points)), 400)
            points.append(weights @ solid.points + directions)
        local = np.vstack(points)
        world = [local @ s.rotations[body.index].T + s.positions[body.index] for s in (before, after)]
        speeds = np.linalg.norm((world[1] - world[0]) / (2 * h), axis=1)
        assert speeds.max() <= bound + 1e-6, body.name
        if body.radius == 0 and body.deviation == 0:
            assert speeds.max() == pytest.approx(bound, abs=1e-6), body.name
            assert np.linalg.norm(velocity) == pytest.approx(bound)
            at = np.vstack(world).reshape(2, -1, 3).mean(axis=0)
            assert np.linalg.norm(at - point, axis=1).min() < 1e-6


def test_a_shape_that_may_be_off_is_faster_by_that_much(cell):
    """|ω| times what the real surface may stick out."""
    from dataclasses import replace

    state = moved(cell, 0.0)
    body = next(b for b in cell.model.bodies if b.name == "grip")
    plain = state.fastest_point(body.index)[0]
    thick = replace(body, solids=tuple(replace(s, deviation=0.01) for s in body.solids))
    bodies = list(cell.model.bodies)
    bodies[body.index] = thick
    other = State(replace(cell.model, bodies=tuple(bodies)), state.data, state.hearings)
    other.refresh(state.t)
    omega = np.linalg.norm(state.body_velocities((body.index,))[1][body.index])
    assert other.fastest_point(body.index)[0] == pytest.approx(plain + 0.01 * omega)


def test_what_is_drawn_later_is_where_it_was_and_is_worked_out_once(cell):
    state, offset = moved(cell, 0.0), np.array([0.01, -0.02, 0.3])
    frame = cell.model.frame("grip")
    rotation, position = (each.copy() for each in state.pose(frame))
    origin, point = state.drawn_point(frame, np.zeros(3)), state.drawn_point(frame, offset)
    state.data.xpos[:] += 1.0
    state.data.xmat[:] = np.eye(3).ravel()
    assert origin().tolist() == position.tolist()
    close(point(), position + rotation @ offset)
    assert state.drawn_point(frame, offset.copy())() is point()
    with pytest.raises(ValueError, match="read-only"):
        point()[0] = 0.0
    before = point()
    state.data.qpos[0] += 0.5
    state.refresh(1.0)
    rotation, position = state.pose(frame)
    close(state.drawn_point(frame, offset)(), position + rotation @ offset)
    assert np.abs(state.drawn_point(frame, offset)() - before).max() > 0.01


def test_poses_are_seven_float32_per_body(cell):
    state = moved(cell, 0.0)
    table = np.frombuffer(state.poses(), "<f4").reshape(-1, 7)
    np.testing.assert_allclose(table[:, :3], state.positions, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(table[:, 3:], axis=1), 1, atol=1e-6)
