"""A moving person as MVN sees one: the 23 segments of our own digital human, or those of a recording."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from seerob.core.samples import BodySample
from seerob.core.transforms import Array, wxyz_from_rotation
from seerob.description.capture.captured import Captured
from seerob.description.capture.fitting import Fitter, pulls
from seerob.description.description import Description
from seerob.description.humans import keyframes, manikin
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.devices.sources import bvh, mvnx
from seerob.protocols.tracking.mvn_pose import SEGMENTS
from seerob.workstation.source import Target

WORN = {
    "waist": "Pelvis",
    "chest": "T8",
    "left_foot": "LeftFoot",
    "right_foot": "RightFoot",
    "left_hand": "LeftHand",
    "right_hand": "RightHand",
    "left_elbow": "LeftForeArm",
    "right_elbow": "RightForeArm",
    "head": "Head",
}
"""Roles and the segments that they sit on."""
FIVE = ("waist", "left_foot", "right_foot", "left_hand", "right_hand")
"""The least with which a whole body is followed."""
ARMS = ("left_elbow", "right_elbow")
"""Of a person of whom only arms are followed."""
RATE = 120.0
"""Of keyframes [Hz]."""
_NAMES = {
    "Shoulder": "clavicle",
    "UpperArm": "upper_arm",
    "ForeArm": "forearm",
    "Hand": "hand",
    "UpperLeg": "thigh",
    "LowerLeg": "shank",
    "Foot": "foot",
    "Toe": "toes",
}
_SPINE = {
    "Pelvis": "pelvis",
    "L5": "lumbar",
    "L3": "lumbar",
    "T12": "thorax",
    "T8": "thorax",
    "Neck": "neck",
    "Head": "head",
}
_BETWEEN = {"L3": ("lumbar", "thorax"), "T8": ("thorax", "neck")}
"""Segments that begin half-way along one of our bones."""


class Pose(NamedTuple):
    """The 23 segments at an instant."""

    positions: Array
    """z up [m], shape (23, 3)."""
    wxyz: Array
    """World from segment, shape (23, 4)."""


Person = Callable[[float], Pose]
"""Pose at a time [s]."""


def _bone(segment: str) -> str:
    for side in ("Right", "Left"):
        if segment.startswith(side):
            return f"{side.lower()}_{_NAMES[segment.removeprefix(side)]}"
    return _SPINE[segment]


_ROWS = [BONES.index(_bone(segment)) for segment in SEGMENTS]


def segments(person: Description, q: Array) -> tuple[Array, Array]:
    """The segments of our digital human: each has the world's axes in the T-pose.

    Args:
        person: Made by `seerob.description.humans.manikin.build`.
        q: Joint values [rad, m], shape (..., 53).

    Returns:
        Positions [m], shape (..., 23, 3), and rotations, shape (..., 23, 3, 3).
    """
    rotations, origins = bone_poses(person, q)
    rest, _ = bone_poses(person, posture(person, "t_pose"))
    turned = rotations[..., _ROWS, :, :] @ np.swapaxes(rest[_ROWS], -1, -2)
    positions = origins[..., _ROWS, :].copy()
    for name, (lower, upper) in _BETWEEN.items():
        ends = origins[..., [BONES.index(lower), BONES.index(upper)], :]
        positions[..., SEGMENTS.index(name), :] = ends.mean(axis=-2)
    return positions, turned


def animated(file: str, *, folder: Path = Path(), person: Description | None = None) -> Person:
    """Somebody of medium size who does what keyframes say, again and again.

    Raises:
        InputError: The file is missing or wrong.
    """
    if person is None and file.startswith("library:"):
        return _of_library(file)
    return _posed(file, folder, person or _medium())


@cache
def _of_library(file: str) -> Person:
    return _posed(file, Path(), _medium())


def _medium() -> Description:
    return manikin.build(name="person", stature=1.75, mass=75.0, sex="male")


def _posed(file: str, folder: Path, someone: Description) -> Person:
    played = keyframes.sample(keyframes.read(file, someone, folder=folder), someone, RATE)
    return _of_postures(someone, played.t, played.q)


def recorded(path: Path) -> Person:
    """Who was recorded in an MVNX file, again and again.

    Raises:
        InputError: The file is missing or wrong.
    """
    return captured(mvnx.read(path))


def followed(path: Path, *, person: Description | None = None) -> Person:
    """Somebody of medium size who follows the joints of a BVH file, again and again.

    Raises:
        InputError: The file is missing or wrong, or its names are nobody's that is known.
    """
    someone = person or _medium()
    target = Target(name="person", joints=(), units=(), lower=(), upper=(), velocity=(), description=someone)
    opened = bvh.Bvh(human="person", file=path.name).open(path.parent, target)
    fitter = Fitter(someone)
    q: Array | None = None
    times, postures = [], []
    for sample in opened.samples:
        if not isinstance(sample, BodySample):
            continue
        q, _ = fitter.fit(pulls(sample.points, np.eye(4)), q)
        times.append(sample.t)
        postures.append(q)
    return _of_postures(someone, np.array(times), np.array(postures))


def captured(recording: Captured) -> Person:
    """The person of a recording whose rows begin with the 23 segments, again and again."""
    frames = list(recording.frames)
    t = np.array([frame.t for frame in frames]) - frames[0].t
    positions = np.stack([frame.positions[: len(SEGMENTS)] for frame in frames])
    turns = np.stack([np.asarray(frame.orientations)[: len(SEGMENTS)] for frame in frames])
    return _repeated(t, positions, turns)


def measured(person: Person, noise: float) -> Person:
    """Who moves, as a device measures it: what has no noise is taken for frozen.

    Args:
        person: Who moves.
        noise: Standard deviation of each coordinate [m], and of each direction [rad].
    """
    chance = np.random.default_rng(0)

    def pose(t: float) -> Pose:
        at = person(t)
        turns = at.wxyz + 0.5 * noise * chance.normal(size=at.wxyz.shape)
        turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
        return Pose(at.positions + noise * chance.normal(size=at.positions.shape), turns)

    return pose if noise else person


def _of_postures(person: Description, times: Array, q: Array) -> Person:
    positions, rotations = segments(person, q)
    turns = np.array([[wxyz_from_rotation(R) for R in row] for row in rotations])
    return _repeated(times, positions, turns)


def _repeated(times: Array, positions: Array, turns: Array) -> Person:
    """The nearest sample before; from the end it starts again."""
    duration = float(times[-1]) if len(times) > 1 else 0.0
    for shared in (positions, turns):
        shared.flags.writeable = False

    def pose(t: float) -> Pose:
        at = t % duration if duration else 0.0
        k = max(int(np.searchsorted(times, at + 1e-9, side="right")) - 1, 0)
        return Pose(positions[k], turns[k])

    return pose
