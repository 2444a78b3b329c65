"""Plots of a report as SVG that stands inside an HTML page and refers to nothing outside it."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from io import StringIO
from typing import TYPE_CHECKING, Any

import numpy as np

from seerob.core.snapshot import Verdict
from seerob.outputs.html import Html, legal, text
from seerob.outputs.palette import DARK_HEX, HEX, MARK, WORD
from seerob.recording.series import CODES, Series

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 1500
"""Ticks per curve; thinned without losing an extremum."""
_TINT = {Verdict.EXCEEDED: 0.2, Verdict.UNDECIDED: 0.6}
_HATCH = {Verdict.EXCEEDED: "//", Verdict.UNDECIDED: "....", Verdict.WITHIN: "", None: ""}
_STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    # Names come from files: a dollar sign is a dollar sign.
    "text.parse_math": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#6B7785",
    "axes.linewidth": 0.8,
    "xtick.color": "#44505C",
    "ytick.color": "#44505C",
    "hatch.linewidth": 0.9,
}


def curve(series: Series, *, salt: str) -> Html:
    """Value and limit over time, with the stretches that are exceeded or undecided as hatched bands.

    Args:
        series: Of one criterion; must have been heard at least once.
        salt: Makes the ids inside the drawing unique on the page.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    i = series.thinned(POINTS)
    t, values, limits = series.t[i], series.values[i], series.limits[i]
    with mpl.rc_context(_style(salt)):
        # Margins by hand: finding them takes as long as drawing.
        figure = Figure(figsize=(7.4, 2.5))
        figure.subplots_adjust(left=0.1, right=0.985, bottom=0.19, top=0.88)
        axes = figure.add_subplot()
        span = float(series.t[-1] - series.t[0]) or 1.0
        for verdict in (Verdict.UNDECIDED, Verdict.EXCEEDED):
            _bands(axes, series, verdict, span)
        marker = "o" if np.count_nonzero(np.isfinite(values)) < 3 else None
        axes.plot(
            t, _finite(values), color="#1A2430", linewidth=1.3, label="value", marker=marker, markersize=3
        )
        if np.isfinite(limits).any():
            name = "limit (at most)" if series.at_most else "limit (at least)"
            axes.plot(
                t,
                _finite(limits),
                color=DARK_HEX[Verdict.EXCEEDED],
                linewidth=1.3,
                linestyle=(0, (5, 2)),
                label=name,
            )
        worst = series.worst()
        if worst.value is not None and np.isfinite(worst.value):
            color = DARK_HEX[worst.verdict]
            axes.plot(
                [worst.t], [worst.value], "o", color=color, markersize=5, label=f"worst, {worst.t:.2f} s"
            )
        axes.set_xlabel("time [s]")
        axes.set_ylabel(f"[{series.unit}]" if series.unit else "")
        axes.set_xlim(float(series.t[0]) - 0.01 * span, float(series.t[-1]) + 0.01 * span)
        axes.grid(axis="y", color="#E1E6EB", linewidth=0.6)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.18), ncols=5, frameon=False, fontsize=8)
        return svg(figure, f"{series.name} over time")


def lanes(series: Sequence[Series], *, salt: str) -> Html:
    """One row per criterion: its verdict over time."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_style(salt)):
        figure = Figure(figsize=(7.4, 0.55 + 0.3 * len(series)), layout="constrained")
        axes = figure.add_subplot()
        names = []
        for row, one in enumerate(series):
            names.append(f"{MARK[one.verdict]}  {one.name if len(one.name) < 36 else one.name[:35] + '…'}")
            for verdict in CODES:
                spans = [(a, max(b - a, 0.0) + _step(one)) for a, b in one.intervals(verdict)]
                if spans:
                    axes.broken_barh(
                        merged(spans, _step(one) * max(1.0, len(one) / POINTS)),
                        (row - 0.36, 0.72),
                        facecolor=HEX[verdict] if verdict else "#E4E9EE",
                        edgecolor="#FFFFFF" if verdict is Verdict.EXCEEDED else "#44505C",
                        linewidth=0,
                        hatch=_HATCH[verdict],
                    )
        axes.set_yticks(range(len(series)), names)
        axes.set_ylim(len(series) - 0.4, -0.6)
        axes.set_xlabel("time [s]")
        axes.tick_params(left=False)
        axes.spines["left"].set_visible(False)
        return svg(figure, "Verdict of every criterion over time")


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


def svg(figure: Figure, title: str) -> Html:
    """The drawing as an ``<svg>`` element without prologue, metadata and namespaces."""
    out = StringIO()
    with warnings.catch_warnings():
        # Words stay words in the drawing: the fonts of who reads it count, not matplotlib's.
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font")
        figure.savefig(out, format="svg", metadata={"Date": None})
    drawing = legal(out.getvalue())
    drawing = drawing[drawing.index("<svg") :]
    drawing = re.sub(r"<metadata>.*?</metadata>", "", drawing, flags=re.DOTALL)
    drawing = re.sub(r' xmlns(:\w+)?="[^"]*"', "", drawing)
    drawing = re.sub(r'(<svg[^>]*?) (?:width|height)="[^"]*pt"', r"\1", drawing)
    drawing = re.sub(r'(<svg[^>]*?) (?:width|height)="[^"]*pt"', r"\1", drawing)
    return Html(drawing.replace("<svg", f'<svg role="img" aria-label="{text(title)}"', 1))


def _bands(axes: Axes, series: Series, verdict: Verdict, span: float) -> None:
    bars = [(a, b - a + _step(series)) for a, b in series.intervals(verdict)]
    for k, (start, length) in enumerate(merged(bars, span / 400)):
        end = start + max(length, span / 600)
        label = WORD[verdict] if k == 0 else None
        axes.axvspan(start, end, facecolor=HEX[verdict], alpha=_TINT[verdict], linewidth=0)
        # A patch of its own, so that the hatch is not as faint as the tint.
        axes.axvspan(
            start,
            end,
            facecolor="none",
            edgecolor=DARK_HEX[verdict],
            hatch=_HATCH[verdict],
            linewidth=0,
            label=label,
        )


def _style(salt: str) -> Any:
    return {**_STYLE, "svg.hashsalt": salt}


def _step(series: Series) -> float:
    """Usual time between two evaluations [s]."""
    t = series.t
    return float(np.median(np.diff(t))) if len(t) > 1 else 0.01


def _finite(data: Any) -> Any:
    return np.where(np.isfinite(data), data, np.nan)
