"""The one line that is printed of a criterion."""

from seerob.app.console.terminal import extreme
from seerob.core.snapshot import Result, Snapshot, Verdict
from seerob.recording.result_log import log_of


def shown(*results):
    log = log_of(Snapshot(seq=k, t=k / 10, poses=b"", results=(r,)) for k, r in enumerate(results))
    return extreme(log["share"])


def result(value, verdict, reason=""):
    return Result(name="share", value=value, unit="", limit=1.0, verdict=verdict, reason=reason)


def test_what_has_no_figure_says_why():
    fine, forbidden = result(0.5, Verdict.WITHIN), result(None, Verdict.EXCEEDED, "moves where it may not")
    assert shown(fine, forbidden, forbidden) == "moves where it may not (first at 0.10 s)"
    assert shown(fine, result(1.5, Verdict.EXCEEDED, "knee")) == "max 1.5 at 0.10 s, limit 1 (knee)"
    assert shown(result(None, None)) == "no value"


def test_what_is_undecided_at_first_says_what_it_was_later():
    silent = result(None, Verdict.UNDECIDED, "nothing heard yet")
    first = "nothing heard yet (first at 0.00 s)"
    assert shown(silent) == first
    low, high = result(0.5, Verdict.WITHIN), result(0.75, None)
    assert shown(silent, low, high, low) == f"{first}; where decided, max 0.75 at 0.20 s"
    # A figure that is undecided itself is none of the rest.
    assert shown(result(0.9, Verdict.UNDECIDED, "late"), low) == (
        "late (first at 0.00 s); where decided, max 0.5 at 0.10 s"
    )


def test_the_instant_that_decides_is_called_so_where_a_limit_that_moves_hides_the_extreme_value():
    def separation(value, limit):
        verdict = Verdict.EXCEEDED
        return Result(name="share", value=value, unit="m", limit=limit, at_most=False, verdict=verdict)

    assert shown(separation(0.2, 0.3), separation(0.4, 1.0)) == "worst 0.4 m at 0.10 s, limit 1"
    assert shown(separation(0.2, 1.0), separation(0.4, 0.5)) == "min 0.2 m at 0.00 s, limit 1"
