"""What the head of an MVNX file says of the person: what was measured, and how long the segments are."""

from __future__ import annotations

import numpy as np

from seerob.core.transforms import Array
from seerob.devices.capture.mvnx_stream import Head
from seerob.protocols.tracking.mvn_segments import JOINTS, SEGMENTS

_ENDS = {"Head": "pTopOfHead", "RightHand": "pRightTopOfHand", "LeftHand": "pLeftTopOfHand"}
_LIMBS = {
    "legs": tuple(f"{side}{part}" for side in ("Right", "Left") for part in ("UpperLeg", "LowerLeg", "Foot")),
    "arms": tuple(f"{side}{part}" for side in ("Right", "Left") for part in ("UpperArm", "ForeArm", "Hand")),
    "head": ("Head",),
}


def numbers(text: str, count: int) -> Array:
    """So many numbers [as written], shape (count,).

    Raises:
        ValueError: There are more or fewer, or one is none.
    """
    words = text.split()
    if len(words) != count:
        raise ValueError(f"{len(words)} numbers, {count} are expected")
    return np.array([float(word) for word in words])


def unmeasured(head: Head) -> tuple[str, ...]:
    """Segments that no sensor says anything of: they follow a neighbour stiffly."""
    sensors = set(head.sensors)
    if sensors:
        lost = {name for limb in _LIMBS.values() for name in limb if name not in sensors}
        for side in ("Right", "Left"):
            if f"{side}Foot" in lost:
                lost.add(f"{side}Toe")
        return tuple(name for name in SEGMENTS if name in lost)
    configuration = head.configuration.lower()
    if "upperbody" in configuration:
        return SEGMENTS[SEGMENTS.index("RightUpperLeg") :]
    return SEGMENTS[1 : SEGMENTS.index("RightUpperLeg")] if "lowerbody" in configuration else ()


def lengths(head: Head) -> dict[str, float]:
    """Segment lengths [m] from the points of the head: from the origin to where the next segment begins."""
    found = {}
    for name in SEGMENTS[1:]:
        following = [label for label, parent, child in JOINTS if parent == name and child[:4] != "Righ"]
        following = following or [label for label, parent, _ in JOINTS if parent == name]
        text = head.points.get((name, following[0] if following else _ENDS.get(name, "")))
        try:
            length = 0.0 if text is None else float(np.linalg.norm(numbers(text, 3)))
        except ValueError:
            continue
        if 0.0 < length < 1.0:
            found[name] = length
    return found
