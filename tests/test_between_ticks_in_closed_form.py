"""Between two ticks, in closed form: what is said is true of all the time since the last one, and no more."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice, pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec import structs

from made_cell import TWO_R, made, two_r
from made_ticks import DOOR, PLC, SOURCE, rows
from seerob.core.errors import Undecided
from seerob.core.snapshot import Basis, Result, Verdict
from seerob.core.verdict import judge_interval
from seerob.criteria.between_ticks import FEW, MOST, least_margin, watched
from seerob.criteria.criterion import Criterion, Follows, Moment
from seerob.criteria.question import bound_to
from seerob.session.run import Judge, engine_of, pump, ticks
from seerob.twin.attachments import Attachments
from seerob.twin.spans import (
    ROUNDING,
    AllFalls,
    Fall,
    Path,
    Points,
    Span,
    Turning,
    approaching,
    coupling_of,
    speeding,
)


def test_the_falls_of_all_in_one_call_are_those_of_each_by_itself():
    rng = np.random.default_rng(5)
    rows = [tuple(rng.choice(9, n, replace=False).tolist()) for n in (1, 3, 0, 9, 2, 4)]
    every = [
        approaching(rows[0], rows[1]),
        speeding(rows[3]),
        approaching(rows[2], rows[5]),
        speeding(rows[4]),
    ]
    for _ in range(20):
        bounds, joints, mj = rng.uniform(0, 3, (3, 9)), np.zeros((4, 2)), SimpleNamespace(nv=2)
        span = Span(0.2, 0.2 + rng.random(), bounds, joints, None, mj)
        found = AllFalls([every[0], None, *every[1:]]).of(span)
        assert found == {each: each(span, 0.0) for each in every}
        for each, (first, second) in ((every[0], (rows[0], rows[1])), (every[2], (rows[2], rows[5]))):
            way = [span.fast[list(r)].max(initial=0.0) * span.T + ROUNDING for r in (first, second)]
            assert found[each] == Fall(sum(way))
        fast = span.quick[list(rows[3])].max() * span.T + ROUNDING, span.bend[list(rows[3])].max() + ROUNDING
        assert found[every[1]] == Fall(*fast)
    span.fast[rows[0][0]] = np.nan
    assert np.isnan(AllFalls(every).of(span)[every[0]].fall)


def test_how_jacobians_change_is_told_in_that_call_too(tmp_path):
    two = TWO_R + TWO_R.replace('"arm"', '"other"').replace(
        "[[robots]]", "[[robots]]\nbase = { position = [3, 0, 0] }"
    )
    model = made(tmp_path, two, {"arm.urdf": two_r()}).model
    points, rng = Points(model), np.random.default_rng(3)
    ends = [(m, m.mj_bodies[-1]) for m in model.mechanisms.values()]
    every = [
        Turning(points, points.add(body, np.array([far, 0.0, 0.2])), coupling_of(model, mechanism))
        for mechanism, body in ends
        for far in (0.1, 1.0)
    ]
    path = Path(np.array([0.0, 0.004, 0.01]), rng.random((3, model.mj.nq)), rng.random((3, model.mj.nv)))
    span = points.span(path, 0.0, 0.01, Attachments(model).ids, model.mj)
    found = AllFalls([*every[:3], speeding([0]), None, every[3]]).of(span)
    for each in every:
        assert found[each].fall == pytest.approx(each(span, 0.0).fall, rel=1e-12)
        assert found[each].fall > 1e-3
        assert found[each].bend == np.inf
    assert len({found[each].fall for each in every}) == 4


@pytest.mark.parametrize("kind", [float, lambda x: np.array([x, 9.0]), lambda x: np.array([9.0, x])])
@pytest.mark.parametrize("other", [float, np.array])
def test_a_margin_is_nowhere_less_than_its_ends_less_half_of_what_it_loses_or_what_it_bends(kind, other):
    """Of the worst of all parts; the larger tolerance of both ends is taken off."""

    def least(one, also, fall, bend):
        to = [None if end is None else (kind(end[0]), other(end[1])) for end in (one, also)]
        return least_margin(
            to[0], to[1], Fall(kind(fall) if kind is float else fall, kind(bend) if kind is float else bend)
        )

    assert least((5.0, 0.0), (3.0, 0.0), 4.0, np.inf) == pytest.approx(2.0)  # down by 3, and up by 1
    assert least((3.0, 0.0), (5.0, 0.0), 4.0, 2.5) == pytest.approx(2.0)
    assert least((5.0, 0.0), (3.0, 0.0), 4.0, 0.5) == pytest.approx(2.5)
    assert least((3.0, 0.0), (5.0, 0.0), 4.0, 0.5) == pytest.approx(2.5)
    assert least((5.0, 0.2), (3.0, 0.7), 4.0, 0.5) == pytest.approx(1.8)
    assert least((5.0, 0.7), (3.0, 0.2), 4.0, 0.5) == pytest.approx(1.8)
    assert least((3.0, 0.2), None, 1.0, np.inf) == pytest.approx(1.8)
    assert least((3.0, 0.2), None, 1.0, 0.0) == pytest.approx(1.8)
    assert least_margin((5.0, 0.0), (3.0, 0.0), Fall(np.array([4.0, 1.0]))) == 2.0
    assert least_margin((5.0, 0.0), (3.0, 0.0), Fall(4.0, np.array([np.inf, 0.5]))) == 2.0


class Turned(Criterion, frozen=True, kw_only=True):
    """How far joints of an arm are turned: of a motion in cubics that is known at every instant."""

    limit: float
    spread: float = 0.0
    """How far it may be off [rad]."""
    each: bool = False
    """Whether of both joints, each with its own margin; else of the first."""
    bends: bool = True
    """Whether its bound says how far it gets from a straight line."""
    bounds_itself: bool = False
    """Whether it is bounded by `lowest`."""
    idle_below: float = -np.inf
    """Below it there is nothing to judge [rad]."""
    follows_other: bool = False
    """Whether its limit falls by how far the second joint is turned, of the second part by the opposite."""
    keeps: bool = False
    """Whether by the most since the run began."""
    unknown: tuple[float, float] = (np.inf, np.inf)
    """Of ways that begin from one instant to another [s], nobody knows how its limit falls, or its margin."""
    hidden: tuple[float, float] = (np.inf, np.inf)
    """From one instant to another [s], nobody sees the arm."""
    once: bool = False
    """Whether it says what it can lose on the whole way, so that no instant tells more."""

    def bounded_once(self, model):
        return self.once

    def remembers(self, model):
        return self.keeps

    def follows(self, model, points):
        if not self.follows_other:
            return None
        robot = model.robot("arm")
        count = 1 + self.each

        def now(state):
            if self.hidden[0] < state.t < self.hidden[1]:
                raise Undecided("nobody sees the arm")
            return Moment(state.q(robot)[1] * np.array([1.0, -1.0])[:count])

        def most(span, moment):
            found = moment.figure + span.qd[robot.v_address[1]] * span.T
            found[-1] += np.inf if self.unknown[0] <= span.begin < self.unknown[1] else 0.0
            return found

        return Follows(now, most, 1e-4, self.keeps, lambda: self._bound(model, keeps=False))

    def subjects(self):
        return ("arm",)

    def basis(self, model):
        return Basis(formula="q", source="made", inputs=(), not_modelled=())

    def bind(self, model):
        return self._bound(model, keeps=self.keeps)

    def _bound(self, model, *, keeps):
        robot, known = model.robot("arm"), np.full(1 + self.each, -np.inf)

        def evaluate(state):
            q = state.q(robot) if self.each else state.q(robot)[:1]
            if self.hidden[0] < state.t < self.hidden[1]:
                raise Undecided("nobody sees the arm")
            if self.follows_other:
                figure = state.q(robot)[1] * np.array([1.0, -1.0])[: len(q)]
                if keeps:
                    known[:] = figure = np.maximum(known, figure)
                q = q + figure
            value = float(q.max())
            if value < self.idle_below:
                return Result(name=self.name, nothing=True, reason="nothing there")
            ends = value - self.spread, value + self.spread
            return Result(
                name=self.name,
                value=value,
                unit="rad",
                limit=self.limit,
                interval=ends,
                verdict=judge_interval(ends, self.limit),
                parts=tuple(Result(name=str(k), value=float(x), unit="rad") for k, x in enumerate(q)),
            )

        return evaluate

    def margin(self, result):
        far = self.limit - np.array([part.value for part in result.parts])
        return (far, np.full(len(far), self.spread)) if self.each else (float(far[0]), self.spread)

    def falls(self, model, points):
        if self.bounds_itself:
            return None
        rows = np.asarray(model.robot("arm").v_address)

        def falls(span, least):
            fall, bend = span.qd[rows] * span.T + ROUNDING, span.qdd[rows] * span.T**2 / 8 + ROUNDING
            if not self.bends:
                bend = np.full(2, np.inf)
            return Fall(fall, bend) if self.each else Fall(float(fall[0]), float(bend[0]))

        return falls

    def lowest(self, model, points):
        if not self.bounds_itself:
            return None
        robot = model.robot("arm")

        def lowest(state, span):
            rows = np.asarray(robot.v_address)[: 1 + self.each]
            if self.unknown[0] <= span.begin < self.unknown[1]:
                raise Undecided("nobody knows")
            q = state.q(robot)[: 1 + self.each]
            return self.limit - self.spread - float((q + span.qd[rows] * span.T).max())

        return lowest


def leaping(t):
    """A joint that turns to and fro within each tick, and one behind it."""
    t = np.asarray(t)
    q = np.stack([0.2 * np.sin(17 * t) + 0.004 * np.sin(600 * t), 0.15 * np.cos(11 * t)], axis=-1)
    qd = np.stack([3.4 * np.cos(17 * t) + 2.4 * np.cos(600 * t), -1.65 * np.sin(11 * t)], axis=-1)
    return q, qd


SWITCHED = [
    *[(0.0, 1), (0.0137, 0), (0.0168, 1), (0.0352, 0), (0.0437, 1), (0.0537, 0), (0.0682, 1), (0.0868, 0)],
    *[(0.1035, 1), (0.1237, 0), (0.1268, 1), (0.1335, 0), (0.1461, 1), (0.15, 0), (0.16, 1), (0.3, 1)],
]
"""When it begins and ceases to apply: within ticks, twice in one, and just at them."""


def leaps(folder, motion=leaping, switched=SWITCHED, more=""):
    """The arm, its ticks, and where its joints are in between, from tick to tick."""
    t = np.arange(0, 0.2001, 0.01)
    files = {
        "arm.urdf": two_r(),
        "motion.csv": rows(lambda at: tuple(map(tuple, motion(at))), t.tolist()),
        "v.toml": DOOR,
        "s.csv": "t,x\n" + "".join(f"{at},{x}\n" for at, x in switched),
    }
    engine = 'variables = "v.toml"\nengine = { gravity = [0, 0, 0], physics = false }\n'
    station = made(folder, engine + TWO_R + more + SOURCE + PLC, files)
    q, qd = map(np.array, zip(*map(motion, t), strict=True))
    s = np.linspace(0, 1, 401)[:, None]
    cubics = [
        (2 * s**3 - 3 * s**2 + 1) * q[k]
        + (s**3 - 2 * s**2 + s) * 0.01 * qd[k]
        + (3 * s**2 - 2 * s**3) * q[k + 1]
        + (s**3 - s**2) * 0.01 * qd[k + 1]
        for k in range(len(t) - 1)
    ]
    return station, t, s[:, 0], cubics


def judged_by(station, criteria, **changed):
    """What each says at each tick, and how often it was asked; last how often of all instants between."""
    model, points, asked = station.model, Points(station.model), [0] * len(criteria)
    bound = []
    for k, criterion in enumerate(criteria):
        one = bound_to(model, criterion, "safety")

        def counted(state, k=k, evaluate=one.evaluate):
            asked[k] += 1
            return evaluate(state)

        watch = replace(watched(criterion, model, points), **changed)
        bound.append(replace(one, evaluate=counted, watch=watch))
    judge, feed = Judge(bound), pump(station.sources, station.workstation.engine.tick)
    found = [out.results for out, _ in islice(ticks(engine_of(model), judge, feed), 21)]
    return [[results[k] for results in found] for k in range(len(criteria))], [*asked, judge.looks]


HOWS = {
    "plain": {},
    "each": {"each": True},
    "spread": {"spread": 0.01},
    "each with a spread": {"each": True, "spread": 0.01},
    "without a bend": {"bends": False},
    "each without a bend": {"bends": False, "each": True},
    "by a period": {"every": 0.05},
    "by a period with a wide spread": {"every": 0.05, "spread": 0.05},
    "each by a period": {"every": 0.05, "each": True, "spread": 0.003},
    "bounded by itself": {"bounds_itself": True},
    "both bounded by itself": {"bounds_itself": True, "each": True, "spread": 0.002},
    "nothing there at times": {"bounds_itself": True, "idle_below": -0.05},
    "bounded by itself in a period": {"bounds_itself": True, "every": 0.04},
    "while it applies": {"active": "door"},
    "each while it applies": {"active": "door", "each": True, "spread": 0.002},
    "while it applies, by a period": {"active": "door", "every": 0.05},
    "while it applies, bounded by itself": {"active": "door", "bounds_itself": True},
    "with a limit that follows": {"follows_other": True},
    "each with a limit that follows": {"follows_other": True, "each": True, "spread": 0.003},
    "with a limit that keeps": {"follows_other": True, "keeps": True},
    "each with a limit that keeps": {"follows_other": True, "keeps": True, "each": True},
    "with a limit that keeps, by a period": {"follows_other": True, "keeps": True, "every": 0.05},
    "with a limit that follows, by a period": {"follows_other": True, "every": 0.05},
    "with a limit that follows while it applies": {"follows_other": True, "active": "door"},
}
LIMITS = [0.0, 0.1, 0.15, 0.19, 0.1985, 0.1995, 0.2, 0.25, 0.29, 0.2905]


@pytest.mark.parametrize("how", HOWS)
def test_at_each_tick_what_is_said_is_true_of_all_the_time_since_the_last(tmp_path, how):
    """Against the cubics themselves, but where one end exceeds already, which is said there."""
    station, t, s, cubics = leaps(tmp_path)
    options = HOWS[how]
    limits = [*LIMITS, *np.arange(0.02, 0.2, 0.01).tolist()] if "active" in options else LIMITS
    criteria = [
        Turned(name=f"at most {limit}", limit=limit + options.get("spread", 0.0), **options)
        for limit in limits
    ]
    every, _ = judged_by(station, criteria)
    switches, seen = np.array([at for at, _ in SWITCHED]), set()
    for criterion, results in zip(criteria, every, strict=True):
        known = np.full(2, -np.inf)
        for k, q in enumerate(cubics, 1):
            at = t[k - 1] + 0.01 * s
            applies = np.ones(len(s), bool)
            if criterion.active:
                applies = np.array(SWITCHED)[np.searchsorted(switches, at, side="right") - 1, 1] == 1
            result, off = results[k], criterion.spread
            if criterion.follows_other:
                figure = q[:, 1:] * [1.0, -1.0]
                if criterion.keeps:
                    figure = known = np.maximum(np.maximum.accumulate(figure), known)
                    known = known[-1]
                q = q + figure
            most = q.max(axis=1) if criterion.each else q[:, 0]
            said = Verdict.EXCEEDED in (results[k - 1].verdict, result.verdict)
            if said if criterion.keeps else max(most[0], most[-1]) - off > criterion.limit:
                continue
            top = most[applies].max(initial=-np.inf)
            verdict, where = result.verdict, (criterion.name, k, result)
            green = verdict is Verdict.WITHIN or result.muted or result.nothing
            if top + off > criterion.limit + 2e-5:
                assert not green, where
            if verdict is Verdict.EXCEEDED and not criterion.every:  # with a period what was is said again
                assert top - off > criterion.limit - 2e-5, where
            # With room enough it is decided, where the bound gets sharper in parts of the way.
            if not (criterion.bounds_itself or criterion.every or criterion.keeps):
                room = 0.02 if criterion.follows_other else 3e-4 if criterion.bends else 0.002
                if top + off < criterion.limit - room:
                    assert green, where
                if top - off > criterion.limit + room:
                    assert verdict is Verdict.EXCEEDED, where
            seen.add(verdict)
    assert Verdict.WITHIN in seen
    assert {Verdict.EXCEEDED, Verdict.UNDECIDED} & seen or HOWS[how].get("keeps")


@pytest.mark.parametrize("every", [{}, {"every": 0.05}])
@pytest.mark.parametrize(
    "how",
    [
        {"follows_other": True},
        {"follows_other": True, "each": True},
        {"follows_other": True, "keeps": True},
        {"follows_other": True, "keeps": True, "each": True, "spread": 0.01},
        {"bounds_itself": True},
    ],
)
def test_what_nobody_knows_of_the_way_is_undecided_there_and_only_there(tmp_path, how, every):
    """However far the limit is: that of one of two parts, or of a bound of its own, for 30 ms."""
    station = leaps(tmp_path)[0]
    one = Turned(name="one", limit=0.9, unknown=(0.0599999, 0.0899), **how, **every)
    ((*results,),), _ = judged_by(station, [one])
    undecided = [k for k, result in enumerate(results) if result.verdict is Verdict.UNDECIDED]
    assert undecided == [7, 8, 9]
    reasons = [results[k].reason for k in undecided]
    assert all(r.startswith("not known to be within") and "between two ticks" in r for r in reasons)


@pytest.mark.parametrize("how", HOWS)
def test_where_there_is_room_nothing_is_asked_between_two_ticks_and_nothing_before_its_period(tmp_path, how):
    options = {key: value for key, value in HOWS[how].items() if key != "active"}
    _, (asked, looks) = judged_by(leaps(tmp_path)[0], [Turned(name="one", limit=0.95, **options)])
    if "follows_other" in options:  # by how much its limit falls is bounded more closely in parts of the way
        assert 0 < looks <= 20 * FEW
    else:
        assert looks == 0
    assert asked == (round(0.2 / options["every"]) + 1 if "every" in options else 21)


def rising(t):
    """The first joint turns evenly."""
    return (t, 0.5), (1.0, 0.0)


def falling(t):
    """And back."""
    return (0.2 - t, 0.5), (-1.0, 0.0)


def bowing(t):
    """The first joint is at 0 at each tick, and up to 20 mrad up or down in between."""
    return (0.0, 0.5), (8.0 * (-1) ** round(t / 0.01), 0.0)


@pytest.mark.parametrize(
    ("motion", "how", "switched", "verdict"),
    [
        # No instant tells more: whatever it may come to while it does not apply is not asked.
        (rising, {"limit": 0.1145, "once": True}, [(0, 1), (0.101, 0), (0.109, 1), (0.3, 1)], Verdict.WITHIN),
        (
            bowing,
            {"limit": 0.015, "once": True},
            [(0, 0), (0.0955, 1), (0.101, 0), (0.109, 1), (0.1105, 0), (0.3, 0)],
            Verdict.WITHIN,
        ),
        # Where it ceases to apply it is asked as if it did: both ends together leave it room.
        (falling, {"limit": 0.101, "once": True}, [(0, 0), (0.0995, 1), (0.106, 0), (0.3, 0)], None),
        # Nobody knows how its limit falls on the way, and just before it ceases to apply it exceeds.
        (
            rising,
            {"limit": 0.603, "follows_other": True, "unknown": (0.0999, 0.1099)},
            [(0, 1), (0.106, 0), (0.3, 0)],
            Verdict.EXCEEDED,
        ),
    ],
)
def test_what_applies_in_parts_of_a_tick_is_judged_in_these_alone(tmp_path, motion, how, switched, verdict):
    station, *_ = leaps(tmp_path, motion, switched)
    ((*results,),), _ = judged_by(station, [Turned(name="one", active="door", **how)])
    assert results[11].verdict is verdict
    assert {result.verdict for result in results[:11] if not result.muted} == {Verdict.WITHIN}


def test_where_somebody_was_hidden_at_a_tick_the_next_one_is_known_all_the_same(tmp_path):
    """What nobody knows of the way to it is said at the tick before."""
    for follows in (False, True):
        one = Turned(name="one", limit=0.9, hidden=(0.055, 0.065), follows_other=follows)
        ((*results,),), _ = judged_by(leaps(tmp_path / str(follows))[0], [one])
        undecided = [k for k, result in enumerate(results) if result.verdict is Verdict.UNDECIDED]
        assert undecided == [6]


def test_where_nothing_is_to_judge_after_nobody_saw_the_way_between_is_open(tmp_path):
    """At the next tick but one it would be too far, and nobody looks in between."""
    station, *_ = leaps(tmp_path, rising)
    one = Turned(
        name="one", limit=0.0755, idle_below=0.075, hidden=(0.055, 0.065), bounds_itself=True, once=True
    )
    ((*results,),), _ = judged_by(station, [one])
    assert all(result.nothing for result in results[:6])
    assert {result.verdict for result in results[6:8]} == {Verdict.UNDECIDED}
    assert results[7].reason.startswith("not known to be within")


def test_where_nothing_is_to_judge_a_bound_tells_of_what_nobody_sees(tmp_path):
    """Of the way to where it is seen from either end, though nobody sees it in the middle."""
    station, *_ = leaps(tmp_path, rising)
    hidden = {"idle_below": 0.062, "hidden": (0.0512, 0.0588), "bounds_itself": True}
    ((*results,),), (_, looks) = judged_by(station, [Turned(name="one", limit=0.0635, **hidden)])
    assert all(result.nothing for result in results[:7])
    assert looks > 0


def test_what_nothing_bounds_is_muted_at_each_tick_at_which_it_does_not_apply_whatever_its_period(tmp_path):
    station, t, *_ = leaps(tmp_path)
    one = bound_to(station.model, Turned(name="one", limit=0.95, active="door", every=10.0), "safety")
    feed = pump(station.sources, 0.01)
    judge = Judge([replace(one, watch=None)])
    results = [out.results[0] for out, _ in islice(ticks(engine_of(station.model), judge, feed), 21)]
    on = np.array(SWITCHED)[np.searchsorted([at for at, _ in SWITCHED], t + 1e-9, side="right") - 1, 1] == 1
    # From 146 to 150 ms it applied, and at neither tick.
    passed = results.pop(15)
    assert (passed.verdict, passed.muted) == (Verdict.UNDECIDED, False)
    assert "from 0.1461 s, between two ticks only" in passed.reason
    on = np.delete(on, 15)
    assert [result.muted for result in results] == (~on).tolist()
    assert {result.verdict for result in results if not result.muted} == {Verdict.WITHIN}
    # And it is asked when it begins to apply, not again while it goes on.
    since = [result.t for result in results if not result.muted]
    assert len({*since}) == 1 + np.count_nonzero(on[1:] & ~on[:-1])


def test_what_applied_at_the_last_tick_is_muted_once_it_does_not_however_often_that_was_switched(tmp_path):
    station, *_ = leaps(tmp_path, switched=[(0, 1), (0.012, 0), (0.014, 1), (0.016, 0), (0.3, 0)])
    one = bound_to(station.model, Turned(name="one", limit=0.95, active="door"), "safety")
    judge = Judge([replace(one, watch=None)])
    results = [
        out.results[0]
        for out, _ in islice(ticks(engine_of(station.model), judge, pump(station.sources, 0.01)), 4)
    ]
    assert [result.muted for result in results] == [False, False, True, True]


OTHER = TWO_R.replace('"arm"', '"other"\nq = [0, 0]\nbase = { position = [9, 0, 0] }', 1)


@pytest.mark.parametrize("how", [{}, {"bounds_itself": True}, {"follows_other": True}])
def test_a_jump_leaves_open_the_way_of_who_jumped_and_of_nobody_else(tmp_path, how):
    station, *_ = leaps(tmp_path, more=OTHER)
    limits = [0.9, 0.15, 0.1985]

    def told(who):
        model, points = station.model, Points(station.model)
        some = [Turned(name=f"{limit}", limit=limit, **how) for limit in limits]
        bound = [replace(bound_to(model, one, "safety"), watch=watched(one, model, points)) for one in some]
        judge = Judge(bound)

        def judged(state):
            if who and abs(state.t - 0.07) < 1e-6:
                state.path = replace(state.path, broken=(who,))
            return judge(state)

        feed = pump(station.sources, 0.01)
        every = [out.results for out, _ in islice(ticks(engine_of(model), judged, feed), 21)]
        return [[(r.verdict, r.reason) for r in results] for results in every]

    usual, moved, other = map(told, ("", "arm", "other"))
    assert other == usual
    assert [k for k in range(21) if moved[k] != usual[k]] == [7]
    why = "arm jumped: its way between two ticks is not known"
    assert moved[7][0] == (Verdict.UNDECIDED, why)
    assert usual[7][0][0] is Verdict.WITHIN


def bump(t):
    """The second joint turns to 0.3 rad and back, fastest 13 and 7 ticks before the end."""
    q = 0.3 * np.exp(-(((t - 0.1) / 0.03) ** 2))
    return (0.0, q), (0.0, -2 * (t - 0.1) / 0.03**2 * q)


@pytest.mark.parametrize(
    ("limit", "blind", "kept"),
    [(0.32, (np.inf, np.inf), True), (0.2, (0.0349, 0.1651), False), (0.5, (0.0349, 0.1651), True)],
)
def test_by_how_much_a_limit_fell_while_nobody_asked_is_not_forgotten(tmp_path, limit, blind, kept):
    """What remembers knows of the instants at which it was asked; where its limit was since, others do."""

    class Blind(Turned, frozen=True, kw_only=True):
        def _bound(self, model, *, keeps):
            evaluate = super()._bound(model, keeps=keeps)

            def seen(state):
                if blind[0] < state.t < blind[1]:
                    raise Undecided("nobody asks it")
                return evaluate(state)

            return seen

    one = Blind(name="one", limit=limit, follows_other=True, keeps=True)
    ((*results,),), _ = judged_by(leaps(tmp_path, bump)[0], [one])
    assert {result.verdict for result in results[:4]} == {Verdict.WITHIN}
    assert {result.verdict for result in results[17:]} == {Verdict.WITHIN if kept else Verdict.UNDECIDED}


@pytest.mark.parametrize(
    ("speed", "keeps", "looks"), [(1, False, 0), (1, True, 0), (-1, False, 20 * 7), (-1, True, 7)]
)
def test_how_a_limit_falls_is_looked_at_until_little_is_open_and_not_where_an_end_tells(
    tmp_path, speed, keeps, looks
):
    """Bounded by where the second joint was, and how fast it is: halved to less than 0.1 mrad of 10."""
    station, *_ = leaps(tmp_path, lambda t: ((0.0, 0.5 + speed * t), (0.0, speed)))
    one = Turned(name="one", limit=3.0, follows_other=True, keeps=keeps)
    ((*results,),), (_, looked) = judged_by(station, [one])
    assert looked == looks
    assert {result.verdict for result in results} == {Verdict.WITHIN}
    # What has no bound is not halved for one, though looked at for what exceeds.
    _, (_, more) = judged_by(station, [structs.replace(one, unknown=(0.0999, 0.1099))])
    assert more == looks + MOST - (looks // 20 if looks > 20 else 0)


def test_instants_that_are_looked_at_are_counted_each_and_not_where_an_end_exceeds(tmp_path):
    station, asked, looked = leaps(tmp_path)[0], [], []
    for limit in LIMITS:
        one = Turned(name="one", limit=limit, bends=False)

        def again(one=one):
            evaluate = one.bind(station.model)
            return lambda state: asked.append(state.t) or evaluate(state)

        asked.clear()
        ((*results,),), (_, looks) = judged_by(station, [one], again=again)
        looked.append(looks)
        assert looks == len(asked)
        for t in asked:
            at = results[int(t / 0.01) : int(t / 0.01) + 2]
            assert Verdict.EXCEEDED not in [result.verdict for result in at if result.t in (None, 0.0)]
    assert max(looked) > 3


def test_a_bound_is_told_the_least_margin_of_both_ends_less_what_it_may_be_off(tmp_path):
    for each in (False, True):
        station, told = leaps(tmp_path / str(each))[0], {}
        one = Turned(name="one", limit=0.7, spread=0.02, each=each, hidden=(0.055, 0.065))
        falls = one.falls(station.model, None)

        def telling(span, least, falls=falls, told=told):
            told[span.end] = least
            return falls(span, least)

        ((first, *results),), _ = judged_by(station, [one], falls=telling)
        assert len(told) == len(results) == 20
        ways = zip((first, *results), results, told.values(), strict=False)
        for k, (before, now, least) in enumerate(ways, 1):
            both = [one.margin(result) for result in (before, now) if result.verdict is Verdict.WITHIN]
            assert len(both) == (1 if k in (6, 7) else 2)
            assert least == pytest.approx(np.min([m - off for m, off in both], axis=0))


@pytest.mark.parametrize(("how", "step"), [({}, 0.001), ({"bounds_itself": True}, 0.004)])
def test_what_nobody_sees_between_two_ticks_is_undecided_with_that_reason(tmp_path, how, step):
    """Where a bound does not clear it: the arm is hidden from 51 to 59 ms, and seen at each tick."""
    station, reasons = leaps(tmp_path)[0], set()
    limits = np.arange(0.15, 0.3, step).tolist()
    some = [Turned(name=f"{x}", limit=x, hidden=(0.0512, 0.0588), **how) for x in limits]
    same = [Turned(name=f"{x}", limit=x, **how) for x in limits]
    every, _ = judged_by(station, [*some, *same])
    for hidden, seen in zip(every[: len(some)], every[len(some) :], strict=True):
        for k, (one, other) in enumerate(zip(hidden, seen, strict=True)):
            assert k == 6 or one.verdict is other.verdict
        reasons.add(hidden[6].reason)
        assert hidden[6].verdict is seen[6].verdict or hidden[6].verdict is Verdict.UNDECIDED
    assert "between two ticks: nobody sees the arm" in reasons


def test_what_remembers_is_not_asked_between_two_ticks_unless_its_limit_follows(tmp_path):
    station = leaps(tmp_path)[0]
    for follows in (False, True):
        criteria = [Turned(name=f"{x}", limit=x, keeps=True, follows_other=follows) for x in LIMITS]
        every, _ = judged_by(station, criteria)
        reasons = [result.reason for results in every for result in results]
        assert any(reason.endswith("it remembers") for reason in reasons) is not follows


def test_what_is_picked_up_between_two_ticks_is_known_from_no_bound(tmp_path):
    """It has the speed of the hand at once; with room enough all the same, and in a period too."""
    for how in ({}, {"bounds_itself": True}, {"every": 0.05}, {"every": 0.05, "bounds_itself": True}):
        station = leaps(tmp_path / str(len(str(how))))[0]
        one = Turned(name="one", limit=0.9, **how)
        criterion = bound_to(station.model, one, "safety")
        judge = Judge([replace(criterion, watch=watched(one, station.model, Points(station.model)))])
        verdicts = []
        for out, _ in islice(ticks(engine_of(station.model), judge, pump(station.sources, 0.01)), 21):
            verdicts.append(out.results[0].verdict)
            if len(verdicts) == 7:
                ids = np.frombuffer(judge._between._ids, np.int64).copy()
                judge._between._ids = np.roll(ids, 1).tobytes()
        assert (verdicts[7] is Verdict.UNDECIDED) is ("bounds_itself" in how), how
        assert {*verdicts[:7], *verdicts[8:]} == {Verdict.WITHIN}


def test_a_file_accepts_only_what_a_bound_of_its_own_leaves_open(tmp_path):
    model, accepted = leaps(tmp_path)[0].model, "accepted: it is slow"
    points = Points(model)
    for how, text in (({"bounds_itself": True}, accepted), ({"once": True}, accepted), ({}, "")):
        watch = watched(Turned(name="one", limit=1.0, between_samples=accepted, **how), model, points)
        assert watch.accepted == text
        assert (watch.looks == 0) is ("once" in how)
        assert (watch.falls is None) is ("bounds_itself" in how)
        assert watched(Turned(name="one", limit=1.0, **how), model, points).accepted == ""


LOST = [Fall(0.0, 0.0), Fall(np.array([0.0, 1.0])), Fall(-1e-12), Fall(1.0, -1.0), Fall(np.nan)]
LOST += [Fall(np.array([1.0, -1.0])), Fall(1.0, np.array([0.0, -1.0]))]


@pytest.mark.parametrize("lost", LOST)
def test_no_margin_grows_by_a_bound_of_ones_own(tmp_path, lost):
    class Own(Turned, frozen=True, kw_only=True):
        def falls(self, model, points):
            return lambda span, margin: lost

    model = leaps(tmp_path)[0].model
    falls = watched(Own(name="one", limit=1.0), model, Points(model)).falls
    if all(np.all(each >= 0) for each in lost):
        assert falls(None, 1.0) is lost
    else:
        with pytest.raises(ValueError, match="no margin falls by less than nothing"):
            falls(None, 1.0)


@pytest.mark.parametrize("how", [{}, {"each": True, "spread": 0.01}, {"keeps": True}])
def test_a_period_hides_no_tick_at_which_nobody_knows_how_a_limit_falls(tmp_path, how):
    one = Turned(name="one", limit=0.9, hidden=(0.065, 0.075), follows_other=True, every=0.05, **how)
    ((*results,),), _ = judged_by(leaps(tmp_path)[0], [one])
    assert [k for k, result in enumerate(results) if result.verdict is Verdict.UNDECIDED][:1] == [7]


def test_what_is_bounded_is_judged_beside_what_is_not_and_in_a_run_that_begins_again(tmp_path):
    station = leaps(tmp_path)[0]
    one, model = Turned(name="one", limit=0.1995, bends=False), station.model
    bounded = replace(bound_to(model, one, "safety"), watch=watched(one, model, Points(model)))
    alone, beside = Judge([bounded]), Judge([replace(bounded, watch=None), bounded])
    runs = []
    for judge in (alone, beside, alone):
        feed = pump(station.sources, 0.01)
        runs.append([out.results[-1] for out, _ in islice(ticks(engine_of(model), judge, feed), 21)])
    told = [[(result.verdict, result.reason) for result in results] for results in runs]
    assert told[0] == told[1] == told[2]
    assert any("between two ticks" in reason for _, reason in told[0])


def test_nothing_to_judge_at_a_tick_hides_no_way_to_it_that_is_open(tmp_path):
    """The arm turns back below where there is nothing to judge; what it was on the way nobody knows."""
    station = leaps(tmp_path)[0]
    limits = np.arange(0.1, 0.3, 0.002).tolist()
    some = [Turned(name=f"{x}", limit=x, idle_below=x - 0.02, once=True) for x in limits]
    every, _ = judged_by(station, some)
    left = [now for results in every for before, now in pairwise(results) if before.verdict is Verdict.WITHIN]
    hidden = [now for now in left if now.value is None]
    assert hidden
    for now in hidden:
        assert now.nothing or (now.verdict, now.reason[:9]) == (Verdict.UNDECIDED, "not known")
    assert any(now.verdict is Verdict.UNDECIDED for now in hidden)
