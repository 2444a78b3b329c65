"""A tick's plan: criteria of which all is known are computed kind by kind, and judged in one compiled call.

In most ticks nothing of anybody is in doubt (`State.clear`). Then no accessor is refused, no speed is off,
and what a criterion asks is the same each time. So a kind computes the figures of all its criteria at once
(`Criterion.planned`); they are laid out as rows, and `seerob.kernels.verdicts.judged_rows` says what these
are against their limits, by the rule that also judges parts and recordings. Only a figure that is known and
decided is taken from a plan: each other criterion is asked alone, as ever, and says itself why.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

import numpy as np

from seerob.core.markers import Marker, drawn
from seerob.core.snapshot import Result
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING, Verdict
from seerob.kernels.verdicts import UNDECIDED, Codes, judged_rows
from seerob.recording.answers import Flags
from seerob.recording.series import CODES

if TYPE_CHECKING:
    from seerob.twin.state import State

_VERDICTS = {code: verdict for verdict, code in CODES.items()}
Draw = Callable[[], tuple[Marker, ...]]


class Rows(NamedTuple):
    """Figures of n criteria of one kind at one instant; views of those of all."""

    value: Array
    """Shape (n,), as all of them; NaN of one that is to be asked alone."""
    low: Array
    """Least that it may be; as the value where the kind has no intervals."""
    high: Array
    exceeded: Flags
    """Which exceed their limit whatever the value, which is a bound."""


@runtime_checkable
class Together(Protocol):
    """Criteria of one kind, bound together."""

    intervals: bool
    """Whether it writes `Rows.low` and `Rows.high`."""

    def compute(self, state: State, rows: Rows) -> None:
        """Write figures of an instant that is clear.

        Raises:
            Undecided: All of them are asked alone.
        """

    def present(
        self, state: State, k: int, value: float, verdict: Verdict | None
    ) -> tuple[str, Draw, tuple[Result, ...]]:
        """Say why, draw, and what is shown beside one of them that is decided; as `Criterion.present`."""


class Whole(Protocol):
    """Criteria of one kind whose figures have parts, bound together: they are results at once."""

    def results(self, state: State) -> Sequence[Result | None]:
        """Results of all at an instant that is clear; None of one that is undecided, to be asked alone.

        Raises:
            Undecided: All of them are asked alone.
        """


class Plan:
    """What of a tick is computed together.

    Args:
        given: Of every kind its criteria, and the names, units, limits and sides of their results.
        count: How many criteria there are in all.
    """

    def __init__(
        self, given: Sequence[tuple[Together | Whole, Sequence[int], Sequence[Result]]], count: int
    ) -> None:
        self._whole = [(k, indices) for k, indices, _ in given if not isinstance(k, Together)]
        kinds = [(k, indices, results) for k, indices, results in given if isinstance(k, Together)]
        kinds.sort(key=lambda each: each[0].intervals)  # exact ones first: one copy for all
        self.some = bool(given)
        """Whether anything is."""
        self._count, every = count, [same for _, _, results in kinds for same in results]
        n = len(every)
        self._value, self._low, self._high = np.empty((3, n))
        self._exceeded, self._verdicts = np.zeros(n, np.bool_), np.empty(n, np.uint8)
        self._limit = np.array([np.nan if same.limit is None else same.limit for same in every])
        self._limited, self._at_most = ~np.isnan(self._limit), np.array([s.at_most for s in every], np.bool_)
        self._kinds: list[tuple[Together, Rows]] = []
        self._each: list[tuple[int, Together, int, Result]] = []
        """Of every row the criterion, its kind, which of these it is, and what of its result stays."""
        self._exact = 0
        """How many rows have no interval."""
        for kind, indices, results in kinds:
            rows = slice(len(self._each), len(self._each) + len(indices))
            self._exact += 0 if kind.intervals else len(indices)
            own = Rows(self._value[rows], self._low[rows], self._high[rows], self._exceeded[rows])
            self._kinds.append((kind, own))
            self._each += [
                (i, kind, k, same) for k, (i, same) in enumerate(zip(indices, results, strict=True))
            ]

    def __call__(self, state: State) -> list[Result | None]:
        """Results at an instant that is clear; None of every criterion that is to be asked alone."""
        found: list[Result | None] = [None] * self._count
        exact, value, low, high = self._exact, self._value, self._low, self._high
        with state.asking():
            for kind, rows in self._kinds:
                try:
                    kind.compute(state, rows)
                except Exception:  # whoever is asked alone says why
                    rows.value[:] = np.nan
            for whole, indices in self._whole:
                try:
                    for i, result in zip(indices, whole.results(state), strict=True):
                        found[i] = result
                except Exception:  # noqa: S112 - likewise
                    continue
            low[:exact] = high[:exact] = value[:exact]
            codes: Codes = self._verdicts
            judged_rows(
                value, low, high, self._limit, self._limited, self._at_most, self._exceeded, ROUNDING, codes
            )
            figures = zip(
                self._each, codes.tolist(), value.tolist(), low.tolist(), high.tolist(), strict=True
            )
            for (i, kind, k, same), code, number, least, most in figures:
                if code == UNDECIDED:
                    continue
                verdict = _VERDICTS[code]
                try:
                    reason, draw, parts = kind.present(state, k, number, verdict)
                except Exception:  # noqa: S112 - likewise
                    continue
                found[i] = Result(
                    name=same.name, value=number, unit=same.unit, limit=same.limit, at_most=same.at_most,
                    verdict=verdict, reason=reason, interval=(least, most) if least < most else None,
                    parts=parts, markers=drawn(draw),
                )  # fmt: skip
        return found
