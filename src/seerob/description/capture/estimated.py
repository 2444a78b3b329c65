"""Which bones nobody measures although the twin has them somewhere, and which the bones beside them tell.

Between a hand and an upper arm an elbow follows from the bones' lengths; of a leg of which only the foot is
seen the knee may be anywhere on a circle. A headset with two controllers sees head and hands: arms, legs,
pelvis and spine are a guess, and neither a distance nor a score may be made of them.

Hands, feet and heads of which a device sees too little: how they are turned is a guess.

A wrist that is seen says where the hand begins. Where the fingers are it does not say, and the twin's are
where rest has them. Told is how such a bone is turned by an orientation, by other places on it, or by the
joint at its other end. Places on one line leave open how the bone is turned about that line: a wrist and a
fingertip do not say whether the palm is up.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable
from functools import lru_cache

import numpy as np

from seerob.core.samples import BodyPoint, Vec3
from seerob.core.transforms import Array
from seerob.description.humans.skeleton import AXES, BONES, PARENTS, SIDES, without_side

ENDS = frozenset({"head", *(f"{side}_{bone}" for side in SIDES for bone in ("hand", "foot"))})
"""Bones beyond which no joint says where they point; a foot may have its toes."""
LEAST_LEVER = 0.02
"""Places on a bone that are nearer to each other, or to one line, than this [m] do not tell how it is
turned, or not about that line."""
OPEN = 0.4
"""Share of the line along an axis of the bone from which on the turn about that axis is open; a choice."""
Turn = tuple[str, int]
"""A bone and one of its axes: 0 forward, 1 up, 2 right, in the anatomical position."""
_END_OF: dict[str, tuple[str, Vec3]] = {
    name: end
    for side in SIDES
    for name, end in (
        (f"{side}_foot", (f"{side}_toes", (0.15, 0.0, 0.0))),
        (f"{side}_forearm", (f"{side}_hand", (0.0, -0.25, 0.0))),
    )
}
"""Bone → the one at its other end, and about where that begins [m]."""
_LIMBS = {f"{side}_{bone}" for side in SIDES for bone in ("clavicle", "upper_arm", "thigh", "shank")}
_TURNING = ENDS | _END_OF.keys() | _LIMBS | {"neck"}
_WAYS = {"foot": (1, 2), "clavicle": (0, 1)}
"""Axes about which a bone must be known to be turned for it to be known where it points: of a foot, which
points forward, and a clavicle, which points sideways; of others `_HANGING`."""
_HANGING = (0, 2)
_ROLLED = {f"{side}_hand": f"{side}_forearm" for side in SIDES}
"""With an unseen hand it is not seen either how its forearm is turned about itself."""


def turned(points: Iterable[BodyPoint]) -> set[Turn]:
    """About which axes points tell how limbs, neck and head are turned.

    Args:
        points: That are believed.
    """
    found: set[Turn] = set()
    places: dict[str, set[Vec3]] = defaultdict(set)
    for p in points:
        if p.wxyz is not None and p.orientation_weight > 0 and p.bone in _TURNING:
            found |= {(p.bone, axis) for axis in range(3) if axis != 1 or p.rolled}
        if p.position is not None and p.position_weight > 0:
            places[p.bone].add(p.at)
    for bone, (after, there) in _END_OF.items():
        if after in places:
            places[bone].add(there)
    for bone in _TURNING & places.keys():
        found |= {(bone, axis) for axis in _fixed_axes(frozenset(places[bone]))}
    return found


@lru_cache(maxsize=1024)
def _fixed_axes(places: frozenset[Vec3]) -> tuple[int, ...]:
    """Axes of a bone about which places on it, and its joint, tell how it is turned."""
    spots = np.array([(0.0, 0.0, 0.0), *sorted(places)])
    lengths = np.linalg.norm(spots[:, None] - spots, axis=2)
    i, j = np.unravel_index(lengths.argmax(), lengths.shape)
    if lengths[i, j] <= LEAST_LEVER:
        return ()
    line = (spots[j] - spots[i]) / lengths[i, j]
    beside = float(np.linalg.norm(np.cross(spots - spots[i], line), axis=1).max())
    return tuple(axis for axis in range(3) if beside > LEAST_LEVER or abs(line[axis]) < OPEN)


def aimed(turns: Collection[Turn]) -> set[str]:
    """Bones of `ENDS` that are known to point somewhere; how they are turned about their axis is not asked.

    Args:
        turns: Of `turned`.
    """
    return {
        bone
        for bone in ENDS
        if all((bone, axis) in turns for axis in _WAYS.get(without_side(bone), _HANGING))
    }


_SHOWN_BY = {
    f"{prefix}{bone}": tuple(f"{prefix}{other}" for other in others)
    for prefixes, bone, others in (
        (("",), "neck", ("head",)),
        (("right_", "left_"), "clavicle", ("upper_arm", "forearm")),
        (("right_", "left_"), "upper_arm", ("forearm", "hand")),
        (("right_", "left_"), "forearm", ("hand",)),
        (("right_", "left_"), "thigh", ("shank", "foot")),
        (("right_", "left_"), "shank", ("foot", "toes")),
    )
    for prefix in prefixes
}
"""Bone → bones beyond it, of which the place of one shows where it points: the next one, or the one after
it, by which the next one is told."""


def bare(observed: Collection[str], placed: Collection[str], turns: Collection[Turn]) -> frozenset[str]:
    """Bones of limbs of which the joint is seen and nothing shows where they point.

    An elbow that is seen does not say where the forearm is when neither hand nor forearm is.

    Args:
        observed: Bones of which something is seen.
        placed: Those of them of which a place is seen.
        turns: Of `turned`.
    """
    return frozenset(
        bone
        for bone, beyond in _SHOWN_BY.items()
        if bone in observed
        and not any(other in placed for other in beyond)
        and not all((bone, axis) in turns for axis in _WAYS.get(without_side(bone), _HANGING))
    )


_LEANING = frozenset(
    (angle, side)
    for angle, sides in (
        ("trunk_flexion", 1),
        ("neck_flexion", 1),
        ("shoulder_flexion", 2),
        ("shoulder_elevation", 2),
    )
    for side in range(sides)
)
"""Angles that are off with where a device has the joints of the trunk."""


def undetermined(turns: Collection[Turn], *, leaning: bool = False) -> frozenset[tuple[str, int]]:
    """Angles of `humans.angles` that nothing tells, each with its side: 0 right or none, 1 left.

    A wrist bends forward or sideways only to somebody who knows how the forearm is turned about itself: by
    places on the forearm, or by those on the hand, which does not turn in its joint.

    Args:
        turns: Of `turned`.
        leaning: Whether somebody who stands upright may lean by what a device sees.
    """
    neck = (("neck_side_bend", 0), ("neck_twist", 1), ("neck_flexion", 2))
    found = {(angle, 0) for angle, axis in neck if ("head", axis) not in turns}
    for k, side in enumerate(SIDES):
        hand = f"{side}_hand"
        rolled = (hand, 1) in turns or (f"{side}_forearm", 1) in turns
        found |= set() if rolled else {("forearm_rotation", k)}
        for angle, axis in (("wrist_deviation", 0), ("wrist_flexion", 2)):
            if not rolled or (hand, axis) not in turns:
                found.add((angle, k))
    return frozenset(found | _LEANING) if leaning else frozenset(found)


def swing(bone: str, q: Array, lower: Array, upper: Array) -> float:
    """Bound on the angle between how a bone of the twin is turned and how the person's may be [rad].

    Angles of rotations one after the other add up at most; each joint is somewhere within its limits.

    Args:
        bone: One of `ENDS`.
        q: Of the twin [rad or m], shape (53,).
        lower: Limits, shape (53,).
        upper: Shape (53,).
    """
    own = [k for k, axis in enumerate(AXES) if axis.bone == bone or _rolls(axis.name, axis.bone, bone)]
    return float(min(np.pi, np.maximum(upper[own] - q[own], q[own] - lower[own]).sum()))


def _rolls(name: str, of: str, bone: str) -> bool:
    return of == _ROLLED.get(bone) and "pronation" in name


HIPS = frozenset(f"{side}_thigh" for side in SIDES)
SHOULDERS = frozenset(f"{side}_upper_arm" for side in SIDES)


def estimated(seen: Collection[str], bare: Collection[str] = ()) -> tuple[str, ...]:
    """Bones that are neither seen nor told by the bones beside them, in the order of `BONES`.

    Told are: a bone between a bone that is seen (or a trunk that is told) and one that is seen; toes of a
    foot that is known; pelvis and thorax by both hips and both shoulders together. Which is a choice.

    Args:
        seen: Bones that a device sees now. Whom joints or keyframes move nobody sees, and nothing of it is
            estimated: that is not asked here.
        bare: Those of them of which nothing shows where they point (`bare`).
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


def invalid_with(lost: str, seen: Collection[str]) -> tuple[str, ...]:
    """Bones that may be anywhere when one is not seen any more.

    Itself; of a limb the bone before it, whose direction it showed; and what hangs on it and is not seen.

    Args:
        lost: The bone.
        seen: Bones that are seen.
    """
    invalid = [lost]
    for bone, parent in PARENTS.items():
        # A parent stands before its children in the order of the bones.
        if parent in invalid and bone not in seen and bone not in invalid:
            invalid.append(bone)
    if without_side(lost) in LIMBS and without_side(PARENTS[lost]) in (*LIMBS, "clavicle", "neck"):
        invalid.append(PARENTS[lost])
    return tuple(invalid)
