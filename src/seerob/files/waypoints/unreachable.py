"""Why a pose of the tool is not reached: too far, turned wrongly, or beyond the limits of a joint."""

from __future__ import annotations

import math

import numpy as np

from seerob.core.transforms import Array
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.inverse import EXACT, reach_from_around, rotation_vectors

PLACE = 1e-3
"""A place that is missed by less is reached [m]."""
STEPS = 120
DAMPING = 1e-2
"""Squared, of the descent [m² or 1]."""
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
    angle = _turn_missing(arm, rotation, position, q)
    least = f"; the nearest that was found is {math.degrees(angle):.2g}° from it" if angle < math.inf else ""
    return f"{there} turned so: the place is reached, this orientation there is not{least}"


def _beyond(arm: Arm, q: Array) -> Array:
    """How far each joint is beyond its limits, whole turns aside, shape (n,) [rad or m]."""
    turns = 2 * np.pi * np.arange(-1, 2)[:, None] * ~arm.slides
    x = q + turns
    return np.asarray(np.maximum(np.maximum(arm.lower - x, x - arm.upper), 0.0).min(axis=0))


def _place_missing(arm: Arm, position: Array, starts: Array) -> float:
    """How far the tool point stays from a place, whatever its orientation [m]."""
    q = _descended(arm, None, position, starts)
    return float(np.linalg.norm(position - arm.posture(q).position, axis=-1).min())


def _turn_missing(arm: Arm, rotation: Array, position: Array, starts: Array) -> float:
    """How far the tool stays from an orientation at a place that it reaches [rad]; infinite when lost."""
    turned = _descended(arm, rotation, position, starts)
    at = arm.posture(_descended(arm, None, position, turned))
    there = np.linalg.norm(position - at.position, axis=-1) < PLACE
    away = rotation_vectors(rotation @ np.swapaxes(at.rotation[there], -1, -2))
    return float(np.linalg.norm(away, axis=-1).min(initial=np.inf))


def _descended(arm: Arm, rotation: Array | None, position: Array, starts: Array) -> Array:
    """Joint positions within the limits that are near a place, and turned as near as the place allows.

    Args:
        arm: The arm.
        rotation: Base from tool, shape (3, 3); None when it does not matter.
        position: Of the tool point in the base [m], shape (3,).
        starts: Joint positions, shape (m, n) [rad or m].

    Returns:
        Of shape (m, n).
    """
    q: Array = np.clip(np.array(starts, float), arm.lower, arm.upper)
    for _ in range(STEPS):
        at = arm.posture(q)
        J = at.jacobian()
        to_place, to_turn = J[..., :3, :], J[..., 3:, :]
        back = _damped_inverse(to_place)
        step = back @ (position - at.position)[..., None]
        if rotation is not None:
            turn = rotation_vectors(rotation @ np.swapaxes(at.rotation, -1, -2))[..., None]
            free = to_turn @ (np.eye(arm.n) - back @ to_place)
            step = step + _damped_inverse(free) @ (turn - to_turn @ step)
        longest = np.abs(step).max(axis=-2, keepdims=True)
        q += (step * np.minimum(1.0, LARGEST_STEP / np.maximum(longest, 1e-12)))[..., 0]
        np.clip(q, arm.lower, arm.upper, out=q)
    return q


def _damped_inverse(J: Array) -> Array:
    Jt = np.swapaxes(J, -1, -2)
    return np.asarray(Jt @ np.linalg.inv(J @ Jt + DAMPING * np.eye(3)))
