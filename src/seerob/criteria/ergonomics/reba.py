"""REBA: its scores as pure functions, and the rule on the twin, every tick, both sides, each component.

Hignett and McAtamney 2000, Applied Ergonomics 31.
An edge of a band belongs to the stricter side (`seerob.criteria.scoring.spans`), although the wording
``>60°`` gives it to the other one. Group A is trunk, neck and legs here, group B the arms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.domains import number, whole
from seerob.core.snapshot import Basis
from seerob.core.transforms import Array
from seerob.criteria.scoring.handled import NOTE, NOTHING, Handled, load_range
from seerob.criteria.scoring.held_work import WorkMonitor, activity
from seerob.criteria.scoring.judgement import Method
from seerob.criteria.scoring.measured import Accuracy, ArmPolicy, Measured, arm_score, one_foot_up
from seerob.criteria.scoring.phases import Kilograms, Phase, Sides, Stance, TaskPhase, on_sides
from seerob.criteria.scoring.rule import ScoredPosture
from seerob.criteria.scoring.score_rows import Edges, degrees, modifier_edges
from seerob.criteria.scoring.spans import (
    Ints,
    Span,
    Thresholds,
    answer,
    between,
    cells,
    either,
    exactly,
    fallen,
    graded,
    published,
    reached,
)
from seerob.description.humans.angles import Angles
from seerob.model.model import Model

_RAD = np.pi / 180
LEAST = {
    "neck": 1,
    "trunk": 1,
    "legs": 1,
    "upper arm": 1,
    "lower arm": 1,
    "wrist": 1,
    "load": 0,
    "coupling": 0,
    "activity": 0,
}
"""Components in the order of `reba`, and their least score."""
MOST = {
    "neck": 3,
    "trunk": 5,
    "legs": 4,
    "upper arm": 6,
    "lower arm": 2,
    "wrist": 3,
    "load": 3,
    "coupling": 3,
    "activity": 3,
}
"""Their greatest score."""


class Coupling(StrEnum):
    """How well the load can be held."""

    GOOD = "good"
    """Well-fitting handle, mid-range power grip."""
    FAIR = "fair"
    """Acceptable, not ideal, or by another part of the body."""
    POOR = "poor"
    """Not acceptable, although possible."""
    UNACCEPTABLE = "unacceptable"
    """Awkward, no handle."""


class RebaScores(NamedTuple):
    """Scores of REBA, shape (...)."""

    table_A: Ints
    table_B: Ints
    A: Ints
    """Trunk, neck, legs with the load."""
    B: Ints
    """Arms with the coupling."""
    C: Ints
    final: Ints
    """C with the activity, 1 to 15."""


def reba(
    neck: ArrayLike,
    trunk: ArrayLike,
    legs: ArrayLike,
    upper_arm: ArrayLike,
    lower_arm: ArrayLike,
    wrist: ArrayLike,
    load: ArrayLike = 0,
    coupling: ArrayLike = 0,
    activity: ArrayLike = 0,
) -> RebaScores:
    """Score of component scores, tables A, B and C of the method.

    Args:
        neck: 1 to 3, shape (...); all others broadcast with it.
        trunk: 1 to 5.
        legs: 1 to 4.
        upper_arm: 1 to 6.
        lower_arm: 1 or 2.
        wrist: 1 to 3.
        load: 0 to 3, added to A.
        coupling: 0 to 3, added to B.
        activity: 0 to 3, added at the end.

    Raises:
        ValueError: A score that the method does not have.
    """
    given = (neck, trunk, legs, upper_arm, lower_arm, wrist, load, coupling, activity)
    head, back, feet, upper, lower, hand, weight, grip, active = (
        whole(name, score, LEAST[name], MOST[name]) for name, score in zip(LEAST, given, strict=True)
    )
    table_A = cells("reba", "A")[head - 1, back - 1, feet - 1]
    table_B = cells("reba", "B")[upper - 1, lower - 1, hand - 1]
    A, B = table_A + weight, table_B + grip
    C = cells("reba", "C")[np.minimum(A, 12) - 1, np.minimum(B, 12) - 1]
    return RebaScores(table_A, table_B, A, B, C, C + active)


def trunk(flexion: Array, upright: float) -> Ints:
    """1 to 4 of the flexion [rad], without modifiers."""
    bent = reached(np.abs(flexion), 20 * _RAD)
    upset = reached(np.abs(flexion), upright) | bent
    return 1 + upset.astype(np.int64) + bent + reached(flexion, 60 * _RAD)


def neck(flexion: Array, extension_from: float) -> Ints:
    """1 or 2 of the flexion [rad], without modifiers."""
    return 1 + (fallen(flexion, -extension_from) | reached(flexion, 20 * _RAD)).astype(np.int64)


def knees(flexion: Array) -> Ints:
    """What bent knees add to the legs, 0 to 2, of the flexion [rad]."""
    return reached(flexion, 30 * _RAD).astype(np.int64) + reached(flexion, 60 * _RAD)


def upper_arm(flexion: Array) -> Ints:
    """1 to 4 of the flexion [rad], without modifiers."""
    away = reached(np.abs(flexion), 20 * _RAD)
    return 1 + away.astype(np.int64) + reached(flexion, 45 * _RAD) + reached(flexion, 90 * _RAD)


def lower_arm(flexion: Array) -> Ints:
    """1 or 2 of the elbow's flexion [rad]."""
    return 1 + (fallen(flexion, 60 * _RAD) | reached(flexion, 100 * _RAD)).astype(np.int64)


def wrist(flexion: Array) -> Ints:
    """1 or 2 of flexion or extension [rad], without modifiers."""
    return 1 + reached(np.abs(flexion), 15 * _RAD).astype(np.int64)


def load(kg: float | None, shock: bool | None, least: float = 0.0) -> Span:
    """Score of a load [kg], one more for shock or rapid build-up.

    What is not given may be anything, a load from ``least`` on.
    """
    if kg is not None:
        number("load", kg, 0, unit="kg")
    weight = between((least >= 5) + (least > 10), 2) if kg is None else exactly((kg >= 5) + (kg > 10))
    sudden = between(0, 1) if shock is None else exactly(int(shock))
    return weight + sudden


def coupling(grip: Coupling | None) -> Span:
    """Score of the grip."""
    return between(0, 3) if grip is None else exactly(list(Coupling).index(Coupling(grip)))


def edges(thresholds: Thresholds) -> Edges:
    """Bands of REBA's angles."""
    t = thresholds
    return {
        **modifier_edges(t),
        "shoulder_flexion": degrees(-20, 20, 45, 90),
        "elbow_flexion": degrees(60, 100),
        "wrist_flexion": degrees(-15, 15),
        "neck_flexion": (-t.neck_extension, *degrees(20)),
        "trunk_flexion": (*degrees(-20), -t.trunk_upright, t.trunk_upright, *degrees(20, 60)),
        "knee_flexion": degrees(30, 60),
    }


def posture_components(
    angles: Angles,
    *,
    thresholds: Thresholds,
    supported: Span,
    legs: Span,
    sitting: bool | None,
    accuracy: Accuracy = 0.0,
    policy: ArmPolicy = ArmPolicy.PROJECTION,
) -> dict[str, Span]:
    """Scores of the six parts of the body.

    Args:
        angles: Of the postures.
        thresholds: Of the modifiers.
        supported: 1 where an arm is supported, helped by gravity, or the person leans, shape (2,).
        legs: 1 or 2 by how the weight is borne.
        sitting: Bent knees add nothing to a person who sits; None when nobody said.
        accuracy: Of each angle [rad].
        policy: Which angle stands for the flexion of the upper arm.

    Returns:
        Span by component: arms with shape (..., 2), right and left; neck, trunk and legs with shape (...).
    """
    t, m = thresholds, Measured(angles, accuracy)
    relief = Span(-supported.high, -supported.low)
    bent = graded(angles.knee_flexion.max(axis=-1), knees, within=(0, 2), accuracy=m.error("knee_flexion"))
    if sitting is not False:
        bent = Span(np.zeros_like(bent.low), np.zeros_like(bent.high) if sitting else bent.high)
    return {
        "neck": m.graded("neck_flexion", lambda x: neck(x, t.neck_extension), within=(1, 2))
        + either(m.beyond("neck_twist", t.neck_twist), m.beyond("neck_side_bend", t.neck_side_bend)),
        "trunk": m.graded("trunk_flexion", lambda x: trunk(x, t.trunk_upright), within=(1, 4))
        + either(m.beyond("trunk_twist", t.trunk_twist), m.beyond("trunk_side_bend", t.trunk_side_bend)),
        "legs": legs + bent,
        "upper arm": (
            arm_score(m, upper_arm, policy)
            + either(
                m.beyond("shoulder_abduction", t.arm_abducted, signed=True),
                m.beyond("shoulder_rotation", t.arm_rotated),
            )
            + m.beyond("clavicle_elevation", t.shoulder_raised, signed=True)
            + relief
        ).at_least(1),
        "lower arm": m.graded("elbow_flexion", lower_arm, within=(1, 2), neutral=80 * _RAD),
        "wrist": m.graded("wrist_flexion", wrist, within=(1, 2))
        + either(
            m.beyond("wrist_deviation", t.wrist_deviation),
            m.beyond("forearm_rotation", t.forearm_rotation),
        ),
    }


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
    coupling: Coupling | None = None
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
            "coupling": None if task.coupling is None else Coupling(task.coupling),
            "legs": _STANCES.get(task.legs),
        }


def _final(scores: Mapping[str, Ints]) -> Ints:
    return reba(*(scores[key] for key in LEAST)).final


_TABLE = published("reba")
METHOD = Method(
    grand=_final,
    least=LEAST,
    most=MOST,
    edges=edges,
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
        self,
        angles: Angles,
        phase: Phase,
        accuracy: Accuracy = 0.0,
        watch: WorkMonitor | None = None,
        handled: Handled = NOTHING,
    ) -> dict[str, Span]:
        """Score the components of postures in a phase: shapes (..., 2) of sided, (...) of central ones."""
        assert isinstance(phase, RebaPhase)
        bearing = (
            exactly(1) + one_foot_up(Measured(angles, accuracy), self.thresholds)
            if phase.legs == "posture"
            else _BEARING[phase.legs]
        )
        found = posture_components(
            angles,
            thresholds=self.thresholds,
            supported=on_sides(phase.supported_arms),
            legs=bearing,
            sitting=None if phase.legs is None else phase.legs == "sitting",
            accuracy=accuracy,
            policy=self.arm,
        )
        least, most = load_range(phase.load, handled)
        empty = most == 0
        grip = Coupling.GOOD if empty and phase.coupling is None else phase.coupling
        static, repeated = answer(phase.static), answer(phase.repeated)
        if watch is not None:
            seen = activity(watch, walking=phase.legs == "walking")
            static = seen[0] if phase.static is None else static
            repeated = seen[1] if phase.repeated is None else repeated
        return {
            **found,
            "load": load(
                None if most == math.inf else most,
                False if empty and phase.shock is None else phase.shock,
                least,
            ),
            "coupling": coupling(grip),
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
                NOTE,
            ),
        )
