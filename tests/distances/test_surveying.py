"""Asked together, asked alone, asked whether: the same answers, whatever was asked before."""

from __future__ import annotations

import numpy as np
import pytest

from concave import made_crowd, said, walk
from seerob.distance.least import DistanceKind, Per, Query, Survey, Surveyor


@pytest.fixture(scope="module")
def crowd():
    return made_crowd()


def questions(crowd):
    return [
        (Query(crowd, (0, 1, 2), (3, 4, 6)), Per.SETS),
        (Query(crowd, (3, 4, 6), (1, 2)), Per.BODY),
        (Query(crowd, (0, 1), (3, 5, 6), cap=0.3), Per.PAIR),
        (Query(crowd, (6,), (0, 1, 2), cap=0.2), Per.WHETHER),
        (Query(crowd, (3,), (4,)), Per.SETS),
    ]


def same(one, other):
    for a, b in zip(said(one), said(other), strict=True):
        np.testing.assert_array_equal(a, b)


def test_asked_together_is_asked_alone_bit_for_bit(crowd):
    R, x = walk(120, 7, 0.6)
    asked = questions(crowd)
    together, live = Survey(crowd, asked).batch(R, x), Survey(crowd, asked)
    for k, (query, per) in enumerate(asked):
        same(together[k], query.batch(R, x, per))
    for n in np.random.default_rng(2).permutation(len(R)):
        for found, expected in zip(live.ask(R[n], x[n]), together, strict=True):
            same(found, expected.of(n))


@pytest.mark.parametrize("cap", [0.05, 0.3, 1.0])
def test_whether_is_whether_the_distance_is_less(crowd, cap):
    """Over a slow walk, where bounds answer, and in any order, where they do not."""
    R, x = walk(200, 7, 0.8, 3)
    query = Query(crowd, (0, 1, 2), (3, 4, 6), cap=cap)
    expected = query.batch(R, x, Per.PAIR).distance < cap
    found = query.batch(R, x, Per.WHETHER)
    assert 0 < expected.sum() < expected.size
    assert ((found.kind == DistanceKind.WITHIN_CAP) == expected).all()
    assert ((found.kind == DistanceKind.BEYOND_CAP) == ~expected).all()
    assert (found.distance == cap).all()
    assert np.isnan(found.point_a).all()
    for n in np.random.default_rng(1).permutation(len(R)):
        same(query.ask(R[n], x[n], Per.WHETHER), found.of(n))


def test_a_surveyor_says_what_the_query_says_however_it_is_asked(crowd):
    R, x = walk(700, 7, 0.6, 5)
    asked = questions(crowd)
    answers = [query.batch(R, x, per) for query, per in asked]
    surveyor, random, together = Surveyor(crowd), np.random.default_rng(0), 0
    for n in range(len(R)):
        surveyor.forget()
        # One always, one never after a while, the others now and then and more than once.
        for k in [0, *([1] if n < 100 else []), *random.integers(2, 5, 3).tolist()]:
            same(surveyor.ask(*asked[k], R[n], x[n]), answers[k].of(n))
        both = random.choice(5, 2, replace=False).tolist()
        if found := surveyor.together(tuple(asked[k] for k in both), R[n], x[n]):
            every, begins = found
            for k, begin in zip(both, begins, strict=True):
                same(every.of(slice(begin, begin + len(answers[k].distance[n]))), answers[k].of(n))
                together += 1
    assert together > 100
