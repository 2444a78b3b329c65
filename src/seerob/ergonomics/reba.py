"""REBA on the twin: every tick, both sides, each component; Hignett and McAtamney 2000."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from seerob import provenance
from seerob.criterion import Criterion, Evaluate
from seerob.ergonomic_posture import bind_posture
from seerob.human.angles import Angles
from seerob.model import Model
from seerob.scoring import reba as method
from seerob.scoring.basis import ACCURACY_NOTE, PROJECTION_NOTE, choices, entered
from seerob.scoring.judgement import Method, judged
from seerob.scoring.phases import Kilograms, Phase, Sides, check_order, on_sides, phase_at
from seerob.scoring.published import Ints, published
from seerob.scoring.rula import one_foot_up
from seerob.scoring.shoulder import ArmPolicy
from seerob.scoring.spans import Span, answer, between, exactly
from seerob.scoring.thresholds import Thresholds
from seerob.snapshot import Basis, Result
from seerob.state import State


class RebaPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What REBA asks and no posture shows, from `start` on; what is left out is not assessed."""

    load: Kilograms | None = None
    """Handled mass, or a force divided by 9.81 m/s² [kg]; 0 for none."""
    shock: bool | None = None
    """The load comes as a shock or builds up rapidly; not needed for a load of 0."""
    coupling: method.Coupling | None = None
    """How well the load can be held; not needed for a load of 0."""
    supported_arms: Sides | None = None
    """Arms that are supported, helped by gravity, or on which the person leans."""
    legs: Literal["bilateral", "unilateral", "sitting", "posture"] | None = None
    """Weight on both legs (or walking), on one or unstable, sitting; ``posture``: standing, from the feet."""
    static: bool | None = None
    """One or more parts of the body held longer than 1 min."""
    repeated: bool | None = None
    """Small movements repeated more than 4 times per minute, walking apart."""
    rapid: bool | None = None
    """Rapid large changes of posture, or an unstable base."""


def _final(scores: Mapping[str, Ints]) -> Ints:
    return method.reba(*(scores[key] for key in method.LEAST)).final


_TABLE = published("reba")
METHOD = Method(
    grand=_final, least=method.LEAST, levels=_TABLE["levels"], actions=_TABLE["actions"], first_level=0
)


class Reba(Criterion, frozen=True, kw_only=True):
    """REBA score of a person, the worse of both sides."""

    human: str
    """Who is judged."""
    action_level: Literal[0, 1, 2, 3, 4] | None = None
    """Highest admissible action level; the limit is its highest score: 1, 3, 7, 10, 15."""
    phases: tuple[RebaPhase, ...] = ()
    """Phases of the task, each from its `start` on."""
    thresholds: Thresholds = Thresholds()
    """Where a posture counts as twisted, raised, upright and so on."""
    arm: ArmPolicy = ArmPolicy.PROJECTION
    """Which angle stands for the flexion of an upper arm."""
    accuracy: Annotated[float, Meta(ge=0, lt=np.pi / 2, extra={"unit": "rad"})] | None = None
    """How far each angle of the posture may be off [rad]; the verdict then is of the whole interval."""
    unmeasured: tuple[str, ...] = ()
    """Bones that the source does not measure, such as ``"right_hand"``: what needs them is not assessed."""

    def __post_init__(self) -> None:
        check_order(self.phases)

    @property
    def limit(self) -> int | None:
        """Greatest admissible score."""
        return None if self.action_level is None else METHOD.levels[self.action_level]

    def subjects(self) -> tuple[str, ...]:
        """The person."""
        return (self.human,)

    def bind(self, model: Model) -> Evaluate:
        """See `Criterion.bind`."""
        read = bind_posture(model, self.human, self.unmeasured)

        def evaluate(state: State) -> Result:
            angles = read(state)
            phase = phase_at(self.phases, state.t, RebaPhase())
            return judged(
                METHOD,
                name=self.name,
                human=self.human,
                limit=self.limit,
                angles=angles,
                components=self.components(angles, phase),
                spread=None if self.accuracy is None else self.components(angles, phase, self.accuracy),
            )

        return evaluate

    def components(self, angles: Angles, phase: RebaPhase, accuracy: float = 0.0) -> dict[str, Span]:
        """Component scores of postures in a phase, in the order of `method.LEAST`.

        Args:
            angles: Of the postures.
            phase: What was entered.
            accuracy: Of each angle [rad].

        Returns:
            Shapes (..., 2) of sided components and (...) of central ones.
        """
        legs = {"bilateral": exactly(1), "sitting": exactly(1), "unilateral": exactly(2), None: between(1, 2)}
        bearing = (
            exactly(1) + one_foot_up(angles, self.thresholds, accuracy)
            if phase.legs == "posture"
            else legs[phase.legs]
        )
        found = method.posture_components(
            angles,
            thresholds=self.thresholds,
            supported=on_sides(phase.supported_arms),
            legs=bearing,
            sitting=None if phase.legs is None else phase.legs == "sitting",
            accuracy=accuracy,
            policy=self.arm,
        )
        empty = phase.load == 0
        grip = method.Coupling.GOOD if empty and phase.coupling is None else phase.coupling
        return {
            **found,
            "load": method.load(phase.load, False if empty and phase.shock is None else phase.shock),
            "coupling": method.coupling(grip),
            "activity": answer(phase.static) + answer(phase.repeated) + answer(phase.rapid),
        }

    def basis(self, model: Model) -> Basis:
        """See `Criterion.basis`."""
        return Basis(
            formula="REBA: tables A, B and C of the components' scores, and the activity; the worse side",
            source="Hignett and McAtamney 2000, Applied Ergonomics 31; tables from five public sources that "
            "agree (2+)",
            inputs=(
                *provenance.motion(model, self.human),
                *entered(self.phases, RebaPhase()),
                *choices(self.thresholds, self.arm, self.accuracy, self.unmeasured),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                "static, repeated and rapid activity are entered, not detected",
                "the coupling of both hands is the same",
                PROJECTION_NOTE,
                *((ACCURACY_NOTE,) if self.accuracy is not None else ()),
            ),
        )
