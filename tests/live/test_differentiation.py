"""Speeds from positions, against closed forms and numpy's least squares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.devices.live.differentiation import (
    DEVIATIONS_OF_FEW,
    FEW,
    SAMPLES,
    Differentiator,
    PositionNoise,
    end_weights,
)

steps = st.lists(st.floats(1e-3, 0.1), min_size=2, max_size=SAMPLES - 1)


def end_slope(times, values):
    return np.array(end_weights(list(times))) @ np.asarray(values)


@given(steps, st.floats(0, 2e9), st.integers(0, 2**32))
def test_it_is_the_slope_of_the_least_squares(steps, start, seed):
    t = np.cumsum([0.0, *steps])
    values = np.random.default_rng(seed).uniform(-3, 3, (len(t), 2))
    oracle = [np.polyfit(t - t[-1], column, 2)[1] for column in values.T]
    assert end_slope(t, values) == pytest.approx(oracle, rel=1e-6, abs=1e-6)
    assert sum(end_weights(list(t))) == pytest.approx(0.0, abs=1e-6 / t[-1])
    shifted = (start + t).tolist()  # a clock of seconds since 1970 says them only so exactly
    if start < 1e3:
        assert end_slope(shifted, values) == pytest.approx(oracle, rel=1e-4, abs=1e-2)


def test_slope_is_exact_for_constant_acceleration_at_uneven_instants():
    t = np.array([0.0, 0.004, 0.011, 0.015, 0.02])
    values = np.stack([1 + 2 * t + 3 * t**2, -t], axis=1)
    assert end_slope(t, values) == pytest.approx([2 + 6 * 0.02, -1.0], abs=1e-11)


def test_instants_that_tell_no_parabola_have_the_slope_of_a_line():
    for t in ([0.0, 1e-9, 0.1], [0.0, 0.1 - 1e-9, 0.1], [5.0, 5.0 + 1e-15, 6.0]):
        assert end_slope(t, np.multiply(2.0, t)) == pytest.approx(2.0)
        assert np.abs(end_weights(t)).max() < 100


def test_noise_of_the_slope_is_what_the_formula_says():
    n, T, sigma, rng = SAMPLES, 0.005, 1e-5, np.random.default_rng(1)
    t = T * np.arange(n)
    spread = np.std(end_slope(t, sigma * rng.standard_normal((n, 20_000))))
    stated = sigma / T * np.sqrt(12 * (2 * n - 1) * (8 * n - 11) / (n * (n**2 - 1) * (n**2 - 4)))
    assert spread == pytest.approx(stated, rel=0.02)


def test_a_gap_begins_anew():
    slope = Differentiator(0.1)
    ramp = [slope.add(0.01 * k, (0.02 * k, -0.01 * k)) for k in range(10)]
    assert ramp[:3] == [None, None, None]
    for speeds in ramp[3:]:
        assert speeds == pytest.approx((2.0, -1.0))
    assert slope.add(1.0, (5.0, 5.0)) is None
    assert slope.add(0.5, (5.0, 5.0)) is None
    # What is known of the noise stays: three tell a speed then.
    assert slope.add(0.51, (5.0, 5.0)) is None
    assert slope.add(0.52, (5.0, 5.0)) == pytest.approx((0.0, 0.0))


def told(noise, t, q):
    for instant, value in zip(t.tolist(), q.tolist(), strict=True):
        noise.add(instant, (value,))


@pytest.mark.parametrize("hertz", [20, 125, 500])
@pytest.mark.parametrize("uneven", [0.0, 0.4])
def test_how_far_derived_speeds_may_be_off_is_what_the_noise_makes(hertz, uneven):
    """Of a swing, at even and at uneven instants: hardly ever more than that, and mostly not much less."""
    rng, sigma, count = np.random.default_rng(2), 3e-4, 400
    t = (np.arange(count) + uneven * rng.uniform(-0.5, 0.5, count)) / hertz
    q, v = 0.3 * np.sin(1.5 * t), 0.45 * np.cos(1.5 * t)
    q += sigma * rng.standard_normal(count)
    for n in (3, SAMPLES) if hertz > 100 else (3,):
        noise, off = PositionNoise(), []
        for k in range(count):
            noise.add(t[k], (q[k],))
            if k >= n + FEW:
                times = t[k - n + 1 : k + 1].tolist()
                (error,) = noise.speed_error(times)
                wrong = abs(end_slope(times, q[k - n + 1 : k + 1, None])[0] - v[k])
                off.append(wrong / error)
        assert np.mean(np.array(off) > 1) < 0.02
        assert 0.2 < np.sqrt(np.mean(np.square(off))) < 0.5  # a third, of three standard deviations


def test_what_has_no_noise_is_not_off():
    noise = PositionNoise()
    t = np.arange(200) / 125
    told(noise, t, 0.3 * np.sin(1.5 * t))
    assert noise.speed_error(t[-3:].tolist())[0] < 5e-3


def test_before_much_is_told_the_largest_counts():
    noise = PositionNoise()
    told(noise, np.arange(3.0), np.zeros(3))
    assert noise.speed_error([0.0, 1.0, 2.0]) is None
    noise.add(3.0, (1.0,))
    noise.add(3.0, (9.0,))  # not later: left out
    (first,) = noise.speed_error([1.0, 2.0, 3.0])
    assert first == pytest.approx(DEVIATIONS_OF_FEW[0] * np.sqrt(6.5) / np.sqrt(20))
    told(noise, np.arange(4.0, 12.0), np.ones(8))
    largest = 2 * 3 * np.sqrt(6.5) / np.sqrt(20)
    assert noise.speed_error([9.0, 10.0, 11.0])[0] == pytest.approx(largest)


@pytest.mark.parametrize("samples", [3, SAMPLES])
def test_how_far_derived_speeds_may_be_off_holds_from_the_first_time_it_is_told(samples):
    rng = np.random.default_rng(3)
    for count in (1, 2, 3, 5, 8, 9, 12, 16, 20, 32):
        beyond = []
        for _ in range(1000):
            noise, q = PositionNoise(), rng.standard_normal(count + 3)
            told(noise, np.arange(float(len(q))), q)
            q = q[-samples:]
            (error,) = noise.speed_error(np.arange(float(len(q))).tolist())
            beyond.append(abs(end_slope(np.arange(float(len(q))), q)) > error)
        assert np.mean(beyond) < 0.008, count


@pytest.mark.parametrize("step", [1e-160, 1e150])
def test_instants_that_are_too_near_or_too_far_apart_tell_nothing(step):
    slope = Differentiator(np.inf)
    for k in range(SAMPLES):
        slope.add(step * k, (0.1 * (k % 2),))
        error = slope.error()
        assert error is None or not np.isfinite(error[0])


@pytest.mark.parametrize("before", [2, 200])
def test_noise_after_a_clock_has_begun_again_is_told(before):
    """A controller that is switched on again, or milliseconds that are full: its clock is behind for long."""
    rng, slope, period = np.random.default_rng(5), Differentiator(1.0), 0.004
    for k in range(before):
        slope.add(4e6 + period * k, (0.5,))
    speeds, told = [], []
    for k in range(400):
        speed = slope.add(period * k, (float(rng.normal(0.5, 1e-4)),))
        if speed is not None and k > 200:
            speeds.append(speed[0])
            told.append(slope.error()[0])
    assert np.mean(np.abs(speeds) <= told) > 0.98


def test_a_jump_is_no_noise():
    noise = PositionNoise()
    told(noise, np.arange(60.0), np.where(np.arange(60) < 30, 0.0, 1.0))
    assert noise.speed_error([57.0, 58.0, 59.0])[0] < 1e-12
    noise.add(60.0, (1.0, 1.0))
    assert noise.speed_error([57.0, 58.0, 59.0]) is None
