"""Words of a report that are short keep what they are about."""

from types import SimpleNamespace

import numpy as np
import pytest

from seerob.core.snapshot import Finding, Verdict
from seerob.outputs.report.page import _unasked
from seerob.outputs.sentences import _reasons, _stretches, listed, shortened
from seerob.outputs.words import speaking
from seerob.recording.series import CODES


def test_a_text_that_is_too_long_keeps_its_begin_and_its_end_where_the_figure_is():
    text = "✕ Lower arms and wrist joints: 0.872 m/s of 0.202 m/s"
    short = shortened(text, 48)
    assert len(short) == 48
    assert short.startswith("✕ Lower arms and")
    assert short.endswith("0.872 m/s of 0.202 m/s")
    assert shortened(text, len(text)) == text
    assert len(shortened(text, len(text) - 1)) == len(text) - 1


def test_a_sentence_lists_so_many_names_and_counts_the_others():
    assert listed(["a", "b", "c"]) == "a, b and c"
    many = listed([f"n{k}" for k in range(200)])
    assert many.startswith("n0, n1, ")
    assert many.endswith("n13 and 186 more")


def test_the_opening_names_whom_no_criterion_asks_about():
    asked = Finding(level="warning", subject="first", text="envelope made by seerob")
    other = Finding(level="warning", subject="second", text="not evaluated: criteria ask about first")
    (said,) = _unasked(SimpleNamespace(scene=SimpleNamespace(findings=(asked, other))))
    assert "nothing of second" in said
    assert _unasked(SimpleNamespace(scene=SimpleNamespace(findings=(asked,)))) == []


def test_reasons_for_doubt_are_told_in_the_language_of_the_report():
    codes = np.array([CODES[Verdict.UNDECIDED]] * 2)
    series = SimpleNamespace(verdicts=codes, reasons=["no part moves", "no part moves"])
    with speaking("de"):
        assert _reasons(series) == "Grund: kein Teil bewegt sich."
    assert _reasons(series) == "Reason: no part moves."


@pytest.mark.parametrize(
    ("language", "one", "two"),
    [("en", "one stretch;", "two stretches;"), ("de", "einem Abschnitt;", "2 Abschnitten;")],
)
def test_one_stretch_is_not_told_as_several(language, one, two):
    with speaking(language):
        for spans, said in (([(0.0, 1.0)], one), ([(0.0, 1.0), (2.0, 2.5)], two)):
            series = SimpleNamespace(intervals=lambda _, spans=spans: spans)
            assert said in _stretches(series, Verdict.UNDECIDED)
