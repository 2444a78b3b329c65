"""A criterion whose names are resolved, and what is known of it before it is asked."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from seerob.core.errors import SeerobError, UnknownName
from seerob.core.plugin import PluginError
from seerob.core.snapshot import Basis, Finding, Result
from seerob.criteria.between_ticks import Watch
from seerob.criteria.criterion import Criterion, Evaluate, not_adult
from seerob.criteria.figure import Twin
from seerob.criteria.scoring.phases import entered_for, turns
from seerob.model.model import Model
from seerob.recording.series import INFORMS
from seerob.twin.state import State
from seerob.twin.states import Reasons
from seerob.workstation.variables import VARIABLE

UNBOUNDED = "nothing bounds it between the instants at which it was asked; between_samples can accept that"


@dataclass(frozen=True)
class Bound:
    """A criterion whose names are resolved."""

    criterion: Criterion
    group: str
    evaluate: Evaluate
    basis: Basis
    watch: Watch | None = None
    """How it is judged between two ticks; None where nothing bounds it."""
    given: Evaluate | None = None
    """What its kind's `bind` gave: a plan stands for that alone."""
    closed: Bound | None = None
    """Its criterion bound to the workstation with all openings closed of which nobody says whether they are
    (`Model.closed`): nothing is within that is not so by both. None where that changes nothing."""

    def __repr__(self) -> str:
        return f"<Bound {self.criterion.name!r}: {type(self.criterion).__name__} of {self.group}>"

    @cached_property
    def own(self) -> bool:
        """Whether it is one of the user's, which does not ship."""
        return not type(self.criterion).__module__.startswith("seerob.")

    @property
    def between(self) -> str:
        """Say what is known of the time between instants (`seerob.core.snapshot.CriterionInfo.between`)."""
        if self.watch is not None:
            return self.watch.accepted
        return self.criterion.between_samples or self._of_instants or self.unbounded

    @property
    def _of_instants(self) -> str:
        """Why its method speaks of instants; of one's own the file accepts that, not its author."""
        kinds = type(self.criterion).__mro__
        says = next(kind for kind in kinds if "instants" in vars(kind))
        return self.criterion.instants if says.__module__.startswith("seerob.") else ""

    @property
    def unbounded(self) -> str:
        """Why the time between instants is not known, where nothing bounds it."""
        return INFORMS if getattr(self.criterion, "limit", UNBOUNDED) is None else UNBOUNDED


def bound_to(model: Model, criterion: Criterion, group: str) -> Bound:
    """A criterion with its names resolved.

    Raises:
        SeerobError: It cannot be, and why; whatever a criterion of one's own raises, with the place.
    """
    kind = type(criterion)
    for method, gives, instead in (
        ("compute", "the function that computes a figure", ("bind",)),
        ("basis", "formula, source, inputs", ()),
    ):
        if all(getattr(kind, each) is getattr(Criterion, each) for each in (method, *instead)):
            raise PluginError(
                f"{kind.__name__} of {kind.__module__} has no {method}: define {method}(self, model), "
                f"which returns {gives} (CONTRIBUTING.md, “A criterion”)"
            )
    method = "bind"
    try:
        evaluate = criterion.bind(model)
        method = "basis"
        basis = criterion.basis(model)
    except SeerobError:
        raise
    except Exception as error:
        raise PluginError(f"{method} of {kind.__module__} fails: {worded(error)}") from error
    for what, returned, right in (
        ("bind", evaluate, callable(evaluate)),
        ("basis", basis, isinstance(basis, Basis)),
    ):
        if not right:
            wanted = "a function of State" if what == "bind" else "a seerob.api.Basis"
            raise PluginError(f"{what} of {kind.__module__} returns {type(returned).__name__}, not {wanted}")
    shaped = group == "safety" and criterion.by_shape
    closed = bound_to(model.closed, criterion, group) if shaped and model.closed is not None else None
    return Bound(criterion, group, evaluate, basis, given=evaluate, closed=closed)


def needed(criterion: Criterion, model: Model) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Robots, people and machines, and bodies, that must be where the twin shows them before it is asked."""
    names: dict[str, None] = {}
    bodies: dict[int, None] = {}
    for name in criterion.depends(model) if criterion.whole else ():
        if name in model.mechanisms:
            names[name] = None
        elif meant := _meant(model, name):
            bodies |= dict.fromkeys(meant)
        else:
            names |= dict.fromkeys(_of_link(model, name))
    return tuple(names), tuple(bodies)


def relied_on(criterion: Criterion, model: Model) -> tuple[str, ...]:
    """Of whom something must be heard for one's own to be within that judges bone by bone, or part by part.

    One that ships raises `Undecided` itself, or finds that what is known suffices.
    """
    if criterion.whole or type(criterion).__module__.startswith("seerob."):
        return ()
    found: dict[str, None] = {}
    for name in criterion.depends(model):
        if name in model.mechanisms:
            found[name] = None
        else:
            found |= dict.fromkeys(filter(None, (model.bodies[i].mover for i in _meant(model, name))))
            found |= dict.fromkeys(_of_link(model, name))
    return tuple(found)


def _of_link(model: Model, name: str) -> tuple[str, ...]:
    """Robot, person or machine that has a link without a shape; none where the name means none."""
    link = model.frames.get(name)
    return () if link is None else tuple(m.name for m in model.mechanisms.values() if link.mj in m.mj_bodies)


def declared(model: Model, names: Iterable[str]) -> tuple[str, ...]:
    """Robots, people and machines that names mean, with what carries them and what is on them."""
    found = dict[str, None]()
    for name in names:
        if name in model.mechanisms:
            found[name] = None
            continue
        if bodies := _meant(model, name):
            found |= dict.fromkeys(filter(None, (model.bodies[i].mover for i in bodies)))
        else:
            found |= dict.fromkeys(_of_link(model, name))
    for name in tuple(found):
        mechanism = model.mechanisms[name]
        found |= dict.fromkeys((*mechanism.riders, *mechanism.holders))
        while mechanism.on:
            found[mechanism.on] = None
            mechanism = model.mechanisms[mechanism.on]
    return tuple(found)


def _all_declared(criterion: Criterion, model: Model) -> frozenset[str]:
    variables = (VARIABLE + name for name in criterion.variables())
    return frozenset((*declared(model, criterion.depends(model)), *variables))


def worded(error: Exception) -> str:
    """An error in a sentence, with the place in the code where it came from."""
    last = traceback.extract_tb(error.__traceback__)[-1:]
    place = "".join(f" ({Path(frame.filename).name}, line {frame.lineno})" for frame in last)
    return f"{type(error).__name__}: {error}{place}"


def unmoved(names: Collection[str]) -> str:
    """Why nothing is within that asked for speeds which nothing tells: whose, by name; empty for nobody's."""
    who = ", ".join(sorted(names))
    return f"{who}: no source says how it moves, and how fast it is was asked" if who else ""


def held(criterion: Criterion, model: Model, findings: Iterable[Finding]) -> str:
    """Why nothing that a criterion says of its subjects is within; empty for nothing.

    Shapes that are missing (`Criterion.unshaped`), and findings that hold a name (`Finding.holds`) that means
    some of what the criterion's subjects mean.
    """
    reasons = [criterion.unshaped(model)]
    subjects = criterion.subjects()
    bodies = {i for name in subjects for i in _meant(model, name)}
    if criterion.adults:
        every = {human.name for human in model.workstation.humans}
        people = every.intersection((*subjects, *criterion.depends(model)))
        reasons += [not_adult(model, name) for name in sorted(people)]
    for finding in findings:
        if any(
            name in ("*", criterion.name, *subjects) or not bodies.isdisjoint(_meant(model, name))
            for name in finding.holds
        ):
            reasons.append(finding.text)
    return "; ".join(dict.fromkeys(filter(None, reasons)))


def unmentioned(criterion: Criterion, model: Model) -> dict[str, str]:
    """By robot that no subject means, what no shape shows of it: should it be asked all the same."""
    if not criterion.by_shape:
        return {}
    subjects = criterion.depends(model)
    meant = {model.bodies[i].carrier for name in subjects for i in _meant(model, name)}
    meant |= {name.partition("/")[0] for name in subjects}
    every = {name: model.unshaped((name,)) for name in model.mechanisms if name not in meant}
    return {name: text for name, text in every.items() if text}


def held_names(findings: Iterable[Finding], model: Model) -> dict[str, str]:
    """By name that findings hold, why nothing that depends on it is within."""
    found: dict[str, list[str]] = {}
    for finding in findings:
        for name in finding.holds:
            found.setdefault(name, []).append(finding.text)
    for mechanism in model.mechanisms.values():
        above = mechanism.on
        while above:  # whatever is known of it is known of where its carrier is
            found.setdefault(mechanism.name, []).extend(found.get(above, ()))
            above = model.mechanisms[above].on
    return {name: "; ".join(dict.fromkeys(texts)) for name, texts in found.items() if texts}


def _meant(model: Model, name: str) -> tuple[int, ...]:
    """Bodies that a name means; none for one that has no shape."""
    try:
        return model.select(name)
    except UnknownName:
        return ()


class Kept(NamedTuple):
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


@dataclass(slots=True, eq=False)
class Question:
    """A criterion, and what is known of it before it is asked, of one instant or of many."""

    bound: Bound
    criterion: Criterion
    model: Model
    """To which it is bound."""
    names: tuple[str, ...]
    """Robots, people and machines that must be where the twin shows them before it is asked."""
    bodies: tuple[int, ...]
    """Bodies, likewise."""
    declared: frozenset[str]
    """Whom it says that it rests on, and the variables."""
    unmentioned: dict[str, str]
    """By robot that no subject means, what no shape shows of it."""
    moves: bool = True
    """Whether it is about bodies: what is late of that was elsewhere."""
    relied_on: tuple[str, ...] = ()
    """Of whom something must be heard where it is within."""
    held: str = ""
    """Why nothing that it says of its subjects is within."""
    undeclared: set[str] = field(default_factory=set)
    """Who else it asked for so far."""
    kept: Kept | None = None
    again: tuple[Evaluate | None] | None = None
    """Another one of it, for what errors of speeds would change; none of one that remembers."""
    turns: Callable[[float, float], Sequence[float]] | None = None
    """When what its phases enter changes between two instants (`seerob.criteria.scoring.phases.turns`)."""
    since: float | None = None
    """The last instant at which it was looked whether it applies [s]."""
    seen: tuple[float, str] | None = None
    """The last instant [s], and why nothing is within there: a phase that began and ended since the one
    before."""
    why: str = ""
    """Why nothing that it said last is within."""
    rests: frozenset[str] | None = None
    """Whom it asks for where nothing of anybody is in doubt; None until it was asked so."""
    own: bool = field(init=False)
    """Whether it is one of the user's, which does not ship."""
    always: bool = field(init=False)
    """Whether it is asked at every tick, whatever variables and phases of the task say."""
    shaken: bool = field(init=False)
    """Whether the judge finds out what errors of speeds would change (`Criterion.by_speed`)."""
    held_names: Mapping[str, str] = field(default_factory=dict)
    """By name that findings hold, why nothing that depends on it is within."""

    def __post_init__(self) -> None:
        self.own, self.shaken = self.bound.own, not self.criterion.by_speed
        self.always = self.criterion.active is None and self.criterion.every is None and self.turns is None

    def hold(self, findings: Iterable[Finding], names: Mapping[str, str]) -> bool:
        """Take note of what is held by findings, and by shapes that are missing; whether anything is.

        Args:
            findings: See `held`.
            names: What they hold, by name (`held_names`).
        """
        self.held, self.held_names = held(self.criterion, self.model, findings), names
        return bool(self.held or self.unmentioned or names)

    def held_for(self, asked: Collection[str]) -> str:
        """Why nothing is within that it said when it asked for these; empty for nothing."""
        if not self.held_names and not self.unmentioned:
            return self.held
        every = (*self.held_names.items(), *self.unmentioned.items())
        texts = (text for name, text in every if name in asked)
        return "; ".join(dict.fromkeys(filter(None, (self.held, *(t for t in texts if t not in self.held)))))

    def undecided_reasons(self, twin: Twin) -> Iterator[str | Reasons]:
        """Why what it has just said of the twin is not within, by what it asked for: empty where it is.

        The rules of a run and of arrays; of N instants each is a text, of all of them, or has the shape (N,).
        """
        if twin.speeds_asked and (still := [name for name in twin.speeds_asked if not twin.moved(name)]):
            yield unmoved(still)
        for name in self.relied_on:
            yield twin.invalid_source_reason(name)

    @property
    def muted_by(self) -> str:
        """The variable that says whether it applies, as inputs are called; empty for none."""
        return "" if self.criterion.active is None else VARIABLE + self.criterion.active

    def muted_late(self, state: State) -> str:
        """Why it may apply though a variable says that it does not; empty where that is known."""
        if not (self.muted_by and self.moves and (late := state.late_reason((self.muted_by,)))):
            return ""
        return late if state.signals.at(self.criterion.active or "", state.t).value is False else ""

    def pulse(self, state: State) -> str:
        """Why one that does not apply is not muted: it did, between two ticks only; empty where it did not.

        One that is bounded between ticks is judged there by itself (`BetweenTicks`).
        """
        active = self.criterion.active
        if active is None or self.bound.watch is not None:
            return ""
        before, self.since = self.since, state.t
        if before is None or not before < state.t:
            return ""
        switches = state.signals.switches(active, before, state.t)
        ends = (state.signals.at(active, t).value for t in (before, state.t))
        if len(switches) < 2 or any(value is not False for value in ends):
            return ""
        return f"{active} was true from {switches[0]:.6g} s, between two ticks only, and nobody asked it then"

    def passed_over(self, t: float) -> str:
        """Why nothing is within at an instant [s]: a phase began and ended since the last one."""
        if self.turns is None:
            return ""
        if self.seen is None or self.seen[0] != t:
            edges = () if self.seen is None else self.turns(self.seen[0], t)
            text = ""
            if len(edges) > 1:
                text = (
                    f"what is entered from {edges[0]:.6g} s to {edges[1]:.6g} s lies between two ticks, and "
                    "is judged at no instant: give a shorter engine.tick"
                )
            self.seen = t, text
        return self.seen[1]


def question_of(bound: Bound, model: Model) -> Question:
    """What is known of a criterion before it is asked."""
    names, bodies = needed(bound.criterion, model)
    declared = _all_declared(bound.criterion, model)
    shapeless, rests = unmentioned(bound.criterion, model), relied_on(bound.criterion, model)
    phases = entered_for(model, bound.criterion)
    changes = turns(phases) if phases else None
    moves = bool(bound.criterion.depends(model))
    return Question(
        bound, bound.criterion, model, names, bodies, declared, shapeless, moves, rests, turns=changes
    )
