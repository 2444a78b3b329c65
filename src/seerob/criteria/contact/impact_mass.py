r"""Mass that a person hit by a moving part of a robot would feel: by the norm, and along the motion."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from seerob.core.transforms import Array
from seerob.criteria.contact import collision
from seerob.criteria.contact.clamping import STILL
from seerob.kernels.speed import directions
from seerob.model.model import Mechanism, Model
from seerob.twin.moving_base import first_moving
from seerob.twin.state import State


def simplified_mass(model: Model, robot: Mechanism) -> float:
    """M/2 + m_L of ISO/TS 15066:2016 A.4 [kg]: links by half, tools and workpieces in full.

    Where `Mechanism.unknown_masses` names any, of the known masses alone.
    """
    return float(collision.robot_mass(*moving_masses(model, robot)))


def moving_masses(model: Model, robot: Mechanism) -> tuple[float, float]:
    """M and m_L: mass of the links that the joints move, and of what is mounted beyond the flange [kg].

    A gripper counts as load, whether the robot's own file has it or the workstation file.
    Where `Mechanism.unknown_masses` names any, of the known masses alone.
    """
    masses = {int(i): float(model.mj.body_mass[i]) for i in robot.mj_bodies if i not in robot.unweighed}
    load = math.fsum(mass for i, mass in masses.items() if i in robot.load)
    return math.fsum(masses.values()) - load, load


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
    return np.where(np.isnan(u[:, 0]), np.nan, collision.mass_of_rows(rows, M))


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
    return math.fsum(float(model.mj.body_mass[i]) for i in sorted(bodies))
