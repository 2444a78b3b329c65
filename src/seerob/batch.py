"""Criteria over many instants at once: for recordings, for research, for optimisation.

The road judges one instant after the other; here a stretch of instants is placed, and each criterion that
can (`Criterion.batch`) judges it in a few array operations, on all cores. Its figures are those of the
road for the same states to rounding, and its verdicts are by the same rules. What cannot, or has a
memory of earlier instants, is asked instant by instant as on the road, in the order of time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import mujoco
import numpy as np
from msgspec.structs import replace as changed

from seerob.answers import UNDECIDED, WITHIN, Answers
from seerob.criterion import Criterion, EvaluateMany
from seerob.errors import Undecided, UnknownName
from seerob.judging import Judge, held, held_names, unmentioned
from seerob.model import Model
from seerob.results.series import CODES
from seerob.run import Bound, Feed, engine_of, settled
from seerob.snapshot import Finding, Result, Verdict
from seerob.state import Hearing, State
from seerob.states import Bench, Motion, Questions, Reasons
from seerob.transforms import Array
from seerob.whereabouts.hearing import SLACK, STANDS

STRETCH = 256
"""Instants that are placed together: enough for the arrays to pay, few enough for the processor's cache."""


@dataclass(frozen=True, eq=False)
class Column:
    """What one criterion says of every instant."""

    name: str
    unit: str
    at_most: bool
    answers: Answers
    reasons: Reasons
    """Why an instant is UNDECIDED, as far as it is said, shape (N,)."""
    note: str = ""
    """Why it was asked instant by instant; empty when it was not."""

    @property
    def value(self) -> Array:
        """In ``unit``, NaN where there is none, shape (N,)."""
        return self.answers.value

    @property
    def verdict(self) -> Verdict | None:
        """Of the whole: EXCEEDED before UNDECIDED before WITHIN before none."""
        there = set(np.unique(self.answers.verdict).tolist())
        order = (Verdict.EXCEEDED, Verdict.UNDECIDED, Verdict.WITHIN)
        return next((verdict for verdict in order if CODES[verdict] in there), None)


@dataclass(frozen=True, eq=False)
class Batch(Mapping[str, Column]):
    """What all criteria say of N instants, by the criterion's name."""

    t: Array
    """[s], shape (N,)."""
    columns: Mapping[str, Column]

    def __getitem__(self, name: str) -> Column:
        try:
            return self.columns[name]
        except KeyError:
            raise UnknownName("result", name, self.columns) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)


class _Whereabouts(State):
    """Where everybody is, and nothing of what follows from it."""

    def refresh(self, t: float) -> None:
        """See `State.refresh`."""
        self.t = t


def recorded(model: Model, feed: Feed) -> Motion:
    """Where everybody is at every tick of a feed, without physics: where the samples say.

    Args:
        model: The compiled workstation, whose sources drive it.
        feed: Samples per tick.
    """
    station = model.workstation
    placed = changed(station, engine=changed(station.engine, physics=False))
    engine = engine_of(replace(model, workstation=placed))
    engine.state = _Whereabouts(model, engine.state.data, engine.state.hearings, engine.state.signals)
    t, q, v = [], [], []
    doubts: dict[str, list[str]] = {name: [] for name in engine.model.mechanisms}
    for seq, samples in enumerate(feed):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        t.append(state.t)
        q.append(state.data.qpos.copy())
        v.append(state.data.qvel.copy())
        for name, found in doubts.items():
            found.append(state.doubt(name))
    reasons = {name: np.array(found, object) for name, found in doubts.items()}
    return Motion(np.array(t), np.array(q), np.array(v), reasons, foreseen=True)


def judged(
    model: Model,
    bound: Sequence[Bound],
    motion: Motion,
    *,
    threads: int,
    findings: Iterable[Finding] = (),
) -> Batch:
    """Judge a motion.

    Args:
        model: The compiled workstation.
        bound: Its criteria.
        motion: Where everybody is.
        threads: How many work at once.
        findings: Of sources, besides those of the model (`Finding.holds`).
    """
    n = len(motion.t)
    findings = tuple(dict.fromkeys((*model.findings, *findings)))
    asked, notes = _able(model, bound, findings)
    parts = [motion.part(begin, end) for begin, end in pairwise([*range(0, n, STRETCH), n]) if begin < end]
    questions = Questions(model)
    found: dict[str, list[tuple[Answers, Reasons]]] = {name: [] for name in asked}
    if asked and parts:
        # Learns what distances are asked, so that every stretch asks for all of them together.
        _stretch(Bench(model, questions), asked, parts[0].part(0, 1))
        with ThreadPoolExecutor(max(1, threads), "seerob batch") as pool:
            shares = [parts[k::threads] for k in range(max(1, threads))]
            made = list(pool.map(lambda share: _share(model, questions, asked, share), shares))
        for k in range(len(parts)):
            for name, answers in made[k % len(shares)][k // len(shares)].items():
                found[name].append(answers)
    slow = [one for one in bound if one.criterion.name not in asked]
    walked = _walked(model, slow, motion, findings) if slow else {}
    columns = {}
    for one in bound:
        name = one.criterion.name
        said, reasons = walked[name] if name in walked else _joined(found[name])
        criterion = one.criterion
        columns[name] = Column(name, criterion.unit, criterion.at_most, said, reasons, notes.get(name, ""))
    return Batch(motion.t, columns)


def _able(
    model: Model, bound: Sequence[Bound], findings: Sequence[Finding]
) -> tuple[dict[str, _Able], dict[str, str]]:
    """Criteria that judge many instants at once; why others do not."""
    able: dict[str, _Able] = {}
    names = held_names(findings, model)
    notes: dict[str, str] = {}
    for one in bound:
        criterion = one.criterion
        many = criterion.batch(model)
        if many is None:
            notes[criterion.name] = "asked instant by instant: with these options it is not made for batches"
        elif held(criterion, model, findings) or unmentioned(criterion, model):
            notes[criterion.name] = "asked instant by instant: a finding holds what it is about"
        elif criterion.variables():
            notes[criterion.name] = "asked instant by instant: it follows variables"
        else:
            able[criterion.name] = _Able(criterion, many, names)
    return able, notes


@dataclass(frozen=True)
class _Able:
    """A criterion that judges many instants at once."""

    criterion: Criterion
    many: EvaluateMany
    held: Mapping[str, str]
    """By name that findings hold, why nothing that depends on it is within."""


Stretch = dict[str, tuple[Answers, Reasons]]


def _share(
    model: Model,
    questions: Questions,
    asked: dict[str, _Able],
    parts: Sequence[Motion],
) -> list[Stretch]:
    """The work of one thread."""
    bench = Bench(model, questions)
    return [_stretch(bench, asked, part) for part in parts]


def _stretch(bench: Bench, asked: dict[str, _Able], motion: Motion) -> Stretch:
    states = bench.place(motion)
    found: Stretch = {}
    for name, one in asked.items():
        states.asked.clear()
        reasons = np.full(len(states), "", object)
        try:
            answers = one.many(states)
        except Undecided as reason:
            answers, reasons[:] = _nothing(one.criterion, len(states)), str(reason)
        for who in sorted(states.asked):
            reasons = np.where(motion.doubts[who] != "", motion.doubts[who], reasons)
        answers = _doubted(answers, one.criterion, reasons)
        if texts := [text for held_name, text in one.held.items() if held_name in states.asked]:
            reasons = np.where(answers.verdict == WITHIN, "; ".join(dict.fromkeys(texts)), reasons)
            answers = answers.open()
        found[name] = answers, reasons
    return found


def _doubted(answers: Answers, criterion: Criterion, reasons: Reasons) -> Answers:
    """The same where nothing is said of instants that are in doubt."""
    doubted = reasons != ""
    if not doubted.any():
        return answers
    nothing = _nothing(criterion, len(reasons))
    return Answers(
        np.where(doubted, nothing.value, answers.value),
        np.where(doubted, nothing.limit, answers.limit),
        np.where(doubted, nothing.verdict, answers.verdict).astype(np.uint8),
        None if answers.interval is None else _blanked(answers.interval, doubted),
    )


def _blanked(interval: tuple[Array, Array], where: Array) -> tuple[Array, Array]:
    low, high = (np.where(where, np.nan, end) for end in interval)
    return low, high


def _nothing(criterion: Criterion, n: int) -> Answers:
    """Of instants at which nobody knows."""
    limit = getattr(criterion, "limit", None)
    limits = np.full(n, np.nan if limit is None else limit, float)
    return Answers(np.full(n, np.nan), limits, np.full(n, UNDECIDED, np.uint8))


def _joined(parts: Sequence[tuple[Answers, Reasons]]) -> tuple[Answers, Reasons]:
    said = [answers for answers, _ in parts]
    ends = [answers.interval for answers in said if answers.interval is not None]
    interval = None
    if ends and len(ends) == len(said):
        interval = np.concatenate([low for low, _ in ends]), np.concatenate([high for _, high in ends])
    joined = Answers(
        np.concatenate([np.zeros(0), *(answers.value for answers in said)]),
        np.concatenate([np.zeros(0), *(answers.limit for answers in said)]),
        np.concatenate([np.zeros(0, np.uint8), *(answers.verdict for answers in said)]),
        interval,
    )
    return joined, np.concatenate([np.zeros(0, object), *(reasons for _, reasons in parts)])


def _walked(model: Model, bound: Sequence[Bound], motion: Motion, findings: Sequence[Finding]) -> Stretch:
    """The same instant by instant, as on the road, each criterion at every instant."""
    hearings = {name: Hearing(given=False, driven=True) for name in model.mechanisms}
    data = mujoco.MjData(model.mj)
    state = State(model, data, hearings)
    # With criteria that were bound for another run, what they remember of it would be in the way.
    fresh = [
        Bound(changed(one.criterion, every=None), one.group, one.criterion.bind(model), one.basis)
        for one in bound
    ]
    judge = Judge(fresh, findings)
    if motion.foreseen:
        state.foresee = partial(_foresee, model, motion, state)
    rows: list[tuple[Result, ...]] = []
    with settled():
        for k, t in enumerate(motion.t.tolist()):
            data.qpos[:], data.qvel[:] = motion.q[k], motion.v[k]
            for name, hearing in hearings.items():
                reason = motion.doubts[name][k].removeprefix(f"{name}: ")
                hearing.heard, hearing.torques = [(t, reason)], [None]
            state.refresh(t)
            rows.append(judge(state))
    return {one.criterion.name: _of_results([row[i] for row in rows]) for i, one in enumerate(bound)}


def _foresee(
    model: Model, motion: Motion, state: State, name: str, t: Array
) -> tuple[Array, Array, str] | None:
    """See `seerob.state.Foresee`: the motion itself, at its own instants."""
    rows = np.searchsorted(motion.t, t - SLACK)
    beyond, rows = bool(len(rows)) and rows[-1] >= len(motion.t), np.minimum(rows, len(motion.t) - 1)
    columns = state.columns[name]
    q, qd = motion.q[rows][:, columns.own_q], motion.v[rows][:, columns.own_v]
    why = next(filter(None, motion.doubts[name][rows].tolist()), "")
    if beyond and np.abs(motion.v[-1][columns.own_v]).max(initial=0.0) > STANDS:
        why = why or "the motion ends, and what it does after is not known"
    return q, qd, why


def _of_results(results: Sequence[Result]) -> tuple[Answers, Reasons]:
    def numbers(values: Sequence[float | None]) -> Array:
        return np.array([np.nan if value is None else value for value in values], float)

    answers = Answers(
        numbers([r.value for r in results]),
        numbers([r.limit for r in results]),
        np.array([CODES[r.verdict] for r in results], np.uint8),
    )
    if any(r.interval for r in results):
        low, high = (numbers([r.interval[k] if r.interval else r.value for r in results]) for k in range(2))
        answers = replace(answers, interval=(low, high))
    reasons = [r.reason if r.verdict is Verdict.UNDECIDED else "" for r in results]
    return answers, np.array(reasons, object)
