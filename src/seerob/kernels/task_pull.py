r"""Torques that pull the bones of a person, each as a rigid body, to where they are to be.

Every bone with mass m and inertia I is pulled at its centre of mass and turned with

.. math:: F = m \omega^2 \Delta x, \qquad N = I \omega^2 \Delta\theta

and the joints receive :math:`\tau = \sum_b J_b^T (F_b, N_b)`. As :math:`\sum_b J_b^T M_b J_b` is the mass
matrix M, this is to first order :math:`\omega^2 M(q) \Delta q`: every bone moves at the same natural
frequency, and what one joint cannot do others help with.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import Layout
from seerob.kernels.posture_fit import logarithm

Indices = NDArray[np.int64]


class Bones(NamedTuple):
    """What of a person is the same at all instants: b bodies that m joints move."""

    bodies: Indices
    """MuJoCo's bodies that the joints move, parents first, shape (b,)."""
    up: Indices
    """Row of each one's parent among them, -1 for none, shape (b,)."""
    mass: Array
    """Of each [kg], shape (b,)."""
    inertia: Array
    """Principal moments [kg·m²], shape (b, 3)."""
    dof: Indices
    """Degree of freedom of each joint, shape (m,)."""
    at: Indices
    """Row of the body of each joint, shape (m,)."""
    joint: Indices
    """MuJoCo's joints, shape (m,)."""
    turns: NDArray[np.bool_]
    """Whether each turns; otherwise it slides, shape (m,)."""


BONES = Layout(
    Bones, [*[(np.int64, 1)] * 2, (np.float64, 1), (np.float64, 2), *[(np.int64, 1)] * 3, (np.bool_, 1)]
)
_bones_in = BONES.read


@njit(cache=True, nogil=True, error_model="numpy")
def torques(
    bones: Indices, x: Array, R: Array, wanted_x: Array, wanted_R: Array, anchor: Array, axis: Array,
    omega: float, out: Array,
) -> None:  # fmt: skip
    """Writes the torque of each joint into ``out``.

    Args:
        bones: Of `BONES`.
        x: World positions of all centres of mass [m], ``MjData.xipos``.
        R: World from principal axes, ``MjData.ximat`` as (n, 9).
        wanted_x: As ``x``, of where the bones are to be.
        wanted_R: As ``R``.
        anchor: ``MjData.xanchor`` [m].
        axis: ``MjData.xaxis``.
        omega: Natural frequency [rad/s].
        out: Torques [N·m or N] of all degrees of freedom; only those of the person are written.
    """
    bodies, up, mass, inertia, dof, at, joint, turns = _bones_in(bones, 0)
    count = len(bodies)
    force, moment = np.zeros((count, 3)), np.zeros((count, 3))
    turned, own = np.empty(3), np.empty(3)
    for k in range(count):
        body = bodies[k]
        here, there = R[body].copy().reshape(3, 3), wanted_R[body].copy().reshape(3, 3)
        logarithm(there, here, turned)
        for i in range(3):
            own[i] = here[0, i] * turned[0] + here[1, i] * turned[1] + here[2, i] * turned[2]
            force[k, i] = mass[k] * omega * omega * (wanted_x[body, i] - x[body, i])
            own[i] *= inertia[k, i] * omega * omega
        for i in range(3):
            j, h = (i + 1) % 3, (i + 2) % 3
            asked = here[i, 0] * own[0] + here[i, 1] * own[1] + here[i, 2] * own[2]
            moment[k, i] = asked + x[body, j] * force[k, h] - x[body, h] * force[k, j]
    for k in range(count - 1, -1, -1):
        if up[k] >= 0:
            for i in range(3):
                force[up[k], i] += force[k, i]
                moment[up[k], i] += moment[k, i]
    for c in range(len(dof)):
        k, line, through = at[c], axis[joint[c]], anchor[joint[c]]
        total = 0.0
        for i in range(3):
            j, h = (i + 1) % 3, (i + 2) % 3
            if turns[c]:
                total += line[i] * (moment[k, i] - through[j] * force[k, h] + through[h] * force[k, j])
            else:
                total += line[i] * force[k, i]
        out[dof[c]] = total
