"""REBA as pure functions: Hignett and McAtamney 2000, Applied Ergonomics 31.

An edge of a band belongs to the stricter side (`seerob.criteria.scoring.edges`), although the wording
``>60°`` gives it to the other one. Group A is trunk, neck and legs here, group B the arms.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.domains import number, whole
from seerob.core.transforms import Array
from seerob.criteria.scoring.edges import fallen, reached
from seerob.criteria.scoring.measured import Accuracy, Measured
from seerob.criteria.scoring.published import Ints, cells
from seerob.criteria.scoring.shoulder import ArmPolicy, arm_score
from seerob.criteria.scoring.spans import Span, between, either, exactly, graded
from seerob.criteria.scoring.thresholds import Thresholds
from seerob.description.humans.angles import Angles

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


def load(kg: float | None, shock: bool | None) -> Span:
    """Score of a load [kg], one more for shock or rapid build-up; what is not given may be anything."""
    if kg is not None:
        number("load", kg, 0, unit="kg")
    weight = between(0, 2) if kg is None else exactly((kg >= 5) + (kg > 10))
    sudden = between(0, 1) if shock is None else exactly(int(shock))
    return weight + sudden


def coupling(grip: Coupling | None) -> Span:
    """Score of the grip."""
    return between(0, 3) if grip is None else exactly(list(Coupling).index(Coupling(grip)))


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
