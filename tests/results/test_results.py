"""A run is as good as its worst tick."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seerob.core.errors import Undecided, UnknownName
from seerob.core.snapshot import CriterionInfo, Result, Snapshot, Verdict
from seerob.recording.result_log import ResultLog, log_of, result_named
from seerob.recording.series import CODES, MAX_REASONS, Series, Times, margin, severity, worst_verdict

W, E, U = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED


def tick(k, *results, tracking=None):
    return Snapshot(seq=k, t=k * 0.01, poses=b"", results=results, tracking=tracking or {})


def result(value=1.0, verdict=W, *, name="speed", limit=2.0, at_most=True, **more):
    return Result(name=name, value=value, unit="m/s", limit=limit, at_most=at_most, verdict=verdict, **more)


verdicts = st.sampled_from([W, E, U, None])
results = st.builds(
    result,
    st.none() | st.floats(-10, 10),
    verdicts,
    limit=st.none() | st.floats(-5, 5),
    at_most=st.booleans(),
    reason=st.sampled_from(["", "a", "b"]),
)


@settings(max_examples=100, deadline=None)
@given(st.lists(results, min_size=1, max_size=60))
def test_arrays_hold_what_was_added_and_the_worst_is_the_smallest_severity(rows):
    log = log_of(tick(k, r) for k, r in enumerate(rows))
    series = log["speed"]
    nan = math.nan
    np.testing.assert_array_equal(series.t, [k * 0.01 for k in range(len(rows))])
    np.testing.assert_array_equal(series.values, [nan if r.value is None else r.value for r in rows])
    np.testing.assert_array_equal(series.limits, [nan if r.limit is None else r.limit for r in rows])
    assert series.verdicts.tolist() == [CODES[r.verdict] for r in rows]
    assert series.reasons == tuple(r.reason for r in rows)
    first = min(range(len(rows)), key=lambda k: (severity(rows[k]), k))
    worst = series.worst()
    assert (worst.seq, worst.t) == (first, first * 0.01)
    assert (worst.value, worst.reason) == (rows[first].value, rows[first].reason)
    judged = worst_verdict(r.verdict for r in rows)
    # A limit that no tick judged leaves the run undecided.
    open_ = judged is None and any(r.limit is not None for r in rows)
    assert series.verdict == worst.verdict == (U if open_ else judged)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(-10, 10), verdicts), min_size=1, max_size=400), st.integers(7, 60))
def test_thinning_loses_no_extremum_and_no_exceedance(rows, most):
    series = log_of(tick(k, result(v, verdict)) for k, (v, verdict) in enumerate(rows))["speed"]
    trace = series.thin(most)
    t, values = np.frombuffer(trace.t, "<f8"), np.frombuffer(trace.values, "<f8")
    codes = np.frombuffer(trace.verdicts, np.uint8)
    assert len(t) == len(values) == len(codes) == len(trace.limits) // 8 <= most
    assert (np.diff(t) > 0).all()
    assert set(t) <= set(series.t)
    assert values.max() == series.max()
    assert values.min() == series.min()
    assert (E in dict(series.shares())) == (1 in codes)
    assert (t[0], t[-1]) == (series.t[0], series.t[-1])


@pytest.mark.parametrize(
    ("rows", "expected"),
    [([W, E, U], E), ([W, U, None], U), ([None, W], W), ([None], U), ([], U)],
)
def test_a_run_is_as_good_as_its_worst_tick(rows, expected):
    log = ResultLog([CriterionInfo(name="speed", kind="k", group="safety", title="")])
    for k, verdict in enumerate(rows):
        log.add(tick(k, result(1.0, verdict)))
    assert log["speed"].verdict == log.verdict == expected


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_part_is_not_within_where_the_whole_was_undecided_and_did_not_speak_of_it(order):
    """Of a hand nobody heard anything in half of the run: its row was WITHIN, undecided in 0 %."""
    said = (
        result(parts=(result(name="hand"), result(name="head", parts=(result(name="left"),)))),
        result(None, U, parts=(result(name="head"),)),
    )
    series = log_of(tick(k, said[i]) for k, i in enumerate(order))["speed"]
    assert series.verdict is U
    assert (series.parts["hand"].verdict, series.parts["head"].verdict) == (U, W)
    assert series.parts["hand"].worst().verdict is U
    series = log_of(tick(k, (said[0], result(None, U))[i]) for k, i in enumerate(order))["speed"]
    assert [series.parts["head"].verdict, series.parts["head"].parts["left"].verdict] == [U, U]
    # Muted, or with nothing to judge, it had nothing to say of it; and what is exceeded stays so.
    other = (result(parts=(result(name="hand"),)), result(None, None, limit=None, muted=True))
    assert log_of(tick(k, other[i]) for k, i in enumerate(order))["speed"].parts["hand"].verdict is W
    beyond = (result(3.0, E, parts=(result(3.0, E, name="hand"),)), said[1])
    assert log_of(tick(k, beyond[i]) for k, i in enumerate(order))["speed"].parts["hand"].verdict is E


def test_a_part_is_not_within_where_nothing_bounds_the_whole_between_its_instants():
    said = result(parts=(result(name="hand"),))
    for between, verdict in (("", W), ("nothing bounds it", U), ("accepted: it stands", W)):
        info = CriterionInfo(name="speed", kind="velocity", group="safety", title="", between=between)
        log = log_of([tick(k, said) for k in range(3)], [info])
        assert log["speed"].verdict is log["speed"].parts["hand"].verdict is verdict


def test_without_a_limit_there_is_no_verdict():
    log = log_of([tick(0, result(1.0, None, limit=None))])
    assert (log.verdict, log["speed"].worst().verdict) == (None, None)


def test_what_was_announced_and_never_heard_is_undecided():
    silent = CriterionInfo(name="silent", kind="k", group="safety", title="", unit="J", limit=1.0)
    log = ResultLog([silent])
    log.add(tick(0, result()))
    assert (log.verdict, log["silent"].verdict, log["speed"].verdict) == (U, U, W)
    assert log["silent"].unit == "J"
    with pytest.raises(Undecided, match="never heard"):
        log["silent"].worst()


def test_an_exceedance_of_unknown_size_is_the_worst_and_a_lower_limit_looks_down():
    log = log_of([tick(0, result(9.0, E)), tick(1, result(None, E)), tick(2, result(99.0, E))])
    assert log["speed"].worst().seq == 1
    down = [tick(k, result(v, E, at_most=False)) for k, v in enumerate((1.5, 0.5, 1.0))]
    assert log_of(down)["speed"].worst().value == 0.5
    free = [tick(k, result(v, None, limit=None)) for k, v in enumerate((1.5, 3.5, 1.0))]
    assert log_of(free)["speed"].worst().value == 3.5


def test_the_worst_names_the_part_that_governs():
    parts = (result(1.9, W, name="hand"), result(5.0, E, name="skull"), result(3.0, E, name="face"))
    log = log_of([tick(0, result(5.0, E, parts=parts, reason="skull ↔ gripper"))])
    assert log["speed"].worst().part == "skull"
    assert log["speed"].parts["face"].worst().value == 3.0
    assert log["speed"].parts["hand"].verdict == W


@pytest.mark.parametrize(("verdict", "part"), [(E, W), (W, E), (None, None), (U, None)])
def test_a_part_with_another_verdict_or_none_governs_nothing(verdict, part):
    log = log_of([tick(0, result(5.0, verdict, parts=(result(1.0, part, name="hand"),)))])
    assert log["speed"].worst().part == ""


def test_a_margin_is_to_the_limit_or_to_nought_and_what_is_judged_comes_before_what_is_not():
    cases = {(2.0, True): 0.5, (2.0, False): -0.5, (None, True): -1.5, (None, False): 1.5}
    for (limit, at_most), expected in cases.items():
        assert margin(result(1.5, W, limit=limit, at_most=at_most)) == expected
    assert math.isnan(margin(result(None, U)))
    log = log_of([tick(0, result(1.0, W)), tick(1, result(9.0, None))])
    assert log["speed"].worst().seq == 0
    assert repr(log["speed"]) == "<Series 'speed': 2 instants, within>"
    assert "no verdict" in repr(log_of([tick(0, result(1.0, None, limit=None))])["speed"])


def test_instants_are_counted_where_no_time_passes_and_are_seen():
    """Of a criterion that nothing bounds: that nobody was near, known at an instant, hides nothing."""
    said = Series(name="v", unit="m", at_most=True, between="nothing bounds it")
    for verdict in (W, E):
        said.pass_time(result(1.0, verdict), 0.0)
    assert (said.times().within, said.times().exceeded) == (0.5, 0.5)
    said = Series(name="v", unit="m", at_most=True)
    for dt, verdict in ((0.3, W), (0.1, E)):
        said.pass_time(result(1.0, verdict), dt)
    assert (said.times().within, said.times().exceeded) == pytest.approx((0.75, 0.25))
    for dt, verdict in ((0.0, None), (0.1, U)):
        said = Series(name="v", unit="m", at_most=True, between="nothing bounds it")
        nobody = Result(name="v", nothing=True, reason="nobody is near")
        said.append(nobody, 0.0)
        said.pass_time(nobody, dt)
        assert said.verdict is verdict


def test_exceedance_comes_as_intervals_and_shares():
    log = log_of(tick(k, result(1.0, v)) for k, v in enumerate([E, E, W, U, E, W, W, E]))
    assert log["speed"].intervals() == ((0.0, 0.01), (0.04, 0.04), (0.07, 0.07))
    assert log["speed"].intervals(U) == ((0.03, 0.03),)
    assert log["speed"].shares() == {E: 0.5, U: 0.125, W: 0.375}


def test_a_mean_comes_with_its_extrema_and_nothing_is_made_up():
    log = log_of(tick(k, result(v)) for k, v in enumerate((1.0, None, 4.0)))
    assert log["speed"].spread() == (1.0, 2.5, 4.0)
    assert not hasattr(log["speed"], "mean")
    with pytest.raises(Undecided, match="no value"):
        log_of([tick(0, result(None, U))])["speed"].max()


def test_a_result_shown_again_counts_once():
    log = ResultLog()
    for k in range(10):
        log.add(tick(k, result(float(k // 5), t=(k // 5) * 0.05)))
    assert log["speed"].values.tolist() == [0.0, 1.0]
    assert log.ticks == 10


def test_add_tells_whose_worst_instant_this_is():
    log = ResultLog()
    rows = [(1.0, W), (0.5, W), (1.5, W), (None, U), (1.9, W), (2.5, E)]
    told = [bool(log.add(tick(k, result(v, verdict)))) for k, (v, verdict) in enumerate(rows)]
    assert told == [True, False, True, True, False, True]


def test_a_reason_that_changes_at_every_tick_does_not_fill_the_memory():
    log = log_of(tick(k, result(None, U, reason=f"age {k}")) for k in range(MAX_REASONS + 10))
    reasons = log["speed"].reasons
    assert len(set(reasons)) == MAX_REASONS
    assert (reasons[5], reasons[-1], log["speed"].worst().reason) == ("age 5", "…", "age 0")


def test_tracking_keeps_the_largest_error_and_shows_a_nan():
    log = ResultLog()
    for k, error in enumerate((1e-4, 3e-4, 2e-4)):
        log.add(tick(k, tracking={"ur10": error, "iiwa": math.nan if k == 1 else 0.0}))
    ur10, iiwa = log.tracking
    assert (ur10.error, ur10.t) == (3e-4, 0.01)
    assert math.isnan(iiwa.error)


def test_arrays_are_read_only_copies():
    log = ResultLog()
    first = result()
    for k in range(50):
        log.add(tick(k, first))
    before = log["speed"].values
    log.add(tick(50, first))
    assert (len(before), len(log["speed"])) == (50, 51)
    with pytest.raises(ValueError, match="read-only"):
        log["speed"].values[0] = 0.0


def test_an_unknown_name_gets_the_known_ones():
    log = log_of([tick(0, result())])
    with pytest.raises(UnknownName, match="did you mean 'speed'"):
        log["sped"]
    assert "speed" in log
    assert list(log) == ["speed"]
    assert log.get("sped") is None
    assert result_named(tick(0, result()), "speed") == result()
    assert result_named(tick(0), "speed") is None
    assert [s.name for s in log.ranked()] == ["speed"]
    assert log.history(10).traces[0].name == "speed"


def test_a_part_has_its_own_unit_and_its_own_extremum():
    def said(k, factor, speed, distance):
        parts = (
            Result(name="share", value=factor),
            Result(name="permissible", value=speed, unit="mm/s", at_most=False),
            Result(name="hand", value=distance, unit="m", limit=0.1, at_most=False, verdict=W),
        )
        return tick(k, result(parts=parts))

    log = log_of([said(0, 2.0, 900.0, 0.5), said(1, 4e5, 300.0, 0.4), said(2, 1.0, 700.0, 0.6)])
    parts = log["speed"].parts
    assert [(p.name, p.unit) for p in parts.values()] == [
        ("share", ""),
        ("permissible", "mm/s"),
        ("hand", "m"),
    ]
    assert [p.worst().value for p in parts.values()] == [4e5, 300.0, 0.4]


def thinned(values, verdicts, most, *, limit=2.0, at_most=True):
    rows = [
        result(v, verdict, limit=limit, at_most=at_most) for v, verdict in zip(values, verdicts, strict=True)
    ]
    return log_of(tick(k, row) for k, row in enumerate(rows))["speed"].thinned(most).tolist()


def test_of_a_long_run_each_bucket_keeps_its_first_and_its_extreme_instants():
    """Of 31 points six buckets of 100: first, worst verdict, smallest and largest value, smallest margin."""
    values = np.tile(np.linspace(1.0, 1.5, 100), 6)
    verdicts: list = [W] * 600
    for bucket in range(6):
        values[100 * bucket + 20 : 100 * bucket + 22] = (1.9, 0.5)
    verdicts[333], verdicts[334], verdicts[435], verdicts[540] = U, E, U, None
    verdicts[500:600] = [None if k != 555 else W for k in range(500, 600)]
    kept = thinned(values, verdicts, 31)
    usual = [100 * bucket + k for bucket in range(6) for k in (0, 20, 21)]
    assert kept == sorted({*usual, 334, 435, 555, 599})
    # Of a limit from below the smallest margin is that of the smallest value.
    assert thinned(values, verdicts, 31, at_most=False, limit=0.1) == kept
    # What is no number is no extreme; a bucket of nothing else keeps its first instant.
    empty = [None if 200 <= k < 300 or k == 20 else v for k, v in enumerate(values)]
    assert thinned(empty, verdicts, 31) == sorted({*kept, 99} - {20, 220, 221})


@pytest.mark.parametrize("at_most", [True, False])
def test_where_the_limit_moves_the_smallest_margin_is_kept(at_most):
    """Where the value is neither the smallest nor the largest."""
    cells = {333: (1.9, 2.0 if at_most else 1.8), 340: (5.0, 9.0 if at_most else 1.0)}
    usual = (0.2, 1.0 if at_most else -0.8)
    rows = [cells.get(k, usual) for k in range(600)]
    said = [result(value, W, limit=limit, at_most=at_most) for value, limit in rows]
    assert 333 in log_of(tick(k, row) for k, row in enumerate(said))["speed"].thinned(31)


@pytest.mark.parametrize("most", [26, 27, 28, 29, 30])
def test_no_more_points_are_kept_than_are_asked_for(most):
    """Five of a bucket, where the first, the worst and all extremes are apart, and the last of all."""
    cells = {3: (1.0, 5.0, U), 5: (0.1, 5.0, W), 7: (3.0, 9.0, W), 9: (1.9, 2.0, W)}
    rows = [cells.get(k % 20, (1.0, 5.0, W)) for k in range(900)]
    said = log_of(tick(k, result(v, verdict, limit=limit)) for k, (v, limit, verdict) in enumerate(rows))
    assert len(said["speed"].thinned(most)) == 26


@pytest.mark.parametrize("count", [6, 7, 8])
def test_a_run_of_no_more_instants_than_points_is_kept_whole(count):
    assert thinned([1.0] * count, [W] * count, 7) == ([*range(count)] if count <= 7 else [0, 7])
    with pytest.raises(ValueError, match="at least 7, not 6"):
        thinned([1.0], [W], 6)


def test_a_part_is_at_its_worst_where_its_verdict_and_its_margin_are():
    """By arrays: of its own unit and direction, with sizes that are not known."""

    def worst(*rows, at_most=True):
        parts = [
            Result(name="hand", unit="m", value=v, limit=limit, at_most=at_most, verdict=verdict)
            for v, limit, verdict in rows
        ]
        return (
            log_of(tick(k, result(parts=(part,))) for k, part in enumerate(parts))["speed"]
            .parts["hand"]
            .worst()
        )

    assert worst((1.0, 2.0, W), (9.0, 2.0, E), (None, 2.0, E), (5.0, 2.0, E)).t == 0.02
    assert worst((1.0, 2.0, W), (1.5, 2.0, W), (None, 2.0, W)).t == 0.01
    assert worst((None, 2.0, U), (1.9, 2.0, W)).t == 0.0
    assert worst((1.0, 2.0, W), (9.0, 2.0, None)).t == 0.0
    assert worst((1.5, 1.0, W), (1.2, 1.0, W), (3.0, 2.9, W), at_most=False).t == 0.02
    # Without a limit by the distance to nought.
    assert worst((0.5, 1.0, W), (0.4, None, W)).t == 0.01
    assert worst((0.5, 1.0, W)).verdict is W
    found = worst((0.2, None, None))
    assert (found.seq, found.limit, found.value, found.part) == (-1, None, 0.2, "")


def test_times_without_announcement_are_shares_of_instants():
    series = Series(name="v", unit="m", at_most=True)
    for k, verdict in enumerate((W, W, E, U, None)):
        series.append(result(1.0, verdict), 0.01 * k)
    said = series.times()
    assert said == Times(0.4, 0.2, 0.2, 0.0, 0.2, 0.0)
    assert Series(name="v", unit="m", at_most=True).times() == Times(0, 0, 0, 0, 0, 0)
    assert said.decided == pytest.approx(0.6)


@pytest.mark.parametrize("muted", [0, 1, 2])
def test_what_never_applied_is_undecided_and_what_applied_without_a_limit_informs(muted):
    said = Series(name="v", unit="m", at_most=True)
    for k in range(2):
        row = Result(name="v", muted=True) if k < muted else Result(name="v", nothing=True, reason="nobody")
        said.append(row, 0.1 * k)
        said.pass_time(row, 0.1)
    assert said.verdict is (U if muted == 2 else None)
    assert said.times().muted == muted / 2
    alone = Series(name="v", unit="m", at_most=True)
    alone.append(row, 0.0)
    assert alone.verdict is None
    alone.pass_time(row, 0.0)
    assert alone.verdict is (U if row.muted else None)
