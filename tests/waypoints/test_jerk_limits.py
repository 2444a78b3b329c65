"""Speed, acceleration and jerk by finite differences at 1 kHz, through moves, blends and stops."""

import numpy as np
import pytest

from seerob.core.transforms import rotation_from_rpy, wxyz_from_rotation
from seerob.description.robots import library
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.continuous import Wish, continuous
from seerob.files.waypoints.timing import JointLimits
from seerob.files.waypoints.waypoint import Move, Program, ToolPose, Waypoint

HOME = np.array([0.0, -1.2, 1.4, -1.7, -1.57, 0.0])
JOINT, TOOL = (1.0, 2.0, 20.0), (0.25, 1.0, 10.0)
"""Speed, acceleration and jerk of the leading joint [rad/s …] and of the tool point [m/s …]."""
WISH = Wish(
    joint_speed=JOINT[0],
    joint_acceleration=JOINT[1],
    joint_jerk=JOINT[2],
    tool_speed=TOOL[0],
    tool_acceleration=TOOL[1],
    tool_jerk=TOOL[2],
    period=0.001,
)
FREE = JointLimits.of(6, speed=(9.0,))


@pytest.fixture(scope="module")
def arm():
    return Arm(library.load("ur10e"), base="base")


def moved(arm, waypoints, limits=FREE):
    found = continuous(Program("p", tuple(waypoints)), arm, WISH, limits=limits)
    return found.trajectory.q[:-1]  # the last sample is no whole period after the one before


def derivatives(values):
    """Largest of each column over time, of speed, acceleration and jerk, at 1 kHz."""
    return [np.abs(np.diff(values, order, axis=0)).max(axis=0) / 0.001**order for order in (1, 2, 3)]


@pytest.mark.parametrize("seed", range(3))
def test_joint_moves_with_blends_keep_every_limit_of_every_joint(arm, seed):
    random = np.random.default_rng(seed)
    goals = HOME + random.uniform(-0.8, 0.8, (8, 6))
    blends = random.choice([0.0, 0.01, 0.05, 0.2, 1.0], 8)
    q = moved(
        arm,
        [
            Waypoint(place=f"{i}", q=tuple(g), blend=b)
            for i, (g, b) in enumerate(zip(goals, blends, strict=True))
        ],
    )
    for found, limit in zip(derivatives(q), JOINT, strict=True):
        assert found.max() <= limit * (1 + 1e-4)
        assert found.max() > 0.5 * limit


@pytest.mark.parametrize("seed", range(3))
def test_linear_moves_with_blends_keep_every_limit_of_the_tool_point(arm, seed):
    random = np.random.default_rng(seed)
    places = np.array([-0.75, 0.0, 0.4]) + random.uniform(-0.2, 0.2, (6, 3))
    turns = np.array([np.pi, 0.0, 0.0]) + random.uniform(-0.3, 0.3, (6, 3))
    points = [Waypoint(place="home", q=tuple(HOME))]
    for k, (place, turn) in enumerate(zip(places, turns, strict=True)):
        pose = ToolPose(tuple(place), tuple(wxyz_from_rotation(rotation_from_rpy(turn))))
        move = Move.LINEAR if k else Move.JOINT
        points.append(
            Waypoint(place=f"{k}", move=move, pose=pose, blend=random.choice([0.0, 0.01, 0.04]) if k else 0.0)
        )
    q = moved(arm, points)
    at = arm.posture(q).position
    begin = int(np.argmin(np.linalg.norm(at - places[0], axis=1))) + 3
    tool = at[begin:]
    for order, limit in enumerate(TOOL, start=1):
        size = np.linalg.norm(np.diff(tool, order, axis=0), axis=1).max() / 0.001**order
        assert 0.5 * limit < size <= limit * (1 + 1e-3)
    # Nobody limited the jerk of the joints there, but no acceleration jumps.
    assert derivatives(q[begin:])[2].max() < 100


def test_blends_keep_the_speed_limits_of_the_joints(arm):
    corner = [(-0.7, -0.2, 0.5), (-0.7, 0.2, 0.5), (-0.5, 0.2, 0.6)]
    points = [
        Waypoint(
            place=f"{k}",
            move=Move.LINEAR if k else Move.JOINT,
            pose=ToolPose(p, (0.0, 1.0, 0.0, 0.0)),
            blend=0.05 if k else 0.0,
        )
        for k, p in enumerate(corner)
    ]
    slow = JointLimits.of(6, speed=(0.2,))
    q = moved(arm, [Waypoint(place="home", q=tuple(HOME), speed=0.1), *points], limits=slow)
    assert 0.15 < derivatives(q)[0].max() <= 0.2 * (1 + 1e-4)


def test_a_linear_corner_between_a_joint_and_a_tool_move_is_smooth(arm):
    goal = ToolPose((-0.7, 0.0, 0.4), (0.0, 1.0, 0.0, 0.0))
    q = moved(
        arm,
        [
            Waypoint(place="a", q=tuple(HOME)),
            Waypoint(place="b", q=tuple(np.add(HOME, (0.3, 0.1, -0.1, 0.0, 0.0, 0.2))), blend=0.05),
            Waypoint(place="c", move=Move.LINEAR, pose=goal),
        ],
    )
    assert 20.0 < derivatives(q)[2].max() < 60.0


@pytest.mark.parametrize("seed", range(3))
def test_every_move_keeps_what_the_joints_may_do(arm, seed):
    random = np.random.default_rng(seed)
    acceleration, jerk = random.uniform(0.3, 1.5, 6), random.uniform(1.5, 9.0, 6)
    own = JointLimits.of(6, speed=(9.0,), acceleration=acceleration, jerk=jerk)
    points = [Waypoint(place="home", q=tuple(HOME))]
    for k, place in enumerate(np.array([-0.7, 0.0, 0.4]) + random.uniform(-0.25, 0.25, (5, 3))):
        turn = np.array([np.pi, 0.0, 0.0]) + random.uniform(-0.4, 0.4, 3)
        pose = ToolPose(tuple(place), tuple(wxyz_from_rotation(rotation_from_rpy(turn))))
        move = Move.LINEAR if k % 3 else Move.JOINT
        points.append(Waypoint(place=f"{k}", move=move, pose=pose, blend=random.choice([0.0, 0.03])))
    _, a, j = derivatives(moved(arm, points, limits=own))
    for found, limit in ((a, acceleration), (j, jerk)):
        assert (found <= limit * (1 + 1e-3)).all()
    # As a whole it is slowed no more than some joint needs.
    assert max((a / acceleration).max(), (j / jerk).max()) > 0.7


def test_a_move_that_is_slowed_for_a_joint_says_for_which_and_how_much(arm):
    goal = ToolPose((-0.7, 0.0, 0.4), (0.0, 1.0, 0.0, 0.0))
    points = Waypoint(place="a", q=tuple(HOME)), Waypoint(place="b", move=Move.LINEAR, pose=goal)
    own = JointLimits.of(6, acceleration=(0.4,), jerk=(4.0,))
    found, free = (continuous(Program("p", points), arm, WISH, limits=each) for each in (own, FREE))
    (doubt,) = [text for text in found.deviations if "slowed by" in text]
    assert "keeps its limit of" in doubt
    k = float(doubt.split("slowed by ")[1].split()[0])
    assert found.trajectory.duration == pytest.approx(k * free.trajectory.duration, rel=1e-2)
    assert "do not limit" not in " ".join(found.remarks)


def test_what_joints_reach_on_a_linear_move_is_said(arm):
    goal = ToolPose((-0.7, 0.0, 0.4), (0.0, 1.0, 0.0, 0.0))
    points = Waypoint(place="a", q=tuple(HOME)), Waypoint(place="b", move=Move.LINEAR, pose=goal)
    found = continuous(Program("p", points), arm, WISH, limits=FREE)
    sizes = derivatives(found.trajectory.q[:-1])
    (text,) = [r for r in found.remarks if r.startswith("joints reach, over 0.001 s")]
    assert (
        f"acceleration of {sizes[1].max():.3g} rad/s² ({arm.joints[int(np.argmax(sizes[1]))].name})" in text
    )
    assert f"jerk of {sizes[2].max():.3g} rad/s³" in text
