"""An emulated robot that goes where it is told, and plays a motion until then."""

from __future__ import annotations

import math
from collections.abc import Sequence
from threading import Lock
from typing import Any

import numpy as np

from seerob.app.emulation.motions import Joints, Motion
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.inverse import follow, solutions

STEP = 2e-3
"""Of its speeds [s]."""
MADE_UP = 0.5
"""Time that it moves on at once at most, when nobody asked where it is [s]."""
EXACT = 1e-6
"""Errors of a solution [m, rad]."""
BRAKES = 0.9
"""Share of the acceleration that a brake is planned with: what rounding adds stays below the whole."""


class Follower:
    """A motion that is left for good once a target is told: from then on joints go there by bounded speeds.

    From rest all joints go and arrive together, on a straight line in joint space. A new target on the way
    bends it, without a jump of any speed.

    Args:
        motion: What it does before.
        arm: The robot.
        topic: Whose poses it goes to: of the tip of the arm, in its root link.
        speed: Of the joint that has farthest to go [rad/s or m/s].
        acceleration: Of every joint [rad/s² or m/s²].
    """

    def __init__(self, motion: Motion, arm: Arm, topic: str, *, speed: float, acceleration: float) -> None:
        self.topic = topic
        self.refused = ""
        """Why the last target could not be gone to, which nobody is told, as over rosbridge; empty when it
        could."""
        self._motion, self._arm = motion, arm
        self._speed, self._acceleration = speed, acceleration
        self._goal: Array | None = None
        self._share = np.zeros(arm.n)
        self._told: Array | None = None
        self._t = 0.0
        self._q, self._qd = map(np.array, motion(0.0))
        self._lock = Lock()

    def __call__(self, t: float) -> tuple[Joints, Joints]:
        """Joint positions and speeds at a time since the start [s], which only goes on."""
        with self._lock:
            if self._goal is None:
                q, qd = self._motion(t)
                self._t, self._q, self._qd = t, np.array(q), np.array(qd)
                return q, qd
            for _ in range(math.ceil(min(t - self._t, MADE_UP) / STEP - 1e-9)):
                self._advance(self._goal)
            self._t = max(t, self._t)
            return tuple(self._q.tolist()), tuple(self._qd.tolist())

    def _advance(self, goal: Array) -> None:
        left, faster = goal - self._q, self._acceleration * self._share
        brakes = np.sqrt(2 * BRAKES * faster * np.abs(left))
        wanted = np.sign(left) * np.minimum(
            np.minimum(self._speed * self._share, brakes), np.abs(left) / STEP
        )
        # What a target before has left over is braked as hard as can be.
        most = STEP * np.where(np.abs(wanted) > np.abs(self._qd), faster, self._acceleration)
        self._qd = self._qd + np.clip(wanted - self._qd, -most, most)
        self._q = np.clip(self._q + STEP * self._qd, self._arm.lower, self._arm.upper)

    def hear(self, message: object) -> None:
        """Take a target: a ``Pose``, ``PoseStamped`` or ``TransformStamped`` of geometry_msgs as a table.

        What is no pose, and what the arm does not reach, is refused, and it goes on as before.
        """
        pose = _pose(message)
        if pose is None:
            self.refused = "no pose of geometry_msgs"
            return
        with self._lock:
            if self._told is not None and np.allclose(pose, self._told, rtol=0, atol=1e-9):
                return
            goal = self._reached(rotation_from_wxyz(pose[3:] / np.linalg.norm(pose[3:])), pose[:3])
            self._told = pose
            if goal is None:
                self.refused = f"{np.round(pose[:3], 3).tolist()} m is out of reach"
                return
            self.refused = ""
            # Who moves on the way to somewhere else comes back from where the brakes have stopped it.
            away = np.abs(goal - self._q) + self._qd**2 / (2 * self._acceleration)
            self._share = away / max(float(away.max()), 1e-12)
            self._goal = goal

    def _reached(self, rotation: Array, position: Array) -> Array | None:
        """Joint positions nearest to where it is that bring the tip there, shape (n,)."""
        near, error = follow(self._arm, rotation, position, self._q)
        within = (near >= self._arm.lower).all() and (near <= self._arm.upper).all()
        if error < EXACT and within and np.abs(near - self._q).max() < np.pi:
            return near
        found = solutions(self._arm, rotation, position, self._q)
        return found[0].q if found else None


def _pose(message: object) -> Array | None:
    """Position [m] and orientation (w first) of a message, shape (7,); None when it is no pose."""
    said: Any = message
    try:
        said = said.get("pose") or said.get("transform") or said
        place = said["translation" if "translation" in said else "position"]
        turn = said["rotation" if "rotation" in said else "orientation"]
        numbers: Sequence[Any] = [*(place[k] for k in "xyz"), *(turn[k] for k in "wxyz")]
        found = np.array(numbers, float)
    except (AttributeError, KeyError, TypeError, ValueError):
        return None
    return found if np.isfinite(found).all() and 0.9 < np.linalg.norm(found[3:]) < 1.1 else None
