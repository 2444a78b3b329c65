r"""Mass that a person hit by a moving part of a robot would feel: by the norm, and along the motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seerob import collision
from seerob.model import Frame, Mechanism, Model
from seerob.state import State
from seerob.transforms import Array


def simplified_mass(model: Model, robot: Mechanism) -> float:
    """M/2 + m_L of ISO/TS 15066:2016 A.4 [kg]: links by half, tools and workpieces in full.

    Means nothing where `Mechanism.unknown_masses` names any.
    """
    return float(collision.robot_mass(*moving_masses(model, robot)))


def moving_masses(model: Model, robot: Mechanism) -> tuple[float, float]:
    """M and m_L: mass of the links that the joints move, and of tools and workpieces [kg].

    Mean nothing where `Mechanism.unknown_masses` names any.
    """
    names = {int(i): model.mj.body(int(i)).name for i in robot.mj_bodies}
    masses = {i: float(model.mj.body_mass[i]) for i in names}
    links = sum(masses[i] for i, name in names.items() if name.startswith(f"{robot.name}/"))
    return links, sum(masses.values()) - links


def masses_along_motion(
    state: State, robot: Mechanism, frames: Sequence[Frame], bodies: Sequence[int], *, standstill: float
) -> Array:
    r"""Effective mass of each body at its fastest point along its motion [kg], shape (b,).

    Args:
        state: The twin.
        robot: The robot.
        frames: A frame at the origin of each body.
        bodies: The bodies, by index.
        standstill: Speed below which a motion has no direction [m/s].

    Returns:
        NaN where a body stands still.

    Raises:
        Undecided: Not heard, or a mass that nobody gave.
    """
    M = state.mass_matrix(robot)
    masses = np.full(len(bodies), np.nan)
    J_v, u, rows = [], [], []
    for row, body in enumerate(bodies):
        _, point, velocity = state.fastest_point(body)
        speed = float(np.sqrt(velocity @ velocity))
        if speed > standstill:
            offset = state.rotations[body].T @ (point - state.positions[body])
            J_v.append(state.jacobian(frames[row], robot, offset)[:3])
            u.append(velocity / speed)
            rows.append(row)
    if rows:
        masses[rows] = collision.mass_along(np.array(J_v), M, np.array(u))
    return masses
