"""Thinning what happened, against what happened."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from seerob.app.server.live import KEPT_PER_BUCKET, Past, keep, width_of
from seerob.core.snapshot import Result, Snapshot, Verdict

CODES = {Verdict.WITHIN: 0, Verdict.EXCEEDED: 1, Verdict.UNDECIDED: 2, None: 255}


@settings(deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 3000), st.integers(-4, 8), st.booleans())
def test_every_bucket_keeps_its_extremes_and_its_verdicts(seed, n, power, at_most):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.exponential(size=n))
    values = np.where(rng.random(n) < 0.1, np.nan, rng.normal(size=n))
    limits = np.where(rng.random(n) < 0.1, np.nan, rng.normal(size=n))
    verdicts = rng.choice(np.array([0, 0, 0, 0, 1, 2, 255], np.uint8), n)
    i = keep(t, values, limits, verdicts, at_most=at_most, width=2.0**power)
    assert (np.diff(i) > 0).all()
    assert i[0] == 0
    assert i[-1] == n - 1
    margins = limits - values if at_most else values - limits
    bucket = t // 2.0**power
    assert len(i) <= KEPT_PER_BUCKET * len(np.unique(bucket)) + 1
    for b in np.unique(bucket):
        whole, kept = np.flatnonzero(bucket == b), i[bucket[i] == b]
        assert set(verdicts[kept]) == set(verdicts[whole])
        for data in (values, -values, margins):
            if not np.isnan(data[whole]).all():
                assert np.nanmin(data[kept]) == np.nanmin(data[whole])


def test_a_long_run_takes_bounded_memory_and_loses_no_extremum():
    rng = np.random.default_rng(0)
    past, values = Past(buckets=20), rng.normal(size=20_000)
    bad = {137: Verdict.EXCEEDED, 9_999: Verdict.UNDECIDED, 15_000: None}
    values[[1, 19_998]] = 99.0, -99.0
    longest = 0
    for k, value in enumerate(values.tolist()):
        result = Result(name="x", value=value, limit=1.0, verdict=bad.get(k, Verdict.WITHIN))
        past.add(Snapshot(seq=k, t=k * 0.01, poses=b"", results=(result,)))
        past.tidy()
        longest = max(longest, len(past._of["x"].t))
    assert longest <= 3 * KEPT_PER_BUCKET * 20 + 1
    (trace,) = past.history().traces
    t, kept = np.frombuffer(trace.t, "<f8"), np.frombuffer(trace.values, "<f8")
    codes = np.frombuffer(trace.verdicts, "u1")
    assert (kept.max(), kept.min()) == (99.0, -99.0)
    assert (np.diff(t) > 0).all()
    assert np.isclose(t[kept.argmax()], 0.01)
    for k, verdict in bad.items():
        assert codes[np.isclose(t, k * 0.01)].tolist() == [CODES[verdict]]
    # However often the early part was thinned, each of its buckets has its true extremes.
    true_t = np.arange(len(values)) * 0.01
    width = width_of(200.0, 20)
    for b in range(int(200 // width) - 1):
        whole, left = true_t // width == b, t // width == b
        assert values[whole].max() == kept[left].max()
        assert values[whole].min() == kept[left].min()


@given(st.floats(1e-6, 1e9), st.integers(1, 5000))
def test_buckets_cover_the_span_and_nest(span, buckets):
    width = width_of(span, buckets)
    assert span / buckets <= width <= 2 * span / buckets * (1 + 1e-12)
    assert np.frexp(width)[0] == 0.5


def test_a_result_that_is_shown_again_is_one_point():
    past = Past()
    for k in range(10):
        slow = Result(name="slow", value=float(k // 5), t=(k // 5) * 0.05)
        fast = Result(name="fast", value=None, verdict=Verdict.UNDECIDED, reason="not heard")
        past.add(Snapshot(seq=k, t=k * 0.01, poses=b"", results=(slow, fast)))
    slow, fast = past.history().traces
    np.testing.assert_array_equal(np.frombuffer(slow.values, "<f8"), [0.0, 1.0])
    np.testing.assert_array_equal(np.frombuffer(fast.values, "<f8"), np.full(10, np.nan))
    assert fast.verdicts == bytes([2] * 10)
