"""The reference through samples: cubics, guesses, ends and jumps."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.twin.control.reference import MAX_KEPT, Reference

ZERO = np.zeros(1)


def through(times, f, df=None, **more):
    reference = Reference(ZERO, **more)
    for t in times:
        reference.take(float(t), np.array([f(t)]), None if df is None else np.array([df(t)]))
    return reference


def test_cubic_motion_is_reproduced_with_its_derivatives():
    f, df, ddf = (
        np.poly1d([0.7, -1.3, 0.4, 2.0]).deriv(k) if k else np.poly1d([0.7, -1.3, 0.4, 2.0]) for k in range(3)
    )
    reference = through([0.0, 0.3, 0.5, 1.1], f, df)
    for t in np.linspace(0, 1.0999, 57):
        np.testing.assert_allclose(np.ravel(reference.at(t)), [f(t), df(t), ddf(t)], atol=1e-9)


def test_parabola_is_reproduced_without_velocities():
    f = np.poly1d([1.5, -2.0, 0.3])
    reference = through([0.0, 0.1, 0.25, 0.3, 0.5], f)
    for t in np.linspace(0.1, 0.4999, 41):
        np.testing.assert_allclose(np.ravel(reference.at(t)), [f(t), f.deriv()(t), 3.0], atol=1e-9)


def test_position_and_velocity_are_continuous_at_samples():
    reference = through(np.arange(8) * 0.1, lambda t: np.sin(7 * t), lambda t: 7 * np.cos(7 * t))
    for t in np.arange(1, 7) * 0.1:
        a, b = reference.at(t - 1e-12), reference.at(t + 1e-12)
        assert a[0] == pytest.approx(b[0], abs=1e-9)
        assert a[1] == pytest.approx(b[1], abs=1e-8)


def test_before_the_first_and_after_the_last_sample_it_rests():
    reference = through([1.0, 1.1], lambda t: 5 * t, lambda t: 5.0)
    assert [x[0] for x in reference.at(0.2)] == [5.0, 0.0, 0.0]
    assert [x[0] for x in reference.at(9.0)] == [5.5, 0.0, 0.0]


def test_without_samples_it_is_at_home():
    q, v, a = Reference(np.array([1.0, 2.0])).at(3.0)
    assert q.tolist() == [1, 2]
    assert v.tolist() == a.tolist() == [0, 0]


@pytest.mark.parametrize("late", [0.05, 0.1])
def test_a_sample_that_is_not_newer_changes_nothing(late):
    reference = through([0.0, 0.1], lambda t: t)
    before = reference.at(0.07)
    assert not reference.take(late, np.array([99.0]), None)
    assert reference.at(0.07)[0] == before[0]
    assert reference.newest == 0.1


def test_forgetting_what_is_past_changes_nothing_from_then_on():
    times = np.arange(20) * 0.01
    whole, short = (through(times, np.sin, np.cos) for _ in range(2))
    short.forget(0.105)
    for t in np.linspace(0.105, 0.25, 30):
        assert [x[0] for x in whole.at(t)] == [x[0] for x in short.at(t)]


def test_what_is_kept_is_bounded():
    reference = through(np.arange(MAX_KEPT + 500) * 1e-3, np.sin, np.cos)
    assert len(reference._times) == MAX_KEPT
    assert reference.at(4.4005)[0][0] == pytest.approx(np.sin(4.4005), abs=1e-9)


@pytest.mark.parametrize("df", [None, lambda t: 0.0])
def test_a_jump_is_held_and_landed_on_not_interpolated(df):
    reference = through([0.0, 0.01, 0.02, 0.03], lambda t: 3.0 if t > 0.015 else 0.0, df, largest_speed=30.0)
    for t in (0.005, 0.01, 0.0199):
        assert [x[0] for x in reference.at(t)] == [0.0, 0.0, 0.0]
    for t in (0.02, 0.025, 0.03):
        assert [x[0] for x in reference.at(t)] == [3.0, 0.0, 0.0]
    assert [reference.lands(t) for t in (0.018, 0.02, 0.022, 0.03)] == [False, True, False, False]


def test_no_speed_of_a_reference_comes_from_a_jump():
    """A motion of 1 rad/s before and after a jump of 3 rad stays one of 1 rad/s."""
    times = np.arange(8) * 0.01
    reference = through(times, lambda t: t + (3.0 if t > 0.035 else 0.0), largest_speed=30.0)
    speeds = [reference.at(t)[1][0] for t in np.linspace(0.04, 0.0699, 50)]
    assert max(speeds) <= 1.0 + 1e-9


def test_impossible_given_velocity_is_a_jump_too():
    reference = Reference(ZERO, 30.0)
    reference.take(0.0, np.array([0.0]), np.array([0.0]))
    reference.take(0.01, np.array([0.01]), np.array([1e6]))
    assert reference.jumped
    assert reference.at(0.01)[1] == 0.0


def test_a_live_reference_coasts_until_the_next_sample_or_its_time():
    reference = Reference(np.zeros(1), coast=0.2)
    reference.take(1.0, np.array([3.0]), np.array([2.0]))
    for t, q, v in ((1.0, 3.0, 2.0), (1.1, 3.2, 2.0), (1.25, 3.4, 0.0), (9.0, 3.4, 0.0)):
        np.testing.assert_allclose(np.concatenate(reference.at(t)), [q, v, 0.0], atol=1e-12)


def test_after_a_silence_the_twin_is_put_where_the_sample_is_and_in_motion_when_its_instant_comes():
    reference = Reference(np.zeros(1), coast=0.2)
    reference.take(0.0, np.array([1.0]), np.array([1.0]))
    assert reference.take(5.0, np.array([3.0]), np.array([2.0]), anew=True)
    assert reference.lands(4.9)
    assert not reference.lands(4.95)
    np.testing.assert_array_equal(np.concatenate(reference.at(4.95)), [3.0, 0.0, 0.0])
    assert reference.lands(5.0)
    np.testing.assert_array_equal(np.concatenate(reference.at(5.0)), [3.0, 2.0, 0.0])
    assert not reference.take(4.0, np.array([9.0]), None, anew=True)
    assert reference.until == 5.0
