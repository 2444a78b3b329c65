"""From spans of component scores to a `Result`: worst side, what drives it, and what is not assessed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from seerob.core.figures import whatever_is_missing
from seerob.core.snapshot import Highlight, Level, Result, Row, Verdict
from seerob.core.verdict import judge, judge_interval
from seerob.criteria.scoring.score_rows import ANGLES_OF, BONES_OF, Edges, component_rows, total_row
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
    sides = {key: _both(span) for key, span in components.items()}
    measured = _grand(method, sides)
    reach = measured if spread is None else _grand(method, {key: _both(s) for key, s in spread.items()})
    missing = [key for key, span in sides.items() if not span.known]
    verdicts = [
        _verdict((int(reach.low[i]), int(reach.high[i])), limit, complete=not missing) for i in range(2)
    ]
    low, high = int(reach.low.max()), int(reach.high.max())
    verdict = _verdict((low, high), limit, complete=not missing)
    known = int(measured.low.max()) == int(measured.high.max())
    value = int(measured.high.max()) if known else None
    # By what is known at least: what is not assessed drives nothing. Sides that are as bad both count.
    worst = np.flatnonzero(measured.low == measured.low.max()).tolist()
    known_least = {key: span.low for key, span in sides.items()}
    drivers = {side: _drivers(method, _of_side(known_least, side)) for side in worst}
    reason = _reason(method, sides, drivers, value, (low, high), missing, verdict)
    bones = [
        bone.format(side=SIDES[side])
        for side, keys in drivers.items()
        for key in keys
        for bone in BONES_OF.get(key, ())
    ]
    shown = None if spread is None and not missing else (low, high)
    return Result(
        name=name,
        value=value,
        limit=limit,
        verdict=verdict,
        reason=reason,
        interval=shown,
        parts=(
            *(
                Result(
                    name=own,
                    value=float(measured.high[i]) if measured.low[i] == measured.high[i] else None,
                    limit=limit,
                    verdict=verdicts[i],
                    reason="not assessed" if measured.low[i] != measured.high[i] else "",
                    interval=None if shown is None else (float(reach.low[i]), float(reach.high[i])),
                )
                for i, own in enumerate(SIDES)
            ),
            *_parts(components, spread, angles),
        ),
        markers=tuple(Highlight(body=f"{human}/{bone}", verdict=verdict) for bone in dict.fromkeys(bones)),
        rows=(
            *_totals(method, measured, None if spread is None else reach, limit, (*verdicts, verdict)),
            *component_rows(
                components,
                spread,
                angles,
                human=human,
                least=method.least,
                most=method.most,
                edges=method.edges(thresholds),
            ),
        ),
    )


def _totals(
    method: Method,
    measured: Span,
    reach: Span | None,
    limit: int | None,
    verdicts: Sequence[Verdict | None],
) -> list[Row]:
    def ends(span: Span, side: int) -> tuple[int, int]:
        if side == len(SIDES):
            return int(span.low.max()), int(span.high.max())
        return int(span.low[side]), int(span.high[side])

    return [
        total_row(
            name,
            ends(measured, i),
            None if reach is None else ends(reach, i),
            method.scale,
            limit,
            verdicts[i],
        )
        for i, name in enumerate((*SIDES, ""))
    ]


def _both(span: Span) -> Span:
    """Central components get a last axis, so that they meet those of both sides."""
    return span if span.low.ndim else Span(span.low[None], span.high[None])


def _grand(method: Method, components: Mapping[str, Span]) -> Span:
    low, high = (
        np.array([_score(method, _of_side(ends, side)) for side in range(len(SIDES))], np.int64)
        for ends in (
            {key: span.low for key, span in components.items()},
            {key: span.high for key, span in components.items()},
        )
    )
    return Span(low, high)


Scores = tuple[tuple[str, int], ...]
"""Components of one side and their scores: they seldom change from one tick to the next."""


def _of_side(scores: Mapping[str, Ints], side: int) -> Scores:
    return tuple((key, int(score[side % len(score)])) for key, score in scores.items())


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
    sides: Mapping[str, Span],
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
        scores = ", ".join(f"{key} {sides[key].low[side % len(sides[key].low)]}" for key in keys)
        if scores:
            said.setdefault(scores, []).append(SIDES[side])
    for scores, whose in said.items():
        parts.append(f"{whose[0]} side: {scores}" if len(whose) == 1 else f"both sides: {scores}")
    if value is not None:
        parts.append(method.level(value))
    return "; ".join(parts)


def _parts(components: Mapping[str, Span], spread: Mapping[str, Span] | None, angles: Angles) -> list[Result]:
    found = []
    for key, span in components.items():
        wide = span if spread is None else spread[key]
        for i in range(max(1, span.low.size)):
            sided = bool(span.low.ndim)
            low, high = int(span.low.flat[i]), int(span.high.flat[i])
            ends = (float(wide.low.flat[i]), float(wide.high.flat[i]))
            shown = _shown(angles, ANGLES_OF.get(key, ()), i if sided else None)
            found.append(
                Result(
                    name=f"{SIDES[i]} {key}" if sided else key,
                    value=float(low) if low == high else None,
                    verdict=None if low == high else Verdict.UNDECIDED,
                    reason=shown if low == high else "; ".join(filter(None, ("not assessed", shown))),
                    interval=None if spread is None and low == high else ends,
                )
            )
    return found


def _shown(angles: Angles, names: Sequence[str], side: int | None) -> str:
    words = []
    for name in names:
        values = getattr(angles, name).tolist()
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
