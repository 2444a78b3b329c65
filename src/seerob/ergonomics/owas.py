"""OWAS on the twin: the posture code and its action category, every tick; Karhu et al. 1977."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from seerob import provenance
from seerob.criterion import Criterion, Evaluate, judge, judge_interval
from seerob.ergonomic_posture import bind_posture
from seerob.human.angles import Angles
from seerob.human.skeleton import SIDES
from seerob.model import Model
from seerob.scoring import owas as method
from seerob.scoring.basis import ACCURACY_NOTE, chosen, entered, posture_quality
from seerob.scoring.phases import Kilograms, Phase, check_order, phase_at
from seerob.scoring.published import published
from seerob.scoring.spans import Span
from seerob.snapshot import Basis, Highlight, Input, Origin, Result, Verdict
from seerob.state import State

NEUTRAL = {"back": 1, "arms": 1, "legs": 2, "load": 1}
"""The code of somebody who stands upright with empty hands."""
BONES_OF = {
    "back": ("lumbar", "thorax"),
    "arms": tuple(f"{side}_upper_arm" for side in SIDES),
    "legs": tuple(f"{side}_{bone}" for side in SIDES for bone in ("thigh", "shank")),
    "load": (),
}


class OwasPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What OWAS asks and no posture shows, from `start` on; what is left out is not assessed."""

    load: Kilograms | None = None
    """Handled mass, or a force divided by 9.81 m/s² [kg]; 0 for none."""
    legs: method.Legs | None = None
    """How the legs are used; ``posture`` estimates it for somebody who stands or kneels."""


class Owas(Criterion, frozen=True, kw_only=True):
    """OWAS action category of a person's posture."""

    human: str
    """Who is judged."""
    action_category: Literal[1, 2, 3, 4] | None = None
    """Highest admissible action category."""
    phases: tuple[OwasPhase, ...] = ()
    """Phases of the task, each from its `start` on."""
    thresholds: method.OwasThresholds = method.OwasThresholds()
    """Where a posture counts as bent, twisted and so on."""
    accuracy: Annotated[float, Meta(ge=0, lt=np.pi / 2, extra={"unit": "rad"})] | None = None
    """How far each angle of the posture may be off [rad]; the verdict then is of the whole interval."""
    unmeasured: tuple[str, ...] = ()
    """Bones that the source does not measure, such as ``"right_shank"``: what needs them is not assessed."""

    def __post_init__(self) -> None:
        check_order(self.phases)

    @property
    def limit(self) -> int | None:
        """Greatest admissible action category."""
        return self.action_category

    def subjects(self) -> tuple[str, ...]:
        """The person."""
        return (self.human,)

    def bind(self, model: Model) -> Evaluate:
        """See `Criterion.bind`."""
        read = bind_posture(model, self.human, self.unmeasured)

        def evaluate(state: State) -> Result:
            angles = read(state)
            phase = phase_at(self.phases, state.t, OwasPhase())
            measured = self.codes(angles, phase)
            spread = None if self.accuracy is None else self.codes(angles, phase, self.accuracy)
            return self._result(measured, spread)

        return evaluate

    def codes(self, angles: Angles, phase: OwasPhase, accuracy: float = 0.0) -> dict[str, method.Possible]:
        """Possible codes of postures in a phase, each of shape (..., number of codes)."""
        if phase.legs is None:
            legs = np.ones(7, bool)
        elif phase.legs is method.Legs.POSTURE:
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
        self, measured: Mapping[str, method.Possible], spread: Mapping[str, method.Possible] | None
    ) -> Result:
        span = method.category_span(**measured)
        reach = span if spread is None else method.category_span(**spread)
        low, high = int(reach.low), int(reach.high)
        missing = [key for key, possible in measured.items() if possible.sum() > 1]
        verdict = judge_interval((low, high), self.limit)
        if missing and judge(low, self.limit) is not Verdict.EXCEEDED:
            verdict = Verdict.UNDECIDED
        drivers = self._drivers(measured, span)
        value = float(span.high) if span.known else None
        reasons = []
        if missing:
            reasons.append(f"not assessed: {', '.join(missing)}; the category lies between {low} and {high}")
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
            interval=None if spread is None and not missing else (float(low), float(high)),
            parts=tuple(
                _part(key, measured[key], None if spread is None else spread[key]) for key in measured
            ),
            markers=tuple(
                Highlight(body=f"{self.human}/{bone}", verdict=verdict)
                for key in drivers
                for bone in BONES_OF[key]
            ),
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
        """See `Criterion.basis`."""
        return Basis(
            formula="action category of the code of back, arms, legs and load",
            source="Karhu et al. 1977, categories of Louhevaara and Suurnäkki 1992; backs 3 and 4 from two "
            "public sources that agree (2+), backs 1 and 2 from one and from memory (1 + M)",
            inputs=(
                *provenance.motion(model, self.human),
                *entered(self.phases, OwasPhase()),
                *chosen(self.thresholds, method.OwasThresholds()),
                *posture_quality(self.accuracy, self.unmeasured),
                Input(
                    name="arm at or above shoulder level",
                    value="elbow or wrist at the height of the shoulder's joint or above",
                    origin=Origin.CHOICE,
                    source="a choice of seerob",
                ),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                "shares of time: the category is of one posture",
                *((ACCURACY_NOTE,) if self.accuracy is not None else ()),
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
