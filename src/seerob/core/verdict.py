"""What a limit says of a value, the same word and the same rule everywhere."""

from __future__ import annotations

import math
from enum import StrEnum
from numbers import Integral

ROUNDING = 1e-9
"""Share of its limit by which a computed figure must keep it, and of one unit where the limit is less: more
than the last bits, which change with where a cell stands and in which units it is written, and less than
anything that is measured."""


class Verdict(StrEnum):
    """What a limit says of a value. An evaluation, never a certificate."""

    WITHIN = "within"
    EXCEEDED = "exceeded"
    UNDECIDED = "undecided"


def keeps(value: float, limit: float, *, at_most: bool = True) -> bool:
    """Whether a value keeps a limit: one rule for equality, on the stricter side.

    A computed figure that is its limit but for rounding does not. A score or a count, given as ``int``, is
    exact, and keeps the limit that it is on. What is not a number keeps none.
    """
    if type(value) is float or not isinstance(value, Integral):
        limit = admitted(limit, at_most=at_most)
    return bool(value <= limit if at_most else value >= limit)


def admitted(limit: float, *, at_most: bool = True) -> float:
    """The last computed figure that keeps a limit."""
    if math.isinf(limit):
        return limit
    room = ROUNDING * max(1.0, abs(limit))
    return limit - room if at_most else limit + room


# To ask an enumeration for a member takes longer than all the rest of a judgement.
_WITHIN, _EXCEEDED, _UNDECIDED = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED


def judge(value: float, limit: float | None, *, at_most: bool = True) -> Verdict | None:
    """Verdict of a value against a limit, by the rule of `keeps`; no limit is no verdict.

    A value that is not a number is UNDECIDED, whatever the limit.
    """
    if math.isnan(value):
        return _UNDECIDED
    if limit is None:
        return None
    return _WITHIN if keeps(value, limit, at_most=at_most) else _EXCEEDED


def judge_interval(
    interval: tuple[float, float], limit: float | None, *, at_most: bool = True
) -> Verdict | None:
    """Verdict when the true value lies in ``interval``: UNDECIDED when the limit lies inside it."""
    low, high = interval
    if limit is not None and type(low) is float is type(high):
        if math.isnan(low) or math.isnan(high):
            return _UNDECIDED
        last = admitted(limit, at_most=at_most)
        if at_most:
            kept, also = low <= last, high <= last
        else:
            kept, also = low >= last, high >= last
        return _UNDECIDED if kept is not also else _WITHIN if kept else _EXCEEDED
    verdict = judge(low, limit, at_most=at_most)
    return verdict if verdict is judge(high, limit, at_most=at_most) else _UNDECIDED


def worst(verdicts: list[Verdict | None]) -> Verdict | None:
    """The verdict of a whole: EXCEEDED before UNDECIDED before WITHIN before none."""
    for verdict in (_EXCEEDED, _UNDECIDED, _WITHIN):
        if verdict in verdicts:
            return verdict
    return None
