"""Asking the criteria: each at its period, and what it cannot know becomes UNDECIDED."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from msgspec.structs import replace

from seerob.between_ticks import BetweenTicks, Watch
from seerob.criterion import Criterion, Evaluate
from seerob.errors import Undecided, UnknownName
from seerob.model import Model
from seerob.snapshot import Basis, Finding, Result, Verdict
from seerob.state import State
from seerob.whereabouts.hearing import SLACK


@dataclass(frozen=True)
class Bound:
    """A criterion whose names are resolved."""

    criterion: Criterion
    group: str
    evaluate: Evaluate
    basis: Basis
    watch: Watch | None = None
    """How it is judged between two ticks; None where nothing bounds it."""


def undecided(result: Result, reason: str) -> Result:
    """The same without anything that is within: its verdict, parts, rows and markers are undecided instead.

    The one way in which what a criterion said is taken back, whoever has reason to. What is exceeded stays,
    for what is known suffices; a figure without a verdict informs as before. That there is nothing to judge
    (neither a figure nor a verdict: nobody is near) is taken back too.
    """
    nothing = result.verdict is None and result.value is None
    taken_back = nothing or result.verdict is Verdict.WITHIN
    return replace(
        result,
        verdict=Verdict.UNDECIDED if taken_back else result.verdict,
        reason=f"{reason}; {result.reason}".removesuffix("; ") if taken_back else result.reason,
        parts=tuple(_open(part, reason) for part in result.parts),
        rows=tuple(
            replace(row, verdict=Verdict.UNDECIDED, reason=f"{reason}; {row.reason}".removesuffix("; "))
            if row.verdict is Verdict.WITHIN
            else row
            for row in result.rows
        ),
        markers=tuple(
            replace(marker, verdict=Verdict.UNDECIDED) if marker.verdict is Verdict.WITHIN else marker
            for marker in result.markers
        ),
    )


def _open(part: Result, reason: str) -> Result:
    return part if part.verdict is None and part.value is None else undecided(part, reason)


def held(criterion: Criterion, model: Model, findings: Iterable[Finding]) -> str:
    """Why nothing that a criterion says of its subjects is within; empty for nothing.

    Shapes that are missing (`Criterion.unseen`), and findings that hold a name (`Finding.holds`) that means
    some of what the criterion's subjects mean.
    """
    reasons = [criterion.unseen(model)]
    subjects = criterion.subjects()
    bodies = {i for name in subjects for i in _meant(model, name)}
    for finding in findings:
        if any(
            name == "*" or name in subjects or not bodies.isdisjoint(_meant(model, name))
            for name in finding.holds
        ):
            reasons.append(finding.text)
    return "; ".join(dict.fromkeys(filter(None, reasons)))


def held_names(findings: Iterable[Finding]) -> dict[str, str]:
    """By name that findings hold, why nothing that depends on it is within."""
    found: dict[str, list[str]] = {}
    for finding in findings:
        for name in finding.holds:
            found.setdefault(name, []).append(finding.text)
    return {name: "; ".join(dict.fromkeys(texts)) for name, texts in found.items()}


def _meant(model: Model, name: str) -> tuple[int, ...]:
    """Bodies that a name means; none for one that has no shape."""
    try:
        return model.select(name)
    except UnknownName:
        return ()


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
    """Asks every criterion at its period; what it cannot know becomes UNDECIDED.

    Args:
        bound: The criteria.
        findings: Of sources and of the run, besides those of the model (`Finding.holds`).
    """

    def __init__(self, bound: Sequence[Bound], findings: Iterable[Finding] = ()) -> None:
        self._bound = bound
        self._findings = tuple(findings)
        self._held: tuple[str, ...] | None = None
        self._held_names: dict[str, str] = {}
        self._kept: dict[int, _Kept] = {}
        self._between = BetweenTicks([one.watch for one in bound])

    def __call__(self, state: State) -> tuple[Result, ...]:
        """Results at this state, in the order of the file."""
        if self._held is None:
            model = state.model
            findings = tuple(dict.fromkeys((*model.findings, *self._findings)))
            self._held = tuple(held(bound.criterion, model, findings) for bound in self._bound)
            self._held_names = held_names(findings)
        results = tuple(self._one(i, bound, state) for i, bound in enumerate(self._bound))

        def ask(i: int) -> Result:
            self._kept.pop(i, None)
            return self._one(i, self._bound[i], state)

        return self._between(state, results, ask, undecided)

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
            if muted is None and (reason := self._reason(i, state)):
                result = undecided(result, reason)
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

    def _reason(self, i: int, state: State) -> str:
        """Why nothing that a criterion has just said is within; empty for nothing."""
        assert self._held is not None
        reason = self._held[i]
        if not self._held_names:
            return reason
        texts = (text for name, text in self._held_names.items() if name in state.asked)
        return "; ".join(dict.fromkeys(filter(None, (reason, *(t for t in texts if t not in reason)))))

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
