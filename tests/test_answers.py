"""Verdicts in arrays are those of each value, by the rule for one."""

from __future__ import annotations

import itertools
from typing import ClassVar

import numpy as np
import pytest

from seerob.core.markers import Label
from seerob.core.snapshot import Result, Row, Verdict
from seerob.core.verdict import ROUNDING, judge, judge_interval, keeps, worst
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Figure, Parts, Shown, answers_of, result_of, verdict_of
from seerob.criteria.judging import contradiction, unsaid
from seerob.kernels import verdicts
from seerob.recording.answers import Answers, judge_many, keep_many
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
@pytest.mark.parametrize(
    "ends",
    [None, (0.0, 0.0), (0.4, 0.6), (0.5, 1.5), (NAN, NAN), (0.4, NAN), (-INF, 0.5), (0.5, INF)],
)
@pytest.mark.parametrize("flags", [{}, {"nothing": True}, {"exceeded": True}, {"open": True}])
def test_a_figure_says_of_many_instants_what_it_says_of_one(at_most, limit, value, ends, flags):
    one = verdict_of(Figure(value, limit, ends, **flags), at_most=at_most)
    arrays = None if ends is None else tuple(np.full(3, end) for end in ends)
    each = {name: np.full(3, flag) for name, flag in flags.items()}
    many = answers_of(Figure(np.full(3, value), limit, arrays, **each), 3, at_most=at_most)
    assert many.verdict.tolist() == [CODES[one]] * 3
    # A result shows it: what is no number, or has no end, as none.
    figure = Figure(None if np.isnan(value) else value, limit, ends, **flags)
    told = result_of(figure, one, Shown("why"), Result(name="x", unit="m", at_most=at_most))
    shown = [None if np.isnan(x) else x for x in (many.value[0], many.limit[0])]
    assert [told.value, told.limit] == shown
    assert told.interval == (ends if ends in ((0.4, 0.6), (0.5, 1.5)) else None)
    assert told.nothing is (many.nothing is not None and bool(many.nothing[0]))
    assert (told.name, told.unit, told.at_most, told.reason) == ("x", "m", at_most, "why")
    assert told.verdict is one


@pytest.mark.parametrize("at_most", [True, False])
def test_each_instant_is_judged_alone_whatever_is_beside_it(at_most):
    """Values with and without ends, what is open or exceeded or nothing, in any order."""
    rng = np.random.default_rng(7)
    for n in (1, 2, 60):
        value, limit = rng.choice([0.5, 1.0, 1.5, NAN, INF], n), rng.choice([1.0, 1.2, INF, -INF], n)
        low, high = (np.where(rng.random(n) < 0.5, value, value + off) for off in (-0.4, 0.4))
        flags = {name: rng.random(n) < 0.3 for name in ("nothing", "exceeded", "open")}
        many = answers_of(Figure(value, limit, (low, high), **flags), n, at_most=at_most)
        for k in range(n):
            each = {name: bool(flag[k]) for name, flag in flags.items()}
            alone = Figure(float(value[k]), float(limit[k]), (float(low[k]), float(high[k])), **each)
            assert many.verdict[k] == code(verdict_of(alone, at_most=at_most))


def test_a_count_is_exact_and_what_is_no_count_is_shown_as_a_float():
    assert [verdict_of(Figure(3, 3.0), at_most=side) for side in (True, False)] == [Verdict.WITHIN] * 2
    for value, kind in ((3, int), (np.float64(3.0), float), (np.float32(3.0), float)):
        told = result_of(Figure(value, 4.0), Verdict.WITHIN, Shown(), Result(name="x"))
        assert (told.value, type(told.value)) == (3, kind)
        assert Figure(value).number == 3.0
    assert verdict_of(Figure(np.float64(3.0), 3.0), at_most=True) is Verdict.EXCEEDED
    assert np.isnan(Figure(None).number)


def test_what_is_drawn_is_made_when_somebody_looks_and_nothing_is_where_nobody_draws():
    label, made = Label(position=(0, 0, 0), text="here"), []
    shown = Shown(draw=lambda: made.append(1) or (label,))
    told = result_of(Figure(0.5, 1.0), Verdict.WITHIN, shown, Result(name="x"))
    assert not made
    assert tuple(told.markers) == (label,)
    assert result_of(Figure(0.5, 1.0), Verdict.WITHIN, Shown(), Result(name="x")).markers == ()


@pytest.mark.parametrize("at_most", [True, False])
def test_nothing_is_within_a_limit_without_end(at_most):
    endless = INF if at_most else -INF
    assert verdict_of(Figure(1.0, endless), at_most=at_most) is Verdict.UNDECIDED
    assert (
        answers_of(Figure(np.ones(2), endless), 2, at_most=at_most).verdict.tolist()
        == [CODES[Verdict.UNDECIDED]] * 2
    )


def test_a_part_without_a_figure_is_undecided_whatever_its_ends():
    nan, limit, ends = np.array([NAN]), np.array([1.0]), (np.array([0.0]), np.array([0.5]))
    assert verdict_of(Figure(None, parts=Parts("a", nan, limit, ends)), at_most=True) is Verdict.UNDECIDED


@pytest.mark.parametrize("at_most", [True, False])
@pytest.mark.parametrize("open_", [False, True])
def test_the_worst_of_parts_is_the_whole_of_one_instant_and_of_many(at_most, open_):
    """Parts on both sides of their limits, but for rounding, with ends that are no number and infinite."""
    assert [CODES[v] for v in Verdict] == [verdicts.WITHIN, verdicts.EXCEEDED, verdicts.UNDECIDED]
    rng = np.random.default_rng(3)
    limit = rng.choice([0.0, 1.0, 5e3, -2.0, INF, NAN], (400, 3), p=[0.3, 0.3, 0.2, 0.1, 0.05, 0.05])
    side = 1.0 if at_most else -1.0
    limit[:4] = side * INF
    at = np.where(np.isfinite(limit), limit, 0.0)
    off = rng.choice([-1.0, -1.01 * ROUNDING, -ROUNDING, -0.99 * ROUNDING, 0.0, 1e-10, 1.0], (400, 3))
    value = at + side * off * np.maximum(1.0, np.abs(at))
    low, high = value - rng.choice([0.0, 1.0, 3.0], (400, 3)), value + rng.choice([0.0, 1.0, NAN], (400, 3))
    many = answers_of(
        Figure(None, parts=Parts("abc", value, limit, (low, high), open_)), 400, at_most=at_most
    )
    for k in range(400):
        parts = Parts("abc", value[k], limit[k], (low[k], high[k]), open_)
        verdict = verdict_of(Figure(None, parts=parts), at_most=at_most)
        alone = []
        for least, most, last in zip(low[k].tolist(), high[k].tolist(), limit[k].tolist(), strict=True):
            told = judge_interval((least, most), last, at_most=at_most)
            # Nothing could exceed a limit without end.
            unknown = np.isnan(last) or ((open_ or np.isinf(last)) and told is Verdict.WITHIN)
            alone.append(Verdict.UNDECIDED if unknown else told)
        assert list(parts.verdicts) == alone
        assert verdict is worst(alone)
        room = side * (limit[k] - value[k])
        # The first of those that are as bad and keep their limits by the least; NaN is less than nothing.
        as_bad = [i for i, told in enumerate(alone) if told is verdict]
        lost = np.isnan(room[as_bad[0]])
        assert parts.governs == as_bad[0 if lost else np.nanargmin(room[as_bad])]
        assert many.verdict[k] == CODES[verdict]
        assert np.array_equal(
            [end[k] for end in many.interval], [low[k][parts.governs], high[k][parts.governs]], True
        )
        if np.isfinite(value[k][parts.governs]):
            assert many.value[k] == value[k][parts.governs]


@pytest.mark.parametrize("at_most", [True, False])
def test_what_is_said_of_some_parts_counts_of_one_instant_and_of_many(at_most):
    """More than is known, exceeded whatever its value, judged by nobody; without a limit it is the worst."""
    rng = np.random.default_rng(4)
    side = 1.0 if at_most else -1.0
    value, limit = np.zeros((300, 4)), side * rng.choice([-2.0, -1.0, 1.0, 2.0, NAN], (300, 4))
    unsure, exceeded, informs = rng.random((3, 300, 4)) < 0.25
    said = {"unsure": unsure, "exceeded": exceeded, "informs": informs}
    many = answers_of(Figure(None, parts=Parts("abcd", value, limit, **said)), 300, at_most=at_most)
    for k in range(300):
        each = {key: flags[k] for key, flags in said.items()}
        parts = Parts("abcd", value[k], limit[k], **each)
        verdict = verdict_of(Figure(None, parts=parts), at_most=at_most)
        alone = []
        for i in range(4):
            told = Verdict.UNDECIDED if np.isnan(limit[k, i]) else judge(0.0, limit[k, i], at_most=at_most)
            told = Verdict.UNDECIDED if unsure[k, i] and told is Verdict.WITHIN else told
            told = Verdict.EXCEEDED if exceeded[k, i] else told
            alone.append(None if informs[k, i] else told)
        assert list(parts.verdicts) == alone
        assert verdict is worst(alone)
        room = np.where(np.isnan(limit[k]), -INF, side * limit[k])
        as_bad = [i for i, told in enumerate(alone) if told is verdict]
        assert parts.governs == min(as_bad, key=lambda i: room[i])
        assert many.verdict[k] == CODES[verdict]
        np.testing.assert_array_equal(many.limit[k], limit[k, parts.governs])


def test_what_lies_beneath_parts_and_rows_are_shown():
    value = np.array([0.5, 3.0])
    ends = np.array([0.4, NAN]), np.array([0.6, NAN])
    parts = Parts(["a", "b"], value, np.array([1.0, NAN]), ends, informs=np.array([False, True]))
    figure, beneath, row = Figure(None, parts=parts), (Result(name="c", value=1.0),), Row(name="d", group="e")
    verdict = verdict_of(figure, at_most=True)
    told = result_of(figure, verdict, Shown(beneath=((), beneath), rows=(row,)), Result(name="x", unit="m"))
    assert [part.parts for part in told.parts] == [(), beneath]
    assert [part.interval for part in told.parts] == [(0.4, 0.6), None]
    assert [part.verdict for part in told.parts] == [Verdict.WITHIN, None]
    assert told.rows == (row,)


def test_parts_are_told_each_with_its_place_and_the_worst_is_the_whole():
    value, limit = np.array([0.5, 3.0]), np.array([1.0, NAN])
    for interval in (None, (value - 0.1, value + 0.1)):
        parts = Parts(["a", "b"], value, limit, interval)
        figure = Figure(None, parts=parts)
        verdict = verdict_of(figure, at_most=True)
        told = result_of(figure, verdict, Shown(where=("here", "there")), Result(name="x", unit="m"))
        ends = [None, None] if interval is None else list(zip(*map(np.ndarray.tolist, interval), strict=True))
        assert [part.interval for part in told.parts] == ends
        assert [(part.name, part.value, part.limit, part.unit, part.reason) for part in told.parts] == [
            ("a", 0.5, 1.0, "m", "here"), ("b", 3.0, None, "m", "there"),
        ]  # fmt: skip
        assert [part.verdict for part in told.parts] == [Verdict.WITHIN, Verdict.UNDECIDED]
        assert (told.value, told.limit, told.interval) == (3.0, None, ends[1])
        quiet = result_of(figure, verdict, Shown(), Result(name="x", unit="m"))
        assert [part.reason for part in quiet.parts] == ["", ""]
        both = Parts(
            ["a", "b"],
            np.tile(value, (2, 1)),
            np.tile(limit, (2, 1)),
            interval and tuple(np.tile(end, (2, 1)) for end in interval),
        )
        many = answers_of(Figure(None, parts=both), 2, at_most=True)
        assert (many.interval is None) is (interval is None)


def test_a_whole_with_a_figure_of_its_own_is_no_better_than_its_parts():
    for own, part, told in ((0.5, 0.5, "within"), (0.5, 2.0, "exceeded"), (2.0, 0.5, "exceeded")):
        parts = Parts(["a"], np.array([part]), np.array([1.0]), whole=False)
        assert verdict_of(Figure(own, 1.0, parts=parts), at_most=True) == told
        assert verdict_of(Figure(own, 1.0, open=True, parts=parts), at_most=True) == told.replace(
            "within", "undecided"
        )


@pytest.mark.parametrize("at_most", [True, False])
def test_of_many_a_limit_is_kept_by_what_keeps_it_of_one(at_most):
    limits = np.array([0.0, 0.5, -0.5, 1.05, 5e3, -2e3, INF, -INF])
    for off in (0.99, 1.0, 1.01, -0.99, -1.01, 0.5, 1e6):
        at = np.where(np.isinf(limits), 0.0, limits)
        values = at - (1 if at_most else -1) * off * ROUNDING * np.maximum(1.0, np.abs(at))
        expected = [
            keeps(float(v), float(limit), at_most=at_most) for v, limit in zip(values, limits, strict=True)
        ]
        assert keep_many(values, limits, at_most=at_most).tolist() == expected
        if at_most:
            assert keep_many(values, limits).tolist() == expected


@pytest.mark.parametrize("at_most", [True, False])
@pytest.mark.parametrize("limit", [-2e3, -0.5, 0.5, 2e3])
def test_many_within_by_less_than_rounding_contradict_themselves(limit, at_most):
    for share, wrong in ((0.5, True), (2.0, False)):
        off = share * ROUNDING * max(1.0, abs(limit))
        value = np.array([limit - off if at_most else limit + off])
        found = Answers(value, np.array([limit]), np.array([0], np.uint8), None, None)
        assert (found.contradictions(at_most=at_most) is not None) is wrong


class Any(Criterion, frozen=True, kw_only=True):
    """Says whatever it is told to say."""


class AtLeast(Any, frozen=True, kw_only=True):
    at_most: ClassVar[bool] = False


@pytest.mark.parametrize("at_most", [True, False])
@pytest.mark.parametrize("n", [1, 2, 300])
def test_many_instants_contradict_themselves_where_one_does(n, at_most):
    criterion, rng = (Any if at_most else AtLeast)(name="x"), np.random.default_rng(n)
    codes = [0, 1, 2, NO_VERDICT]
    met = set()
    for turn in range(1 if n > 2 else 150):
        value, limit = rng.choice([0.0, 1.0, 2.0, NAN], n), rng.choice([0.5, 1.0, 1.5, NAN, INF, -INF], n)
        ends = value - rng.choice([0.0, 0.7], n), value + rng.choice([0.0, 0.7], n)
        interval, nothing = (ends if turn % 2 else None), (rng.random(n) < 0.3 if turn % 3 else None)
        verdict = rng.choice(codes, n).astype(np.uint8)
        found = Answers(value, limit, verdict, interval, nothing).contradictions(at_most=at_most)
        found = [""] * n if found is None else found
        for k in range(n):
            result = Result(
                name="x",
                value=None if np.isnan(value[k]) else float(value[k]),
                limit=None if np.isnan(limit[k]) else float(limit[k]),
                at_most=at_most,
                verdict={CODES[v]: v for v in Verdict}.get(int(verdict[k])),
                interval=None
                if interval is None or np.isnan(value[k])
                else (float(ends[0][k]), float(ends[1][k])),
                nothing=nothing is not None and bool(nothing[k]),
                reason="nobody is near",
            )
            why = contradiction(result, criterion) or unsaid(result, criterion)
            assert bool(found[k]) is bool(why), (result, why)
            met.add(found[k])
    assert len(met) > 4
