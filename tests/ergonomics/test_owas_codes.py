"""OWAS: codes from angles, categories from the published table."""

import numpy as np
import pytest
from made_postures import made_angles, posed

from seerob.criteria.ergonomics.owas import OwasThresholds, arm_codes, back_codes, leg_codes, load_codes, owas

USUAL = OwasThresholds()


def codes(possible):
    return (np.flatnonzero(possible) + 1).tolist()


@pytest.mark.parametrize(
    ("code", "category"),
    [
        ((1, 1, 2, 1), 1),
        ((2, 1, 2, 3), 3),
        ((2, 3, 1, 3), 4),
        ((3, 1, 5, 1), 4),
        ((3, 3, 7, 3), 1),
        ((4, 1, 3, 2), 2),
        ((4, 3, 7, 2), 3),
        ((1, 3, 7, 3), 2),
    ],
)
def test_categories(code, category):
    assert int(owas(*code)) == category


def test_a_code_that_the_method_does_not_have_is_refused():
    with pytest.raises(ValueError, match=" to "):
        owas(5, 1, 1, 1)


@pytest.mark.parametrize(
    ("given", "code"),
    [
        ({}, 1),
        ({"trunk_flexion": 19}, 1),
        ({"trunk_flexion": 21}, 2),
        ({"trunk_flexion": -21}, 2),
        ({"trunk_twist": -21}, 3),
        ({"trunk_side_bend": 21}, 3),
        ({"trunk_twist": 21, "trunk_side_bend": 21}, 3),
        ({"trunk_flexion": 21, "trunk_twist": 21}, 4),
        ({"trunk_flexion": 21, "trunk_side_bend": -21}, 4),
    ],
)
def test_backs(given, code):
    assert codes(back_codes(made_angles(**given), USUAL)) == [code]


@pytest.mark.parametrize(("rise", "code"), [([-5, -5], 1), ([0, -5], 2), ([-5, 10], 2), ([10, 10], 3)])
def test_arms_at_shoulder_level_count(rise, code):
    assert codes(arm_codes(made_angles(arm_rise=rise))) == [code]


def test_a_hand_above_the_shoulder_counts_with_the_elbow_below():
    assert codes(arm_codes(posed(both_shoulder_flexion=70, both_elbow_flexion=90))) == [3]
    assert codes(arm_codes(posed(both_shoulder_flexion=45))) == [1]


@pytest.mark.parametrize(
    ("given", "code"),
    [
        ({}, 2),
        ({"knee_flexion": [40, 40]}, 4),
        ({"knee_flexion": [40, 10]}, 4),
        ({"foot_rise": [10, 0], "knee_flexion": [80, 10]}, 3),
        ({"foot_rise": [10, 0], "knee_flexion": [10, 40]}, 5),
        ({"foot_rise": [0, 10], "knee_flexion": [40, 80]}, 5),
        ({"shank_tilt": [85, 10], "knee_flexion": [90, 90]}, 6),
        ({"shank_tilt": [85, 85], "knee_flexion": [90, 90]}, 6),
        ({"shank_tilt": [0, 85], "knee_flexion": [0, 90], "foot_rise": [0, 30]}, 3),
    ],
)
def test_legs_of_somebody_who_stands_or_kneels(given, code):
    assert codes(leg_codes(made_angles(**given), USUAL)) == [code]


def test_a_leg_that_is_not_measured_leaves_every_code_open_that_it_may_be():
    unknown = leg_codes(made_angles(knee_flexion=[np.nan, 0]), USUAL)
    assert codes(unknown) == [2, 4]
    nothing = made_angles(knee_flexion=np.nan, foot_rise=np.nan, shank_tilt=np.nan)
    assert codes(leg_codes(nothing, USUAL)) == [2, 3, 4, 5, 6]


def test_the_accuracy_opens_the_neighbouring_codes():
    near = made_angles(trunk_flexion=19, trunk_twist=15)
    assert codes(back_codes(near, USUAL, np.radians(2))) == [1, 2]
    assert codes(back_codes(near, USUAL, np.radians(6))) == [1, 2, 3, 4]


@pytest.mark.parametrize(("kg", "found"), [(9.9, [1]), (10, [2]), (20, [2]), (20.1, [3]), (None, [1, 2, 3])])
def test_loads(kg, found):
    assert codes(load_codes(kg)) == found
