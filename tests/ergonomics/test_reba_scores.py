"""REBA: published tables through the vectors, bands at their edges, modifiers, load, and the sitting knee."""

import numpy as np
import pytest
from made_postures import UNSUPPORTED, known, made_angles

from seerob.criteria.ergonomics.reba import (
    Coupling,
    coupling,
    knees,
    load,
    neck,
    posture_components,
    reba,
    trunk,
    upper_arm,
    wrist,
)
from seerob.criteria.scoring.spans import ROUNDING, Thresholds, exactly

SIX = ("neck", "trunk", "legs", "upper arm", "lower arm", "wrist")


def scored(angles, *, legs=1, sitting=False, **more):
    return posture_components(
        angles, thresholds=Thresholds(), supported=UNSUPPORTED, legs=exactly(legs), sitting=sitting, **more
    )


@pytest.mark.parametrize(
    ("scores", "expected"),
    [
        ((1, 1, 1, 1, 1, 1, 0, 0, 0), (1, 1, 1, 1, 1, 1)),
        ((2, 3, 2, 3, 2, 2, 1, 1, 1), (5, 5, 6, 6, 8, 9)),
        ((3, 5, 4, 6, 2, 3, 3, 3, 3), (9, 9, 12, 12, 12, 15)),
        ((2, 2, 1, 3, 1, 2, 0, 0, 1), (3, 4, 3, 4, 3, 4)),
        ((1, 3, 3, 4, 2, 2, 0, 2, 0), (5, 6, 5, 8, 8, 8)),
        ((2, 1, 1, 2, 2, 3, 0, 1, 1), (1, 4, 1, 5, 3, 4)),
        ((3, 3, 2, 5, 1, 1, 2, 1, 2), (6, 6, 8, 7, 10, 12)),
    ],
)
def test_vectors(scores, expected):
    assert tuple(map(int, reba(*scores))) == expected


@pytest.mark.parametrize("scores", [(4, 1, 1, 1, 1, 1), (1, 1, 0, 1, 1, 1), (1, 1, 1, 1, 3, 1)])
def test_a_score_that_the_tables_do_not_have_is_refused(scores):
    with pytest.raises(ValueError, match=" to "):
        reba(*scores)


SITUATIONS = {
    "F1": (
        {"neck_flexion": 10, "knee_flexion": 5, "shoulder_flexion": 30, "wrist_flexion": 10},
        {},
        (0, 0, 0),
        (1, 1, 1, 2, 1, 1),
        (1, 1, 1, 1, 1, 1),
    ),
    "F2": (
        {
            "neck_flexion": 10,
            "trunk_flexion": 65,
            "knee_flexion": 50,
            "shoulder_flexion": 50,
            "elbow_flexion": 30,
            "wrist_flexion": 20,
        },
        {},
        (2, 1, 0),
        (1, 4, 2, 3, 2, 2),
        (5, 5, 7, 6, 9, 9),
    ),
    "F3": (
        {
            "neck_flexion": -10,
            "trunk_flexion": -10,
            "shoulder_flexion": 100,
            "shoulder_abduction": 40,
            "elbow_flexion": 120,
            "wrist_flexion": 20,
            "wrist_deviation": 20,
        },
        {},
        (0, 0, 1),
        (2, 2, 1, 5, 2, 3),
        (3, 8, 3, 8, 7, 8),
    ),
    "F4": (
        {
            "neck_flexion": 25,
            "neck_twist": 30,
            "trunk_flexion": 40,
            "trunk_twist": 30,
            "knee_flexion": 90,
            "shoulder_flexion": 60,
            "clavicle_elevation": 15,
            "elbow_flexion": 70,
            "wrist_flexion": 5,
        },
        {"legs": 2},
        (1, 2, 2),
        (3, 4, 4, 4, 1, 1),
        (9, 4, 10, 6, 11, 13),
    ),
    "F5": (
        {
            "neck_flexion": 22,
            "trunk_flexion": 10,
            "knee_flexion": 90,
            "shoulder_flexion": 25,
            "elbow_flexion": 90,
            "wrist_flexion": 16,
        },
        {"sitting": True},
        (0, 0, 1),
        (2, 2, 1, 2, 1, 2),
        (3, 2, 3, 2, 3, 4),
    ),
}


@pytest.mark.parametrize("name", SITUATIONS)
def test_situations(name):
    given, options, added, components, expected = SITUATIONS[name]
    found = known(scored(made_angles(**given), **options))
    assert tuple(found[key] for key in SIX) == components
    assert tuple(map(int, reba(*components, *added))) == expected


UPRIGHT, EXTENSION = Thresholds().trunk_upright, Thresholds().neck_extension


@pytest.mark.parametrize(
    ("score", "edge", "within", "above"),
    [
        (upper_arm, 20, 1, 2),
        (upper_arm, 45, 2, 3),
        (upper_arm, 90, 3, 4),
        (lambda x: upper_arm(-x), 20, 1, 2),
        (lambda x: neck(x, EXTENSION), 20, 1, 2),
        (lambda x: trunk(x, UPRIGHT), 20, 2, 3),
        (lambda x: trunk(x, UPRIGHT), 60, 3, 4),
        (lambda x: trunk(-x, UPRIGHT), 20, 2, 3),
        (wrist, 15, 1, 2),
        (lambda x: wrist(-x), 15, 1, 2),
        (knees, 60, 1, 2),
    ],
)
def test_an_edge_belongs_to_the_stricter_band(score, edge, within, above):
    near = np.radians(edge) + np.array([-1e-5, -ROUNDING / 2, 0.0, ROUNDING])
    assert score(near).tolist() == [within, above, above, above]


def test_knees_count_from_30_degrees_on():
    assert knees(np.radians([29.999, 30])).tolist() == [0, 1]


@pytest.mark.parametrize(
    ("given", "component"),
    [
        ({"shoulder_abduction": 25}, "upper arm"),
        ({"shoulder_rotation": 50}, "upper arm"),
        ({"shoulder_rotation": -50}, "upper arm"),
        ({"shoulder_rotation": 50, "shoulder_abduction": 25}, "upper arm"),
        ({"clavicle_elevation": 8}, "upper arm"),
        ({"wrist_deviation": 12, "forearm_rotation": 50}, "wrist"),
        ({"neck_twist": 12, "neck_side_bend": 12}, "neck"),
        ({"trunk_twist": -12, "trunk_side_bend": 12}, "trunk"),
        ({"knee_flexion": [0, 40]}, "legs"),
    ],
)
def test_each_modifier_adds_one_to_its_component_alone_and_once(given, component):
    plain, more = known(scored(made_angles())), known(scored(made_angles(**given)))
    assert {key: more[key] - plain[key] for key in plain} == {key: int(key == component) for key in plain}


def test_the_forearm_has_no_modifier():
    assert known(scored(made_angles(forearm_out=60, wrist_across=10))) == known(scored(made_angles()))


@pytest.mark.parametrize(("sitting", "expected"), [(False, (3, 3)), (True, (1, 1)), (None, (1, 3))])
def test_a_bent_knee_counts_unless_somebody_sits(sitting, expected):
    span = scored(made_angles(knee_flexion=90), sitting=sitting)["legs"]
    assert (int(span.low), int(span.high)) == expected


@pytest.mark.parametrize(
    ("kg", "shock", "expected"),
    [(4.9, False, 0), (5, False, 1), (10, False, 1), (10.1, False, 2), (10.1, True, 3), (0, True, 1)],
)
def test_load(kg, shock, expected):
    assert load(kg, shock) == exactly(expected)


def test_what_nobody_gave_may_be_anything():
    assert tuple(map(int, load(None, None))) == (0, 3)
    assert tuple(map(int, load(7.0, None))) == (1, 2)
    assert tuple(map(int, coupling(None))) == (0, 3)
    assert [int(coupling(grip).low) for grip in Coupling] == [0, 1, 2, 3]


def test_a_knee_that_nobody_measured_of_somebody_who_may_sit():
    span = scored(made_angles(knee_flexion=np.nan), sitting=None)["legs"]
    assert (int(span.low), int(span.high)) == (1, 3)
