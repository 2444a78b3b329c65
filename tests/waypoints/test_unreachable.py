"""Why a pose is not reached, with what is missing: against a second optimiser and closed forms."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from seerob.description.robots import library
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.inverse import rotation_vectors, solutions, why_not

DOWN = np.diag([1.0, -1.0, -1.0])
NEAR = np.array([0.0, -1.2, 1.4, -1.7, -1.57, 0.0])


def miss(arm, rotation, place, q):
    """To a pose, where the place counts most."""
    at = arm.posture(q)
    return np.concatenate([3000 * (at.position - place), rotation_vectors(rotation @ at.rotation.T)])


def number(text, before):
    return float(text.split(f" {before}")[0].split()[-1])


@pytest.mark.parametrize("place", [(2.0, 0.3, 0.2), (-1.0, 1.5, 0.9)])
def test_what_is_missing_is_what_another_optimiser_finds(place):
    arm = Arm(library.load("ur10e"), base="base")
    text = why_not(arm, DOWN, np.array(place), NEAR)
    starts = np.random.default_rng(3).uniform(-2, 2, (4, 6))
    best = min(
        np.linalg.norm(least_squares(lambda q: arm.posture(q).position - place, start).fun)
        for start in starts
    )
    assert number(text, "m are missing") == pytest.approx(best, rel=1e-2)


def test_what_is_missing_to_a_place_is_its_distance_less_the_stretched_arm():
    arm = Arm(library.load("iiwa14"))
    # Shoulder at 0.36 m; upper arm, forearm and flange of an LBR iiwa 14 [m].
    reach = 0.42 + 0.40 + 0.126
    place = np.array([1.5, 0.2, 0.5])
    text = why_not(arm, DOWN, place, np.array([0.0, 0.5, 0.0, -1.4, 0.0, 1.2, 0.0]))
    expected = np.linalg.norm(place - [0, 0, 0.36]) - reach
    assert number(text, "m are missing") == pytest.approx(expected, abs=2e-3)


def test_a_place_that_is_reached_in_another_orientation_only_is_told_apart():
    arm = Arm(library.load("ur10e"), base="base")
    far = np.array([2.0, 0.3, 0.2])
    stretched = least_squares(lambda q: arm.posture(q).position - far, NEAR).x
    at = arm.posture(stretched)
    place = at.position - 0.01 * (far - at.position) / np.linalg.norm(far - at.position)
    # Near the end of its reach the tool points outward, and cannot look back.
    back = at.rotation @ DOWN
    assert solutions(arm, back, place, stretched) == ()
    text = why_not(arm, back, place, stretched)
    assert "the place is reached, this orientation" in text
    best = min(
        np.linalg.norm(rotation_vectors(back @ arm.posture(found.x).rotation.T))
        for start in np.random.default_rng(5).uniform(-3, 3, (4, 6))[1:]
        if (found := least_squares(lambda q: miss(arm, back, place, q), start))
        and np.linalg.norm(arm.posture(found.x).position - place) < 1e-3
    )
    assert np.radians(float(text.split(" is ")[-1].split("°")[0])) == pytest.approx(best, rel=0.1)


def test_a_joint_that_would_have_to_pass_its_limit_is_named():
    arm = Arm(library.load("iiwa14"))
    q = np.array([0.1, 0.5, 0.2, -1.4, 0.1, 1.2, 0.3])
    at = arm.posture(q)
    assert solutions(arm, at.rotation, at.position, q)
    tight = Arm(library.load("ur5"), base="base")
    tight.lower, tight.upper = np.full(6, -0.1), np.full(6, 0.1)
    goal = tight.posture(np.array([0.0, 0.0, 0.0, 0.0, 0.5, 0.05]))
    text = why_not(tight, goal.rotation, goal.position, np.zeros(6))
    assert "would have to go" in text
    assert 0.0 < number(text, "rad beyond its own") <= 0.4 + 1e-6
