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
