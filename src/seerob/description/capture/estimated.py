"""Which bones nobody measures although the twin has them somewhere, and which the bones beside them tell.

Between a hand and an upper arm an elbow follows from the bones' lengths; of a leg of which only the foot is
seen the knee may be anywhere on a circle. A headset with two controllers sees head and hands: arms, legs,
pelvis and spine are a guess, and neither a distance nor a score may be made of them.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import lru_cache

from seerob.description.humans.skeleton import BONES, PARENTS, SIDES, without_side

HIPS = frozenset(f"{side}_thigh" for side in SIDES)
SHOULDERS = frozenset(f"{side}_upper_arm" for side in SIDES)


def estimated(seen: Collection[str], bare: Collection[str] = ()) -> tuple[str, ...]:
    """Bones that are neither seen nor told by the bones beside them, in the order of `BONES`.

    Told are: a bone between a bone that is seen (or a trunk that is told) and one that is seen; toes of a
    foot that is known; pelvis and thorax by both hips and both shoulders together. Which is a choice.

    Args:
        seen: Bones that a device sees now. Whom joints or keyframes move nobody sees, and nothing of it is
            estimated: that is not asked here.
        bare: Those of them of which nothing shows where they point (`seerob.description.capture.ends.bare`).
    """
    return _estimated(frozenset(seen), frozenset(bare))


@lru_cache(maxsize=256)
def _estimated(seen: frozenset[str], bare: frozenset[str]) -> tuple[str, ...]:
    known = set(seen)
    if seen >= HIPS and (seen >= SHOULDERS or seen & {"lumbar", "thorax"}):
        known.add("pelvis")
    if seen >= SHOULDERS and (seen >= HIPS or seen & {"lumbar", "pelvis"}):
        known.add("thorax")
    ends = {PARENTS[bone] for bone in known}
    known |= {bone for bone in ends if PARENTS.get(bone) in known}
    known |= {f"{side}_toes" for side in SIDES if f"{side}_foot" in known}
    return tuple(bone for bone in BONES if bone not in known or bone in bare)


def located(directed: Collection[str], placed: Collection[str]) -> frozenset[str]:
    """Bones of which it is told where they begin, by the places of some and by where the bones between point.

    A bone begins at the end of the one before it. So a place goes on over every bone of which it is known
    where it points, and no further: a suit that tells how all bones are turned, and no place, tells of
    nobody where he stands.

    Args:
        directed: Bones that are seen or told by the bones beside them.
        placed: Bones of which a place is seen.
    """
    return _located(frozenset(directed), frozenset(placed))


@lru_cache(maxsize=256)
def _located(directed: frozenset[str], placed: frozenset[str]) -> frozenset[str]:
    found, before = set(placed), -1
    while len(found) != before:
        before = len(found)
        for bone, parent in PARENTS.items():
            if parent in directed and (bone in found or parent in found):
                found |= {bone, parent}
    return frozenset(found)


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
