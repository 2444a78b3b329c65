r"""The anatomical angles that ergonomics rules speak of, from where the bones are.

Each angle is the direction of one bone's long axis in the frame of another, never a triple of Euler
angles: :math:`u = R_{parent}^T R_{bone} e`, with the ISB axes X forward, Y up, Z to the right. A flexion
is the direction projected on the sagittal plane, an angle out of that plane is :math:`\arcsin` of the
lateral component (the projection on the frontal plane would call an arm that reaches forward abducted), a
twist is the rotation about the long axis that is left when the shortest rotation is taken away:
:math:`\theta = \operatorname{atan2}(R_{02} - R_{20}, R_{00} + R_{22})`.

The trunk is measured against gravity in the heading of the pelvis, arms and neck against the thorax, the
rest against the neighbouring bone. So no angle changes with where the person stands and looks, and each
changes sides in a mirror.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.transforms import Array
from seerob.description.humans.skeleton import BONES, SIDES
from seerob.kernels.posture_angles import ANGLES, SINES, TANGENTS, directions, in_range


@dataclass(frozen=True, eq=False)
class Angles:
    """Angles of a posture [rad]; NaN is not assessed. Sided ones have a last axis (right, left)."""

    trunk_flexion: Array
    """Long axis of the thorax against gravity, forward positive, shape (...)."""
    trunk_side_bend: Array
    """To the right, shape (...)."""
    trunk_twist: Array
    """Thorax against pelvis, to the left, shape (...)."""
    neck_flexion: Array
    """Head against thorax, forward positive, shape (...)."""
    neck_side_bend: Array
    """To the right, shape (...)."""
    neck_twist: Array
    """To the left, shape (...)."""
    shoulder_flexion: Array
    """Upper arm projected on the sagittal plane of the thorax, forward positive, -π/2 to 3π/2: an arm that
    points up and back went forward to get there. Shape (..., 2)."""
    shoulder_elevation: Array
    """Upper arm against the hanging arm, whatever the direction, 0 to π, shape (..., 2)."""
    shoulder_abduction: Array
    """Upper arm out of the sagittal plane of the thorax, outward positive, at most π/2, shape (..., 2)."""
    shoulder_rotation: Array
    """Upper arm about its long axis, inward positive, shape (..., 2)."""
    clavicle_elevation: Array
    """Of the shoulder, upward positive, shape (..., 2)."""
    arm_rise: Array
    """Shoulder to elbow or to wrist, whichever is higher, above the horizontal, shape (..., 2)."""
    elbow_flexion: Array
    """0 is straight, shape (..., 2)."""
    forearm_out: Array
    """Forearm out of the sagittal plane of the thorax, outward positive, shape (..., 2)."""
    wrist_across: Array
    """How far the wrist is beyond the middle of the trunk, seen from the shoulder, shape (..., 2)."""
    forearm_rotation: Array
    """From thumb up, pronation positive, shape (..., 2)."""
    wrist_flexion: Array
    """Toward the palm positive, shape (..., 2)."""
    wrist_deviation: Array
    """Ulnar positive, shape (..., 2)."""
    knee_flexion: Array
    """0 is straight, shape (..., 2)."""
    shank_tilt: Array
    """Shank against the vertical, 0 to π, shape (..., 2)."""
    foot_rise: Array
    """Ankle above the lower ankle, seen from the hip over the length of the leg, shape (..., 2)."""

    @cached_property
    def listed(self) -> dict[str, Any]:
        """By name, a number [rad] or those of both sides, of one posture."""
        return {f.name: getattr(self, f.name).tolist() for f in fields(self)}

    def without(self, bones: Collection[str]) -> Angles:
        """Return these angles, with NaN for every angle that needs one of the bones: it is not assessed."""
        return self.masked(made_of(frozenset(bones)))

    def masked(self, angles: Collection[tuple[str, int]]) -> Angles:
        """Set the angles named, by name and side (0 right, 1 left), to NaN: they are not assessed."""
        if not angles:
            return self
        changed = {name: np.array(getattr(self, name), float) for name, _ in angles}
        for name, side in angles:
            changed[name][(..., side) if name in SIDED else ...] = np.nan
        return replace(self, **changed)

    def __getitem__(self, key: object) -> Angles:
        """Some postures of a batch: the key is applied to the leading axes of every angle."""
        return Angles(**{f.name: getattr(self, f.name)[key] for f in fields(self)})


_ARM = ("{side}_clavicle", "{side}_upper_arm")
NEEDS: dict[str, tuple[str, ...]] = {
    "trunk_flexion": ("pelvis", "thorax"),
    "trunk_side_bend": ("pelvis", "thorax"),
    "trunk_twist": ("pelvis", "thorax"),
    "neck_flexion": ("thorax", "head"),
    "neck_side_bend": ("thorax", "head"),
    "neck_twist": ("thorax", "head"),
    "shoulder_flexion": ("thorax", "{side}_upper_arm"),
    "shoulder_elevation": ("thorax", "{side}_upper_arm"),
    "shoulder_abduction": ("thorax", "{side}_upper_arm"),
    "shoulder_rotation": ("thorax", "{side}_upper_arm"),
    "clavicle_elevation": ("thorax", "{side}_clavicle"),
    "arm_rise": ("{side}_upper_arm", "{side}_forearm"),
    "elbow_flexion": ("{side}_upper_arm", "{side}_forearm"),
    "forearm_out": ("thorax", "{side}_forearm"),
    "wrist_across": ("thorax", *_ARM, "{side}_forearm"),
    "forearm_rotation": ("{side}_upper_arm", "{side}_forearm"),
    "wrist_flexion": ("{side}_forearm", "{side}_hand"),
    "wrist_deviation": ("{side}_forearm", "{side}_hand"),
    "knee_flexion": ("{side}_thigh", "{side}_shank"),
    "shank_tilt": ("{side}_shank",),
    "foot_rise": ("pelvis", *(f"{side}_{bone}" for side in SIDES for bone in ("thigh", "shank"))),
}
"""Angle → bones that it is made of; ``{side}`` stands for the angle's own side."""
SIDED = frozenset(NEEDS) - {
    f"{part}_{way}" for part in ("trunk", "neck") for way in ("flexion", "side_bend", "twist")
}
"""Angles with a last axis (right, left)."""


_PAIRS = ("clavicle", "upper_arm", "forearm", "hand", "thigh", "shank", "foot")
_PLACES = np.array(
    [BONES.index(bone) for bone in ("pelvis", "thorax", "head")]
    + [BONES.index(f"{side}_{bone}") for bone in _PAIRS for side in SIDES],
    np.int64,
)
"""Bones as `seerob.kernels.posture_angles` takes them."""
_ROWS: list[int | slice] = []
"""Where each angle is among all of a posture."""
for _name in NEEDS:
    _at = sum(2 if isinstance(rows, slice) else 1 for rows in _ROWS)
    _ROWS.append(slice(_at, _at + 2) if _name in SIDED else _at)


@lru_cache(maxsize=256)
def made_of(bones: frozenset[str]) -> tuple[tuple[str, int], ...]:
    """Angles that need one of the bones, each with its side: 0 right or none, 1 left."""
    return tuple(
        (name, side)
        for name, needed in NEEDS.items()
        for side, own in enumerate(SIDES if name in SIDED else SIDES[:1])
        if any(bone.format(side=own) in bones for bone in needed)
    )


def angles(rotations: ArrayLike, positions: ArrayLike) -> Angles:
    """Angles of postures.

    Args:
        rotations: World from bone, in the order of `BONES`, shape (..., 21, 3, 3); z of the world is up.
        positions: Proximal joints of the bones in the world [m], shape (..., 21, 3).

    Returns:
        Angles [rad], shapes (...) and (..., 2).
    """
    R = np.ascontiguousarray(rotations, float)
    p = np.ascontiguousarray(positions, float)
    many = R.shape[:-3]
    n = math.prod(many)
    tangents, sines, found = np.empty((n, TANGENTS, 2)), np.empty((n, SINES)), np.empty((n, ANGLES))
    directions(R.reshape(n, *R.shape[-3:]), p.reshape(n, *p.shape[-2:]), _PLACES, tangents, sines)
    in_range(np.arctan2(tangents[..., 0], tangents[..., 1]), np.arcsin(sines), found)
    every = found.reshape(*many, ANGLES)
    return Angles(*[every[..., rows] for rows in _ROWS])
