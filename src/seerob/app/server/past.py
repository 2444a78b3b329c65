"""What happened so far in a live run, in bounded memory and without losing an extremum."""

from __future__ import annotations

from array import array
from math import ceil, log2, nan

import numpy as np
from numpy.typing import NDArray

from seerob.core.snapshot import History, Result, Snapshot, Trace
from seerob.core.transforms import Array
from seerob.recording.series import CODES

KEPT_PER_BUCKET = 7
"""Smallest, largest, smallest margin, and the first of each verdict; the first of all is one of those."""


def width_of(span: float, buckets: int) -> float:
    """Length of a bucket [s]: the smallest power of two of which ``buckets`` cover the span [s].

    Powers of two nest: thinning again what was thinned loses nothing that the first did not.
    """
    return 2.0 ** ceil(log2(max(span, 1e-6) / buckets))


def keep(
    t: Array, values: Array, limits: Array, verdicts: NDArray[np.uint8], *, at_most: bool, width: float
) -> NDArray[np.int64]:
    """Indices of the points that keep the picture true, ascending.

    Time is cut into buckets that begin at multiples of ``width``. Of each stay the first point, the
    smallest and the largest value, the smallest margin, and one point of each verdict in it.

    Args:
        t: Times [s], ascending, shape (n,), n > 0.
        values: Shape (n,); nan where there was none.
        limits: Shape (n,); nan where there was none.
        verdicts: Codes as in `snapshot.Trace`, shape (n,).
        at_most: Whether limits bound from above.
        width: Length of a bucket [s]; at most `KEPT_PER_BUCKET` points stay of each, and the last.
    """
    bucket = np.floor(t / width).astype(np.int64)
    starts = np.flatnonzero(np.diff(bucket, prepend=bucket[0] - 1))
    margins = limits - values if at_most else values - limits
    kept = [starts, np.array([len(t) - 1])]
    # Stable sort by bucket, then by key: the first of each bucket is its smallest; nan comes last.
    for sort_key in (values, -values, margins):
        kept.append(np.lexsort((sort_key, bucket))[starts])
    for code in np.unique(verdicts):
        where = np.flatnonzero(verdicts == code)
        kept.append(where[np.flatnonzero(np.diff(bucket[where], prepend=bucket[0] - 1))])
    return np.unique(np.concatenate(kept))


class _Past:
    """One criterion."""

    def __init__(self, *, at_most: bool) -> None:
        self.at_most = at_most
        self.t, self.values, self.limits, self.verdicts = array("d"), array("d"), array("d"), array("B")
        self._last_t: float | None = None

    def append(self, result: Result, t: float) -> None:
        if result.t is not None and result.t == self._last_t:
            return  # a criterion with a period, shown again
        self._last_t = result.t
        self.t.append(t)
        self.values.append(nan if result.value is None else result.value)
        self.limits.append(nan if result.limit is None else result.limit)
        self.verdicts.append(CODES[result.verdict])

    def thin(self, buckets: int) -> None:
        t, values, limits = (np.array(a, np.float64) for a in (self.t, self.values, self.limits))
        verdicts = np.array(self.verdicts, np.uint8)
        width = width_of(float(t[-1] - t[0]), buckets)
        i = keep(t, values, limits, verdicts, at_most=self.at_most, width=width)
        self.t, self.values, self.limits = (array("d", a[i].tobytes()) for a in (t, values, limits))
        self.verdicts = array("B", verdicts[i].tobytes())

    def trace(self, name: str) -> Trace:
        return Trace(
            name=name,
            t=np.array(self.t, "<f8").tobytes(),
            values=np.array(self.values, "<f4").tobytes(),
            limits=np.array(self.limits, "<f4").tobytes(),
            verdicts=self.verdicts.tobytes(),
        )


class Past:
    """The results of a run that has no end yet.

    Args:
        buckets: Stretches of equal length that old points are thinned to, at most; per criterion
            about three times `KEPT_PER_BUCKET` as many points are held, the newest of them whole.
    """

    def __init__(self, *, buckets: int = 600) -> None:
        self._buckets = buckets
        self._most = 3 * KEPT_PER_BUCKET * buckets
        self._of: dict[str, _Past] = {}

    def add(self, snapshot: Snapshot) -> None:
        """Take the results of one tick."""
        for result in snapshot.results:
            past = self._of.get(result.name)
            if past is None:
                past = self._of[result.name] = _Past(at_most=result.at_most)
            past.append(result, snapshot.t)

    def tidy(self) -> None:
        """Thin the longest series if it is due; one at a time, so that nobody waits for all of them."""
        longest = max(self._of.values(), key=lambda past: len(past.t), default=None)
        if longest is not None and len(longest.t) > self._most:
            longest.thin(self._buckets)

    def history(self) -> History:
        """What a page that comes late is told."""
        return History(traces=tuple(past.trace(name) for name, past in self._of.items()))
