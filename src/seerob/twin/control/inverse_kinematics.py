r"""Cartesian targets into joint positions, by damped least squares from where the robot is.

.. math:: \Delta q = J^T (J J^T + \lambda^2 I)^{-1} e

A robot with more or other solutions keeps the branch it is on; redundancy is resolved by staying
near the start. Real controllers may choose otherwise, so a pose-driven twin is less certain.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np

from seerob.core.transforms import Array
from seerob.model.model import Frame, Mechanism

ITERATIONS = 40
DAMPING = 1e-3
LARGEST_STEP = 0.3
"""Of one iteration and joint [rad or m]."""
LEAST_DAMPING = 1e-12
"""Of the sum of the squares: far above what is rounded, far below what slows convergence."""


class Miss(NamedTuple):
    """How far a frame stays from where it is to be."""

    distance: float
    """[m]"""
    angle: float
    """[rad]"""

    @property
    def larger(self) -> float:
        """The larger of both [m, rad]."""
        return max(self)

    def __str__(self) -> str:
        return f"{self.distance:.3g} m and {math.degrees(self.angle):.2g}° away"


def solve_pose(
    mj: mujoco.MjModel,
    data: mujoco.MjData,
    mechanism: Mechanism,
    frame: Frame,
    rotation: Array,
    position: Array,
    *,
    start: Array,
) -> tuple[Array, Miss]:
    """Joint positions that bring a frame to a pose.

    Args:
        mj: The `mujoco.MjModel`.
        data: Scratch `mujoco.MjData`.
        mechanism: The robot; only its joints move.
        frame: The frame to place.
        rotation: World from frame, shape (3, 3).
        position: In the world [m], shape (3,).
        start: Joint positions to start from, shape (n,) [rad or m].

    Returns:
        Joint positions, shape (n,), within their limits, and what is left to the pose.
    """
    q = start.astype(float).copy()
    jacobian_p, jacobian_r = np.zeros((3, mj.nv)), np.zeros((3, mj.nv))
    miss = Miss(np.inf, np.inf)
    for _ in range(ITERATIONS):
        data.qpos[mechanism.q_address] = mechanism.coupling @ q + mechanism.offset
        mujoco.mj_kinematics(mj, data)
        mujoco.mj_comPos(mj, data)
        body = data.xmat[frame.mj].reshape(3, 3)
        at = data.xpos[frame.mj] + body @ frame.body_from_frame[:3, 3]
        twist = np.concatenate(
            [position - at, _rotation_vector(rotation @ (body @ frame.body_from_frame[:3, :3]).T)]
        )
        miss = Miss(float(np.linalg.norm(twist[:3])), float(np.linalg.norm(twist[3:])))
        if miss.larger < 1e-10:
            break
        mujoco.mj_jac(mj, data, jacobian_p, jacobian_r, at, frame.mj)
        J = np.vstack([jacobian_p, jacobian_r])[:, mechanism.v_address] @ mechanism.coupling
        squares = J @ J.T
        # The damping fades with the error, so that convergence is quadratic in the end; what is left of it
        # keeps the system of an arm with fewer than six joints solvable.
        damping = max(min(DAMPING, miss.larger**2), LEAST_DAMPING * max(1.0, float(squares.trace())))
        step = J.T @ np.linalg.solve(squares + damping * np.eye(6), twist)
        step *= min(1.0, LARGEST_STEP / max(float(np.abs(step).max()), 1e-12))
        q = np.clip(q + step, mechanism.lower, mechanism.upper)
    return q, miss


def _rotation_vector(rotation: Array) -> Array:
    """Axis times angle [rad] of a rotation matrix."""
    sine = 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    s, c = float(np.linalg.norm(sine)), 0.5 * (float(rotation.trace()) - 1)
    if s > 1e-9:
        return np.asarray(sine * (np.arctan2(s, c) / s))
    if c > 0:
        return sine
    # Half a turn: (R + I)/2 is the axis times itself, either sign will do.
    outer = 0.5 * (rotation + np.eye(3))
    axis = outer[:, int(np.diag(outer).argmax())]
    return np.asarray(np.pi * axis / float(np.linalg.norm(axis)))
