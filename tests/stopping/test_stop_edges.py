"""Edges of the separation distance and of how it is searched: on the limit, at rest, at the first instant."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.core.errors import Undecided
from seerob.core.tolerances import Tolerance
from seerob.criteria.safety.separation import room_ends
from seerob.criteria.stopping import required, table
from seerob.criteria.stopping.required import LargestSeparation, SeparationEnds, factor_by_search
from seerob.criteria.stopping.table import interpolate, joint_stop
from seerob.criteria.stopping.terms import (
    BOUND,
    CONSTANT,
    course,
    largest_factor,
    largest_scale,
    way_of_person,
)


def test_full_speed_until_standstill_is_the_bound_and_half_of_it_a_constant_deceleration():
    """So a course says its share only where it is not all of v_r T_s."""
    assert (BOUND, CONSTANT) == (1.0, 0.5)
    assert course(np.array([2.0]), 0.1, 0.3).S_s == pytest.approx(0.6)
    assert course(np.array([2.0]), 0.1, 0.3, CONSTANT).S_s == pytest.approx(0.3)


def test_a_person_who_recedes_counts_as_standing():
    assert way_of_person(-1.0, 0.1, 0.3) == way_of_person(0.0, 0.1, 0.3) == 0.0
    assert way_of_person(0.5, 0.1, 0.3) == pytest.approx(0.2)


def test_a_part_that_is_as_near_as_it_may_be_at_rest():
    """Any factor where nothing grows, none where anything does."""
    zero, one = np.zeros(1), np.ones(1)
    assert largest_factor(zero, zero) == largest_factor(zero, zero, zero) == np.inf
    assert (
        largest_factor(zero, one) == largest_factor(zero, zero, one) == largest_factor(zero, zero, 1.0) == 0
    )
    assert largest_factor(np.array([-1.0]), np.array([2.0])) == 0.5
    assert largest_factor(np.array([-1.0, -1.0]), np.array([2.0, 4.0]), 0.0) == 0.25
    assert np.isnan(largest_factor(np.array([np.nan]), one))


def test_the_largest_of_a_run_is_that_of_one_state_forward_in_time():
    class Run:
        t = 0.0

    now, largest = Run(), LargestSeparation()
    for t, S_p, found in (
        (0.0, [1.0, 5.0], [1.0, 5.0]),
        (0.1, [2.0, 3.0], [2.0, 5.0]),
        (0.1, [1.0, 1.0], [2.0, 5.0]),
        (0.05, [1.0, 1.0], [1.0, 1.0]),
        (0.2, [0.5, 2.0], [1.0, 2.0]),
    ):
        now.t = t
        assert largest.including(now, np.array(S_p)).tolist() == found
    other = Run()
    other.t = 0.3
    assert largest.including(other, np.array([0.1, 0.1])).tolist() == [0.1, 0.1]


def test_a_search_halves_so_often_and_stays_below():
    assert [largest_scale(lambda s: s <= 0.7, 2.0, n) for n in range(5)] == [0, 0, 0.5, 0.5, 0.625]


@pytest.mark.parametrize(("costly", "top", "halvings"), [(False, required.TOP, 14), (True, 1.0, 6)])
def test_the_largest_factor_is_searched_up_to_ten_times_the_present_speeds(costly, top, halvings):
    """A costly course is asked seldom, and never beyond the present speeds."""
    asked = []

    def S_p(factor):
        asked.append(factor)
        if factor > 9.5:
            raise Undecided("beyond a table")
        return np.array([factor, 2 * factor])

    assert required.TOP == 10.0
    found = factor_by_search(S_p, np.array([5.0, 0.6]), costly)
    assert len(asked) == 2 + halvings
    assert max(asked) == top
    assert 0 < found <= 0.3 < found + top / 2**halvings
    assert factor_by_search(S_p, np.array([5.0, 2 * top]), costly) <= top
    assert factor_by_search(lambda s: np.zeros(1), np.zeros(1), costly) == top


# -- intervals ------------------------------------------------------------------------------------


def test_what_S_p_may_be_off_is_put_on_the_side_of_the_distance():
    distance, S_p, none = np.array([3.0, 2.0]), np.array([1.0, 1.5]), np.zeros(2)

    def between(near, far, low, high):
        ends = room_ends(near, far, S_p, none, low, high)
        return list(zip(*(each.tolist() for each in ends), strict=True))

    assert between(distance, distance, S_p, S_p) == [(3.0, 3.0), (2.0, 2.0)]
    assert between(distance - 0.25, distance + 0.25, S_p, S_p) == [(2.75, 3.25), (1.75, 2.25)]
    assert between(distance, distance, S_p - 0.5, S_p + 0.25) == [(2.75, 3.5), (1.75, 2.5)]
    assert between(distance - 1.0, distance + 1.0, S_p - 0.5, S_p + 0.25) == [(1.75, 4.5), (0.75, 3.5)]


@pytest.mark.parametrize("remembers", [False, True])
def test_ends_are_bound_once_and_asked_of_each_state(remembers):
    """What depends on what was before is asked at every tick, for every end."""
    bound, asked = [], []

    def required(shifts):
        bound.append(shifts)

        def at(state):
            asked.append(shifts)
            return np.array([state + shifts[0] + 10 * shifts[1]])

        return at

    both = tuple(Tolerance(name, 1.0, "m") for name in "ab")
    ends = SeparationEnds(both, required, remembers=remembers)
    for state in (100.0, 200.0):
        found = ends.at(state)
        assert (found.low, found.high) == (state - 11, state + 11)
        assert len(asked) == (6 if remembers else 2)
        assert found.widths[:, 0].tolist() == [2.0, 20.0]
        asked.clear()
    assert len(bound) == len(set(bound)) == 6


# -- tables ---------------------------------------------------------------------------------------

ONE = table.JointStop(joint=0, way=(((0.3,),),), time=(((0.2,),),))


def test_two_nodes_have_a_middle_and_an_end_within_rounding():
    axes, values = [(1.0, 2.0)], np.array([3.0, 7.0])
    for x, found in ((0.0, 3.0), (1.0, 3.0), (1.25, 4.0), (2.0, 7.0), (2 * (1 + 5e-10), 7.0)):
        assert interpolate(axes, values, [x]) == pytest.approx(found)
    with pytest.raises(Undecided, match="2 is beyond the table, which ends at 2"):
        interpolate(axes, values, [2 * (1 + 2e-9)])


def test_a_joint_may_be_at_its_full_figures_within_rounding():
    for x in (1.0, 1 + 5e-10):
        assert joint_stop(ONE, x, x, x) == (0.3, 0.2)
        assert joint_stop(ONE, -x, 0.0, 0.0) == (0.3, 0.2)
    for at in ((1 + 2e-9, 1, 1), (-1 - 2e-9, 1, 1), (1, 1 + 2e-9, 1), (1, 1, 1 + 2e-9)):
        with pytest.raises(Undecided, match="the table ends at 1"):
            joint_stop(ONE, *at)
