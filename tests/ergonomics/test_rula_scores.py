"""RULA: published tables through the vectors, bands at their edges, modifiers, force, and what is unknown."""

import numpy as np
import pytest
from made_postures import UNSUPPORTED, known, made_angles

from seerob.criteria.ergonomics.rula import (
    LEAST,
    LoadUse,
    Profile,
    Rula,
    force,
    lower_arm,
    neck,
    posture_components,
    rula,
    trunk,
    upper_arm,
    wrist,
)
from seerob.criteria.scoring.measured import ArmPolicy
from seerob.criteria.scoring.spans import ROUNDING, Thresholds, exactly

SEVEN = list(LEAST)[:7]


def scored(angles, *, supported=UNSUPPORTED, back_supported=False, legs=1, **more):
    return posture_components(
        angles,
        thresholds=Thresholds(),
        supported=supported,
        back_supported=back_supported,
        legs=exactly(legs),
        **more,
    )


@pytest.mark.parametrize(
    ("scores", "expected"),
    [
        ((1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0), (1, 1, 1, 1, 1)),
        ((2, 2, 2, 1, 4, 3, 1, 1, 1, 1, 1), (3, 6, 5, 8, 7)),
        ((3, 2, 3, 1, 3, 3, 1, 1, 0, 1, 0), (4, 4, 5, 5, 6)),
        ((4, 3, 4, 2, 4, 4, 2, 1, 3, 1, 3), (6, 7, 10, 11, 7)),
        ((6, 3, 4, 2, 6, 6, 2, 0, 0, 0, 0), (9, 9, 9, 9, 7)),
        ((2, 1, 1, 1, 2, 1, 1, 0, 0, 0, 0), (2, 2, 2, 2, 2)),
        ((3, 1, 2, 1, 1, 2, 1, 1, 0, 0, 0), (4, 2, 5, 2, 4)),
        ((4, 2, 2, 2, 2, 3, 2, 0, 1, 0, 1), (4, 5, 5, 6, 7)),
        ((5, 2, 3, 2, 3, 3, 1, 0, 0, 0, 0), (7, 4, 7, 4, 6)),
        ((1, 2, 2, 1, 3, 1, 2, 0, 0, 0, 0), (2, 3, 2, 3, 3)),
    ],
)
def test_vectors(scores, expected):
    assert tuple(map(int, rula(*scores))) == expected


@pytest.mark.parametrize("scores", [(0, 1, 1, 1, 1, 1, 1), (7, 1, 1, 1, 1, 1, 1), (1, 1, 1, 3, 1, 1, 1)])
def test_a_score_that_the_tables_do_not_have_is_refused(scores):
    with pytest.raises(ValueError, match=" to "):
        rula(*scores)


UP = {"clavicle_elevation": 15, "shoulder_abduction": 40}
SITUATIONS = {
    "E1": (
        {"shoulder_flexion": 30, "elbow_flexion": 90, "wrist_flexion": 10, "neck_flexion": 15},
        {},
        (0, 0, 0, 0),
        (2, 1, 2, 1, 2, 1, 1),
        (3, 2, 3, 2, 3),
    ),
    "E2": (
        {
            "shoulder_flexion": 60,
            "shoulder_abduction": 40,
            "wrist_flexion": 20,
            "neck_flexion": 25,
            "trunk_flexion": 10,
        },
        {},
        (1, 0, 0, 0),
        (4, 1, 3, 1, 3, 2, 1),
        (4, 3, 5, 3, 4),
    ),
    "E3": (
        {
            "shoulder_flexion": 110,
            **UP,
            "elbow_flexion": 110,
            "forearm_out": 60,
            "wrist_flexion": 20,
            "wrist_deviation": 20,
            "forearm_rotation": 70,
            "neck_flexion": -12,
        },
        {},
        (1, 1, 1, 0),
        (6, 3, 4, 2, 4, 1, 1),
        (9, 5, 11, 6, 7),
    ),
    "E4": (
        {
            "shoulder_flexion": 70,
            "elbow_flexion": 40,
            "wrist_flexion": 6,
            "neck_flexion": 5,
            "trunk_flexion": 75,
            "trunk_twist": -30,
        },
        {"legs": 2},
        (0, 3, 0, 3),
        (3, 2, 2, 1, 1, 5, 2),
        (4, 6, 7, 9, 7),
    ),
    "E5": (
        {"shoulder_flexion": 50, "elbow_flexion": 95, "neck_flexion": 5, "trunk_flexion": 2},
        {"supported": exactly([1, 1])},
        (0, 0, 0, 0),
        (2, 1, 1, 1, 1, 1, 1),
        (2, 1, 2, 1, 2),
    ),
    "E6": (
        {
            "shoulder_flexion": -30,
            "elbow_flexion": 70,
            "wrist_deviation": -20,
            "forearm_rotation": -70,
            "neck_flexion": 22,
            "neck_twist": 30,
            "neck_side_bend": -20,
            "trunk_flexion": 12,
            "trunk_side_bend": 20,
        },
        {},
        (1, 0, 1, 0),
        (2, 1, 2, 2, 5, 3, 1),
        (3, 7, 4, 8, 6),
    ),
}


@pytest.mark.parametrize("name", SITUATIONS)
def test_situations(name):
    given, options, added, components, expected = SITUATIONS[name]
    found = known(scored(made_angles(**given), **options))
    assert tuple(found[key] for key in SEVEN) == components
    assert tuple(map(int, rula(*components, *added))) == expected


NOMINAL = Thresholds()


@pytest.mark.parametrize(
    ("score", "below", "edge", "above"),
    [
        (upper_arm, 45, 2, 3),
        (upper_arm, 90, 3, 4),
        (lambda x: neck(x, NOMINAL.neck_extension), 10, 1, 2),
        (lambda x: neck(x, NOMINAL.neck_extension), 20, 2, 3),
        (lambda x: trunk(x, NOMINAL.trunk_upright), 20, 2, 3),
        (lambda x: trunk(x, NOMINAL.trunk_upright), 60, 3, 4),
        (lambda x: wrist(x, NOMINAL.wrist_neutral), 15, 2, 3),
        (lambda x: wrist(-x, NOMINAL.wrist_neutral), 15, 2, 3),
    ],
)
def test_an_edge_belongs_to_the_stricter_band(score, below, edge, above):
    near = np.radians(below) + np.array([-1e-5, -ROUNDING / 2, 0.0, ROUNDING])
    assert score(near).tolist() == [edge, above, above, above]


def test_the_elbow_has_both_ends_outside():
    near = np.radians([59.999, 60, 60.001, 80, 99.999, 100, 100.001])
    assert lower_arm(near).tolist() == [2, 2, 1, 1, 1, 2, 2]


def test_extension():
    assert upper_arm(np.radians([-19, -21, -80])).tolist() == [1, 2, 2]
    assert neck(np.radians([-4, -6, -60]), NOMINAL.neck_extension).tolist() == [1, 4, 4]
    assert trunk(np.radians([-4, -6, -60]), NOMINAL.trunk_upright).tolist() == [1, 2, 2]


@pytest.mark.parametrize(
    ("given", "component"),
    [
        ({"shoulder_abduction": 25}, "upper arm"),
        ({"clavicle_elevation": 8}, "upper arm"),
        ({"forearm_out": 50}, "lower arm"),
        ({"wrist_across": 3}, "lower arm"),
        ({"wrist_deviation": 12}, "wrist"),
        ({"wrist_deviation": -12}, "wrist"),
        ({"forearm_rotation": 50}, "wrist twist"),
        ({"neck_twist": 12}, "neck"),
        ({"neck_side_bend": -12}, "neck"),
        ({"trunk_twist": -12}, "trunk"),
        ({"trunk_side_bend": 12}, "trunk"),
    ],
)
def test_each_modifier_adds_one_to_its_component_alone(given, component):
    plain, more = known(scored(made_angles())), known(scored(made_angles(**given)))
    assert {key: more[key] - plain[key] for key in plain} == {key: int(key == component) for key in plain}


@pytest.mark.parametrize(
    "given", [{"shoulder_abduction": -25}, {"clavicle_elevation": -8}, {"forearm_out": -50}]
)
def test_the_other_direction_adds_nothing(given):
    assert known(scored(made_angles(**given))) == known(scored(made_angles()))


def test_out_to_the_side_and_across_count_once():
    both = known(scored(made_angles(forearm_out=50, wrist_across=3)))
    assert both["lower arm"] == 2


def test_support_of_one_arm_relieves_that_arm_and_never_below_one():
    span = scored(made_angles(shoulder_flexion=50), supported=exactly([1, 0]))["upper arm"]
    assert span.low.tolist() == [2, 3]
    assert scored(made_angles(), supported=exactly([1, 1]))["upper arm"].low.tolist() == [1, 1]


def test_a_supported_back_may_lean_back_but_not_forward():
    back = made_angles(trunk_flexion=-15)
    assert known(scored(back, back_supported=True))["trunk"] == 1
    assert known(scored(back))["trunk"] == 2
    assert [int(x) for x in scored(back, back_supported=None)["trunk"]] == [1, 2]
    assert known(scored(made_angles(trunk_flexion=30), back_supported=True))["trunk"] == 3


@pytest.mark.parametrize(
    ("load", "use", "original", "worksheet"),
    [
        (0.0, LoadUse.INTERMITTENT, 0, 0),
        (1.9, LoadUse.INTERMITTENT, 0, 0),
        (2.0, LoadUse.INTERMITTENT, 1, 1),
        (10.0, LoadUse.INTERMITTENT, 1, 1),
        (10.1, LoadUse.INTERMITTENT, 2, 3),
        (2.0, LoadUse.STATIC, 2, 2),
        (10.0, LoadUse.REPEATED, 2, 2),
        (10.1, LoadUse.REPEATED, 3, 3),
        (0.5, LoadUse.SHOCK, 3, 3),
    ],
)
def test_force(load, use, original, worksheet):
    assert force(load, use, Profile.ORIGINAL_1993) == exactly(original)
    assert force(load, use, Profile.WORKSHEET) == exactly(worksheet)


def test_plain_words_are_understood_and_others_refused():
    """A script that writes ``profile="worksheet"`` gets the worksheet, not silently the paper."""
    for profile in Profile:
        for use in LoadUse:
            for kg in (1.0, 5.0, 25.0):
                assert force(kg, str(use.value), str(profile.value)) == force(kg, use, profile)
    assert Rula(human="op", profile="worksheet").static == Profile.WORKSHEET.static
    for use, profile in (("sometimes", "worksheet"), ("shock", "worksheets")):
        with pytest.raises(ValueError, match="is not a valid"):
            force(25.0, use, profile)
    with pytest.raises(ValueError, match="is not a valid"):
        posture_components(
            made_angles(),
            thresholds=Thresholds(),
            supported=UNSUPPORTED,
            back_supported=None,
            legs=None,
            policy="projected",
        )


def test_the_profiles_differ_in_two_things_only():
    """Force of more than 10 kg, intermittent, and how long is static."""
    loads = np.arange(0, 20, 0.25)
    differ = [
        (kg, use)
        for kg in loads
        for use in LoadUse
        if force(kg, use, Profile.ORIGINAL_1993) != force(kg, use, Profile.WORKSHEET)
    ]
    assert differ == [(kg, LoadUse.INTERMITTENT) for kg in loads if kg > 10]
    assert (Profile.ORIGINAL_1993.static, Profile.WORKSHEET.static) == (60, 600)


def test_a_force_that_nobody_gave_may_be_anything():
    assert tuple(map(int, force(None, None, Profile.ORIGINAL_1993))) == (0, 3)
    assert tuple(map(int, force(5.0, None, Profile.ORIGINAL_1993))) == (1, 3)
    assert tuple(map(int, force(None, LoadUse.SHOCK, Profile.ORIGINAL_1993))) == (3, 3)


def test_the_estimate_of_the_legs():
    def legs(**given):
        span = posture_components(
            made_angles(**given),
            thresholds=Thresholds(),
            supported=UNSUPPORTED,
            back_supported=False,
            legs=None,
        )["legs"]
        return span.low.item(), span.high.item()

    assert legs() == (1, 1)
    assert legs(foot_rise=[0, 8]) == (2, 2)
    assert legs(knee_flexion=[20, 0]) == (2, 2)
    assert legs(knee_flexion=[20, 20]) == (1, 1)
    assert legs(knee_flexion=[np.nan, 20]) == (1, 2)


def test_an_arm_policy_changes_arms_between_forward_and_sideways_only():
    forward = made_angles(shoulder_flexion=50, shoulder_elevation=50)
    for policy in ArmPolicy:
        assert known(scored(forward, policy=policy))["upper arm"] == 3
    # 40° beside forward, 55° up: seen from the side only 48°.
    between = made_angles(shoulder_flexion=43, shoulder_abduction=30, shoulder_elevation=50.6)
    assert known(scored(between))["upper arm"] == 2 + 1
    assert known(scored(between, policy=ArmPolicy.ELEVATION))["upper arm"] == 3 + 1
    aside = made_angles(shoulder_flexion=60, shoulder_abduction=85, shoulder_elevation=87.5)
    assert known(scored(aside))["upper arm"] == 3 + 1
    assert known(scored(aside, policy=ArmPolicy.ELEVATION))["upper arm"] == 1 + 1
    behind = made_angles(shoulder_flexion=-30, shoulder_elevation=30)
    assert known(scored(behind, policy=ArmPolicy.ELEVATION))["upper arm"] == 2
