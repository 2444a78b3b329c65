"""What a criterion says of many instants, in arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seerob.core.snapshot import Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING
from seerob.kernels.verdicts import contradicted
from seerob.recording.series import CODES, NO_VERDICT

Codes = NDArray[np.uint8]
"""Verdicts; see `seerob.recording.series.CODES`."""
Flags = NDArray[np.bool_]

WITHIN, EXCEEDED, UNDECIDED = CODES[Verdict.WITHIN], CODES[Verdict.EXCEEDED], CODES[Verdict.UNDECIDED]


@dataclass(frozen=True, eq=False)
class Answers:
    """Values, limits and verdicts of N instants."""

    value: Array
    """In the criterion's unit, shape (N,); NaN where there is none."""
    limit: Array
    """Limit in the criterion's unit, shape (N,); NaN where there is none."""
    verdict: Codes
    """Shape (N,)."""
    interval: tuple[Array, Array] | None = None
    """Where the true values lie, as far as tolerances are known, shape (N,) each."""
    nothing: Flags | None = None
    """Where there is nothing to judge, shape (N,); without that, who says nothing is UNDECIDED."""
    exact: bool = False
    """Whether values are scores or counts, which keep the limit that they are on."""

    @classmethod
    def against(
        cls, value: Array, limit: Array | float | None, *, at_most: bool, exact: bool = False
    ) -> Answers:
        """Values against a limit or limits, by the rule of `seerob.core.verdict.judge`."""
        limits = np.full(value.shape, np.nan) if limit is None else np.broadcast_to(limit, value.shape)
        return cls(value, limits, judge_many(value, limit, at_most=at_most, exact=exact), exact=exact)

    def between(self, low: Array, high: Array, *, at_most: bool) -> Answers:
        """Judge values that lie between two ends (`seerob.core.verdict.judge_interval`)."""
        ends = [judge_many(end, self.limit, at_most=at_most, exact=self.exact) for end in (low, high)]
        either = np.where(ends[0] == ends[1], ends[0], UNDECIDED).astype(np.uint8)
        informs = np.isnan(self.limit) & ~np.isnan(low) & ~np.isnan(high)
        verdict = np.where(informs, self.verdict, either)
        return replace(self, verdict=verdict, interval=(low, high))

    def finite(self) -> Answers:
        """Replace infinite values by NaN. A verdict stays; an instant without one has nothing to judge."""
        none = np.isinf(self.value)
        value = np.where(none, np.nan, self.value)
        return replace(self, value=value).without_verdict(none & (self.verdict == NO_VERDICT))

    def exceeded(self, where: Flags) -> Answers:
        """Return these answers with EXCEEDED at the instants where ``where``, shape (N,), is true."""
        return replace(self, verdict=np.where(where, EXCEEDED, self.verdict).astype(np.uint8))

    def without_verdict(self, where: Flags) -> Answers:
        """Return these answers with nothing to judge at the instants where ``where``, shape (N,), is true."""
        verdict = np.where(where, NO_VERDICT, self.verdict).astype(np.uint8)
        return replace(self, verdict=verdict, nothing=where if self.nothing is None else self.nothing | where)

    def open(self, where: Flags | bool = True) -> Answers:
        """Turn WITHIN into UNDECIDED where it may not be what it says: everywhere when not given."""
        verdict = np.where((self.verdict == WITHIN) & where, UNDECIDED, self.verdict)
        return replace(self, verdict=verdict.astype(np.uint8))

    def contradictions(self, *, at_most: bool) -> NDArray[np.object_] | None:
        """Why each instant cannot be what it says, or says nothing, shape (N,); empty where it can.

        None where all of them can.
        """
        nothing = np.zeros(len(self.value), bool) if self.nothing is None else self.nothing
        low, high = (self.value, self.value) if self.interval is None else self.interval
        value, limit, least, most = (np.array(each, float) for each in (self.value, self.limit, low, high))
        codes, idle = np.array(self.verdict, np.uint8), np.array(nothing, np.bool_)
        if not contradicted(value, limit, least, most, codes, idle, ROUNDING, at_most, self.exact):
            return None
        within, silent = self.verdict == WITHIN, (self.verdict == NO_VERDICT) & ~nothing
        ends = np.array([self.value, low, high], float)
        kept = keep_many(ends, self.limit, at_most=at_most, exact=self.exact).all(axis=0) & np.isfinite(
            self.value
        )
        kept &= ~np.isinf(self.limit)
        reason = np.where(
            np.isnan(self.limit), "it is within, and has no limit", "it is within, beyond its limit"
        )
        reason = np.where(np.isinf(self.limit), "it is within, and nothing could exceed its limit", reason)
        reason = np.where(np.isfinite(self.value), reason, "it is within, and has no value")
        reason = np.where(nothing, "it is within, and says that there is nothing to judge", reason)
        reason = np.where(within & (nothing | ~kept), reason, "")
        empty = np.isnan(self.value) & np.isnan(low)
        reason = np.where(silent & ~np.isnan(self.limit), "it has a limit and no verdict", reason)
        return np.where(silent & empty, "it says nothing, neither a figure nor a verdict", reason).astype(
            object
        )


def judge_many(value: Array, limit: Array | float | None, *, at_most: bool, exact: bool = False) -> Codes:
    """Verdicts of values against a limit or limits; the rule is `seerob.core.verdict.judge`."""
    if limit is None:
        return np.where(np.isnan(value), UNDECIDED, NO_VERDICT).astype(np.uint8)
    within = keep_many(value, limit, at_most=at_most, exact=exact)
    return np.where(np.isnan(value), UNDECIDED, np.where(within, WITHIN, EXCEEDED)).astype(np.uint8)


def keep_many(value: Array, limit: Array | float, *, at_most: bool = True, exact: bool = False) -> Flags:
    """Whether computed or exact figures keep a limit or limits; the rule is `seerob.core.verdict.keeps`."""
    limits = np.asarray(limit, float)
    inexact = ~np.isinf(limits) & (not exact)
    room = np.where(inexact, ROUNDING * np.maximum(1.0, np.abs(limits)), 0.0)
    return np.asarray(value <= limits - room if at_most else value >= limits + room)
