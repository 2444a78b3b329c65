"""A device's time on the host's clock, and how regularly it is heard."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.live.arrivals import Arrivals
from seerob.live.device_clock import WINDOW, DeviceClock


@given(st.floats(-1e6, 1e6), st.lists(st.floats(0, 0.5), min_size=1, max_size=80))
def test_an_instant_is_late_by_the_least_latency_and_never_later_than_it_arrived(offset, latencies):
    clock, least = DeviceClock(), math.inf
    for k, latency in enumerate(latencies):
        device = 0.008 * k
        taken, arrived = device + offset, device + offset + latency
        least = min(least, latency)
        instant = clock.instant(device, arrived)
        assert instant == pytest.approx(taken + least, abs=1e-9)
        assert instant <= arrived + 1e-9


@given(st.lists(st.floats(0, 1), min_size=2, max_size=50))
def test_only_news_is_told(stamps):
    clock, newest = DeviceClock(), -math.inf
    for k, stamp in enumerate(stamps):
        assert (clock.instant(stamp, 10 + 0.01 * k) is not None) == (stamp > newest)
        newest = max(newest, stamp)


@pytest.mark.parametrize("drift", [1e-4, -1e-4, 1e-3])
def test_a_clock_that_drifts_is_followed(drift):
    clock = DeviceClock()
    chance = np.random.default_rng(1)
    for k in range(12_000):
        taken = 0.01 * k
        instant = clock.instant(taken * (1 + drift) + 7, taken + 0.001 + chance.exponential(0.002))
        assert abs(instant - taken - 0.001) < WINDOW * abs(drift) + 0.003


def test_a_device_that_starts_again_is_believed_and_one_that_stands_still_is_not():
    clock = DeviceClock()
    assert clock.instant(500.0, 10.0) == 10.0
    assert clock.instant(500.0, 10.5) is None
    assert clock.instant(0.5, 11.0) == 11.0
    assert clock.offset == 10.5
    assert all(clock.instant(t, 12.0) is None for t in (math.nan, math.inf, -math.inf, 1.1e12, -1e308))
    clock.restart()
    assert clock.offset is None


def test_a_backlog_keeps_its_own_instants():
    """A network that held everything back for 3 s: what then comes at once is old, and looks it."""
    clock = DeviceClock()
    for k in range(100):
        clock.instant(0.01 * k, 5 + 0.01 * k)
    for k in range(100, 400):
        assert clock.instant(0.01 * k, 9.0) == pytest.approx(5 + 0.01 * k)


@given(st.lists(st.floats(1e-4, 1.0), min_size=1, max_size=60))
def test_arrivals_have_the_mean_and_the_deviation_of_their_intervals(intervals):
    arrivals = Arrivals()
    for host in np.cumsum([0.0, *intervals]).tolist():
        arrivals.add(host, None)
    found = arrivals.statistics()
    assert found.count == len(intervals) + 1
    assert found.rate == pytest.approx(1 / np.mean(intervals))
    assert found.jitter == pytest.approx(np.std(intervals), abs=1e-6)
    assert found.longest_gap == pytest.approx(max(intervals))


def test_what_is_missing_is_told_by_the_device_and_a_loss_is_no_gap():
    arrivals = Arrivals(0.01)
    for k in (0, 1, 2, 5, 6):
        arrivals.add(0.01 * k, 0.01 * k)
    arrivals.repeat()
    arrivals.lose()
    arrivals.lose()
    arrivals.add(100.0, 0.0)
    found = arrivals.statistics()
    assert (found.missed, found.repeated, found.losses, found.count) == (2, 1, 1, 6)
    assert found.longest_gap == pytest.approx(0.03)


def test_nothing_heard_has_no_figures():
    assert Arrivals().statistics().rate is None
    assert str(Arrivals().statistics()) == "0 samples"
