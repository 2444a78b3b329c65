r"""Which of its branches an arm with six revolute joints is on: shoulder, elbow, wrist.

For arms whose axes 2 and 3 are parallel, whose axes 5 and 6 meet, and whose axis 4 is parallel to 3
(Universal Robots) or meets 5 and 6 too (a spherical wrist), the determinant of the Jacobian is a constant
times three factors, each of one cause. A branch is the triple of their signs; a robot can go from one branch
to another only through a singularity, where a factor is 0.

.. math::
    f_{shoulder} = (p_w - p_1) \cdot (z_2 \times z_1), \quad
    f_{elbow} = \big((p_3 - p_2) \times (p_4 - p_3)\big) \cdot z_2, \quad
    f_{wrist} = (z_4 \times z_6) \cdot z_5

with :math:`p_w` where axes 5 and 6 meet and :math:`p_4` a point of axis 4 (of a spherical wrist the one
where the axes meet).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seerob.core.transforms import Array
from seerob.files.waypoints.arm import Arm, Posture

PARALLEL = 0.02
"""Axes that are off by less are taken to be parallel [rad]: calibrated robots are never quite."""
MEET = 5e-3
"""Axes that pass each other at less are taken to meet [m]."""
NAMES = (("shoulder −", "shoulder +"), ("elbow −", "elbow +"), ("wrist −", "wrist +"))


@dataclass(frozen=True)
class Branch:
    """Signs of the three factors."""

    shoulder: int
    elbow: int
    wrist: int

    def __str__(self) -> str:
        signs = (self.shoulder, self.elbow, self.wrist)
        return ", ".join(names[sign > 0] for names, sign in zip(NAMES, signs, strict=True))


def parse(text: str) -> Branch:
    """A branch from its three signs, ``+-+``: shoulder, elbow, wrist.

    Raises:
        ValueError: Something else.
    """
    plain = text.replace("−", "-").replace(" ", "")
    if len(plain) != 3 or set(plain) - {"+", "-"}:
        raise ValueError(f"{text!r} is no branch: give the signs of shoulder, elbow and wrist, such as '+-+'")
    shoulder, elbow, wrist = (1 if sign == "+" else -1 for sign in plain)
    return Branch(shoulder, elbow, wrist)


def is_classic(arm: Arm) -> bool:
    """Whether the arm is of the build that the three factors speak of, judged at an ordinary posture."""
    if arm.n != 6 or arm.slides.any():
        return False
    at = arm.posture(np.array([0.3, -0.9, 1.1, -0.7, 0.8, 0.4]))
    if (np.linalg.norm(at.axes, axis=1) < 0.5).any() or _angle(at.axes[1], at.axes[2]) > PARALLEL:
        return False
    if _apart(at, 4, 5) > MEET:
        return False
    spherical = _apart(at, 3, 4) < MEET and _apart(at, 3, 5) < MEET
    return spherical or _angle(at.axes[2], at.axes[3]) < PARALLEL


def factors(posture: Posture) -> Array:
    """The three factors [m, m², 1], shape (..., 3)."""
    p, z = posture.anchors, posture.axes
    wrist = _meeting(p[..., 4, :], z[..., 4, :], p[..., 5, :], z[..., 5, :])
    shoulder = np.sum((wrist - p[..., 0, :]) * np.cross(z[..., 1, :], z[..., 0, :]), axis=-1)
    # Of an axis parallel to z_2 any point will do; of a spherical wrist it is the one where axes meet.
    fourth = np.where(
        _parallel(z[..., 2, :], z[..., 3, :])[..., None],
        p[..., 3, :],
        wrist,
    )
    upper, fore = p[..., 2, :] - p[..., 1, :], fourth - p[..., 2, :]
    elbow = np.sum(np.cross(upper, fore) * z[..., 1, :], axis=-1)
    turn = np.sum(np.cross(z[..., 3, :], z[..., 5, :]) * z[..., 4, :], axis=-1)
    return np.stack([shoulder, elbow, turn], axis=-1)


def branch(posture: Posture) -> Branch:
    """The branch of one posture; a factor that is 0 counts as negative."""
    shoulder, elbow, wrist = (1 if f > 0 else -1 for f in factors(posture))
    return Branch(shoulder, elbow, wrist)


def _parallel(a: Array, b: Array) -> Array:
    return np.asarray(np.linalg.norm(np.cross(a, b), axis=-1) < PARALLEL)


def _angle(a: Array, b: Array) -> float:
    return float(np.linalg.norm(np.cross(a, b)))


def _meeting(p: Array, u: Array, r: Array, v: Array) -> Array:
    """Point of the line (p, u) that is nearest to the line (r, v), shape (..., 3)."""
    n = np.cross(u, v)
    square = np.sum(n * n, axis=-1, keepdims=True)
    along = np.sum(np.cross(r - p, v) * n, axis=-1, keepdims=True) / np.maximum(square, 1e-12)
    return np.asarray(p + along * u)


def _apart(at: Posture, i: int, j: int) -> float:
    """Distance of two axes [m]; of parallel ones too."""
    p, u, r, v = at.anchors[i], at.axes[i], at.anchors[j], at.axes[j]
    n = np.cross(u, v)
    if np.linalg.norm(n) < PARALLEL:
        return float(np.linalg.norm(np.cross(r - p, u)))
    return abs(float((r - p) @ n)) / float(np.linalg.norm(n))
