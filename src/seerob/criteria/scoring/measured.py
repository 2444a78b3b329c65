"""Angles together with how far each of them may be off; scores of them as spans.

`ArmPolicy` says which angle stands for the flexion of the upper arm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum

import numpy as np
from msgspec import Struct
from msgspec.structs import asdict

from seerob.core.domains import number
from seerob.core.transforms import Array
from seerob.criteria.scoring.spans import ROUNDING, Angle, Ints, Span, Thresholds, any_of, beyond, graded
from seerob.description.humans.angles import Angles

Accuracy = float | Mapping[str, float]
"""How far angles may be off [rad]: one figure for all, or one per name of `Angles`; a name that is not there
is exact."""


class JointAccuracy(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How far the angles of single joints may be off, where that differs from the rest."""

    trunk: Angle | None = None
    """Flexion, bending and twist of the trunk [rad]."""
    neck: Angle | None = None
    """Flexion, bending and twist of the neck [rad]."""
    clavicle: Angle | None = None
    """Raised shoulder [rad]."""
    shoulder: Angle | None = None
    """Direction and rotation of the upper arm [rad]."""
    elbow: Angle | None = None
    """Flexion of the elbow, and direction of the forearm [rad]."""
    forearm: Angle | None = None
    """Pronation and supination [rad]."""
    wrist: Angle | None = None
    """Flexion and deviation of the wrist [rad]."""
    knee: Angle | None = None
    """Flexion of the knee, and tilt of the shank [rad]."""
    foot: Angle | None = None
    """One foot above the other, seen from the hip [rad]."""


ANGLES_OF: dict[str, tuple[str, ...]] = {
    "trunk": ("trunk_flexion", "trunk_side_bend", "trunk_twist"),
    "neck": ("neck_flexion", "neck_side_bend", "neck_twist"),
    "clavicle": ("clavicle_elevation",),
    "shoulder": ("shoulder_flexion", "shoulder_elevation", "shoulder_abduction", "shoulder_rotation"),
    "elbow": ("arm_rise", "elbow_flexion", "forearm_out", "wrist_across"),
    "forearm": ("forearm_rotation",),
    "wrist": ("wrist_flexion", "wrist_deviation"),
    "knee": ("knee_flexion", "shank_tilt"),
    "foot": ("foot_rise",),
}
"""Joint of `JointAccuracy` → its angles."""


def accuracy_of(all_angles: float | None, joints: JointAccuracy | None) -> Accuracy | None:
    """Accuracy of each angle [rad]; None when nobody gave one.

    Raises:
        ValueError: Only some joints have one.
    """
    single = {} if joints is None else {k: v for k, v in asdict(joints).items() if v is not None}
    if not single:
        return all_angles
    missing = [joint for joint in ANGLES_OF if joint not in single]
    if all_angles is None and missing:
        raise ValueError(
            f"joint_accuracy: nothing is said of {', '.join(missing)}; give accuracy for the rest"
        )
    return {
        name: single.get(joint, all_angles or 0.0) for joint, names in ANGLES_OF.items() for name in names
    }


LEVERS = {
    "trunk_flexion": ("trunk_side_bend", False),
    "neck_flexion": ("neck_side_bend", False),
    "wrist_flexion": ("wrist_deviation", False),
    "shoulder_rotation": ("shoulder_elevation", True),
}
"""Angle → the one that shortens its lever, to its cosine or to one more than that."""
SHORT = 0.01
"""A lever that is longer turns rounding by less than a hundredth of a degree."""


def error_of(accuracy: Accuracy, *names: str) -> float:
    """The largest accuracy of some angles [rad]."""
    if type(accuracy) is not float and isinstance(accuracy, Mapping):
        return max(accuracy.get(name, 0.0) for name in names)
    return float(accuracy)


class Measured:
    """Angles of postures, each known to its accuracy.

    Args:
        angles: Of the postures.
        accuracy: Of each angle [rad].
    """

    def __init__(self, angles: Angles, accuracy: Accuracy = 0.0) -> None:
        self.angles = angles
        self._accuracy = accuracy

    def error(self, *names: str) -> float:
        """The largest accuracy of some angles [rad]."""
        return error_of(self._accuracy, *names)

    def graded(
        self, name: str, score: Callable[[Array], Ints], *, within: tuple[int, int], neutral: float = 0.0
    ) -> Span:
        """`spans.graded` of an angle by its name."""
        return graded(
            getattr(self.angles, name),
            score,
            within=within,
            accuracy=self.error(name),
            neutral=neutral,
            rounding=self.rounding(name),
        )

    def rounding(self, name: str) -> Array | float:
        """How far rounding may turn an angle that is seen under a shortened lever [rad].

        Seen from the side, a trunk that is bent sideways by 90° points nowhere, and of an arm that points
        straight up no rotation about itself can be told.
        """
        if name not in LEVERS:
            return 0.0
        aside, whole = LEVERS[name]
        lever = np.cos(getattr(self.angles, aside)) + (1.0 if whole else 0.0)
        return turned(ROUNDING, lever) if np.count_nonzero(lever < SHORT) else 0.0

    def beyond(self, name: str, threshold: float, *, signed: bool = False) -> Span:
        """`spans.beyond` of an angle by its name."""
        return beyond(
            getattr(self.angles, name),
            threshold,
            accuracy=self.error(name),
            signed=signed,
            rounding=self.rounding(name),
        )


def turned(accuracy: float, lever: Array) -> Array | float:
    """How far an error turns a direction that is seen under a shortened lever [rad]."""
    number("accuracy", accuracy, 0.0, unit="rad")
    if not accuracy:
        return 0.0
    sine = np.minimum(np.sin(min(accuracy, np.pi / 2)) / np.maximum(np.abs(lever), 1e-12), 1.0)
    return np.where(np.isnan(sine) | (sine < 1.0), np.arcsin(sine), np.pi)


def one_foot_up(measured: Measured, thresholds: Thresholds) -> Span:
    """1 where one foot is raised: an estimate of standing on one leg."""
    # Not fmax: what is not assessed on one side is not known of both.
    higher = measured.angles.foot_rise.max(axis=-1)
    return beyond(higher, thresholds.foot_rise, accuracy=measured.error("foot_rise"))


class ArmPolicy(StrEnum):
    """How an arm that is raised neither forward nor sideways is read."""

    PROJECTION = "projection"
    """The arm as seen from the side, as the methods' pictures show it."""
    ELEVATION = "elevation"
    """The whole angle to the trunk while the arm points within 60° of forward; up to 90° the arm only
    counts as abducted; behind, the arm as seen from the side."""


WIDEST = np.pi / 3
"""Direction from forward up to which the elevation stands for the flexion [rad], a choice."""
BASE = (1, 4)
"""Least and greatest score of an upper arm without modifiers."""


def arm_score(measured: Measured, score: Callable[[Array], Ints], policy: ArmPolicy) -> Span:
    """Score of the upper arm without modifiers, shape (..., 2).

    Seen from the side, an arm that points sideways has no direction: with its angle λ out of the
    sagittal plane, an error δ turns the projection by up to ``arcsin(sin δ / cos λ)``. So does the
    direction in which an arm points, with its elevation θ, by ``arcsin(sin δ / sin θ)``.

    Args:
        measured: Angles of the postures; the accuracy of the flexion is that of the arm's direction.
        score: 1 to 4 of a flexion [rad], least at 0.
        policy: Which angle it is asked for.
    """
    angles = measured.angles
    accuracy = measured.error("shoulder_flexion", "shoulder_elevation")
    flexion, side = angles.shoulder_flexion, angles.shoulder_abduction
    spread = turned(accuracy, np.cos(side))
    rounding = turned(ROUNDING, np.cos(np.where(np.isnan(side), 0.0, side)))
    if ArmPolicy(policy) is ArmPolicy.PROJECTION:
        return _projected(flexion, score, spread, rounding)
    azimuth = np.abs(np.arctan2(np.sin(side), np.cos(side) * np.sin(flexion)))
    lever = np.sin(angles.shoulder_elevation)
    swing, off = turned(accuracy, lever), turned(ROUNDING, lever)
    ahead = graded(angles.shoulder_elevation, score, within=BASE, accuracy=accuracy)
    beside = graded(np.zeros_like(flexion), score, within=BASE)
    behind = _projected(flexion, score, spread, rounding)
    lowest, highest = np.full(flexion.shape, BASE[1]), np.full(flexion.shape, BASE[0])
    for span, first, last in (
        (ahead, -np.inf, WIDEST),
        (beside, WIDEST, np.pi / 2),
        (behind, np.pi / 2, np.inf),
    ):
        # An edge belongs to both: what is said of an arm exactly there is the worse of the two.
        possible = ~((azimuth + swing < first) | (azimuth - swing > last))
        rounded = ~((azimuth + swing + off < first) | (azimuth - swing - off > last))
        lowest = np.where(possible, np.minimum(lowest, span.low), lowest)
        highest = np.where(rounded, np.maximum(highest, span.high), highest)
    missing = np.isnan(flexion)
    return Span(lowest if accuracy else np.where(missing, BASE[0], highest), highest)


def _projected(
    flexion: Array, score: Callable[[Array], Ints], spread: Array | float, rounding: Array | float
) -> Span:
    """Score of the flexion, which goes on at 270° where it ends at -90°."""
    span = graded(flexion, score, within=BASE, accuracy=spread, rounding=rounding)
    ends = score(np.array([-np.pi / 2, 3 * np.pi / 2]))

    def around(off: Array | float) -> Array:
        return np.asarray((flexion - off < -np.pi / 2) | (flexion + off > 3 * np.pi / 2))

    high = np.where(around(spread + rounding), np.maximum(span.high, ends.max()), span.high)
    if not any_of(spread):
        return Span(np.where(np.isnan(flexion), span.low, high), high)
    return Span(np.where(around(spread), np.minimum(span.low, ends.min()), span.low), high)
