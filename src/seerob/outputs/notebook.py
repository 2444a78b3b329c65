"""What a notebook shows of a workstation and of a run.

Tables stand alone, without styles or scripts; criteria over time are figures of matplotlib, also for papers.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from seerob.core.extras import need
from seerob.core.figures import figure
from seerob.core.snapshot import CriterionInfo, Verdict
from seerob.core.transforms import Array
from seerob.outputs.html import Html, table, tag
from seerob.outputs.palette import DARK_HEX, HEX, MARK, WORD
from seerob.outputs.sentences import bound, covered, extremum, percent
from seerob.recording.answers import EXCEEDED, UNDECIDED, Codes
from seerob.recording.frames import CriterionSeries
from seerob.recording.result_log import ResultLog, Series
from seerob.recording.series import CODES

_HEAD = ("criterion", "verdict", "worst", "limit", "at", "what is known")
_HATCH = {Verdict.EXCEEDED: "", Verdict.UNDECIDED: "////"}


def results_html(results: ResultLog) -> Html:
    """The criteria of a run, one row each, below the verdict of the whole."""
    decided = results.decided
    share = "" if decided is None or decided >= 1 else f", decided {percent(decided)} of the time or more"
    headline = tag("p", _mark(results.verdict), f"the run is {WORD[results.verdict]}{share}")
    return tag("div", headline, table(_HEAD, [_row(series) for series in results.values()]))


def batch_html(columns: Iterable[tuple[str, Verdict | None, Codes, Array, str]]) -> Html:
    """Criteria over many instants: name, verdict, that of each instant, values and their unit."""
    head = ("criterion", "verdict", "least", "largest", "instants exceeded", "undecided")
    rows = []
    for name, verdict, codes, values, unit in columns:
        ends = ["–", "–"]
        if (known := values[np.isfinite(values)]).size:
            ends = [figure(float(known.min()), unit), figure(float(known.max()), unit)]
        counts = [str(int((codes == code).sum())) for code in (EXCEEDED, UNDECIDED)]
        rows.append((name, tag("span", _mark(verdict), WORD[verdict]), *ends, *counts))
    return tag("div", table(head, rows))


def criteria_html(title: str, counts: str, criteria: Iterable[CriterionInfo]) -> Html:
    """What a workstation judges, before any run."""
    rows = [(c.name, c.kind, ", ".join(c.subjects), _limit(c)) for c in criteria]
    return tag("div", tag("p", f"{title}: {counts}"), table(("criterion", "kind", "of", "limit"), rows))


def _limit(criterion: CriterionInfo) -> str:
    if criterion.limit is None:
        return "–"
    return f"{'at most' if criterion.at_most else 'at least'} {criterion.limit:g} {criterion.unit}".rstrip()


def _row(series: Series) -> tuple[Html | str, ...]:
    verdict = tag("span", _mark(series.verdict), WORD[series.verdict])
    if not series.known:
        return series.name, verdict, "–", "–", "–", "never gave a result"
    worst = series.worst()
    at = "–" if worst.t is None else f"{worst.t:.2f} s"
    known = "; ".join(filter(None, (worst.reason, covered(series))))
    return series.name, verdict, extremum(worst, series), bound(worst, series), at, known


def _mark(verdict: Verdict | None) -> Html:
    return tag("b", f"{MARK[verdict]} ", style=f"color:{DARK_HEX[verdict]}")


if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plotted(columns: Sequence[CriterionSeries]) -> Figure:
    """One axis per criterion, below each other.

    Raises:
        MissingPackage: matplotlib is not installed.
    """
    need("matplotlib")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    class Shown(Figure):
        """A figure that notebooks show without a back end being chosen."""

        def _repr_png_(self) -> bytes:
            out = io.BytesIO()
            self.savefig(out, format="png", dpi=110)
            return out.getvalue()

    figure = Shown(figsize=(9, 0.6 + 1.7 * max(len(columns), 1)), layout="constrained")
    FigureCanvasAgg(figure)  # type: ignore[no-untyped-call, unused-ignore]
    if columns:
        every: Any = figure.subplots(len(columns), sharex=True, squeeze=False)
        for axes, one in zip(every[:, 0], columns, strict=True):
            _draw(axes, one)
        every[-1, 0].set_xlabel("t [s]")
    return figure


def _draw(axes: Axes, one: CriterionSeries) -> None:
    alone = len(one.t) == 1
    axes.plot(one.t, one.values, color=DARK_HEX[None], linewidth=1.2, marker="o" if alone else "")
    axes.plot(one.t, one.limits, color="black", linestyle="--", linewidth=1, marker="_" if alone else "")
    for verdict, hatch in _HATCH.items():
        for begin, end in _stretches(one, verdict):
            axes.axvspan(begin, end, facecolor=HEX[verdict], alpha=0.5, hatch=hatch, linewidth=0)
    title = f"{one.name}: {MARK[one.verdict]} {WORD[one.verdict]}"
    # A name may hold what matplotlib would set as mathematics.
    axes.set_title(title, loc="left", fontsize=9, color=DARK_HEX[one.verdict], parse_math=False)
    axes.set_ylabel(f"[{one.unit}]" if one.unit else "", fontsize=8, parse_math=False)
    axes.tick_params(labelsize=8)
    axes.margins(x=0)


def _stretches(one: CriterionSeries, verdict: Verdict) -> list[tuple[float, float]]:
    """Where it has a verdict [s], from its first such instant to the one that ends it."""
    hit = np.concatenate([[False], one.codes == CODES[verdict], [False]])
    edges = np.flatnonzero(hit[1:] != hit[:-1])
    last = len(one.t) - 1
    ends = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(float(one.t[a]), float(one.t[min(b, last)])) for a, b in ends]
