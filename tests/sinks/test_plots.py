"""A plot shows figures where its axes say, leaves gaps where nothing is known, and words stay words."""

import math
import re
from xml.etree import ElementTree

import pytest

from seerob.core.snapshot import Result, Verdict
from seerob.outputs.report.plots import Axis, both, curve, lanes, ticks
from seerob.recording.series import Series


def of(values, limits=None, verdicts=None, name="gap", unit="m"):
    series = Series(name=name, unit=unit, at_most=True)
    for k, value in enumerate(values):
        limit = None if limits is None else limits[k]
        verdict = None if verdicts is None else verdicts[k]
        series.append(Result(name=name, value=value, unit=unit, limit=limit, verdict=verdict), 0.1 * k)
    return series


def drawing(html):
    """Parsed as XML, which is stricter than HTML."""
    return ElementTree.fromstring(html)


def words(root):
    return [e.text for e in root.iter("text")]


def places(path):
    """Pieces of a polyline as lists of points."""
    pieces = [piece for piece in path.split("M") if piece]
    return [[tuple(map(float, p.removesuffix("h0").split(","))) for p in s.split("L")] for s in pieces]


def scale(root, axis):
    """Value of a place, from two labelled ticks: they are all that a reader has."""
    vertical = axis == "y"
    marks = []
    for e in root.iter("text"):
        x, y, word = float(e.get("x")), float(e.get("y")), (e.text or "").replace("\u2212", "-")
        if re.fullmatch(r"-?[\d.]+(e[-+]?\d+)?", word) and (e.get("text-anchor") == "end") == vertical:
            marks.append((y - 3 if vertical else x, float(word)))
    (a, u), (b, v) = marks[0], marks[-1]
    return lambda place: u + (place - a) * (v - u) / (b - a)


@pytest.mark.parametrize("factor", [1e-6, 1.0, 4e3, 7e9])
def test_ticks_tell_what_the_line_says(factor):
    values = [factor * v for v in (-1.3, 0.7, 2.1, 0.4)]
    root = drawing(curve(of(values), salt="a"))
    line = next(d for e in root.iter("path") if "h0" in (d := e.get("d")))
    (points,) = places(line)
    at, when = scale(root, "y"), scale(root, "x")
    assert [at(y) for _, y in points] == pytest.approx(values, abs=0.02 * factor)
    assert [when(x) for x, _ in points] == pytest.approx([0, 0.1, 0.2, 0.3], abs=2e-3)


def test_gaps_stay_gaps_and_one_value_between_two_is_seen():
    line = re.search(r'<path d="(M[^"]*h0[^"]*)"', curve(of([1, 2, None, 3, None, 4, 5]), salt="a"))[1]
    assert [len(piece) for piece in places(line)] == [2, 1, 2]


def test_bands_lie_where_the_verdict_was_and_are_told_without_colour():
    verdicts = [Verdict.WITHIN, Verdict.EXCEEDED, Verdict.EXCEEDED, Verdict.WITHIN, Verdict.UNDECIDED]
    root = drawing(curve(of([1, 3, 3, 1, 1], [2] * 5, verdicts), salt="s"))
    when = scale(root, "x")
    patterns = {e.get("id") for e in root.iter("pattern")}
    for verdict, begin, end in (("exceeded", 0.1, 0.3), ("undecided", 0.4, 0.404)):
        hatched = [e for e in root.iter("rect") if e.get("fill") == f"url(#{verdict}-s)"]
        band = max(hatched, key=lambda e: float(e.get("height")))  # the other is the legend's
        x, width = float(band.get("x")), float(band.get("width"))
        assert f"{verdict}-s" in patterns
        assert (when(x), when(x + width)) == pytest.approx((begin, end), abs=3e-3)
    assert {"EXCEEDED", "UNDECIDED", "value", "limit (at most)", "worst, 0.10 s"} <= set(words(root))
    rows = drawing(lanes([of([1, 3, 3, 1, 1], [2] * 5, verdicts)], salt="t"))
    assert "✕  gap" in words(rows)
    assert sum(e.get("fill") == "url(#exceeded-on-t)" for e in rows.iter("rect")) == 1


@pytest.mark.parametrize(
    "values",
    [
        [5.0],
        [0.0, 0.0],
        [math.inf, 1.0],
        [None, 2.0],
        [1e308, -1e308],
        [9e299, -9e299],
        [5e-324, 0.0],
        [7e9, 7e9 + 1],
    ],
)
def test_nothing_that_is_drawn_is_not_a_number(values):
    for html in (curve(of(values), salt="a"), lanes([of(values)], salt="b")):
        assert not re.search(r'="[^"]*\b(nan|inf)\b', html)
        drawing(html)


def test_names_stay_text():
    name = "<script>$x$ & \u202e"
    root = drawing(lanes([of([1.0], name=name)], salt="a"))
    assert any("<script>$x$ &" in word for word in words(root))


def test_ticks_are_round_and_within():
    for low, high in ((0, 1), (-3.2, 9.1), (1e-7, 3e-7), (99.5, 100.5)):
        found = ticks(Axis(low, high, 0, 140))
        assert 2 <= len(found) <= 9
        assert all(low - 1e-9 <= v <= high + 1e-9 for v in found)


def test_two_runs_are_on_one_axis_each_with_its_limit_and_its_own_end():
    first = of([1.0, 2.0, 4.0], [3.0] * 3)
    second = of([8.0, 6.0, 5.0, 1.0, 0.5], [7.0] * 5)
    root = drawing(both([("before", first), ("after", second)], salt="x"))
    assert {"before", "after", "limit (at most), before", "limit (at most), after", "[m]"} <= set(words(root))
    lines = [
        places(e.get("d"))[0]
        for e in root.iter("path")
        if e.get("stroke-linejoin") == "round" and e.get("d").count("L") > 0
    ]
    x, y = scale(root, "x"), scale(root, "y")
    for line, series in zip(lines, (first.values, first.limits, second.values, second.limits), strict=True):
        assert [x(a) for a, _ in line] == pytest.approx([0.1 * k for k in range(len(series))], abs=2e-3)
        assert [y(b) for _, b in line] == pytest.approx(list(series), abs=0.02)


def test_of_two_runs_each_has_its_bands_in_its_own_half_so_that_no_line_looks_within_that_is_not():
    within, exceeded, undecided = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED
    first = of([1] * 4, [2] * 4, [within, undecided, undecided, within])
    second = of([1, 1, 3, 3], [2] * 4, [within, within, exceeded, exceeded])
    root = drawing(both([("before", first), ("after", second)], salt="s"))
    when = scale(root, "x")
    bands = [e for e in root.iter("rect") if float(e.get("height")) > 20 and e.get("fill").startswith("url")]
    found = {
        e.get("fill"): (
            float(e.get("y")),
            when(float(e.get("x"))),
            when(float(e.get("x")) + float(e.get("width"))),
        )
        for e in bands
    }
    assert len(bands) == len(found) == 2
    (above, *unsure), (below, *beyond) = found["url(#undecided-s)"], found["url(#exceeded-s)"]
    assert above < below
    assert unsure == pytest.approx([0.1, 0.3], abs=3e-3)
    assert beyond == pytest.approx([0.2, 0.3], abs=5e-3)  # to the end of the drawing
    assert "bands: before above, after below" in words(root)
