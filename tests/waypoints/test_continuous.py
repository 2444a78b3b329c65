"""Continuous motion through waypoints: geometry, limits, timing, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.description.robots import library
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.continuous import Wish, continuous
from seerob.files.waypoints.inverse import parse, rotation_vectors, solutions
from seerob.files.waypoints.timing import JointLimits, Limits, needed, profile, reachable
from seerob.files.waypoints.waypoint import Move, Program, ToolPose, Waypoint

HOME = (0.0, -1.2, 1.4, -1.7, -1.57, 0.0)
DOWN = (0.0, 1.0, 0.0, 0.0)
WISH = Wish(
    joint_speed=1.0,
    joint_acceleration=2.0,
    joint_jerk=20.0,
    tool_speed=0.25,
    tool_acceleration=1.0,
    tool_jerk=10.0,
    period=0.004,
)
FREE = JointLimits.of(6, speed=(9.0,))


@pytest.fixture(scope="module")
def arm():
    return Arm(library.load("ur10e"), base="base")


def to(x, y, z, **more):
    return Waypoint(
        place=f"to {x} {y} {z}", move=more.pop("move", Move.LINEAR), pose=ToolPose((x, y, z), DOWN), **more
    )


def joints(q, place="q", **more):
    return Waypoint(place=place, q=tuple(q), **more)


def made(arm, *waypoints, wish=WISH, limits=FREE):
    return continuous(Program("p", waypoints), arm, wish, limits=limits)


def derivatives(found):
    t, q, qd = found.trajectory.t[:-1], found.trajectory.q[:-1], found.trajectory.qd[:-1]
    return np.gradient(q, t, axis=0, edge_order=2), qd, np.diff(qd, axis=0) / np.diff(t)[:, None]


def test_a_joint_move_is_straight_in_joint_space_and_its_leading_joint_keeps_the_limits(arm):
    goal = np.add(HOME, (0.8, -0.2, 0.1, 0.0, 0.4, -0.5))
    found = made(arm, joints(HOME), joints(goal))
    q = found.trajectory.q - HOME
    share = q[:, :1] / 0.8
    np.testing.assert_allclose(q, share * (goal - HOME), atol=1e-12)
    slope, qd, acceleration = derivatives(found)
    assert np.abs(slope - qd).max() < 20 * 0.004**2
    assert np.abs(qd).max() == pytest.approx(1.0, rel=1e-3)
    assert np.abs(acceleration).max() <= 2.0 + 1e-9
    assert np.abs(np.diff(acceleration, axis=0)).max() / 0.004 <= 20.0 + 1e-6
    # Rest to rest with a plateau of speed: L/v + v/a + a/j.
    assert found.trajectory.duration == pytest.approx(0.8 / 1.0 + 1.0 / 2.0 + 2.0 / 20.0, abs=1e-9)


def test_a_linear_move_is_straight_in_space_and_turns_evenly(arm):
    found = made(arm, joints(HOME), to(-0.7, -0.2, 0.5, move=Move.JOINT), to(-0.6, 0.25, 0.4))
    at = arm.posture(found.trajectory.q)
    a, b = np.array([-0.7, -0.2, 0.5]), np.array([-0.6, 0.25, 0.4])
    begin = int(np.argmin(np.linalg.norm(at.position - a, axis=1)))
    way = at.position[begin:] - a
    across = np.linalg.norm(np.cross(way, (b - a) / np.linalg.norm(b - a)), axis=1)
    assert across.max() < 1e-6
    np.testing.assert_allclose(at.position[-1], b, atol=1e-7)
    np.testing.assert_allclose(at.rotation[-1], np.diag([1, -1, -1]), atol=1e-7)
    speed = np.linalg.norm(np.diff(at.position[begin:-1], axis=0), axis=1) / 0.004
    assert speed.max() == pytest.approx(0.25, rel=1e-3)
    slope, qd, _ = derivatives(found)
    assert np.abs(slope - qd).max() < 2e-3


def test_a_circular_move_keeps_its_distance_from_the_centre(arm):
    via = ToolPose((-0.7 - 0.1, 0.0, 0.4), DOWN)
    found = made(
        arm,
        joints(HOME),
        to(-0.7, -0.1, 0.4, move=Move.JOINT),
        to(-0.7, 0.1, 0.4, move=Move.CIRCULAR, via=via),
    )
    at = arm.posture(found.trajectory.q).position
    begin = int(np.argmin(np.linalg.norm(at - [-0.7, -0.1, 0.4], axis=1)))
    np.testing.assert_allclose(np.linalg.norm(at[begin + 1 :] - [-0.7, 0, 0.4], axis=1), 0.1, atol=1e-6)
    way = np.linalg.norm(np.diff(at[begin:], axis=0), axis=1).sum()
    assert way == pytest.approx(np.pi * 0.1, rel=2e-3)


@pytest.mark.parametrize("move", [Move.LINEAR, Move.JOINT])
def test_a_blend_stays_within_its_radius_does_not_stop_and_its_speed_does_not_jump(arm, move):
    r = 0.05
    corner = np.array([-0.7, 0.2, 0.5])
    points = [(-0.7, -0.2, 0.5), (*corner,), (-0.5, 0.2, 0.6)]
    stops = [to(*p, move=move if i else Move.JOINT) for i, p in enumerate(points)]
    smooth = [stops[0], to(*points[1], move=move, blend=r), stops[2]]
    a, b = made(arm, joints(HOME), *stops), made(arm, joints(HOME), *smooth)
    assert b.trajectory.duration < a.trajectory.duration - 0.1
    _, qd, acceleration = derivatives(b)
    assert np.abs(np.diff(qd, axis=0)).max() < 0.02
    assert np.abs(np.diff(acceleration, axis=0)).max() < 0.5
    position = arm.posture(b.trajectory.q).position
    away = np.linalg.norm(position - corner, axis=1)
    assert 0.005 < away.min() < r
    # Of the way with stops it leaves nothing but the surroundings of the corner.
    straight = arm.posture(a.trajectory.q).position
    off = np.array([np.linalg.norm(straight - p, axis=1).min() for p in position[away > r + 1e-3]])
    assert off.max() < 2e-3
    # It goes on through the corner.
    near = away < r
    assert np.abs(qd[near[:-1]]).max(axis=1).min() > 0.05


def test_a_blend_of_moves_that_are_too_short_is_cut_and_said(arm):
    found = made(arm, joints(HOME), to(-0.7, 0.0, 0.5), to(-0.7, 0.02, 0.5, blend=0.1), to(-0.7, 0.02, 0.52))
    assert any("cut to half" in d for d in found.deviations)


def test_joint_speed_limits_slow_a_linear_move_down_and_say_so(arm):
    slow = JointLimits.of(6, speed=(0.05,))
    found = made(arm, joints(HOME), to(-0.7, -0.2, 0.5), limits=slow)
    assert np.abs(found.trajectory.qd).max() <= 0.05 * (1 + 1e-6)
    assert any("slowed from 0.25" in d for d in found.deviations)


def test_a_tool_that_turns_fast_on_a_short_way_is_pointed_out_or_slowed(arm):
    turn = ToolPose((-0.7, 0.0, 0.5), (0.0, np.cos(0.6), np.sin(0.6), 0.0))
    way = joints(HOME), to(-0.72, 0.0, 0.5, move=Move.JOINT), Waypoint(place="t", move=Move.LINEAR, pose=turn)
    free = made(arm, *way, wish=Wish(**{**vars_of(WISH), "tool_acceleration": 5.0, "tool_jerk": 500.0}))
    assert any("the tool turns at up to" in d for d in free.deviations)
    slow = made(arm, *way, wish=Wish(**{**vars_of(WISH), "tool_turn": 0.5}))
    at = arm.posture(slow.trajectory.q[:-1])
    near = np.linalg.norm(at.position - [-0.71, 0.0, 0.5], axis=1) < 0.009
    r = at.rotation[near]
    rate = np.linalg.norm(rotation_vectors(r[1:] @ np.swapaxes(r[:-1], 1, 2)), axis=1) / 0.004
    assert rate.max() == pytest.approx(0.5, rel=0.01)


def test_a_given_duration_is_kept_or_refused(arm):
    goal = np.array(HOME) + 0.3
    assert made(arm, joints(HOME), joints(goal, duration=4.0)).trajectory.duration == pytest.approx(4.0)
    with pytest.raises(InputError, match=r"0\.1 s is too short: the limits allow 0\."):
        made(arm, joints(HOME), joints(goal, duration=0.1))


def test_pauses_and_repeated_waypoints_take_their_time(arm):
    goal = np.array(HOME) + 0.3
    plain = made(arm, joints(HOME), joints(goal)).trajectory.duration
    paused = made(arm, joints(HOME, pause=0.5), joints(goal, pause=0.25), joints(goal, pause=0.25))
    assert paused.trajectory.duration == pytest.approx(plain + 1.0)
    assert np.abs(paused.trajectory.qd[paused.trajectory.t < 0.5]).max() == 0


def test_the_branch_is_nearest_or_as_wished_and_named(arm):
    pose = to(-0.7, -0.2, 0.5, move=Move.JOINT)
    near = made(arm, joints(HOME), pose)
    assert any("nearest to where the robot is, one of 8" in r for r in near.remarks)
    other = made(arm, joints(HOME), pose, wish=Wish(**{**vars_of(WISH), "branch": parse("+-+")}))
    assert any("branch shoulder +, elbow −, wrist + (as the source says" in r for r in other.remarks)
    assert np.abs(other.at[-1] - near.at[-1]).max() > 0.5
    np.testing.assert_allclose(
        arm.posture(other.at[-1]).position, arm.posture(near.at[-1]).position, atol=1e-8
    )


@pytest.mark.parametrize("first", [True, False])
def test_a_posture_to_be_near_to_chooses_the_branch_wherever_the_robot_is(arm, first):
    target = to(-0.7, -0.2, 0.5, move=Move.JOINT)
    rotation = arm.posture(made(arm, joints(HOME), target).at[-1]).rotation
    ways = solutions(arm, rotation, np.array(target.pose.position), np.array(HOME))
    assert len(ways) == 8
    for way in ways:
        near = tuple(way.q + 0.02 * np.sin(np.arange(6)))
        w = replace(target, near=near)
        found = made(arm, w, joints(HOME)) if first else made(arm, joints(HOME), w)
        np.testing.assert_allclose(found.at[0 if first else -1], way.q, atol=1e-6)
        (said,) = [r for r in found.remarks if "branch" in r]
        assert f"{way.branch} (nearest to qnear, one of 8" in said
    with pytest.raises(InputError, match="5 joint positions, the robot has 6"):
        made(arm, joints(HOME), replace(target, near=near[:5]))


def vars_of(wish):
    return {name: getattr(wish, name) for name in wish.__dataclass_fields__}


def test_a_linear_move_through_the_stretched_arm_is_refused(arm):
    with pytest.raises(
        InputError, match=r"cannot follow the way there beyond \d+ % of it: .* 0\.2\d+ m are missing"
    ):
        made(arm, joints(HOME), to(-1.6, 0.0, 0.2))
    with pytest.raises(InputError, match=r"however it is turned, 0\.2\d+ m are missing"):
        made(arm, joints(HOME), to(-1.6, 0.0, 0.2, move=Move.JOINT))


def test_seven_joints_are_a_doubt():
    seven = Arm(library.load("iiwa14"))
    q = (0.0, 0.5, 0.0, -1.4, 0.0, 1.2, 0.0)
    position = np.add(seven.posture(np.array(q)).position, (0.0, 0.1, 0.0))
    w = Waypoint(place="b", move=Move.LINEAR, pose=ToolPose(tuple(position), DOWN))
    found = continuous(Program("p", (joints(q), w)), seven, WISH, limits=JointLimits.of(7, speed=(9.0,)))
    np.testing.assert_allclose(seven.posture(found.at[-1]).position, position, atol=1e-7)
    assert any("7 joints for a pose of 6" in d for d in found.deviations)


def test_what_nobody_gave_is_asked_for_all_at_once(arm):
    with pytest.raises(InputError) as caught:
        made(arm, joints(HOME), to(-0.7, -0.2, 0.5), wish=Wish())
    assert {p.key for p in caught.value.problems} == {
        "joint_jerk", "joint_speed", "joint_acceleration", "tool_jerk", "tool_speed", "tool_acceleration",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("waypoints", "said"),
    [
        ((), "no waypoints"),
        ((to(-0.7, 0, 0.5),), "its branch depends on where the robot stands"),
        ((joints(HOME), joints(HOME[:5])), "5 joint positions"),
        ((joints(HOME), joints(HOME)), "nothing moves"),
        (
            (
                joints(HOME),
                to(-0.7, 0, 0.5),
                to(-0.7, 0.2, 0.5, move=Move.CIRCULAR, via=ToolPose((-0.7, 0.1, 0.5), DOWN)),
            ),
            "lie on one line",
        ),
    ],
)
def test_what_is_no_motion_is_refused(arm, waypoints, said):
    with pytest.raises(InputError, match=said):
        made(arm, *waypoints)


def test_the_way_that_a_change_of_speed_needs_is_the_one_ruckig_takes():
    limits = Limits(2.0, 1.5, 6.0)
    for v0, v1 in ((0.0, 0.2), (0.1, 1.4), (1.9, 0.3)):
        length = needed(v0, v1, limits)
        timing = profile(length, v0, v1, limits, duration=None, file="", place="")
        assert timing.duration == pytest.approx(2 * length / (v0 + v1), rel=1e-6)
    top = reachable(0.2, 2.0, 0.3, limits)
    assert needed(0.2, top, limits) == pytest.approx(0.3)
    assert reachable(0.2, 0.1, 0.3, limits) == 0.1
