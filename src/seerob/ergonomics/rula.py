"""RULA on the twin: every tick, both sides, each component; McAtamney and Corlett 1993."""

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
from seerob.scoring import rula as method
from seerob.scoring.basis import ACCURACY_NOTE, PROJECTION_NOTE, choices, entered
from seerob.scoring.judgement import Method, judged
from seerob.scoring.phases import Kilograms, Phase, Sides, check_order, on_sides, phase_at
from seerob.scoring.published import Ints, published
from seerob.scoring.shoulder import ArmPolicy
from seerob.scoring.spans import Span, answer, between, exactly
from seerob.scoring.thresholds import Thresholds
from seerob.snapshot import Basis, Input, Origin, Result
from seerob.state import State


class RulaPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What RULA asks and no posture shows, from `start` on; what is left out is not assessed."""

    load: Kilograms | None = None
    """Handled mass, or a force divided by 9.81 m/s² [kg]; 0 for none."""
    load_use: method.LoadUse | None = None
    """How the load acts; not needed for a load of 0."""
    hand: Literal["left", "right", "both"] = "both"
    """Which arm carries the load; the trunk always does."""
    muscle_arms: bool | None = None
    """Posture of the arms mainly static, or repeated 4 times per minute or more."""
    muscle_body: bool | None = None
    """The same of neck, trunk and legs."""
    supported_arms: Sides | None = None
    """Arms whose weight is supported, or on which the person leans."""
    back_supported: bool | None = None
    """Seated, the back well supported, hip at 90° or more."""
    legs: Literal["balanced", "unbalanced", "posture"] | None = None
    """Legs and feet well supported and evenly loaded, or not; ``posture`` estimates it."""


def _grand(scores: Mapping[str, Ints]) -> Ints:
    return method.rula(*(scores[key] for key in method.LEAST)).grand


_TABLE = published("rula")
METHOD = Method(
    grand=_grand, least=method.LEAST, levels=_TABLE["levels"], actions=_TABLE["actions"], first_level=1
)


class Rula(Criterion, frozen=True, kw_only=True):
    """RULA grand score of a person, the worse of both sides."""

    human: str
    """Who is judged."""
    profile: method.Profile = method.Profile.ORIGINAL_1993
    """Publication that decides where they differ: the force score above 10 kg, and how long is static."""
    action_level: Literal[1, 2, 3, 4] | None = None
    """Highest admissible action level; the limit is its highest score: 2, 4, 6, 7."""
    phases: tuple[RulaPhase, ...] = ()
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
        """Greatest admissible grand score."""
        return None if self.action_level is None else METHOD.levels[self.action_level - 1]

    def subjects(self) -> tuple[str, ...]:
        """The person."""
        return (self.human,)

    def bind(self, model: Model) -> Evaluate:
        """See `Criterion.bind`."""
        read = bind_posture(model, self.human, self.unmeasured)

        def evaluate(state: State) -> Result:
            angles = read(state)
            phase = phase_at(self.phases, state.t, RulaPhase())
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

    def components(self, angles: Angles, phase: RulaPhase, accuracy: float = 0.0) -> dict[str, Span]:
        """Component scores of postures in a phase, in the order of `method.LEAST`.

        Args:
            angles: Of the postures.
            phase: What was entered.
            accuracy: Of each angle [rad].

        Returns:
            Shapes (..., 2) of sided components and (...) of central ones.
        """
        legs = {"balanced": exactly(1), "unbalanced": exactly(2), "posture": None, None: between(1, 2)}
        found = method.posture_components(
            angles,
            thresholds=self.thresholds,
            supported=on_sides(phase.supported_arms),
            back_supported=phase.back_supported,
            legs=legs[phase.legs],
            accuracy=accuracy,
            policy=self.arm,
        )
        use = method.LoadUse.INTERMITTENT if phase.load == 0 and phase.load_use is None else phase.load_use
        force = method.force(phase.load, use, self.profile)
        carries = on_sides(phase.hand)
        return {
            **found,
            "muscle use of the arms": answer(phase.muscle_arms),
            "force of the arms": Span(force.low * carries.low, force.high * carries.high),
            "muscle use of the body": answer(phase.muscle_body),
            "force of the body": force,
        }

    def basis(self, model: Model) -> Basis:
        """See `Criterion.basis`."""
        usual = self.profile is method.Profile.ORIGINAL_1993
        return Basis(
            formula="RULA tables A, B and C of the components' scores; the worse side counts",
            source="McAtamney and Corlett 1993, Applied Ergonomics 24(2); tables from six or more public "
            "sources that agree (2+), the paper's table images were not seen",
            inputs=(
                *provenance.motion(model, self.human),
                Input(
                    name="profile",
                    value=self.profile.value,
                    origin=Origin.CHOICE if usual else Origin.GIVEN,
                    source="option profile, original1993 when not given",
                ),
                *entered(self.phases, RulaPhase()),
                *choices(self.thresholds, self.arm, self.accuracy, self.unmeasured),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                "fingers, vibration, duration of the task: RULA does not ask",
                "static and repeated postures are entered, not detected "
                f"(static in this profile: longer than {self.profile.static:g} s)",
                "less than 2 kg, static or repeated, has no row in the method and counts as force 0",
                "an extended trunk has no row in the method and counts as 2",
                PROJECTION_NOTE,
                *((ACCURACY_NOTE,) if self.accuracy is not None else ()),
            ),
        )
