"""Scores over a run: shares per level, percentiles and maxima with their instants."""

import math

import numpy as np
import pytest

from seerob.core.snapshot import Level, Result
from seerob.outputs.report.time_shares import distribution
from seerob.recording.series import Series

LEVELS = (Level(up_to=2, name="one"), Level(up_to=4, name="two"), Level(up_to=7, name="three"))


def series(values, period=0.1):
    made = Series(name="s", unit="", at_most=True)
    for k, value in enumerate(values):
        made.append(Result(name="s", value=None if math.isnan(value) else float(value)), k * period)
    return made


def test_shares_of_levels_are_of_all_ticks_and_sum_to_one():
    values = [1, 2, 3, 3, math.nan, 7, 7, 7, 2, math.nan]
    found = distribution(series(values), LEVELS)
    assert {s.name: s.share for s in found.levels} == pytest.approx(
        {"one": 0.3, "two": 0.2, "three": 0.3, "not assessed": 0.2}
    )
    assert found.coverage == pytest.approx(0.8)
    assert {s.name: s.longest for s in found.levels} == pytest.approx(
        {"one": 0.1, "two": 0.1, "three": 0.2, "not assessed": 0.0}
    )


def test_extremes_and_percentiles_have_the_instant_when_they_were_first_reached():
    rng = np.random.default_rng(0)
    values = rng.integers(1, 8, 999)
    found = distribution(series(values), LEVELS)
    for p, at in found.percentiles:
        assert at.value == np.percentile(values, p, method="inverted_cdf")
        assert at.t == pytest.approx(0.1 * np.flatnonzero(values == at.value)[0])
    assert (found.maximum.value, found.minimum.value) == (7, 1)
    assert found.maximum.t == pytest.approx(0.1 * np.argmax(values))
    assert found.mean == pytest.approx(values.mean())


def test_what_is_above_every_level_is_said():
    found = distribution(series([1, 9]), LEVELS)
    assert [s.name for s in found.levels if s.share] == ["one", "beyond"]


def test_never_assessed_is_no_distribution():
    assert distribution(series([math.nan, math.nan]), LEVELS) is None
    assert distribution(series([]), LEVELS) is None
