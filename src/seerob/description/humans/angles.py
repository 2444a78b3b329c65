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

from collections.abc import Collection
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.transforms import Array
from seerob.description.humans.skeleton import BONES, SIDES

_INDEX = {bone: i for i, bone in enumerate(BONES)}
_OUTWARD = np.array([1.0, -1.0])
"""Sign of Z that points away from the trunk, right and left."""
_TINY = 1e-9
_LEAST = 1e-6
"""Directions that are shorter are rounding."""


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
    R, p = np.asarray(rotations, float), np.asarray(positions, float)
    pelvis, thorax, head = (R[..., _INDEX[bone], :, :] for bone in ("pelvis", "thorax", "head"))
    clavicle, upper, fore, hand, thigh, shank = (
        R[..., [_INDEX[f"{side}_{bone}"] for side in SIDES], :, :]
        for bone in ("clavicle", "upper_arm", "forearm", "hand", "thigh", "shank")
    )
    at = {bone: _sided(p, bone) for bone in ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")}
    # Of all bones together: numpy takes longer to be asked than for the six or twelve of one posture.
    middle, chest = np.stack([pelvis, thorax], -3), np.stack([thorax] * 6, -3)
    trunk = _in_heading(pelvis[..., 2], thorax[..., 1])
    parents = np.concatenate([chest, thorax[..., None, :, :], upper, fore, thigh], -3)
    directions = [-upper[..., 1], -fore[..., 1], clavicle[..., 2] * _OUTWARD[:, None], head[..., None, :, 1]]
    directions += [-fore[..., 1], -hand[..., 1], -shank[..., 1]]
    seen = _seen(parents, np.concatenate(directions, -2))
    arm, forearm, lateral = (seen[..., k : k + 2, :] for k in (0, 2, 4))
    neck, (bent, wrist, knee) = seen[..., 6, :], (seen[..., k : k + 2, :] for k in (7, 9, 11))
    children = np.concatenate([np.stack([thorax, head], -3), upper, fore], -3)
    twist = _twist(np.concatenate([middle, chest[..., :2, :, :], upper], -3), children)
    reach, leg = at["hand"] - at["upper_arm"], at["foot"] - at["thigh"]
    across = -_OUTWARD * _dot(at["hand"] - p[..., None, _INDEX["thorax"], :], chest[..., :2, :, 2])
    rise = at["foot"][..., 2] - at["foot"][..., 2].min(axis=-1, keepdims=True)
    sines = [trunk[..., 2:], neck[..., 2:], _OUTWARD * arm[..., 2], lateral[..., 1]]
    sines += [_OUTWARD * forearm[..., 2], across / np.maximum(_norm(reach), _TINY), -_OUTWARD * wrist[..., 2]]
    tilt = _arcsin(np.concatenate([*sines, rise / np.maximum(_norm(leg), _TINY)], -1))
    joints = np.concatenate([arm, bent, knee], -2)
    folded = np.arctan2(np.hypot(joints[..., 0], joints[..., 2]), -joints[..., 1])
    return Angles(
        trunk_flexion=_bent(np.arctan2(trunk[..., 0], trunk[..., 1])),
        trunk_side_bend=tilt[..., 0],
        trunk_twist=twist[..., 0],
        neck_flexion=np.arctan2(neck[..., 0], neck[..., 1]),
        neck_side_bend=tilt[..., 1],
        neck_twist=twist[..., 1],
        shoulder_flexion=_forward(np.arctan2(arm[..., 0], -arm[..., 1])),
        shoulder_elevation=folded[..., :2],
        shoulder_abduction=tilt[..., 2:4],
        shoulder_rotation=_OUTWARD * twist[..., 2:4],
        clavicle_elevation=tilt[..., 4:6],
        arm_rise=np.maximum(_slope(at["forearm"] - at["upper_arm"]), _slope(reach)),
        elbow_flexion=folded[..., 2:4],
        forearm_out=tilt[..., 6:8],
        wrist_across=tilt[..., 8:10],
        forearm_rotation=_wrapped(_OUTWARD * twist[..., 4:] - np.pi / 2),
        wrist_flexion=np.arctan2(wrist[..., 0], -wrist[..., 1]),
        wrist_deviation=tilt[..., 10:12],
        knee_flexion=folded[..., 4:],
        shank_tilt=np.arctan2(np.hypot(shank[..., 0, 1], shank[..., 1, 1]), shank[..., 2, 1]),
        foot_rise=tilt[..., 12:],
    )


def _sided(p: Array, bone: str) -> Array:
    return p[..., [_INDEX[f"{side}_{bone}"] for side in SIDES], :]


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _norm(a: Array) -> Array:
    return np.asarray(np.sqrt(_dot(a, a)))


def _arcsin(sine: Array) -> Array:
    return np.arcsin(np.minimum(np.maximum(sine, -1.0), 1.0))


def _slope(way: Array) -> Array:
    """Angle of a direction above the horizontal."""
    return np.arctan2(way[..., 2], np.hypot(way[..., 0], way[..., 1]))


def _seen(rotation: Array, direction: Array) -> Array:
    """A direction of the world in the frame of a bone."""
    return np.asarray(np.einsum("...ji,...j->...i", rotation, direction))


def _in_heading(right: Array, direction: Array) -> Array:
    """A direction in the frame of gravity and heading: forward, up, right.

    The heading comes from the axis to the right, not from the one forward, which points down when
    somebody bends over. Somebody who lies on a side has none: not a number.
    """
    length = np.hypot(right[..., 0], right[..., 1])[..., None]
    horizontal = right[..., :2] / np.where(length > _LEAST, length, np.nan)
    x, y = horizontal[..., 0], horizontal[..., 1]
    forward = -y * direction[..., 0] + x * direction[..., 1]
    return np.stack([forward, direction[..., 2], x * direction[..., 0] + y * direction[..., 1]], axis=-1)


def _twist(parent: Array, child: Array) -> Array:
    """Rotation of a child about its long axis Y, without the swing of that axis."""

    def entry(i: int, j: int) -> Array:
        return _dot(parent[..., i], child[..., j])

    return np.arctan2(entry(0, 2) - entry(2, 0), entry(0, 0) + entry(2, 2))


def _bent(angle: Array) -> Array:
    """An angle of the range -π to π of which the end is forward: upside down, whatever the last bit says."""
    return np.where(angle < -np.pi + _LEAST, angle + 2 * np.pi, angle)


def _forward(angle: Array) -> Array:
    """An angle of the range -π/2 to 3π/2."""
    return np.where(angle < -np.pi / 2, angle + 2 * np.pi, angle)


def _wrapped(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
