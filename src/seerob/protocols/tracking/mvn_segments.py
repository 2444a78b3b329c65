"""Xsens MVN's skeleton: names of segments and joints, their order, and which hangs on which.

Order and numbers: MVN real-time network streaming protocol specification, MV0305P revision N (2018),
tables 1 to 3; the names are those of MVNX files. A segment's identifier is its place plus one. Segment
frames have x forward, y to the left and z up when the person stands in the T-pose.
"""

from __future__ import annotations

from functools import cache

_SPINE = ("Pelvis", "L5", "L3", "T12", "T8", "Neck", "Head")
_ARM = ("Shoulder", "UpperArm", "ForeArm", "Hand")
_LEG = ("UpperLeg", "LowerLeg", "Foot", "Toe")


def _limb(side: str, parts: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(side + part for part in parts)


SEGMENTS: tuple[str, ...] = (
    *_SPINE,
    *_limb("Right", _ARM),
    *_limb("Left", _ARM),
    *_limb("Right", _LEG),
    *_limb("Left", _LEG),
)
"""The 23 segments, table 1."""

UNITY: tuple[str, ...] = (
    "Pelvis",
    *_limb("Right", _LEG),
    *_limb("Left", _LEG),
    *_SPINE[1:5],
    *_limb("Left", _ARM),
    *_limb("Right", _ARM),
    "Neck",
    "Head",
)
"""The 23 segments in the order of the Unity3D protocol, table 3."""


def _joints() -> tuple[tuple[str, str, str], ...]:
    rows = [
        ("jL5S1", "Pelvis", "L5"),
        ("jL4L3", "L5", "L3"),
        ("jL1T12", "L3", "T12"),
        ("jT9T8", "T12", "T8"),
        ("jT1C7", "T8", "Neck"),
        ("jC1Head", "Neck", "Head"),
    ]
    for names, first, segments in (
        (("T4Shoulder", "Shoulder", "Elbow", "Wrist"), "T8", _ARM),
        (("Hip", "Knee", "Ankle", "BallFoot"), "Pelvis", _LEG),
    ):
        for side in ("Right", "Left"):
            chain = (first, *_limb(side, segments))
            rows += [(f"j{side}{name}", chain[k], chain[k + 1]) for k, name in enumerate(names)]
    return tuple(rows)


JOINTS: tuple[tuple[str, str, str], ...] = _joints()
"""Label, parent and child of the 22 joints, as MVNX files list them; files before 2018 write C7 for T4."""

PARENTS: tuple[int, ...] = (
    -1,
    *(next(SEGMENTS.index(p) for _, p, child in JOINTS if child == name) for name in SEGMENTS[1:]),
)
"""Place of the parent of each of `SEGMENTS`, -1 for the pelvis."""

_FINGERS = (
    "Carpus",
    *(
        f"{number}{bone}"
        for number in ("First", "Second", "Third", "Fourth", "Fifth")
        for bone in ("MC", *(("PP", "DP") if number == "First" else ("PP", "MP", "DP")))
    ),
)
MAX_PROPS = 4
FINGERS = 2 * len(_FINGERS)
"""Segments of both hands: 40."""


@cache
def names(props: int = 0, fingers: int = 0) -> tuple[str, ...]:
    """Names in the order of identifiers: body, props, left hand, right hand (§2.5.1).

    Args:
        props: Number of props, 0 to 4.
        fingers: 0, or 40 for both hands; MC is a metacarpal, PP, MP and DP are phalanges.
    """
    hands = [f"{side}{part}" for side in ("Left", "Right") for part in _FINGERS]
    return (*SEGMENTS, *(f"Prop{k + 1}" for k in range(props)), *hands[:fingers])
