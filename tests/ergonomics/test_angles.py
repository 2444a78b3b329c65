"""Anatomical angles against the joints they come from, in a mirror, and turned about the vertical."""

import sys
from dataclasses import fields

import numpy as np
import pytest
from made_postures import PERSON, degrees, made_angles, posed, random_q

from seerob.core.transforms import rotation_from_axis_angle
from seerob.description.humans.angles import NEEDS, SIDED, Angles, angles
from seerob.description.humans.skeleton import BONES, bone_poses, mirrored

ODD = ("trunk_side_bend", "trunk_twist", "neck_side_bend", "neck_twist")
"""Angles that change sign in a mirror."""


@pytest.mark.parametrize(
    ("joint", "angle", "expected"),
    [
        ("pelvis_tilt_forward", "trunk_flexion", 30),
        ("lumbar_flexion", "trunk_flexion", 30),
        ("thorax_extension", "trunk_flexion", -10),
        ("thorax_bend_left", "trunk_side_bend", -15),
        ("lumbar_bend_right", "trunk_side_bend", 15),
        ("thorax_turn_left", "trunk_twist", 25),
        ("thorax_turn_right", "trunk_twist", -25),
        ("neck_flexion", "neck_flexion", 20),
        ("head_extension", "neck_flexion", -12),
        ("neck_bend_right", "neck_side_bend", 20),
        ("head_turn_left", "neck_twist", 35),
        ("both_shoulder_flexion", "shoulder_flexion", 120),
        ("both_shoulder_extension", "shoulder_flexion", -40),
        ("both_shoulder_abduction", "shoulder_abduction", 70),
        ("both_shoulder_abduction", "shoulder_elevation", 70),
        ("both_shoulder_internal_rotation", "shoulder_rotation", 50),
        ("both_clavicle_elevation", "clavicle_elevation", 20),
        ("both_elbow_flexion", "elbow_flexion", 100),
        ("both_elbow_pronation", "forearm_rotation", 160),
        ("both_wrist_flexion", "wrist_flexion", 40),
        ("both_wrist_extension", "wrist_flexion", -40),
        ("both_wrist_ulnar_deviation", "wrist_deviation", 15),
        ("both_wrist_radial_deviation", "wrist_deviation", -15),
        ("both_knee_flexion", "knee_flexion", 75),
    ],
)
def test_one_joint_is_one_angle(joint, angle, expected):
    size = abs(expected)
    offset = -90 if angle == "forearm_rotation" else 0
    found = posed(**{joint: size})
    assert degrees(found, angle) == pytest.approx(np.full(np.shape(degrees(found, angle)), expected + offset))


def test_angles_survive_the_order_of_turns():
    """A bent and turned back still has its flexion: the twist is about its long axis."""
    found = posed(thorax_turn_left=30, both_shoulder_flexion=60, both_elbow_flexion=90, neck_turn_right=25)
    assert degrees(found, "trunk_twist") == pytest.approx(30)
    assert degrees(found, "neck_twist") == pytest.approx(-25)
    assert degrees(found, "shoulder_flexion") == pytest.approx([60, 60])
    assert degrees(found, "trunk_flexion") == pytest.approx(0, abs=1e-9)


def test_an_arm_that_reaches_forward_is_not_abducted():
    found = posed(both_shoulder_flexion=85, both_shoulder_abduction=5)
    assert degrees(found, "shoulder_abduction") == pytest.approx([5, 5])


def test_an_arm_beyond_the_vertical_is_still_raised_forward():
    """Just beyond 180° the arc tangent says -179°, which would be the score of an arm that hangs back."""
    bent_back = posed(both_shoulder_flexion=180, both_clavicle_elevation=0, thorax_extension=0)
    rotations, positions = bone_poses(PERSON, np.zeros(53))
    index = BONES.index("right_upper_arm")
    rotations[index] = rotations[index] @ rotation_from_axis_angle([0, 0, 1], np.radians(185))
    assert degrees(angles(rotations, positions), "shoulder_flexion")[0] == pytest.approx(185)
    assert degrees(bent_back, "shoulder_flexion") == pytest.approx([180, 180])


@pytest.mark.parametrize(("inward", "crosses"), [(70, True), (20, False)])
def test_a_wrist_beyond_the_middle_of_the_trunk(inward, crosses):
    found = posed(both_elbow_flexion=90, both_shoulder_internal_rotation=inward)
    assert (found.wrist_across > 0).tolist() == [crosses, crosses]
    assert found.forearm_out == pytest.approx(-np.radians([inward, inward]))


def test_a_bent_back_does_not_turn_the_arm():
    """Arm angles belong to the thorax: they stay when the trunk bends, gravity's stay with gravity."""
    upright, bent = posed("hands_up"), posed("hands_up", pelvis_tilt_forward=40)
    assert bent.shoulder_flexion == pytest.approx(upright.shoulder_flexion)
    assert degrees(upright, "arm_rise") == pytest.approx([45, 45], abs=10)
    assert degrees(bent, "trunk_flexion") == pytest.approx(40)


def test_a_mirror_changes_sides_and_nothing_else():
    q = random_q(200)
    one, other = (angles(*bone_poses(PERSON, values)) for values in (q, mirrored(q)))
    for field in fields(Angles):
        a, b = getattr(one, field.name), getattr(other, field.name)
        expected = a[..., ::-1] if field.name in SIDED else -a if field.name in ODD else a
        assert np.abs(np.sin((b - expected) / 2)).max() < 1e-7, field.name


def test_heading_and_place_change_nothing():
    rotations, positions = bone_poses(PERSON, random_q(50))
    turn = rotation_from_axis_angle([0, 0, 1], 2.1)
    moved = angles(turn @ rotations, positions @ turn.T + [3.0, -2.0, 0.5])
    still = angles(rotations, positions)
    for field in fields(Angles):
        assert np.abs(np.sin((getattr(moved, field.name) - getattr(still, field.name)) / 2)).max() < 1e-7


def test_a_batch_is_its_postures_one_by_one():
    rotations, positions = bone_poses(PERSON, random_q(6))
    every = angles(rotations.reshape(2, 3, 21, 3, 3), positions.reshape(2, 3, 21, 3))
    single = angles(rotations[4], positions[4])
    for field in fields(Angles):
        assert getattr(every[1, 1], field.name) == pytest.approx(getattr(single, field.name), abs=1e-12)


@pytest.mark.parametrize("name", sorted(NEEDS))
def test_an_angle_is_made_of_the_bones_that_it_says(name):
    """Turning any other bone leaves it, turning its own does not: `NEEDS` is what the formula uses."""
    rotations, positions = bone_poses(PERSON, random_q(1, seed=3)[0])
    before = getattr(angles(rotations, positions), name)
    turn = rotation_from_axis_angle([0.3, -0.5, 0.8], 0.2)
    bones = {bone.format(side=side) for bone in NEEDS[name] for side in ("right", "left")}
    uses = set()
    for i, bone in enumerate(BONES):
        turned = rotations.copy()
        turned[i] = turn @ rotations[i]
        if not np.allclose(getattr(angles(turned, positions), name), before, atol=1e-12):
            uses.add(bone)
    assert uses <= bones


def test_what_is_not_measured_is_not_assessed():
    found = made_angles().without(["left_hand", "head"])
    assert np.isnan(found.wrist_flexion).tolist() == [False, True]
    assert np.isnan(found.neck_flexion)
    assert not np.isnan(found.trunk_flexion)
    assert np.isnan(made_angles().without(["thorax"]).shoulder_flexion).all()


def test_a_posture_has_the_same_angles_alone_and_among_others_bit_for_bit():
    R, x = bone_poses(PERSON, random_q(40))
    every = angles(R[:, None], x[:, None])
    for k in range(len(R)):
        alone = angles(R[k], x[k])
        for field in fields(Angles):
            one, of_all = getattr(alone, field.name), getattr(every, field.name)[k, 0]
            assert np.asarray(one).tobytes() == np.asarray(of_all).tobytes(), field.name


@pytest.mark.parametrize("side", ["right", "left"])
def test_of_a_foot_that_is_nowhere_nobody_knows_which_is_lower(side):
    R, x = bone_poses(PERSON, random_q(1)[0])
    x[BONES.index(f"{side}_foot")] = np.nan
    assert np.isnan(angles(R, x).foot_rise).all()


def test_an_angle_costs_no_call_of_its_own():
    R, x = bone_poses(PERSON, random_q(1)[0])
    calls = []

    def count(frame, event, called):
        calls.append(called) if event == "c_call" else None

    angles(R, x)
    sys.setprofile(count)
    try:
        angles(R, x)
    finally:
        sys.setprofile(None)
    assert len(calls) < 20
