r"""Speed, force, pressure and energy of an impact on a person, ISO/TS 15066:2016 Annex A.3.

A body region is a spring :math:`k` with an effective mass :math:`m_H`; the robot is a mass
:math:`m_R`; all kinetic energy of the relative motion goes into the spring:

.. math::
    E = \frac{F^2}{2k} = \frac{A^2 p^2}{2k} = \tfrac12 \mu v_{rel}^2 \quad (A.1, A.2)

    \mu = \left(\frac{1}{m_H} + \frac{1}{m_R}\right)^{-1} \quad (A.3) \qquad
    m_R = \frac{M}{2} + m_L \quad (A.4)

    v = \frac{F}{\sqrt{\mu k}} \quad (A.5) \qquad v = \frac{p A}{\sqrt{\mu k}} \quad (A.6)

A clamped part cannot recoil: :math:`m_H \to \infty`, :math:`\mu = m_R`. Everything is SI and
broadcasts. What is unknown is NaN and stays so. Which masses a robot brings, by the norm and along its
motion, is asked of the model and of the twin.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core.domains import agree, at_least, number
from seerob.core.transforms import Array
from seerob.criteria.contact.clamping import STILL
from seerob.kernels.axes import mobility, reciprocals
from seerob.kernels.speed import directions
from seerob.model.model import Mechanism, Model
from seerob.twin.moving_base import first_moving
from seerob.twin.state import State


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


def simplified_mass(model: Model, robot: Mechanism) -> float:
    """M/2 + m_L of ISO/TS 15066:2016 A.4 [kg]: links by half, tools and workpieces in full.

    Where `Mechanism.unknown_masses` names any, of the known masses alone.
    """
    return float(robot_mass(*moving_masses(model, robot)))


def moving_masses(model: Model, robot: Mechanism) -> tuple[float, float]:
    """M and m_L: mass of the links that the joints move, and of what is mounted beyond the flange [kg].

    A gripper counts as load, whether the robot's own file has it or the workstation file.
    Where `Mechanism.unknown_masses` names any, of the known masses alone.
    """
    masses = {int(i): float(model.mj.body_mass[i]) for i in robot.mj_bodies if i not in robot.unweighed}
    load = sum(mass for i, mass in masses.items() if i in robot.load)
    return sum(masses.values()) - load, load


def masses_along_motion(
    state: State,
    robots: tuple[Mechanism, ...],
    bodies: Sequence[int],
    *,
    standstill: float,
    M: Array | None = None,
) -> Array:
    r"""Effective mass of each body at its fastest point along its motion [kg], shape (b,).

    Args:
        state: The twin.
        robots: The robot, or all that moves as one, whose joints yield.
        bodies: The bodies, by index.
        standstill: Speed below which a motion has no direction [m/s].
        M: Another mass matrix than that of the state, shape (n, n).

    Returns:
        NaN where a body stands still.

    Raises:
        Undecided: Not heard, or a mass that nobody gave.
    """
    M = state.mass_matrix(*robots) if M is None else M
    _, points, velocities = state.fastest_points(tuple(bodies))
    some, u = directions(velocities, standstill)
    if not some:
        return np.full(len(bodies), np.nan)
    rows = np.hstack([state.along(tuple(bodies), robot, points, u) for robot in robots])
    return np.where(np.isnan(u[:, 0]), np.nan, mass_of_rows(rows, M))


class Behind:
    """What is behind the surfaces of a robot or a machine when they hit somebody, bound once.

    A robot whose carriers rest has M/2 + m_L, and the effective mass along the motion of its own joints. A
    machine moves as one and carries what is on it: all of its mass counts in full, with that of the robots
    and machines on it, and so it does for a robot while what carries it moves. Along the motion the joints of
    all of them yield.
    """

    def __init__(self, model: Model, robot: Mechanism) -> None:
        self._robot, self._alone = robot, simplified_mass(model, robot)
        self._carriers = [model.mechanisms[name] for name in reversed(model.carriers_of(robot.name))]
        self._riders = [model.mechanisms[name] for name in robot.riders]
        self.pushed = robot.role == "machine" or bool(self._carriers or self._riders)
        """Whether a drive may push it that has more behind it than the joints of a robot."""
        roots = [*self._carriers, *([robot] if robot.role == "machine" else [])]
        self._trains = {root.name: train(model, root) for root in roots}
        self._totals = {name: _total(model, of) for name, of in self._trains.items()}

    def mover(self, state: State) -> Mechanism | None:
        """Who brings all of its mass: the outermost carrier that moves, or a machine itself; None of a robot.

        Raises:
            Undecided: A carrier was not heard.
        """
        moving = first_moving(state, self._carriers, rests=STILL)
        if moving is None:
            return self._robot if self._robot.role == "machine" else None
        return next(carrier for carrier in self._carriers if carrier.name == moving)

    def riding(self, state: State) -> tuple[Mechanism, ...]:
        """Grippers and other machines on it that move by drives of their own, however slowly."""
        return tuple(m for m in self._riders if float(np.abs(state.qd(m)).max(initial=0.0)) > STILL)

    def simplified(self, mover: Mechanism | None) -> float:
        """M/2 + m_L, or the whole mass of what moves as one [kg]."""
        return self._alone if mover is None else self._totals[mover.name]

    def along_motion(
        self, state: State, mover: Mechanism | None, bodies: Sequence[int], *, standstill: float
    ) -> Array:
        """Effective mass of each body along its motion [kg], shape (b,); see `masses_along_motion`."""
        train = (self._robot,) if mover is None else self._trains[mover.name]
        return masses_along_motion(state, train, bodies, standstill=standstill)


def train(model: Model, mover: Mechanism) -> tuple[Mechanism, ...]:
    """A machine and all robots and machines on it."""
    aboard = (m for m in model.mechanisms.values() if mover.name in model.carriers_of(m.name))
    return (mover, *aboard)


def _total(model: Model, mechanisms: Iterable[Mechanism]) -> float:
    """Known mass of all that moves of some mechanisms [kg]."""
    every = tuple(mechanisms)
    unweighed = {i for m in every for i in m.unweighed}
    bodies = {int(i) for m in every for i in m.mj_bodies} - unweighed
    return sum(float(model.mj.body_mass[i]) for i in sorted(bodies))
