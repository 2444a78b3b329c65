"""Orientation columns in any convention → unit quaternions, w first."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np

from seerob.core.samples import LARGEST
from seerob.core.transforms import Array

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


def cross(a: Array, b: Array) -> Array:
    """Vector product of vectors (3,) or rows (n, 3): for a few several times faster than `numpy.cross`."""
    (a0, a1, a2), (b0, b1, b2) = a.T, b.T
    return np.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], axis=-1)
