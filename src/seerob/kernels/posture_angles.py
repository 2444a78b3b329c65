"""From rotations and joints of bones to sines and tangents of a posture's angles, and these in their ranges.

Arctangent and arcsine, which lie between, are NumPy's.

A sum of three products is taken in one order only: a posture has the same angles alone and among others.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Indices = NDArray[np.int64]

TANGENTS, SINES, ANGLES = 24, 14, 36
"""Numbers of a posture."""
TINY = 1e-9
LEAST = 1e-6
"""Directions that are shorter are rounding."""
PELVIS, THORAX, HEAD, CLAVICLE, UPPER_ARM, FOREARM, HAND, THIGH, SHANK, FOOT = (
    0, 1, 2, 3, 5, 7, 9, 11, 13, 15,
)  # fmt: skip
"""Places in a list of bones; of those that there are two of the right one, and the left one is next."""
PLACES = 17


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _from(R: Array, parent: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A direction of the world in the frame of a bone."""
    return (
        0.0 + R[parent, 0, 0] * x + R[parent, 1, 0] * y + R[parent, 2, 0] * z,
        0.0 + R[parent, 0, 1] * x + R[parent, 1, 1] * y + R[parent, 2, 1] * z,
        0.0 + R[parent, 0, 2] * x + R[parent, 1, 2] * y + R[parent, 2, 2] * z,
    )


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _entry(R: Array, parent: int, i: int, child: int, j: int) -> float:
    """An entry of the rotation of a bone in the frame of another."""
    found: float = (
        0.0
        + R[parent, 0, i] * R[child, 0, j]
        + R[parent, 1, i] * R[child, 1, j]
        + R[parent, 2, i] * R[child, 2, j]
    )
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _twist(R: Array, parent: int, child: int, tangent: Array) -> None:
    """Rotation of a child about its long axis Y, without the swing of that axis."""
    tangent[0] = _entry(R, parent, 0, child, 2) - _entry(R, parent, 2, child, 0)
    tangent[1] = _entry(R, parent, 0, child, 0) + _entry(R, parent, 2, child, 2)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _folded(x: float, y: float, z: float, tangent: Array) -> None:
    """Of a direction, how far it is from straight down."""
    tangent[0], tangent[1] = math.hypot(x, z), -y


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _slope(x: float, y: float, z: float, tangent: Array) -> None:
    """Of a direction, how far it is above the horizontal."""
    tangent[0], tangent[1] = z, math.hypot(x, y)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _length(x: float, y: float, z: float) -> float:
    """At least `TINY`; what is not a number stays so."""
    found = math.sqrt((0.0 + x * x + z * z) + y * y)
    return TINY if found < TINY else found


@njit(cache=True, nogil=True, error_model="numpy")
def directions(rotations: Array, positions: Array, bones: Indices, tangents: Array, sines: Array) -> None:
    """Sines and tangents of the angles of postures, sided ones right before left.

    Args:
        rotations: World from bone, shape (n, b, 3, 3); z of the world is up.
        positions: Proximal joints of the bones in the world [m], shape (n, b, 3).
        bones: Where each bone is among these, in the order of `PELVIS` to `FOOT`, shape (17,).
        tangents: Receives both arguments of the arctangent, shape (n, 24, 2): of flexion and twist of the
            trunk, those of the neck, flexion, elevation and rotation of the shoulder, slopes of the upper arm
            and from shoulder to wrist, elbow, rotation of the forearm, flexion of the wrist, knee and tilt of
            the shank.
        sines: Receives those of the side bends of trunk and neck, abduction, clavicle, forearm out, wrist
            across, deviation and rise of the foot, -1 to 1, shape (n, 14).
    """
    pelvis, thorax, head = bones[PELVIS], bones[THORAX], bones[HEAD]
    for n in range(len(rotations)):
        R, p, tangent, sine = rotations[n], positions[n], tangents[n], sines[n]
        # The heading comes from the axis to the right, not from the one forward, which points down when
        # somebody bends over. Somebody who lies on a side has none: not a number.
        length = math.hypot(R[pelvis, 0, 2], R[pelvis, 1, 2])
        if not length > LEAST:
            length = np.nan
        x, y = R[pelvis, 0, 2] / length, R[pelvis, 1, 2] / length
        tangent[0, 0] = -y * R[thorax, 0, 1] + x * R[thorax, 1, 1]
        tangent[0, 1] = R[thorax, 2, 1]
        sine[0] = x * R[thorax, 0, 1] + y * R[thorax, 1, 1]
        _twist(R, pelvis, thorax, tangent[1])
        tangent[2, 0], tangent[2, 1], sine[1] = _from(R, thorax, R[head, 0, 1], R[head, 1, 1], R[head, 2, 1])
        _twist(R, thorax, head, tangent[3])
        right, left = p[bones[FOOT], 2], p[bones[FOOT + 1], 2]
        lower = left if left < right or np.isnan(left) else right  # not a number where one is none
        for side in range(2):
            outward = 1.0 - 2.0 * side
            clavicle, upper, fore = bones[CLAVICLE + side], bones[UPPER_ARM + side], bones[FOREARM + side]
            hand, thigh, shank = bones[HAND + side], bones[THIGH + side], bones[SHANK + side]
            x, y, z = _from(R, thorax, -R[upper, 0, 1], -R[upper, 1, 1], -R[upper, 2, 1])
            tangent[4 + side, 0], tangent[4 + side, 1] = x, -y
            _folded(x, y, z, tangent[6 + side])
            sine[2 + side] = outward * z
            _twist(R, thorax, upper, tangent[8 + side])
            _, y, _ = _from(
                R,
                thorax,
                R[clavicle, 0, 2] * outward,
                R[clavicle, 1, 2] * outward,
                R[clavicle, 2, 2] * outward,
            )
            sine[4 + side] = y
            _, _, z = _from(R, thorax, -R[fore, 0, 1], -R[fore, 1, 1], -R[fore, 2, 1])
            sine[6 + side] = outward * z
            _slope(
                p[fore, 0] - p[upper, 0],
                p[fore, 1] - p[upper, 1],
                p[fore, 2] - p[upper, 2],
                tangent[10 + side],
            )
            x, y, z = p[hand, 0] - p[upper, 0], p[hand, 1] - p[upper, 1], p[hand, 2] - p[upper, 2]
            _slope(x, y, z, tangent[12 + side])
            across = (
                0.0
                + (p[hand, 0] - p[thorax, 0]) * R[thorax, 0, 2]
                + (p[hand, 1] - p[thorax, 1]) * R[thorax, 1, 2]
                + (p[hand, 2] - p[thorax, 2]) * R[thorax, 2, 2]
            )
            sine[8 + side] = -outward * across / _length(x, y, z)
            x, y, z = _from(R, upper, -R[fore, 0, 1], -R[fore, 1, 1], -R[fore, 2, 1])
            _folded(x, y, z, tangent[14 + side])
            _twist(R, upper, fore, tangent[16 + side])
            x, y, z = _from(R, fore, -R[hand, 0, 1], -R[hand, 1, 1], -R[hand, 2, 1])
            tangent[18 + side, 0], tangent[18 + side, 1] = x, -y
            sine[10 + side] = -outward * z
            x, y, z = _from(R, thigh, -R[shank, 0, 1], -R[shank, 1, 1], -R[shank, 2, 1])
            _folded(x, y, z, tangent[20 + side])
            tangent[22 + side, 0] = math.hypot(R[shank, 0, 1], R[shank, 1, 1])
            tangent[22 + side, 1] = R[shank, 2, 1]
            foot = bones[FOOT + side]
            leg = _length(p[foot, 0] - p[thigh, 0], p[foot, 1] - p[thigh, 1], p[foot, 2] - p[thigh, 2])
            sine[12 + side] = (p[foot, 2] - lower) / leg
        for k in range(len(sine)):
            sine[k] = -1.0 if sine[k] < -1.0 else 1.0 if sine[k] > 1.0 else sine[k]


@njit(cache=True, nogil=True, error_model="numpy")
def in_range(turned: Array, tilted: Array, angles: Array) -> None:
    """Angles of postures, each in the range that it is spoken of in.

    Args:
        turned: Arctangents of what `directions` gives [rad], shape (n, 24).
        tilted: Arcsines likewise, shape (n, 14).
        angles: Receives the angles [rad], in the order of `seerob.description.humans.angles.Angles`, sided
            ones right and left, shape (n, 36).
    """
    pi = math.pi
    for n in range(len(turned)):
        turn, tilt, own = turned[n], tilted[n], angles[n]
        # Of the range -π to π of which the end is forward: upside down, whatever the last bit says.
        own[0] = turn[0] + 2 * pi if turn[0] < -pi + LEAST else turn[0]
        own[1], own[2] = tilt[0], turn[1]
        own[3], own[4], own[5] = turn[2], tilt[1], turn[3]
        for side in range(2):
            outward = 1.0 - 2.0 * side
            flexion = turn[4 + side]
            own[6 + side] = flexion + 2 * pi if flexion < -pi / 2 else flexion
            own[8 + side] = turn[6 + side]
            own[10 + side] = tilt[2 + side]
            own[12 + side] = outward * turn[8 + side]
            own[14 + side] = tilt[4 + side]
            elbow, wrist = turn[10 + side], turn[12 + side]
            own[16 + side] = elbow if elbow >= wrist or np.isnan(elbow) else wrist
            own[18 + side] = turn[14 + side]
            own[20 + side] = tilt[6 + side]
            own[22 + side] = tilt[8 + side]
            own[24 + side] = (outward * turn[16 + side] - pi / 2 + pi) % (2 * pi) - pi
            own[26 + side] = turn[18 + side]
            own[28 + side] = tilt[10 + side]
            own[30 + side] = turn[20 + side]
            own[32 + side] = turn[22 + side]
            own[34 + side] = tilt[12 + side]
