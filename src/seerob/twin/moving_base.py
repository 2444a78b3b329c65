r"""Speed and energy of a robot that something moves, or that moves something: axes, carts, grippers.

What a robot's own joints tell, :math:`J \dot q` and :math:`\frac{1}{2} \dot q^T M \dot q`, is not all there
is when it stands on a machine that moves or carries one: then its bodies are asked.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

import numpy as np

from seerob.core.errors import InputError
from seerob.core.samples import PoseSample
from seerob.core.transforms import Array
from seerob.model.model import Frame, Mechanism, Model
from seerob.twin.state import State
from seerob.twin.states import States

RESTS = 1e-3
"""Largest speed of a joint of a machine that counts as standing still [m/s or rad/s]."""


def first_moving(state: State, mechanisms: Iterable[Mechanism], *, rests: float = RESTS) -> str | None:
    """Name of the first that does not stand still; None where all do.

    Args:
        state: The twin.
        mechanisms: Who is asked.
        rests: Largest speed of a joint that counts as standing still [m/s or rad/s].

    Raises:
        Undecided: One of them was not heard.
    """
    for mechanism in mechanisms:
        if np.abs(state.data_of(mechanism.name).qvel[mechanism.v_address]).max(initial=0.0) > rests:
            return mechanism.name
    return None


def velocity_of(state: State | States, frame: Frame, mechanism: Mechanism, offset: Array) -> Array:
    """Velocity of a point in the world, linear before angular, (6,) [m/s, rad/s]; (N, 6) at N instants.

    Args:
        state: The twin; at many instants where the mechanism alone moves the point.
        frame: The frame.
        mechanism: Who moves it, see `seerob.model.model.Model.carrier`.
        offset: The point in the frame [m], shape (3,).

    Raises:
        Undecided: Whoever moves it was not heard.
    """
    if mechanism.alone:
        return state.velocity(frame, mechanism, offset)
    state = cast("State", state)
    data = state.data_of(*_movers(state, frame, mechanism))
    rotation, position = state.pose(frame)
    twist = data.cvel[frame.mj]
    arm = position + rotation @ offset - data.subtree_com[state.model.mj.body_rootid[frame.mj]]
    return np.concatenate([twist[3:] + np.cross(twist[:3], arm), twist[:3]])


def _movers(state: State, frame: Frame, mechanism: Mechanism) -> list[str]:
    """The robot or machine, and of those aboard which move the frame."""
    machines = (state.model.mechanisms[name] for name in mechanism.riders)
    return [mechanism.name, *(m.name for m in machines if frame.mj in m.mj_bodies)]


def moved_by_poses(model: Model, sample: PoseSample) -> Mechanism:
    """Robot or human that follows a pose of one of its links or tools in the world.

    Raises:
        UnknownName: There is none.
        InputError: It is carried by what moves: the same pose would be other joint positions at any instant.
    """
    mechanism = model.carrier(model.frame(sample.target))
    if mechanism.on:
        what = f"poses of {mechanism.name}, which is carried by {mechanism.on}"
        raise InputError.at(sample.source, sample.target, what, "give its joint positions")
    return mechanism


def energy_of(state: State, robot: Mechanism) -> float:
    r"""Kinetic energy of what moves of a robot [J], :math:`\sum \frac{1}{2} (m v_c^2 + \omega^T I \omega)`.

    Raises:
        Undecided: Not heard, or a mass that nobody gave.
    """
    mj, data = state.model.mj, state.data_of(robot.name, *robot.riders)
    state.mass_matrix(robot)  # raises for the reasons that it has
    found = 0.0
    for body in robot.mj_bodies:
        if body in robot.unweighed:
            continue
        spin, at_root = data.cvel[body][:3], data.cvel[body][3:]
        v_c = at_root + np.cross(spin, data.xipos[body] - data.subtree_com[mj.body_rootid[body]])
        local = data.ximat[body].reshape(3, 3).T @ spin
        found += mj.body_mass[body] * (v_c @ v_c) + mj.body_inertia[body] @ local**2
    # Rotors turn with their joints, not with the links.
    dofs = robot.v_address
    return float(0.5 * (found + mj.dof_armature[dofs] @ data.qvel[dofs] ** 2))
