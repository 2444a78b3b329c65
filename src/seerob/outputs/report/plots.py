"""Plots of a report as SVG that stands inside an HTML page and refers to nothing outside it.

Polylines, axes and bands are written as they are: a plotting library takes a second to start and one to draw
what a report of ten criteria shows.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seerob.core.snapshot import Verdict
from seerob.core.transforms import Array
from seerob.outputs.html import Html, tag
from seerob.outputs.palette import DARK_HEX, HEX, MARK, WORD
from seerob.outputs.words import said
from seerob.recording.series import CODES, Series

POINTS = 1500
"""Ticks per curve; thinned without losing an extremum."""
_WIDTH, _HEIGHT = 533.0, 180.0
"""Of a curve; a unit is 1/72 inch on paper of the usual size."""
_LEFT, _RIGHT, _TOP, _BOTTOM = 53.0, 8.0, 22.0, 34.0
"""Margins of a curve."""
_FONT, _SMALL = 9.0, 8.0
_INK, _TICK, _FRAME, _RULE = "#1A2430", "#44505C", "#6B7785", "#E1E6EB"
_EARLIER, _EARLIER_LIMIT = "#5B8DB8", "#C79AA4"
"""Of a run that another is compared with."""
_TINT = {Verdict.EXCEEDED: 0.2, Verdict.UNDECIDED: 0.6}
_DASH = "6.5 2.6"
_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_LONGEST_NAME = 36
_LEAST, _LARGEST = 1e-290, 1e300
"""What is drawn lies between these: no span of two such figures is beyond a double."""


@dataclass(frozen=True)
class Axis:
    """Values between two ends as places on the drawing.

    Attributes:
        low: Value at the begin.
        high: Value at the end, above ``low``.
        begin: Place of ``low``.
        end: Place of ``high``.
    """

    low: float
    high: float
    begin: float
    end: float

    def at(self, values: Array) -> Array:
        """Places of values, any shape."""
        share = (values - self.low) / (self.high - self.low)
        return np.asarray(self.begin + share * (self.end - self.begin))

    def place(self, value: float) -> float:
        """Place of one value."""
        return float(self.at(np.array(value)))


def curve(series: Series, *, salt: str) -> Html:
    """Value and limit over time, with the stretches that are exceeded or undecided as hatched bands.

    Args:
        series: Of one criterion; must have been heard at least once.
        salt: Makes the ids inside the drawing unique on the page.
    """
    i = series.thinned(POINTS)
    t, values, limits = series.t[i], _shown(series.values[i]), _shown(series.limits[i])
    worst = series.worst()
    begin, end = float(series.t[0]), float(series.t[-1])
    span = end - begin or 1.0
    x = Axis(begin - 0.01 * span, end + 0.01 * span, _LEFT, _WIDTH - _RIGHT)
    known = [values[np.isfinite(values)], limits[np.isfinite(limits)]]
    shown = worst.value is not None and abs(worst.value) < _LARGEST
    y = Axis(*_room(np.concatenate([*known, [worst.value] if shown else []])), _HEIGHT - _BOTTOM, _TOP)
    under: list[Html] = []
    over: list[Html] = []
    legend: list[tuple[str, list[Html]]] = []
    for verdict in (Verdict.UNDECIDED, Verdict.EXCEEDED):
        bars = _bands(series, verdict, span)
        for start, stop in bars:
            under += _band(x, start, stop, _TOP, y.begin - _TOP, verdict, salt)
        if bars:
            # A patch of its own for the hatch, so that it is not as faint as the tint.
            legend.append((WORD[verdict], _patches(0, -6, 16, 7, verdict, salt)))
    few = np.count_nonzero(np.isfinite(values)) < 3
    over.append(_line(x.at(t), y.at(values), _INK))
    if few:
        over += [_dot(a, b, 1.5, _INK) for a, b in _finite(x.at(t), y.at(values))]
    legend.append((said("value"), [_stroke("M0,-2.5H16", _INK)]))
    if len(known[1]):
        color = DARK_HEX[Verdict.EXCEEDED]
        over.append(_line(x.at(t), y.at(limits), color, dash=_DASH))
        name = said("limit (at most)") if series.at_most else said("limit (at least)")
        legend.append((name, [_stroke("M0,-2.5H16", color, dash=_DASH)]))
    if worst.value is not None and shown:
        color = DARK_HEX[worst.verdict]
        over.append(_dot(x.place(worst.t), y.place(worst.value), 2.5, color))
        legend.append((said("worst, {t} s", t=f"{worst.t:.2f}"), [_dot(8, -2.5, 2.5, color)]))
    title = said("{name} over time", name=series.name)
    return _svg(_HEIGHT, title, _hatches(salt), under, _axes(x, y, series.unit, over), _legend(legend))


def both(runs: Sequence[tuple[str, Series]], *, salt: str) -> Html:
    """Values and limits of one criterion in several runs, on one axis of run time.

    Stretches that are exceeded or undecided are bands, each run's in a row of its own.

    Args:
        runs: What each is called, and its series, all in one unit; the last is drawn darkest and lowest.
        salt: Makes the ids inside the drawing unique on the page.
    """
    drawn = [(name, one, one.thinned(POINTS)) for name, one in runs]
    figures = [_shown(each[i]) for _, one, i in drawn for each in (one.values, one.limits)]
    begin = min(float(one.t[0]) for _, one in runs)
    end = max(float(one.t[-1]) for _, one in runs)
    span = end - begin or 1.0
    x = Axis(begin - 0.01 * span, end + 0.01 * span, _LEFT, _WIDTH - _RIGHT)
    y = Axis(*_room(np.concatenate([each[np.isfinite(each)] for each in figures])), _HEIGHT - _BOTTOM, _TOP)
    lines: list[Html] = []
    bands: list[Html] = []
    legend: list[tuple[str, list[Html]]] = []
    seen: set[Verdict] = set()
    row = (y.begin - _TOP) / len(drawn)
    for k, (name, one, i) in enumerate(drawn):
        for verdict in (Verdict.UNDECIDED, Verdict.EXCEEDED):
            bars = _bands(one, verdict, span)
            seen |= {verdict} if bars else set()
            for start, stop in bars:
                bands += _band(x, start, stop, _TOP + k * row, row, verdict, salt)
        color, limit = (
            (_INK, DARK_HEX[Verdict.EXCEEDED]) if k == len(drawn) - 1 else (_EARLIER, _EARLIER_LIMIT)
        )
        places = x.at(one.t[i])
        lines += [
            _line(places, y.at(figures[2 * k]), color),
            _line(places, y.at(figures[2 * k + 1]), limit, dash=_DASH),
        ]
        legend.append((name, [_stroke("M0,-2.5H16", color)]))
        if np.isfinite(figures[2 * k + 1]).any():
            side = "at most" if one.at_most else "at least"
            legend.append((f"limit ({side}), {name}", [_stroke("M0,-2.5H16", limit, dash=_DASH)]))
    legend += [
        (WORD[verdict], _patches(0, -6, 16, 7, verdict, salt)) for verdict in Verdict if verdict in seen
    ]
    if seen:
        names = " above, ".join(name for name, _ in runs) + " below"
        lines.append(_text(f"bands: {names}", x.end - 4, _TOP + 9, "end", font_size=_number(_SMALL)))
    title = f"{runs[-1][1].name} over time"
    return _svg(_HEIGHT, title, _hatches(salt), bands, _axes(x, y, runs[-1][1].unit, lines), _legend(legend))


def _axes(x: Axis, y: Axis, unit: str, drawn: list[Html]) -> list[Html]:
    """What is drawn between its axes, on rules."""
    middle = _number((y.begin + y.end) / 2)
    return [
        *(
            _stroke(f"M{_number(x.begin)},{_number(y.place(v))}H{_number(x.end)}", _RULE, 0.6)
            for v in ticks(y)
        ),
        *drawn,
        *_time_axis(x, y.begin),
        _stroke(f"M{_number(x.begin)},{_number(y.begin)}V{_number(y.end)}", _FRAME, 0.8),
        *(_tick(v, _LEFT - 5, y.place(v) + 3, y, "end") for v in ticks(y)),
        *(_stroke(f"M{_number(_LEFT - 3.5)},{_number(y.place(v))}h3.5", _TICK, 0.8) for v in ticks(y)),
        _text(f"[{unit}]" if unit else "", 0, 0, "middle", transform=f"translate(10 {middle}) rotate(-90)"),
    ]


def lanes(series: Sequence[Series], *, salt: str) -> Html:
    """One row per criterion: its verdict over time."""
    names = [f"{MARK[one.verdict]}  {_short(one.name)}" for one in series]
    left = 12 + max(_wide(name, _FONT) for name in names)
    height = 39.6 + 21.6 * len(series)
    floor = height - _BOTTOM
    known = [one.t for one in series if len(one.t)]
    begin = min((float(t[0]) for t in known), default=0.0)
    end = max((float(one.t[-1]) + _step(one) for one in series if len(one.t)), default=1.0)
    span = end - begin or 1.0
    x = Axis(begin - 0.02 * span, end + 0.02 * span, left, _WIDTH - _RIGHT)
    row = (floor - 4) / len(series)
    drawn: list[Html] = []
    for k, one in enumerate(series):
        top = 4 + (k + 0.14) * row
        drawn.append(_text(names[k], left - 8, 4 + (k + 0.5) * row + 3, "end"))
        step = _step(one)
        for verdict in CODES:
            spans = [(a, max(b - a, 0.0) + step) for a, b in one.intervals(verdict)]
            for start, length in merged(spans, step * max(1.0, len(one) / POINTS)):
                a, b = x.place(start), x.place(start + length)
                drawn.append(_rectangle(a, top, b - a, 0.72 * row, HEX[verdict] if verdict else "#E4E9EE"))
                if verdict in _TINT:
                    drawn.append(
                        _rectangle(a, top, b - a, 0.72 * row, f"url(#{_hatch(verdict, salt, on=True)})")
                    )
    return _svg(
        height,
        said("Verdict of every criterion over time"),
        _hatches(salt, on=True),
        drawn,
        _time_axis(x, floor),
    )


def merged(spans: Sequence[tuple[float, float]], gap: float) -> list[tuple[float, float]]:
    """Bars (start, length) with gaps below ``gap`` closed: a flickering verdict must not fill the page."""
    joined: list[tuple[float, float]] = []
    for start, length in spans:
        if joined and start - (joined[-1][0] + joined[-1][1]) < gap:
            first = joined[-1][0]
            joined[-1] = first, start + length - first
        else:
            joined.append((start, length))
    return joined


def ticks(axis: Axis) -> list[float]:
    """Round values on an axis, 1, 2, 2.5 or 5 times a power of ten apart, at most about nine."""
    step = _step_of(axis)
    first, last = math.ceil(axis.low / step - 1e-9), math.floor(axis.high / step + 1e-9)
    return [k * step for k in range(first, last + 1)]


def _step_of(axis: Axis) -> float:
    rough = (axis.high - axis.low) / min(9.0, abs(axis.end - axis.begin) / 20)
    power: float = 10.0 ** math.floor(math.log10(rough))
    return power * next(s for s in _STEPS if s * power >= rough * (1 - 1e-9))


# -- ranges -----------------------------------------------------------------------------------------


def _room(values: NDArray[np.float64]) -> tuple[float, float]:
    """Ends of an axis that shows finite values with 5 % of room at both ends."""
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high))
    if high - low <= max(1e-9 * size, _LEAST):
        # A constant: a tenth of it, so that its ticks have names.
        around = 0.05 * size if size > _LEAST else 0.05
        return low - around, high + around
    return low - 0.05 * (high - low), high + 0.05 * (high - low)


def _shown(values: Array) -> Array:
    """Values, and NaN where one cannot be drawn."""
    return np.where(np.abs(values) < _LARGEST, values, np.nan)


def _bands(series: Series, verdict: Verdict, span: float) -> list[tuple[float, float]]:
    """Begin and end of the stretches with a verdict [s], none too narrow to be seen."""
    bars = [(a, b - a + _step(series)) for a, b in series.intervals(verdict)]
    return [(a, a + max(length, span / 600)) for a, length in merged(bars, span / 400)]


def _step(series: Series) -> float:
    """Usual time between two evaluations [s]."""
    t = series.t
    return float(np.median(np.diff(t))) if len(t) > 1 else 0.01


# -- elements ---------------------------------------------------------------------------------------


def _svg(height: float, title: str, *content: Html | list[Html]) -> Html:
    return tag(
        "svg",
        *content,
        role="img",
        aria_label=title,
        viewBox=f"0 0 {_number(_WIDTH)} {_number(height)}",
        font_family="sans-serif",
        font_size=_number(_FONT),
        fill=_TICK,
    )


def _time_axis(x: Axis, floor: float) -> list[Html]:
    at = _number(floor)
    marks = "".join(f"M{_number(x.place(v))},{at}v3.5" for v in ticks(x))
    return [
        _stroke(f"M{_number(x.begin)},{at}H{_number(x.end)}", _FRAME, 0.8),
        _stroke(marks, _TICK, 0.8),
        *(_tick(v, x.place(v), floor + 13, x, "middle") for v in ticks(x)),
        _text("time [s]", (x.begin + x.end) / 2, floor + 27, "middle", fill=_INK),
    ]


def _tick(value: float, x: float, y: float, axis: Axis, anchor: str) -> Html:
    return _text(_figure(value, axis), x, y, anchor)


def _figure(value: float, axis: Axis) -> str:
    """A tick's figure with the digits that tell it from its neighbours."""
    step, size = _step_of(axis), max(abs(axis.low), abs(axis.high))
    places = next((d for d in range(7) if abs(round(step, d) - step) < 1e-6 * step), None)
    if abs(value) < 1e-9 * size:
        shown = "0"
    elif places is not None and size < 1e6:
        shown = f"{value:.{places}f}"
    else:
        shown = f"{value:.{max(1, math.ceil(math.log10(size / step)) + 1)}g}"
    return shown.replace("-", "\u2212")


def _legend(entries: Sequence[tuple[str, list[Html]]]) -> list[Html]:
    """In one row above the axes, centred."""
    widths = [20 + _wide(name, _SMALL) for name, _ in entries]
    gap = min(14.0, (_WIDTH - sum(widths)) / max(1, len(entries)))
    at = (_LEFT + _WIDTH - _RIGHT - sum(widths) - gap * (len(entries) - 1)) / 2
    found = []
    for (name, sample), width in zip(entries, widths, strict=True):
        words = _text(name, 20, 0, "start", fill=_INK, font_size=_number(_SMALL))
        found.append(tag("g", *sample, words, transform=f"translate({_number(at)} 12)"))
        at += width + gap
    return found


def _band(
    x: Axis, start: float, stop: float, top: float, height: float, verdict: Verdict, salt: str
) -> list[Html]:
    a, b = x.place(start), x.place(min(stop, x.high))
    return _patches(a, top, b - a, height, verdict, salt)


def _patches(x: float, y: float, width: float, height: float, verdict: Verdict, salt: str) -> list[Html]:
    """A tint and the hatch over it."""
    return [
        _rectangle(x, y, width, height, HEX[verdict], opacity=_TINT[verdict]),
        _rectangle(x, y, width, height, f"url(#{_hatch(verdict, salt)})"),
    ]


def _hatch(verdict: Verdict, salt: str, *, on: bool = False) -> str:
    return f"{verdict.value}-{'on-' if on else ''}{salt}"


def _hatches(salt: str, *, on: bool = False) -> Html:
    """Patterns of the verdicts: dots of what is undecided, strokes of what is exceeded.

    Args:
        salt: Of the ids.
        on: Whether they lie on the full colour.
    """
    stroke = "#FFFFFF" if on else DARK_HEX[Verdict.EXCEEDED]
    dots = [(1.5, 1.5), (4.5, 4.5)]
    size = {"width": "6", "height": "6", "patternUnits": "userSpaceOnUse"}
    return tag(
        "defs",
        tag(
            "pattern",
            [_dot(a, b, 0.6, DARK_HEX[Verdict.UNDECIDED]) for a, b in dots],
            id=_hatch(Verdict.UNDECIDED, salt, on=on),
            **size,
        ),
        tag(
            "pattern",
            _stroke("M-1,1L1,-1M0,6L6,0M5,7L7,5", stroke, 0.8),
            id=_hatch(Verdict.EXCEEDED, salt, on=on),
            **size,
        ),
    )


def _line(x: Array, y: Array, color: str, *, dash: str | None = None) -> Html:
    """A polyline with a gap where a value is missing; one value between gaps is a dot."""
    path, pen = [], False
    for a, b, known in zip(x.tolist(), y.tolist(), np.isfinite(y).tolist(), strict=True):
        if known:
            path.append(f"{'L' if pen else 'M'}{_number(a)},{_number(b)}{'' if pen else 'h0'}")
        pen = known
    return _stroke("".join(path), color, dash=dash, stroke_linejoin="round", stroke_linecap="round")


def _finite(x: Array, y: Array) -> list[tuple[float, float]]:
    return [(a, b) for a, b in zip(x.tolist(), y.tolist(), strict=True) if math.isfinite(b)]


def _stroke(path: str, color: str, width: float = 1.3, *, dash: str | None = None, **more: str) -> Html:
    return tag(
        "path", d=path, fill="none", stroke=color, stroke_width=_number(width), stroke_dasharray=dash, **more
    )


def _rectangle(
    x: float, y: float, width: float, height: float, fill: str, *, opacity: float | None = None
) -> Html:
    return tag(
        "rect",
        x=_number(x),
        y=_number(y),
        width=_number(width),
        height=_number(height),
        fill=fill,
        fill_opacity=None if opacity is None else _number(opacity),
    )


def _dot(x: float, y: float, radius: float, color: str) -> Html:
    return tag("circle", cx=_number(x), cy=_number(y), r=_number(radius), fill=color)


def _text(words: str, x: float, y: float, anchor: str, **more: str) -> Html:
    return tag("text", words, x=_number(x), y=_number(y), text_anchor=anchor, **more)


def _number(value: float) -> str:
    """A place to a hundredth of a unit."""
    return f"{value:.2f}".rstrip("0").rstrip(".")


def _short(name: str) -> str:
    return name if len(name) < _LONGEST_NAME else name[: _LONGEST_NAME - 1] + "…"


def _wide(words: str, size: float) -> float:
    """About how wide text is."""
    return size * sum(1.05 if unicodedata.east_asian_width(c) in "WF" else 0.56 for c in words)
