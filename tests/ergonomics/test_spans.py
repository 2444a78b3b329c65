"""Spans of scores: exact against a dense search, wide where nothing is known, mirrored with the posture."""

from itertools import pairwise

import numpy as np
import pytest
from made_postures import PERSON, UNSUPPORTED, made_angles, random_q

from seerob.criteria.ergonomics import reba, rula
from seerob.criteria.ergonomics.owas import (
    OwasThresholds,
    arm_codes,
    back_codes,
    category_span,
    leg_codes,
    only,
    owas,
)
from seerob.criteria.scoring.measured import ArmPolicy, Measured, arm_score
from seerob.criteria.scoring.spans import (
    ROUNDING,
    Span,
    Thresholds,
    answer,
    between,
    beyond,
    cells,
    either,
    exactly,
    fallen,
    graded,
    reached,
)
from seerob.description.humans.angles import angles
from seerob.description.humans.skeleton import bone_poses, mirrored

USUAL = Thresholds()


def components(found, method, accuracy=0.0, policy=ArmPolicy.PROJECTION):
    more = (
        {"back_supported": False, "legs": None} if method is rula else {"legs": exactly(1), "sitting": False}
    )
    return method.posture_components(
        found, thresholds=USUAL, supported=UNSUPPORTED, accuracy=accuracy, policy=policy, **more
    )


def grand(found, method, end="low", accuracy=0.0):
    scores = {
        key: np.atleast_1d(getattr(span, end))
        if key in ("upper arm", "lower arm", "wrist", "wrist twist")
        else getattr(span, end)[..., None]
        for key, span in components(found, method, accuracy).items()
    }
    if method is rula:
        return rula.rula(*(scores[key] for key in list(rula.LEAST)[:7])).grand
    return reba.reba(*(scores[key] for key in list(reba.LEAST)[:6])).final


@pytest.mark.parametrize(
    "score",
    [
        rula.upper_arm,
        reba.upper_arm,
        lambda x: rula.neck(x, USUAL.neck_extension),
        lambda x: rula.trunk(x, USUAL.trunk_upright),
        lambda x: reba.trunk(x, USUAL.trunk_upright),
        lambda x: rula.wrist(x, USUAL.wrist_neutral),
    ],
)
def test_a_graded_span_is_what_a_dense_search_finds(score):
    rng = np.random.default_rng(1)
    angle, accuracy = rng.uniform(-2, 2, 300), rng.uniform(0.0, 0.5, 300)
    span = graded(angle, score, within=(1, 4), accuracy=accuracy)
    every = score(angle + np.linspace(-1, 1, 2001)[:, None] * accuracy)
    # A band narrower than the search's step may be missed by the search, never by the span.
    assert (span.low <= every.min(axis=0)).all()
    assert (span.high >= every.max(axis=0)).all()
    assert (span.low == every.min(axis=0)).mean() > 0.99
    assert (span.high == every.max(axis=0)).mean() > 0.99


def test_the_elbow_is_least_in_the_middle():
    span = graded(
        np.radians([50.0, 80.0, 110.0]),
        rula.lower_arm,
        within=(1, 2),
        accuracy=np.radians(31),
        neutral=np.radians(80),
    )
    assert span.low.tolist() == [1, 1, 1]
    assert span.high.tolist() == [2, 2, 2]


def test_not_a_number_may_be_anything_and_never_scores_least():
    span = graded(np.array([np.nan, 0.0]), rula.upper_arm, within=(1, 4))
    assert span.low.tolist() == [1, 1]
    assert span.high.tolist() == [4, 1]
    assert beyond(np.array(np.nan), 0.1) == Span(np.array(0), np.array(1))


@pytest.mark.parametrize("policy", list(ArmPolicy))
def test_an_arm_that_is_off_by_its_accuracy_stays_in_its_span(policy):
    """Brute force over directions within δ of the arm: sideways arms have no flexion to speak of."""
    rng = np.random.default_rng(2)
    delta = np.radians(8)
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    near = directions + np.tan(delta) * rng.uniform(-1, 1, (400, 400, 3)).transpose(1, 0, 2) / np.sqrt(3)
    near /= np.linalg.norm(near, axis=-1, keepdims=True)
    inside = np.arccos(np.clip((near * directions).sum(-1), -1, 1)) <= delta

    def arm(u):
        flexion, side = np.arctan2(u[..., 0], -u[..., 1]), np.arcsin(np.clip(u[..., 2], -1, 1))
        shape = (*u.shape[:-1], 2)
        flexion = np.where(flexion < -np.pi / 2, flexion + 2 * np.pi, flexion)
        up = np.arccos(np.clip(-u[..., 1], -1, 1))
        values = {"shoulder_flexion": flexion, "shoulder_abduction": side, "shoulder_elevation": up}
        made = made_angles()
        for name, value in values.items():
            object.__setattr__(made, name, np.broadcast_to(value[..., None], shape))
        return made

    span = arm_score(Measured(arm(directions), delta), rula.upper_arm, policy)
    scores = arm_score(Measured(arm(near)), rula.upper_arm, policy)
    off = inside[..., None] & ((scores.high < span.low) | (scores.low > span.high))
    assert not off.any()
    assert (span.low < span.high).mean() < 0.8  # it does not simply say "anything"


@pytest.mark.parametrize("method", [rula, reba])
def test_mirroring_swaps_the_sides(method):
    q = random_q(3000, seed=4)
    one, other = (grand(angles(*bone_poses(PERSON, x)), method) for x in (q, mirrored(q)))
    assert np.array_equal(one, other[:, ::-1])
    assert (one[:, 0] != one[:, 1]).mean() > 0.1


@pytest.mark.parametrize("method", [rula, reba])
def test_heading_and_place_change_no_score(method):
    q = random_q(1000, seed=5)
    turned = q.copy()
    turned[:, :2] += [2.0, -1.0]
    turned[:, 3] += np.random.default_rng(0).uniform(-3, 3, len(q))
    assert np.array_equal(*(grand(angles(*bone_poses(PERSON, x)), method) for x in (q, turned)))


def test_owas_in_a_mirror_and_turned():
    def category(q):
        found = angles(*bone_poses(PERSON, q))
        t = OwasThresholds()
        return category_span(back_codes(found, t), arm_codes(found), leg_codes(found, t), only(1, 3)).low

    q = random_q(1000, seed=6)
    turned = q.copy()
    turned[:, 3] += 1.0
    assert np.array_equal(category(q), category(mirrored(q)))
    assert np.array_equal(category(q), category(turned))


@pytest.mark.parametrize("method", [rula, reba])
def test_a_greater_accuracy_never_narrows_the_score_and_holds_the_measured_one(method):
    found = angles(*bone_poses(PERSON, random_q(500, seed=7, scale=0.5)))
    ends = [(grand(found, method, "low", a), grand(found, method, "high", a)) for a in (0.0, 0.02, 0.1)]
    assert np.array_equal(*ends[0])
    for (low, high), (wider_low, wider_high) in pairwise(ends):
        assert (wider_low <= low).all()
        assert (wider_high >= high).all()
    assert (ends[2][0] < ends[2][1]).any()


def test_owas_span_is_the_extreme_of_every_combination():
    rng = np.random.default_rng(8)
    for _ in range(50):
        sets = [rng.random(n) < 0.5 for n in (4, 3, 7, 3)]
        for possible in sets:
            possible[rng.integers(len(possible))] = True
        codes = np.meshgrid(*(np.flatnonzero(s) + 1 for s in sets), indexing="ij")
        every = owas(*codes)
        span = category_span(*sets)
        assert (int(span.low), int(span.high)) == (every.min(), every.max())


OPEN = {
    ("rula", "shoulder_flexion"): ("upper arm", 1, 4),
    ("rula", "shoulder_abduction"): ("upper arm", 1, 2),
    ("rula", "clavicle_elevation"): ("upper arm", 1, 2),
    ("rula", "elbow_flexion"): ("lower arm", 1, 2),
    ("rula", "forearm_out"): ("lower arm", 1, 2),
    ("rula", "wrist_across"): ("lower arm", 1, 2),
    ("rula", "wrist_flexion"): ("wrist", 1, 3),
    ("rula", "wrist_deviation"): ("wrist", 1, 2),
    ("rula", "forearm_rotation"): ("wrist twist", 1, 2),
    ("rula", "neck_flexion"): ("neck", 1, 4),
    ("rula", "neck_twist"): ("neck", 1, 2),
    ("rula", "neck_side_bend"): ("neck", 1, 2),
    ("rula", "trunk_flexion"): ("trunk", 1, 4),
    ("rula", "trunk_twist"): ("trunk", 1, 2),
    ("rula", "trunk_side_bend"): ("trunk", 1, 2),
    ("rula", "knee_flexion"): ("legs", 1, 2),
    ("rula", "foot_rise"): ("legs", 1, 2),
    ("reba", "shoulder_flexion"): ("upper arm", 1, 4),
    ("reba", "shoulder_abduction"): ("upper arm", 1, 2),
    ("reba", "shoulder_rotation"): ("upper arm", 1, 2),
    ("reba", "clavicle_elevation"): ("upper arm", 1, 2),
    ("reba", "elbow_flexion"): ("lower arm", 1, 2),
    ("reba", "wrist_flexion"): ("wrist", 1, 2),
    ("reba", "wrist_deviation"): ("wrist", 1, 2),
    ("reba", "forearm_rotation"): ("wrist", 1, 2),
    ("reba", "neck_flexion"): ("neck", 1, 2),
    ("reba", "neck_twist"): ("neck", 1, 2),
    ("reba", "neck_side_bend"): ("neck", 1, 2),
    ("reba", "trunk_flexion"): ("trunk", 1, 4),
    ("reba", "trunk_twist"): ("trunk", 1, 2),
    ("reba", "trunk_side_bend"): ("trunk", 1, 2),
    ("reba", "knee_flexion"): ("legs", 1, 3),
}
"""What an angle that nobody measured leaves open of an otherwise least posture."""
METHODS = {"rula": rula, "reba": reba}


@pytest.mark.parametrize(("method", "angle"), OPEN)
def test_an_angle_that_nobody_measured_leaves_its_component_open_and_no_other(method, angle):
    component, low, high = OPEN[method, angle]
    least = components(made_angles(), METHODS[method])
    found = components(made_angles(**{angle: np.nan}), METHODS[method])
    assert {key for key, span in found.items() if not span.known} == {component}
    assert set(np.atleast_1d(found[component].low)) == {low}
    assert set(np.atleast_1d(found[component].high)) == {high}
    assert all(span.low.max() == 1 for span in least.values())


JUST_BELOW = {
    "shoulder_flexion": 44,
    "shoulder_abduction": 19,
    "shoulder_rotation": -44,
    "clavicle_elevation": 4,
    "elbow_flexion": 61,
    "forearm_out": 44,
    "wrist_across": -1,
    "wrist_flexion": -14,
    "wrist_deviation": 9,
    "forearm_rotation": -44,
    "neck_flexion": 19,
    "neck_twist": -9,
    "neck_side_bend": 9,
    "trunk_flexion": 59,
    "trunk_twist": 9,
    "trunk_side_bend": -9,
    "knee_flexion": [59, 59],
    "foot_rise": [6, 0],
}


@pytest.mark.parametrize(("method", "angle"), OPEN)
def test_the_accuracy_reaches_every_angle(method, angle):
    """1° from an edge, ± 0.9° leaves the score and ± 1.1° opens it, of its own component only."""
    component, *_ = OPEN[method, angle]
    if (method, angle) == ("rula", "knee_flexion"):
        near = made_angles(knee_flexion=[13, 0])  # the difference of two angles: twice the accuracy
    else:
        near = made_angles(**{angle: JUST_BELOW[angle]})
    for accuracy, expected in ((0.9, set()), (1.1, {component})):
        found = components(near, METHODS[method], np.radians(accuracy))
        assert {key for key, span in found.items() if not span.known} == expected


@pytest.mark.parametrize("method", [rula, reba])
@pytest.mark.parametrize("angle", ["shoulder_abduction", "clavicle_elevation"])
def test_an_arm_toward_the_body_is_neither_abducted_nor_raised(method, angle):
    found = components(made_angles(**{angle: -40}), method)
    assert found["upper arm"].high.tolist() == [1, 1]


def test_an_arm_that_points_sideways_has_any_flexion():
    aside = made_angles(shoulder_flexion=170, shoulder_abduction=85, shoulder_elevation=91)
    span = arm_score(Measured(aside, np.radians(8)), rula.upper_arm, ArmPolicy.PROJECTION)
    assert (span.low.tolist(), span.high.tolist()) == ([1, 1], [4, 4])
    sure = arm_score(Measured(aside, np.radians(4)), rula.upper_arm, ArmPolicy.PROJECTION)
    assert (sure.low.tolist(), sure.high.tolist()) == ([4, 4], [4, 4])


def ends(span):
    return span.low.tolist(), span.high.tolist()


def test_scores_are_whole_numbers_that_add_up_end_by_end():
    one, other = between([1, 2], [1, 4]), exactly([3, 1])
    assert ends(one + other) == ([4, 3], [4, 5])
    assert ends(one.at_least(2)) == ([2, 2], [2, 4])
    assert ends(either(one, other)) == ([3, 2], [3, 4])
    assert (one.known, other.known) == (False, True)
    assert [ends(answer(yes)) for yes in (True, False, None)] == [(1, 1), (0, 0), (0, 1)]
    assert ends(between([1.0, -1e9], [1.0, 1e9])) == ([1, -(10**9)], [1, 10**9])
    for low, high in (([1, 2], [1, 1]), (1.5, 2), (0, 1e9 + 1), (0, float("nan"))):
        with pytest.raises(ValueError, match="score"):
            between(low, high)
    with pytest.raises(TypeError):
        one + 1
    with pytest.raises(ValueError, match="read-only"):
        cells("rula", "A")[0] = 1


@pytest.mark.parametrize("edge", [-0.75, 0.0, 0.5])
def test_exactly_at_rounding_from_an_edge_it_is_reached(edge):
    """Of a number as of an array of them; at an edge of 0, which is neutral, from there on."""
    near = edge - ROUNDING if edge else ROUNDING
    for angle, at in ((near, True), (np.nextafter(near, -9), False), (float("nan"), True)):
        assert reached(float(angle), edge) is at
        assert fallen(-float(angle), -edge) is at
        assert reached(np.array([angle, 9.0]), edge).tolist() == [at, True]
        assert fallen(np.array([-angle, -9.0]), -edge).tolist() == [at, True]


def steps(x):
    """1 below 0, 2 below 1, then 3: what is least on one side only."""
    return 1 + (x >= 0.0).astype(np.int64) + (x >= 1.0).astype(np.int64)


@pytest.mark.parametrize("sign", [1, -1])
def test_an_angle_is_scored_by_the_worst_that_rounding_alone_makes_of_it(sign):
    """On either side of an edge; an angle that may be turned by half a turn has the greatest score."""
    angle = sign * np.array([0.9, 0.9, 0.2, -0.5, -0.5])
    far = np.array([0.0, 0.2, 0.2, np.pi, np.nextafter(np.pi, 0)])
    found = graded(angle, lambda x: steps(sign * x), within=(1, 5), rounding=far)
    assert ends(found) == ([2, 3, 2, 5, 3], [2, 3, 2, 5, 3])


@pytest.mark.parametrize("sign", [1, -1])
def test_an_angle_that_is_known_to_an_accuracy_has_the_scores_of_both_its_ends(sign):
    angle, accuracy = sign * np.array([0.9, 0.9, 1.1, 0.9, 0.9]), np.array([0.0, 0.2, 0.2, 0.2, 0.2])
    far = np.array([0.0, 0.0, 0.0, np.pi, np.nextafter(np.pi, 0)])
    found = graded(angle, lambda x: steps(sign * x), within=(1, 5), accuracy=accuracy, rounding=far)
    assert ends(found) == ([2] * 5, [2, 3, 3, 5, 3])
    # Rounding that the accuracy does not cover counts beside it.
    near = graded(angle[:1], lambda x: steps(sign * x), within=(1, 5), accuracy=1e-9, rounding=0.2)
    assert ends(near) == ([2], [3])


def test_beyond_counts_the_size_of_an_angle_or_its_sign_too():
    angle = np.array([-0.6, -0.4, 0.4, 0.6, np.nan])
    assert ends(beyond(angle, 0.5)) == ([1, 0, 0, 1, 0], [1, 0, 0, 1, 1])
    assert ends(beyond(angle, 0.5, signed=True)) == ([0, 0, 0, 1, 0], [0, 0, 0, 1, 1])
    assert ends(beyond(angle, 0.5, accuracy=0.2)) == ([0] * 5, [1] * 5)
    assert ends(beyond(angle, 0.5, accuracy=0.2, signed=True)) == ([0] * 5, [0, 0, 1, 1, 1])
    assert ends(beyond(angle, 0.5, rounding=0.2)) == ([1, 1, 1, 1, 0], [1] * 5)
    assert ends(beyond(angle, 0.5, rounding=0.2, signed=True)) == ([0, 0, 1, 1, 0], [0, 0, 1, 1, 1])
