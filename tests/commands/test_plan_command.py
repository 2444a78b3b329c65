"""`seerob plan` and emulated controllers on waypoints, as a user calls them."""

import os
import signal
import time
import tomllib
from threading import Thread

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import seerob
from seerob.app import cli
from seerob.app.console.interruption import Stopped
from seerob.app.console.terminal import Exit
from seerob.app.emulators import fri, rtde
from seerob.core.errors import InputError
from seerob.description.robots import library
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.inverse import branch

CELL = """
[[robots]]
name = "ur5"
model = "library:ur5"
q_deg = [-60, -70, 80, -100, -90, 0]

[[parts]]
name = "post"
shape = { box = [0.1, 0.1, 0.1] }
at = { position = [2, 0, 0.6] }
"""
SOURCE = """
[[sources]]
kind = "waypoints"
robot = "ur5"
file = "planned.toml"
joint_speed = 1.0
joint_acceleration = 2.0
joint_jerk = 20.0

[[safety]]
kind = "waypoints"
name = "waypoints"
robot = "ur5"
"""


@pytest.fixture
def cell(tmp_path):
    (tmp_path / "workstation.toml").write_text(CELL, encoding="utf-8")
    return tmp_path


def test_a_plan_is_written_run_and_drawn(cell, capsys):
    file = cell / "planned.toml"
    call = ["plan", str(cell), "--to-deg=-40,-70,80,-100,-90,0", "-o", str(file)]
    assert cli.main(call) == Exit.WITHIN
    assert "preliminary" in capsys.readouterr().out
    # What is there is not written over.
    assert cli.main(call) == Exit.ERROR
    (cell / "workstation.toml").write_text(CELL + SOURCE, encoding="utf-8")
    station = seerob.load(cell)
    summary = station.run()
    assert summary.results["waypoints"].min() < 1e-3
    texts = " ".join(f.text for f in station.scene().findings)
    assert "a plan that was not executed" in texts
    (criterion,) = station.scene().criteria
    assert criterion.basis.inputs[0].value == "planned, preliminary"


def test_waypoints_are_drawn_only_of_a_robot_that_has_some(cell):
    (cell / "workstation.toml").write_text(
        CELL + '[[safety]]\nkind = "waypoints"\nrobot = "ur5"\n', encoding="utf-8"
    )
    with pytest.raises(InputError, match="no source of kind waypoints drives ur5"):
        seerob.load(cell).bound  # noqa: B018


def test_of_a_pose_the_way_of_reaching_it_that_is_clear_is_planned(cell, capsys):
    q = np.radians([-40, -70, 80, -100, -90, 0])
    at = Arm(library.load("ur5"), base="base").posture(q)
    numbers = [*at.position.tolist(), *Rotation.from_matrix(at.rotation).as_rotvec().tolist()]
    pose = ", ".join(map(repr, numbers))
    (cell / "goal.script").write_text(f"movej(p[{pose}])", encoding="utf-8")
    call = ["plan", str(cell), "--waypoints", str(cell / "goal.script"), "-o"]
    assert cli.main([*call, str(cell / "p.toml")]) == Exit.WITHIN
    named = str(branch(Arm(library.load("ur5"), base="base").posture(q)))
    assert f"line 1: branch {named}, the first of 8 that is clear" in capsys.readouterr().out
    found = tomllib.loads((cell / "p.toml").read_text(encoding="utf-8"))["waypoints"]
    np.testing.assert_allclose(found[-1]["q"], q, atol=1e-8)
    (cell / "goal.script").write_text(f"movel(p[{pose}])", encoding="utf-8")
    assert cli.main([*call, str(cell / "q.toml")]) == Exit.ERROR


def test_a_path_that_is_not_found_is_undecided(cell):
    (cell / "workstation.toml").write_text(CELL.replace("[2, 0, 0.6]", "[0.5, -0.1, 0.35]"), encoding="utf-8")
    call = ["plan", str(cell), "--to-deg=60,-70,80,-100,-90,0", "--seconds", "1e-9"]
    assert cli.main([*call, "-o", str(cell / "p.toml")]) == Exit.UNDECIDED
    assert not (cell / "p.toml").exists()


LEVER = """<robot name="lever"><link name="base"/><link name="lever"><collision>
<origin xyz="0.5 0 0"/><geometry><box size="1 0.05 0.05"/></geometry></collision></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="lever"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""
BEHIND_A_POST = """
[[robots]]
name = "lever"
model = "lever.urdf"
q = [-1.0]

[[parts]]
name = "post"
shape = { box = [0.1, 0.1, 0.1] }
at = { position = [0.8, 0, 0] }
"""


@pytest.fixture
def behind_a_post(tmp_path):
    (tmp_path / "lever.urdf").write_text(LEVER, encoding="utf-8")
    (tmp_path / "workstation.toml").write_text(BEHIND_A_POST, encoding="utf-8")
    return tmp_path


def test_where_there_is_no_way_it_says_so_and_what_to_do(behind_a_post, capsys):
    call = ["plan", str(behind_a_post), "--to=1", "--seconds", "0.5", "-o", str(behind_a_post / "p.toml")]
    assert cli.main(call) == Exit.UNDECIDED
    said = capsys.readouterr().out
    assert "from start to goal 1: no path was found in 0.5 s" in said
    assert "that there is none is not known; give a posture in between" in said


def test_ctrl_c_ends_a_plan_and_leaves_nothing_behind(behind_a_post, capsys):
    there = sorted(behind_a_post.iterdir())

    def press():
        while not isinstance(getattr(signal.getsignal(signal.SIGINT), "__self__", None), Stopped):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    pressing = Thread(target=press, daemon=True)
    pressing.start()
    try:
        call = ["plan", str(behind_a_post), "--to=1", "--seconds", "300", "-o", str(behind_a_post / "p.toml")]
        assert cli.main(call) == Exit.UNDECIDED
    finally:
        pressing.join()
    assert "stopped after" in capsys.readouterr().out
    assert sorted(behind_a_post.iterdir()) == there


@pytest.mark.parametrize("text", ["1,a", "", "1,,2", "nan"])
def test_a_posture_is_numbers(cell, text):
    with pytest.raises(SystemExit):
        cli.main(["plan", str(cell), f"--to={text}"])


def test_a_posture_may_begin_with_a_minus():
    words = "plan x --from -.1,0 --to -1,-2 --to 3,-4 --to-deg -90,5 --margin 0.1 -- -1"
    with pytest.raises(SystemExit):  # one place too many, and no value is taken for it
        cli.parser().parse_args(words.split())
    found = cli.parser().parse_args(words.split()[:-2])
    assert (found.start, found.to, found.to_deg) == ([-0.1, 0.0], [[-1.0, -2.0], [3.0, -4.0]], [[-90.0, 5.0]])
    assert found.margin == 0.1


@pytest.mark.parametrize(("kind", "options", "n"), [(rtde, rtde.Rtde, 6), (fri, fri.Fri, 7)])
def test_an_emulated_controller_goes_through_waypoints(tmp_path, kind, options, n):
    goals = np.zeros((3, n)) + kind.HOME
    goals[1, 0] += 0.4
    goals[2, 1] -= 0.3
    rows = "\n".join(f"[[waypoints]]\nq = {row.tolist()}" for row in goals)
    (tmp_path / "w.toml").write_text(rows, encoding="utf-8")
    server = options(waypoints=str(tmp_path / "w.toml")).ready().server
    q = np.array([server.motion(t)[0] for t in np.arange(0.0, 12.0, 0.02)])
    assert [np.abs(q - goal).max(axis=1).min() < 0.01 for goal in goals] == [True] * 3
    np.testing.assert_allclose(q[-1], goals[-1], atol=1e-9)


def test_a_pose_as_the_first_waypoint_starts_where_the_emulator_stands(tmp_path):
    (tmp_path / "w.script").write_text("movej(p[-0.7, -0.2, 0.5, 3.14, 0, 0])", encoding="utf-8")
    q, _ = rtde.Rtde(waypoints=str(tmp_path / "w.script")).ready().server.motion(0.0)
    assert q == pytest.approx(rtde.HOME)
