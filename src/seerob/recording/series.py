"""One criterion over time, in columns that grow without being copied at each tick.

What a run is, is said here once. It is exceeded when an instant of it is. It is within when at every instant
at which the criterion applied it was within: also between the instants at which it was asked, as far as that
is bounded, or accepted (`CriterionInfo.between`). It is undecided when any of that is not known, when the
criterion never applied, or when it was never heard. That nobody was near whenever it was asked says no more
of the time between than that all was within. Without any limit it has no verdict, and informs.

What a run of eight hours says of one criterion is 80 MB. A `Column` keeps a block of it in memory, and a
`Spill` takes the full blocks of many columns in a file without a name; nothing is rounded or left out, and
reading a column puts it together again. All that is said at an instant is one row of one column.
"""

from __future__ import annotations

import logging
import math
import os
import struct
import tempfile
import weakref
from collections.abc import Iterable, Mapping
from pathlib import Path
from threading import Lock
from types import MappingProxyType
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import Undecided
from seerob.core.snapshot import Result, Snapshot, Trace, Verdict
from seerob.core.transforms import Array

_log = logging.getLogger(__name__)

BLOCK = 1 << 13
"""Numbers of a column in memory: over a minute of ticks."""
DISK = Path("/var/tmp")  # noqa: S108 - files without a name
"""For temporary files that are large, where there is such a folder: the usual one may be memory."""


class Spill:
    """A file without a name for full blocks; gone with the process, however that ends."""

    def __init__(self) -> None:
        self.lock = Lock()
        """Held while a block goes from memory to the file, and while a column is put together."""
        self._file: IO[bytes] | None = None
        self._full = False

    def __reduce__(self) -> tuple[type[Spill], tuple[()]]:
        return Spill, ()

    def write(self, data: bytes) -> int | None:
        """Append a block; call it with the lock held.

        Returns:
            Where it begins; None when it could not be written, and has to stay in memory.
        """
        if self._full:
            return None
        try:
            if self._file is None:
                folder = DISK if os.access(DISK, os.W_OK) else None
                self._file = tempfile.TemporaryFile(buffering=0, dir=folder)  # noqa: SIM115
                weakref.finalize(self, self._file.close)
            begin = self._file.seek(0, os.SEEK_END)
            written = self._file.write(data)
        except OSError as error:
            written, reason = None, error.strerror
        else:
            reason = "no space left"
        if written == len(data):
            return begin
        self._full = True
        _log.warning("results stay in memory, which grows: a temporary file cannot be written: %s", reason)
        return None

    def read(self, begin: int, size: int) -> bytes:
        """A block [byte]; call it with the lock held.

        Raises:
            OSError: The file cannot be read.
        """
        if self._file is None:
            raise OSError("nothing was written")
        self._file.seek(begin)
        parts = []
        while part := self._file.read(size):
            parts.append(part)
            size -= len(part)
        if size:
            raise OSError("a temporary file of results has become shorter")
        return b"".join(parts)


class Column:
    """Rows of numbers, appended one by one, by one thread; any thread may read.

    Args:
        form: Of a row, as of `struct`.
        spill: Takes full blocks.
    """

    def __init__(self, form: str, spill: Spill) -> None:
        row = struct.Struct(form)
        self._form, self._pack, self._spill = form, row.pack, spill
        self._blocks: list[int | bytes] = []
        """Full ones: where each begins in the file, or itself."""
        self._newest = bytearray()
        self._count = 0
        self._size = BLOCK * row.size

    def __getstate__(self) -> dict[str, object]:
        """All rows, and the file that others may write to as well, which is another where this is read."""
        return {"form": self._form, "spill": self._spill, "rows": self.tobytes()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take the rows, block by block."""
        self.__init__(state["form"], state["spill"])  # type: ignore[misc]
        rows: bytes = state["rows"]
        self._count = len(rows) // struct.calcsize(self._form)
        with self._spill.lock:
            for begin in range(0, len(rows), self._size):
                block = rows[begin : begin + self._size]
                if len(block) < self._size:
                    self._newest = bytearray(block)
                else:
                    at = self._spill.write(block)
                    self._blocks.append(block if at is None else at)

    def __len__(self) -> int:
        return self._count

    def append(self, *numbers: float) -> None:
        """Add a row."""
        newest = self._newest
        newest += self._pack(*numbers)
        self._count += 1
        if len(newest) == self._size:
            with self._spill.lock:
                data = bytes(self._newest)
                begin = self._spill.write(data)
                self._blocks.append(data if begin is None else begin)
                self._newest = bytearray()

    def tobytes(self) -> bytes:
        """All of them, one after the other: at least as many as there were when it was called."""
        with self._spill.lock:
            old = [b if isinstance(b, bytes) else self._spill.read(b, self._size) for b in self._blocks]
            # One step under the interpreter's lock: a reader never sees a row that is being written.
            return b"".join((*old, bytes(self._newest)))


NO_VERDICT = 255
CODES: dict[Verdict | None, int] = {
    Verdict.WITHIN: 0,
    Verdict.EXCEEDED: 1,
    Verdict.UNDECIDED: 2,
    None: NO_VERDICT,
}
"""Verdict → the byte that stands for it in arrays, as in `snapshot.Trace`."""

_UNKNOWN = CODES[Verdict.UNDECIDED]
_COLUMNS = np.dtype([("t", "f8"), ("value", "f8"), ("limit", "f8"), ("reason", "i4"), ("verdict", "u1")])
_ROW = "=dddiB"
"""What is kept of an instant, packed: the reason by its number, the verdict by its code."""
MAX_REASONS = 4096
"""Distinct reasons kept per series; a reason with a changing number in it must not fill the memory."""

STILL = "accepted: no source moves anybody"
"""Of `CriterionInfo.between`: one instant then is all of a run."""

INFORMS = (
    "nothing bounds it between the instants at which it was asked; between_samples can accept that where "
    "there is a verdict"
)
"""Why a figure without a limit is not known between: that nobody was near says nothing green then."""

ONE_INSTANT = "the run is one instant, and sources say that something moves"

_RANK = {Verdict.EXCEEDED: 0, Verdict.UNDECIDED: 1, Verdict.WITHIN: 2, None: 3}


class Worst(NamedTuple):
    """The instant that decides: the worst verdict and, within it, the smallest margin to the limit."""

    t: float
    """Instant the result speaks of [s]."""
    seq: int
    """Number of the snapshot that it is in."""
    value: float | None
    limit: float | None
    verdict: Verdict | None
    reason: str
    """Why UNDECIDED, or what governs."""
    part: str
    """The part whose verdict this is; empty when no part has it."""
    interval: tuple[float, float] | None = None
    """Where the true value lies, given the tolerances of the inputs; of a whole criterion only."""


class Times(NamedTuple):
    """How a run is divided, each a share of it, 0…1; of a run of one instant, 1 of what that is."""

    within: float
    exceeded: float
    undecided: float
    muted: float
    """It did not apply."""
    nothing: float
    """It was asked, and there was nothing to judge, or no limit to judge by."""
    open: float
    """It was not asked, and nothing says what it would have said."""

    @property
    def decided(self) -> float:
        """Share in which it was within or exceeded."""
        return self.within + self.exceeded


_WITHIN, _EXCEEDED, _UNDECIDED, _MUTED, _NOTHING, _OPEN = range(6)
_STATE: dict[Verdict | None, int] = {
    Verdict.WITHIN: _WITHIN,
    Verdict.EXCEEDED: _EXCEEDED,
    Verdict.UNDECIDED: _UNDECIDED,
    None: _NOTHING,
}


class Spread(NamedTuple):
    """A mean is never given without what it hides."""

    minimum: float
    mean: float
    maximum: float


def worst_verdict(verdicts: Iterable[Verdict | None]) -> Verdict | None:
    """EXCEEDED before UNDECIDED before WITHIN before none."""
    return min(verdicts, key=_RANK.__getitem__, default=None)


def margin(result: Result) -> float:
    """Distance to the limit in the direction that matters, negative beyond it; nan when unknown.

    Without a limit it is the distance to 0, so that the largest speed and the smallest distance
    still come out as the extreme ones.
    """
    if result.value is None:
        return math.nan
    limit = 0.0 if result.limit is None else result.limit
    return limit - result.value if result.at_most else result.value - limit


def severity(result: Result) -> tuple[int, float]:
    """Sort key: smaller is worse. An exceedance of unknown size counts as the largest."""
    size = margin(result)
    if math.isnan(size):
        size = -math.inf if result.verdict is Verdict.EXCEEDED else math.inf
    return _RANK[result.verdict], size


class WorstTracker:
    """Keeps the worst result so far; of equal ones the first."""

    def __init__(self) -> None:
        self._key = (len(_RANK), math.inf)
        self.worst: Worst | None = None

    def take(self, result: Result, snapshot: Snapshot) -> bool:
        """Whether ``result`` is worse than all before it."""
        key = severity(result)
        if self.worst is not None and key >= self._key:
            return False
        self._key = key
        # A part without this verdict informs; it governs nothing.
        judged = [p for p in result.parts if p.verdict is not None and p.verdict is result.verdict]
        part = min(judged, key=severity).name if judged else ""
        self.worst = Worst(
            snapshot.t if result.t is None else result.t,
            snapshot.seq,
            result.value,
            result.limit,
            result.verdict,
            result.reason,
            part,
            result.interval,
        )
        return True


class Series:
    """One criterion, or one part of it, over a run. Arrays are read-only copies of what is there now."""

    def __init__(
        self,
        *,
        name: str,
        unit: str,
        at_most: bool,
        tracker: WorstTracker | None = None,
        spill: Spill | None = None,
        between: str | None = None,
        whole: Series | None = None,
    ) -> None:
        """Begin.

        Args:
            name: Of the criterion or part.
            unit: Of its values.
            at_most: Whether limits bound from above.
            tracker: Of its worst instant; a part has none.
            spill: Takes full blocks.
            between: As of `CriterionInfo`; None of what no run announced, whose instants are all there is.
            whole: What it is a part of.
        """
        self.between = between
        self._seconds = [0.0] * 6
        self._instants = [0] * 6
        self._snapshots = 0
        self.name = name
        self.open = "" if between is None or between.startswith("accepted: ") else between
        """Why the time between its instants is not within although they are; empty when that is known."""
        self.unit = unit
        self.at_most = at_most
        """Whether limits bound from above."""
        self._tracker = tracker
        self._spill = spill = Spill() if spill is None else spill
        self._rows = Column(_ROW, spill)
        self._append = self._rows.append
        self._reason_of: dict[str, int] = {"": 0}
        self._parts: dict[str, Series] = {}
        self._whole = whole
        self._passed_over = whole is not None and CODES[Verdict.UNDECIDED] in whole._said
        """Of a part: whether it was not spoken of when the whole was undecided."""
        self._last_t: float | None = None
        self._last_verdict: Verdict | None = None
        self._said: set[int] = set()
        self._has_limit = False
        self.broken_off = ""
        """Why the run ended before it was over; empty when it did not."""
        self._unseen = False
        """Whether nobody knows if there was something to judge between instants at which there was not."""

    def __repr__(self) -> str:
        verdict = "no verdict" if self.verdict is None else self.verdict.value
        return f"<Series {self.name!r}: {len(self)} instants, {verdict}>"

    @property
    def known(self) -> bool:
        """Whether anything was heard."""
        return len(self._rows) > 0

    @property
    def asked(self) -> str:
        """At how many ticks it was asked, which its figures are of; empty where it was at each."""
        n, of = len(self), self._snapshots
        return f"asked at {n} of {of} ticks, which its figures are of" if 0 < n < of else ""

    def repeats(self, result: Result) -> bool:
        """Whether this is the last result of a criterion with a period, shown again, and no worse since."""
        again = result.t is not None and result.t == self._last_t
        return again and _RANK[result.verdict] >= _RANK[self._last_verdict]

    def pass_time(self, result: Result | None, dt: float) -> None:
        """Count the time since the snapshot before [s] for what the criterion says in this one.

        Args:
            result: None when it is not in the snapshot.
            dt: Not below 0.
        """
        self._snapshots += 1
        if result is None:
            state = _OPEN
        elif result.muted:
            state = _MUTED
        else:
            state = _STATE[result.verdict]
            idle = result.nothing and self.open != INFORMS
            if (state == _WITHIN or idle) and self.open:
                self._instants[state] += 1
                self._seconds[_OPEN] += dt
                self._unseen = self._unseen or (idle and dt > 0)
                return
        self._seconds[state] += dt
        self._instants[state] += 1

    def times(self) -> Times:
        """How the run is divided so far; of what no run announced, its instants."""
        counted: list[float] | list[int] = self._seconds if sum(self._seconds) > 0 else self._instants
        if not sum(counted):
            counted = [int((self.verdicts == CODES[v]).sum()) for v in Verdict] if self.known else []
            shares = dict(zip((_STATE[v] for v in Verdict), counted, strict=False))
            counted = [shares.get(state, 0) for state in range(6)]
            counted[_NOTHING] = len(self) - sum(counted)
        whole = sum(counted) or 1.0
        return Times(*(part / whole for part in counted))

    @property
    def _is_open(self) -> bool:
        return self.between is not None and self._seconds[_OPEN] > 0

    @property
    def _is_one_instant(self) -> bool:
        return self.between is not None and self._snapshots == 1 and self.between != STILL

    def gap(self) -> str:
        """Why what was within whenever it was asked is not known to be within throughout; empty if it is."""
        if self.broken_off:
            return self.broken_off
        if self._is_open:
            why = self.open or "it was not asked"
            return f"not known in {self._seconds[_OPEN]:.4g} s of the run: {why}"
        if self._is_one_instant:
            return ONE_INSTANT
        return ""

    def append(self, result: Result, t: float) -> None:
        """Add what the criterion said in the snapshot at run time ``t`` [s]."""
        verdict, value, limit, reason = result.verdict, result.value, result.limit, 0
        self._last_t, self._last_verdict = result.t, verdict
        if text := result.reason:
            reason = self._reason_of.get(text, -1)
            if reason < 0 and len(self._reason_of) < MAX_REASONS:
                reason = self._reason_of[text] = len(self._reason_of)
        for part in result.parts:
            series = self._parts.get(part.name)
            if series is None:
                series = Series(
                    name=part.name, unit=part.unit, at_most=part.at_most, spill=self._spill, whole=self
                )
                self._parts[part.name] = series
            series.append(part, t)
        code = CODES[verdict]
        if code == _UNKNOWN:
            said = {part.name for part in result.parts}
            for name, series in self._parts.items():
                series._passed_over = series._passed_over or name not in said
        if code not in self._said:
            self._said.add(code)
        if limit is None:
            limit = math.nan
        else:
            self._has_limit = True
        self._append(t, math.nan if value is None else value, limit, reason, code)

    def __len__(self) -> int:
        return len(self._rows)

    def _column(self, name: str) -> NDArray[Any]:
        found = np.ascontiguousarray(np.frombuffer(self._rows.tobytes(), _COLUMNS)[name])
        found.setflags(write=False)
        return found

    def instants(self) -> tuple[NDArray[Any], tuple[str, ...]]:
        """All that is there now, of one moment also while it grows.

        Returns:
            A structured array, shape (n,), with ``t`` [s], ``value``, ``limit``, ``verdict`` as the
            properties below have them and ``reason``, a number; and the reasons, whose places those are.
        """
        found = np.frombuffer(self._rows.tobytes(), _COLUMNS)
        return found, (*self._reason_of, "…")

    @property
    def t(self) -> Array:
        """Run time of the snapshots [s], shape (n,)."""
        return self._column("t")

    @property
    def values(self) -> Array:
        """In `unit`, shape (n,); nan where there was none."""
        return self._column("value")

    @property
    def limits(self) -> Array:
        """In `unit`, shape (n,); nan where there was none."""
        return self._column("limit")

    @property
    def verdicts(self) -> NDArray[np.uint8]:
        """0 within, 1 exceeded, 2 undecided, 255 none, shape (n,)."""
        return self._column("verdict")

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why UNDECIDED or what governs, per tick; ``…`` beyond the `MAX_REASONS` distinct ones kept."""
        codes = self._column("reason").tolist()
        texts = (*self._reason_of, "…")
        return tuple(texts[code] for code in codes)

    @property
    def parts(self) -> Mapping[str, Series]:
        """One series per link or body area, by its name."""
        return MappingProxyType(self._parts)

    @property
    def verdict(self) -> Verdict | None:
        """Verdict of the whole run so far; see above."""
        if not self.known:
            return Verdict.UNDECIDED
        found = worst_verdict(v for v, code in CODES.items() if code in self._said)
        if found is None and (self._never_judged() or self._never_applied() or self._unseen):
            return Verdict.UNDECIDED
        return Verdict.UNDECIDED if found is Verdict.WITHIN and self._unknown() else found

    def _unknown(self) -> bool:
        """Whether something is not known of it, or of the whole, beside the instants that are there."""
        known = not (self.broken_off or self._is_open or self._is_one_instant or self._passed_over)
        return not known or (self._whole is not None and self._whole._unknown())

    def _never_applied(self) -> bool:
        return self._instants[_MUTED] > 0 and self._instants[_MUTED] == sum(self._instants)

    def _never_judged(self) -> bool:
        """Whether a criterion, not a part of one, has a limit and a run too short to judge it by."""
        return self._tracker is not None and self._has_limit

    def max(self) -> float:
        """Largest value.

        Raises:
            Undecided: There was never a value.
        """
        return self.spread().maximum

    def min(self) -> float:
        """Smallest value.

        Raises:
            Undecided: There was never a value.
        """
        return self.spread().minimum

    def spread(self) -> Spread:
        """Smallest, mean and largest of the values that there are.

        Raises:
            Undecided: There was never a value.
        """
        values = self.values
        values = values[~np.isnan(values)]
        if not len(values):
            raise Undecided(f"{self.name} had no value in this run")
        return Spread(float(values.min()), float(values.mean()), float(values.max()))

    def worst(self) -> Worst:
        """The instant that decides.

        Raises:
            Undecided: Nothing was heard.
        """
        if self._tracker is not None and self._tracker.worst is not None:
            worst, verdict = self._tracker.worst, self.verdict
            if verdict is worst.verdict:
                return worst
            gap = self.gap() if worst.verdict or self._unseen else ""
            return worst._replace(verdict=verdict, reason="; ".join(filter(None, (gap, worst.reason))))
        if not self.known:
            raise Undecided(f"{self.name} was never heard in this run")
        return self._worst_of_arrays()

    def _worst_of_arrays(self) -> Worst:
        best: tuple[tuple[int, float], int, Verdict | None] | None = None
        values, limits, codes = self.values, self.limits, self.verdicts
        reach = np.nan_to_num(limits, nan=0.0)
        margins = reach - values if self.at_most else values - reach
        for verdict, code in CODES.items():
            where = np.flatnonzero(codes == code)
            if not len(where):
                continue
            unknown = -np.inf if verdict is Verdict.EXCEEDED else np.inf
            sizes = np.where(np.isnan(margins[where]), unknown, margins[where])
            k = int(np.argmin(sizes))
            key = (_RANK[verdict], float(sizes[k]))
            if best is None or key < best[0]:
                best = key, int(where[k]), verdict
        assert best is not None
        _, i, verdict = best
        value, limit = float(values[i]), float(limits[i])
        return Worst(
            float(self.t[i]),
            -1,
            None if math.isnan(value) else value,
            None if math.isnan(limit) else limit,
            Verdict.UNDECIDED if verdict is Verdict.WITHIN and self._unknown() else verdict,
            self.reasons[i],
            "",
        )

    def shares(self) -> dict[Verdict | None, float]:
        """Share of the evaluated ticks per verdict, 0…1, in the order of severity; empty when none."""
        if not self.known:
            return {}
        codes = self.verdicts
        counts = {v: int(np.count_nonzero(codes == code)) for v, code in CODES.items()}
        return {v: counts[v] / len(codes) for v in sorted(counts, key=_RANK.__getitem__) if counts[v]}

    def intervals(self, verdict: Verdict | None = Verdict.EXCEEDED) -> tuple[tuple[float, float], ...]:
        """Stretches of consecutive evaluated ticks with a verdict: run time of the first and the last [s]."""
        hit = np.concatenate([[False], self.verdicts == CODES[verdict], [False]])
        edges = np.flatnonzero(hit[1:] != hit[:-1])
        t = self.t
        return tuple((float(t[a]), float(t[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True))

    def thinned(self, max_points: int = 2000) -> NDArray[np.int64]:
        """Indices of at most ``max_points`` ticks that keep the picture true.

        Per bucket: its first tick, its smallest and largest value, its smallest margin and its worst
        verdict. The first and the last tick are always there.
        """
        if max_points < 7:
            raise ValueError(f"max_points must be at least 7, not {max_points}")
        n = len(self)
        if n <= max_points:
            return np.arange(n)
        values, limits, codes = self.values[:n], self.limits[:n], self.verdicts[:n]
        margins = limits - values if self.at_most else values - limits
        rank = np.array([2, 0, 1, *[3] * 253], np.uint8)[codes]
        buckets = max((max_points - 1) // 5, 1)
        edges = np.linspace(0, n, buckets + 1).astype(np.int64)
        keep = {n - 1}
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            keep.update((a, a + int(rank[a:b].argmin())))
            for data in (values[a:b], -values[a:b], margins[a:b]):
                if not np.isnan(data).all():
                    keep.add(a + int(np.nanargmin(data)))
        return np.array(sorted(keep), np.int64)

    def thin(self, max_points: int = 2000) -> Trace:
        """For plots: at most ``max_points`` ticks, no extremum and no exceedance lost."""
        i = self.thinned(max_points)
        return Trace(
            name=self.name,
            t=self.t[i].astype("<f8").tobytes(),
            values=self.values[i].astype("<f8").tobytes(),
            limits=self.limits[i].astype("<f8").tobytes(),
            verdicts=self.verdicts[i].tobytes(),
        )
