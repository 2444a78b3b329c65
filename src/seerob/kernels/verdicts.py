"""What limits say of the figures of many parts, compiled: the rule of `seerob.core.verdict`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Codes = NDArray[np.uint8]

WITHIN, EXCEEDED, UNDECIDED = 0, 1, 2
"""Verdicts, as in `seerob.recording.series.CODES`."""
NO_VERDICT = 255

_ROWS = "f8[:,::1]"


@njit("i8(f8[:], f8[:], f8[:], f8[:], f8, b1, b1, u1[::1])", cache=True, nogil=True, error_model="numpy")
def judged(
    value: Array,
    low: Array,
    high: Array,
    limit: Array,
    rounding: float,
    at_most: bool,
    open_: bool,
    verdicts: Codes,
) -> int:
    """Judge parts at one instant; writes the last argument.

    Args:
        value: Of each part, shape (n,).
        low: Least that it may be, shape (n,).
        high: Largest, likewise.
        limit: Of each, shape (n,); NaN where nobody knows, which is undecided.
        rounding: Share of its limit, and of one unit where it is less, by which a figure must keep it.
        at_most: Whether limits bound from above.
        open_: Whether more may be than what is known: then nothing is within.
        verdicts: Of each, shape (n,).

    Returns:
        Which part governs: of those with the worst verdict the one that keeps its limit by the least, or is
        the farthest beyond.
    """
    side = 1.0 if at_most else -1.0
    worst, least, governs = 0, math.inf, 0
    for i in range(len(value)):
        last = side * limit[i]
        if not math.isinf(last):
            last -= rounding * max(1.0, abs(last))
        kept, also = side * low[i] <= last, side * high[i] <= last
        unknown = math.isnan(value[i]) or math.isnan(low[i]) or math.isnan(high[i]) or math.isnan(last)
        if unknown or kept != also:
            verdicts[i], rank = UNDECIDED, 1
        elif not kept:
            verdicts[i], rank = EXCEEDED, 2
        elif open_ or math.isinf(last):  # nothing could exceed a limit without end
            verdicts[i], rank = UNDECIDED, 1
        else:
            verdicts[i], rank = WITHIN, 0
        room = side * (limit[i] - value[i])
        if rank > worst or (rank == worst and room < least):
            worst, least, governs = rank, room, i
    return governs


@njit(
    "void(f8[::1], f8[::1], f8[::1], f8[::1], b1[::1], b1[::1], b1[::1], f8, u1[::1])",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def judged_rows(
    value: Array,
    low: Array,
    high: Array,
    limit: Array,
    limited: NDArray[np.bool_],
    at_most: NDArray[np.bool_],
    exceeded: NDArray[np.bool_],
    rounding: float,
    verdicts: Codes,
) -> None:
    """Judge figures of one instant by `judged`, each against its own side; writes the last argument.

    Args:
        value: Of each criterion, shape (n,) as all arrays; what is not finite is undecided.
        low: Least that it may be.
        high: Largest.
        limit: Of each; of no meaning where there is none.
        limited: Which have one.
        at_most: Which limits bound from above.
        exceeded: Which exceed theirs whatever the value, which is a bound.
        rounding: As of `judged`.
        verdicts: Of each.
    """
    for k in range(len(value)):
        here = slice(k, k + 1)
        judged(value[here], low[here], high[here], limit[here], rounding, at_most[k], False, verdicts[here])
        if not (math.isfinite(value[k]) and low[k] <= high[k]):
            verdicts[k] = UNDECIDED
        elif not limited[k]:
            verdicts[k] = NO_VERDICT
        elif exceeded[k]:
            verdicts[k] = EXCEEDED


@njit(
    f"void({_ROWS}, {_ROWS}, {_ROWS}, {_ROWS}, f8, b1, b1[::1], u1[:,::1], i8[::1])",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def judged_many(
    value: Array,
    low: Array,
    high: Array,
    limit: Array,
    rounding: float,
    at_most: bool,
    open_: NDArray[np.bool_],
    verdicts: Codes,
    governs: NDArray[np.int64],
) -> None:
    """Judge parts at N instants by `judged`: shapes (N, n), ``open_`` (N,); writes the last two arguments."""
    for k in range(len(value)):
        governs[k] = judged(value[k], low[k], high[k], limit[k], rounding, at_most, open_[k], verdicts[k])


@njit(
    "void(f8[::1], f8[::1], b1, f8, b1, b1, b1[:], b1[:], u1[::1], f8[::1], b1[::1])",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def answered(
    value: Array,
    limit: Array,
    limited: bool,
    rounding: float,
    at_most: bool,
    exact: bool,
    open_: NDArray[np.bool_],
    nothing: NDArray[np.bool_],
    verdicts: Codes,
    shown: Array,
    idle: NDArray[np.bool_],
) -> None:
    """Judge one figure of N instants, of which no interval is known; writes the last three arguments.

    Args:
        value: Shape (N,); NaN where there is none.
        limit: Shape (N,).
        limited: Whether there is one.
        rounding: As of `judged`.
        at_most: Whether it bounds from above.
        exact: Whether values are whole numbers, which keep the limit that they are on.
        open_: Where more may be than what is known, shape (N,): nothing is within there.
        nothing: Where there is nothing to judge, shape (N,).
        verdicts: Shape (N,).
        shown: The values, NaN where they are infinite, shape (N,).
        idle: Where there is no verdict because there is nothing to judge, shape (N,).
    """
    for k in range(len(value)):
        v, last = value[k], limit[k]
        endless = math.isinf(last)
        if not (endless or exact):
            room = rounding * max(1.0, abs(last))
            last = last - room if at_most else last + room
        if math.isnan(v):
            verdicts[k] = UNDECIDED
        elif not limited:
            verdicts[k] = NO_VERDICT
        elif not (v <= last if at_most else v >= last):
            verdicts[k] = EXCEEDED
        else:
            verdicts[k] = UNDECIDED if open_[k] or endless else WITHIN
        shown[k] = np.nan if math.isinf(v) else v
        idle[k] = nothing[k] or (math.isinf(v) and not limited)
        if nothing[k]:
            verdicts[k] = NO_VERDICT


@njit("b1(f8[:], f8[:], f8[:], f8[:], u1[:], b1[:], f8, b1, b1)", cache=True, nogil=True, error_model="numpy")
def contradicted(
    value: Array,
    limit: Array,
    low: Array,
    high: Array,
    verdicts: Codes,
    nothing: NDArray[np.bool_],
    rounding: float,
    at_most: bool,
    exact: bool,
) -> bool:
    """Whether any of N instants cannot be what it says, or says nothing.

    Args:
        value: Shape (N,), as all arrays.
        limit: NaN where there is none.
        low: Least that each may be.
        high: Largest, likewise.
        verdicts: What is said.
        nothing: Where there is nothing to judge.
        rounding: As of `judged`.
        at_most: As of `answered`.
        exact: As of `answered`.
    """
    for k in range(len(value)):
        v, last = value[k], limit[k]
        if verdicts[k] == NO_VERDICT:
            if not nothing[k] and (math.isnan(v) or not math.isnan(last)):
                return True
        elif verdicts[k] == WITHIN:
            if nothing[k] or not math.isfinite(v) or math.isinf(last):
                return True
            room = 0.0 if exact else rounding * max(1.0, abs(last))
            last = last - room if at_most else last + room
            for end in (v, low[k], high[k]):
                if not (end <= last if at_most else end >= last):
                    return True
    return False
