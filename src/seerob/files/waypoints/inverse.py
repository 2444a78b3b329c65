r"""Joint positions for a pose of the tool point: every branch that is found, and the one that is nearest.

Damped least squares from many postures at once, :math:`\Delta q = J^T (J J^T + \lambda^2 I)^{-1} e`. Of a
classic arm with six joints there are at most eight branches, each found from postures on it; of another arm
what is found need not be all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seerob.core.transforms import Array
from seerob.files.waypoints.arm import Arm, Posture
from seerob.files.waypoints.branches import Branch, branch, is_classic

ITERATIONS = 60
SEEDS = 96
LARGEST_STEP = 0.4
"""Of one iteration and joint [rad or m]."""
EXACT = 1e-9
"""Errors in position [m] and orientation [rad] of a solution."""
SAME = 1e-4
"""Solutions that differ by less are the same [rad or m]."""


@dataclass(frozen=True, eq=False)
class Solution:
    """One way of reaching a pose."""

    q: Array
    """[rad or m], shape (n,)."""
    branch: Branch | None
    """None where the arm is not of the build that branches are defined for."""


def reach(arm: Arm, rotation: Array, position: Array, starts: Array) -> tuple[Array, Array]:
    """Descend from many postures.

    Args:
        arm: The arm.
        rotation: Base from tool, shape (3, 3).
        position: Of the tool point in the base [m], shape (3,).
        starts: Joint positions, shape (m, n) [rad or m].

    Returns:
        Joint positions (m, n), and the larger of the errors [m, rad], shape (m,).
    """
    q = np.array(starts, float)
    for _ in range(ITERATIONS):
        at = arm.posture(q)
        e = _twist(at, rotation, position)
        left = np.linalg.norm(e, axis=-1)
        if (left < EXACT).all():
            break
        J = at.jacobian()
        damping = np.minimum(1e-3, left**2)[:, None, None] * np.eye(6)
        Jt = np.swapaxes(J, -1, -2)
        step = (Jt @ np.linalg.solve(J @ Jt + damping + 1e-14 * np.eye(6), e[..., None]))[..., 0]
        longest = np.abs(step).max(axis=-1, keepdims=True)
        q += step * np.minimum(1.0, LARGEST_STEP / np.maximum(longest, 1e-12))
    e = _twist(arm.posture(q), rotation, position)
    return q, np.maximum(np.linalg.norm(e[:, :3], axis=-1), np.linalg.norm(e[:, 3:], axis=-1))


def solutions(arm: Arm, rotation: Array, position: Array, near: Array) -> tuple[Solution, ...]:
    """Ways of reaching a pose, the one nearest to a posture first.

    Every joint that turns is brought as near to ``near`` as whole turns within its limits allow; what is
    beyond a limit is left out. Of an arm with more than six joints there is one at most.

    Args:
        arm: The arm.
        rotation: Base from tool, shape (3, 3).
        position: Of the tool point in the base [m], shape (3,).
        near: Joint positions, shape (n,) [rad or m].
    """
    classic = is_classic(arm)
    if arm.n <= 6:
        return _distinct(arm, reach_from_around(arm, rotation, position, near), near, classic=classic)
    # Of infinitely many only the nearest means something.
    found = _distinct(arm, reach(arm, rotation, position, near[None]), near, classic=classic)
    if not found:
        found = _distinct(arm, reach_from_around(arm, rotation, position, near), near, classic=classic)
    return found[:1]


def reach_from_around(arm: Arm, rotation: Array, position: Array, near: Array) -> tuple[Array, Array]:
    """`reach` from a posture and from many others around it; see there."""
    low = np.maximum(np.where(np.isfinite(arm.lower), arm.lower, -np.pi), near - np.pi)
    high = np.minimum(np.where(np.isfinite(arm.upper), arm.upper, np.pi), near + np.pi)
    low, high = np.minimum(low, high), np.maximum(low, high)
    starts = np.random.default_rng(7).uniform(low, high, (SEEDS, arm.n))
    return reach(arm, rotation, position, np.vstack([near, starts]))


def _distinct(arm: Arm, reached: tuple[Array, Array], near: Array, *, classic: bool) -> tuple[Solution, ...]:
    """Solutions within the limits, each once, the nearest first."""
    q, error = reached
    found: list[Solution] = []
    for row in q[error < 1e3 * EXACT]:
        turned = _nearest_turn(arm, row, near)
        if turned is None or any(_apart(arm, turned, other.q) < SAME for other in found):
            continue
        found.append(Solution(turned, branch(arm.posture(turned)) if classic else None))
    return tuple(sorted(found, key=lambda s: float(np.linalg.norm(s.q - near))))


def follow(arm: Arm, rotation: Array, position: Array, near: Array) -> tuple[Array, float]:
    """The solution that a posture close by leads to, shape (n,), and its error [m, rad]."""
    q, error = reach(arm, rotation, position, near[None])
    return q[0], float(error[0])


def rotation_vectors(rotation: Array) -> Array:
    """Axis times angle [rad] of rotation matrices, shape (..., 3)."""
    sine = 0.5 * np.stack(
        [
            rotation[..., 2, 1] - rotation[..., 1, 2],
            rotation[..., 0, 2] - rotation[..., 2, 0],
            rotation[..., 1, 0] - rotation[..., 0, 1],
        ],
        axis=-1,
    )
    s = np.linalg.norm(sine, axis=-1)
    angle = np.arctan2(s, 0.5 * (np.trace(rotation, axis1=-2, axis2=-1) - 1))
    usual = sine * (angle / np.maximum(s, 1e-300))[..., None]
    # Half a turn: (R + I)/2 is the axis times itself, either sign will do.
    outer = 0.5 * (rotation + np.eye(3))
    k = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    column = np.take_along_axis(outer, k[..., None, None], axis=-1)[..., 0]
    axis = column / np.maximum(np.linalg.norm(column, axis=-1, keepdims=True), 1e-300)
    half = (s < 1e-9) & (angle > 1.0)
    return np.where(half[..., None], np.pi * axis, np.where(s[..., None] < 1e-9, sine, usual))


def _twist(at: Posture, rotation: Array, position: Array) -> Array:
    turn = rotation_vectors(rotation @ np.swapaxes(at.rotation, -1, -2))
    return np.concatenate([position - at.position, turn], axis=-1)


def _apart(arm: Arm, a: Array, b: Array) -> float:
    """Largest difference of a joint, whole turns aside."""
    d = a - b
    return float(np.abs(np.where(arm.slides, d, (d + np.pi) % (2 * np.pi) - np.pi)).max())


def _nearest_turn(arm: Arm, q: Array, near: Array) -> Array | None:
    """Turn joints by whole turns until they are nearest to ``near``; None where that is beyond a limit."""
    turned = q.copy()
    for i in np.flatnonzero(~arm.slides):
        k = round((near[i] - q[i]) / (2 * np.pi))
        options = [q[i] + 2 * np.pi * (k + d) for d in (-1, 0, 1)]
        fitting = [x for x in options if arm.lower[i] - 1e-9 <= x <= arm.upper[i] + 1e-9]
        if not fitting:
            return None
        turned[i] = min(fitting, key=lambda x: abs(x - near[i]))
    if ((turned < arm.lower - 1e-9) | (turned > arm.upper + 1e-9)).any():
        return None
    return turned
