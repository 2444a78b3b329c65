"""From spans of component scores to a score: worst side, what drives it, and what is not assessed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, cast

import numpy as np
from msgspec.structs import replace

from seerob.core.figures import whatever_is_missing
from seerob.core.snapshot import Highlight, Level, Result, Row, Verdict
from seerob.core.transforms import Array
from seerob.criteria.figure import Figure, Shown, verdict_of
from seerob.criteria.scoring.score_rows import (
    BONES_OF,
    Component,
    Edges,
    Ends,
    component_rows,
    components_of,
    total_row,
)
from seerob.criteria.scoring.spans import Ints, Span, Thresholds
from seerob.description.humans.angles import Angles
from seerob.description.humans.skeleton import SIDES
from seerob.recording.answers import Flags

Grand = Callable[[Mapping[str, Ints]], Ints]
"""Score of component scores; central components have a last axis of 1, sided ones of 2."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Method:
    """What a score is made by, and called."""

    grand: Grand
    least: Mapping[str, int]
    """Components and their least score."""
    most: Mapping[str, int]
    """Components and their greatest score."""
    edges: Callable[[Thresholds], Edges]
    """Bands of the angles: every angle and every threshold on which a component depends, by which what was
    scored is looked up again (`seerob.criteria.scoring.bands`)."""
    levels: Sequence[int]
    """Highest score of each action level."""
    actions: Sequence[str]
    first_level: int
    """Number of the first action level."""

    @property
    def scale(self) -> tuple[int, int]:
        """Best and worst score."""
        return 1, self.levels[-1]

    @property
    def classes(self) -> tuple[Level, ...]:
        """The action levels, the lowest first."""
        return tuple(
            Level(up_to=top, name=f"action level {self.first_level + k}") for k, top in enumerate(self.levels)
        )

    def level(self, score: float) -> str:
        """``action level 3: investigation …`` of a score."""
        k = int(np.searchsorted(self.levels, score))
        return f"action level {k + self.first_level}: {self.actions[k]}"


class Scored(NamedTuple):
    """What a score of one instant was made from."""

    angles: Angles | None
    """None where only the scores are kept."""
    components: Ends
    """Score of each component as it was measured."""
    spread: Ends | None
    """Score of each component when each angle may be off by its accuracy; None when that is not known."""


class Summed(NamedTuple):
    """Scores of both sides, and what is not known of them."""

    low: tuple[int, ...]
    """Least score of each side as it was measured."""
    high: tuple[int, ...]
    """Greatest score likewise."""
    least: tuple[int, ...]
    """Least score of each side within the accuracy."""
    most: tuple[int, ...]
    """Greatest score likewise."""
    missing: tuple[str, ...]
    """Components that are not assessed."""


@lru_cache(maxsize=4096)
def _summed(method: Method, measured: Ends, spread: Ends | None) -> Summed:
    """What follows from scores alone, which seldom change from one tick to the next."""
    low, high = _grand(method, measured)
    least, most = (low, high) if spread is None else _grand(method, spread)
    return Summed(low, high, least, most, tuple(key for key, lows, highs in measured if lows != highs))


def score(
    method: Method,
    angles: Angles,
    components: Mapping[str, Span],
    spread: Mapping[str, Span] | None,
    limit: int | None,
) -> Figure:
    """Score of one posture, or of N.

    Args:
        method: The rule.
        angles: Of the postures.
        components: Score of each component as it was measured: shape () of central ones and (2,) of sided
            ones; of N postures also (N, 1) and (N, 1, 2).
        spread: Likewise when each angle may be off by its accuracy; None when that is not known.
        limit: Greatest admissible score.

    Returns:
        The worse side gives the value. Open where a component is not assessed, so that only the best that
        it may be decides.
    """
    if angles.trunk_flexion.ndim:
        return _score_of_many(method, components, spread, limit)
    ends, wide = _ends(components), None if spread is None else _ends(spread)
    low, high, least, most, missing = _summed(method, ends, wide)
    return Figure(
        max(high) if max(low) == max(high) else None,
        limit,
        interval=None if wide is None and not missing else (max(least), max(most)),
        open=bool(missing),
        beside=Scored(angles, ends, wide),
    )


def of_posture(figure: Figure, angles: Angles | None) -> Figure:
    """Return the same score of one posture, of another one with the same component scores."""
    found: Scored = figure.beside
    return replace(figure, beside=Scored(angles, found.components, found.spread))


def _score_of_many(
    method: Method, components: Mapping[str, Span], spread: Mapping[str, Span] | None, limit: int | None
) -> Figure:
    measured = [_of_both_sides(method, components, end) for end in range(2)]
    reach = measured if spread is None else [_of_both_sides(method, spread, end) for end in range(2)]
    least, most = (ends.max(axis=-1)[:, 0].astype(float) for ends in measured)
    low, high = (ends.max(axis=-1)[:, 0].astype(float) for ends in reach)
    unknown = np.zeros((len(least), 1, 1), bool)
    for span in components.values():
        unknown = unknown | (_on_sides(span.low) != _on_sides(span.high)).any(axis=-1, keepdims=True)
    value = np.where(least == most, most, np.nan)
    return Figure(value, limit, interval=(low, high), open=unknown[:, 0, 0], exact=True)


def _of_both_sides(method: Method, components: Mapping[str, Span], end: int) -> Ints:
    return method.grand({key: _on_sides(span[end]) for key, span in components.items()})


def _on_sides(scores: Ints) -> Ints:
    """Central components get a last axis, so that they meet those of both sides."""
    return scores if scores.ndim % 2 else scores[..., None]


def together(parts: Sequence[tuple[Flags, Figure]]) -> Figure:
    """Scores of N instants from those of some of them each.

    Args:
        parts: Which of the N instants, shape (N,), and their scores.
    """
    every = [np.flatnonzero(where) for where, _ in parts]
    order = np.argsort(np.concatenate(every), kind="stable")

    def joined(columns: Sequence[Any]) -> Array:
        return np.asarray(np.concatenate(columns)[order])

    figures = [figure for _, figure in parts]
    ends = [figure.interval for figure in figures if figure.interval is not None]
    return replace(
        figures[0],
        value=joined([figure.value for figure in figures]),
        interval=(joined([low for low, _ in ends]), joined([high for _, high in ends])),
        open=joined([figure.open for figure in figures]),
        nothing=joined(
            [np.full(np.shape(low), figure.nothing) for figure, (low, _) in zip(figures, ends, strict=True)]
        ),
    )


def shown(
    method: Method,
    figure: Figure,
    verdict: Verdict | None,
    *,
    limit: int | None,
    human: str,
    thresholds: Thresholds,
) -> Shown:
    """What is said and coloured of one posture.

    Args:
        method: The rule.
        figure: From `score`.
        verdict: Of it.
        limit: Greatest admissible score.
        human: Whose bones are coloured.
        thresholds: For the bands that are shown.
    """
    angles, ends, wide = cast("Scored", figure.beside)
    assert angles is not None
    found = _said(method, human, limit, ends, wide, verdict)
    parts, rows = component_rows(_components(method, thresholds, human, ends, wide), angles)
    return replace(found, parts=(*found.parts, *parts), rows=(*found.rows, *rows))


@lru_cache(maxsize=4096)
def _said(
    method: Method,
    human: str,
    limit: int | None,
    measured: Ends,
    spread: Ends | None,
    verdict: Verdict | None,
) -> Shown:
    """What follows from scores alone, which seldom change from one tick to the next."""
    low, high, least, most, missing = _summed(method, measured, spread)
    value = max(high) if max(low) == max(high) else None
    sided = [
        Figure(
            high[i] if low[i] == high[i] else None, limit, interval=(least[i], most[i]), open=bool(missing)
        )
        for i in range(len(SIDES))
    ]
    verdicts = [verdict_of(one, at_most=True) for one in sided]
    # By what is known at least: what is not assessed drives nothing. Sides that are as bad both count.
    worst = [side for side in range(len(SIDES)) if low[side] == max(low)]
    drivers = {side: _drivers(method, _of_side(measured, side, LOW)) for side in worst}
    bones = [
        bone.format(side=SIDES[side])
        for side, keys in drivers.items()
        for key in keys
        for bone in BONES_OF.get(key, ())
    ]
    markers = tuple(Highlight(body=f"{human}/{bone}", verdict=verdict) for bone in dict.fromkeys(bones))
    shows = spread is not None or bool(missing)
    return Shown(
        _reason(method, measured, drivers, value, (max(least), max(most)), missing, verdict),
        lambda: markers,
        parts=tuple(
            Result(
                name=own,
                value=None if one.value is None else float(one.number),
                limit=limit,
                verdict=verdicts[i],
                reason="not assessed" if one.value is None else "",
                interval=(float(least[i]), float(most[i])) if shows else None,
            )
            for i, (own, one) in enumerate(zip(SIDES, sided, strict=True))
        ),
        rows=_totals(
            method, (low, high), None if spread is None else (least, most), limit, (*verdicts, verdict)
        ),
    )


@lru_cache(maxsize=4096)
def _components(
    method: Method, thresholds: Thresholds, human: str, measured: Ends, spread: Ends | None
) -> tuple[Component, ...]:
    """Scores of the components of postures in the same bands of the angles, made once for all of them."""
    return components_of(
        measured,
        spread,
        human=human,
        least=method.least,
        most=method.most,
        edges=method.edges(thresholds),
    )


Grands = tuple[tuple[int, ...], tuple[int, ...]]
"""Least score of each side, and greatest."""


def _totals(
    method: Method,
    measured: Grands,
    reach: Grands | None,
    limit: int | None,
    verdicts: Sequence[Verdict | None],
) -> tuple[Row, ...]:
    def ends(span: Grands, side: int) -> tuple[int, int]:
        low, high = span
        return (max(low), max(high)) if side == len(SIDES) else (low[side], high[side])

    return tuple(
        total_row(
            name,
            ends(measured, i),
            None if reach is None else ends(reach, i),
            method.scale,
            limit,
            verdicts[i],
        )
        for i, name in enumerate((*SIDES, ""))
    )


def _ends(components: Mapping[str, Span]) -> Ends:
    return tuple(
        (key, tuple(span.low.ravel().tolist()), tuple(span.high.ravel().tolist()))
        for key, span in components.items()
    )


def _grand(method: Method, components: Ends) -> Grands:
    low, high = (
        tuple(_score(method, _of_side(components, side, end)) for side in range(len(SIDES)))
        for end in (LOW, HIGH)
    )
    return low, high


Scores = tuple[tuple[str, int], ...]
"""Components of one side and their scores."""
LOW, HIGH = 1, 2


def _of_side(components: Ends, side: int, end: int) -> Scores:
    # What is not of a side counts on both.
    return tuple((str(each[0]), int(each[end][side % len(each[end])])) for each in components)


@lru_cache(maxsize=4096)
def _score(method: Method, scores: Scores) -> int:
    return int(method.grand({key: np.array([score]) for key, score in scores})[0])


@lru_cache(maxsize=4096)
def _drivers(method: Method, scores: Scores) -> tuple[str, ...]:
    """Components whose least score alone would lower the score most; all that are raised if none does."""
    raised = [key for key, score in scores if score > method.least[key]]
    variants = {
        key: np.array([score, *(method.least[key] if key == r else score for r in raised)])
        for key, score in scores
    }
    found = method.grand(variants)
    gains = found[0] - found[1:]
    best = int(gains.max(initial=0))
    return tuple(key for key, gain in zip(raised, gains, strict=True) if best in (0, gain))


def _reason(
    method: Method,
    components: Ends,
    drivers: Mapping[int, Sequence[str]],
    value: float | None,
    ends: tuple[int, int],
    missing: Sequence[str],
    verdict: Verdict | None,
) -> str:
    parts = []
    if missing:
        parts.append(f"not assessed: {', '.join(missing)}; {whatever_is_missing('score', *ends)}")
    elif verdict is Verdict.UNDECIDED:
        parts.append(f"the accuracy leaves it open: the score lies between {ends[0]} and {ends[1]}")
    said: dict[str, list[str]] = {}
    for side, keys in drivers.items():
        least = dict(_of_side(components, side, LOW))
        scores = ", ".join(f"{key} {least[key]}" for key in keys)
        if scores:
            said.setdefault(scores, []).append(SIDES[side])
    for scores, whose in said.items():
        parts.append(f"{whose[0]} side: {scores}" if len(whose) == 1 else f"both sides: {scores}")
    if value is not None:
        parts.append(method.level(value))
    return "; ".join(parts)
