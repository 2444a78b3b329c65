"""Static and repeated work in made signals."""

import numpy as np
import pytest

from seerob.criteria.scoring.held_work import repetitions, static


def signal(duration, rate=10.0):
    t = np.arange(0, duration, 1 / rate)
    return t, np.ones((len(t), 3), int)


@pytest.mark.parametrize(("held", "expected"), [(60.5, True), (60.0, True), (59.0, False)])
def test_a_minute_is_static(held, expected):
    t, scores = signal(100)
    scores[(t >= 10) & (t < 10 + held - 1e-9), 1] = 2
    scores[t >= 10 + held - 1e-9, 1] = 3
    found = static(t, scores, 60.0)
    assert found.any() == expected
    if expected:
        assert t[found][0] == pytest.approx(10)
        assert t[found][-1] == pytest.approx(10 + held, abs=0.11)


@pytest.mark.parametrize(("away", "expected"), [(0.9, True), (1.0, False), (1.5, False)])
def test_a_short_glance_does_not_end_it(away, expected):
    t, scores = signal(65)
    scores[(t >= 30 - 1e-9) & (t < 30 + away - 1e-9), 0] = 4
    found = static(t, scores, 60.0)
    assert found.all() == expected
    assert found.any() == expected


def test_many_glances_do_not_add_up():
    """Away for half of every second: each return is within the gap."""
    t, scores = signal(70)
    scores[(t % 1.0) > 0.45, 2] = 2
    assert static(t, scores, 60.0).all()
    scores[(t > 30) & (t < 40), 2] = 3
    assert not static(t, scores, 60.0).any()


@pytest.mark.parametrize("cycles", [3, 4, 5])
def test_cycles_per_minute(cycles):
    t = np.arange(0, 180, 0.05)
    band = 1 + (np.sin(2 * np.pi * cycles * t / 60 - 0.3) > 0).astype(int)
    counts = repetitions(t, band)
    assert set(counts[t > 61]) == {cycles}
    assert counts[0] == 0


def test_the_length_of_the_signal_does_not_matter():
    assert static([], np.zeros((0, 2)), 60).tolist() == []
    assert static([0.0], [[1]], 60).tolist() == [False]
    assert repetitions([0.0], [1]).tolist() == [0]
    assert static([0.0, 61.0], [1, 2], 60).tolist() == [True, False]
