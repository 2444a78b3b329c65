"""How a score is spread over a run: share of time per level, percentiles and the maximum with their instants.

A mean hides the minutes that matter, so there is none here without what it hides beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seerob.core.snapshot import Level
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
        shares.append(Share("beyond", float(beyond.mean()), _longest(t, beyond)))
    if levels and not known.all():
        shares.append(Share("not assessed", float((~known).mean()), _longest(t, ~known)))
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
