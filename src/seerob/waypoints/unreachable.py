"""Why a pose of the tool is not reached: too far, turned wrongly, or beyond the limits of a joint."""

from __future__ import annotations

import numpy as np

from seerob.transforms import Array
from seerob.waypoints.arm import Arm
from seerob.waypoints.inverse import EXACT, reach_from_around

PLACE = 1e-3
"""A place that is missed by less is reached [m]."""
STEPS = 120
LARGEST_STEP = 0.4
"""Of one iteration and joint [rad or m]."""


def why_not(arm: Arm, rotation: Array, position: Array, near: Array) -> str:
    """Why no joint positions within the limits bring the tool to a pose, with how much is missing.

    Args:
        arm: The arm.
        rotation: Base from tool, shape (3, 3).
        position: Of the tool point in the base [m], shape (3,).
        near: Joint positions, shape (n,) [rad or m].
    """
    there = f"the tool cannot be brought to {np.round(position, 4).tolist()} m"
    q, error = reach_from_around(arm, rotation, position, near)
    exact = q[error < 1e3 * EXACT]
    if len(exact):
        beyond = np.array([_beyond(arm, row) for row in exact])
        row = beyond[int(np.argmin(beyond.max(axis=1)))]
        i = int(np.argmax(row))
        unit = "m" if arm.slides[i] else "rad"
        name = arm.joints[i].name
        return f"{there} within the limits: {name} would have to go {row[i]:.3g} {unit} beyond its own"
    missing = _place_missing(arm, position, q)
    if missing > PLACE:
        return f"{there}: however it is turned, {missing:.3g} m are missing"
    return f"{there} turned so: the place is reached, this orientation there is not"


def _beyond(arm: Arm, q: Array) -> Array:
    """How far each joint is beyond its limits, whole turns aside, shape (n,) [rad or m]."""
    turns = 2 * np.pi * np.arange(-1, 2)[:, None] * ~arm.slides
    x = q + turns
    return np.asarray(np.maximum(np.maximum(arm.lower - x, x - arm.upper), 0.0).min(axis=0))


def _place_missing(arm: Arm, position: Array, starts: Array) -> float:
    """How far the tool point stays from a place, whatever its orientation [m]."""
    q = np.array(starts, float)
    for _ in range(STEPS):
        at = arm.posture(q)
        e = position - at.position
        J = at.jacobian()[..., :3, :]
        Jt = np.swapaxes(J, -1, -2)
        step = (Jt @ np.linalg.solve(J @ Jt + 1e-2 * np.eye(3), e[..., None]))[..., 0]
        longest = np.abs(step).max(axis=-1, keepdims=True)
        q += step * np.minimum(1.0, LARGEST_STEP / np.maximum(longest, 1e-12))
        q = np.clip(q, arm.lower, arm.upper)
    return float(np.linalg.norm(position - arm.posture(q).position, axis=-1).min())
