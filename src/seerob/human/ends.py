"""Hands, feet and heads of which a device sees the joint alone: how they are turned is a guess.

A wrist that is seen says where the hand begins. Where the fingers are it does not say, and the twin's are
where rest has them. Told is how such a bone is turned by an orientation, by a second place on it, or by the
joint at its other end.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from seerob.human.skeleton import AXES, SIDES
from seerob.samples import BodyPoint, Vec3
from seerob.transforms import Array

ENDS = frozenset({"head", *(f"{side}_{bone}" for side in SIDES for bone in ("hand", "foot"))})
"""Bones beyond which no joint says where they point; a foot may have its toes."""
APART = 0.02
"""Two places on a bone that are nearer to each other [m] do not tell how it is turned."""
_ROLLED = {f"{side}_hand": f"{side}_forearm" for side in SIDES}
"""With an unseen hand it is not seen either how its forearm is turned about itself."""


def aimed(points: Iterable[BodyPoint]) -> set[str]:
    """Bones among `ENDS` of which points tell how they are turned; not how about their own axis.

    Args:
        points: That are believed.
    """
    found: set[str] = set()
    places: dict[str, list[Vec3]] = defaultdict(list)
    for p in points:
        bone = p.bone
        if bone in ENDS and p.wxyz is not None and p.orientation_weight > 0:
            found.add(bone)
        if p.position is not None and p.position_weight > 0:
            places[bone].append(p.at)
            if bone.endswith("_toes"):
                found.add(bone.replace("_toes", "_foot"))
    for bone in ENDS & places.keys() - found:
        spots = np.array(places[bone])
        # Of one place the joint at the bone's beginning is the other: its parent tells where that is.
        if np.linalg.norm(spots - spots[0], axis=1).max() > APART or np.linalg.norm(spots[0]) > APART:
            found.add(bone)
    return found


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
