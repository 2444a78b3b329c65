"""Posture screening in the style of the EAWS form: sections 0 and 1, over the time of a cycle.

This is not the EAWS: its figures come from one public code and from memory, sections 2 to 4 are not public.
First lines and points of a posture, then the screening over time (seconds per posture line and of an
asymmetric trunk, the points of both), then the rule.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from functools import cache
from itertools import pairwise
from typing import Annotated, NamedTuple, cast

import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import asdict

from seerob.core import figures
from seerob.core.domains import number
from seerob.core.errors import UnknownName
from seerob.core.snapshot import Basis, Highlight, Input, Origin, Result, Row, RowState, Verdict
from seerob.core.verdict import keeps
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.scoring.basis import chosen, entered, posture_quality
from seerob.criteria.scoring.held_work import GAP
from seerob.criteria.scoring.measured import Accuracy, Measured
from seerob.criteria.scoring.phases import Period, Phase, Seconds, phase_at, shared_phases
from seerob.criteria.scoring.rule import PostureRule, bind_posture
from seerob.criteria.scoring.score_rows import total_row
from seerob.criteria.scoring.spans import ROUNDING, Angle, Span, published, reached
from seerob.description.humans.angles import Angles
from seerob.model import provenance
from seerob.model.model import Model
from seerob.twin.state import State
from seerob.workstation.tables.task_phase import Stance


class Interpolation(StrEnum):
    """What lies between two columns of the form."""

    LINEAR = "linear"
    """Linear between columns, proportional below the first, the last column beyond it."""
    STEP = "step"
    """The column that was reached; 0 below the first."""


class EawsThresholds(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Angles at which a posture belongs to a line."""

    bent: Angle = math.radians(20)
    """Trunk bent forward from here on [rad]."""
    far_bent: Angle = math.radians(60)
    """Trunk strongly bent forward beyond [rad]."""
    overhead: Angle = math.radians(40)
    """Elbow or wrist above the horizontal through the shoulder by more: hands above head [rad]; a choice."""
    crouching: Angle = math.radians(60)
    """Both knees bent beyond [rad]: crouching; a choice."""
    kneeling: Angle = math.radians(60)
    """Shank from the vertical beyond [rad]: kneeling; a choice."""


class Line(NamedTuple):
    """One line of the form."""

    id: str
    name: str
    position: str
    points: tuple[float, ...]
    confidence: str


@cache
def lines() -> dict[str, Line]:
    """The lines by their number."""
    rows = published("eaws_posture")["lines"]
    return {row["id"]: Line(**{**row, "points": tuple(map(float, row["points"]))}) for row in rows}


POSITIONS: Mapping[Stance, str] = {
    "sitting": "sitting",
    "standing": "standing",
    "one_leg": "standing",
    "walking": "walking",
    "both_knees_bent": "kneeling",
    "one_knee_bent": "kneeling",
    "kneeling": "kneeling",
    "lying": "lying",
    "climbing": "climbing",
}
"""How the legs are used → group of lines."""


def line_points(line: str, share: float, interpolation: Interpolation = Interpolation.LINEAR) -> float:
    """Points of a posture that lasts for a share of the time, 0 to 1."""
    if line not in lines():
        raise UnknownName("line of the form", line, lines())
    number("share", share, 0, 1 + _ROUNDING)
    points = lines()[line].points
    shares = published("eaws_posture")["shares"][: len(points)]
    if Interpolation(interpolation) is Interpolation.STEP:
        reached = int(np.searchsorted(shares, share + _ROUNDING, side="right"))
        return points[reached - 1] if reached else 0.0
    return float(np.interp(share, [0.0, *shares], [0.0, *points]))


def most_points(shares: Mapping[str, float], whole: float) -> float:
    """At most so many points of postures together, of which each may last for no more than its share.

    Args:
        shares: Of the time that each line may have at most, 0 to 1; together they may be more than the whole.
        whole: Share of the time that all of them have together.

    Returns:
        The smaller of two bounds: all shares at once, and the whole time given to where it costs most, by
        the least concave curves above the points of the form.
    """
    number("whole", whole, 0, 1 + _ROUNDING)
    at_once = sum(line_points(line, share) for line, share in shares.items())
    pieces = sorted(
        (
            ((end[1] - begin[1]) / (end[0] - begin[0]), min(end[0], shares[line]) - begin[0])
            for line in shares
            for begin, end in pairwise(_above(line))
            if shares[line] > begin[0]
        ),
        reverse=True,
    )
    given, left = 0.0, whole
    for slope, width in pieces:
        given += slope * min(width, left)
        left -= min(width, left)
    return min(at_once, given)


def _above(line: str) -> list[tuple[float, float]]:
    """Corners of the least concave curve above the points of a line: share and points."""
    points = lines()[line].points
    hull = [(0.0, 0.0)]
    for x, y in zip(published("eaws_posture")["shares"][: len(points)], points, strict=True):
        while len(hull) > 1 and (y - hull[-2][1]) * (hull[-1][0] - hull[-2][0]) >= (
            hull[-1][1] - hull[-2][1]
        ) * (x - hull[-2][0]):
            hull.pop()
        hull.append((x, y))
    return hull


def asymmetry_points(at_least: tuple[float, ...]) -> float:
    """Points of a trunk that is turned, or bent sideways.

    Args:
        at_least: Share of the time at or beyond each of the form's three angles.
    """
    table = published("eaws_posture")
    number("share", at_least, 0, 1 + _ROUNDING)
    best = 0.0
    for share, points in zip(at_least, table["asymmetry_points"], strict=True):
        reached = int(np.searchsorted(table["asymmetry_shares"], share + _ROUNDING, side="right"))
        factor = table["asymmetry_factors"][reached - 1] if reached else 0.0
        best = max(best, points * factor)
    return float(min(best, table["asymmetry_most"]))


def possible_lines(
    angles: Angles,
    *,
    legs: Stance | None,
    supported: bool | None,
    thresholds: EawsThresholds,
    accuracy: Accuracy = 0.0,
) -> tuple[str, ...]:
    """Lines that a posture may belong to; one when it is known.

    Of several that fit, a posture belongs to the one with the most points: bent or arms raised.

    Args:
        angles: Of one posture.
        legs: How they are used; ``posture`` tells standing, crouching and kneeling apart.
        supported: Whether the trunk is well supported; None when nobody said.
        thresholds: Of the lines.
        accuracy: Of each angle [rad].
    """
    t, m = thresholds, Measured(angles, accuracy)
    bent = m.graded(
        "trunk_flexion",
        lambda x: reached(x, t.bent).astype(np.int64) + reached(x, t.far_bent),
        within=(0, 2),
        neutral=-math.inf,
    )
    arms = _highest(
        m.graded(
            "arm_rise",
            lambda x: (x >= -ROUNDING).astype(np.int64) + reached(x, t.overhead),
            within=(0, 2),
            neutral=-math.inf,
        )
    )
    positions = _positions(m, legs, t)
    held = [supported] if supported is not None else [True, False]
    found: dict[str, None] = {}
    for position in positions:
        for b in range(int(bent.low), int(bent.high) + 1):
            for a in range(int(arms.low), int(arms.high) + 1):
                for support in held:
                    found[_line(position, b, a, support)] = None
    return tuple(sorted(found, key=_weight))


def _highest(span: Span) -> Span:
    return Span(span.low.max(axis=-1), span.high.max(axis=-1))


def _positions(measured: Measured, legs: Stance | None, t: EawsThresholds) -> tuple[str, ...]:
    if legs is None:
        return tuple(dict.fromkeys(POSITIONS.values()))
    if legs != "posture":
        return (POSITIONS[legs],)
    folded = measured.beyond("knee_flexion", t.crouching)
    flat = measured.beyond("shank_tilt", t.kneeling)
    low = folded.low.min() == 1 or flat.low.max() == 1
    high = folded.high.min() == 1 or flat.high.max() == 1
    return ("kneeling",) if low else ("standing", "kneeling") if high else ("standing",)


def _line(position: str, bent: int, arms: int, supported: bool) -> str:
    if position in ("lying", "climbing"):
        return {"lying": "15", "climbing": "16"}[position]
    if position == "sitting":
        upright = "9" if bent else "7" if supported else "8"
        return (upright, "10", "11")[arms]
    if position == "kneeling":
        upright = "13" if bent else "12"
        return upright if arms == 0 else "14"
    upright = "1" if supported or position == "walking" else "2"
    trunk = (upright, "3b" if supported else "3a", "4b" if supported else "4a")[bent]
    return max((trunk, (trunk, "5", "6")[arms]), key=_weight)


def _weight(line: str) -> float:
    return line_points(line, 0.66)


_ROUNDING = 1e-9


class PostureTime:
    """Seconds by posture; a posture counts, from its begin, once it was held long enough.

    Args:
        hold: How long a posture is held to count [s].
    """

    def __init__(self, hold: float) -> None:
        self._hold = hold
        self._posture: str | None = None
        self._since = self._t = math.nan
        self.seconds: dict[str, float] = {}
        """Posture → time for which it was held [s], where it was held long enough to count."""
        self.heard = 0.0
        """All time that was heard [s]."""
        self.silent = 0.0
        """Time in which nothing was heard [s]."""

    def add(self, t: float, posture: str) -> None:
        """The posture from the instant before up to this one [s]."""
        number("the instant", t, unit="s")
        step = t - self._t
        if math.isnan(step):
            self._posture, self._since = posture, t
        elif step > GAP + _ROUNDING:
            self.silent += step
            self._posture, self._since = posture, t
        else:
            self.heard += step
            before = 0.0 if self._posture is None else self._credit(self._t)
            after = 0.0 if self._posture is None else self._credit(t)
            if self._posture is not None and after > before:
                self.seconds[self._posture] = self.seconds.get(self._posture, 0.0) + after - before
            if posture != self._posture:
                self._posture, self._since = posture, t
        self._t = t

    def _credit(self, t: float) -> float:
        held = t - self._since
        return held if held >= self._hold - _ROUNDING else 0.0


_TURNS = ("trunk_twist", "trunk_side_bend")


class Points(NamedTuple):
    """Points so far."""

    lines: dict[str, float]
    rotation: float
    bending: float
    together: float
    """Of all lines."""

    @property
    def total(self) -> float:
        """Points of section 1, far reach apart."""
        most = float(published("eaws_posture")["asymmetry_sum_most"])
        return self.together + min(self.rotation + self.bending, most)


class _Ledger:
    """Time by line and by size of the asymmetry, at one end of what is possible."""

    def __init__(self, hold: float) -> None:
        self.lines = PostureTime(hold)
        self.turns = {name: [PostureTime(0.0) for _ in range(3)] for name in _TURNS}


class Screening:
    """Points of a posture as time goes on, least and greatest.

    Args:
        cycle: Length of the cycle [s]; shares are of this, or of all that was heard when that is longer.
        hold: How long a posture is held to count [s].
        interpolation: Between the columns of the form.
    """

    def __init__(self, cycle: float, hold: float, interpolation: Interpolation) -> None:
        self._cycle, self._hold, self._interpolation = cycle, hold, interpolation
        self._t = -math.inf
        self._begin()

    def _begin(self) -> None:
        self._ends = (_Ledger(self._hold), _Ledger(self._hold))
        self._may = {name: PostureTime(self._hold) for name in lines()}
        self._open = False
        """Whether some posture may have belonged to several lines."""

    def add(self, t: float, possible: tuple[str, ...], angles: Angles, accuracy: Accuracy) -> None:
        """What a posture may be at an instant [s], lightest line first; an earlier instant begins anew."""
        if t < self._t:
            self._begin()
        if t == self._t:
            return
        self._t = t
        measured = Measured(angles, accuracy)
        self._open = self._open or len(possible) > 1
        for name, timer in self._may.items():
            timer.add(t, name if name in possible else "")
        for end, ledger in enumerate(self._ends):
            ledger.lines.add(t, possible[-end])
            for name, timers in ledger.turns.items():
                for edge, timer in zip(published("eaws_posture")["asymmetry_from_deg"], timers, strict=True):
                    turned = measured.beyond(name, math.radians(edge))
                    timer.add(t, "turned" if int(turned[end]) else "")

    @property
    def heard(self) -> float:
        """Time that was heard [s]."""
        return self._ends[0].lines.heard

    @property
    def silent(self) -> float:
        """Time in which nothing was heard [s]."""
        return self._ends[0].lines.silent

    @property
    def coverage(self) -> float:
        """Share of the time that was heard."""
        return self.heard / (self.heard + self.silent) if self.heard > 0 else 0.0

    @property
    def complete(self) -> bool:
        """Whether a whole cycle was heard."""
        return self.heard >= self._cycle - 1e-6

    def points(self) -> tuple[Points, Points]:
        """Least and greatest."""
        whole = max(self._cycle, self.heard)
        found = []
        for ledger in self._ends:
            seconds = {name: s for name, s in ledger.lines.seconds.items() if name}
            turns = [
                asymmetry_points(tuple(timer.seconds.get("turned", 0.0) / whole for timer in timers))
                for timers in ledger.turns.values()
            ]
            points = {name: line_points(name, s / whole, self._interpolation) for name, s in seconds.items()}
            found.append(Points(points, turns[0], turns[1], sum(points.values())))
        if self._open:
            # Which line a posture had may have changed, or stayed and been held, as no single guess of it is.
            shares = {name: timer.seconds.get(name, 0.0) / whole for name, timer in self._may.items()}
            most = {name: line_points(name, x, self._interpolation) for name, x in shares.items() if x > 0}
            together = max(found[0].together, most_points(shares, self.heard / whole))
            found[1] = found[1]._replace(lines=most, together=together)
        return found[0], found[1]


WHAT = "EAWS-style posture screening (sections 0-1 only)"
_BONES = ("lumbar", "thorax")


class EawsPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the lines ask and no posture shows; what is left out may be any line."""

    legs: Stance | None = None
    """How the legs are used; ``posture`` tells standing, crouching and kneeling apart."""
    back_supported: bool | None = None
    """The body or trunk is well supported: leaning, or a back rest."""


class EawsEntered(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Points that somebody with the form and the training entered."""

    moving_objects: Annotated[float, Meta(ge=0, le=15)] | None = None
    """0a: adverse effects by moving objects."""
    accessibility: Annotated[float, Meta(ge=0, le=10)] | None = None
    """0b: such as entering a vehicle."""
    impulses: Annotated[float, Meta(ge=0, le=40)] | None = None
    """0c: countershocks, impulses, vibrations."""
    joint_position: Annotated[float, Meta(ge=0, le=40)] | None = None
    """0d: especially of the wrist."""
    special: Annotated[float, Meta(ge=0, le=15)] | None = None
    """0e: other special situations."""
    far_reach: Annotated[float, Meta(ge=0, le=10)] | None = None
    """1: far reach, which is not seen in the posture."""
    forces: Annotated[float, Meta(ge=0, le=1000)] | None = None
    """2: action forces."""
    loads: Annotated[float, Meta(ge=0, le=1000)] | None = None
    """3: manual handling of materials."""
    upper_limbs: Annotated[float, Meta(ge=0, le=1000)] | None = None
    """4: upper limbs in repetitive tasks."""


OTHERS = ("forces", "loads", "upper_limbs")
"""Sections 2 to 4."""


class Screened(NamedTuple):
    """What the points of a cycle up to one instant were made from."""

    now: tuple[str, ...]
    """Lines that the posture of this instant may have, the lightest first."""
    low: Points
    high: Points
    ends: tuple[float, float]
    """Points with those that were entered, at least and at most."""
    missing: tuple[str, ...]
    """What nobody entered."""
    counting: bool
    """Whether the cycle is not whole."""
    heard: float
    """[s]"""
    silent: float
    """[s]"""
    coverage: float


class EawsPosture(PostureRule, frozen=True, kw_only=True):
    """EAWS-style posture screening (sections 0-1 only); not the EAWS."""

    cycle: Period
    """Length of the cycle or task that shares of time are of [s]."""
    entered: EawsEntered = EawsEntered()
    """Points that are entered; what is left out is not assessed."""
    limit: Annotated[float, Meta(ge=0)] | None = None
    """Greatest admissible points; judged only when sections 2 to 4 are entered."""
    minimum_hold: Seconds = 4.0
    """A posture counts when it is held so long [s]; 0 counts all, as frequent dynamic postures need."""
    interpolation: Interpolation = Interpolation.LINEAR
    """What lies between the columns of the form; a choice."""
    phases: tuple[EawsPhase, ...] = ()
    """Phases of the task, each from its `start` on; without any, those of ``[[phases]]``."""
    thresholds: EawsThresholds = EawsThresholds()
    """Angles at which a posture belongs to a line."""

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the points."""
        read = bind_posture(model, self.human, self.unmeasured)
        phases = shared_phases(model, self.human, self.phases, EawsPhase.from_task)
        error = self.error(model)
        screening = Screening(self.cycle, self.minimum_hold, self.interpolation)
        given = asdict(self.entered)
        missing = tuple(name.replace("_", " ") for name, value in given.items() if value is None)
        whole = sum(value or 0.0 for name, value in given.items() if name != "upper_limbs")
        limbs = given["upper_limbs"] or 0.0

        def compute(twin: Twin) -> Figure:
            assert isinstance(twin, State)
            angles, phase = read(twin), phase_at(phases, twin.t, EawsPhase())
            now = possible_lines(
                angles,
                legs=phase.legs,
                supported=phase.back_supported,
                thresholds=self.thresholds,
                accuracy=0.0 if error is None else error,
            )
            screening.add(twin.t, now, angles, 0.0 if error is None else error)
            low, high = screening.points()
            ends = (max(low.total + whole, limbs), max(high.total + whole, limbs))
            known = ends[1] - ends[0] < 1e-9
            rests = self.limit is not None and (bool(missing) or screening.silent > 0)
            # Points of a cycle only grow until it is whole: what is too much already stays so.
            counting = not screening.complete
            exceeds = self.limit is not None and not keeps(ends[0], self.limit)
            return Figure(
                ends[0] if known else None,
                self.limit,
                interval=None if known else ends,
                nothing=counting and not exceeds and not rests,
                undecided=rests,
                beside=Screened(
                    now,
                    low,
                    high,
                    ends,
                    missing,
                    counting,
                    screening.heard,
                    screening.silent,
                    screening.coverage,
                ),
            )

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says and colours which lines hold."""
        return lambda state, figure, verdict: self._shown(figure, verdict)

    def one_by_one(self, model: Model) -> str:
        """Say so: shares of time are counted as it goes."""
        return "shares of the cycle are counted as it goes"

    def _shown(self, figure: Figure, verdict: Verdict | None) -> Shown:
        found = cast("Screened", figure.beside)
        low, high, ends, missing = found.low, found.high, found.ends, found.missing
        known = figure.value is not None
        reasons = [f"{WHAT}, no rating: lower bound" if missing else "with entered sections 2-4"]
        if missing:
            reasons.append(f"not entered: {', '.join(missing)}")
        if found.silent > 0:
            reasons.append(f"coverage {100 * found.coverage:.1f} %: {found.silent:.1f} s not heard")
        if not known:
            between = figures.ends(*ends)
            reasons.append(f"the points lie between {between[0]} and {between[1]}")
        if found.counting:
            reasons.append(f"counting: {found.heard:.1f} of {self.cycle:g} s, judged after a whole cycle")
        if known and not missing and not found.counting and found.silent == 0:
            reasons.append(_rating(ends[0]))
        if verdict in (Verdict.WITHIN, Verdict.EXCEEDED):
            reasons.append("by figures of one public code and of memory, not verified (1 + M)")
        best = lines()[found.now[-1]]
        several = len(found.now) > 1
        reasons.append(f"now line {' or '.join(found.now)}" + ("" if several else f": {best.name}"))
        return Shown(
            "; ".join(reasons),
            lambda: (
                tuple(Highlight(body=f"{self.human}/{bone}", verdict=verdict) for bone in _BONES)
                if low.lines
                else ()
            ),
            parts=tuple(
                Result(name=name, value=a if abs(a - b) < 1e-9 else None, interval=None if a == b else (a, b))
                for name, a, b in _pairs(low, high)
            ),
            rows=(
                total_row("", ends, None, (0.0, 100.0), self.limit, verdict),
                *(self._row(name, a, b) for name, a, b in _pairs(low, high)),
            ),
        )

    def _row(self, name: str, low: float, high: float) -> Row:
        known = abs(high - low) < 1e-9
        key = name.removeprefix("line ")
        line = lines().get(key)
        most = published_most() if line is None else line.points[-1]
        return Row(
            name=name if line is None else f"{name}: {line.name}",
            group="section 1",
            state=RowState.JUDGED if known else RowState.NOT_ASSESSED,
            value=low if known else None,
            scale=(0.0, most),
            interval=None if known else (low, high),
            bones=tuple(f"{self.human}/{bone}" for bone in _BONES),
        )

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        phases = shared_phases(model, self.human, self.phases, EawsPhase.from_task)
        return Basis(
            formula="points of each posture line at its share of the cycle, trunk rotation and lateral "
            "bending, and what was entered",
            source=f"{WHAT}: one public code and memory of the form (1 + M); the form v1.3.6, first page, "
            "for section 0 (1)",
            inputs=(
                *provenance.motion(model, self.human),
                *entered(phases, EawsPhase()),
                provenance.given("cycle", self.cycle, "s"),
                Input(
                    name="a posture counts from",
                    value=self.minimum_hold,
                    unit="s",
                    origin=Origin.STATED if self.minimum_hold == 4 else Origin.GIVEN,
                    source="static from 4 s on (1 + M); option minimum_hold",
                ),
                Input(
                    name="between columns",
                    value=Interpolation(self.interpolation).value,
                    origin=Origin.CHOICE,
                    source="option interpolation",
                ),
                Input(
                    name="line 14",
                    value="row from memory",
                    origin=Origin.CHOICE,
                    source="conflict: the one public code copies line 5, which would make kneeling with "
                    "raised arms cheaper than kneeling bent",
                ),
                *(
                    Input(
                        name=f"entered {name.replace('_', ' ')}",
                        value=value,
                        origin=Origin.MISSING if value is None else Origin.GIVEN,
                        source="option entered",
                    )
                    for name, value in asdict(self.entered).items()
                ),
                *chosen(self.thresholds, EawsThresholds()),
                *posture_quality(self.accuracy, self.joint_accuracy, self.unmeasured, model, self.human),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                "sections 2 to 4: action forces, handling of loads, upper limbs; they are entered or missing",
                "far reach, and frequent dynamic postures shorter than the minimum hold",
                "with an accuracy or unknown support the least points are an estimate: those of the lightest "
                "line of each instant",
                "lying counts as line 15 whatever the arms do: the form has no other line for it",
            ),
        )


def published_most() -> float:
    """Most points of trunk rotation, and of lateral bending."""
    return float(published("eaws_posture")["asymmetry_most"])


def _pairs(low: Points, high: Points) -> list[tuple[str, float, float]]:
    names = sorted({*low.lines, *high.lines}, key=list(lines()).index)
    found = [(f"line {name}", low.lines.get(name, 0.0), high.lines.get(name, 0.0)) for name in names]
    return [
        *found,
        ("trunk rotation", low.rotation, high.rotation),
        ("lateral bending", low.bending, high.bending),
    ]


def _rating(points: float) -> str:
    band = "0 to 25" if points <= 25 else "above 25, up to 50" if points <= 50 else "above 50"
    return f"{figures.rounded_up(points)} points: {band}"
