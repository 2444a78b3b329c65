"""What a notebook shows of a workstation and of a run: tables that stand alone, without styles or scripts."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from seerob.core.figures import figure
from seerob.core.snapshot import CriterionInfo, Verdict
from seerob.core.transforms import Array
from seerob.outputs.html import Html, table, tag
from seerob.outputs.palette import DARK_HEX, MARK, WORD
from seerob.outputs.sentences import bound, covered, extremum, percent
from seerob.recording.answers import EXCEEDED, UNDECIDED, Codes
from seerob.recording.result_log import ResultLog, Series

_HEAD = ("criterion", "verdict", "worst", "limit", "at", "what is known")


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
