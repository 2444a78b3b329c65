r"""Joint positions for a pose of the tool point: every branch that is found, and the one that is nearest.

Damped least squares from many postures at once, :math:`\Delta q = J^T (J J^T + \lambda^2 I)^{-1} e`. Of a
classic arm with six joints there are at most eight branches, each found from postures on it; of another arm
what is found need not be all.
"""

from __future__ import annotations

import math
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
    if _axis_distance(at, 4, 5) > MEET:
        return False
    spherical = _axis_distance(at, 3, 4) < MEET and _axis_distance(at, 3, 5) < MEET
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


def _axis_distance(at: Posture, i: int, j: int) -> float:
    """Distance of two axes [m]; of parallel ones too."""
    p, u, r, v = at.anchors[i], at.axes[i], at.anchors[j], at.axes[j]
    n = np.cross(u, v)
    if np.linalg.norm(n) < PARALLEL:
        return float(np.linalg.norm(np.cross(r - p, u)))
    return abs(float((r - p) @ n)) / float(np.linalg.norm(n))


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


ITERATIONS = 60
SEEDS = 96
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
        if turned is None or any(_joint_distance(arm, turned, other.q) < SAME for other in found):
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


def _joint_distance(arm: Arm, a: Array, b: Array) -> float:
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
