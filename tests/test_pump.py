"""The pump: each sample once, one ahead, and loops that say where nobody drove."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.core.samples import JointSample, Quality, SignalSample
from seerob.workstation.source import Opened, Pump


def opened(times, values=None):
    values = values if values is not None else [0.0] * len(times)
    samples = [
        JointSample(source="s", target="r", seq=i, t=t, q=(v,))
        for i, (t, v) in enumerate(zip(times, values, strict=True))
    ]
    return Opened(samples=samples, duration=times[-1] - times[0] if times else 0.0)


times = st.lists(st.floats(0.001, 0.3), max_size=30).map(lambda steps: [0.0, *itertools.accumulate(steps)])


@given(times, st.floats(0.001, 0.1))
def test_every_sample_comes_once_in_order_and_one_is_always_ahead(times, period):
    pump = Pump(opened(times))
    got, k = [], 0
    while not pump.finished:
        got += [s.t for s in pump.until(k * period)]
        # What follows now is known already, so that the reference can be interpolated to it.
        assert pump.finished or got[-1] > k * period
        # And never more than the one: what is far ahead has not been heard.
        assert len(got) < 2 or got[-2] <= k * period
        k += 1
    assert got == times
    assert list(pump.until(1e9)) == []


def test_a_closed_loop_goes_on_good_after_its_pause():
    pump = Pump(opened([0.0, 1.0], [5.0, 5.0005]), loop=True, pause=0.5)
    got = list(pump.until(4.0))
    assert [s.t for s in got if s.t % 0.5 == 0] == [0.0, 1.0, 1.5, 2.5, 3.0, 4.0]
    assert {s.quality for s in got} == {Quality.GOOD}
    assert not pump.finished
    # It says all through the pause that it stands still, so that it is never taken for silent.
    pause = [s for s in got if 1.0 < s.t < 1.5]
    assert {s.q for s in pause} == {(5.0005,)}
    assert max(b.t - a.t for a, b in itertools.pairwise(s for s in got if 1.0 <= s.t <= 1.5)) < 0.051


def test_samples_are_counted_through_all_rounds_and_never_go_back_in_time():
    for values in ([0.0, 0.1, 0.0], [0.0, 0.1, 0.2]):
        got = list(Pump(opened([0.0, 0.3, 0.7], values), loop=True, pause=0.21).until(10.0))
        assert [s.seq for s in got] == list(range(len(got)))
        assert all(b.t > a.t for a, b in itertools.pairwise(got))


def test_a_held_robot_has_no_velocity():
    samples = [JointSample(source="s", target="r", seq=i, t=float(i), q=(1.0,), qd=(2.0,)) for i in range(2)]
    got = list(Pump(Opened(samples=samples, duration=1.0), loop=True, pause=0.5).until(1.4))
    assert {s.qd for s in got if s.t > 1.0} == {(0.0,)}


def test_the_way_back_of_an_open_loop_is_never_judged():
    pump = Pump(opened([0.0, 1.0], [0.0, 0.1]), loop=True, pause=0.5)
    got = list(pump.until(3.1))
    assert [s.quality for s in got] == ["good", "good", "degraded", "good", "degraded", "good"]


def test_a_loop_of_one_instant_or_of_nothing_ends():
    assert len(list(Pump(opened([0.0]), loop=True).until(100.0))) == 1
    assert list(Pump(opened([]), loop=True).until(100.0)) == []


def test_signals_have_no_ends_to_compare():
    samples = [SignalSample(source="s", seq=i, t=float(i), values={}) for i in range(2)]
    pump = Pump(Opened(samples=samples, duration=1.0), loop=True, pause=1.0)
    got = list(pump.until(3.5))
    assert [s.t for s in got] == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert got[2].quality == Quality.DEGRADED


@pytest.mark.parametrize("loops", [1, 7])
def test_loops_do_not_drift(loops):
    pump = Pump(opened([0.0, 0.4]), loop=True, pause=0.1)
    got = [s.t for s in pump.until(0.5 * loops)]
    assert got[-2] == pytest.approx(0.5 * loops, abs=1e-12)
    assert sum(abs(t - 0.5 * round(2 * t)) < 1e-9 for t in got) == loops + 1
