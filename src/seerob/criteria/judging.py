"""Asking the criteria: each at its period, and what it cannot know becomes UNDECIDED."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Collection, Iterable, Sequence
from copy import copy
from functools import partial

from msgspec.structs import replace

from seerob.core.errors import Undecided, Unweighed
from seerob.core.markers import Marker, changed
from seerob.core.plugin import kind_of
from seerob.core.snapshot import Finding, Result, Verdict
from seerob.core.verdict import ROUNDING, admitted, keeps
from seerob.criteria.between_ticks import Asking, BetweenTicks
from seerob.criteria.criterion import Claim, Criterion, Evaluate
from seerob.criteria.in_hand import InHand
from seerob.criteria.noisy_speeds import shaken
from seerob.criteria.plan import Plan, Together, Whole
from seerob.criteria.plausible_places import PlausiblePlaces
from seerob.criteria.question import Bound, Kept, Question, held_names, question_of, worded
from seerob.model.model import Model
from seerob.twin.state import State
from seerob.twin.validity.hearing import SLACK
from seerob.workstation.variables import VARIABLE

SHIFT = 28800.0
"""How much later it is looked again at whom no source moves [s]: a shift of eight hours. Own choice."""

_log = logging.getLogger(__name__)
# To ask an enumeration for a member takes longer than all the rest of a judgement.
_WITHIN, _EXCEEDED, _UNDECIDED = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED


def contradiction(result: Result, criterion: Criterion) -> str:
    """Why a result cannot be what it says; empty where it can.

    Only what makes it greener than it is: nothing is within without a value and a limit that it keeps, or
    beside a part that is not.
    """
    if result.name != criterion.name:
        return f"its result is called {result.name!r}, not {criterion.name!r}"
    verdict = result.verdict
    if verdict is not _WITHIN:
        known = verdict is None or type(verdict) is Verdict
        return "" if known else f"its verdict is {verdict!r}, not a seerob.Verdict"
    value, limit = result.value, result.limit
    if result.nothing:
        return "it is within, and says that there is nothing to judge"
    if value is None or limit is None:
        return f"it is within, and has no {'value' if value is None else 'limit'}"
    if math.isinf(limit):
        return f"it is within, and its limit is {limit}: nothing could exceed that"
    ends = (value,) if result.interval is None else (value, *result.interval)
    last = admitted(limit, at_most=result.at_most)
    for end in ends:
        if type(end) is float and (end <= last if result.at_most else end >= last):
            continue
        # A value that is not a number keeps no limit.
        if not keeps(end, limit, at_most=result.at_most):
            side = "above" if result.at_most else "below"
            side = "but for rounding on" if abs(end - limit) <= ROUNDING * max(1.0, abs(limit)) else side
            return f"it is within, and {end:g} {result.unit} lies {side} its limit of {limit:g} {result.unit}"
    if result.at_most is not criterion.at_most:
        return "it bounds from the other side than its kind says (at_most)"
    return _worse_part(result) if result.parts or result.rows else ""


def unsaid(result: Result, criterion: Criterion) -> str:
    """Why a result without a verdict is not passed over; empty where it may be.

    It may where it informs of a figure that has no limit, or says that there is nothing to judge, and why.
    """
    if result.verdict is not None:
        return ""
    if result.nothing:
        return "" if result.reason else "it says that there is nothing to judge, and not why"
    limits = result.limit, getattr(criterion, "limit", None)
    what = "" if limits == (None, None) else "it has a limit and no verdict"
    if result.value is None and result.interval is None:
        what = "it says nothing, neither a figure nor a verdict"
    return f"{what}: where there is nothing to judge, say nothing=True with a reason" if what else ""


def _worse_part(result: Result) -> str:
    nested = False
    for part in result.parts:
        verdict = part.verdict
        if verdict is _EXCEEDED or verdict is _UNDECIDED:
            return f"it is within, and its part {part.name} is {verdict}"
        nested = nested or bool(part.parts or part.rows)
    for row in result.rows:
        if row.verdict is _EXCEEDED or row.verdict is _UNDECIDED:
            return f"it is within, and its part {row.name} is {row.verdict}"
    return next(filter(None, map(_worse_part, result.parts)), "") if nested else ""


def _limit_of(criterion: Criterion) -> float | None:
    """The limit that the file states; None where that is no number, or one without end."""
    limit = getattr(criterion, "limit", None)
    return limit if isinstance(limit, (int, float)) and math.isfinite(limit) else None


def _endless(result: Result) -> str:
    """Which number of a result, or of its parts, is not finite; empty where all are."""
    ends = zip(("an end of its interval",) * 2, result.interval or (), strict=False)
    for what, number in (("its value", result.value), ("its limit", result.limit), *ends):
        if number is not None and not math.isfinite(number):
            return f"{what} is {number}, not a finite number"
    return next((f"{part.name}: {what}" for part in result.parts if (what := _endless(part))), "")


def _unknown(criterion: Criterion, reason: str) -> Result:
    """What is said of a criterion that could not be asked."""
    return Result(
        name=criterion.name,
        unit=criterion.unit,
        limit=_limit_of(criterion),
        at_most=criterion.at_most,
        verdict=_UNDECIDED,
        reason=reason,
    )


def _where(bound: Bound) -> str:
    return kind_of(bound.group, bound.criterion)


def undecided(result: Result, reason: str) -> Result:
    """Take a result back: what is within, in it, its parts, rows and markers, becomes undecided.

    The one way in which what a criterion said is taken back, whoever has reason to. What is exceeded stays,
    for what is known suffices; a figure without a verdict informs as before. That there is nothing to judge
    (neither a figure nor a verdict: nobody is near) is taken back too.
    """
    nothing = result.verdict is None and result.value is None
    taken_back = nothing or result.verdict is Verdict.WITHIN
    return replace(
        result,
        verdict=Verdict.UNDECIDED if taken_back else result.verdict,
        nothing=result.nothing and not taken_back,
        reason=f"{reason}; {result.reason}".removesuffix("; ") if taken_back else result.reason,
        parts=tuple(_open(part, reason) for part in result.parts),
        rows=tuple(
            replace(row, verdict=Verdict.UNDECIDED, reason=f"{reason}; {row.reason}".removesuffix("; "))
            if row.verdict is Verdict.WITHIN
            else row
            for row in result.rows
        ),
        markers=changed(result.markers, _open_marker),
    )


def openings_decide(model: Model, criterion: Criterion) -> str:
    """Why what is within by a mesh as it is may not be: nobody says whether its openings are closed."""
    judged = {model.bodies[i].owner for i in criterion.judged(model)}
    names = [name for name in model.possibly_closed if name in judged] or model.possibly_closed
    return (
        f"it rests on openings of {', '.join(names)}, and nobody says whether they are closed in reality: "
        'give openings = "open" or "closed" there'
    )


def closed_too(result: Result, closed: Result, why: str) -> Result:
    """What is said of meshes as they are, as far as it is said of them with their openings closed, too.

    Args:
        result: Of the meshes as they are, whose value it keeps.
        closed: Of the same criterion with all openings closed of which nobody says whether they are.
        why: What is within by the meshes alone rests on.
    """
    same = result.limit == closed.limit and result.t == closed.t
    if same and result.value is not None and closed.value is not None:
        ends = [end for each in (result, closed) for end in (each.value, *(each.interval or ()))]
        least, most = min(ends), max(ends)
        result = replace(result, interval=(least, most)) if least < most else result
    kept = closed.verdict is _WITHIN or closed.nothing or closed.muted
    return result if kept or _verdicts(closed) == _verdicts(result) else undecided(result, why)


def _verdicts(result: Result) -> tuple[object, ...]:
    """What a result says of all that it is made of."""
    return result.verdict, *(row.verdict for row in result.rows), *map(_verdicts, result.parts)


def _open_marker(marker: Marker) -> Marker:
    return replace(marker, verdict=_UNDECIDED) if marker.verdict is _WITHIN else marker


def _open(part: Result, reason: str) -> Result:
    return part if part.verdict is None and part.value is None else undecided(part, reason)


def plan_of(questions: Sequence[Question]) -> Plan:
    """What of a tick can be computed together: of shipped kinds, what is asked at every tick.

    Whoever was not asked in a clear tick yet, or asked for more than they declare, is asked alone.
    """
    kinds = dict[tuple[Callable[..., Together | Whole], int], list[int]]()
    for i, question in enumerate(questions):
        bound, rests = question.bound, question.rests
        if question.own or not question.always or question.relied_on or bound.evaluate is not bound.given:
            continue
        if rests is None or question.undeclared or not rests <= question.declared:
            continue
        if (kind := question.criterion.planned(question.model)) is not None:
            kinds.setdefault((kind, id(question.model)), []).append(i)
    every = []
    for (kind, _), indices in kinds.items():
        criteria = [questions[i].criterion for i in indices]
        same = [
            Result(name=each.name, unit=each.unit, limit=getattr(each, "limit", None), at_most=each.at_most)
            for each in criteria
        ]
        every.append((kind(criteria, questions[indices[0]].model), indices, same))
    return Plan(every, len(questions))


def _asked_alone(bound: Bound, evaluate: Evaluate, state: State) -> Result:
    """What one's own says of a state, of which it is given the accessors, and nothing that others read."""
    with state.for_author(bound.criterion.name) as own:
        return evaluate(own)


class Judge:
    """Asks every criterion at its period; what it cannot know becomes UNDECIDED.

    Args:
        bound: The criteria.
        findings: Of sources and of the run, besides those of the model (`Finding.holds`).
        unmoved: Whom nothing moves; who is not heard at the first instant, and no source drives, when not
            given.
    """

    def __init__(
        self, bound: Sequence[Bound], findings: Iterable[Finding] = (), unmoved: Collection[str] | None = None
    ) -> None:
        self._given, self._unmoved = bound, unmoved
        self._bound = (*bound, *(one.closed for one in bound if one.closed is not None))
        """And each that may be closed, after all as they are."""
        self._openings: dict[int, str] = {}
        """By place of each that may be closed, why it is not within where that decides."""
        self._first = True
        self._questions: list[Question] = []
        """Of every criterion, once the model is known."""
        self._findings = tuple(findings)
        self._holds = False
        """Whether anything is held."""
        self._plausible_places: PlausiblePlaces | None = None
        self._worded: tuple[Finding, ...] = ()
        """What it says now."""
        self._claims: list[Claim] = []
        """That nothing has contradicted yet."""
        self._plan: Plan | None = None
        """What of a tick is computed together, once everybody was asked alone in one that is clear."""
        self._between = BetweenTicks([one.watch for one in bound])
        self._passed: list[bool] = []
        """Whether each did not apply at the last tick."""
        self._warned: set[str] = set()

    def __call__(self, state: State) -> tuple[Result, ...]:
        """Results at this state, in the order of the file."""
        if self._plausible_places is None:
            model = state.model
            models = (model,) * len(self._given) + (model.closed or model,) * len(self._bound)
            self._questions = [question_of(*each) for each in zip(self._bound, models, strict=False)]
            findings = tuple(dict.fromkeys((*model.findings, *self._findings)))
            self._hold(model, findings)
            self._plausible_places = PlausiblePlaces(model)
            self._in_hand = InHand(model, self._given)
            known = {finding.holds for finding in findings}
            claims = (claim for one in self._given for claim in one.criterion.claims(model))
            self._claims = [claim for claim in claims if claim.holds not in known]
        worded = self._plausible_places.at(state)
        refuted = [(claim, what) for claim in self._claims if (what := claim(state)) is not None]
        if worded is not None or refuted:
            self._worded = self._worded if worded is None else worded
            self._findings = (*self._findings, *(what for _, what in refuted))
            self._claims = [claim for claim in self._claims if claim not in [one for one, _ in refuted]]
            findings = tuple(dict.fromkeys((*state.model.findings, *self._findings, *self._worded)))
            self._hold(state.model, findings)
        results = self._asked_together(state)
        if self._first:
            self._first = False
            every = zip(self._questions, results, strict=True)
            results = [self._lasting(question, result, state) for question, result in every]

        def ask(i: int) -> Result:
            self._questions[i].kept = None
            return self._one(self._questions[i], state)

        def look(i: int, evaluate: Evaluate, shadow: State, applies: bool) -> Result:
            return self._now(self._questions[i], evaluate, shadow, applies=applies)

        # What is held is taken back last: what is exceeded between two ticks is looked for all the same.
        found = self._between(state, results, Asking(ask, look, undecided))
        found, self._passed = self._untold(found, state), [result.muted for result in found]
        if len(found) > len(self._given):
            found = self._closed_too(found)
        if not self._in_hand.never:
            for i, why in self._in_hand.reasons(state, found).items():
                if not found[i].muted:
                    found = (*found[:i], undecided(found[i], why), *found[i + 1 :])
        if not self._holds:
            return found
        return tuple(
            undecided(result, question.why) if question.why and not result.muted else result
            for result, question in zip(found, self._questions, strict=False)
        )

    def _closed_too(self, results: tuple[Result, ...]) -> tuple[Result, ...]:
        """What is said of everything as its meshes are, as far as it is said with openings closed, too."""
        found, closed = list(results[: len(self._given)]), iter(results[len(self._given) :])
        for i, one in enumerate(self._given):
            if one.closed is not None:
                if i not in self._openings:
                    self._openings[i] = openings_decide(self._questions[i].model, one.criterion)
                found[i] = closed_too(found[i], next(closed), self._openings[i])
        return tuple(found)

    def _untold(self, results: tuple[Result, ...], state: State) -> tuple[Result, ...]:
        """Results without what rests on a variable of which samples turn out to be missing."""
        gaps = () if state.path is None else state.path.gaps or ()
        lost = {gap.name: gap for gap in gaps if gap.name.startswith(VARIABLE)}
        if not lost:
            return results
        found, muted = list(results), self._passed or [False] * len(results)
        for i, question in enumerate(self._questions):
            applied = not (results[i].muted or muted[i])
            names = question.declared & lost.keys() - ({question.muted_by} if applied else set())
            if names:
                gap = lost[min(names)]
                text = (
                    f"samples of {gap.name} are missing from {gap.begin:.4g} s to {gap.end:.4g} s: nobody "
                    "knows what it was meanwhile"
                )
                found[i] = replace(undecided(results[i], text), muted=False)
        return tuple(found)

    @property
    def looks(self) -> int:
        """How many instants between ticks were looked at so far."""
        return self._between.looks

    def _hold(self, model: Model, findings: Sequence[Finding]) -> None:
        """Resolve what is held by findings, and by shapes that are missing."""
        names = held_names(findings, model)
        for question in self._questions:
            holds = question.hold(findings, names)
            self._holds = self._holds or holds  # and stays so for what was said meanwhile

    def _asked_together(self, state: State) -> list[Result]:
        """What criteria say of a tick: those of its plan together where nothing is in doubt, others alone.

        A plan is made of those that were asked alone in such a tick before, and asked for whom they declare.
        """
        questions, plan = self._questions, self._plan
        if plan is None or not (plan.some and state.clear):
            results = [self._one(question, state) for question in questions]
            if plan is None and not self._first and state.clear:
                self._plan = plan_of(questions)
            return results
        planned = plan(state)
        results = []
        for question, result in zip(questions, planned, strict=True):
            if result is None:
                results.append(self._one(question, state))
                continue
            if self._holds and question.rests is not None:
                question.why = question.held_for(question.rests)
            results.append(result)
        return results

    def _one(self, question: Question, state: State) -> Result:
        if question.always:
            result = self._says(question, question.bound.evaluate, state)
            if self._holds:
                question.why = question.held_for(state.asked)
            if question.rests is None and result.verdict is not _UNDECIDED and state.clear:
                question.rests, self._plan = frozenset(state.asked), None  # which may hold it, too
            return result
        criterion, kept = question.criterion, question.kept
        passed_over = question.turns is not None and question.passed_over(state.t)
        if criterion.active is not None and (pulse := question.pulse(state)):
            question.kept = None
            return _unknown(criterion, pulse)
        if kept is not None and self._lasts(kept, question, state):
            if self._holds:  # also what was found out since it was asked
                question.why = question.held_for(kept.asked)
            return kept.result
        says = self._says if criterion.active is None else self._now
        result = says(question, question.bound.evaluate, state)
        if passed_over and not result.muted:
            result = undecided(result, passed_over)
        if self._holds:
            question.why = question.held_for(state.asked)
        if (every := criterion.every) is not None:
            result = replace(result, t=state.t)
            asked = tuple(sorted(state.asked))
            question.kept = Kept(result, state.t, state.t + every, result.muted, asked)
        return result

    def _lasting(self, question: Question, result: Result, state: State) -> Result:
        """What is said of the first instant of whom no source moves, as far as it is said a shift later, too.

        How long something is held is a figure of methods that judge work: none at the first instant, and
        how long a motion of somebody else lasts says nothing of it.
        """
        criterion, model = question.criterion, question.model
        by_instant = not (question.own or question.bound.group == "ergonomics" or criterion.remembers(model))
        if by_instant or result.verdict is not _WITHIN:
            return result
        unmoved = self._unmoved
        if unmoved is None:
            unmoved = [name for name, said in state.hearings.items() if not said.driven and not said.heard]
        if not question.declared <= {*unmoved, question.muted_by}:  # nor does a variable change
            return result
        later = State(state.model, copy(state.data), state.hearings, state.signals)
        later.attachments = state.attachments
        edges = question.turns(state.t, state.t + SHIFT) if question.turns is not None else ()
        later.refresh((state.t + edges[0]) / 2 if edges else state.t + SHIFT)
        evaluate = criterion.bind(model)  # what the one that is asked remembers is of the run
        said = [self._says(question, evaluate, twin) for twin in (state, later)][-1]
        limit, ends = said.limit, said.interval or ()
        keeps_it = limit is not None and all(keeps(end, limit, at_most=said.at_most) for end in ends)
        if said.verdict is _WITHIN or (said.verdict is _UNDECIDED and ends and keeps_it):
            return result
        why = "" if said.reason in result.reason else f" ({said.reason})"
        then = f"{later.t - state.t:g} s later it is {said.verdict or 'not judged'}{why}"
        text = f"no source moves whom it judges, and {then}: give a motion that lasts as long as the work"
        return undecided(result, text)

    def _at_least(self, question: Question, evaluate: Evaluate, state: State, reason: str) -> Result:
        """What the known masses of a robot exceed, when others are not known; else undecided."""
        criterion = question.criterion
        if criterion.heavier_is_worse:
            try:
                with state.asking(), state.known_masses_alone():
                    result = self._asked(question, evaluate, state)
                if result.verdict is _EXCEEDED:
                    return undecided(replace(result, reason=f"{result.reason}; at least: {reason}"), reason)
            except Exception as error:
                _log.debug("%s: %s", criterion.name, error)
        return _unknown(criterion, reason)

    def _now(self, question: Question, evaluate: Evaluate, state: State, *, applies: bool = False) -> Result:
        """What a criterion says of a state, muted where it does not apply there; as if it ``applies``.

        Where nobody knows how late what mutes it is, it is asked all the same, and exceeds nothing.
        """
        if applies or question.criterion.active is None:
            return self._says(question, evaluate, state)
        late = question.muted_late(state)
        result = self._says(question, evaluate, state, mutes=not late)
        if not late or result.verdict is not _EXCEEDED:
            return result
        doubt = _unknown(question.criterion, f"exceeded were it true: {late}")
        return replace(doubt, value=result.value, limit=result.limit, interval=result.interval)

    def _says(self, question: Question, evaluate: Evaluate, state: State, *, mutes: bool = False) -> Result:
        """What a criterion says of a state; muted by its variable where that ``mutes``."""
        criterion = question.criterion
        try:
            with state.asking():
                if mutes and (muted := self._muted(criterion, state)) is not None:
                    return muted
                return self._asked(question, evaluate, state)
        except Unweighed as reason:
            return self._at_least(question, evaluate, state, str(reason))
        except Undecided as reason:
            return _unknown(criterion, str(reason))
        except Exception as error:
            # One's own criterion that fails must not end a run that others are judged in.
            return _unknown(criterion, self._failed(question.bound, error))

    def _asked(self, question: Question, evaluate: Evaluate, state: State) -> Result:
        """What a criterion says, as far as it may be green.

        Raises:
            Undecided: What it depends on may not be relied on, or what it says is no result.
        """
        bound, criterion = question.bound, question.criterion
        if question.names:
            state.require(*question.names)
        if question.bodies:
            state.require_bodies(question.bodies)
        result = _asked_alone(bound, evaluate, state) if question.own else evaluate(state)
        if question.undeclared or not state.asked <= question.declared:
            self._rely_on_undeclared(question, state)
        if type(result) is not Result:
            what = f"{_where(bound)} returns {type(result).__name__}, not a Result"
            self._warn(bound, what)
            raise Undecided(what)
        if result.muted or result.t is not None:
            # When it was asked and whether it applied is for who asks to say: a log counts no instant twice.
            result = replace(result, t=None, muted=False)
        if reason := contradiction(result, criterion):
            reason = f"{_where(bound)} contradicts itself: {reason}"
            self._warn(bound, reason)
            if type(result.verdict) is not Verdict:
                raise Undecided(reason)
            return undecided(result, reason)
        if result.verdict is None and (silent := unsaid(result, criterion)):
            self._warn(bound, f"{_where(bound)}: {silent}")
            silent = f"{silent}; {result.reason}".removesuffix("; ")
            return replace(undecided(result, silent), verdict=_UNDECIDED, nothing=False, reason=silent)
        if result.value is not None and not math.isfinite(result.value):
            raise Undecided(f"the value is {result.value}, not a finite number")
        if question.own:
            if what := _endless(result):
                raise Undecided(what)
            if question.moves and state.late_reason(state.asked):
                # What it says where it applies is so where it does not; none that ships is greener by it.
                late = state.late_reason(state.asked - {question.muted_by})
                result = undecided(result, late) if late else result
        if (state.speeds_asked and result.verdict is _WITHIN) or question.relied_on:
            for said in question.undecided_reasons(state):
                if said:
                    return undecided(result, str(said))
        if state.speeds_asked and question.shaken and state.speed_errors:
            return self._shaken(question, result, state)
        return result

    def _rely_on_undeclared(self, question: Question, state: State) -> None:
        """Require whom a criterion asked for without having said so, at this instant or before.

        Raises:
            Undecided: One of them may not be relied on, whether or not the criterion looked at that.
        """
        undeclared = question.undeclared
        undeclared |= state.asked - question.declared
        whole = question.criterion.whole
        for name in sorted(undeclared):
            reason_of = (
                state.invalid_reason if whole or name.startswith(VARIABLE) else state.invalid_source_reason
            )
            if reason := reason_of(name):
                raise Undecided(f"{reason}; it depends on that and does not declare it (depends, variables)")

    def _shaken(self, question: Question, result: Result, state: State) -> Result:
        """A result with the noise of speeds that it asked for in its interval; undecided across a limit."""
        criterion = question.criterion
        if question.again is None:
            question.again = (
                None if criterion.remembers(question.model) else criterion.bind(question.model),
            )
        (again,) = question.again
        if again is not None and question.bound.own:
            again = partial(_asked_alone, question.bound, again)
        noise = shaken(result, criterion, again, state)
        if noise.off and result.value is not None:
            low, high = result.interval or (result.value, result.value)
            result = replace(result, interval=(low - noise.off, high + noise.off))
        return undecided(result, noise.reason) if noise.reason else result

    def _failed(self, bound: Bound, error: Exception) -> str:
        what = f"{_where(bound)} failed: {worded(error)}"
        self._warn(bound, what)
        return what

    def _warn(self, bound: Bound, what: str) -> None:
        if bound.criterion.name not in self._warned:
            self._warned.add(bound.criterion.name)
            _log.warning("%s: %s", bound.criterion.name, what)

    @staticmethod
    def _lasts(kept: Kept, question: Question, state: State) -> bool:
        """Whether a result between two evaluations holds: what it rests on is heard, and not switched since.

        Set back before its instant it says nothing; nor in another phase of the task.
        """
        criterion = question.criterion
        if question.turns is not None and question.turns(kept.since, state.t):
            return False
        if not kept.since - SLACK <= state.t < kept.due - SLACK or any(map(state.input_reason, kept.asked)):
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
            limit=_limit_of(criterion),
            at_most=criterion.at_most,
            reason=f"not asked: {criterion.active} is false",
            muted=True,
        )
