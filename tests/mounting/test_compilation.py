"""From the file to the model: mounting, names, files that travel, mistakes."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, person, state_at, two_r
from seerob.core.errors import InputError
from seerob.core.shapes import capsule
from seerob.core.transforms import rotation_from_rpy
from seerob.model.mounting.specification import extreme_points
from seerob.recording.format import filed

GRIP = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = { box = [0.2, 0.1, 0.1] }\nmass = 0.5\n'
PART = '[[workpieces]]\nname = "part"\non = "grip"\nshape = { sphere = 0.05 }\ndensity = 1000\n'


def cell(folder, text, **more):
    return made(folder, FLOATING + TWO_R + text, {"arm.urdf": two_r(**more)})


def test_everything_is_where_the_file_puts_it(tmp_path):
    """base · joints · tip · tool · workpiece, multiplied by hand."""
    base = "base = { position = [1, 2, 3], rpy_deg = [0, 0, 90] }\n"
    at = "at = { position = [0.1, 0, 0], rpy_deg = [90, 0, 0] }\n"
    station = cell(tmp_path, base + GRIP + at + PART + "at = { position = [0, 0, 0.2] }\n")
    state = state_at(station, arm=((0.0, np.pi / 2), (0, 0)))
    index = {b.name: b.index for b in station.model.bodies}
    # World: link 1 along y, link 2 along −x.
    np.testing.assert_allclose(state.positions[index["arm/l2"]], [1, 3, 3], atol=1e-12)
    np.testing.assert_allclose(state.positions[index["grip"]], [-0.1, 3, 3], atol=1e-12)
    R = rotation_from_rpy((0, 0, np.pi)) @ rotation_from_rpy((np.pi / 2, 0, 0))
    np.testing.assert_allclose(state.rotations[index["grip"]], R, atol=1e-12)
    np.testing.assert_allclose(state.positions[index["part"]], [-0.1, 3, 3] + R @ [0, 0, 0.2], atol=1e-12)


def test_order_of_the_tables_does_not_matter(tmp_path):
    """A workpiece on a tool on a tool, given backwards."""
    second = '[[tools]]\nname = "finger"\non = "grip"\nshape = { sphere = 0.01 }\nmass = 0.1\n'
    first = cell(tmp_path / "a", GRIP + second + PART.replace('"grip"', '"finger"')).model
    other = cell(tmp_path / "b", PART.replace('"grip"', '"finger"') + second + GRIP).model
    assert {b.name for b in first.bodies} == {b.name for b in other.bodies}
    assert first.mj.body_mass.sum() == pytest.approx(other.mj.body_mass.sum())
    robot = other.robot("arm")
    assert sorted(other.bodies[i].name for i in robot.carried) == ["finger", "grip", "part"]


def test_masses_are_in_the_twin(tmp_path):
    model = cell(tmp_path, GRIP + PART).model
    masses = {name: model.mj.body(name).mass[0] for name in ("arm/l1", "arm/l2", "grip", "part")}
    assert masses == pytest.approx(
        {"arm/l1": 1, "arm/l2": 1, "grip": 0.5, "part": 1000 * 4 / 3 * np.pi * 0.05**3}
    )
    inertia = model.mj.body("part").inertia
    np.testing.assert_allclose(inertia, 0.4 * masses["part"] * 0.05**2)


def test_things_of_the_environment_have_no_mass_and_do_not_move(tmp_path):
    model = cell(tmp_path, '[[parts]]\nname = "table"\nshape = { box = [1, 1, 1] }\n').model
    table = model.mj.body("table")
    assert table.mass[0] == 0
    assert model.mj.body_weldid[table.id] == 0
    assert all(model.bodies[i].name != "table" for i in model.robot("arm").moving)


def test_tool_centre_point_is_the_point_of_interest(tmp_path):
    model = cell(tmp_path / "tcp", GRIP + "tcp = { position = [0.3, 0, 0] }\n").model
    assert model.frame("arm").name == "grip"
    np.testing.assert_allclose(model.frame("arm").body_from_frame[:3, 3], [0.3, 0, 0])
    assert cell(tmp_path / "without", GRIP).model.frame("arm").name == "arm/tip"
    named = made(
        tmp_path / "named",
        TWO_R + 'tool = "l1"\n' + GRIP + "tcp = { position = [0.3, 0, 0] }\n",
        {"arm.urdf": two_r()},
    )
    assert named.model.frame("arm").name == "arm/l1"


def test_what_moves(tmp_path):
    model = cell(tmp_path, GRIP + PART + '[[parts]]\nname = "table"\nshape = { box = [1, 1, 1] }\n').model
    robot = model.robot("arm")

    def names(indices):
        return [model.bodies[i].name for i in indices]

    assert names(robot.bodies) == ["arm/l1", "arm/l2"]
    assert names(robot.carried) == ["grip", "part"]
    assert set(names(robot.moving)) == {"arm/l1", "arm/l2", "grip", "part"}
    assert set(names(model.select("arm"))) == {"arm/l1", "arm/l2", "grip", "part"}
    assert names(model.select("arm/l*")) == ["arm/l1", "arm/l2"]
    assert names(model.select("grip")) == ["grip"]


def test_every_joint_has_its_actuator_in_order(tmp_path):
    mj = cell(tmp_path, "").model.mj
    assert mj.nu == mj.nv
    assert mj.actuator_trnid[:, 0].tolist() == list(range(mj.nv))


def test_limits_of_the_file_win_and_say_so(tmp_path):
    station = made(
        tmp_path, TWO_R + "torque_limits = [7, 8]\nvelocity_limits = [1, 2]\n", {"arm.urdf": two_r()}
    )
    robot = station.model.robot("arm")
    assert [x.value for x in robot.effort_limits] == [7, 8]
    assert [x.value for x in robot.velocity_limits] == [1, 2]
    assert {x.origin for x in robot.effort_limits} == {"given"}


@pytest.mark.parametrize(
    ("text", "key", "what"),
    [
        ("q = [1]\n", "q", "arm has 2 joints: give 2"),
        ("torque_limits = [1]\n", "torque_limits", "j1, j2"),
        ("rotor_inertia = [1, -1]\n", "rotor_inertia", "0 or more"),
        ("[robots.masses]\nl3 = { mass = 1 }\n", "masses.l3", "known: base, l1, l2"),
        ('tool = "tpi"\n', "tool", "known: arm/base, arm/l1"),
        ('arguments = { length = "1" }\n', "arguments", "arm.urdf is not a xacro file"),
        (GRIP.replace("arm/tip", "arm/tpi"), "tools[0]", "did you mean 'arm/tip'"),
        ('[[areas]]\nname = "a"\nshape = { sphere = 1 }\non = "arm/l9"\n', "areas[0]", "arm/l9"),
        ('[[parts]]\nname = "p"\nmesh = "missing.stl"\nunits = "m"\n', "parts[0]", "missing.stl"),
    ],
)
def test_mistakes_name_file_key_and_remedy(tmp_path, text, key, what):
    with pytest.raises(InputError) as error:
        cell(tmp_path, text)
    (problem,) = error.value.problems
    assert key in problem.key
    assert what in str(problem)
    assert problem.file


@pytest.mark.parametrize("name", ["arm/l1", "op/head", "world"])
@pytest.mark.parametrize("group", ["parts", "tools", "areas"])
def test_a_name_that_a_link_a_bone_or_the_world_has_is_refused(tmp_path, group, name):
    thing = f'[[{group}]]\nname = "{name}"\nshape = {{ sphere = 0.1 }}\n'
    thing += 'on = "arm/tip"\nmass = 1\n' if group == "tools" else ""
    with pytest.raises(InputError, match=rf"{group}\[0\] \(name\): the name '{name}' is taken"):
        made(tmp_path, FLOATING + TWO_R + person() + thing, {"arm.urdf": two_r()})


def test_mistakes_of_several_tables_come_together(tmp_path):
    wrong = '[[parts]]\nname = "{0}"\nmesh = "{0}.stl"\nunits = "m"\n'
    with pytest.raises(InputError) as error:
        cell(tmp_path, "q = [1]\n" + wrong.format("a") + wrong.format("b"))
    assert len(error.value.problems) == 3


def test_placeholder_of_an_unknown_mass_moves_the_twin_and_is_reported(tmp_path):
    import re

    bare = re.sub(r"<inertial>.*?</inertial>", "", two_r())
    model = made(tmp_path, TWO_R, {"arm.urdf": bare}).model
    assert (model.mj.body_mass[model.robot("arm").mj_bodies[:2]] > 0.1).all()
    assert any("UNDECIDED" in finding.text for finding in model.findings)
    assert all(body.mass is None for body in model.bodies)


def test_massless_frame_between_joints_changes_nothing(tmp_path):
    """Two joints on one link, or a bare link between them: the same mass matrix."""
    bare = two_r().replace(
        '<joint name="j2"',
        '<link name="mid"/><joint name="jm" type="continuous"><parent link="l1"/><child link="mid"/>'
        '<origin xyz="1 0 0"/><axis xyz="1 0 0"/><limit effort="9" velocity="9"/></joint><joint name="j2"',
    )
    bare = bare.replace(
        '<parent link="l1"/><child link="l2"/><origin xyz="1 0 0"/>',
        '<parent link="mid"/><child link="l2"/><origin xyz="0 0 0"/>',
    )
    station = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": bare})
    robot = station.model.robot("arm")
    assert not robot.unknown_masses
    M = state_at(station, arm=((0, 0, np.pi / 2), (0, 0, 0))).mass_matrix(robot)
    keep = [i for i, joint in enumerate(robot.joints) if joint.name != "jm"]
    np.testing.assert_allclose(M[np.ix_(keep, keep)], [[3, 1], [1, 1]], atol=1e-9)


def test_extreme_points_bound_every_point_of_the_solids():
    from seerob.core.shapes import Solid
    from seerob.description.shapes.shapes import box_mesh

    solids = [
        capsule(np.zeros(3), np.array([0, 0, 1.0]), 0.1),
        Solid(mesh=box_mesh(np.ones(3), 2 * np.ones(3))),
    ]
    points, radius = extreme_points(solids)
    assert radius == 0.1
    for direction in np.random.default_rng(0).normal(size=(50, 3)):
        u = direction / np.linalg.norm(direction)
        support = max(max(np.array([[0, 0, 0], [0, 0, 1]]) @ u) + 0.1, (solids[1].mesh.vertices @ u).max())
        assert (points @ u).max() + radius >= support - 1e-12


def test_compiled_model_is_the_same_each_time(tmp_path):
    a, b = (cell(tmp_path, GRIP + PART).model for _ in range(2))
    for name in ("body_mass", "body_inertia", "body_pos", "body_quat", "jnt_axis", "dof_armature"):
        assert (getattr(a.mj, name) == getattr(b.mj, name)).all()
    assert [x.mesh for x in a.bodies] == [x.mesh for x in b.bodies]
    assert a.files == b.files
    assert a.mj.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST


def limited(lower, upper):
    return (
        two_r()
        .replace('type="continuous"', 'type="revolute"')
        .replace("<limit", f'<limit lower="{lower}" upper="{upper}"')
    )


def test_a_pose_beyond_position_limits_is_refused_joint_by_joint(tmp_path):
    with pytest.raises(InputError) as error:
        made(tmp_path, TWO_R + "q_deg = [90, -20]\n", {"arm.urdf": limited(-0.1, 1)})
    first, second = error.value.problems
    assert first.key == "robots[0] (q)"
    assert "'j1' at 1.571 rad (90.0°), above its limit 1 rad (57.3°)" in first.what
    assert "'j2' at -0.3491 rad (-20.0°), below its limit -0.1 rad (-5.7°)" in second.what
    assert "give -0.1 rad (-5.7°) to 1 rad (57.3°)" in first.remedy


def test_a_pose_at_its_limits_is_accepted(tmp_path):
    robot = made(tmp_path, TWO_R + "q = [1, -0.1]\n", {"arm.urdf": limited(-0.1, 1)}).model.robot("arm")
    np.testing.assert_allclose(robot.home, [1, -0.1])


def test_joints_of_a_person_beyond_their_limits_are_refused(tmp_path):
    person = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
    with pytest.raises(InputError, match=r"300\.0° is beyond its limit; give 0…\d+°"):
        made(tmp_path, person + "joints_deg = { right_elbow_flexion = 300 }\n")


@pytest.mark.parametrize(
    ("text", "files", "assumed"),
    [
        (TWO_R + GRIP, two_r(), True),
        (TWO_R + GRIP + "tcp = { position = [0.3, 0, 0] }\n", two_r(), False),
        (TWO_R + 'tool = "tip"\n', two_r(), False),
        (TWO_R, two_r().replace('"tip"', '"flange"'), False),
        ('[[robots]]\nname = "arm"\nmodel = "library:iiwa7"\n', "", False),
    ],
)
def test_a_point_of_interest_that_nobody_named_is_assumed(tmp_path, text, files, assumed):
    model = made(tmp_path, FLOATING + text, {"arm.urdf": files}).model
    said = [f for f in model.findings if "point of interest" in f.text]
    assert [(f.level, f.subject) for f in said] == [("assumed", "arm")] * assumed


# -- files that travel --------------------------------------------------------------------------


def written(folder, *names):
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(name.encode())


@pytest.mark.parametrize(
    ("reference", "name", "disk", "wanted"),
    [
        ("arm.urdf", "arm.urdf", "arm.urdf", "arm.urdf"),
        ("robots/a/arm.urdf", "../meshes/l.stl", "robots/meshes/l.stl", "robots/meshes/l.stl"),
        ("robots/arm.urdf", "package://pkg/m/l.stl", "robots/pkg/m/l.stl", "robots/pkg/m/l.stl"),
        ("pkg/urdf/arm.urdf", "package://pkg/m/l.stl", "pkg/m/l.stl", "pkg/m/l.stl"),
        ("robots/arm.urdf", "package://named/l.stl", "vendor/l.stl", "vendor/l.stl"),
        ("../arm.urdf", "arm.urdf", "../arm.urdf", "outside/r/arm.urdf"),
        ("library:ur10", "library/ur10.toml", "x", "outside/r/library/ur10.toml"),
        ("package:some/arm.urdf", "package://pkg/l.stl", "x", "outside/r/pkg/l.stl"),
    ],
)
def test_files_travel_under_the_name_the_workstation_finds_them_by(tmp_path, reference, name, disk, wanted):
    folder = tmp_path / "cell"
    folder.mkdir()
    written(folder, disk)
    content = disk.encode() if disk != "x" else b"other"
    placed = filed(
        "r", {name: content}, folder=folder, references=(reference, None), packages={"named": "vendor"}
    )
    assert placed == {wanted: content}


def test_what_is_not_where_its_name_says_is_kept_where_it_would_be_found(tmp_path):
    """A file of the same size is not the same; packages are found beside the robot."""
    (tmp_path / "arm.urdf").write_bytes(b"one")
    names = {
        "arm.urdf": "outside/r/arm.urdf",
        "package://pkg/l.stl": "pkg/l.stl",
        "model://m/l.stl": "m/l.stl",
        "http://pkg/n.stl": "outside/r/pkg/n.stl",
    }
    placed = filed("r", dict.fromkeys(names, b"two"), folder=tmp_path, references=("arm.urdf",))
    assert placed == dict.fromkeys(names.values(), b"two")


def test_no_name_leads_out_of_the_folder(tmp_path):
    names = ["/etc/passwd", "../../x", "package://../../y", "file:///etc/z", "C:\\w", "a/../../../v"]
    placed = filed("r", dict.fromkeys(names, b""), folder=tmp_path, references=("arm.urdf",))
    assert len(placed) == len(names)
    assert all(not key.startswith(("/", "..")) and ".." not in key.split("/") for key in placed)


def test_warnings_of_the_physics_leave_no_file_behind(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ball = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(ball)
    data.qpos[0] = np.nan
    mujoco.mj_step(ball, data)
    assert data.warning[mujoco.mjtWarning.mjWARN_BADQPOS].number == 1
    assert list(tmp_path.iterdir()) == []
