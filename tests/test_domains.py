"""Formulas refuse what cannot be, and what is not a number never comes out as the least."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seerob.contact import collision
from seerob.domains import number, whole
from seerob.errors import SeerobError
from seerob.norms import iso_13855
from seerob.safety.separation import separation_bound
from seerob.scoring import eaws_posture, niosh, owas, reba, repetition, rula
from seerob.scoring.posture_time import PostureTime
from seerob.stopping import terms

END = niosh.End(H=0.3, V=0.8)
NEGATIVE = st.floats(max_value=-1e-6, allow_nan=False)
NOT = st.one_of(NEGATIVE, st.just(math.nan), st.just(-math.inf))
"""What no length, mass, time, share or speed is."""


def lifted(**changed):
    task = {"average": 5.0, "heaviest": 8.0, "origin": END, "destination": END, "control": False}
    task |= {"frequency": 1.0, "grip": niosh.Grip.GOOD}
    return niosh.composite_index([niosh.Task(**{**task, **changed})], niosh.Duration.SHORT)


def minimum(**given):
    return iso_13855.minimum_distance("orthogonal", "2024", **{"time": 0.5, "over": 0, "under": 0, **given})


REFUSES = {
    "niosh H": lambda x: lifted(origin=niosh.End(H=x, V=0.8)),
    "niosh V": lambda x: lifted(origin=niosh.End(H=0.3, V=x)),
    "niosh average": lambda x: lifted(average=x),
    "niosh heaviest": lambda x: lifted(heaviest=x),
    "niosh frequency": lambda x: lifted(frequency=x),
    "niosh recovery": lambda x: niosh.duration(3600, x),
    "niosh work": lambda x: niosh.duration(x, 3600),
    "niosh D": lambda x: niosh.distance_multiplier([0.3, x]),
    "reba load": lambda x: reba.load(x, False),
    "rula load": lambda x: rula.force(x, rula.LoadUse.STATIC, rula.Profile.WORKSHEET),
    "owas load": owas.load_codes,
    "eaws share": lambda x: eaws_posture.line_points("2", x),
    "eaws asymmetry": lambda x: eaws_posture.asymmetry_points((0.5, 0.2, x)),
    "hold": lambda x: repetition.static([0.0, 1.0], [1, 1], x),
    "window": lambda x: repetition.repetitions([0.0, 1.0], [1, 2], window=x),
    "iso 13855 over": lambda x: minimum(over=x, supplement=0.1),
    "iso 13855 supplement": lambda x: minimum(supplement=x),
    "iso 13855 time": lambda x: minimum(time=x, supplement=0.1),
    "S_p v_h": lambda x: separation_bound(np.array([1.0]), x, 0.1, 0.5, 0.2),
    "S_p T_r": lambda x: separation_bound(np.array([1.0]), 1.6, x, 0.5, 0.2),
    "S_p T_s": lambda x: separation_bound(np.array([1.0]), 1.6, 0.1, x, 0.2),
    "S_p xi": lambda x: separation_bound(np.array([1.0]), 1.6, 0.1, 0.5, x),
    "course T_r": lambda x: terms.course(np.array([1.0]), x, 0.5),
    "course T_s": lambda x: terms.course(np.array([1.0]), 0.1, x),
    "decelerating a": lambda x: terms.decelerating(1.0, 1.6, 0.1, x, 0.2),
    "inverse a": lambda x: terms.largest_speed_decelerating(1.0, 1.6, 0.1, x, 0.2),
    "inverse T_s": lambda x: terms.largest_speed_in_time(1.0, 1.6, 0.1, x, 0.2),
    "A.3": lambda x: collision.reduced_mass(x, 10.0),
    "A.4": lambda x: collision.robot_mass(x, 1.0),
    "A.1": lambda x: collision.spring_energy(100.0, x),
    "A.5": lambda x: collision.speed_at_force(100.0, 5.0, x),
    "A.6": lambda x: collision.speed_at_pressure(1e6, x, 5.0, 75e3),
    "speed of an energy": lambda x: collision.speed_at_energy(x, 5.0),
}


@pytest.mark.parametrize("name", REFUSES)
@settings(max_examples=12, deadline=None)
@given(x=NOT)
def test_what_cannot_be_is_refused(name, x):
    with pytest.raises((ValueError, SeerobError)):
        REFUSES[name](x)


SCORES = {
    "rula": (rula.rula, list(zip(rula.LEAST.values(), rula.MOST.values(), strict=True))),
    "reba": (reba.reba, list(zip(reba.LEAST.values(), reba.MOST.values(), strict=True))),
    "owas": (owas.owas, [(1, most) for most in owas.CODES.values()]),
}


@pytest.mark.parametrize("method", SCORES)
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_scores_that_a_method_does_not_have_are_refused_and_all_others_are_taken(method, data):
    score, ranges = SCORES[method]
    good = [data.draw(st.integers(low, high)) for low, high in ranges]
    score(*good)
    k = data.draw(st.integers(0, len(ranges) - 1))
    low, high = ranges[k]
    bad = data.draw(
        st.one_of(st.integers(-9, low - 1), st.integers(high + 1, 99), st.just(math.nan), st.just(low + 0.5))
    )
    with pytest.raises(ValueError, match=f"{low} to {high}"):
        score(*good[:k], bad, *good[k + 1 :])


BANDS = {
    "rula upper arm": (rula.upper_arm, 4),
    "rula lower arm": (rula.lower_arm, 2),
    "rula neck": (lambda x: rula.neck(x, 0.1), 4),
    "rula trunk": (lambda x: rula.trunk(x, 0.1), 4),
    "rula wrist": (lambda x: rula.wrist(x, 0.1), 3),
    "reba upper arm": (reba.upper_arm, 4),
    "reba lower arm": (reba.lower_arm, 2),
    "reba neck": (lambda x: reba.neck(x, 0.1), 2),
    "reba trunk": (lambda x: reba.trunk(x, 0.1), 4),
    "reba wrist": (reba.wrist, 2),
    "reba knees": (reba.knees, 2),
}


@pytest.mark.parametrize("name", BANDS)
def test_an_angle_that_is_not_a_number_scores_most(name):
    score, most = BANDS[name]
    assert score(np.array([math.nan])).tolist() == [most]


@pytest.mark.parametrize(("which", "known"), [(0, False), (1, True), (2, False)])
@given(speeds=st.lists(st.floats(0.01, 2.0), min_size=3, max_size=3))
@settings(max_examples=20, deadline=None)
def test_no_speed_is_permitted_by_what_is_not_a_number_but_where_the_area_is_unknown(which, known, speeds):
    speeds[which] = math.nan
    found, _ = collision.permissible_speed(*speeds)
    assert np.isfinite(found) == known


def test_instants_increase_and_are_numbers():
    for t in ([0.0, 0.0], [1.0, 0.5], [0.0, math.nan]):
        with pytest.raises(ValueError, match="instant"):
            repetition.static(t, [1, 1], 1.0)
    with pytest.raises(ValueError, match="instant"):
        PostureTime(1.0).add(math.nan, "x")


def test_editions_are_not_guessed():
    with pytest.raises(ValueError, match="2031"):
        iso_13855.intrusion("orthogonal", "2031", capability=0.03)
    # A text is the edition that it names, not the other one.
    assert iso_13855.intrusion("parallel", "2024", capability=0.05, height=0.8).value == iso_13855.FLOOR
    assert iso_13855.intrusion("parallel", "2010", capability=0.05, height=0.8).value < iso_13855.FLOOR


def test_the_message_says_what_is_wrong_and_what_would_be_right():
    with pytest.raises(ValueError, match=r"H is -0\.1 m, it is 0 or more m"):
        number("H", [0.2, -0.1], 0, unit="m")
    with pytest.raises(ValueError, match=r"neck is 2\.5, it is a whole number, 1 to 3"):
        whole("neck", 2.5, 1, 3)
    with pytest.raises(ValueError, match=r"x is nan, it is a number"):
        number("x", math.nan)
