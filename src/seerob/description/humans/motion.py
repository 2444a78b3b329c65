r"""A motion between postures: smooth, within the limits, with the feet on the floor.

Between keys each joint follows the cubic Hermite spline with the slopes of Fritsch and Butland (1984;
"pchip"), and starts and ends at rest: its velocity is continuous, and where the keys rise it rises, so it
never leaves the range of two neighbouring keys and thus never a limit.

The pelvis' height is not interpolated but follows from the legs: at every instant the lowest sole is on
the floor. Its velocity may jump when the weight passes from one edge of a sole to another.
With `Travel.FEET` the pelvis also moves over the floor so that the point that touches it does not slide.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.description.description import Description
from seerob.description.humans.posture import HEIGHT, sole_corners
from seerob.description.humans.skeleton import bone_poses

FINENESS = 8
"""Instants per sample at which floor contact is followed."""


class Travel(StrEnum):
    """How the pelvis gets over the floor."""

    KEYS = "keys"
    """As the keys' positions say; feet may slide."""
    FEET = "feet"
    """On top of the keys' positions, so that the point of the foot that carries stays where it is."""


class Sampled(NamedTuple):
    """A motion at a fixed rate."""

    t: Array
    """Instants from 0 [s], shape (n,)."""
    q: Array
    """Joint values [rad, m], shape (n, 53)."""
    qd: Array
    """Their velocities [rad/s, m/s], shape (n, 53)."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Postures at instants."""

    title: str
    note: str
    """What it is not: ``schematic``."""
    t: Array
    """Instants of the keys from 0 [s], shape (k,), strictly increasing, k >= 1."""
    q: Array
    """Joint values at the keys [rad, m], shape (k, 53)."""
    floor: bool = True
    """Keep the lowest sole on the floor; else the pelvis' height is interpolated like a joint."""
    travel: Travel = Travel.KEYS

    @property
    def duration(self) -> float:
        """From the first to the last key [s]."""
        return float(self.t[-1] - self.t[0])


def interpolated(keys_t: Array, keys_q: Array, t: Array) -> tuple[Array, Array]:
    """Values and velocities, each (n, m), of keys (k,), (k, m) at instants (n,) within their span."""
    if len(keys_t) == 1:
        return np.repeat(keys_q, len(t), axis=0), np.zeros((len(t), keys_q.shape[1]))
    width = np.diff(keys_t)[:, None]
    chord = np.diff(keys_q, axis=0) / width
    slopes = np.zeros_like(keys_q)
    slopes[1:-1] = _between(width, chord)
    bend = (slopes[:-1] + slopes[1:] - 2 * chord) / width
    cubic = (keys_q[:-1], slopes[:-1], (chord - slopes[:-1]) / width - bend, bend / width)
    # Rounding may leave the range of the keys by the last bit; a limit is a limit.
    after = np.clip(np.searchsorted(keys_t, t, side="right"), 1, len(keys_t) - 1)
    low = np.minimum(keys_q[after - 1], keys_q[after])
    high = np.maximum(keys_q[after - 1], keys_q[after])
    x = (t - keys_t[after - 1])[:, None]
    a, b, c, d = (each[after - 1] for each in cubic)
    return np.clip(a + b * x + c * (x * x) + d * (x * x * x), low, high), b + c * x * 2 + d * (x * x) * 3


def _between(width: Array, chord: Array) -> Array:
    """Slopes at the inner keys (k - 2, m) of chords (k - 1, m), with which nothing is passed beyond a key.

    The weighted harmonic mean of both chords (Fritsch and Butland 1984), 0 where they differ in sign.
    """
    before, after = chord[:-1], chord[1:]
    w1, w2 = 2 * width[1:] + width[:-1], width[1:] + 2 * width[:-1]
    onward = np.sign(before) * np.sign(after) > 0
    mean = (w1 / np.where(onward, before, 1.0) + w2 / np.where(onward, after, 1.0)) / (w1 + w2)
    return np.where(onward, 1.0 / np.where(onward, mean, 1.0), 0.0)


def sample(motion: Motion, description: Description, rate: float) -> Sampled:
    """The motion at a rate [1/s]; the last sample is at the last key or less than 1/rate after it."""
    count = int(np.ceil(motion.duration * rate - 1e-9)) + 1
    t = np.arange(count) / rate
    following = motion.floor or motion.travel is Travel.FEET
    fine = FINENESS if following else 1
    instants = np.arange((count - 1) * fine + 1) / (rate * fine)
    within = np.minimum(motion.t[0] + instants, motion.t[-1])
    q, qd = interpolated(motion.t, motion.q, within)
    if following:
        moved = q[:, :3] + _carried(description, q, floor=motion.floor, travel=motion.travel)
        q[:, :3] = moved
        if count > 1:
            qd[:, :3] = np.gradient(moved, instants, axis=0)
    return Sampled(t, q[::fine], qd[::fine])


def _carried(description: Description, q: Array, *, floor: bool, travel: Travel) -> Array:
    """What to add to the pelvis' position in the root's axes [m], (n, 3), for the feet to carry it."""
    placed = q.copy()
    if floor:
        placed[:, HEIGHT] = 0.0
    rotations, positions = bone_poses(description, placed)
    corners, centers, owners = sole_corners(description, rotations, positions)
    lowest = corners[..., 2].argmin(axis=1)
    rows = np.arange(len(q))
    added = np.zeros((len(q), 3))
    if floor:
        added[:, 2] = -q[:, HEIGHT] - corners[rows, lowest, 2]
    if travel is Travel.FEET and len(q) > 1:
        added[1:, :2] = -np.cumsum(_slips(rotations, corners, centers, owners, lowest), axis=0)
    return added


def _slips(
    rotations: Array, corners: Array, centers: Array, owners: NDArray[np.intp], lowest: NDArray[np.intp]
) -> Array:
    """Way over the floor of the touching point from one instant to the next [m], shape (n - 1, 2)."""
    rows = np.arange(len(lowest) - 1)
    which = lowest[:-1]
    bone = owners[which]
    arm = corners[rows, which] - centers[rows, which]  # from the core's corner down to the floor
    turned = rotations[rows + 1, bone] @ np.swapaxes(rotations[rows, bone], -1, -2)
    after = centers[rows + 1, which] + (turned @ arm[..., None])[..., 0]
    return np.asarray((after - corners[rows, which])[:, :2])
