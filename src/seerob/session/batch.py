"""Criteria over many instants at once: for recordings, for research, for optimisation.

The road judges one instant after the other; here a stretch of instants is placed, and each criterion that
can (`Criterion.batch`) judges it in a few array operations, on all cores. Its figures are those of the
road for the same states to rounding, and its verdicts are by the same rules. What has a memory of earlier
instants is asked stretch by stretch in the order of time; what cannot, instant by instant as on the road.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from operator import itemgetter
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from msgspec.structs import replace as changed
from numpy.typing import NDArray

from seerob.core.errors import Undecided, UnknownName
from seerob.core.snapshot import Finding, Result, Verdict
from seerob.core.transforms import Array
from seerob.criteria.criterion import Criterion, EvaluateMany
from seerob.criteria.judging import Judge, openings_decide
from seerob.criteria.question import Question, held_names, question_of, worded
from seerob.model.model import Model
from seerob.outputs.notebook import batch_html, plotted
from seerob.recording import frames
from seerob.recording.answers import UNDECIDED, WITHIN, Answers, Flags
from seerob.recording.series import CODES, INFORMS, ONE_INSTANT, STILL
from seerob.session.recorded_motion import hear, hearings_of
from seerob.session.run import Bound, settled
from seerob.twin.spans import Path, Ways
from seerob.twin.state import State
from seerob.twin.states import Bench, Motion, Questions, Reasons, States
from seerob.twin.validity.hearing import SLACK, STANDS

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from matplotlib.figure import Figure

STRETCH, LONGEST, LONGEST_OF_SEVERAL = 256, 4096, 1024
"""Instants that are placed together, at least and at most: enough for the arrays to pay, few enough for the
processor's cache, which several threads share."""
SHARES = 8
"""Parts that a motion has between the two, so that threads end together."""
ASKED_AGAIN = 8
"""Instants of which what one's own says of many is compared with what it says of one, at least."""
_KNOWN = np.isin(np.arange(256), [*CODES.values()])
"""By number, whether it is the code of a verdict."""
TOGETHER = 32
"""Ways from one instant to the next that are bounded together, at most."""


@dataclass(frozen=True, eq=False, repr=False)
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
    between: str = ""
    """What is known of the time between the instants, as `seerob.core.snapshot.CriterionInfo.between` says
    it; empty where the instants are no motion."""

    @property
    def value(self) -> Array:
        """In ``unit``, NaN where there is none, shape (N,)."""
        return self.answers.value

    @property
    def verdict(self) -> Verdict | None:
        """Verdict of all instants: EXCEEDED before UNDECIDED before WITHIN before none."""
        there = set(np.unique(self.answers.verdict).tolist())
        order = (Verdict.EXCEEDED, Verdict.UNDECIDED, Verdict.WITHIN)
        found = next((verdict for verdict in order if CODES[verdict] in there), None)
        known = not self.between or self.between.startswith("accepted: ")
        nothing = self.answers.nothing
        idle = found is None and self.between != INFORMS and nothing is not None and bool(nothing.any())
        return Verdict.UNDECIDED if not known and (found is Verdict.WITHIN or idle) else found

    def __repr__(self) -> str:
        verdict = "no verdict" if self.verdict is None else self.verdict.value
        return f"<Column {self.name!r}: {len(self.value)} instants, {verdict}>"


@dataclass(frozen=True, eq=False, repr=False)
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

    def __repr__(self) -> str:
        return f"<Batch: {len(self)} criteria, {len(self.t)} instants>"

    def to_pandas(self, form: frames.Form = "wide") -> pd.DataFrame:
        """Answers as a DataFrame (extra ``data``), as `seerob.ResultLog.to_pandas` makes it.

        Args:
            form: ``wide``, ``long`` or ``criteria``; a batch keeps no parts.

        Raises:
            UnknownName: There is no such form of a batch.
            MissingPackage: pandas is not installed.
        """
        return frames.table(form, self.criterion_series()).to_pandas()

    def to_arrow(self, form: frames.Form = "wide") -> pa.Table:
        """Answers as an Arrow table (extra ``data``), as `seerob.ResultLog.to_arrow` makes it.

        Args:
            form: ``wide``, ``long`` or ``criteria``; a batch keeps no parts.

        Raises:
            UnknownName: There is no such form of a batch.
            InputError: A criterion of a wide table is called ``t``.
            MissingPackage: pyarrow is not installed.
        """
        return frames.table(form, self.criterion_series()).to_arrow()

    def criterion_series(self) -> list[frames.CriterionSeries]:
        """Each criterion, as tables and plots ask for it."""
        return [
            frames.CriterionSeries(
                name=c.name,
                unit=c.unit,
                at_most=c.at_most,
                verdict=c.verdict,
                t=self.t,
                values=c.value,
                limits=c.answers.limit,
                codes=c.answers.verdict,
                reasons=["" if why is None else str(why) for why in c.reasons],
                why="" if c.between.startswith("accepted: ") else c.between,
            )
            for c in self.values()
        ]

    def plot(self, *criteria: str) -> Figure:
        """Plot figures over the instants, as `seerob.Summary.plot` does.

        Args:
            criteria: Their names, in the order wanted; all of them when not given.

        Raises:
            UnknownName: There is none of that name.
            MissingPackage: matplotlib is not installed (extra ``data``).
        """
        named = {one.name: one for one in self.criterion_series()}
        return plotted([named[self[name].name] for name in criteria or self])

    def _repr_html_(self) -> str:
        return batch_html((c.name, c.verdict, c.answers.verdict, c.value, c.unit) for c in self.values())


def judged(
    model: Model,
    bound: Sequence[Bound],
    motion: Motion,
    *,
    threads: int,
    findings: Sequence[Finding] = (),
) -> Batch:
    """Judge a motion.

    Args:
        model: The compiled workstation.
        bound: Its criteria.
        motion: Where everybody is.
        threads: How many work at once.
        findings: Of sources, besides those of the model (`Finding.holds`).
    """
    found = _as_it_is(model, bound, motion, threads=threads, findings=findings)
    openings = [one.closed for one in bound if one.closed is not None]
    if model.closed is None or not openings:
        return found
    closed = _as_it_is(model.closed, openings, motion, threads=threads, findings=findings)
    columns = dict(found.columns)
    for one in openings:
        name = one.criterion.name
        columns[name] = _closed_too(columns[name], closed[name], openings_decide(model, one.criterion))
    return replace(found, columns=columns)


def _closed_too(column: Column, closed: Column, why: str) -> Column:
    """What is said of meshes as they are, as far as it is with openings closed (`closed_too`).

    Args:
        column: Of the meshes as they are, whose values it keeps.
        closed: Of the same criterion with all openings closed of which nobody says whether they are.
        why: What is not within by the meshes alone rests on.
    """
    said, other = column.answers, closed.answers
    limits = (said.limit == other.limit) | (np.isnan(said.limit) & np.isnan(other.limit))
    both = limits & ~np.isnan(said.value) & ~np.isnan(other.value)
    own, closed_ends = (one.interval or (one.value, one.value) for one in (said, other))
    low = np.where(both, np.minimum(own[0], closed_ends[0]), own[0])
    high = np.where(both, np.maximum(own[1], closed_ends[1]), own[1])
    taken_back = ((said.verdict == WITHIN) | _idle(said)) & ~((other.verdict == WITHIN) | _idle(other))
    verdict = np.where(taken_back, UNDECIDED, said.verdict).astype(np.uint8)
    interval = (low, high) if (low < high).any() else said.interval
    answers = replace(said, verdict=verdict, interval=interval, nothing=_idle(said) & ~taken_back)
    reasons = np.where(taken_back, why, column.reasons)
    return replace(column, answers=answers, reasons=reasons)


def _as_it_is(
    model: Model, bound: Sequence[Bound], motion: Motion, *, threads: int, findings: Sequence[Finding]
) -> Batch:
    """What all criteria say of a motion, of meshes as they are."""
    n = len(motion.t)
    findings = tuple(dict.fromkeys((*model.findings, *findings)))
    if motion.ways is not None:
        claims = (claim for one in bound for claim in one.criterion.claims(model))
        refuted = (each.of_motion(motion) for each in claims if each.holds not in {f.holds for f in findings})
        findings = (*findings, *filter(None, refuted))
    # Whom that holds, and when, is found out on the road.
    asked, notes = _able(model, bound, (*findings, *motion.implausible))
    length = LONGEST if threads <= 1 else min(max(STRETCH, -(-n // SHARES)), LONGEST_OF_SEVERAL)
    parts = [motion.part(begin, end) for begin, end in pairwise([*range(0, n, length), n]) if begin < end]
    found: dict[str, list[tuple[Answers, Reasons]]] = {name: [] for name in asked}
    left: dict[str, list[Flags]] = {name: [] for name in asked}
    speeds: list[tuple[int, Array]] = []
    alone: dict[str, str] = {}
    if asked and parts:
        # Learns what distances are asked, so that every stretch asks for all of them together.
        bench = Bench(model, Questions(model))
        _stretch(bench, asked, parts[0].part(0, 1))
        shares = [range(k, len(parts), max(1, threads)) for k in range(max(1, threads))]
        # What remembers is asked by one thread.
        lasting = {name for name, one in asked.items() if shares[1:] and one.criterion.remembers(model)}
        free = {name: one for name, one in asked.items() if name not in lasting}
        work = [(free, share) for share in shares]
        if lasting:
            work.append(({name: asked[name] for name in lasting}, range(len(parts))))
        benches = [bench, *(bench.another() for _ in work[1:])]
        with ThreadPoolExecutor(len(work), "seerob batch") if work[1:] else nullcontext() as pool:
            at_once = map if pool is None else pool.map
            made = at_once(lambda at, one: _share(at, one[0], one[1], parts), benches, work)
            stretches = [stretch for share in made for stretch in share]
        for k, (stretch, fast, rested) in sorted(stretches, key=itemgetter(0)):
            if fast is not None:
                speeds.append((k * length, fast))
            alone |= rested
            for name, (answers, reasons, open_) in stretch.items():
                found[name].append((answers, reasons))
                left[name].append(open_)
    for name, why in alone.items():
        # How far errors reach is asked of a state (`seerob.criteria.noisy_speeds`, `State.require_bodies`).
        del asked[name], found[name]
        notes[name] = f"asked instant by instant: {why}"
    slow = [one for one in bound if one.criterion.name not in asked]
    walked = _walked(model, slow, motion, findings) if slow else {}
    walked |= {name: _joined(answers) for name, answers in found.items()}
    for one in bound:
        name = one.criterion.name
        if name in asked and one.own and n:
            walked[name] = _confirmed(model, one, motion, findings, walked[name])
    again = {name: np.concatenate([np.zeros(0, bool), *left[name]]) for name in asked}
    if motion.ways and asked:
        every = np.full((n if speeds else 0, len(model.bodies)), np.nan)
        for begin, fast in speeds:
            every[begin : begin + len(fast)] = fast
        _mark_uncleared(model, bound, again, motion, walked, every)
    for one in bound:
        name = one.criterion.name
        if name in asked and (spans := again[name]).any():
            walked[name] = _with(walked[name], _walked(model, [one], motion, findings, spans)[name], spans)
    columns, still = {}, n == 1 and not model.workstation.sources
    for one in bound:
        name = one.criterion.name
        said, reasons = walked[name]
        criterion, between = one.criterion, one.between if motion.ways is not None else ""
        if n == 1 and motion.foreseen and model.workstation.sources:
            between = ONE_INSTANT
        elif still and between:
            between = STILL
        columns[name] = Column(
            name, criterion.unit, criterion.at_most, said, reasons, notes.get(name, ""), between
        )
    return Batch(motion.t, columns)


def _confirmed(
    model: Model, one: Bound, motion: Motion, findings: Sequence[Finding], said: tuple[Answers, Reasons]
) -> tuple[Answers, Reasons]:
    """What one's own says of many instants, undecided where it says less of some of them one by one."""
    answers, reasons = said
    n = len(motion.t)
    some = np.zeros(n, bool)
    some[np.linspace(0, n - 1, min(n, ASKED_AGAIN)).astype(int)] = True
    within = answers.verdict == WITHIN
    if within.any():
        some[np.argmin(np.where(within, np.abs(answers.limit - answers.value), np.inf))] = True
    road, why = _walked(model, [replace(one, watch=None)], motion, findings, some)[one.criterion.name]
    greener = np.flatnonzero(some & within & (road.verdict != WITHIN))
    if not len(greener):
        return said
    k = int(greener[0])
    what = f"batch says within at {motion.t[k]:.4g} s, and bind does not: {why[k]}".removesuffix(": ")
    return answers.open(), np.where(within, what, reasons)


def _mark_uncleared(
    model: Model,
    bound: Sequence[Bound],
    again: Mapping[str, Flags],
    motion: Motion,
    said: Stretch,
    speeds: Array,
) -> None:
    """Mark, of criteria that were judged together, at which instants the way there is to be looked at.

    The same bounds as on the road (`seerob.criteria.between_ticks`) clear the others.

    Args:
        model: The compiled workstation.
        bound: Its criteria.
        again: By name, instants that are asked again anyway; written.
        motion: Where everybody is.
        said: What was found of each instant.
        speeds: Of all bodies [m/s], shape (N, n); NaN, or none at all, where nothing is within.
    """
    ways = motion.ways
    assert ways is not None
    ids = np.array([body.mj for body in model.bodies], np.int64)
    for one in bound:
        name, watch = one.criterion.name, one.watch
        if name not in again or watch is None:
            continue
        open_, (answers, _) = again[name], said[name]
        at_most, off = one.criterion.at_most, np.zeros(len(open_))
        bare = answers.limit - answers.value if at_most else answers.value - answers.limit
        if answers.interval is not None:
            low, high = answers.interval
            off = high - answers.value if at_most else answers.value - low
        within = (answers.verdict == WITHIN) & ~open_
        exceeded = (answers.verdict == CODES[Verdict.EXCEEDED]) & ~open_
        undecided = ~(exceeded[1:] | exceeded[:-1])
        both = within[1:] & within[:-1]
        either = (within[1:] | within[:-1]) & ~both
        # What is bounded by a judgement of its own is judged on the road, idle or not.
        open_[1:] |= undecided & (either if watch.falls is not None else True)
        if watch.falls is None:
            continue
        # A figure without a limit, or one that is never within, has nothing to lose on the way.
        size, runs = 1, np.flatnonzero(np.diff(both, prepend=False, append=False))
        for begin, end in runs.reshape(-1, 2).tolist():
            k = begin
            while k < end:
                size = min(size, end - k) if isinstance(ways, Ways) else 1
                path = ways.joined(k, k + size) if isinstance(ways, Ways) else ways[k]
                span = watch.points.span(path, float(motion.t[k]), float(motion.t[k + size]), ids, model.mj)
                span.between_speeds(speeds[k], speeds[k + size])
                m, o = bare[k : k + size + 1], off[k : k + size + 1]
                try:
                    fall, bend = watch.falls(span, float((m - o).min()))
                except Exception:
                    # The road says what of it failed, and ends no batch that others are judged in.
                    open_[1:] |= both
                    break
                # Of several ways at once the bound is no sharper than of each, and the least margin counts.
                one_way = (m[0] + m[1] - fall) / 2 if size == 1 else m.min() - np.asarray(fall) / 2
                if np.min(np.maximum(one_way, m.min() - bend) - o.max()) >= 0:
                    k, size = k + size, min(2 * size, TOGETHER)
                elif size > 1:
                    size = size // 2
                else:
                    open_[k + 1], k = True, k + 1


def _with(
    said: tuple[Answers, Reasons], again: tuple[Answers, Reasons], where: Flags
) -> tuple[Answers, Reasons]:
    """Replace answers at some instants by those that were found once the way there was looked at."""
    (answers, reasons), (then, why) = said, again
    picked = {key: np.where(where, getattr(then, key), getattr(answers, key)) for key in ("value", "limit")}
    verdict = np.where(where, then.verdict, answers.verdict).astype(np.uint8)
    interval = None
    if answers.interval is not None or then.interval is not None:
        ends, others = (one.interval or (one.value, one.value) for one in (answers, then))
        interval = np.where(where, others[0], ends[0]), np.where(where, others[1], ends[1])
    nothing = np.where(where, _idle(then), _idle(answers))
    found = replace(answers, **picked, verdict=verdict, interval=interval, nothing=nothing)
    return found, np.where(where, why, reasons)


def _able(
    model: Model, bound: Sequence[Bound], findings: Sequence[Finding]
) -> tuple[dict[str, _Able], dict[str, str]]:
    """Criteria that judge many instants at once; why others do not."""
    able: dict[str, _Able] = {}
    names = held_names(findings, model)
    notes: dict[str, str] = {}
    for one in bound:
        criterion, question = one.criterion, question_of(one, model)
        many = criterion.batch(model)
        question.hold(findings, names)
        if many is None:
            why = criterion.one_by_one(model) or "its bind says more than its figure"
            notes[criterion.name] = f"asked instant by instant: {why}"
        elif question.held or question.unmentioned:
            notes[criterion.name] = "asked instant by instant: a finding holds what it is about"
        elif criterion.heavier_is_worse and any(m.unknown_masses for m in model.mechanisms.values()):
            notes[criterion.name] = "asked instant by instant: masses are not known"
        elif one.own and criterion.remembers(model):
            notes[criterion.name] = "asked instant by instant: it remembers"
        elif criterion.variables():
            notes[criterion.name] = "asked instant by instant: it follows variables"
        else:
            movers = filter(None, (model.bodies[i].mover for i in question.bodies))
            needs = tuple(dict.fromkeys((*question.names, *movers)))
            computed = type(criterion).batch is Criterion.batch and not criterion.one_by_one(model)
            widens = criterion.by_speed and computed
            able[criterion.name] = _Able(question, many, needs, widens)
    return able, notes


@dataclass(frozen=True)
class _Able:
    """A criterion that judges many instants at once."""

    question: Question
    many: EvaluateMany
    needs: tuple[str, ...]
    """Who must be where the motion says, whatever it asks."""
    widens: bool
    """Whether its intervals hold what noise makes of speeds, of many instants as of one."""

    @property
    def criterion(self) -> Criterion:
        """What is asked."""
        return self.question.criterion


Stretch = dict[str, tuple[Answers, Reasons]]
Part = dict[str, tuple[Answers, Reasons, Flags]]
"""With the instants that are to be asked one by one."""


def _share(
    bench: Bench, asked: dict[str, _Able], which: Iterable[int], parts: Sequence[Motion]
) -> list[tuple[int, tuple[Part, Array | None, dict[str, str]]]]:
    """The work of one thread: of some parts, which it is and what is said of it."""
    return [(k, _stretch(bench, asked, parts[k])) for k in which]


def _stretch(
    bench: Bench, asked: dict[str, _Able], motion: Motion
) -> tuple[Part, Array | None, dict[str, str]]:
    """What criteria say, speeds of all bodies, and why some are to be asked instant by instant.

    Speeds [m/s], shape (N, n), are None where nothing can be lost on the way from one instant to the next.
    """
    states = bench.place(motion)
    found: Part = {}
    alone: dict[str, str] = {}
    doubted = {who for who, every in motion.invalid_reasons.items() if every.any()}
    for name, one in asked.items():
        states.asked.clear()
        states.speeds_asked.clear()
        states.alone = np.zeros(len(states), bool)
        answers, reasons, said = _said(one, states)
        if one.question.turns is not None:
            states.alone |= _passed_over(one.question.turns, motion)
        with_carriers = {above for who in states.speeds_asked for above in bench.model.carriers_of(who)}
        movers = (with_carriers | states.speeds_asked) & motion.speed_errors.keys()
        noisy = np.any([motion.speed_errors[who].any(axis=1) for who in movers], axis=0)
        if one.widens:
            pass  # its intervals hold what noise makes of speeds
        elif np.all(noisy) or (np.any(noisy) and one.criterion.remembers(bench.model)):
            alone[name] = "speeds follow from noisy positions"
        else:
            states.alone |= noisy
        asked_of = states.asked | {above for who in states.asked for above in bench.model.carriers_of(who)}
        if states.alone.any() and one.criterion.remembers(bench.model):
            alone.setdefault(name, "what is entered changes twice between two instants")
        if some := sorted(motion.seen.keys() & asked_of):
            alone[name] = f"more is known of {some[0]} than where it is"
        for who in sorted(states.asked & doubted):
            reasons = np.where(motion.invalid_reasons[who] != "", motion.invalid_reasons[who], reasons)
            said = True
        if said:
            answers = _undecided_where(answers, one.criterion, reasons)
        for reason in (*one.question.undecided_reasons(states), one.question.held_for(states.asked)):
            there = np.asarray(reason, object) != ""
            if there.any():
                reasons = np.where((answers.verdict == WITHIN) & there, reason, reasons)
                answers = answers.open(there)
        found[name] = answers, reasons, states.alone
    # Only what is within, and so has a limit, is to stay so on the way.
    watched = [name for name, one in asked.items() if one.question.bound.watch is not None]
    kept = any((found[name][0].verdict == WITHIN).any() for name in watched)
    if motion.ways is not None and kept:
        return found, states.largest_speeds(), alone
    return found, None, alone


def _passed_over(turns: Callable[[float, float], Sequence[float]], motion: Motion) -> Flags:
    """Instants since the one before which what is entered changed more than once, shape (N,)."""
    whole = motion.t if motion.of is None else motion.of.t
    t = whole[max(motion.begin - 1, 0) : motion.begin + len(motion.t)].tolist()
    found = [len(turns(before, now)) > 1 for before, now in pairwise(t)]
    return np.array([False, *found][-len(motion.t) :], bool)


def _said(one: _Able, states: States) -> tuple[Answers, Reasons, bool]:
    """What a criterion says, as far as it may be green, why it is not, and whether it is not anywhere.

    By the rules of `Judge`.
    """
    criterion, n = one.criterion, len(states)
    states.require(*one.needs)
    reasons = np.full(n, "", object)
    try:
        if one.question.bound.own:
            with states.for_author(criterion.name) as own:
                answers = one.many(own)
        else:
            answers = one.many(states)
        why = _misshapen(answers, n)
    except Undecided as reason:
        why = str(reason)
    except Exception as error:
        # One's own criterion that fails must not end a batch that others are judged in.
        why = f"{criterion.name} failed: {worded(error)}"
    if why:
        reasons[:] = why
        return _nothing(criterion, n), reasons, True
    found = answers.contradictions(at_most=criterion.at_most)
    if found is None or not found.any():
        return replace(answers, verdict=answers.verdict.astype(np.uint8)), reasons, False
    reasons = np.where(found == "", reasons, f"{criterion.name}: " + found)
    verdict = np.where(found == "", answers.verdict, UNDECIDED).astype(np.uint8)
    return replace(answers, verdict=verdict), reasons, True


def _misshapen(answers: Answers, n: int) -> str:
    """Why what a criterion returned cannot be read; empty where it can."""
    if type(answers) is not Answers:
        return f"it returns {type(answers).__name__}, not seerob.api.Answers"
    ends = () if answers.interval is None else answers.interval
    shapes = {np.shape(column) for column in (answers.value, answers.limit, answers.verdict, *ends)}
    if shapes != {(n,)}:
        return f"it returns shapes {sorted(shapes)} of {n} instants, not ({n},) each"
    codes = answers.verdict
    quick = codes.dtype == np.uint8 and _KNOWN[codes].all()
    if not quick and (unknown := set(codes.tolist()) - set(CODES.values())):
        return f"its verdicts {sorted(unknown)} are none of seerob.recording.series.CODES"
    return ""


def _undecided_where(answers: Answers, criterion: Criterion, reasons: Reasons) -> Answers:
    """Make answers undecided, without a figure, at the instants that are in doubt."""
    invalid = reasons != ""
    nothing = _nothing(criterion, len(reasons))
    return replace(
        answers,
        value=np.where(invalid, nothing.value, answers.value),
        limit=np.where(invalid, nothing.limit, answers.limit),
        verdict=np.where(invalid, nothing.verdict, answers.verdict).astype(np.uint8),
        interval=None if answers.interval is None else _blanked(answers.interval, invalid),
        nothing=None if answers.nothing is None else answers.nothing & ~invalid,
    )


def _blanked(interval: tuple[Array, Array], where: Array) -> tuple[Array, Array]:
    low, high = (np.where(where, np.nan, end) for end in interval)
    return low, high


def _nothing(criterion: Criterion, n: int) -> Answers:
    """Of instants at which nobody knows."""
    limit = getattr(criterion, "limit", None)
    limits = np.full(n, np.nan if limit is None else limit, float)
    return Answers(np.full(n, np.nan), limits, np.full(n, UNDECIDED, np.uint8))


def _idle(answers: Answers) -> Flags:
    """Where there was nothing to judge, shape (N,)."""
    return np.zeros(len(answers.value), bool) if answers.nothing is None else answers.nothing


def _joined(parts: Sequence[tuple[Answers, Reasons]]) -> tuple[Answers, Reasons]:
    said = [answers for answers, _ in parts]
    interval = None
    if any(answers.interval is not None for answers in said):
        # Where all of a stretch is exact, it is not in another one.
        ends = [answers.interval or (answers.value, answers.value) for answers in said]
        interval = np.concatenate([low for low, _ in ends]), np.concatenate([high for _, high in ends])
    joined = Answers(
        np.concatenate([np.zeros(0), *(answers.value for answers in said)]),
        np.concatenate([np.zeros(0), *(answers.limit for answers in said)]),
        np.concatenate([np.zeros(0, np.uint8), *(answers.verdict for answers in said)]),
        interval,
        np.concatenate([np.zeros(0, bool), *(_idle(answers) for answers in said)]),
    )
    return joined, np.concatenate([np.zeros(0, object), *(reasons for _, reasons in parts)])


def _walked(
    model: Model,
    bound: Sequence[Bound],
    motion: Motion,
    findings: Sequence[Finding],
    only: Flags | None = None,
) -> Stretch:
    """Ask every criterion instant by instant, as in a run.

    Args:
        model: The compiled workstation.
        bound: The criteria.
        motion: Where everybody is.
        findings: See `judged`.
        only: Instants that are asked, each with the one before; all of them when None. Of others it says
            nothing that counts.
    """
    hearings = hearings_of(model, motion)
    data = mujoco.MjData(model.mj)
    state = State(model, data, hearings)
    # With criteria that were bound for another run, what they remember of it would be in the way.
    fresh = [
        Bound(changed(one.criterion, every=None), one.group, one.criterion.bind(model), one.basis, one.watch)
        for one in bound
    ]
    judge = Judge(fresh, findings, unmoved=motion.unmoved)
    many = settled() if only is None else nullcontext()
    if motion.foreseen:
        state.foresee, state.knots = partial(_foresee, model, motion, state), partial(_knots, motion)
    rows: list[tuple[Result, ...]] = []
    with many:
        for k, t in enumerate(motion.t.tolist()):
            if only is not None and not (only[k] or only[min(k + 1, len(only) - 1)]):
                rows.append(())
                continue
            data.qpos[:], data.qvel[:] = motion.q[k], motion.v[k]
            hear(hearings, motion, k)
            state.path = motion.ways[k - 1] if motion.ways and k and rows[-1] else None
            state.refresh(t)
            rows.append(judge(state))
    said_nothing = tuple(Result(name=one.criterion.name) for one in bound)
    rows = [row or said_nothing for row in rows]
    return {one.criterion.name: _of_results([row[i] for row in rows]) for i, one in enumerate(bound)}


def _foresee(
    model: Model, motion: Motion, state: State, name: str, t: Array
) -> tuple[Array, Array, str] | None:
    """Tell what a robot or human does ahead (`seerob.twin.motion.Foresee`): the motion says it."""
    if name in motion.unforeseen:
        return None
    rows = np.searchsorted(motion.t, t - SLACK)
    beyond, rows = bool(len(rows)) and rows[-1] >= len(motion.t), np.minimum(rows, len(motion.t) - 1)
    columns = state.columns[name]
    q, qd = motion.q[rows][:, columns.own_q], motion.v[rows][:, columns.own_v]
    if motion.ways is not None:
        between = (rows > 0) & (motion.t[rows - 1] + SLACK < t) & (t < motion.t[rows] - SLACK)
        if between.any():
            q_there, v_there = _on_ways(motion.ways, rows[between] - 1, t[between])
            q[between], qd[between] = q_there[:, columns.own_q], v_there[:, columns.own_v]
    why = next(filter(None, motion.invalid_reasons[name][rows].tolist()), "")
    if beyond and np.abs(motion.v[-1][columns.own_v]).max(initial=0.0) > STANDS:
        why = why or "the motion ends, and what it does after is not known"
    return q, qd, why


def _on_ways(ways: Sequence[Path], k: NDArray[np.int64], t: Array) -> tuple[Array, Array]:
    """``qpos`` (m, nq) and ``qvel`` (m, nv) at instants [s], shape (m,), each on one way, shape (m,)."""
    if isinstance(ways, Ways):
        return ways.at(k, t)
    every = [ways[way].at(instant) for way, instant in zip(k.tolist(), t.tolist(), strict=True)]
    return np.array([q for q, _ in every]), np.array([v for _, v in every])


def _knots(motion: Motion, name: str, begin: float, end: float) -> Sequence[float] | Array:
    """Tell between which instants of a motion a robot moves along one cubic (`seerob.twin.spans.Knots`)."""
    if motion.ways is None:
        return []
    first, last = np.searchsorted(motion.t, (begin, end)).tolist()
    ways = motion.ways[max(first - 1, 0) : last]
    if isinstance(ways, Ways):
        inside = ways.knots_inside()
    else:
        inside = np.array([t for way in ways for t in way.t[1:-1].tolist()])
    return np.asarray(inside[(begin + SLACK < inside) & (inside < end - SLACK)])


def _of_results(results: Sequence[Result]) -> tuple[Answers, Reasons]:
    def numbers(values: Sequence[float | None]) -> Array:
        return np.array([np.nan if value is None else value for value in values], float)

    answers = Answers(
        numbers([r.value for r in results]),
        numbers([r.limit for r in results]),
        np.array([CODES[r.verdict] for r in results], np.uint8),
        nothing=np.array([r.nothing for r in results], bool),
    )
    if any(r.interval for r in results):
        low, high = (numbers([r.interval[k] if r.interval else r.value for r in results]) for k in range(2))
        answers = replace(answers, interval=(low, high))
    reasons = [r.reason if r.verdict is Verdict.UNDECIDED else "" for r in results]
    return answers, np.array(reasons, object)
