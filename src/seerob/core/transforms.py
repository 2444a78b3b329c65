"""Rigid transforms. They read right to left: ``world_from_tool = world_from_base @ base_from_tool``.

Positions are in metres, angles in radians, quaternions are unit and ordered w, x, y, z.

Orientation columns in any convention → unit quaternions, w first.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core.samples import LARGEST

EULER = re.compile(r"[XYZ]{3}|[xyz]{3}")

NAMED = {"rpy": 3, "rotation_vector": 3, "wxyz": 4, "xyzw": 4}
"""Conventions with a name and their number of columns."""

CONVENTIONS = (
    'three axes in the order of the columns, capital for the turned axes ("ZYX"), small for the fixed '
    'ones ("xyz"); "rpy" (= "xyz"), "rotation_vector", "wxyz" or "xyzw"'
)


def is_convention(convention: str) -> bool:
    """Whether a text is one of the conventions."""
    if convention in NAMED:
        return True
    return bool(EULER.fullmatch(convention)) and all(a != b for a, b in pairwise(convention))


def columns_of(convention: str) -> int:
    """Number of columns a convention needs."""
    return NAMED.get(convention, 3)


def wxyz_from(convention: str, values: Array) -> Array:
    """Unit quaternions with w >= 0.

    Args:
        convention: One of `CONVENTIONS`. ``"ZYX"`` on columns a, b, c is
            ``Rz(a) Ry(b) Rx(c)``; ``"xyz"`` on columns a, b, c is ``Rz(c) Ry(b) Rx(a)``.
        values: Angles [rad], rotation vectors [rad] or quaternions (any length but zero),
            shape (n, 3) or (n, 4).

    Returns:
        Shape (n, 4).

    Raises:
        ValueError: A value beyond all bounds, or a quaternion of length zero; the message names the sample.
    """
    far = (np.abs(values) > LARGEST).any(axis=1)
    if far.any():
        raise ValueError(f"orientation beyond {LARGEST:g} in sample {int(np.argmax(far))}")
    if convention in ("wxyz", "xyzw"):
        q = np.roll(values, 1, axis=1) if convention == "xyzw" else values
        length = np.linalg.norm(q, axis=1)
        if (length < 1e-9).any():
            raise ValueError(f"quaternion of length zero in row {int(np.argmin(length))}")
        q = q / length[:, None]
    elif convention == "rotation_vector":
        angle = np.linalg.norm(values, axis=1)
        # sin(a/2)/a is smooth at 0; numpy's sinc is sin(pi x)/(pi x).
        q = np.column_stack([np.cos(angle / 2), values * (np.sinc(angle / (2 * np.pi)) / 2)[:, None]])
    else:
        axes = "xyz" if convention == "rpy" else convention
        turns = [about(axis, values[:, i]) for i, axis in enumerate(axes.lower())]
        if axes.islower():
            turns = turns[::-1]
        q = product(product(turns[0], turns[1]), turns[2])
    return np.where(q[:, :1] < 0, -q, q)


def angles_from_rotation(order: str, rotation: ArrayLike) -> Array:
    """Angles of three successive turns about turned axes, the inverse of ``wxyz_from`` with capitals.

    Args:
        order: Three different axes: ``"ZYX"`` for ``Rz(a) Ry(b) Rx(c)``.
        rotation: Shape (..., 3, 3).

    Returns:
        a, b, c [rad], b within a quarter turn, shape (..., 3). Where b is a quarter turn only a + c or
        a - c is known, and c is 0.
    """
    R = np.asarray(rotation, float)
    i, j, k = ("XYZ".index(axis) for axis in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    cosine = np.hypot(R[..., i, i], R[..., i, j])
    locked = cosine < 1e-7
    a = np.where(
        locked,
        np.arctan2(sign * R[..., k, j], R[..., j, j]),
        np.arctan2(-sign * R[..., j, k], R[..., k, k]),
    )
    b = np.arctan2(sign * R[..., i, k], cosine)
    c = np.where(locked, 0.0, np.arctan2(-sign * R[..., i, j], R[..., i, i]))
    return np.stack([a, b, c], axis=-1)


def about(axis: str, angle: Array) -> Array:
    """Quaternions (n, 4) of turns (n,) [rad] about ``x``, ``y`` or ``z``."""
    q = np.zeros((len(angle), 4))
    q[:, 0] = np.cos(angle / 2)
    q[:, 1 + "xyz".index(axis)] = np.sin(angle / 2)
    return q


def product(p: Array, q: Array) -> Array:
    """Hamilton product of quaternions (n, 4), row by row."""
    pw, pv, qw, qv = p[:, :1], p[:, 1:], q[:, :1], q[:, 1:]
    w = pw * qw - np.sum(pv * qv, axis=1, keepdims=True)
    return np.hstack([w, pw * qv + qw * pv + cross(pv, qv)])


def length(v: Array) -> Array | float:
    """Length of vectors, shape (...), given (..., 3); a number, bit by bit the same, of a single one."""
    if v.ndim > 1:
        return np.asarray(np.sqrt(v[..., 0] ** 2 + v[..., 1] ** 2 + v[..., 2] ** 2))
    x, y, z = v.tolist()
    return math.sqrt(x * x + y * y + z * z)


def cross(a: Array, b: Array) -> Array:
    """Vector product of vectors (3,) or rows (n, 3): for a few several times faster than `numpy.cross`."""
    (a0, a1, a2), (b0, b1, b2) = a.T, b.T
    return np.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], axis=-1)


Array = NDArray[np.float64]
_VAST = 1e150
"""A component of a quaternion beyond this has no direction, and its square no number."""


def rotation_from_wxyz(wxyz: ArrayLike) -> Array:
    """Rotation matrix of a quaternion.

    Args:
        wxyz: Quaternion, w first, shape (..., 4); need not be normalised, must not be zero.

    Returns:
        Rotation matrix, shape (..., 3, 3).
    """
    quaternion = np.asarray(wxyz, float)
    w, x, y, z = np.moveaxis(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def wxyz_from_rotation(rotation: ArrayLike) -> Array:
    """Unit quaternion with w >= 0 of a rotation matrix.

    Args:
        rotation: Rotation matrix, shape (3, 3).

    Returns:
        Quaternion w, x, y, z, shape (4,).
    """
    return np.array(wxyz_from_rows(np.asarray(rotation, float).tolist()))


def wxyz_from_rows(m: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """Unit quaternion with w >= 0 of a rotation matrix, both of plain numbers.

    Args:
        m: Rotation matrix, row by row.

    Returns:
        Quaternion w, x, y, z.
    """
    # Shepperd's method: divide by the largest of the four, so that nothing cancels.
    trace = m[0][0] + m[1][1] + m[2][2]
    squares = [trace, m[0][0], m[1][1], m[2][2]]
    largest = squares.index(max(squares))
    q = [1 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]]
    if largest > 0:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q[0] = m[k][j] - m[j][k]
        q[1 + i] = 1 + m[i][i] - m[j][j] - m[k][k]
        q[1 + j] = m[j][i] + m[i][j]
        q[1 + k] = m[k][i] + m[i][k]
    length = math.sqrt(sum(x * x for x in q))
    if q[0] < 0:
        length = -length
    if not length:
        return math.nan, math.nan, math.nan, math.nan
    return q[0] / length, q[1] / length, q[2] / length, q[3] / length


def left_product(wxyz: ArrayLike) -> Array:
    """What makes ``p q`` of a quaternion q, for a quaternion p with w first, shape (4, 4)."""
    a, b, c, d = np.asarray(wxyz, float).tolist()
    return np.array([[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]])


def right_product(wxyz: ArrayLike) -> Array:
    """What makes ``q p`` of a quaternion q, for a quaternion p with w first, shape (4, 4)."""
    a, b, c, d = np.asarray(wxyz, float).tolist()
    return np.array([[a, -b, -c, -d], [b, a, d, -c], [c, -d, a, b], [d, c, -b, a]])


def turned(rotation: ArrayLike, wxyz: ArrayLike) -> Array:
    """Quaternions of ``rotation`` times each rotation that is given.

    Args:
        rotation: Rotation matrix, shape (3, 3).
        wxyz: Quaternions, w first, shape (..., 4); one that is not finite, or vast, becomes NaN.

    Returns:
        Quaternions, w first, of the same lengths, shape (..., 4).
    """
    return multiplied(left_product(wxyz_from_rotation(rotation)), wxyz)


def multiplied(left: Array, wxyz: ArrayLike) -> Array:
    """Quaternions as `turned` gives them, by what `left_product` makes of that rotation."""
    given = np.asarray(wxyz, float)
    near = np.abs(given) < _VAST
    if near.all():
        return np.asarray(np.matmul(given, left.T, out=np.empty_like(given)))
    known = near.all(axis=-1, keepdims=True)
    return np.where(known, np.where(known, given, 0.0) @ left.T, np.nan)


def rotation_from_rpy(rpy: ArrayLike) -> Array:
    """Rotation matrix of fixed-axis roll, pitch, yaw as URDF has them: ``Rz(yaw) Ry(pitch) Rx(roll)``.

    Args:
        rpy: Roll, pitch, yaw [rad], shape (3,).

    Returns:
        Rotation matrix, shape (3, 3).
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rotation_from_axis_angle(axis: ArrayLike, angle: float) -> Array:
    """Rotation by ``angle`` [rad] about ``axis`` (any length but zero), shape (3, 3)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def transform(rotation: ArrayLike | None = None, position: ArrayLike | None = None) -> Array:
    """Homogeneous matrix of a rotation (3, 3) and a position [m] (3,), shape (4, 4)."""
    matrix = np.eye(4)
    if rotation is not None:
        matrix[:3, :3] = rotation
    if position is not None:
        matrix[:3, 3] = position
    return matrix


def inverse(a_from_b: ArrayLike) -> Array:
    """``b_from_a`` of a rigid ``a_from_b``, shape (..., 4, 4)."""
    matrix = np.asarray(a_from_b, float)
    result = np.zeros_like(matrix)
    rotation = np.swapaxes(matrix[..., :3, :3], -1, -2)
    result[..., :3, :3] = rotation
    result[..., :3, 3] = -np.einsum("...ij,...j->...i", rotation, matrix[..., :3, 3])
    result[..., 3, 3] = 1.0
    return result


def apply(a_from_b: ArrayLike, points_in_b: ArrayLike) -> Array:
    """Points in ``a`` [m], shape (n, 3), of points in ``b`` [m], shape (n, 3)."""
    matrix = np.asarray(a_from_b, float)
    return np.asarray(np.asarray(points_in_b, float) @ matrix[:3, :3].T + matrix[:3, 3])
