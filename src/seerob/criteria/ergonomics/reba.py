"""REBA on the twin: every tick, both sides, each component; Hignett and McAtamney 2000."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from seerob.core.snapshot import Basis
from seerob.criteria.postures.rule import ScoredPosture
from seerob.criteria.scoring import reba as method
from seerob.criteria.scoring.bands import reba_edges
from seerob.criteria.scoring.held_work import Watch, activity
from seerob.criteria.scoring.judgement import Method
from seerob.criteria.scoring.measured import Accuracy, Measured, one_foot_up
from seerob.criteria.scoring.phases import Kilograms, Phase, Sides, Stance, TaskPhase, on_sides
from seerob.criteria.scoring.published import Ints, published
from seerob.criteria.scoring.spans import Span, answer, between, exactly
from seerob.description.humans.angles import Angles
from seerob.model.model import Model

Bearing = Literal["bilateral", "walking", "unilateral", "sitting", "posture"]
_STANCES: Mapping[Stance | None, Bearing] = {
    "sitting": "sitting",
    "standing": "bilateral",
    "both_knees_bent": "bilateral",
    "walking": "walking",
    "one_leg": "unilateral",
    "one_knee_bent": "unilateral",
    "posture": "posture",
}
"""How the legs are used → how the weight is borne; kneeling, lying and climbing have no row in REBA."""


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
    legs: Bearing | None = None
    """Weight on both legs, walking, on one or unstable, sitting; ``posture``: standing, from the feet."""
    static: bool | None = None
    """One or more parts of the body held longer than 1 min."""
    repeated: bool | None = None
    """Small movements repeated more than 4 times per minute, walking apart."""
    rapid: bool | None = None
    """Rapid large changes of posture, or an unstable base."""

    @classmethod
    def read(cls, task: TaskPhase) -> Mapping[str, Any]:
        """Return the fields of the phase that this rule has words of its own for, by name."""
        return {
            "shock": None if task.load_use is None else task.load_use == "shock",
            "coupling": None if task.coupling is None else method.Coupling(task.coupling),
            "legs": _STANCES.get(task.legs),
        }


def _final(scores: Mapping[str, Ints]) -> Ints:
    return method.reba(*(scores[key] for key in method.LEAST)).final


_TABLE = published("reba")
METHOD = Method(
    grand=_final,
    least=method.LEAST,
    most=method.MOST,
    edges=reba_edges,
    levels=_TABLE["levels"],
    actions=_TABLE["actions"],
    first_level=0,
)
_BEARING: Mapping[str | None, Span] = {
    "bilateral": exactly(1),
    "walking": exactly(1),
    "sitting": exactly(1),
    "unilateral": exactly(2),
    None: between(1, 2),
}


class Reba(ScoredPosture, frozen=True, kw_only=True):
    """REBA score of a person, the worse of both sides."""

    METHOD: ClassVar[Method] = METHOD
    PHASE: ClassVar[type[RebaPhase]] = RebaPhase
    REPEATED: ClassVar[int] = 5
    """More than 4."""

    action_level: Literal[0, 1, 2, 3, 4] | None = None
    """Highest admissible action level; the limit is its highest score: 1, 3, 7, 10, 15."""
    phases: tuple[RebaPhase, ...] = ()
    """Phases of the task, each from its `start` on; without any, those of ``[[phases]]``."""

    @property
    def static(self) -> float:
        """A posture that is held for this long counts as static [s]."""
        return 60.0

    def components(
        self, angles: Angles, phase: Phase, accuracy: Accuracy = 0.0, watch: Watch | None = None
    ) -> dict[str, Span]:
        """Score the components of postures in a phase: shapes (..., 2) of sided, (...) of central ones."""
        assert isinstance(phase, RebaPhase)
        bearing = (
            exactly(1) + one_foot_up(Measured(angles, accuracy), self.thresholds)
            if phase.legs == "posture"
            else _BEARING[phase.legs]
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
        static, repeated = answer(phase.static), answer(phase.repeated)
        if watch is not None:
            seen = activity(watch, walking=phase.legs == "walking")
            static = seen[0] if phase.static is None else static
            repeated = seen[1] if phase.repeated is None else repeated
        return {
            **found,
            "load": method.load(phase.load, False if empty and phase.shock is None else phase.shock),
            "coupling": method.coupling(grip),
            "activity": static + repeated + answer(phase.rapid),
        }

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        return self.based(
            model,
            formula="REBA: tables A, B and C of the components' scores, and the activity; the worse side",
            source="Hignett and McAtamney 2000, Applied Ergonomics 31; tables from five public sources that "
            "agree (2+)",
            not_modelled=(
                "static, repeated and rapid activity are entered, not detected"
                if self.detect is None
                else "rapid large changes of posture are entered, not detected",
                "the coupling of both hands is the same",
            ),
        )
