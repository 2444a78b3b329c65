"""Verdicts in arrays are those of each value, by the rule for one."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from seerob.core.snapshot import Verdict
from seerob.core.verdict import judge, judge_interval
from seerob.criteria.figure import Figure, answers_of, verdict_of
from seerob.recording.answers import Answers, judge_many
from seerob.recording.series import CODES, NO_VERDICT

EDGES = np.array([-1.0, np.nextafter(1.0, 0), 1.0, np.nextafter(1.0, 2), np.inf, np.nan])


def code(verdict):
    return NO_VERDICT if verdict is None else CODES[verdict]


@pytest.mark.parametrize("at_most", [True, False])
@pytest.mark.parametrize("limit", [1.0, None])
def test_each_value_is_judged_alone(limit, at_most):
    expected = [code(judge(float(x), limit, at_most=at_most)) for x in EDGES]
    assert judge_many(EDGES, limit, at_most=at_most).tolist() == expected
    found = Answers.against(EDGES, limit, at_most=at_most)
    assert found.verdict.tolist() == expected
    assert np.isnan(found.limit).all() if limit is None else (found.limit == limit).all()


@pytest.mark.parametrize("at_most", [True, False])
@pytest.mark.parametrize("limit", [1.0, None])
def test_each_interval_is_judged_alone(limit, at_most):
    low, high = np.array([ends for ends in itertools.product(EDGES[:5], repeat=2) if ends[0] <= ends[1]]).T
    found = Answers.against(low, limit, at_most=at_most).between(low, high, at_most=at_most)
    pairs = zip(low.tolist(), high.tolist(), strict=True)
    assert found.verdict.tolist() == [code(judge_interval(ends, limit, at_most=at_most)) for ends in pairs]
    assert found.interval == (pytest.approx(low), pytest.approx(high))


def test_what_is_said_of_some_instants_is_said_of_no_other():
    within, exceeded, undecided = (CODES[v] for v in (Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED))
    found = Answers.against(np.array([0.0, 0.0, 2.0, np.nan]), 1.0, at_most=True)
    assert found.verdict.tolist() == [within, within, exceeded, undecided]
    some = np.array([True, False, True, False])
    assert found.exceeded(some).verdict.tolist() == [exceeded, within, exceeded, undecided]
    assert found.without_verdict(some).verdict.tolist() == [NO_VERDICT, within, NO_VERDICT, undecided]
    assert found.open().verdict.tolist() == [undecided, undecided, exceeded, undecided]
    infinite = Answers.against(np.array([np.inf, 0.0]), 1.0, at_most=True).finite()
    assert np.isnan(infinite.value).tolist() == [True, False]
    assert infinite.verdict.tolist() == [exceeded, within]


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("at_most", [True, False])
@pytest.mark.parametrize("limit", [None, 1.0])
@pytest.mark.parametrize("value", [0.5, 1.0, 1.5, NAN, INF])
@pytest.mark.parametrize("ends", [None, (0.0, 0.0), (0.4, 0.6), (0.5, 1.5), (NAN, NAN), (0.4, NAN)])
@pytest.mark.parametrize("flags", [{}, {"nothing": True}, {"exceeded": True}, {"open": True}])
def test_a_figure_says_of_many_instants_what_it_says_of_one(at_most, limit, value, ends, flags):
    one = verdict_of(Figure(value, limit, ends, **flags), at_most=at_most)
    arrays = None if ends is None else tuple(np.full(3, end) for end in ends)
    each = {name: np.full(3, flag) for name, flag in flags.items()}
    many = answers_of(Figure(np.full(3, value), limit, arrays, **each), 3, at_most=at_most)
    assert many.verdict.tolist() == [CODES[one]] * 3
