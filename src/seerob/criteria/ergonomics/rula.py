"""RULA on the twin: every tick, both sides, each component; McAtamney and Corlett 1993."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from seerob.core.snapshot import Basis, Input, Origin
from seerob.criteria.postures.rule import ScoredPosture
from seerob.criteria.scoring import rula as method
from seerob.criteria.scoring.bands import rula_edges
from seerob.criteria.scoring.held_work import Watch, muscle_use
from seerob.criteria.scoring.judgement import Method
from seerob.criteria.scoring.measured import Accuracy
from seerob.criteria.scoring.phases import Kilograms, Phase, Sides, TaskPhase, on_sides
from seerob.criteria.scoring.published import Ints, published
from seerob.criteria.scoring.spans import Span, answer, between, exactly
from seerob.description.humans.angles import Angles
from seerob.model.model import Model


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
    """Posture of neck, trunk and legs mainly static, or repeated 4 times per minute or more."""
    supported_arms: Sides | None = None
    """Arms whose weight is supported, or on which the person leans."""
    back_supported: bool | None = None
    """Seated, the back well supported, hip at 90° or more."""
    legs: Literal["balanced", "unbalanced", "posture"] | None = None
    """Legs and feet well supported and evenly loaded, or not; ``posture`` estimates it."""

    @classmethod
    def read(cls, task: TaskPhase) -> Mapping[str, Any]:
        """Return the fields of the phase that this rule has words of its own for, by name."""
        legs = "posture" if task.legs == "posture" else None
        if task.balanced is not None:
            legs = "balanced" if task.balanced else "unbalanced"
        elif task.legs in ("one_leg", "one_knee_bent"):
            legs = "unbalanced"
        return {
            "load_use": None if task.load_use is None else method.LoadUse(task.load_use),
            # RULA's row is of somebody who sits; a trunk that leans while standing has none.
            "back_supported": task.back_supported if task.legs in ("sitting", None) else False,
            "legs": legs,
        }


def _grand(scores: Mapping[str, Ints]) -> Ints:
    return method.rula(*(scores[key] for key in method.LEAST)).grand


_TABLE = published("rula")
METHOD = Method(
    grand=_grand,
    least=method.LEAST,
    most=method.MOST,
    edges=rula_edges,
    levels=_TABLE["levels"],
    actions=_TABLE["actions"],
    first_level=1,
)
_LEGS: Mapping[str | None, Span | None] = {
    "balanced": exactly(1),
    "unbalanced": exactly(2),
    "posture": None,
    None: between(1, 2),
}


class Rula(ScoredPosture, frozen=True, kw_only=True):
    """RULA grand score of a person, the worse of both sides."""

    METHOD: ClassVar[Method] = METHOD
    PHASE: ClassVar[type[RulaPhase]] = RulaPhase
    REPEATED: ClassVar[int] = 4
    """The paper says more than 4, the worksheets 4."""

    profile: method.Profile = method.Profile.ORIGINAL_1993
    """Publication that decides where they differ: the force score above 10 kg, and how long is static."""
    action_level: Literal[1, 2, 3, 4] | None = None
    """Highest admissible action level; the limit is its highest score: 2, 4, 6, 7."""
    phases: tuple[RulaPhase, ...] = ()
    """Phases of the task, each from its `start` on; without any, those of ``[[phases]]``."""

    @property
    def static(self) -> float:
        """A posture that is held for this long counts as static [s]."""
        return method.Profile(self.profile).static

    def components(
        self, angles: Angles, phase: Phase, accuracy: Accuracy = 0.0, watch: Watch | None = None
    ) -> dict[str, Span]:
        """Score the components of postures in a phase: shapes (..., 2) of sided, (...) of central ones."""
        assert isinstance(phase, RulaPhase)
        found = method.posture_components(
            angles,
            thresholds=self.thresholds,
            supported=on_sides(phase.supported_arms),
            back_supported=phase.back_supported,
            legs=_LEGS[phase.legs],
            accuracy=accuracy,
            policy=self.arm,
        )
        use = method.LoadUse.INTERMITTENT if phase.load == 0 and phase.load_use is None else phase.load_use
        force = method.force(phase.load, use, self.profile)
        carries = on_sides(phase.hand)
        arms, body = answer(phase.muscle_arms), answer(phase.muscle_body)
        if watch is not None:
            seen = muscle_use(watch)
            arms = seen[0] if phase.muscle_arms is None else arms
            body = seen[1] if phase.muscle_body is None else body
        return {
            **found,
            "muscle use of the arms": arms,
            "force of the arms": Span(force.low * carries.low, force.high * carries.high),
            "muscle use of the body": body,
            "force of the body": force,
        }

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        usual = self.profile == method.Profile.ORIGINAL_1993
        return self.based(
            model,
            formula="RULA tables A, B and C of the components' scores; the worse side counts",
            source="McAtamney and Corlett 1993, Applied Ergonomics 24(2); tables from six or more public "
            "sources that agree (2+), the paper's table images were not seen",
            options=(
                Input(
                    name="profile",
                    value=method.Profile(self.profile).value,
                    origin=Origin.CHOICE if usual else Origin.GIVEN,
                    source="option profile, original1993 when not given",
                ),
            ),
            not_modelled=(
                "fingers, vibration, duration of the task: RULA does not ask",
                *(
                    (
                        "static and repeated postures are entered, not detected "
                        f"(static in this profile: longer than {self.static:g} s)",
                    )
                    if self.detect is None
                    else ()
                ),
                "less than 2 kg, static or repeated, has no row in the method and counts as force 0",
                "an extended trunk has no row in the method and counts as 2",
            ),
        )
