r"""Mass that a person hit by a moving part of a robot would feel: by the norm, and along the motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seerob.contact import collision
from seerob.criterion import Evaluate
from seerob.errors import Undecided
from seerob.kernels.speed import directions
from seerob.model import Mechanism, Model
from seerob.moving_base import first_moving
from seerob.snapshot import Result, Verdict
from seerob.state import State
from seerob.transforms import Array


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
    load = sum(mass for i, mass in masses.items() if i in robot.load)
    return sum(masses.values()) - load, load


def masses_along_motion(
    state: State, robot: Mechanism, bodies: Sequence[int], *, standstill: float, M: Array | None = None
) -> Array:
    r"""Effective mass of each body at its fastest point along its motion [kg], shape (b,).

    Args:
        state: The twin.
        robot: The robot.
        bodies: The bodies, by index.
        standstill: Speed below which a motion has no direction [m/s].
        M: Another mass matrix than that of the state, shape (n, n).

    Returns:
        NaN where a body stands still.

    Raises:
        Undecided: Not heard, or a mass that nobody gave.
    """
    M = state.mass_matrix(robot) if M is None else M
    _, points, velocities = state.fastest_points(tuple(bodies))
    some, u = directions(velocities, standstill)
    if not some:
        return np.full(len(bodies), np.nan)
    rows = state.along(tuple(bodies), robot, points, u)
    return np.where(np.isnan(u[:, 0]), np.nan, collision.mass_of_rows(rows, M))


def while_carriers_rest(model: Model, robot: Mechanism, judge: Evaluate) -> Evaluate:
    """The same judgement, but never within while something moves that carries the robot.

    What carries it moves too then, and its mass is not in M/2 + m_L: the real mass may be larger.
    """
    carriers = []
    above = robot.on
    while above:
        carriers.append(model.mechanisms[above])
        above = carriers[-1].on

    def evaluate(state: State) -> Result:
        result = judge(state)
        if result.verdict is None or result.verdict is Verdict.EXCEEDED:
            return result
        if name := first_moving(state, carriers):
            raise Undecided(f"{name} moves and carries {robot.name}: its mass is not in M/2 + m_L")
        return result

    return evaluate if carriers else judge
