"""OWAS on the twin: the posture code and its action category, every tick; Karhu et al. 1977."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from seerob.core.figures import whatever_is_missing
from seerob.core.snapshot import Basis, Highlight, Input, Level, Origin, Result, Row, RowState, Verdict
from seerob.criteria.criterion import Evaluate, judge, judge_interval
from seerob.criteria.postures.ergonomic_posture import bind_posture
from seerob.criteria.postures.rule import PostureRule
from seerob.criteria.scoring import owas as method
from seerob.criteria.scoring.basis import ACCURACY_NOTE, chosen, entered, posture_quality
from seerob.criteria.scoring.edges import ROUNDING
from seerob.criteria.scoring.measured import Accuracy
from seerob.criteria.scoring.phases import Kilograms, Phase, TaskPhase, phase_at, shared_phases
from seerob.criteria.scoring.published import published
from seerob.criteria.scoring.score_rows import aspects, total_row
from seerob.criteria.scoring.spans import Span
from seerob.description.humans.angles import Angles
from seerob.description.humans.skeleton import SIDES
from seerob.model import provenance
from seerob.model.model import Model
from seerob.twin.state import State

NEUTRAL = {"back": 1, "arms": 1, "legs": 2, "load": 1}
"""The code of somebody who stands upright with empty hands."""
BONES_OF = {
    "back": ("lumbar", "thorax"),
    "arms": tuple(f"{side}_upper_arm" for side in SIDES),
    "legs": tuple(f"{side}_{bone}" for side in SIDES for bone in ("thigh", "shank")),
    "load": (),
}
ANGLES_OF = {
    "back": ("trunk_flexion", "trunk_twist", "trunk_side_bend"),
    "arms": ("arm_rise",),
    "legs": ("knee_flexion", "foot_rise", "shank_tilt"),
    "load": (),
}


class OwasPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What OWAS asks and no posture shows, from `start` on; what is left out is not assessed."""

    load: Kilograms | None = None
    """Handled mass, or a force divided by 9.81 m/s² [kg]; 0 for none."""
    legs: method.Legs | None = None
    """How the legs are used; ``posture`` estimates it for somebody who stands or kneels."""

    @classmethod
    def read(cls, task: TaskPhase) -> Mapping[str, Any]:
        """Return the fields of the phase that this rule has words of its own for, by name."""
        return {"legs": next((code for code in method.Legs if code == task.legs), None)}


class Owas(PostureRule, frozen=True, kw_only=True):
    """OWAS action category of a person's posture."""

    action_category: Literal[1, 2, 3, 4] | None = None
    """Highest admissible action category."""
    phases: tuple[OwasPhase, ...] = ()
    """Phases of the task, each from its `start` on; without any, those of ``[[phases]]``."""
    thresholds: method.OwasThresholds = method.OwasThresholds()
    """Where a posture counts as bent, twisted and so on."""

    @property
    def limit(self) -> int | None:
        """Greatest admissible action category."""
        return self.action_category

    @property
    def levels(self) -> tuple[Level, ...]:
        """Action categories, the lowest first."""
        return tuple(Level(up_to=k, name=f"action category {k}") for k in range(1, 5))

    def entered(self, model: Model) -> tuple[OwasPhase, ...]:
        """Phases of the rule, or else those that every rule shares."""
        return shared_phases(model, self.human, self.phases, OwasPhase.from_task)

    def bind(self, model: Model) -> Evaluate:
        """Look up every name in the model once and return the function that judges one instant."""
        read = bind_posture(model, self.human, self.unmeasured)
        phases, unknown, error = self.entered(model), OwasPhase(), self.error()

        def evaluate(state: State) -> Result:
            angles = read(state)
            phase = phase_at(phases, state.t, unknown)
            measured = method.settled(self.codes(angles, phase), self.codes(angles, phase, ROUNDING))
            spread = None if error is None else self.codes(angles, phase, error)
            return self._result(angles, measured, spread)

        return evaluate

    def codes(self, angles: Angles, phase: OwasPhase, accuracy: Accuracy = 0.0) -> dict[str, method.Possible]:
        """Possible codes of postures in a phase, each of shape (..., number of codes)."""
        if phase.legs is None:
            legs = np.ones(7, bool)
        elif phase.legs == method.Legs.POSTURE:
            legs = method.leg_codes(angles, self.thresholds, accuracy)
        else:
            legs = method.only(list(method.Legs).index(phase.legs) + 1, 7)
        return {
            "back": method.back_codes(angles, self.thresholds, accuracy),
            "arms": method.arm_codes(angles, accuracy),
            "legs": legs,
            "load": method.load_codes(phase.load),
        }

    def _result(
        self,
        angles: Angles,
        measured: Mapping[str, method.Possible],
        spread: Mapping[str, method.Possible] | None,
    ) -> Result:
        span = method.category_span(**measured)
        reach = span if spread is None else method.category_span(**spread)
        low, high = int(reach.low), int(reach.high)
        missing = [key for key, possible in measured.items() if possible.sum() > 1]
        verdict = judge_interval((low, high), self.limit)
        if missing and judge(low, self.limit) is not Verdict.EXCEEDED:
            verdict = Verdict.UNDECIDED
        drivers = self._drivers(measured, span)
        value = int(span.high) if span.known else None
        reasons = []
        if missing:
            said = whatever_is_missing("category", low, high)
            reasons.append(f"not assessed: {', '.join(missing)}; {said}")
        elif verdict is Verdict.UNDECIDED:
            reasons.append(f"the accuracy leaves it open: the category lies between {low} and {high}")
        if drivers:
            reasons.append(", ".join(f"{key} {_text(measured[key])}" for key in drivers))
        if value is not None:
            reasons.append(f"action category {value:.0f}: {published('owas')['actions'][int(value) - 1]}")
        return Result(
            name=self.name,
            value=value,
            limit=self.limit,
            verdict=verdict,
            reason="; ".join(reasons),
            interval=None if spread is None and not missing else (low, high),
            parts=tuple(
                _part(key, measured[key], None if spread is None else spread[key]) for key in measured
            ),
            markers=tuple(
                Highlight(body=f"{self.human}/{bone}", verdict=verdict)
                for key in drivers
                for bone in BONES_OF[key]
            ),
            rows=(
                total_row(
                    "",
                    (int(span.low), int(span.high)),
                    None if spread is None else (low, high),
                    (1, 4),
                    self.limit,
                    verdict,
                ),
                *(
                    self._row(key, angles, measured[key], None if spread is None else spread[key])
                    for key in measured
                ),
            ),
        )

    def _row(
        self, key: str, angles: Angles, measured: method.Possible, spread: method.Possible | None
    ) -> Row:
        part, t = _part(key, measured, spread), self.thresholds
        edges = {
            "trunk_flexion": (-t.bent, t.bent),
            "trunk_twist": (-t.twisted, t.twisted),
            "trunk_side_bend": (-t.side_bent, t.side_bent),
            "arm_rise": (0.0,),
            "knee_flexion": (t.knee_bent,),
            "foot_rise": (t.foot_rise,),
            "shank_tilt": (t.kneeling,),
        }
        return Row(
            name=key,
            state=RowState.NOT_ASSESSED if part.value is None else RowState.JUDGED,
            value=part.value,
            scale=(1.0, float(method.CODES[key])),
            interval=part.interval,
            reason=part.reason,
            bones=tuple(f"{self.human}/{bone}" for bone in BONES_OF[key]),
            aspects=aspects(angles, ANGLES_OF[key], None, edges),
        )

    def _drivers(self, measured: Mapping[str, method.Possible], span: Span) -> list[str]:
        """Parts that alone, put back to upright, would lower the category most."""
        gains = {}
        for key, possible in measured.items():
            if possible.sum() == 1:
                instead = {**measured, key: method.only(NEUTRAL[key], method.CODES[key])}
                gains[key] = int(span.low - method.category_span(**instead).low)
        best = max(gains.values(), default=0)
        return [key for key, gain in gains.items() if gain == best] if best > 0 else []

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        return Basis(
            formula="action category of the code of back, arms, legs and load",
            source="Karhu et al. 1977, categories of Louhevaara and Suurnäkki 1992; each as at least three "
            "of five public implementations have it (2+), the papers were not read",
            inputs=(
                *provenance.motion(model, self.human),
                *entered(self.entered(model), OwasPhase()),
                *chosen(self.thresholds, method.OwasThresholds()),
                *posture_quality(self.accuracy, self.joint_accuracy, self.unmeasured),
                Input(
                    name="arm at or above shoulder level",
                    value="elbow or wrist at the height of the shoulder's joint or above",
                    origin=Origin.CHOICE,
                    source="a choice of seerob",
                ),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                "categories of the shares of time of single codes: the category is of one posture",
                *((ACCURACY_NOTE,) if self.error() is not None else ()),
            ),
        )


def _text(possible: method.Possible) -> str:
    return " or ".join(str(code) for code in np.flatnonzero(possible) + 1)


def _part(key: str, measured: method.Possible, spread: method.Possible | None) -> Result:
    codes = np.flatnonzero(measured) + 1
    wide = codes if spread is None else np.flatnonzero(spread) + 1
    known = len(codes) == 1
    return Result(
        name=key,
        value=float(codes[0]) if known else None,
        verdict=None if known else Verdict.UNDECIDED,
        reason="" if known else f"not assessed: {_text(measured)}",
        interval=None if spread is None and known else (float(wide[0]), float(wide[-1])),
    )
