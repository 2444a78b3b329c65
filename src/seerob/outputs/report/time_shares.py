"""How the scores of ergonomics rules are spread over the run, for the report and the workbook."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from seerob.core.figures import figure
from seerob.core.snapshot import CriterionInfo, Level
from seerob.outputs.html import Html, joined, table, tag
from seerob.outputs.sentences import percent
from seerob.outputs.words import said, told, word
from seerob.outputs.workbook import Cell
from seerob.recording.result_log import ResultLog
from seerob.recording.series import Series


class At(NamedTuple):
    """A value and when it was first reached [s]."""

    value: float
    t: float


class Share(NamedTuple):
    """How much of the evaluated time a level has."""

    name: str
    share: float
    """0…1 of all evaluated ticks, also of those without a value."""
    longest: float
    """Longest stretch without a break, from its first to its last tick [s]."""


class Distribution(NamedTuple):
    """One score over a run."""

    coverage: float
    """Share of the evaluated ticks that have a value, 0…1."""
    mean: float
    """Mean of the values that there are."""
    percentiles: tuple[tuple[int, At], ...]
    """50 and 95: the smallest value that so many per cent of the ticks with a value do not exceed."""
    minimum: At
    maximum: At
    levels: tuple[Share, ...]
    """Share of each level, the lowest first, then of what was not assessed."""


def distribution(series: Series, levels: Sequence[Level] = ()) -> Distribution | None:
    """How a series is spread; None when it never had a value.

    Args:
        series: Of scores; every evaluated tick has the same weight.
        levels: The lowest first; a value belongs to the first level that reaches up to it.
    """
    n = len(series)
    t, values = series.t[:n], series.values[:n]
    known = ~np.isnan(values)
    if not known.any():
        return None
    there, when = values[known], t[known]

    def first(value: float) -> At:
        return At(float(value), float(when[int(np.argmax(there == value))]))

    ordered = np.sort(there)
    percentiles = tuple(
        (p, first(ordered[max(math.ceil(p / 100 * len(ordered) - 1e-9) - 1, 0)])) for p in (50, 95)
    )
    shares, below = [], np.zeros(n, bool)
    for level in levels:
        inside = known & ~below & (np.nan_to_num(values, nan=np.inf) <= level.up_to)
        below |= inside
        shares.append(Share(level.name, float(inside.mean()), _longest(t, inside)))
    if levels and (known & ~below).any():
        beyond = known & ~below
        shares.append(Share(word("beyond"), float(beyond.mean()), _longest(t, beyond)))
    if levels and not known.all():
        shares.append(Share(word("not assessed"), float((~known).mean()), _longest(t, ~known)))
    return Distribution(
        coverage=float(known.mean()),
        mean=float(there.mean()),
        percentiles=percentiles,
        minimum=first(there.min()),
        maximum=first(there.max()),
        levels=tuple(shares),
    )


def _longest(t: np.ndarray[tuple[int], np.dtype[np.float64]], inside: np.ndarray) -> float:
    hit = np.concatenate([[False], inside, [False]])
    edges = np.flatnonzero(hit[1:] != hit[:-1])
    return max((float(t[b - 1] - t[a]) for a, b in zip(edges[::2], edges[1::2], strict=True)), default=0.0)


HEAD: list[Cell] = [
    "criterion", "part", "coverage [%]", "what", "value", "first at [s]", "share of time [%]",
    "longest stretch [s]",
]  # fmt: skip

_WHOLE = ("", "right", "left")
"""Parts whose values have the levels of the rule."""
_FEW = 12
"""A component with more values than this has no scores, but a measure."""


def spread_over_time(info: CriterionInfo | None, series: Series) -> Html | None:
    """Shares, percentiles and extremes of one rule; nothing for what is no ergonomics rule."""
    found = None if info is None or info.group != "ergonomics" else distribution(series, info.levels)
    if found is None or info is None:
        return None
    marks = [(f"P{p}", at) for p, at in found.percentiles]
    rows = [
        [said(name), figure(at.value, series.unit), f"{at.t:.2f} s"]
        for name, at in ((word("least"), found.minimum), *marks, (word("largest"), found.maximum))
    ]
    levels = [[told(s.name), percent(s.share), f"{s.longest:.2f} s"] for s in found.levels]
    return joined(
        [
            tag("h4", said("Over time")),
            table(["", said("value"), said("first at")], rows),
            table([said("level"), said("share of time"), said("longest stretch")], levels)
            if levels
            else None,
            tag(
                "p",
                said(
                    "Coverage {share} of the evaluated ticks; their mean, {mean}, hides what stands above.",
                    share=percent(found.coverage),
                    mean=figure(found.mean, series.unit),
                ),
                class_="lead",
            ),
        ]
    )


def time_rows(log: ResultLog, infos: dict[str, CriterionInfo]) -> Iterator[list[Cell]]:
    """Rows of a sheet: for each ergonomics rule, side and component its levels, percentiles and extremes."""
    for name, info in infos.items():
        series = log.get(name)
        if info.group != "ergonomics" or series is None:
            continue
        for part, one in {"": series, **series.parts}.items():
            found = distribution(one, info.levels if part in _WHOLE else _scores(one))
            if found is None:
                yield [name, part, 0.0, "never assessed", None, None, None, None]
                continue
            covered = 100 * found.coverage
            marks = [("least", found.minimum), *((f"P{p}", at) for p, at in found.percentiles)]
            for what, at in (*marks, ("largest", found.maximum)):
                yield [name, part, covered, what, at.value, at.t, None, None]
            yield [name, part, covered, "mean, beside the others", found.mean, None, None, None]
            for level in found.levels:
                yield [name, part, covered, level.name, None, None, 100 * level.share, level.longest]


def _scores(series: Series) -> tuple[Level, ...]:
    """The scores that a component had, the lowest first; none when its values are no scores."""
    values = np.unique(series.values[~np.isnan(series.values)])
    if len(values) > _FEW or not np.array_equal(values, np.round(values)):
        return ()
    return tuple(Level(up_to=float(value), name=f"score {value:.0f}") for value in values)
