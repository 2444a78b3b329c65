"""What Xsens MVN's segment frames mean: how they lie in the bones, and the joint angles that follow.

A segment's frame is the world's in the T-pose: x forward, y left, z up, arms to the sides. Segments of other
files (MVN 4.2, MVNX 3) have the anatomical frames themselves, with z along an arm. In an MVNX file
the frame ``tpose`` has the orientations in that pose, and ``tpose-isb`` those of the anatomical frames, which
are the world's when the arms hang with the palms forward. So the anatomical frame is

    R = R_segment R_tpose^T R_tpose_isb

and the angles of a joint are those of :math:`R_{parent}^T R_{child}` in ISB axes (X forward, Y up, Z right)
in the order Z, X, Y. That this gives the joint angles of a file was tried on a real one (MVN 2019,
11 sensors): within 0.01° away from the singular pose; and that segments are the anatomical frames, on one of
MVN 4.2.4 (17 sensors): within 0.03°. Which way each angle counts is Xsens' clinical convention.
"""

from __future__ import annotations

import numpy as np

from seerob.core.transforms import Array, product, rotation_from_wxyz
from seerob.protocols.tracking.mvn_pose import JOINTS, SEGMENTS

ISB_AXES: Array = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Columns: the ISB's X, Y, Z in axes with x forward, y left, z up."""

_HALF = np.sqrt(0.5)
_ISB = {
    "RightUpperArm": (_HALF, -_HALF, 0.0, 0.0),
    "RightForeArm": (0.5, -0.5, 0.5, 0.5),
    "RightHand": (0.5, -0.5, 0.5, 0.5),
    "LeftUpperArm": (_HALF, _HALF, 0.0, 0.0),
    "LeftForeArm": (0.5, 0.5, 0.5, -0.5),
    "LeftHand": (0.5, 0.5, 0.5, -0.5),
}
ISB_TPOSE: Array = np.array([_ISB.get(name, (1.0, 0.0, 0.0, 0.0)) for name in SEGMENTS])
"""Anatomical frames in the ideal T-pose, where every segment's is the world's: w first, shape (23, 4)."""

FROM_ANATOMICAL: Array = ISB_TPOSE * (1.0, -1.0, -1.0, -1.0)
"""Anatomical from ideal segment, which has the world's axes in the T-pose: w first, shape (23, 4)."""

_PARENT = np.array([SEGMENTS.index(parent) for _, parent, _ in JOINTS])
_CHILD = np.array([SEGMENTS.index(child) for _, _, child in JOINTS])


def _sign(label: str) -> tuple[float, float, float]:
    """About x (outward, to the right), y (inward, to the left) and z (flexion)."""
    if label.startswith("jRight"):
        return -1.0, 1.0, -1.0 if label.endswith("Knee") else 1.0
    if label.startswith("jLeft"):
        return 1.0, -1.0, -1.0 if label.endswith("Knee") else 1.0
    return 1.0, 1.0, -1.0


SIGNS: Array = np.array([_sign(label) for label, _, _ in JOINTS])
"""Xsens' angle over the ISB's, about x, y and z, shape (22, 3)."""


def anatomical(wxyz: Array) -> Array:
    """World from anatomical frames, which are ours: the ISB's, alike when the palms look forward.

    Args:
        wxyz: World from segment in the order of `SEGMENTS`, w first, shape (..., 23, 4).

    Returns:
        Rotations, shape (..., 23, 3, 3).
    """
    return np.asarray(rotation_from_wxyz(wxyz) @ rotation_from_wxyz(ISB_TPOSE) @ ISB_AXES)


def correction(tpose: Array, tpose_isb: Array) -> tuple[Array, float]:
    """What turns segment frames into those that are the world's in the ideal T-pose.

    The anatomical frame of a file, :math:`R R_{tpose}^T R_{tpose,isb}`, is that of `anatomical` without a
    T-pose when the segment is turned on its own side by :math:`C = R_{tpose}^T R_{tpose,isb} R_{ideal}^T`.

    Args:
        tpose: Segments in the T-pose, w first, shape (23, 4).
        tpose_isb: Anatomical frames there, shape (23, 4).

    Returns:
        Segment from ideal segment, w first, shape (23, 4), and the largest turn among them [rad].
    """
    flip = np.array([1.0, -1.0, -1.0, -1.0])
    turn = product(product(tpose * flip, tpose_isb), ISB_TPOSE * flip)
    turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    largest = 2 * np.arctan2(np.linalg.norm(turn[:, 1:], axis=1), np.abs(turn[:, 0])).max()
    return turn, float(largest)


_ARMS = [
    (SEGMENTS.index(f"{side}{part}"), SEGMENTS.index(f"{side}{following}"), aside)
    for side, aside in (("Right", -1.0), ("Left", 1.0))
    for part, following in (("UpperArm", "ForeArm"), ("ForeArm", "Hand"))
]


def beside_arms(positions: Array, wxyz: Array) -> Array:
    """How far the arms' segments are from pointing along the arms, with frames of the world's T-pose [rad].

    Args:
        positions: Origins of segments, in any unit, shape (n, 23, 3).
        wxyz: World from segment, w first, shape (n, 23, 4).

    Returns:
        Both upper arms and forearms, shape (n, 4).
    """
    R = rotation_from_wxyz(wxyz)
    angles = []
    for part, following, aside in _ARMS:
        way = np.einsum("nji,nj->ni", R[:, part], positions[:, following] - positions[:, part])
        angles.append(np.arctan2(np.hypot(way[:, 0], way[:, 2]), aside * way[:, 1]))
    return np.stack(angles, axis=1)


def joint_angles(rotations: Array) -> Array:
    """Angles of the joints as Xsens gives them.

    Args:
        rotations: Of `anatomical`, shape (..., 23, 3, 3).

    Returns:
        Abduction or bend, rotation, flexion [rad] in the order of `JOINTS`, shape (..., 22, 3).
    """
    relative = np.swapaxes(rotations[..., _PARENT, :, :], -1, -2) @ rotations[..., _CHILD, :, :]
    # R = Rz(c) Rx(a) Ry(b)
    a = np.arcsin(np.clip(relative[..., 2, 1], -1.0, 1.0))
    b = np.arctan2(-relative[..., 2, 0], relative[..., 2, 2])
    c = np.arctan2(-relative[..., 0, 1], relative[..., 1, 1])
    return np.stack([a, b, c], axis=-1) * SIGNS


def turns(angles: Array) -> Array:
    """Parent from child of joint angles, shapes (..., 22, 3) [rad] → (..., 22, 3, 3).

    Near a quarter turn of abduction two of the three angles are not determined, the turn is.
    """
    (ca, cb, cc), (sa, sb, sc) = (np.moveaxis(f(angles * SIGNS), -1, 0) for f in (np.cos, np.sin))
    rows = [
        [cc * cb - sc * sa * sb, -sc * ca, cc * sb + sc * sa * cb],
        [sc * cb + cc * sa * sb, cc * ca, sc * sb - cc * sa * cb],
        [-ca * sb, sa, ca * cb],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def differences(rotations: Array, angles: Array) -> Array:
    """How far joint angles are from those of the segments [rad], each a single turn.

    Args:
        rotations: Of `anatomical`, shape (..., 23, 3, 3).
        angles: As Xsens gives them [rad], shape (..., 22, 3).

    Returns:
        Shape (..., 22).
    """
    off = np.swapaxes(turns(angles), -1, -2) @ turns(joint_angles(rotations))
    cosine = (np.trace(off, axis1=-2, axis2=-1) - 1) / 2
    sine = np.stack(
        [off[..., 2, 1] - off[..., 1, 2], off[..., 0, 2] - off[..., 2, 0], off[..., 1, 0] - off[..., 0, 1]],
        -1,
    )
    return np.asarray(np.arctan2(np.linalg.norm(sine, axis=-1) / 2, cosine))
