"""Criteria over time as figures of matplotlib, for notebooks and papers."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from seerob.core.extras import need
from seerob.core.snapshot import Verdict
from seerob.outputs.palette import DARK_HEX, HEX, MARK, WORD
from seerob.recording.frames import CriterionSeries
from seerob.recording.series import CODES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HATCH = {Verdict.EXCEEDED: "", Verdict.UNDECIDED: "////"}


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
