"""Terms of the separation distance and their inverses; approach speed and intrusion of ISO 13855."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.core.errors import InputError, Undecided
from seerob.criteria.stopping.terms import (
    BOUND,
    CONSTANT,
    assumed_speed,
    course,
    decelerating,
    largest_factor,
    largest_scale,
    largest_speed_decelerating,
    largest_speed_in_time,
    separation_distance,
    travel,
    worst_case,
)
from seerob.description.norms.iso_13855 import (
    Approach,
    Edition,
    intrusion,
    least_distance,
    minimum_distance,
)
from seerob.kernels.separation import approach_speeds

positive = st.floats(0.01, 5)


def three(low, high):
    return st.lists(st.floats(low, high), min_size=3, max_size=3)


ACROSS, ALONG = Approach.ORTHOGONAL, Approach.PARALLEL
NO_WAY = {"over": 0.0, "under": 0.0}
"""Around the field."""


@pytest.mark.parametrize(
    ("v_r", "share", "S_p"),
    [(1.0, CONSTANT, 1.24), (1.0, BOUND, 1.39), (0.0, BOUND, 0.99), (-2.0, BOUND, 0.99)],
)
def test_published_separation_distances(v_r, share, S_p):
    """1.24 m = 0.64 + 0.10 + 0.15 + 0.35; with nothing moving 0.99 m; a receding part does not shrink it."""
    assert separation_distance(course(np.array([v_r]), 0.1, 0.3, share), 1.6, 0.1, 0.35) == pytest.approx(S_p)


@pytest.mark.parametrize(("d", "K", "v"), [(2.0, 0.35, 1.233150), (1.0, 0.95, 0.0)])
def test_published_inverse(d, K, v):
    assert largest_speed_decelerating(d, 1.6, 0.1, 2.0, K) == pytest.approx(v, abs=5e-7)
    assert v > 0 or decelerating(0.0, 1.6, 0.1, 2.0, K) == pytest.approx(1.11)


@given(v=positive, v_h=positive, T_r=positive, a=positive, K=positive)
def test_inverse_of_the_constant_deceleration(v, v_h, T_r, a, K):
    d = decelerating(v, v_h, T_r, a, K)
    assert largest_speed_decelerating(d, v_h, T_r, a, K) == pytest.approx(v, rel=1e-6)
    factor = largest_factor(np.array([v_h * T_r + K - d]), np.array([v_h * v / a + v * T_r]), v**2 / (2 * a))
    assert factor == pytest.approx(1, rel=1e-6)


@given(
    v=positive, v_h=positive, T_r=positive, T_s=positive, K=positive, share=st.sampled_from([BOUND, CONSTANT])
)
def test_inverse_with_a_stopping_time(v, v_h, T_r, T_s, K, share):
    d = separation_distance(course(np.array([v]), T_r, T_s, share), v_h, T_r, K)
    assert largest_speed_in_time(d, v_h, T_r, T_s, K, share) == pytest.approx(v, rel=1e-6)


@pytest.mark.parametrize("inverse", [largest_speed_in_time, largest_speed_decelerating])
def test_a_person_who_backs_away_is_refused_in_metres_per_second(inverse):
    with pytest.raises(ValueError, match=r"-1\.6 m/s, "):
        inverse(1.0, -1.6, 0.1, 2.0, 0.2)


@given(x=st.tuples(positive, positive, positive, positive, positive), i=st.integers(0, 4), more=positive)
def test_separation_distance_grows_with_every_input(x, i, more):
    def S_p(v_r, v_h, T_r, T_s, K, share):
        return separation_distance(course(np.array([v_r]), T_r, T_s, share), v_h, T_r, K)[0]

    def by_norm(v_r, _, T_r, T_s, K, share):
        return least_distance(
            lambda v_h: separation_distance(course(np.array([v_r]), T_r, T_s, share), v_h, T_r, K)
        )[0]

    y = (*x[:i], x[i] + more, *x[i + 1 :])
    for share in (BOUND, CONSTANT):
        assert S_p(*y, share) > S_p(*x, share)
        assert by_norm(*y, share) >= by_norm(*x, share)


@given(v_r=positive, T_r=positive, T_s=positive)
def test_standing_robot_leaves_the_whole_way_of_the_person(v_r, T_r, T_s):
    still = separation_distance(course(np.zeros(1), T_r, T_s), 1.6, T_r, 0.0)
    assert still == pytest.approx(1.6 * (T_r + T_s))


@given(c=three(-5, 1), b=three(0, 5), a=three(0, 5))
def test_largest_factor_is_the_last_that_holds(c, b, a):
    c, b, a = map(np.array, (c, b, a))
    s = largest_factor(c, b, a)

    def worst(s):
        return (a * s * s + b * s + c).max()

    if s == 0:
        # Squares of the smallest numbers are 0.
        assert worst(0) >= -1e-100
    elif np.isfinite(s) and s < 1e6:
        assert worst(s * (1 - 1e-6)) <= 1e-9
        assert worst(s * (1 + 1e-6) + 1e-9) >= -1e-9
    else:
        assert worst(1e6 * (1 - 1e-6)) <= 1e-9


def test_no_factor_helps_a_part_that_is_too_near_at_rest():
    """Also where nothing grows with the speeds."""
    assert largest_factor(np.array([0.5]), np.zeros(1), np.zeros(1)) == 0.0
    assert largest_factor(np.array([-0.5]), np.zeros(1), np.zeros(1)) == np.inf
    assert largest_factor(np.array([-0.5]), np.zeros(1), np.full(1, 2.0)) == pytest.approx(0.5)


def test_search_ends_where_it_holds():
    assert largest_scale(lambda s: s <= 0.7, 2.0, 40) == pytest.approx(0.7)
    assert largest_scale(lambda s: s <= 0.7, 2.0, 3) <= 0.7
    assert largest_scale(lambda s: s <= 7, 2.0, 1) == 2.0
    assert largest_scale(lambda s: False, 2.0, 1) == 0.0


def test_worst_case_is_the_largest_of_each_part():
    assert (worst_case(np.array([[1.0, 5.0], [2.0, 3.0]])) == [2.0, 5.0]).all()


def test_travel_bounds_the_path_of_a_folded_arm():
    """Three links of 1 m that turn by up to 1.5 rad each, in any order and overlap, from any posture."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        q = rng.uniform(-3, 3, 3)
        speeds = rng.normal(size=(40, 3)) * 0.1
        angles = q + np.vstack([np.zeros(3), np.cumsum(speeds, axis=0)])
        turned = np.cumsum(angles, axis=1)
        joints = np.cumsum(np.stack([np.cos(turned), np.sin(turned)], -1), axis=1)
        tip = joints[:, 2]
        path = np.linalg.norm(np.diff(tip, axis=0), axis=1).sum()
        axes = np.array([[0, 0], joints[0, 0], joints[0, 1]])
        levers = np.linalg.norm(tip[0] - axes, axis=1)
        assert path <= travel([True] * 3, np.abs(speeds).sum(axis=0), levers) + 1e-12
    assert travel([False, True], np.array([0.3, 0.5]), np.array([9.0, 2.0])) == pytest.approx(1.3)
    assert travel([True, False], np.array([0.5, 0.3]), np.array([2.0, 9.0])) == pytest.approx(0.3 + 0.5 * 2.3)


# -- ISO 13855 ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("approach", "edition", "d", "H", "T", "S"),
    [
        (ACROSS, "2010", 0.030, None, 0.3, 0.608),
        (ACROSS, "2010", 0.014, None, 0.1, 0.200),
        (ACROSS, "2010", 0.050, None, 0.3, 1.330),
        (ALONG, "2010", None, 0.3, 0.3, 1.680),
        (ALONG, "2010", 0.07, 0.3, 0.3, 1.560),
        (ALONG, "2024", 0.07, 0.3, 0.3, 1.680),
        (ALONG, "2010", 0.05, 1.0, 0.0, 0.850),
        (ACROSS, "2010", 0.014, None, 0.01, 0.100),  # never nearer than 100 mm
        (ACROSS, "2010", 0.014, None, 0.26, 0.500),  # 520 mm at 2 m/s, 416 mm at 1.6 m/s
        (ACROSS, "2010", 0.010, None, 0.1, 0.200),  # C is never negative
        (ACROSS, "2010", 0.040, None, 0.1, 0.408),  # 40 mm is a fine field still: 2 m/s
        (ALONG, "2010", 0.05, 0.0, 0.0, 1.200),
        (ALONG, "2010", 0.05 + 1 / 15, 1.0, 0.0, 0.850),  # the coarsest, as high as it must be
        (ACROSS, "2010", None, None, 0.3, 1.330),
        (Approach.TWO_HAND, "2010", None, None, 0.5, 1.05),
    ],
)
def test_worked_minimum_distances(approach, edition, d, H, T, S):
    found = minimum_distance(approach, Edition(edition), T, capability=d, height=H, supplement=0.0, **NO_WAY)
    assert found.distance == pytest.approx(S, abs=1e-12)


def test_supplement_of_2024_is_added_and_needed():
    field = {"capability": 0.07, "height": 0.3, **NO_WAY}
    with pytest.raises(Undecided, match="Z is not given"):
        minimum_distance(ALONG, Edition.E2024, 0.3, **field)
    with_it = minimum_distance(ALONG, Edition.E2024, 0.3, **field, supplement=0.05)
    assert with_it.distance == pytest.approx(1.73)


@pytest.mark.parametrize("d", [0.041, 0.055, 0.07])
def test_what_sources_of_2024_do_not_agree_on_takes_the_larger_figure(d):
    found = intrusion(ACROSS, Edition.E2024, capability=d)
    assert found.value == 0.85 > 8 * (0.07 - 0.014)
    assert "do not agree" in found.note


@pytest.mark.parametrize("edition", Edition)
def test_what_nobody_knows_is_undecided(edition):
    with pytest.raises(Undecided):
        intrusion(ACROSS, edition, capability=0.0701)


def test_two_hand_control_of_2024_is_undecided():
    with pytest.raises(Undecided):
        intrusion(Approach.TWO_HAND, Edition.E2024)


@pytest.mark.parametrize(
    ("key", "more"),
    [
        ("height", {"approach": ALONG, "height": 0.29, "capability": 0.07}),
        ("height", {"approach": ALONG, "height": 1.01}),
        ("height", {"approach": ALONG, "height": -0.1}),
        ("height", {"approach": ACROSS, "height": 0.5}),
        # H would have to be above 1 m: d is at most 1000 / 15 + 50 = 116.7 mm.
        ("capability", {"approach": ALONG, "capability": 0.1167}),
        ("capability", {"approach": ALONG, "capability": 0.2}),
        ("capability", {"approach": ACROSS, "capability": -0.03}),
        ("capability", {"approach": ACROSS, "capability": 0.0}),
        ("capability", {"approach": ACROSS, "capability": float("nan")}),
    ],
)
def test_what_the_norm_does_not_admit_is_an_error(key, more):
    with pytest.raises(InputError) as error:
        intrusion(more.pop("approach"), Edition.E2010, **more)
    assert error.value.problems[0].key == key


@given(d=st.floats(0.001, 0.07), finer=st.floats(0, 1))
def test_a_finer_field_never_needs_more_room(d, finer):
    for approach in (ACROSS, ALONG):
        height = 0.3 if approach is ALONG else None
        for edition in Edition:
            fine = intrusion(approach, edition, capability=max(d * finer, 1e-4), height=height)
            assert fine.value <= intrusion(approach, edition, capability=d, height=height).value


@pytest.mark.parametrize("edition", Edition)
def test_coarse_field_along_the_floor_needs_its_height(edition):
    with pytest.raises(Undecided, match=r"at least 0\.3 m above the floor"):
        intrusion(ALONG, edition, capability=0.07)
    assert intrusion(ALONG, edition, capability=0.05).value == 1.2
    assert intrusion(ALONG, edition, capability=0.1166, height=1.0).value >= 0.85


@pytest.mark.parametrize(
    ("approach", "edition", "height", "ways"),
    [
        (ACROSS, "2010", None, ["reaching over the field"]),
        (ACROSS, "2024", None, ["reaching over the field", "reaching under the field"]),
        (ALONG, "2010", 0.2, []),
        (ALONG, "2010", 0.201, ["crawling under the field"]),
        (ALONG, "2024", None, ["crawling under the field"]),
    ],
)
def test_ways_around_the_field_are_open_until_somebody_speaks_of_them(approach, edition, height, ways):
    """C is the larger of C_RO and what the field gives: 8 (30 - 14) = 128 mm."""
    field = {"capability": 0.03, "height": height}
    assert list(intrusion(approach, Edition(edition), **field).uncovered) == ways
    closed = intrusion(approach, Edition(edition), **field, **NO_WAY)
    assert closed.uncovered == ()
    if approach is ACROSS:
        assert closed.value == pytest.approx(0.128)
        longer = intrusion(approach, Edition(edition), **field, over=0.9, under=0.0)
        assert longer.value == 0.9
        assert longer.source == f"{closed.source}; reaching over the field: 0.9 m"
    if ways:
        with pytest.raises(Undecided, match=ways[0]):
            minimum_distance(approach, Edition(edition), 0.3, **field, supplement=0.0)


def test_what_is_from_memory_says_so():
    for edition in Edition:
        assert "M)" in intrusion(ACROSS, edition, capability=0.07).source
        fine = intrusion(ACROSS, edition, capability=0.03).source
        assert fine.endswith("(2S)" if edition is Edition.E2010 else "(1S)")


def approach_speed(distance):
    found = np.empty(1)
    approach_speeds(np.array([distance]), assumed_speed(None), 0.0, found)
    return float(found[0])


@given(v=st.floats(0, 3), T=st.floats(0.01, 0.5), d=st.floats(0, 2))
def test_approach_speed_at_a_distance_decides_as_the_distance_itself(v, T, d):
    """So an inverse may use one speed: d ≥ S_p as switched if and only if d ≥ S_p at that speed."""

    def S(v_h):
        return np.array(v_h * T + v * T)

    if abs(d - least_distance(S)) > 1e-9:
        assert (d >= least_distance(S)) == (d >= S(approach_speed(d)))
    assert least_distance(S) >= S(1.6)
