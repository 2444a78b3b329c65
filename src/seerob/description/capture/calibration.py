r"""Calibration in a known pose: how every sensor is mounted on its bone.

The person stands in the pose, so every bone is known but for where the person stands and faces, which
follows from the positions (a fit of shift and heading). Then

.. math:: T_{bone,sensor} = T_{bone}^{-1} T_{sensor}

of the mean over the window. What is left is told: how far the sensors moved meanwhile, how far they are
from where they are expected, and by how much their mounting differs from the one that the device states.
A difference near 90° or 180° about an axis is a sensor that was put on wrongly, and is named.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.description.capture.captured import CaptureFrame, Seen
from seerob.description.capture.observing import OWN_PLACE, Observer
from seerob.description.description import Description
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses

STILL = 0.02, np.radians(5.0)
"""A person who moves no more [m, rad] stands still."""
FAR = 0.15
"""A sensor farther from where it is expected [m] is on another bone, or the person stands differently."""
SPREAD = 0.1
"""Positions that are nearer to one another [m] do not tell where the person faces."""
QUARTER = np.radians(30.0)
"""A mounting this near to a quarter turn or a half turn was meant to be none."""
SMALL = np.radians(30.0)
"""A mounting that differs by less is how a person wears it."""


class CalibrationPose(StrEnum):
    """How the person stands while the sensors are calibrated."""

    NONE = "none"
    """No calibration: what the device states is believed."""
    NPOSE = "npose"
    """Upright, arms hanging, palms to the thighs, thumbs forward."""
    TPOSE = "tpose"
    """Upright, arms horizontal to the sides, palms down."""


POSTURES: dict[str, str | dict[str, float]] = {
    CalibrationPose.NPOSE: {"both_elbow_pronation_deg": 90.0},
    CalibrationPose.TPOSE: "t_pose",
}


@dataclass(frozen=True, eq=False)
class Residual:
    """What a calibration left of one sensor."""

    name: str
    bone: str
    moved: float
    """How far it moved during the window [m], root mean square."""
    swayed: float
    """How far it turned during the window [rad], root mean square; NaN without orientations."""
    off: float
    """From where it is expected on the person [m]."""
    turn: float
    """Between its mounting and the one that the device states [rad]; NaN when it states none."""
    axis: str
    """Axis of the device's segment nearest to that turn's: ``x``, ``y`` or ``z``; empty for no turn."""


@dataclass(frozen=True, eq=False)
class Calibrated:
    """What a calibration found."""

    mounts: dict[int, tuple[Array, Array]]
    """Row of the layout → ``segment_from_bone`` (3, 3) and where it is in the bone's frame [m] (3,)."""
    residuals: tuple[Residual, ...]
    heading: float
    """Where the person faced in the device's world, about z from x [rad]."""
    findings: tuple[Finding, ...]
    places: dict[str, Array]
    """Name of what devices place as they like → where it is in the bone's frame [m], (3,)."""
    taller: float | None = None
    """How many times as high as that of the person of the file the head was over z = 0 of the device's world;
    None when it was not seen."""


def calibrate(
    frames: Sequence[CaptureFrame],
    observer: Observer,
    description: Description,
    pose: CalibrationPose,
    *,
    seen: Seen,
    subject: str,
) -> Calibrated:
    """Find how sensors are mounted from frames of a person in a known pose.

    Args:
        frames: Of the window, in the device's world.
        observer: Rows of the device bound to bones; where a device states it, with its mounting.
        description: The person.
        pose: The pose.
        seen: What the rows are; of trackers the place on the bone is found too.
        subject: Whom findings are about.

    Raises:
        InputError: No frame, or none of the sensors was seen in it.
    """
    if not frames:
        raise InputError.at(subject, "calibration", "no frame in its window", "give another window")
    rotations, positions = bone_poses(description, posture(description, POSTURES[pose]))
    bones = [BONES.index(row.bone) for row in observer.rows]
    index = [row.index for row in observer.rows]
    stack = np.array([np.asarray(f.positions, float)[index] for f in frames])
    found = np.array([_mean(stack[:, i]) for i in range(len(index))])
    if not np.isfinite(found).all(axis=1).any():
        raise InputError.at(subject, "calibration", "no sensor was seen in its window", "give another one")
    expected = positions[bones] + np.einsum("nij,nj->ni", rotations[bones], [r.at for r in observer.rows])
    heading, shift, assumptions = _stance(found, expected, observer)
    turn = np.array(
        [[np.cos(heading), -np.sin(heading), 0], [np.sin(heading), np.cos(heading), 0], [0, 0, 1]]
    )
    mounts: dict[int, tuple[Array, Array]] = {}
    places: dict[str, Array] = {}
    residuals = []
    for k, row in enumerate(observer.rows):
        world_from_bone = turn @ rotations[bones[k]]
        segment, swayed = _mean_rotation(frames, row.index)
        away = found[k] - (turn @ expected[k] + shift)
        at = row.at
        if (seen is Seen.TRACKERS or row.fitted) and np.isfinite(away).all():
            at = row.at + world_from_bone.T @ away
            if row.fitted and np.linalg.norm(away) <= OWN_PLACE:
                places[row.name] = at
        angle, axis = np.nan, ""
        if segment is not None:
            mount = segment.T @ world_from_bone
            if row.segment_from_bone is not None:
                angle, axis = _difference(mount @ row.segment_from_bone.T)
            mounts[row.index] = mount, at
        moved = _spread(stack[:, k], found[k])
        off = float(np.linalg.norm(away))
        residuals.append(Residual(row.name, row.bone, moved, swayed, off, angle, axis))
    findings = (*assumptions, *_tell(residuals, pose, heading, subject))
    heads = [k for k, row in enumerate(observer.rows) if row.bone == "head" and np.isfinite(found[k]).all()]
    taller = float(found[heads[0], 2] / expected[heads[0], 2]) if heads else None
    return Calibrated(mounts, tuple(residuals), heading, findings, places, taller)


def _mean(points: Array) -> Array:
    """Average the points that were seen, of those given (n, 3); NaN when none was."""
    seen = points[np.isfinite(points).all(axis=1)]
    return np.asarray(seen.mean(axis=0)) if len(seen) else np.full(3, np.nan)


def _spread(points: Array, middle: Array) -> float:
    seen = points[np.isfinite(points).all(axis=1)]
    return float(np.sqrt(((seen - middle) ** 2).sum(axis=1).mean())) if len(seen) else np.nan


def _mean_rotation(frames: Iterable[CaptureFrame], index: int) -> tuple[Array | None, float]:
    """Mean rotation of a segment (chordal), and the root mean square angle about it [rad]."""
    rows = [f.orientations[index] for f in frames if f.orientations is not None]
    known = [row for row in rows if np.isfinite(row).all() and np.linalg.norm(row) > 0]
    if not known:
        return None, np.nan
    rotations = rotation_from_wxyz(np.array(known))
    u, _, vt = np.linalg.svd(rotations.mean(axis=0))
    mean = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    cosine = (np.einsum("nij,ij->n", rotations, mean) - 1) / 2
    return mean, float(np.sqrt((np.arccos(np.clip(cosine, -1, 1)) ** 2).mean()))


def _stance(found: Array, expected: Array, observer: Observer) -> tuple[float, Array, tuple[Finding, ...]]:
    """Heading [rad] and place [m] (3,) that bring the expected points to those found, least squares."""
    use = np.isfinite(found).all(axis=1)
    a, b = expected[use], found[use]
    weight = np.array([1e-6 if row.fitted else max(row.position, 1e-6) for row in observer.rows])[use, None]
    weight = weight / weight.sum()
    ma, mb = (weight * a).sum(axis=0), (weight * b).sum(axis=0)
    da, db = a - ma, b - mb
    assumptions: tuple[Finding, ...] = ()
    heading = 0.0
    if np.sqrt((weight * da[:, :2] ** 2).sum()) < SPREAD:
        text = "calibration: the sensors are too near to each other to tell the heading; facing x is assumed"
        assumptions = (Finding(level="assumed", subject=observer.rows[0].name, text=text),)
    else:
        across = (weight[:, 0] * (da[:, 0] * db[:, 1] - da[:, 1] * db[:, 0])).sum()
        along = (weight[:, 0] * (da[:, 0] * db[:, 0] + da[:, 1] * db[:, 1])).sum()
        heading = float(np.arctan2(across, along))
    c, s = np.cos(heading), np.sin(heading)
    return heading, mb - np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ ma, assumptions


def _difference(rotation: Array) -> tuple[float, str]:
    """Angle of a rotation [rad] and the axis of the frame that is nearest to its own."""
    angle = float(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1)))
    if angle < 1e-6:
        return angle, ""
    # (R + R^T)/2 = cos I + (1 - cos) aa^T: its diagonal has the squares of the axis, also at half a turn.
    squares = (np.diag(rotation) - np.cos(angle)) / (1 - np.cos(angle))
    return angle, "xyz"[int(squares.argmax())]


def mounted_wrongly(turn: float) -> str:
    """``a quarter turn`` or ``half a turn`` when a mounting is nearer to that than to none; else empty."""
    if abs(turn - np.pi / 2) < QUARTER:
        return "a quarter turn"
    return "half a turn" if abs(turn - np.pi) < QUARTER else ""


def _tell(
    residuals: Iterable[Residual], pose: CalibrationPose, heading: float, subject: str
) -> Iterable[Finding]:
    every = tuple(residuals)

    def say(text: str, level: str = "note") -> Finding:
        return Finding(level=level, subject=subject, text=f"calibration ({pose}): {text}")

    offs = [r.off for r in every if np.isfinite(r.off)]
    yield say(
        f"{len(every)} sensors, {np.median(offs) * 1e3:.0f} mm median and {max(offs) * 1e3:.0f} mm largest "
        f"distance from where they are expected; heading {np.degrees(heading):.0f}°"
    )
    for r in every:
        turned = "" if np.isnan(r.turn) else f", mounting {np.degrees(r.turn):.0f}° from the stated one"
        yield say(f"{r.name} on {r.bone}: {r.off * 1e3:.0f} mm off, moved {r.moved * 1e3:.0f} mm{turned}")
        if r.moved > STILL[0] or r.swayed > STILL[1]:
            yield say(f"{r.name} moved during it: stand still, or give another window", "warning")
        if r.off > FAR:
            yield say(
                f"{r.name} is {r.off:.2f} m from where {r.bone} should be: other bone or pose?", "warning"
            )
        if not np.isnan(r.turn) and r.turn > SMALL and (wrong := mounted_wrongly(r.turn)):
            text = (
                f"{r.name} on {r.bone} is mounted {wrong} ({np.degrees(r.turn):.0f}°) about its {r.axis} axis"
            )
            yield say(f"{text}; the calibration makes up for it", "warning")
