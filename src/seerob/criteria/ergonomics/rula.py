"""RULA: its scores as pure functions, and the rule on the twin, every tick, both sides, each component.

McAtamney and Corlett 1993, Applied Ergonomics 24(2).
An edge of a band belongs to the stricter side (`seerob.criteria.scoring.spans`), as the paper's wording fixes
for 15° of the wrist, 20° of the neck, 60° of the trunk and 90° of the upper arm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.domains import number, whole
from seerob.core.snapshot import Basis, Input, Origin
from seerob.core.transforms import Array
from seerob.criteria.scoring.handled import NOTE, NOTHING, Handled, holding, load_range
from seerob.criteria.scoring.held_work import WorkMonitor, muscle_use
from seerob.criteria.scoring.judgement import Method
from seerob.criteria.scoring.measured import Accuracy, ArmPolicy, Measured, arm_score, one_foot_up
from seerob.criteria.scoring.phases import Kilograms, Phase, Sides, TaskPhase, on_sides
from seerob.criteria.scoring.rule import ScoredPosture
from seerob.criteria.scoring.score_rows import Edges, degrees, modifier_edges
from seerob.criteria.scoring.spans import (
    Ints,
    Span,
    Thresholds,
    answer,
    between,
    beyond,
    cells,
    either,
    exactly,
    fallen,
    published,
    reached,
)
from seerob.description.humans.angles import Angles
from seerob.model.model import Model

_RAD = np.pi / 180
LEAST = {
    "upper arm": 1,
    "lower arm": 1,
    "wrist": 1,
    "wrist twist": 1,
    "neck": 1,
    "trunk": 1,
    "legs": 1,
    "muscle use of the arms": 0,
    "force of the arms": 0,
    "muscle use of the body": 0,
    "force of the body": 0,
}
"""Components in the order of `rula`, and their least score."""
MOST = {
    "upper arm": 6,
    "lower arm": 3,
    "wrist": 4,
    "wrist twist": 2,
    "neck": 6,
    "trunk": 6,
    "legs": 2,
    "muscle use of the arms": 1,
    "force of the arms": 3,
    "muscle use of the body": 1,
    "force of the body": 3,
}
"""Their greatest score."""


class Profile(StrEnum):
    """Which publication decides where they differ."""

    ORIGINAL_1993 = "original1993"
    """More than 10 kg, intermittent: 2. Static is longer than 60 s."""
    WORKSHEET = "worksheet"
    """More than 10 kg: 3. Static is longer than 600 s."""

    @property
    def static(self) -> float:
        """How long a posture is held to be static [s]."""
        return 60.0 if self is Profile.ORIGINAL_1993 else 600.0


class LoadUse(StrEnum):
    """How a load acts."""

    INTERMITTENT = "intermittent"
    STATIC = "static"
    REPEATED = "repeated"
    SHOCK = "shock"
    """Shock or rapid build-up."""


class RulaScores(NamedTuple):
    """Scores of RULA, shape (...)."""

    A: Ints
    """Posture of the arm and wrist."""
    B: Ints
    """Posture of neck, trunk and legs."""
    C: Ints
    """A with muscle use and force."""
    D: Ints
    """B with muscle use and force."""
    grand: Ints
    """1 to 7."""


def rula(
    upper_arm: ArrayLike,
    lower_arm: ArrayLike,
    wrist: ArrayLike,
    wrist_twist: ArrayLike,
    neck: ArrayLike,
    trunk: ArrayLike,
    legs: ArrayLike,
    muscle_arms: ArrayLike = 0,
    force_arms: ArrayLike = 0,
    muscle_body: ArrayLike = 0,
    force_body: ArrayLike = 0,
) -> RulaScores:
    """Grand score of component scores, tables A, B and C of the method.

    Args:
        upper_arm: 1 to 6, shape (...); all others broadcast with it.
        lower_arm: 1 to 3.
        wrist: 1 to 4.
        wrist_twist: 1 or 2.
        neck: 1 to 6.
        trunk: 1 to 6.
        legs: 1 or 2.
        muscle_arms: 0 or 1, added to A.
        force_arms: 0 to 3, added to A.
        muscle_body: 0 or 1, added to B.
        force_body: 0 to 3, added to B.

    Raises:
        ValueError: A score that the method does not have.
    """
    scores = (upper_arm, lower_arm, wrist, wrist_twist, neck, trunk, legs)
    added = (muscle_arms, force_arms, muscle_body, force_body)
    upper, lower, bent, turned, head, back, feet, held_arms, loaded_arms, held_body, loaded_body = (
        whole(name, score, LEAST[name], MOST[name])
        for name, score in zip(LEAST, (*scores, *added), strict=True)
    )
    A = cells("rula", "A")[upper - 1, lower - 1, 2 * (bent - 1) + turned - 1]
    B = cells("rula", "B")[head - 1, 2 * (back - 1) + feet - 1]
    C = A + held_arms + loaded_arms
    D = B + held_body + loaded_body
    return RulaScores(A, B, C, D, cells("rula", "C")[np.minimum(C, 8) - 1, np.minimum(D, 7) - 1])


def upper_arm(flexion: Array) -> Ints:
    """1 to 4 of the flexion [rad], without modifiers."""
    raised = sum(reached(flexion, edge * _RAD).astype(np.int64) for edge in (20, 45, 90))
    return np.asarray(np.minimum(1 + fallen(flexion, -20 * _RAD).astype(np.int64) + raised, 4))


def lower_arm(flexion: Array) -> Ints:
    """1 or 2 of the elbow's flexion [rad], without modifiers."""
    return 1 + (fallen(flexion, 60 * _RAD) | reached(flexion, 100 * _RAD)).astype(np.int64)


def neck(flexion: Array, extension_from: float) -> Ints:
    """1 to 4 of the flexion [rad], without modifiers."""
    bent = 1 + reached(flexion, 10 * _RAD).astype(np.int64) + reached(flexion, 20 * _RAD)
    return np.where(fallen(flexion, -extension_from), 4, bent)


def trunk(flexion: Array, upright: float) -> Ints:
    """1 to 4 of the flexion [rad], without modifiers; extension has no row and counts as 2."""
    bent = reached(np.abs(flexion), upright) | reached(flexion, 20 * _RAD)
    return 1 + bent.astype(np.int64) + reached(flexion, 20 * _RAD) + reached(flexion, 60 * _RAD)


def wrist(flexion: Array, neutral: float) -> Ints:
    """1 to 3 of flexion or extension [rad], without modifiers."""
    size = np.abs(flexion)
    far = reached(size, 15 * _RAD)
    return 1 + (reached(size, neutral) | far).astype(np.int64) + far


def force(load: float | None, use: LoadUse | None, profile: Profile, least: float = 0.0) -> Span:
    """Force score of a handled load [kg]; what is not given may be anything from ``least`` on.

    Less than 2 kg, static or repeated, has no row: it counts as 0, muscle use apart.
    """
    if load is not None:
        number("load", load, 0, unit="kg")
    uses = list(LoadUse) if use is None else [LoadUse(use)]
    heavy = 3 if Profile(profile) is Profile.WORKSHEET else 2
    loads = [least, math.inf] if load is None else [load]
    scores = []
    for each in uses:
        for kg in loads:
            band = 0 if kg < 2 else 1 if kg <= 10 else 2
            steady = (0, 2, 3)[band]
            brief = (0, 1, heavy)[band]
            scores.append(3 if each is LoadUse.SHOCK else brief if each is LoadUse.INTERMITTENT else steady)
    return between(min(scores), max(scores))


def edges(thresholds: Thresholds) -> Edges:
    """Bands of RULA's angles."""
    t = thresholds
    return {
        **modifier_edges(t),
        "shoulder_flexion": degrees(-20, 20, 45, 90),
        "elbow_flexion": degrees(60, 100),
        "wrist_flexion": (*degrees(-15), -t.wrist_neutral, t.wrist_neutral, *degrees(15)),
        "neck_flexion": (-t.neck_extension, *degrees(10, 20)),
        "trunk_flexion": (-t.trunk_upright, t.trunk_upright, *degrees(20, 60)),
    }


def posture_components(
    angles: Angles,
    *,
    thresholds: Thresholds,
    supported: Span,
    back_supported: bool | None,
    legs: Span | None,
    accuracy: Accuracy = 0.0,
    policy: ArmPolicy = ArmPolicy.PROJECTION,
) -> dict[str, Span]:
    """Scores of the seven parts of the body.

    Args:
        angles: Of the postures.
        thresholds: Of the modifiers.
        supported: 1 where an arm is supported or the person leans, shape (2,) for right and left.
        back_supported: Seated, back well supported, hip at 90° or more: trunk 1 unless bent forward.
        legs: Score of the legs; None to estimate it from the feet and knees.
        accuracy: Of each angle [rad].
        policy: Which angle stands for the flexion of the upper arm.

    Returns:
        Span by component: arms with shape (..., 2), right and left; neck, trunk and legs with shape (...).
    """
    t, m = thresholds, Measured(angles, accuracy)
    relief = Span(-supported.high, -supported.low)
    aside = either(
        m.beyond("wrist_across", t.wrist_across, signed=True),
        m.beyond("forearm_out", t.forearm_out, signed=True),
    )
    back = m.graded("trunk_flexion", lambda x: trunk(x, t.trunk_upright), within=(1, 4))
    if back_supported is not False:
        leaning = m.graded(
            "trunk_flexion", lambda x: trunk(np.maximum(x, 0.0), t.trunk_upright), within=(1, 4)
        )
        back = Span(leaning.low, leaning.high if back_supported else back.high)
    return {
        "upper arm": (
            arm_score(m, upper_arm, policy)
            + m.beyond("shoulder_abduction", t.arm_abducted, signed=True)
            + m.beyond("clavicle_elevation", t.shoulder_raised, signed=True)
            + relief
        ).at_least(1),
        "lower arm": m.graded("elbow_flexion", lower_arm, within=(1, 2), neutral=80 * _RAD) + aside,
        "wrist": m.graded("wrist_flexion", lambda x: wrist(x, t.wrist_neutral), within=(1, 3))
        + m.beyond("wrist_deviation", t.wrist_deviation),
        "wrist twist": exactly(1) + m.beyond("forearm_rotation", t.forearm_rotation),
        "neck": m.graded("neck_flexion", lambda x: neck(x, t.neck_extension), within=(1, 4))
        + m.beyond("neck_twist", t.neck_twist)
        + m.beyond("neck_side_bend", t.neck_side_bend),
        "trunk": back
        + m.beyond("trunk_twist", t.trunk_twist)
        + m.beyond("trunk_side_bend", t.trunk_side_bend),
        "legs": exactly(1) + uneven(m, t) if legs is None else legs,
    }


def uneven(measured: Measured, thresholds: Thresholds) -> Span:
    """1 where one foot is raised or the knees differ: an estimate of weight that is not evenly spread."""
    knees = measured.angles.knee_flexion
    apart = beyond(
        knees[..., 0] - knees[..., 1],
        thresholds.knee_difference,
        accuracy=2 * measured.error("knee_flexion"),
    )
    return either(apart, one_foot_up(measured, thresholds))


class RulaPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What RULA asks and no posture shows, from `start` on; what is left out is not assessed."""

    load: Kilograms | None = None
    """Handled mass, or a force divided by 9.81 m/s² [kg]; 0 for none."""
    load_use: LoadUse | None = None
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
            "load_use": None if task.load_use is None else LoadUse(task.load_use),
            # RULA's row is of somebody who sits; a trunk that leans while standing has none.
            "back_supported": task.back_supported if task.legs in ("sitting", None) else False,
            "legs": legs,
        }


def _grand(scores: Mapping[str, Ints]) -> Ints:
    return rula(*(scores[key] for key in LEAST)).grand


_TABLE = published("rula")
METHOD = Method(
    grand=_grand,
    least=LEAST,
    most=MOST,
    edges=edges,
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

    profile: Profile = Profile.ORIGINAL_1993
    """Publication that decides where they differ: the force score above 10 kg, and how long is static."""
    action_level: Literal[1, 2, 3, 4] | None = None
    """Highest admissible action level; the limit is its highest score: 2, 4, 6, 7."""
    phases: tuple[RulaPhase, ...] = ()
    """Phases of the task, each from its `start` on; without any, those of ``[[phases]]``."""

    @property
    def static(self) -> float:
        """A posture that is held for this long counts as static [s]."""
        return Profile(self.profile).static

    def components(
        self,
        angles: Angles,
        phase: Phase,
        accuracy: Accuracy = 0.0,
        watch: WorkMonitor | None = None,
        handled: Handled = NOTHING,
    ) -> dict[str, Span]:
        """Score the components of postures in a phase: shapes (..., 2) of sided, (...) of central ones."""
        assert isinstance(phase, RulaPhase)
        found = posture_components(
            angles,
            thresholds=self.thresholds,
            supported=on_sides(phase.supported_arms),
            back_supported=phase.back_supported,
            legs=_LEGS[phase.legs],
            accuracy=accuracy,
            policy=self.arm,
        )
        least, most = load_range(phase.load, handled)
        use = LoadUse.INTERMITTENT if most == 0 and phase.load_use is None else phase.load_use
        exerted = force(None if most == math.inf else most, use, self.profile, least)
        carries, holds = on_sides(phase.hand), holding(handled)
        arms, body = answer(phase.muscle_arms), answer(phase.muscle_body)
        if watch is not None:
            seen = muscle_use(watch)
            arms = seen[0] if phase.muscle_arms is None else arms
            body = seen[1] if phase.muscle_body is None else body
        return {
            **found,
            "muscle use of the arms": arms,
            "force of the arms": Span(
                exerted.low * np.maximum(carries.low, holds).astype(np.int64),
                exerted.high * np.maximum(carries.high, holds).astype(np.int64),
            ),
            "muscle use of the body": body,
            "force of the body": exerted,
        }

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        usual = self.profile == Profile.ORIGINAL_1993
        return self.based(
            model,
            formula="RULA tables A, B and C of the components' scores; the worse side counts",
            source="McAtamney and Corlett 1993, Applied Ergonomics 24(2); tables from six or more public "
            "sources that agree (2+), the paper's table images were not seen",
            options=(
                Input(
                    name="profile",
                    value=Profile(self.profile).value,
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
                NOTE,
            ),
        )
