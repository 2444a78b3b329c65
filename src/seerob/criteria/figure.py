"""What a criterion computes, and the one place where that becomes a verdict.

A criterion computes figures: of one instant as numbers, of N instants as arrays by the same function. What
they say against the limit is decided here, for both. Words and drawings are made of one instant, once its
verdict is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from msgspec import Struct

from seerob.core.markers import Marker, drawn
from seerob.core.snapshot import Result
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict, judge, judge_interval
from seerob.recording.answers import Answers, Flags
from seerob.recording.series import CODES

if TYPE_CHECKING:
    from seerob.twin.state import State
    from seerob.twin.states import States

_WITHIN, _EXCEEDED, _UNDECIDED = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED
Twin: TypeAlias = "State | States"
"""The twin at one instant, or at N; accessors of both have the same names, with instants in front."""


class Figure(Struct, frozen=True, eq=False):
    """What a criterion computes of one instant; of N instants each figure has the shape (N,)."""

    value: float | Array | None
    """In the criterion's unit. None, or NaN of many instants, where there is none; infinite, which is not
    shown, where it is beyond any limit."""
    limit: float | Array | None = None
    """Admissible value; None where there is none."""
    interval: tuple[float | Array, float | Array] | None = None
    """Where the true value lies, as far as tolerances are known: that decides, then."""
    nothing: bool | Flags = False
    """Whether there is nothing to judge, and `Shown.reason` says why."""
    exceeded: bool | Flags = False
    """Whether a limit is exceeded whatever the value, which is a bound."""
    open: bool | Flags = False
    """Whether more may be than what is known: it may exceed, and is never within."""
    beside: Any = None
    """What computing it found besides, for `Criterion.present`: where, in which direction."""

    @property
    def number(self) -> float:
        """The value of one instant; NaN where there is none."""
        return math.nan if self.value is None else float(self.value)


class Shown(NamedTuple):
    """What is said and drawn of one instant, beside its figure."""

    reason: str = ""
    """Why it is undecided, or what governs."""
    draw: Callable[[], tuple[Marker, ...]] | None = None
    """Draws it from copies, maybe ticks later."""
    parts: tuple[Result, ...] = ()


Compute = Callable[[Twin], Figure]
"""May raise `Undecided`; of many instants, that is said of all of them."""
Present = Callable[["State", Figure, Verdict | None], Shown]
"""Called with what was computed of a state, and with what that says."""


def verdict_of(figure: Figure, *, at_most: bool) -> Verdict | None:
    """Verdict of a figure of one instant."""
    limit, value = figure.limit, figure.value
    assert not isinstance(limit, np.ndarray)
    if figure.nothing:
        return None
    if limit is not None and figure.exceeded:
        return _EXCEEDED
    if value is None or math.isnan(value):
        return _UNDECIDED
    if figure.interval is not None:
        low, high = figure.interval
        verdict = judge_interval((float(low), float(high)), limit, at_most=at_most)
    else:
        verdict = judge(float(value), limit, at_most=at_most)
    return _UNDECIDED if verdict is _WITHIN and figure.open else verdict


def result_of(figure: Figure, verdict: Verdict | None, shown: Shown, result: Result) -> Result:
    """Make the result of one instant from its figure.

    Args:
        figure: As computed.
        verdict: Of it.
        shown: What is said and drawn of it.
        result: What is the same at all instants: name, unit, side of the limit.
    """
    value = None if figure.value is None else float(figure.value)
    known, interval = None if value is None or math.isinf(value) else value, None
    if figure.interval is not None:
        low, high = figure.interval
        interval = (float(low), float(high)) if low < high else None
    assert not isinstance(figure.limit, np.ndarray)
    return Result(
        name=result.name,
        value=known,
        unit=result.unit,
        limit=figure.limit,
        at_most=result.at_most,
        verdict=verdict,
        reason=shown.reason,
        interval=interval,
        nothing=bool(figure.nothing) or (verdict is None and known is None),
        parts=shown.parts,
        markers=() if shown.draw is None else drawn(shown.draw),
    )


def answers_of(figure: Figure, n: int, *, at_most: bool) -> Answers:
    """Judge figures of N instants, by the same rules as `verdict_of` and `result_of`."""

    def each(given: float | Array | None) -> Array:
        return np.broadcast_to(np.asarray(np.nan if given is None else given, float), (n,))

    limit = None if figure.limit is None else each(figure.limit)
    found = Answers.against(each(figure.value), limit, at_most=at_most)
    if figure.interval is not None:
        low, high = map(each, figure.interval)
        if not ((low == high) & (low == found.value)).all():  # also where one is not a number
            found = found.between(low, high, at_most=at_most)
    unknown = np.isnan(found.value)
    found = replace(found, verdict=np.where(unknown, CODES[_UNDECIDED], found.verdict).astype(np.uint8))
    if limit is not None and np.any(figure.exceeded):
        found = found.exceeded(np.broadcast_to(figure.exceeded, (n,)))
    found = found.finite().open(figure.open) if np.any(figure.open) else found.finite()
    return found.without_verdict(np.broadcast_to(figure.nothing, (n,))) if np.any(figure.nothing) else found
