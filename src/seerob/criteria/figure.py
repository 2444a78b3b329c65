"""What a criterion computes, and the one place where that becomes a verdict.

A criterion computes figures: of one instant as numbers, of N instants as arrays by the same function. What
they say against the limit is decided here, for both. Words and drawings are made of one instant, once its
verdict is known.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import repeat
from math import isinf, isnan
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from msgspec import Struct, structs
from numpy.typing import NDArray

from seerob.core.markers import Marker, drawn
from seerob.core.snapshot import Result, Row
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING, Verdict, judge_interval, keeps, worst
from seerob.kernels.verdicts import Codes, answered, judged, judged_many
from seerob.recording.answers import Answers, Flags
from seerob.recording.series import CODES

if TYPE_CHECKING:
    from seerob.twin.state import State
    from seerob.twin.states import States

_WITHIN, _EXCEEDED, _UNDECIDED = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED
_VERDICTS = {code: verdict for verdict, code in CODES.items()}
_RANKS = np.zeros(max(CODES.values()) + 1, np.int64)
"""By code of a verdict: the higher, the worse."""
_RANKS[[CODES[each] for each in (None, _WITHIN, _UNDECIDED, _EXCEEDED)]] = range(4)
Twin: TypeAlias = "State | States"
"""The twin at one instant, or at N; accessors of both have the same names, with instants in front."""


class Parts(Struct, eq=False):
    """Figures of n parts of a whole, each against its own limit; of N instants with these in front.

    A criterion computes them. What they say is written here by who judges, of one instant.
    """

    names: Sequence[str]
    """Of the results of the parts."""
    value: Array
    """Shape (..., n)."""
    limit: Array
    """Shape (..., n); NaN where nobody knows it, which is undecided."""
    interval: tuple[Array, Array] | None = None
    """Where the true values lie, shape (..., n) each."""
    open: bool | Flags = False
    """Whether more may be than what is known, shape (...): then none of them is within."""
    unsure: Flags | None = None
    """Which may be more than what is known of them, shape (..., n): they are not within."""
    exceeded: Flags | None = None
    """Which exceed whatever their value, as what nobody may touch, shape (..., n)."""
    informs: Flags | None = None
    """Which nobody judges, shape (..., n): they have no verdict."""
    units: Sequence[str] | None = None
    """Of each; that of the criterion when not given."""
    whole: bool = True
    """Whether the worst of them is the whole: its value, its limit and its interval."""
    verdicts: Sequence[Verdict | None] = ()
    """Of each."""
    governs: int = 0
    """Which is the worst: of those with the worst verdict the nearest to its limit, or farthest beyond."""

    @property
    def qualified(self) -> bool:
        """Whether something is said of some of them."""
        return not (self.unsure is self.exceeded is self.informs is None)


class Figure(Struct, frozen=True, eq=False):
    """What a criterion computes of one instant; of N instants each figure has the shape (N,)."""

    value: float | int | Array | None
    """In the criterion's unit, a count as ``int``. None, or NaN of many instants, where there is none;
    infinite, which is not shown, where it is beyond any limit."""
    limit: float | Array | None = None
    """Admissible value; None where there is none."""
    interval: tuple[float | Array, float | Array] | None = None
    """Where the true value lies, as far as tolerances are known: that decides, then. It is shown where its
    ends are finite and differ, or are whole numbers."""
    nothing: bool | Flags = False
    """Whether there is nothing to judge, and `Shown.reason` says why."""
    exceeded: bool | Flags = False
    """Whether a limit is exceeded whatever the value, which is a bound."""
    open: bool | Flags = False
    """Whether more may be than what is known: it may exceed, and is never within."""
    exact: bool = False
    """Whether values and intervals of N instants are whole numbers, as an ``int`` of one instant is."""
    undecided: bool | Flags = False
    """Whether nobody may say whether it keeps its limit, whatever it is."""
    parts: Parts | None = None
    """No better than the worst of them is the whole."""
    beside: Any = None
    """What computing it found besides, for `Criterion.present`: where, in which direction."""

    @property
    def number(self) -> float:
        """The value of one instant; NaN where there is none."""
        return math.nan if self.value is None else float(self.value)


class Shown(Struct, frozen=True, eq=False):
    """What is said and drawn of one instant, beside its figure."""

    reason: str = ""
    """Why it is undecided, or what governs."""
    draw: Callable[[], tuple[Marker, ...]] | None = None
    """Draws it from copies, maybe ticks later."""
    parts: tuple[Result, ...] = ()
    """Figures that are shown beside those that are judged (`Figure.parts`), after them."""
    where: Sequence[str] | None = None
    """What is said of each of `Figure.parts`."""
    beneath: Sequence[tuple[Result, ...]] | None = None
    """Figures that are shown beneath each of `Figure.parts`."""
    rows: tuple[Row, ...] = ()
    """Of the places of a person's body."""


Compute = Callable[[Twin], Figure]
"""May raise `Undecided`; of many instants, that is said of all of them."""
Present = Callable[["State", Figure, Verdict | None], Shown]
"""Called with what was computed of a state, and with what that says."""


def verdict_of(figure: Figure, *, at_most: bool) -> Verdict | None:
    """Verdict of a figure of one instant, and of its parts, which is written into these."""
    if figure.parts is not None:
        return _verdict_of_parts(figure, figure.parts, at_most=at_most)
    if figure.nothing:
        return None
    limit: Any
    limit, value, interval = figure.limit, figure.value, figure.interval
    if limit is not None and (figure.exceeded or figure.undecided):
        return _UNDECIDED if figure.undecided else _EXCEEDED
    unknown = value is None or isnan(value)
    if interval is None:
        if unknown:
            return _UNDECIDED
        if limit is None:
            return None
        number: Any = value
        if type(number) is not int and type(number) is not float:
            number = float(number)
        verdict: Verdict | None = _WITHIN if keeps(number, limit, at_most=at_most) else _EXCEEDED
    else:
        low, high = interval
        if type(low) is not float and type(low) is not int:
            low = float(low)
        if type(high) is not float and type(high) is not int:
            high = float(high)
        verdict = judge_interval((low, high), limit, at_most=at_most)
        if unknown:  # wherever it lies in there
            informs = verdict is None and not figure.open
            return verdict if informs or verdict is _EXCEEDED else _UNDECIDED
    # Nothing could exceed a limit without end.
    if verdict is _WITHIN and (figure.open or limit is None or isinf(limit)):
        return _UNDECIDED
    return verdict


def _verdict_of_parts(figure: Figure, parts: Parts, *, at_most: bool) -> Verdict | None:
    low, high = parts.interval or (parts.value, parts.value)
    codes = np.empty(len(parts.limit), np.uint8)
    parts.governs = k = judged(
        parts.value, low, high, parts.limit, ROUNDING, at_most, bool(parts.open), codes
    )
    if parts.qualified:
        parts.governs = k = int(_said_of_each(parts, codes, at_most=at_most))
    parts.verdicts = verdicts = list(map(_VERDICTS.__getitem__, codes.tolist()))
    if parts.whole:
        return verdicts[k]
    return worst([verdicts[k], verdict_of(structs.replace(figure, parts=None), at_most=at_most)])


def _said_of_each(parts: Parts, codes: Codes, *, at_most: bool) -> NDArray[np.int64]:
    """Write what is said of some parts into their verdicts, shape (..., n), and find which one governs.

    One without a limit is the worst of its verdict: nothing is permitted, or known to be.
    """
    if parts.unsure is not None:
        codes[parts.unsure & (codes == CODES[_WITHIN])] = CODES[_UNDECIDED]
    if parts.exceeded is not None:
        codes[parts.exceeded] = CODES[_EXCEEDED]
    if parts.informs is not None:
        codes[parts.informs] = CODES[None]
    rank = _RANKS[codes]
    room = parts.limit - parts.value if at_most else parts.value - parts.limit
    room = np.where(np.isnan(room), -np.inf, np.minimum(room, sys.float_info.max))
    worst = rank == rank.max(axis=-1, keepdims=True)
    return np.asarray(np.where(worst, room, np.inf).argmin(axis=-1))


def result_of(figure: Figure, verdict: Verdict | None, shown: Shown, result: Result) -> Result:
    """Make the result of one instant from its figure.

    Args:
        figure: As computed.
        verdict: Of it.
        shown: What is said and drawn of it.
        result: What is the same at all instants: name, unit, side of the limit.
    """
    limit: Any
    value, limit, nothing = figure.value, figure.limit, figure.nothing
    parts, draw = shown.parts, shown.draw
    interval: tuple[float, float] | None = None
    if type(value) is not float and type(value) is not int and value is not None:
        value = float(value)
    if figure.interval is not None:
        low, high = figure.interval
        if type(low) is type(high) is int:
            interval = (low, high)
        elif -math.inf < low < high < math.inf:
            interval = (float(low), float(high))
    if figure.parts is not None:
        told = _part_results(figure.parts, shown, result)
        parts = (*told, *parts)
        if figure.parts.whole:
            governs = told[figure.parts.governs]
            value, limit, interval = governs.value, governs.limit, governs.interval
    if value is None:
        # Where a value lies informs, too.
        nothing = nothing or (verdict is None and interval is None)
    elif isinf(value):
        value, nothing = None, nothing or verdict is None
    return Result(
        name=result.name,
        value=value,
        unit=result.unit,
        limit=limit,
        at_most=result.at_most,
        verdict=verdict,
        reason=shown.reason,
        interval=interval,
        nothing=bool(nothing),
        parts=parts,
        rows=shown.rows,
        markers=() if draw is None else drawn(draw),
    )


def _part_results(parts: Parts, shown: Shown, result: Result) -> list[Result]:
    unit, at_most = result.unit, result.at_most
    ends: Iterable[tuple[float, float] | None] = repeat(None)
    limits = parts.limit.tolist()
    if math.isnan(sum(limits)):
        limits = [None if math.isnan(limit) else limit for limit in limits]
    if parts.interval is not None:
        low, high = parts.interval
        both = zip(low.tolist(), high.tolist(), strict=True)
        ends = (None if math.isnan(least) else (least, most) for least, most in both)
    every = zip(
        parts.names,
        parts.value.tolist(),
        parts.units or repeat(unit),
        limits,
        parts.verdicts,
        ends,
        shown.where or repeat(""),
        shown.beneath or repeat(()),
        strict=False,
    )
    return [
        Result(
            name=name,
            value=value,
            unit=own,
            limit=limit,
            at_most=at_most,
            verdict=verdict,
            interval=interval,
            reason=reason,
            parts=beneath,
        )
        for name, value, own, limit, verdict, interval, reason, beneath in every
    ]


def answers_of(figure: Figure, n: int, *, at_most: bool) -> Answers:
    """Judge figures of N instants, by the same rules as `verdict_of` and `result_of`."""

    def each(given: float | Array | None) -> Array:
        return np.broadcast_to(np.asarray(np.nan if given is None else given, float), (n,))

    if figure.parts is not None:
        return _answers_of_parts(figure.parts, at_most=at_most)
    if figure.interval is None:
        return _answers_of_values(figure, n, at_most=at_most)
    limit = None if figure.limit is None else each(figure.limit)
    found = Answers.against(each(figure.value), limit, at_most=at_most, exact=figure.exact)
    low, high = map(each, figure.interval)
    if not ((low == high) & (low == found.value)).all():  # also where one is not a number
        found = found.between(low, high, at_most=at_most)
    unknown, silent = np.isnan(found.value), np.zeros(n, bool)
    verdict = np.where(unknown & (found.verdict != CODES[_EXCEEDED]), CODES[_UNDECIDED], found.verdict)
    if limit is None and found.interval is not None:  # it informs of where the value lies
        known = ~np.isnan(found.interval).any(axis=0) & ~np.asarray(figure.open)
        verdict = np.where(unknown & known, CODES[None], verdict)
        low, high = found.interval
        shown = np.isfinite(low) & np.isfinite(high) & ((low < high) | figure.exact)
        silent = unknown & known & ~shown
    found = replace(found, verdict=verdict.astype(np.uint8))
    if silent.any():
        found = found.without_verdict(silent)
    if limit is not None and np.any(figure.exceeded):
        found = found.exceeded(np.broadcast_to(figure.exceeded, (n,)))
    if limit is not None and np.any(figure.undecided):
        codes = np.where(figure.undecided, CODES[_UNDECIDED], found.verdict)
        found = replace(found, verdict=codes.astype(np.uint8))
    open_ = figure.open if limit is None else figure.open | np.isinf(limit)
    found = found.finite().open(open_) if np.any(open_) else found.finite()
    return found.without_verdict(np.broadcast_to(figure.nothing, (n,))) if np.any(figure.nothing) else found


def _answers_of_values(figure: Figure, n: int, *, at_most: bool) -> Answers:
    """Judge figures of N instants of which no interval is known."""
    value, limit = (np.full(n, np.nan if given is None else given) for given in (figure.value, figure.limit))
    open_, nothing = (np.full(n, given, np.bool_) for given in (figure.open, figure.nothing))
    verdicts, shown, idle = np.empty(n, np.uint8), np.empty(n), np.empty(n, np.bool_)
    limited = figure.limit is not None
    answered(
        value.astype(float, copy=False), limit.astype(float, copy=False), limited, ROUNDING, at_most,
        figure.exact, open_, nothing, verdicts, shown, idle,
    )  # fmt: skip
    for given, verdict in ((figure.exceeded, _EXCEEDED), (figure.undecided, _UNDECIDED)):
        if limited and np.any(given):
            verdicts[given & ~nothing] = CODES[verdict]
    return Answers(shown, limit, verdicts, None, idle, figure.exact)


def _answers_of_parts(parts: Parts, *, at_most: bool) -> Answers:
    assert parts.whole
    value, limit = np.ascontiguousarray(parts.value), np.ascontiguousarray(parts.limit)
    low, high = (value, value) if parts.interval is None else map(np.ascontiguousarray, parts.interval)
    verdicts, governs = np.empty(value.shape, np.uint8), np.empty(len(value), np.int64)
    open_ = np.broadcast_to(np.asarray(parts.open), len(value)).copy()
    judged_many(value, low, high, limit, ROUNDING, at_most, open_, verdicts, governs)
    if parts.qualified:
        governs = _said_of_each(parts, verdicts, at_most=at_most)
    rows = np.arange(len(value)), governs
    interval = None if parts.interval is None else (low[rows], high[rows])
    return Answers(value[rows], limit[rows], verdicts[rows], interval).finite()
