r"""Speed, force, pressure and energy of an impact on a person, ISO/TS 15066:2016 Annex A.3.

A body region is a spring :math:`k` with an effective mass :math:`m_H`; the robot is a mass
:math:`m_R`; all kinetic energy of the relative motion goes into the spring:

.. math::
    E = \frac{F^2}{2k} = \frac{A^2 p^2}{2k} = \tfrac12 \mu v_{rel}^2 \quad (A.1, A.2)

    \mu = \left(\frac{1}{m_H} + \frac{1}{m_R}\right)^{-1} \quad (A.3) \qquad
    m_R = \frac{M}{2} + m_L \quad (A.4)

    v = \frac{F}{\sqrt{\mu k}} \quad (A.5) \qquad v = \frac{p A}{\sqrt{\mu k}} \quad (A.6)

A clamped part cannot recoil: :math:`m_H \to \infty`, :math:`\mu = m_R`. Everything is SI and
broadcasts. What is unknown is NaN and stays so.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core.domains import agree, at_least, number
from seerob.core.transforms import Array
from seerob.kernels.axes import mobility, reciprocals


class Governing(IntEnum):
    """Which limit is reached first."""

    FORCE = 0
    PRESSURE = 1
    ENERGY = 2


LEAST = 1e-9
"""What divides is greater [kg, N/m]."""


def robot_mass(M: ArrayLike, m_L: ArrayLike) -> Array:
    """Effective mass of a robot, A.4: half of its moving parts and all of the load [kg].

    Args:
        M: Mass of the moving parts of the robot [kg].
        m_L: Mass of tool and workpiece [kg].
    """
    return np.asarray(number("M", M, 0, unit="kg") / 2 + number("m_L", m_L, 0, unit="kg"))


def reduced_mass(m_H: ArrayLike, m_R: ArrayLike) -> Array:
    """Reduced mass μ of two bodies, A.3 [kg]; an infinite ``m_H`` is a clamped body part.

    Args:
        m_H: Effective mass of the body region [kg].
        m_R: Effective mass of the robot [kg].
    """
    m_H, m_R = number("m_H", m_H, LEAST, unit="kg"), number("m_R", m_R, LEAST, unit="kg")
    return np.asarray(1.0 / (1.0 / m_H + 1.0 / m_R))


def mass_of_rows(w: Array, M: Array) -> Array:
    r"""Mass of an articulated robot felt at points, :math:`1/m_u = u^T J_v M^{-1} J_v^T u` [kg].

    Args:
        w: Rows :math:`u^T J_v` of unit directions u and linear Jacobians of the points, shape (b, n).
        M: Joint-space mass matrix, shape (n, n).

    Returns:
        Shape (b,); inf where a point cannot be pushed that way.
    """
    agree(n=(w.shape[-1], *M.shape))
    found = np.empty((1, len(w), len(w)))
    if not mobility(np.ascontiguousarray(w)[None], np.ascontiguousarray(M)[None], found):
        raise np.linalg.LinAlgError("a mass matrix is not positive definite")
    return reciprocals(found[0].diagonal().copy())


def spring_energy(F: ArrayLike, k: ArrayLike) -> Array:
    """Energy in the spring at a force, A.1 [J]. F [N], k [N/m]."""
    return np.asarray(np.square(at_least("F", F, unit="N")) / (2 * number("k", k, LEAST, unit="N/m")))


def speed_at_force(F: ArrayLike, mu: ArrayLike, k: ArrayLike) -> Array:
    """Relative speed at which an impact reaches a force, A.5 [m/s]. F [N], μ [kg], k [N/m]."""
    return np.asarray(np.asarray(F) / np.sqrt(np.asarray(mu) * number("k", k, LEAST, unit="N/m")))


def speed_at_pressure(p: ArrayLike, A: ArrayLike, mu: ArrayLike, k: ArrayLike) -> Array:
    """Relative speed at which an impact reaches a pressure, A.6 [m/s]. p [Pa], A [m²], μ [kg], k [N/m]."""
    area = number("A", A, 0, unit="m²")
    return np.asarray(np.asarray(p) * area / np.sqrt(np.asarray(mu) * number("k", k, LEAST, unit="N/m")))


def speed_at_energy(E: ArrayLike, mu: ArrayLike) -> Array:
    """Relative speed of an energy [m/s]. E [J], μ [kg]."""
    return np.asarray(np.sqrt(2 * number("E", E, 0, unit="J") / number("mu", mu, LEAST, unit="kg")))


def energy_limit(F: ArrayLike, k: ArrayLike, printed: ArrayLike) -> Array:
    """The smaller of the energy at the force limit and the printed one [J]; NaN means not printed."""
    spring = spring_energy(F, k)
    return np.where(np.isnan(np.asarray(printed, float)), spring, np.minimum(spring, printed))


def permissible_speed(v_F: ArrayLike, v_P: ArrayLike, v_E: ArrayLike) -> tuple[Array, NDArray[np.int64]]:
    """The least of the three speeds [m/s] and which limit it is (`Governing`).

    A speed at pressure that is NaN (unknown area) is left out: the result is then an upper bound, and
    whoever asks must not call a speed below it within.
    """
    # Where the energy limit is that of the force, rounding must not say that energy governs.
    v_E = np.where(np.asarray(v_E) >= np.asarray(v_F) * (1 - 1e-12), v_F, v_E)
    # Only the pressure may be unknown: what else is not a number stays so.
    least = np.minimum(np.where(np.isnan(v_P), v_F, np.minimum(v_F, v_P)), v_E)
    which = np.where(
        least == v_F, Governing.FORCE, np.where(least == v_P, Governing.PRESSURE, Governing.ENERGY)
    )
    return least, which
