"""Posture screening in the style of the EAWS form: sections 0 and 1, over the time of a cycle."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct
from msgspec.structs import asdict

from seerob.core.snapshot import Basis, Highlight, Input, Origin, Result, Row, RowState, Verdict
from seerob.criteria.criterion import Evaluate, judge_interval
from seerob.criteria.postures.ergonomic_posture import bind_posture
from seerob.criteria.postures.rule import PostureRule
from seerob.criteria.scoring import eaws_posture as method
from seerob.criteria.scoring.basis import chosen, entered, posture_quality
from seerob.criteria.scoring.eaws_screening import Points, Screening
from seerob.criteria.scoring.phases import Period, Phase, Seconds, Stance, phase_at, shared_phases
from seerob.criteria.scoring.published import published
from seerob.criteria.scoring.score_rows import total_row
from seerob.model import provenance
from seerob.model.model import Model
from seerob.twin.state import State

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
    interpolation: method.Interpolation = method.Interpolation.LINEAR
    """What lies between the columns of the form; a choice."""
    phases: tuple[EawsPhase, ...] = ()
    """Phases of the task, each from its `start` on; without any, those of ``[[phases]]``."""
    thresholds: method.EawsThresholds = method.EawsThresholds()
    """Angles at which a posture belongs to a line."""

    def bind(self, model: Model) -> Evaluate:
        """Look up every name in the model once and return the function that judges one instant."""
        read = bind_posture(model, self.human, self.unmeasured)
        phases = shared_phases(model, self.human, self.phases, EawsPhase.from_task)
        error = self.error()
        screening = Screening(self.cycle, self.minimum_hold, self.interpolation)

        def evaluate(state: State) -> Result:
            angles = read(state)
            phase = phase_at(phases, state.t, EawsPhase())
            found = method.possible_lines(
                angles,
                legs=phase.legs,
                supported=phase.back_supported,
                thresholds=self.thresholds,
                accuracy=0.0 if error is None else error,
            )
            screening.add(state.t, found, angles, 0.0 if error is None else error)
            return self._result(found, screening)

        return evaluate

    def _result(self, now: tuple[str, ...], screening: Screening) -> Result:
        low, high = screening.points()
        given = asdict(self.entered)
        missing = [name.replace("_", " ") for name, value in given.items() if value is None]
        whole = sum(value or 0.0 for name, value in given.items() if name != "upper_limbs")
        ends = (low.total + whole, high.total + whole)
        limbs = given["upper_limbs"] or 0.0
        ends = (max(ends[0], limbs), max(ends[1], limbs))
        every = not missing
        known = ends[1] - ends[0] < 1e-9
        reasons = [f"{WHAT}, no rating: lower bound" if not every else "with entered sections 2-4"]
        if missing:
            reasons.append(f"not entered: {', '.join(missing)}")
        if screening.silent > 0:
            reasons.append(f"coverage {100 * screening.coverage:.1f} %: {screening.silent:.1f} s not heard")
        if not known:
            reasons.append(f"the points lie between {ends[0]:.1f} and {ends[1]:.1f}")
        counting = not screening.complete
        if counting:
            reasons.append(f"counting: {screening.heard:.1f} of {self.cycle:g} s, judged after a whole cycle")
        verdict = judge_interval(ends, self.limit)
        # Points of a cycle only grow until it is whole: what is too much already stays so, the rest is open.
        if counting and verdict is not Verdict.EXCEEDED:
            verdict = None
        if self.limit is not None and (not every or screening.silent > 0):
            verdict = Verdict.UNDECIDED
        if every and known and not counting and screening.silent == 0:
            reasons.append(_rating(ends[0]))
        if verdict in (Verdict.WITHIN, Verdict.EXCEEDED):
            reasons.append("by figures of one public code and of memory, not verified (1 + M)")
        best = method.lines()[now[-1]]
        reasons.append(f"now line {' or '.join(now)}" + (f": {best.name}" if len(now) == 1 else ""))
        value = ends[0] if known else None
        return Result(
            name=self.name,
            value=value,
            limit=self.limit,
            verdict=verdict,
            nothing=counting and verdict is None,
            reason="; ".join(reasons),
            interval=None if known else ends,
            parts=tuple(
                Result(name=name, value=a if abs(a - b) < 1e-9 else None, interval=None if a == b else (a, b))
                for name, a, b in _pairs(low, high)
            ),
            markers=tuple(Highlight(body=f"{self.human}/{bone}", verdict=verdict) for bone in _BONES)
            if low.lines
            else (),
            rows=(
                total_row("", ends, None, (0.0, 100.0), self.limit, verdict),
                *(self._row(name, a, b) for name, a, b in _pairs(low, high)),
            ),
        )

    def _row(self, name: str, low: float, high: float) -> Row:
        known = abs(high - low) < 1e-9
        key = name.removeprefix("line ")
        line = method.lines().get(key)
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
                    value=method.Interpolation(self.interpolation).value,
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
                *chosen(self.thresholds, method.EawsThresholds()),
                *posture_quality(self.accuracy, self.joint_accuracy, self.unmeasured),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                "sections 2 to 4: action forces, handling of loads, upper limbs; they are entered or missing",
                "far reach, and frequent dynamic postures shorter than the minimum hold",
                "with an accuracy or unknown support the ends take the lightest and the heaviest line of "
                "each instant: an estimate of the interval",
                "lying counts as line 15 whatever the arms do: the form has no other line for it",
            ),
        )


def published_most() -> float:
    """Most points of trunk rotation, and of lateral bending."""
    return float(published("eaws_posture")["asymmetry_most"])


def _pairs(low: Points, high: Points) -> list[tuple[str, float, float]]:
    names = sorted({*low.lines, *high.lines}, key=list(method.lines()).index)
    found = [(f"line {name}", low.lines.get(name, 0.0), high.lines.get(name, 0.0)) for name in names]
    return [
        *found,
        ("trunk rotation", low.rotation, high.rotation),
        ("lateral bending", low.bending, high.bending),
    ]


def _rating(points: float) -> str:
    band = "0 to 25" if points <= 25 else "above 25, up to 50" if points <= 50 else "above 50"
    return f"{points:.1f} points: {band}"
