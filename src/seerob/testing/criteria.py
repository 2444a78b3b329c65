"""Whether criteria say within where nobody knows: each is asked while all is known, and once it is not."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from msgspec.structs import replace as changed

from seerob.core.samples import JointSample, Quality, SignalSample
from seerob.core.snapshot import Finding, Result, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING
from seerob.criteria.between_ticks import BetweenTicks, least_margin, watched
from seerob.criteria.criterion import Criterion
from seerob.criteria.judging import Judge
from seerob.criteria.question import bound_to, declared
from seerob.description.humans.skeleton import BONES, PARENTS, ROOT
from seerob.model.model import Mechanism, Model
from seerob.session.station import Station, load
from seerob.twin.engine import Engine
from seerob.twin.spans import Points
from seerob.twin.state import State
from seerob.twin.validity.hearing import BonesHeard
from seerob.workstation.variables import VARIABLE, Kind, Value, Variable

TICKS = 18
TIMEOUT = 4
"""Ticks of silence after which nobody is known to be where they were."""
SPOILED = 8
"""Tick from which what is said is spoiled."""
SWING = 1e-3
"""Amplitude of the motion of every joint of a robot or person [rad or m]."""
ELSEWHERE = 0.2
"""By how much joints of those who must not matter are moved [rad or m]."""
SETTLED = 2
"""Tick at which somebody in a posture of their own is asked."""
MUTE = "seerob.testing/asked"

SampleChange = Callable[[JointSample, int], JointSample | None]


@dataclass(frozen=True)
class Spoiling:
    """One way in which what is said can be wrong."""

    what: str
    said: SampleChange
    """What is said instead at a tick; None for nothing."""
    ticks: range
    """In which nothing that depends on it may be within."""


def _number(k: int, sample: JointSample, **more: object) -> JointSample:
    return sample if k < SPOILED else changed(sample, **more)


_NAN = float("nan")
_LATER = range(SPOILED + TIMEOUT + 2, TICKS)
SPOILINGS = (
    Spoiling("never heard", lambda s, k: None, range(TICKS)),
    Spoiling("stale", lambda s, k: s if k < SPOILED else None, _LATER),
    Spoiling("heard at every eighth tick only", lambda s, k: None if k % 8 else s, range(6, 8)),
    Spoiling("late by more than its time-out", lambda s, k: changed(s, t=s.t - 1.0), range(TICKS)),
    Spoiling("repeated", lambda s, k: s if k < SPOILED else changed(s, t=(SPOILED - 1) * _PERIOD), _LATER),
    Spoiling("set back in time", lambda s, k: _number(k, s, t=s.t - SPOILED * _PERIOD), _LATER),
    Spoiling(
        "not a number",
        lambda s, k: _number(k, s, q=(_NAN,) * len(s.q)),
        range(SPOILED + 1, TICKS),
    ),
    Spoiling(
        "one joint not a number",
        lambda s, k: _number(k, s, q=(*s.q[:-1], _NAN)),
        range(SPOILED + 1, TICKS),
    ),
    Spoiling(
        "speeds not a number",
        lambda s, k: _number(k, s, qd=(_NAN,) * len(s.q)),
        range(SPOILED + 1, TICKS),
    ),
    Spoiling(
        "jumping to and fro",
        lambda s, k: _number(k, s, q=tuple(q + 2.0 * (k % 2) for q in s.q)),
        range(SPOILED + 1, TICKS),
    ),
    Spoiling(
        "called invalid by its source",
        lambda s, k: _number(k, s, quality=Quality.INVALID),
        range(SPOILED + 1, TICKS),
    ),
    Spoiling(
        "called degraded by its source",
        lambda s, k: _number(k, s, quality=Quality.DEGRADED),
        range(SPOILED + 1, TICKS),
    ),
)
_PERIOD = 0.01


def never_within(
    cell: Station | Path | str, values: Mapping[str, Value] | None = None, *, names: Sequence[str] = ()
) -> None:
    """Fail unless every criterion of a workstation is within when all is known, and never when it is not.

    Args:
        cell: A workstation, or its file or folder; nobody but this harness drives it.
        values: Of variables, by name, where all is known; else false, 0 and an empty text.
        names: Criteria that are asked, by name; all of them when not given.

    Raises:
        AssertionError: With every criterion that is within where it must not be, or is none.
        InputError: The workstation cannot be used.
    """
    station = cell if isinstance(cell, Station) else load(cell, allow_plugins=True)
    asked = [
        (criterion, group)
        for group in ("safety", "ergonomics")
        for criterion in getattr(station.workstation, group)
        if not names or criterion.name in names
    ]
    if unknown := nobody_called(names, [criterion.name for criterion, _ in asked], "criterion"):
        raise AssertionError(unknown)
    failures = _Harness(station.model, values or {}, asked).failures()
    if failures:
        raise AssertionError("\n".join(dict.fromkeys(failures)))


class _Harness:
    """One workstation, without physics, whose robots, people and machines are all driven from here."""

    def __init__(
        self, model: Model, values: Mapping[str, Value], asked: Sequence[tuple[Criterion, str]]
    ) -> None:
        station = changed(
            model.workstation,
            engine=changed(model.workstation.engine, physics=False, tick=_PERIOD),
        )
        mute = Variable(name=MUTE, source="seerob.testing", address="", type=Kind.BOOL)
        dictionary = {**model.dictionary, MUTE: mute}
        self.model = replace(model, workstation=station, dictionary=dictionary)
        self._values = {MUTE: True, **{v.name: _usual(v) for v in model.dictionary.values()}, **values}
        self._asked = [(changed(criterion, every=None), group) for criterion, group in asked]

    def failures(self) -> list[str]:
        """What is wrong, one sentence each."""
        criteria = [criterion for criterion, _ in self._asked]
        whom = [declared(self.model, criterion.depends(self.model)) for criterion in criteria]
        variables = [set(criterion.variables()) for criterion in criteria]
        clean = list(self._run())
        told: list[str] = []
        for i, criterion in enumerate(criteria):
            results = [said[i][0] for _, said in clean]
            bad = [r for r in results if r.verdict is Verdict.EXCEEDED]
            bad += [r for r in results[-1:] if r.verdict is Verdict.UNDECIDED]
            if bad:
                what = f"it is {bad[0].verdict}, {bad[0].reason}"
                told.append(f"{criterion.name}: give a workstation in which it is within: {what}")
            wrong = [r.reason for r in results if " failed: " in r.reason or "contradicts itself" in r.reason]
            told += [f"{criterion.name}: {reason}" for reason in wrong[:1]]
            known = {*whom[i], *(VARIABLE + name for name in variables[i])}
            rests = set().union(*(said[i][1] for _, said in clean))
            if strangers := sorted(rests - known):
                what = f"it depends on {', '.join(strangers)}: say so in depends, or in variables"
                told.append(f"{criterion.name}: {what}")
        told += self._unsteady(clean)
        told += self._loses_more()
        for name in self.model.mechanisms:
            concerned = [i for i, names in enumerate(whom) if name in names]
            moved = self._run(elsewhere=name) if len(concerned) < len(criteria) else ()
            for (_, before), (_, after) in zip(clean, moved, strict=False):
                told += [
                    f"{c.name}: it changes when {name} moves, and does not declare that (depends)"
                    for i, c in enumerate(criteria)
                    if i not in concerned and not _alike(before[i][0], after[i][0])
                ]
            for spoiling in SPOILINGS if concerned else ():
                spoiled = self._run(spoil={name: spoiling.said})
                told += self._green(spoiled, concerned, f"{name} is {spoiling.what}", spoiling.ticks)
            if concerned:
                finding = Finding(level="warning", subject=name, text="seerob.testing", holds=(name,))
                told += self._green(self._run(findings=(finding,)), concerned, f"a finding holds {name}")
            if concerned and self.model.mechanisms[name].role == "human":
                hidden = self._run(hidden=name)
                told += self._green(hidden, concerned, f"no bone of {name} is sure")
                told += self._blind(name, concerned)
        asking = [i for i, names in enumerate(variables) if names]
        told += self._green(self._run(quiet=True), asking, "no variable was heard")
        told += self._green(self._run(muted=True), range(len(criteria)), "it is muted")
        return told

    def _loses_more(self) -> list[str]:
        """Whose margin falls by more between two ticks than `Criterion.falls` says."""
        points = Points(self.model)
        watches = [watched(criterion, self.model, points) for criterion, _ in self._asked]
        judges = [Judge([bound_to(self.model, criterion, group)]) for criterion, group in self._asked]
        between, told = BetweenTicks(()), dict[int, str]()
        ends: list[tuple[Sequence[Result], Array]] = []

        def look(state: State, now: Sequence[Result]) -> None:
            before, path, speeds = ends[-1:], state.path, state.largest_speeds().copy()
            ends[:] = [(now, speeds)]
            if path is None or not before:
                return
            ((was, slower),) = before
            begin, end = float(path.t[0]), float(path.t[-1])
            span = points.span(path, begin, end, state.attachments.ids, self.model.mj)
            span.between_speeds(slower, speeds)
            span.foresee, span.knots = state.foresee, state.knots
            for i, watch in enumerate(watches):
                if watch is None or watch.falls is None or watch.follows is not None or watch.remembers:
                    continue
                criterion, both = self._asked[i][0], (was[i], now[i])
                if i in told or any(result.verdict is not Verdict.WITHIN for result in both):
                    continue
                one, other = map(criterion.margin, both)
                try:
                    fall = watch.falls(span, np.minimum(one[0] - one[1], other[0] - other[1]))
                except Exception as error:
                    told[i] = f"{criterion.name}: what bounds it between two ticks failed: {error}"
                    continue
                least = least_margin(one, other, fall)
                for share in (0.25, 0.5, 0.75):
                    t = begin + share * (end - begin)
                    (there,) = judges[i](between.placed(path, t, state))
                    if there.verdict is not Verdict.WITHIN:
                        continue
                    m, off = criterion.margin(there)
                    if (left := float(np.min(m - off))) < least - ROUNDING * max(1.0, abs(least)):
                        what = f"a margin of {left:.9g} between two ticks"
                        told[i] = f"{criterion.name}: {what}, and falls bounds it by {least:.9g}"

        list(self._run(look=look))
        return list(told.values())

    def _blind(self, name: str, concerned: Sequence[int]) -> list[str]:
        """Who is within while limbs of a person are not sure, that could be where it is exceeded."""
        human, mj, told = self.model.mechanisms[name], self.model.mj, list[str]()
        bone_of = {b.mj: b.name.removeprefix(f"{name}/") for b in self.model.bodies if b.owner == name}
        moved = [bone_of.get(int(mj.dof_bodyid[v]), "") for v in human.v_address[human.own]]
        for limb in PARENTS:
            joints = [j for j, bone in enumerate(moved) if bone == limb]
            if PARENTS[limb] == ROOT or not joints:
                continue
            bones = tuple(bone for bone in PARENTS if _hangs_on(bone, limb))
            seen = self._posed(concerned, name, human.home, bones)
            within = [i for i in concerned if seen[i].verdict is Verdict.WITHIN]
            ends = [(j, float(end[j])) for j in joints for end in (human.lower, human.upper)]
            for j, end in ends if within else ():
                q = human.home.copy()
                q[j] = end
                if not math.isfinite(end):
                    continue
                there = self._posed(within, name, q, ())
                for i in [i for i in within if there[i].verdict is Verdict.EXCEEDED]:
                    within.remove(i)
                    what = f"it is within although {limb} of {name} is not sure"
                    at = f"{human.joints[j].name} at {end:.3g} rad"
                    told.append(f"{self._asked[i][0].name}: {what}, and exceeded with {at}")
        return told

    def _posed(self, which: Iterable[int], name: str, q: Array, hidden: tuple[str, ...]) -> dict[int, Result]:
        """What some say of a person in a posture, of whom some bones are not sure."""

        def posed(sample: JointSample, k: int) -> JointSample:
            return changed(sample, q=tuple(q.tolist()))

        run = self._run(spoil={name: posed}, hidden=name if hidden else "", bones=hidden, only=tuple(which))
        for k, said in run:
            if k == SETTLED:
                return dict(zip(which, (result for result, _ in said), strict=True))
        raise AssertionError

    def _unsteady(self, clean: Sequence[tuple[int, list[tuple[Result, set[str]]]]]) -> list[str]:
        """Who says another thing of what was said before, or hangs on earlier instants without saying so."""
        told: dict[int, str] = {}
        for (k, before), (_, after) in zip(clean, self._run(anew=True), strict=True):
            for i, (criterion, _) in enumerate(self._asked):
                if i in told or _alike(before[i][0], after[i][0]):
                    continue
                if k < TICKS - 1:
                    told[i] = (
                        f"{criterion.name}: it says another thing when the same is said again (chance, time)"
                    )
                elif not criterion.remembers(self.model):
                    told[i] = (
                        f"{criterion.name}: it hangs on earlier instants, and does not say so (remembers)"
                    )
        return list(told.values())

    def _green(
        self,
        run: Iterable[tuple[int, list[tuple[Result, set[str]]]]],
        concerned: Iterable[int],
        why: str,
        ticks: range = range(TICKS),
    ) -> list[str]:
        """Who of those concerned is within although nothing may be."""
        concerned, told = list(concerned), {}
        for k, said in run:
            for i in concerned if k in ticks else ():
                if i not in told and (where := where_within(said[i][0])):
                    told[i] = f"{self._asked[i][0].name}: {where} is within at tick {k} although {why}"
        return list(told.values())

    def _run(
        self,
        *,
        spoil: Mapping[str, SampleChange] | None = None,
        elsewhere: str = "",
        findings: Sequence[Finding] = (),
        hidden: str = "",
        bones: Sequence[str] = BONES,
        only: Sequence[int] | None = None,
        quiet: bool = False,
        muted: bool = False,
        anew: bool = False,
        look: Callable[[State, Sequence[Result]], None] | None = None,
    ) -> Iterator[tuple[int, list[tuple[Result, set[str]]]]]:
        """What every criterion says at every tick, and on whom that depends; the last asked ``anew``."""
        model = self.model
        sources = {v.source: TIMEOUT * _PERIOD for v in model.dictionary.values()}
        driven = dict.fromkeys(model.mechanisms, (TIMEOUT + 0.5) * _PERIOD)
        engine = Engine(model, driven=driven, live=driven, signals=sources)

        def bound() -> list[Judge]:
            which = self._asked if only is None else [self._asked[i] for i in only]
            asked = ((changed(c, active=MUTE) if muted else c, group) for c, group in which)
            return [Judge([bound_to(model, c, group)], findings) for c, group in asked]

        judges = bound()
        values = {**self._values, MUTE: not muted}
        for k in range(TICKS):
            said = []
            for mechanism in model.mechanisms.values():
                sample = _sample(mechanism, k, ELSEWHERE if mechanism.name == elsewhere else 0.0)
                spoiled = spoil[mechanism.name](sample, k) if spoil and mechanism.name in spoil else sample
                said += [] if spoiled is None else [spoiled]
            engine.take(said)
            if not quiet:
                engine.take([*self._signals(k, values)])
            state: State = engine.tick() if k else engine.start()
            if hidden:
                invalid = "seerob.testing", tuple(bones)
                state.hearings[hidden].bones_heard = [BonesHeard(state.t, parts=(invalid,))]
            if anew and k == TICKS - 1:
                judges = bound()
            results = []
            for judge in judges:
                (result,) = judge(state)
                results.append((result, set(state.asked)))
            if look is not None:
                look(state, [result for result, _ in results])
            yield k, results

    def _signals(self, k: int, values: Mapping[str, Value]) -> Iterator[SignalSample]:
        for source in {v.source for v in self.model.dictionary.values()}:
            own = {n: values[n] for n, v in self.model.dictionary.items() if v.source == source}
            yield SignalSample(source=source, seq=k, t=k * _PERIOD, values=own)


def _sample(mechanism: Mechanism, k: int, elsewhere: float) -> JointSample:
    """Where somebody is at a tick: about their home, robots and people in motion."""
    t = k * _PERIOD
    swing = 0.0 if mechanism.role == "machine" else SWING
    q: Array = mechanism.home + swing * np.sin(2 * np.pi * t) + elsewhere
    qd = np.full(len(q), 2 * np.pi * swing * math.cos(2 * np.pi * t))
    return JointSample(
        source="seerob.testing",
        seq=k,
        t=t,
        target=mechanism.name,
        q=tuple(q.tolist()),
        qd=tuple(qd.tolist()),
        tau=(0.0,) * len(q) if mechanism.role == "robot" else None,
    )


def _hangs_on(bone: str, limb: str) -> bool:
    """Whether a bone is a limb's, or moves with it."""
    while bone in PARENTS and bone != limb:
        bone = PARENTS[bone]
    return bone == limb


def _usual(variable: Variable) -> Value:
    if variable.type is Kind.BOOL:
        return False
    return 0.0 if variable.type is Kind.NUMBER else next(iter(variable.choices.values()), "")


def nobody_called(names: Sequence[str], known: Sequence[str], what: str) -> str:
    """Why nothing would be asked of some names; empty when something is."""
    if lacking := sorted({*names} - {*known}):
        return f"no {what} is called {' or '.join(map(repr, lacking))}"
    return "" if known else f"there is no {what} to be asked"


def where_within(result: Result) -> str:
    """What of a result is within, it or a part, a row, a marker; empty for nothing."""
    if result.verdict is Verdict.WITHIN:
        return "it"
    for part in result.parts:
        if where_within(part):
            return f"its part {part.name}"
    for row in result.rows:
        if row.verdict is Verdict.WITHIN:
            return f"its row {row.name}"
    return "a marker of it" if any(m.verdict is Verdict.WITHIN for m in result.markers) else ""


def _alike(a: Result, b: Result) -> bool:
    if a.verdict is not b.verdict or (a.value is None) != (b.value is None):
        return False
    return a.value is None or b.value is None or math.isclose(a.value, b.value, rel_tol=1e-6, abs_tol=1e-9)
