"""Where a posture counts as twisted, raised or upright: what the methods leave to whoever applies them."""

from __future__ import annotations

import math
from typing import Annotated

from msgspec import Meta, Struct

Angle = Annotated[float, Meta(ge=0, le=math.pi, extra={"unit": "rad"}, extra_json_schema={"x-unit": "rad"})]


def _deg(angle: float) -> float:
    return math.radians(angle)


class Thresholds(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Angles at which a posture counts as upright, twisted, bent, raised and so on; all are choices."""

    trunk_upright: Angle = _deg(5)
    """Trunk within this of the vertical is upright [rad]; published: 2 to 7°."""
    trunk_twist: Angle = _deg(10)
    """Trunk twisted beyond [rad]; published: 15 to 25°."""
    trunk_side_bend: Angle = _deg(10)
    """Trunk bent sideways beyond [rad]; published: 3 to 30°."""
    neck_extension: Angle = _deg(5)
    """Neck in extension beyond [rad]; published: 0 to 5°."""
    neck_twist: Angle = _deg(10)
    """Neck twisted beyond [rad]; published: 15 to 20°."""
    neck_side_bend: Angle = _deg(10)
    """Neck bent sideways beyond [rad]; published: 8 to 20°."""
    arm_abducted: Angle = _deg(20)
    """Upper arm abducted beyond [rad]; published: 20 to 45°."""
    arm_rotated: Angle = _deg(45)
    """Upper arm rotated about its long axis beyond [rad], REBA only; no published value was found."""
    shoulder_raised: Angle = _deg(5)
    """Shoulder raised: clavicle above its place in the upright posture by more [rad]; published: 5°."""
    forearm_out: Angle = _deg(45)
    """Forearm out to the side beyond [rad], RULA only; a choice."""
    wrist_across: Angle = 0.0
    """Wrist beyond the middle of the trunk, seen from the shoulder, by more [rad], RULA only."""
    wrist_neutral: Angle = _deg(5)
    """Wrist within this of straight is neutral [rad], RULA only; published: 1 to 5°."""
    wrist_deviation: Angle = _deg(10)
    """Wrist deviated beyond [rad]; published: 5 to 10°."""
    forearm_rotation: Angle = _deg(45)
    """Forearm turned from thumb up beyond [rad]: near the end of its range; published: 30 to 45°."""
    foot_rise: Angle = _deg(7)
    """One foot above the other, over the length of the leg, beyond [rad]: on one leg; published: 100 mm."""
    knee_difference: Angle = _deg(15)
    """Knees bent by different angles beyond [rad]: weight not even, RULA only; published: 15°."""
