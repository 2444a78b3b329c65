"""From spans of component scores to a `Result`: worst side, what drives it, and what is not assessed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from msgspec.structs import replace

from seerob.core.figures import whatever_is_missing
from seerob.core.snapshot import Highlight, Level, Result, Row, Verdict
from seerob.core.verdict import judge, judge_interval
from seerob.criteria.scoring.score_rows import (
    ANGLES_OF,
    BONES_OF,
    Edges,
    Ends,
    component_rows,
    total_row,
)
from seerob.criteria.scoring.spans import Ints, Span, Thresholds
from seerob.description.humans.angles import SIDED, Angles
from seerob.description.humans.skeleton import SIDES

Grand = Callable[[Mapping[str, Ints]], Ints]
"""Score of component scores; central components have a last axis of 1, sided ones of 2."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Method:
    """What `judged` needs to know of a rule."""

    grand: Grand
    least: Mapping[str, int]
    """Components and their least score."""
    most: Mapping[str, int]
    """Components and their greatest score."""
    edges: Callable[[Thresholds], Edges]
    """Bands of the angles."""
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


def judged(
    method: Method,
    *,
    name: str,
    human: str,
    limit: int | None,
    angles: Angles,
    components: Mapping[str, Span],
    spread: Mapping[str, Span] | None,
    thresholds: Thresholds,
) -> Result:
    """The result of a rule at one instant.

    Args:
        method: The rule.
        name: Of the result.
        human: Whose bones are coloured.
        limit: Greatest admissible score.
        angles: Of the posture, to be shown.
        components: Score of each component as it was measured.
        spread: The same when each angle may be off by its accuracy; None when that is not known.
        thresholds: For the bands that are shown.

    Returns:
        The worse side gives the value. Undecided when a component is not assessed, unless even the
        best that it may be exceeds the limit; and when the accuracy leaves it open.
    """
    ends, wide = _ends(components), None if spread is None else _ends(spread)
    found = _scored(method, name, human, limit, ends, wide)
    edges = _edges(method, thresholds)
    return replace(
        found,
        parts=(*found.parts, *_parts(ends, wide, angles)),
        rows=(
            *found.rows,
            *component_rows(
                ends, wide, angles, human=human, least=method.least, most=method.most, edges=edges
            ),
        ),
    )


@lru_cache(maxsize=4096)
def _scored(
    method: Method, name: str, human: str, limit: int | None, measured: Ends, spread: Ends | None
) -> Result:
    """What of a result follows from scores alone, which seldom change from one tick to the next."""
    low, high = _grand(method, measured)
    least, most = (low, high) if spread is None else _grand(method, spread)
    missing = [key for key, lows, highs in measured if lows != highs]
    verdicts = [_verdict((least[i], most[i]), limit, complete=not missing) for i in range(len(SIDES))]
    whole = max(least), max(most)
    verdict = _verdict(whole, limit, complete=not missing)
    value = max(high) if max(low) == max(high) else None
    # By what is known at least: what is not assessed drives nothing. Sides that are as bad both count.
    worst = [side for side in range(len(SIDES)) if low[side] == max(low)]
    drivers = {side: _drivers(method, _of_side(measured, side, LOW)) for side in worst}
    reason = _reason(method, measured, drivers, value, whole, missing, verdict)
    bones = [
        bone.format(side=SIDES[side])
        for side, keys in drivers.items()
        for key in keys
        for bone in BONES_OF.get(key, ())
    ]
    shown = spread is not None or bool(missing)
    reach = None if spread is None else (least, most)
    return Result(
        name=name,
        value=value,
        limit=limit,
        verdict=verdict,
        reason=reason,
        interval=whole if shown else None,
        parts=tuple(
            Result(
                name=own,
                value=float(high[i]) if low[i] == high[i] else None,
                limit=limit,
                verdict=verdicts[i],
                reason="not assessed" if low[i] != high[i] else "",
                interval=(float(least[i]), float(most[i])) if shown else None,
            )
            for i, own in enumerate(SIDES)
        ),
        markers=tuple(Highlight(body=f"{human}/{bone}", verdict=verdict) for bone in dict.fromkeys(bones)),
        rows=_totals(method, (low, high), reach, limit, (*verdicts, verdict)),
    )


@lru_cache(maxsize=64)
def _edges(method: Method, thresholds: Thresholds) -> Edges:
    return method.edges(thresholds)


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


def _verdict(interval: tuple[int, int], limit: int | None, *, complete: bool) -> Verdict | None:
    verdict = judge_interval(interval, limit)
    if complete or judge(interval[0], limit) is Verdict.EXCEEDED:
        return verdict
    return Verdict.UNDECIDED


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


def _parts(components: Ends, spread: Ends | None, angles: Angles) -> list[Result]:
    found = []
    for (key, lows, highs), (_, least, most) in zip(components, spread or components, strict=True):
        sided = len(lows) > 1
        for i, (low, high) in enumerate(zip(lows, highs, strict=True)):
            shown = _shown(angles, ANGLES_OF.get(key, ()), i if sided else None)
            found.append(
                Result(
                    name=f"{SIDES[i]} {key}" if sided else key,
                    value=float(low) if low == high else None,
                    verdict=None if low == high else Verdict.UNDECIDED,
                    reason=shown if low == high else "; ".join(filter(None, ("not assessed", shown))),
                    interval=None if spread is None and low == high else (float(least[i]), float(most[i])),
                )
            )
    return found


def _shown(angles: Angles, names: Sequence[str], side: int | None) -> str:
    words = []
    for name in names:
        values = angles.listed[name]
        label = name.replace("_", " ")
        if side is not None and name in SIDED:
            words.append(f"{label} {_degrees(values[side])}")
        elif name in SIDED:
            words += [f"{own} {label} {_degrees(x)}" for own, x in zip(SIDES, values, strict=True)]
        else:
            words.append(f"{label} {_degrees(values)}")
    return ", ".join(words)


def _degrees(angle: float) -> str:
    return "not measured" if math.isnan(angle) else f"{round(math.degrees(angle))}°"
