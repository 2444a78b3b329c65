"""The bones and joint axes of the person, and where every bone is for given joint values.

Twenty-one bones, 47 joint axes and six of the waist, as many as the paper's digital human has
[Weistroffer2022]_ §2.3.1; which axes those are is our proposal, the paper does not say.

Frames follow the ISB (Wu and Cavanagh 1995; Wu et al. 2002, 2005): X forward, Y up, Z to the right, in
the anatomical position: upright, arms hanging, elbows straight, **palms forward, thumbs outward**. A
bone's frame lies in its proximal joint; with every joint at 0 all bone frames are parallel. The root
frame has the workstation's axes (x forward, y left, z up, the floor at 0); the one rotation between the
two conventions is `ROOT_FROM_ISB`, in the pelvis' ``parent_from_link``.

Every axis is +X, +Y or +Z of its bone, so every sign is the ISB's, and a joint is named after what a
*positive* value does: ``right_hip_flexion`` is +Z, ``right_knee_extension`` is +Z and a bent knee is
negative. The opposite word is understood too, with the opposite sign (`resolve`).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.errors import UnknownName
from seerob.core.transforms import Array
from seerob.description.description import Description, JointKind

SIDES = ("right", "left")

ROOT = "root"
"""Link that stands still on the floor under the person; it has no mass and no shape."""

ROOT_FROM_ISB: Array = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation of the ISB axes (X forward, Y up, Z right) in the root's (x forward, y left, z up)."""


class Axis(NamedTuple):
    """One degree of freedom of a bone."""

    name: str
    """What a positive value does."""
    opposite: str
    """What a negative value does; empty for the translations of the waist."""
    bone: str
    group: str
    """Joint without side: ``hip``; the key of the limit and torque tables."""
    axis: tuple[float, float, float]
    """In the bone's frame."""
    kind: JointKind = JointKind.REVOLUTE

    @property
    def senses(self) -> tuple[str, str]:
        """Positive and negative direction without side and group: ``('flexion', 'extension')``."""
        start = self.name.index(self.group) + len(self.group) + 1
        return self.name[start:], self.opposite[start:]


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

_SPINE_BONES = ("pelvis", "lumbar", "thorax", "neck", "head")
_LIMB_BONES = (
    ("thorax", ("clavicle", "upper_arm", "forearm", "hand")),
    ("pelvis", ("thigh", "shank", "foot", "toes")),
)


def _parents() -> dict[str, str]:
    parents = dict(zip(_SPINE_BONES, (ROOT, *_SPINE_BONES), strict=False))
    for start, bones in _LIMB_BONES:
        for side in SIDES:
            names = [f"{side}_{bone}" for bone in bones]
            parents |= dict(zip(names, (start, *names), strict=False))
    return parents


PARENTS: dict[str, str] = _parents()
"""Bone → parent, depth first: physics engines keep this order of bodies and joints."""

BONES: tuple[str, ...] = tuple(PARENTS)
"""The 21 bones in the order of the description's links, each after its parent."""


@cache
def without_side(bone: str) -> str:
    """``upper_arm`` of ``left_upper_arm``."""
    return bone.removeprefix("right_").removeprefix("left_")


# Per joint: bone, group, then axis, positive and negative sense on the right side. On the left side the
# senses of X and Y change places: mirroring in the sagittal plane turns these two axes round.
_SPINE = (
    (Z, "extension", "flexion"),
    (X, "bend_right", "bend_left"),
    (Y, "turn_left", "turn_right"),
)
_LIMBS: tuple[tuple[str, str, tuple[tuple[tuple[float, float, float], str, str], ...]], ...] = (
    ("clavicle", "clavicle", ((X, "depression", "elevation"), (Y, "protraction", "retraction"))),
    (
        # Order Z, Y, X: the one whose singular poses (arm in the sagittal plane, turned inward or outward
        # by 90°) are neither hanging (Y-X-Y), nor reaching forward (X-Z-Y), nor the T-pose (Z-X-Y).
        "upper_arm",
        "shoulder",
        (
            (Z, "flexion", "extension"),
            (Y, "internal_rotation", "external_rotation"),
            (X, "adduction", "abduction"),
        ),
    ),
    ("forearm", "elbow", ((Z, "flexion", "extension"), (Y, "pronation", "supination"))),
    ("hand", "wrist", ((Z, "flexion", "extension"), (X, "ulnar_deviation", "radial_deviation"))),
    (
        "thigh",
        "hip",
        (
            (Z, "flexion", "extension"),
            (X, "adduction", "abduction"),
            (Y, "internal_rotation", "external_rotation"),
        ),
    ),
    (
        "shank",
        "knee",
        ((Z, "extension", "flexion"), (Y, "internal_rotation", "external_rotation")),
    ),
    (
        "foot",
        "ankle",
        (
            (Z, "dorsiflexion", "plantarflexion"),
            (X, "inversion", "eversion"),
            (Y, "internal_rotation", "external_rotation"),
        ),
    ),
    ("toes", "toes", ((Z, "extension", "flexion"),)),
)


def _axes() -> tuple[Axis, ...]:
    # Waist: where it is, then heading, list and tilt (Baker 2001), singular only when lying on a side.
    axes = [
        Axis("pelvis_x", "", "pelvis", "pelvis", X, JointKind.PRISMATIC),
        Axis("pelvis_y", "", "pelvis", "pelvis", (0.0, 0.0, -1.0), JointKind.PRISMATIC),
        Axis("pelvis_z", "", "pelvis", "pelvis", Y, JointKind.PRISMATIC),
        Axis("pelvis_turn_left", "pelvis_turn_right", "pelvis", "pelvis", Y),
        Axis("pelvis_list_right", "pelvis_list_left", "pelvis", "pelvis", X),
        Axis("pelvis_tilt_back", "pelvis_tilt_forward", "pelvis", "pelvis", Z),
    ]
    for bone in ("lumbar", "thorax", "neck", "head"):
        senses = _SPINE if bone != "head" else (_SPINE[0], _SPINE[2])
        axes += [Axis(f"{bone}_{plus}", f"{bone}_{minus}", bone, bone, a) for a, plus, minus in senses]
    limbs = {bone: (group, senses) for bone, group, senses in _LIMBS}
    for name in BONES:
        bone = without_side(name)
        if bone == name:
            continue
        side, (group, limb_senses) = name.removesuffix(f"_{bone}"), limbs[bone]
        for axis, plus, minus in limb_senses:
            first, second = (plus, minus) if side == "right" or axis == Z else (minus, plus)
            axes.append(Axis(f"{side}_{group}_{first}", f"{side}_{group}_{second}", name, group, axis))
    return tuple(axes)


AXES: tuple[Axis, ...] = _axes()
"""The six axes of the waist and the 47 joint axes, in the order of ``q``."""

JOINTS: tuple[str, ...] = tuple(axis.name for axis in AXES)
"""Names of the 53 degrees of freedom, in the order of ``q``."""


@cache
def _names() -> dict[str, tuple[tuple[int, float], ...]]:
    names: dict[str, tuple[tuple[int, float], ...]] = {}
    for index, axis in enumerate(AXES):
        names[axis.name] = ((index, 1.0),)
        if axis.opposite:
            names[axis.opposite] = ((index, -1.0),)
    for name in tuple(names):
        if name.startswith("right_"):
            both = name.replace("right_", "both_", 1)
            names[both] = names[name] + names[name.replace("right_", "left_", 1)]
    return names


def resolve(name: str) -> tuple[tuple[int, float], ...]:
    """Places in ``q`` and signs that a joint's name, its opposite or a ``both_`` name stands for.

    Raises:
        UnknownName: No axis of the person has that name.
    """
    try:
        return _names()[name]
    except KeyError:
        raise UnknownName("joint of a person", name, _names()) from None


MIRROR_INDEX = np.array(
    [
        next(
            j
            for j, b in enumerate(AXES)
            if (b.bone, b.axis)
            == (a.bone.replace("right", "?").replace("left", "right").replace("?", "left"), a.axis)
            and b.kind is a.kind
        )
        for a in AXES
    ]
)
MIRROR_SIGN = np.array(
    [
        (-1.0 if a.name == "pelvis_y" else 1.0)
        if a.kind is JointKind.PRISMATIC
        else (1.0 if a.axis == Z else -1.0)
        for a in AXES
    ]
)


def mirrored(q: ArrayLike) -> Array:
    """Mirror a posture in the sagittal plane of the root: left and right change places.

    Args:
        q: Joint values [rad, m], shape (..., 53).

    Returns:
        Joint values [rad, m], shape (..., 53).
    """
    return np.asarray(np.asarray(q, float)[..., MIRROR_INDEX] * MIRROR_SIGN)


def bone_poses(description: Description, q: ArrayLike) -> tuple[Array, Array]:
    """Forward kinematics: where every bone is.

    Args:
        description: A person made by `seerob.description.humans.manikin.build` (any other open tree without
        mimic
            joints works as well).
        q: Joint values [rad, m] in the order of ``description.joints()``, shape (..., n).

    Returns:
        Rotations ``root_from_bone``, shape (..., 21, 3, 3), and positions of the bones' origins in the
        root's frame [m], shape (..., 21, 3); in the order of the links without the root.
    """
    values = np.asarray(q, float)
    batch = values.shape[:-1]
    count = len(description.links) - 1
    rotations = np.empty((*batch, count, 3, 3))
    positions = np.empty((*batch, count, 3))
    known = {description.links[0].name: (np.broadcast_to(np.eye(3), (*batch, 3, 3)), np.zeros((*batch, 3)))}
    column = 0
    for index, link in enumerate(description.links[1:]):
        assert link.parent is not None  # only the first link has none
        rotation, position = known[link.parent]
        position = position + rotation @ link.parent_from_link[:3, 3]
        rotation = rotation @ link.parent_from_link[:3, :3]
        for joint in link.joints:
            value = values[..., column]
            column += 1
            if joint.kind is JointKind.PRISMATIC:
                position = position + (rotation @ joint.axis) * value[..., None]
            else:
                turned = rotation @ _rotation(joint.axis, value)
                position = position + (rotation - turned) @ joint.anchor
                rotation = turned
        known[link.name] = (rotation, position)
        rotations[..., index, :, :] = rotation
        positions[..., index, :] = position
    return rotations, positions


def _rotation(axis: Array, angle: Array) -> Array:
    """Rodrigues' formula, angle (...) [rad] → (..., 3, 3)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sine, versine = np.sin(angle)[..., None, None], (1 - np.cos(angle))[..., None, None]
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))
