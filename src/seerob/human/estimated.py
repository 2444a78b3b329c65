"""Which bones nobody measures although the twin has them somewhere: limbs of which nothing is seen.

Between a hand and a shoulder an elbow follows from the bones' lengths, to a degree; of a leg of which no
device sees anything nothing follows. A headset with two controllers sees head and hands: its legs, pelvis
and spine are a guess, and no score may be made of them.
"""

from __future__ import annotations

from collections.abc import Collection

from seerob.human.skeleton import PARENTS, SIDES, without_side

PARTS: tuple[tuple[str, ...], ...] = (
    ("pelvis", "lumbar", "thorax"),
    ("head", "neck"),
    *((f"{s}_upper_arm", f"{s}_forearm", f"{s}_hand") for s in SIDES),
    *((f"{s}_thigh", f"{s}_shank", f"{s}_foot", f"{s}_toes") for s in SIDES),
)
"""Parts of the body of which one bone at least must be seen."""


def estimated(seen: Collection[str]) -> tuple[str, ...]:
    """Bones of the parts of which nothing is seen.

    Args:
        seen: Bones that a device sees now; empty when no device sees the person at all, as when joints or
            keyframes move it: then nothing is estimated.
    """
    if not seen:
        return ()
    return tuple(bone for part in PARTS if not any(b in seen for b in part) for bone in part)


LIMBS = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot", "toes", "head")
"""Bones at whose beginning the bone before them ends: without the one, the direction of the other is open."""


def in_doubt_with(lost: str, seen: Collection[str]) -> tuple[str, ...]:
    """Bones that may be anywhere when one is not seen any more.

    Itself; of a limb the bone before it, whose direction it showed; and what hangs on it and is not seen.

    Args:
        lost: The bone.
        seen: Bones that are seen.
    """
    doubted = [lost]
    for bone, parent in PARENTS.items():
        # A parent stands before its children in the order of the bones.
        if parent in doubted and bone not in seen and bone not in doubted:
            doubted.append(bone)
    if without_side(lost) in LIMBS and without_side(PARENTS[lost]) in (*LIMBS, "clavicle", "neck"):
        doubted.append(PARENTS[lost])
    return tuple(doubted)
