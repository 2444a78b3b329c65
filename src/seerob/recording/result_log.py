"""What a run said: every criterion over time, its worst instant and its verdict.

A run is as good as its worst tick: EXCEEDED before UNDECIDED before WITHIN before no verdict, and
a criterion that was announced and never heard is UNDECIDED.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from seerob.core.errors import UnknownName
from seerob.core.figures import against, with_unit
from seerob.core.snapshot import (
    CriterionInfo,
    CriterionSoFar,
    Event,
    History,
    Result,
    Snapshot,
    SoFar,
    Verdict,
)
from seerob.recording import frames
from seerob.recording.bone_errors import BoneErrors
from seerob.recording.series import Series, Spill, Spread, Worst, WorstTracker, worst_verdict

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

__all__ = ["JointLog", "ResultLog", "Series", "Spread", "Worst"]


MOST_EVENTS = 10_000
TOLD = 200
"""Events that a page is told of, the newest."""


class JointLog(NamedTuple):
    """Largest tracking error of one robot or human."""

    name: str
    error: float
    """Largest joint error between the twin and what was heard [rad or m]."""
    t: float
    """When [s]."""


class ResultLog(Mapping[str, Series]):
    """The results of a run by the criterion's name, in the order they were announced or first heard.

    Args:
        criteria: What the run was to judge; one that never reports stays in the log as UNDECIDED.
    """

    def __init__(self, criteria: Iterable[CriterionInfo] = ()) -> None:
        self._series: dict[str, Series] = {}
        self._worst: dict[str, WorstTracker] = {}
        self._tracking: dict[str, JointLog] = {}
        self._bones: dict[str, BoneErrors] = {}
        self._spill = Spill()
        self._last: Snapshot | None = None
        self._worse: tuple[str, ...] = ()
        self.events: list[Event] = []
        """What happened to loose workpieces, the first `MOST_EVENTS`."""
        self.ticks = 0
        """Snapshots that were added."""
        self.start: float | None = None
        """Run time of the first snapshot [s]."""
        self.end: float | None = None
        """Run time of the last snapshot [s]."""
        self.slipped = 0.0
        """How much later than real time a live run is by now [s]."""
        self.slipped_at: float | None = None
        """Run time at which it fell behind last [s]; None when it never did."""
        for criterion in criteria:
            self._begin(criterion.name, criterion.unit, criterion.at_most, criterion.between)

    def add(self, snapshot: Snapshot) -> tuple[str, ...]:
        """Take the results of one tick.

        A criterion with a period repeats its last result between two evaluations; the repetition
        (the same `Result.t` again) is not counted twice. Nor is a snapshot that was added last: the
        writers of a run share its log, and whoever comes first adds.

        Returns:
            Names of the criteria whose worst instant so far is in this snapshot.
        """
        if snapshot is self._last:
            return self._worse
        self._last = snapshot
        self.ticks += 1
        if self.start is None:
            self.start = snapshot.t
        self.events += snapshot.events[: MOST_EVENTS - len(self.events)]
        passed = max(snapshot.t - self.end, 0.0) if self.end is not None else 0.0
        self.end = snapshot.t
        worse = []
        for result in snapshot.results:
            series = self._series.get(result.name)
            if series is None:
                series = self._begin(result.name, result.unit, result.at_most, None)
            elif not series.known:
                series.unit, series.at_most = result.unit, result.at_most
            series.pass_time(result, passed)
            if series.repeats(result):
                continue
            series.append(result, snapshot.t)
            if self._worst[result.name].take(result, snapshot):
                worse.append(result.name)
        if len(snapshot.results) < len(self._series):
            said = {result.name for result in snapshot.results}
            for name, series in self._series.items():
                if name not in said:
                    series.pass_time(None, passed)
        for name, error in snapshot.tracking.items():
            known = self._tracking.get(name)
            # A nan is not at most anything, so it shows; and nothing replaces it.
            if known is None or not (error <= known.error or math.isnan(known.error)):
                self._tracking[name] = JointLog(name, error, snapshot.t)
        for name, bones in snapshot.bones.items():
            self._bones.setdefault(name, BoneErrors()).add(bones, snapshot.t)
        self._worse = tuple(worse)
        return self._worse

    def slip(self, slipped: float) -> None:
        """Note how much later than real time the run is by now [s]."""
        if slipped > self.slipped:
            self.slipped, self.slipped_at = slipped, self.end

    def break_off(self, reason: str) -> None:
        """Note why the run ended before it was over: nothing of it is known to be within."""
        for series in self._series.values():
            series.broken_off = reason

    def _begin(self, name: str, unit: str, at_most: bool, between: str | None) -> Series:
        tracker = WorstTracker()
        series = Series(
            name=name, unit=unit, at_most=at_most, tracker=tracker, spill=self._spill, between=between
        )
        self._series[name], self._worst[name] = series, tracker
        return series

    def __getitem__(self, name: str) -> Series:
        try:
            return self._series[name]
        except KeyError:
            raise UnknownName("result", name, self._series) from None

    def get(self, name: str, default: Series | None = None) -> Series | None:  # type: ignore[override]
        """The series of a criterion, or ``default`` when there is none of that name."""
        return self._series.get(name, default)

    def __contains__(self, name: object) -> bool:
        return name in self._series

    def __iter__(self) -> Iterator[str]:
        return iter(tuple(self._series))

    def __len__(self) -> int:
        return len(self._series)

    def __repr__(self) -> str:
        return f"<ResultLog: {len(self)} criteria, {self.ticks} ticks, {self._word(self.verdict)}>"

    def _repr_html_(self) -> str:
        head = ("criterion", "verdict", "worst", "limit", "at")
        return frames.html(f"the run: {self._word(self.verdict)}", head, map(self._told, self.values()))

    @staticmethod
    def _word(verdict: Verdict | None) -> str:
        return "no verdict" if verdict is None else verdict.value

    def _told(self, series: Series) -> tuple[str, ...]:
        if not series.known:
            return series.name, self._word(series.verdict), "never gave a result", "", ""
        worst, unit = series.worst(), series.unit
        pair = against(worst.value, worst.limit, unit, at_most=series.at_most)
        figures = [text if text == "–" else with_unit(text, unit) for text in (pair.value, pair.limit)]
        return series.name, self._word(series.verdict), *figures, f"{worst.t:.2f} s"

    @property
    def verdict(self) -> Verdict | None:
        """Verdict of the whole run; None when no criterion has one."""
        return worst_verdict(s.verdict for s in tuple(self._series.values()))

    def verdicts(self) -> tuple[Verdict | None, ...]:
        """Verdict of each criterion so far."""
        return tuple(series.verdict for series in tuple(self._series.values()))

    @property
    def decided(self) -> float | None:
        """Least share of the run that a criterion with a verdict decided, 0…1; None when none has one.

        What a criterion had nothing to judge in takes nothing from it; what it did not apply in does: nobody
        judged that, and no headline claims more than the rows below it.
        """
        shares = []
        for series in tuple(self._series.values()):
            times = series.times()
            if series.verdict is not None:
                asked = 1.0 - times.nothing
                shares.append(times.decided / asked if asked > 0 else 0.0)
        return min(shares, default=None)

    def so_far(self, *, whole: bool) -> SoFar:
        """What a page is told of the run: ``whole`` when that is all of it."""
        criteria = {}
        for name, series in tuple(self._series.items()):
            times = series.times()
            criteria[name] = CriterionSoFar(
                verdict=series.verdict,
                decided=times.decided,
                undecided=times.undecided,
                muted=times.muted,
                nothing=times.nothing,
                open=times.open,
                reason=series.gap(),
            )
        return SoFar(
            verdict=self.verdict,
            decided=self.decided,
            criteria=criteria,
            whole=whole,
            slipped=self.slipped,
            slipped_at=self.slipped_at,
            events=tuple(self.events[-TOLD:]),
        )

    @property
    def tracking(self) -> tuple[JointLog, ...]:
        """Largest tracking error per robot and human."""
        return tuple(self._tracking.values())

    @property
    def bones(self) -> Mapping[str, BoneErrors]:
        """Tracking error per bone of the people that devices see, by the person's name."""
        return MappingProxyType(self._bones)

    def ranked(self) -> tuple[Series, ...]:
        """The series, worst verdict first and, within one verdict, in their own order."""
        order = {Verdict.EXCEEDED: 0, Verdict.UNDECIDED: 1, Verdict.WITHIN: 2, None: 3}
        return tuple(sorted(self._series.values(), key=lambda s: order[s.verdict]))

    def to_pandas(self, form: frames.Form = "wide") -> pd.DataFrame:
        """Results as a DataFrame (extra ``data``).

        Args:
            form: ``wide`` has the instants [s] as its index and the columns ``value``, ``limit`` and
                ``verdict`` of each criterion: ``frame["value"]["tcp speed"]``. ``long`` has a row per instant
                and criterion, ``parts`` one per part, ``criteria`` one per criterion; see
                `seerob.recording.frames.Form`.

        Returns:
            Units, limits and verdicts of the whole run are in ``frame.attrs``. A figure that there was not is
            NaN; verdicts are ordered categories, and none where a criterion was not asked.

        Raises:
            UnknownName: These results have no such form.
            MissingPackage: pandas is not installed.
        """
        return self.table(form).to_pandas()

    def to_arrow(self, form: frames.Form = "wide") -> pa.Table:
        """Results as an Arrow table (extra ``data``), for Parquet, Polars, DuckDB.

        Args:
            form: As of `to_pandas`; ``wide`` has the column ``t`` [s] and one per criterion, whose fields are
                ``value``, ``limit`` and ``verdict``.

        Returns:
            Units, limits and verdicts of the whole run are in its metadata, as JSON below ``seerob``.

        Raises:
            UnknownName: These results have no such form.
            InputError: A criterion of a wide table is called ``t``.
            MissingPackage: pyarrow is not installed.
        """
        return self.table(form).to_arrow()

    def table(self, form: frames.Form, snapshots: Iterable[Snapshot] | None = None) -> frames.Table:
        """Results in one of the forms of `seerob.recording.frames`.

        Args:
            form: Of the table.
            snapshots: What rows and aspects are in, of which a log keeps none.
        """
        every = tuple(self._series.values())
        return frames.table(
            form,
            [frames.criterion_series(series) for series in every],
            parts={
                s.name: [frames.criterion_series(part) for part in tuple(s.parts.values())] for s in every
            },
            snapshots=snapshots,
            criteria=frames.worst_columns(every),
        )

    def __getstate__(self) -> dict[str, Any]:
        """What was said so far, without the snapshot that was added last, whose drawings stay here."""
        return {**self.__dict__, "_last": None}

    def history(self, max_points: int = 2000) -> History:
        """Every series thinned for a plot; no extremum and no exceedance is lost."""
        return History(traces=tuple(s.thin(max_points) for s in tuple(self._series.values())))


def log_of(snapshots: Iterable[Snapshot], criteria: Iterable[CriterionInfo] = ()) -> ResultLog:
    """The log of snapshots that are already there, such as those of a recording."""
    log = ResultLog(criteria)
    for snapshot in snapshots:
        log.add(snapshot)
    return log


def result_named(snapshot: Snapshot, name: str) -> Result | None:
    """The result of one criterion in a snapshot; None when it is not in it."""
    return next((r for r in snapshot.results if r.name == name), None)
