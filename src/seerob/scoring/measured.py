"""Angles together with how far each of them may be off; scores of them as spans."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from msgspec import Struct
from msgspec.structs import asdict

from seerob.human.angles import Angles
from seerob.scoring.published import Ints
from seerob.scoring.spans import Span, beyond, graded
from seerob.scoring.thresholds import Angle
from seerob.transforms import Array

Accuracy = float | Mapping[str, float]
"""Of each angle [rad]: one figure for all, or one per name of `Angles`; a name that is not there is exact."""


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
        if isinstance(self._accuracy, Mapping):
            return max(self._accuracy.get(name, 0.0) for name in names)
        return float(self._accuracy)

    def graded(
        self, name: str, score: Callable[[Array], Ints], *, within: tuple[int, int], neutral: float = 0.0
    ) -> Span:
        """`spans.graded` of an angle by its name."""
        return graded(
            getattr(self.angles, name), score, within=within, accuracy=self.error(name), neutral=neutral
        )

    def beyond(self, name: str, threshold: float, *, signed: bool = False) -> Span:
        """`spans.beyond` of an angle by its name."""
        return beyond(getattr(self.angles, name), threshold, accuracy=self.error(name), signed=signed)
