"""What every rule made of a table of angle zones shares: the table over time, sides, and the worst row."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, NamedTuple, cast

from msgspec import Meta

from seerob.core.errors import InputError
from seerob.core.figures import whatever_is_missing
from seerob.core.snapshot import Aspect, Basis, Highlight, Input, Origin, Result, Row, RowState, Verdict
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.scoring.basis import ACCURACY_NOTE, entered, posture_quality
from seerob.criteria.scoring.phases import Phase, Sides, on_sides, phase_at, shared_phases
from seerob.criteria.scoring.rule import PostureRule, bind_posture
from seerob.criteria.scoring.score_rows import total_row
from seerob.criteria.scoring.zones import DERIVED, ZoneMonitor, ZoneRow, ZoneTable, sided, value_of
from seerob.description.humans.angles import NEEDS, Angles
from seerob.description.humans.skeleton import SIDES
from seerob.model import provenance
from seerob.model.model import Model
from seerob.twin.state import State

FROM_MEMORY = "by figures quoted from memory, not verified (M)"
"""What a verdict rests on whose table says so."""
Scores = dict[tuple[str, int], tuple[float, float]]


class SupportPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What tables of zones ask and no posture shows; what is left out is not assessed."""

    supported_arms: Sides | None = None
    """Arms whose weight is fully supported."""
    back_supported: bool | None = None
    """The trunk is well supported."""


class Zoned(NamedTuple):
    """What a score of one instant was looked up by."""

    angles: Angles
    scores: Scores
    ends: tuple[float, float]
    """Score of the worse side, at least and at most."""
    absent: tuple[tuple[str, int], ...]
    """Angles that are not measured."""


class ZoneRule(PostureRule, frozen=True, kw_only=True):
    """Base of the rules that look angles up in a table of zones."""

    COMBINE: ClassVar[Literal["max", "sum"]] = "max"

    limit: Annotated[float, Meta(ge=0)] | None = None
    """Greatest admissible score."""
    phases: tuple[SupportPhase, ...] = ()
    """Phases of the task, each from its `start` on; without any, those of ``[[phases]]``."""
    from_rest: bool = False
    """The work begins with the run. If not, what was held or repeated before it is unknown."""

    def zones(self, model: Model) -> ZoneTable:
        """The table.

        Raises:
            InputError: With every mistake in it.
        """
        raise NotImplementedError

    def combination(self) -> Literal["max", "sum"]:
        """How the scores of several angles become one."""
        return self.COMBINE

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the score."""
        read = bind_posture(model, self.human, self.unmeasured)
        phases = shared_phases(model, self.human, self.phases, SupportPhase.from_task)
        rows, error = self.zones(model).rows, self.error(model)
        self._refuse_idle(rows)
        watch = ZoneMonitor(rows, from_rest=self.from_rest)
        # Whether more than the accuracy leaves the score open, what was held before above all; with a limit
        # both are in the interval that is judged.
        exactly = ZoneMonitor(rows, from_rest=self.from_rest) if error and self.limit is None else watch

        def compute(twin: Twin) -> Figure:
            assert isinstance(twin, State)
            angles, phase = read(twin), phase_at(phases, twin.t, SupportPhase())
            scores = watch.add(twin.t, angles, 0.0 if error is None else error, _support(phase))
            joined = [self._joined(scores, side) for side in range(2)]
            low, high = max(ends[0] for ends in joined), max(ends[1] for ends in joined)
            absent = tuple(key for key in scores if math.isnan(value_of(*key, angles, 0.0)[0]))
            known = low == high and not absent
            open_anyway = error is None and not known
            if exactly is not watch:
                alone = exactly.add(twin.t, angles, 0.0, _support(phase))
                ends = [self._joined(alone, side) for side in range(2)]
                open_anyway = max(low for low, _ in ends) != max(high for _, high in ends)
            return Figure(
                low if known else None,
                self.limit,
                interval=None if known and error is None else (low, high),
                # It is what was before that nobody knows.
                open=bool(absent) or open_anyway,
                beside=Zoned(angles, scores, (low, high), absent),
            )

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says and colours which rows of the table hold."""
        rows = self.zones(model).rows
        return lambda state, figure, verdict: self._shown(rows, figure, verdict)

    def one_by_one(self, model: Model) -> str:
        """Say so: how long something is held, and how often, is found as it happens."""
        return "what is held and repeated is found as it happens"

    def _refuse_idle(self, rows: tuple[ZoneRow, ...]) -> None:
        """Refuse a limit that no posture exceeds.

        Raises:
            InputError: The table has no score beyond the limit.
        """
        join = max if self.combination() == "max" else sum
        most = join([max(r.score for r in rows if r.angle == angle) for angle in {r.angle for r in rows}])
        if self.limit is not None and self.limit >= most:
            what = f"no posture scores more than {most:g} by this table: nothing exceeds {self.limit:g}"
            remedy = "give less, or leave it out to be told the score alone"
            raise InputError.at(self.name, "limit", what, remedy)

    def _shown(self, rows: tuple[ZoneRow, ...], figure: Figure, verdict: Verdict | None) -> Shown:
        angles, scores, (low, high), absent = cast("Zoned", figure.beside)
        missing = [_label(*key) for key in absent]
        worst = [key for key, ends in scores.items() if ends[1] == max(e[1] for e in scores.values())]
        drivers = [key for key in worst if scores[key][1] > 0 and key not in absent]
        reasons = []
        if missing:
            reasons.append(f"not assessed: {', '.join(missing)}")
        if missing or low != high:
            reasons.append(whatever_is_missing("score", low, high))
        reasons += [self._said(rows, key, angles, scores[key]) for key in drivers[:4]]
        deciding = {angle for angle, _ in drivers} if verdict is Verdict.EXCEEDED else {r.angle for r in rows}
        decided = verdict in (Verdict.WITHIN, Verdict.EXCEEDED)
        if decided and any(r.confidence == "M" and r.angle in deciding for r in rows):
            reasons.append(FROM_MEMORY)
        best = max((row.score for row in rows), default=0.0)
        top = best if self.combination() == "max" else sum(_tops(rows, scores).values())
        return Shown(
            "; ".join(reasons),
            lambda: tuple(
                Highlight(body=body, verdict=verdict)
                for body in dict.fromkeys(b for key in drivers for b in self._bones(*key))
            ),
            parts=tuple(
                Result(
                    name=_label(*key),
                    value=ends[0] if ends[0] == ends[1] else None,
                    verdict=None if ends[0] == ends[1] else Verdict.UNDECIDED,
                    reason=self._said(rows, key, angles, ends),
                    interval=None if ends[0] == ends[1] else ends,
                )
                for key, ends in scores.items()
            ),
            rows=(
                total_row("", (low, high), None, (0.0, top), self.limit, verdict),
                *(self._row(rows, key, angles, ends) for key, ends in scores.items()),
            ),
        )

    def _joined(self, scores: Scores, side: int) -> tuple[float, float]:
        own = [ends for (name, at), ends in scores.items() if at == side or not sided(name)]
        join = max if self.combination() == "max" else sum
        return _points(join([e[0] for e in own] or [0.0])), _points(join([e[1] for e in own] or [0.0]))

    def _bones(self, name: str, side: int) -> tuple[str, ...]:
        needed = [bone for part in DERIVED.get(name, (name,)) for bone in NEEDS[part]]
        return (f"{self.human}/{needed[-1].format(side=SIDES[side])}",)

    def _said(
        self, rows: tuple[ZoneRow, ...], key: tuple[str, int], angles: Angles, ends: tuple[float, float]
    ) -> str:
        value, _ = value_of(*key, angles, 0.0)
        if math.isnan(value):
            return f"{_label(*key)}: not measured"
        here = [row for row in _of(rows, key) if row.within(value) and ends[0] <= row.score <= ends[1]]
        named = next((r.label or r.colour for r in reversed(here) if r.score == ends[1]), "")
        points = f"{ends[0]:g}" if ends[0] == ends[1] else f"{ends[0]:g} to {ends[1]:g}"
        text = f"{_label(*key)} {round(math.degrees(value))}°: {points}"
        return f"{text} ({named})" if named else text

    def _row(
        self, rows: tuple[ZoneRow, ...], key: tuple[str, int], angles: Angles, ends: tuple[float, float]
    ) -> Row:
        value, _ = value_of(*key, angles, 0.0)
        known = ends[0] == ends[1]
        return Row(
            name=key[0].replace("_", " "),
            side=SIDES[key[1]] if sided(key[0]) else "",
            state=RowState.JUDGED if known else RowState.NOT_ASSESSED,
            value=ends[0] if known else None,
            scale=(0.0, max((row.score for row in _of(rows, key)), default=0.0)),
            interval=None if known else ends,
            reason=self._said(rows, key, angles, ends),
            bones=self._bones(*key),
            aspects=(
                Aspect(
                    name=key[0].replace("_", " "),
                    value=None if math.isnan(value) else value,
                    unit="rad",
                    band=next((_range(row) for row in _of(rows, key) if row.within(value)), ""),
                ),
            ),
        )

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        table = self.zones(model)
        phases = shared_phases(model, self.human, self.phases, SupportPhase.from_task)
        asks = any(row.support is not None for row in table.rows)
        return Basis(
            formula=f"{self.combination()} over the angles of the highest row that holds; the worse side",
            source=table.source or table.title,
            inputs=(
                *provenance.motion(model, self.human),
                *(entered(phases, SupportPhase()) if asks else ()),
                *(_stated(row) for row in table.rows),
                *posture_quality(self.accuracy, self.joint_accuracy, self.unmeasured, model, self.human),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                "angles that the table has no row for",
                *((ACCURACY_NOTE,) if self.error(model) is not None else ()),
            ),
        )


def _support(phase: SupportPhase) -> dict[tuple[str, int], bool | None]:
    arms = on_sides(phase.supported_arms)
    found: dict[tuple[str, int], bool | None] = {}
    for name in (*NEEDS, *DERIVED):
        for side in range(2 if sided(name) else 1):
            known = int(arms.low[side]) == int(arms.high[side])
            arm = bool(arms.low[side]) if known else None
            found[name, side] = arm if sided(name) else phase.back_supported
    return found


def _of(rows: tuple[ZoneRow, ...], key: tuple[str, int]) -> list[ZoneRow]:
    return [row for row in rows if row.angle == key[0] and row.side in (None, SIDES[key[1]])]


def _tops(rows: tuple[ZoneRow, ...], scores: Scores) -> dict[str, float]:
    tops: dict[str, float] = {}
    for key in scores:
        own = max((row.score for row in _of(rows, key)), default=0.0)
        tops[key[0]] = max(tops.get(key[0], 0.0), own)
    return tops


def _label(name: str, side: int) -> str:
    text = name.replace("_", " ")
    return f"{SIDES[side]} {text}" if sided(name) else text


def _range(row: ZoneRow) -> str:
    ends = ["" if x is None else f"{math.degrees(x):.4g}°" for x in (row.low, row.high)]
    size = " either way" if row.either_way else ""
    if all(ends):
        return f"{ends[0]} to {ends[1]}{size}"
    return (f"from {ends[0]}" if ends[0] else f"below {ends[1]}" if ends[1] else "any") + size


def _stated(row: ZoneRow) -> Input:
    """A row in words, with how sure it is."""
    words = [_range(row)]
    words += [f"held {row.hold:g} s"] if row.hold is not None else []
    words += [f"{row.per_minute:g} per minute"] if row.per_minute is not None else []
    if row.allowed is not None:
        to = "" if row.allowed_at_end is None else f" to {row.allowed_at_end:g}"
        words.append(f"held longer than {row.allowed:g}{to} s")
    words += [f"{row.support} support"] if row.support else []
    side = f"{row.side} " if row.side else ""
    return Input(
        name=f"{side}{row.angle.replace('_', ' ')}, {', '.join(words)}",
        value=row.score,
        origin={"": Origin.GIVEN, "M": Origin.ESTIMATED}.get(row.confidence, Origin.STATED),
        source=" ".join(filter(None, (row.label, f"[{row.confidence}]" if row.confidence else ""))),
    )


def _points(score: float) -> float:
    """A score that is whole as such, so that it keeps the limit that it is on; see `verdict.keeps`."""
    return int(score) if float(score).is_integer() else score
