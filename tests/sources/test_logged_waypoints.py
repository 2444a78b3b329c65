"""Logs as waypoints: near what was logged, stops where the robot stood, drawn in a workstation."""

import numpy as np
import pytest
import test_kuka_log
import test_robodk
from made_motion import target

import seerob
from kept_run import Kept
from seerob.core.errors import InputError
from seerob.core.samples import JointSample
from seerob.core.snapshot import Polyline, Sphere
from seerob.devices.sources.waypoints import Waypoints, reduced
from seerob.files.trajectories.trajectory import Trajectory

GIVEN = {"joint_speed": 1.0, "joint_acceleration": 2.0, "joint_jerk": 20.0}


def far(q, path):
    """Largest distance of rows from a polyline, in any joint."""
    a, d = path[:-1], np.diff(path, axis=0)
    share = np.einsum("mkn,kn->mk", q[:, None] - a, d) / np.maximum((d * d).sum(axis=1), 1e-300)
    off = q[:, None] - a - np.clip(share, 0, 1)[..., None] * d
    return np.abs(off).max(axis=2).min(axis=1).max()


def program_of(motion, tolerance):
    program = reduced(motion, tolerance)
    return program, np.array([w.q for w in program.waypoints])


def curve(n=400):
    t = np.linspace(0.0, 4.0, n)
    return t, np.column_stack([np.sin(t), 0.5 * np.cos(2 * t), 0.1 * t])


@pytest.mark.parametrize("tolerance", [1e-3, 1e-2, 0.1])
def test_every_row_is_within_the_tolerance_of_the_moves(tolerance):
    t, q = curve()
    _, path = program_of(Trajectory(file="log", t=t, q=q), tolerance)
    assert far(q, path) <= tolerance
    np.testing.assert_array_equal(path[[0, -1]], q[[0, -1]])
    # A circle's sagitta: fewer for a larger tolerance, as its root.
    assert len(path) < 12 / np.sqrt(tolerance)


def test_a_line_is_two_waypoints_and_a_stand_is_a_pause():
    way = np.concatenate([np.linspace(0, 1, 50), np.full(30, 1.0), np.linspace(1, 0.2, 40)])
    noise = 5e-5 * np.random.default_rng(1).standard_normal((120, 2))
    t = 0.02 * np.arange(120)
    program, path = program_of(Trajectory(file="log", t=t, q=np.column_stack([way, 2 * way]) + noise), 2e-3)
    np.testing.assert_allclose(path, [[0, 0], [1, 2], [0.2, 0.4]], atol=2e-3)
    assert [w.pause for w in program.waypoints] == pytest.approx([0.0, 0.6, 0.0], abs=0.05)
    assert [w.blend for w in program.waypoints] == [np.inf, 0.0, 0.0]


def test_a_log_of_a_robot_that_stands_is_refused():
    with pytest.raises(InputError, match="nothing moves"):
        reduced(Trajectory(file="log", t=np.arange(9.0), q=np.zeros((9, 2))), 0.01)


def logged(folder, kind):
    if kind == "robodk":
        _, q, _ = test_robodk.write(folder / "log.csv")
        return "log.csv", q, "ur10"
    _, q = test_kuka_log.write(folder / "log.log")
    return "log.log", q, "iiwa14"


@pytest.mark.parametrize("kind", ["robodk", "kuka"])
def test_a_log_is_driven_through_and_drawn(tmp_path, kind):
    file, q, robot = logged(tmp_path, kind)
    (tmp_path / "workstation.toml").write_text(
        f"""
[[robots]]
name = "arm"
model = "library:{robot}"

[[sources]]
kind = "waypoints"
robot = "arm"
file = "{file}"
tolerance = 0.002
joint_speed = 1.0
joint_acceleration = 2.0
joint_jerk = 20.0

[[safety]]
kind = "waypoints"
name = "drawn"
robot = "arm"
""",
        encoding="utf-8",
    )
    station = seerob.load(tmp_path)
    ((source, opened),) = station.sources
    found = np.array([s.q for s in opened.samples if isinstance(s, JointSample)])
    assert far(found, q) < 3 * 0.002
    assert np.abs(found[-1] - q[-1]).max() < 1e-9
    assert any("waypoints of" in f.text and "within 0.002" in f.text for f in opened.findings)
    kept = Kept()
    station.run(writers=[kept], stop=lambda: bool(kept.snapshots))
    (drawn,) = kept.snapshots[0].results
    balls = [m for m in drawn.markers if isinstance(m, Sphere)]
    assert len(balls) == len(source.program(tmp_path / file).waypoints)
    assert [isinstance(m, Polyline) for m in drawn.markers].count(True) == 1
    assert drawn.value < 1e-3


def test_a_log_without_a_tolerance_is_asked_about(tmp_path):
    test_robodk.write(tmp_path / "log.csv")
    source = Waypoints(robot="ur10", file="log.csv", **GIVEN)
    with pytest.raises(InputError, match=r'tolerance: .*kind = "robodk"'):
        source.open(tmp_path, target())
