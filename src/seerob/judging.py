"""Asking the criteria: each at its period, and what it cannot know becomes UNDECIDED."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from msgspec.structs import replace

from seerob.criterion import Criterion, Evaluate
from seerob.errors import Undecided
from seerob.model import Model
from seerob.snapshot import Basis, Result, Verdict
from seerob.state import State
from seerob.whereabouts.hearing import SLACK


@dataclass(frozen=True)
class Bound:
    """A criterion whose names are resolved."""

    criterion: Criterion
    group: str
    evaluate: Evaluate
    basis: Basis


def bound(criterion: Criterion, model: Model) -> Evaluate:
    """The criterion with its names resolved; never within where parts of a robot have no shape."""
    evaluate, unseen = criterion.bind(model), criterion.unseen(model)
    if not unseen:
        return evaluate

    def judged(state: State) -> Result:
        result = evaluate(state)
        nobody = result.verdict is None and result.value is None
        if result.verdict is not Verdict.WITHIN and not nobody:
            return result
        reason = f"{unseen}; {result.reason}".removesuffix("; ")
        markers = tuple(
            replace(marker, verdict=Verdict.UNDECIDED) if getattr(marker, "verdict", None) else marker
            for marker in result.markers
        )
        return replace(result, verdict=Verdict.UNDECIDED, reason=reason, markers=markers)

    return judged


class _Kept(NamedTuple):
    """An answer of a criterion with a period of its own, until it is asked again."""

    result: Result
    since: float
    """Run time at which it was asked [s]."""
    due: float
    """Run time from which it is asked again [s]."""
    muted: bool
    """Whether it did not apply then."""
    asked: tuple[str, ...]
    """Robots, people and variables that it rests on."""


class Judge:
    """Asks every criterion at its period; what it cannot know becomes UNDECIDED."""

    def __init__(self, bound: Sequence[Bound]) -> None:
        self._bound = bound
        self._kept: dict[int, _Kept] = {}

    def __call__(self, state: State) -> tuple[Result, ...]:
        """Results at this state, in the order of the file."""
        return tuple(self._one(i, bound, state) for i, bound in enumerate(self._bound))

    def _one(self, i: int, bound: Bound, state: State) -> Result:
        kept = self._kept.get(i)
        criterion = bound.criterion
        if kept and self._lasts(kept, criterion, state):
            return kept.result
        state.asked.clear()
        muted: Result | None = None
        try:
            muted = self._muted(criterion, state)
            result = muted or bound.evaluate(state)
            if result.value is not None and not math.isfinite(result.value):
                raise Undecided(f"the value is {result.value}, not a finite number")
        except Undecided as reason:
            result = Result(
                name=criterion.name,
                unit=criterion.unit,
                limit=getattr(criterion, "limit", None),
                at_most=criterion.at_most,
                verdict=Verdict.UNDECIDED,
                reason=str(reason),
            )
        result = replace(result, basis=bound.basis)
        if criterion.every is not None:
            result = replace(result, t=state.t)
            due, asked = state.t + criterion.every, tuple(sorted(state.asked))
            self._kept[i] = _Kept(result, state.t, due, muted is not None, asked)
        return result

    @staticmethod
    def _lasts(kept: _Kept, criterion: Criterion, state: State) -> bool:
        """Whether a result between two evaluations holds: what it rests on is heard, and not switched since.

        Set back before its instant it says nothing.
        """
        if not kept.since - SLACK <= state.t < kept.due - SLACK or any(map(state.interrupted, kept.asked)):
            return False
        return criterion.active is None or bool(state.signal(criterion.active)) is not kept.muted

    @staticmethod
    def _muted(criterion: Criterion, state: State) -> Result | None:
        """The result of a criterion that its variable says does not apply now; None when it applies."""
        if criterion.active is None or state.signal(criterion.active):
            return None
        return Result(
            name=criterion.name,
            unit=criterion.unit,
            limit=getattr(criterion, "limit", None),
            at_most=criterion.at_most,
            reason=f"not asked: {criterion.active} is false",
        )
