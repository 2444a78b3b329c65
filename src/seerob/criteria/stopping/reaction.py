"""Which bound holds during a robot's reaction time: of what is known the sharpest, and where it is from."""

from __future__ import annotations

import math
from collections.abc import Callable

import mujoco
import numpy as np

from seerob.core.snapshot import Input, Origin
from seerob.core.transforms import Array
from seerob.criteria.stopping.onset import (
    BEYOND,
    At,
    Foreseen,
    Levers,
    Onset,
    by_joints,
    chain_of,
    constant,
    held,
    largest_between,
    shaken,
    with_knots,
)
from seerob.model.model import Gap, Mechanism, Model
from seerob.twin.moving_base import RESTS
from seerob.twin.state import State

Reactions = Callable[[State], tuple[At, At | None]]
"""What follows from the speeds as they are known, and a bound from above where that is another one: with all
joints at their largest speeds at once, and of speeds that may be off by the noise of positions that they were
derived from."""

NAME = "acceleration during T_r"
GIVE = "give stop.acceleration"


def bind_reaction(
    model: Model, robot: Mechanism, gap: Gap, T_r: float, a: float | None, *, points: bool, joints: bool
) -> tuple[Reactions, Input]:
    """Resolve what a robot does until it brakes.

    Args:
        model: The workstation.
        robot: Who moves.
        gap: Its second set are the moving parts.
        T_r: Reaction time [s].
        a: Acceleration of its points that was given [m/s²].
        points: Whether how it brakes can begin with an acceleration of points, or of joints.
        joints: Whether how it brakes asks for its joints.

    Returns:
        How to ask, and where it is from.
    """

    def noise(state: State) -> tuple[Array, Array] | None:
        """How far speeds of parts and joints may be off [m/s, rad/s or m/s]; None where they are not."""
        errors = state.speed_errors
        if not errors or errors.keys().isdisjoint(
            (robot.name, *robot.riders, *model.carriers_of(robot.name))
        ):
            return None
        off = state.speed_error(robot)
        return state.speed_noise(gap.b), np.zeros(len(robot.joints)) if off is None else off

    def with_noise(state: State, found: tuple[At, At | None]) -> tuple[At, At | None]:
        off, (least, most) = noise(state), found
        if off is None:
            return found
        top = least if most is None else most
        return least, lambda scale: shaken(top(scale), *off, T_r)

    if a is not None:
        unsaid = (
            "" if points or a == 0 else "its simulated stop begins at the present speeds: give 0, or a table"
        )
        given = constant(robot, gap, T_r, a, unsaid)
        what = Input(name=NAME, value=a, unit="m/s²", origin=Origin.GIVEN, source="workstation file")
        return lambda state: with_noise(state, (given(state), None)), what
    foreseen = Foreseen(model, robot, gap, T_r, joints=joints)
    limits = _acceleration_limits(model, robot)
    levers = Levers(model, robot, gap)
    largest = np.array([np.inf if limit is None else limit.value for limit in robot.velocity_limits])
    endless = ", ".join(j.name for j, x in zip(robot.joints, largest, strict=True) if np.isinf(x))
    carriers = model.carriers_of(robot.name)
    lead = model.workstation.engine.tick

    def reactions(state: State) -> tuple[At, At | None]:
        known = foreseen.at(state)
        if known is not None and (
            not carriers or all(stands_until(state, each, T_r + lead) for each in carriers)
        ):
            return with_noise(state, (known, None))
        v, qd = state.fastest_speeds(gap.b), state.qd(robot)
        if robot.role != "robot":
            why = f"nobody says how fast {robot.name} may get faster during the reaction time: {GIVE}"
        elif robot.on:
            why = f"{robot.name} is carried by {robot.on}, and nobody says how fast both get faster: {GIVE}"
        elif not points:
            why = f"what {robot.name} does during the reaction time is not known: {GIVE} = 0 where it may not"
        elif limits is None and endless:
            why = f"{robot.name}: neither acceleration_limits nor the speed limit of {endless}: {GIVE}"
        elif limits is None and (np.abs(qd) > (1 + BEYOND) * largest).any():
            why = f"{robot.name} is faster than its speed limits, and has no acceleration_limits: {GIVE}"
        else:
            why = ""
        if why:
            return with_noise(state, (lambda scale: held(scale * v, T_r, scale * qd, why), None))
        chains = levers.at(state)

        def with_joints(v: Array, qd: Array) -> Onset:
            return by_joints(v, T_r, qd, limits, largest, robot.coupling, chains, lead)

        def most(scale: float) -> Onset:
            return with_joints(scale * v, scale * qd)

        off = noise(state)
        top = most
        if off is not None:
            # How quickly points get faster depends on how fast joints are.
            top = lambda scale: with_joints(scale * v + off[0], np.abs(scale * qd) + off[1])  # noqa: E731
        if limits is not None:
            return most, None if off is None else top
        return (lambda scale: held(scale * v, T_r, scale * qd)), top

    named = {limit.source for limit in robot.velocity_limits if limit is not None}
    value, origin, source, unit = (
        "at once to its speed limits",
        Origin.ESTIMATED,
        "; ".join(sorted(named)),
        "",
    )
    driving = [source for source in model.workstation.sources if source.target() == robot.name]
    if robot.role == "robot" and not carriers and not any(each.live for each in driving):
        # Whom nothing drives stands.
        value, origin, source = "as its motion goes on", Origin.COMPUTED, "what drives it, known ahead"
    elif limits is not None and not carriers:
        value, origin, unit = ", ".join(f"{x:g}" for x in limits), Origin.GIVEN, "rad/s² or m/s²"
        source = f"workstation file (acceleration_limits of {robot.name})"
    elif endless or robot.role != "robot" or carriers:
        value, origin, source = "not known", Origin.MISSING, ""
    what = Input(name=NAME, value=value, unit=unit, origin=origin, source=source)
    return reactions, what


def stands_until(state: State, name: str, span: float) -> bool:
    """Whether a robot or machine is known to stand, and to go on standing for a while [s]."""
    period, t = state.model.workstation.engine.tick, state.t
    k = math.floor(t / period + 1e-6)
    instants, _ = with_knots(state.knots, name, t, k, math.ceil((t + span) / period - 1e-6), period)
    found = state.foresee(name, instants)
    if found is None or found[2]:
        return False
    q, qd, _ = found
    moved = np.abs(qd).max(initial=0.0), largest_between(instants, q, qd).max(initial=0.0)
    return bool(max(moved) <= RESTS)


def bind_riders(
    model: Model, robot: Mechanism, gap: Gap, T_r: float
) -> Callable[[State], tuple[Array, str, str]]:
    """Resolve how far machines on a robot may carry parts by themselves until all stand.

    No farther than their fingers and slides reach, whatever they do. Nothing bounds what turns.

    Args:
        model: The workstation.
        robot: Who carries them.
        gap: Its second set are the moving parts.
        T_r: Reaction time [s].

    Returns:
        From a state to ways [m], shape (n,), why they may be longer, and whose they are.
    """
    none, lead = np.zeros(len(gap.b)), model.workstation.engine.tick
    strokes: list[tuple[str, Array, str]] = []
    for rider in (model.mechanisms[name] for name in robot.riders):
        kinds = model.mj.jnt_type[model.mj.dof_jntid[rider.v_address]]
        reach = np.abs(rider.coupling) @ (rider.upper - rider.lower)
        endless = (kinds != mujoco.mjtJoint.mjJNT_SLIDE).any() or not np.isfinite(reach).all()
        why = f"{rider.name} moves on {robot.name}, and nobody says how fast it may get faster: {GIVE}"
        rows = [chain_of(model, rider, model.bodies[i]) for i in gap.b]
        ways = none if endless else np.array([reach[row].sum() for row in rows])
        strokes.append((rider.name, ways, why if endless else ""))

    def at(state: State) -> tuple[Array, str, str]:
        going = [each for each in strokes if not stands_until(state, each[0], T_r + lead)]
        why = "; ".join(filter(None, (each[2] for each in going)))
        who = ", ".join(each[0] for each in going)
        return np.sum([none, *(each[1] for each in going)], axis=0), why, who

    return at


def _acceleration_limits(model: Model, robot: Mechanism) -> Array | None:
    """Of each joint [rad/s² or m/s²], where the file has them."""
    table = next((r for r in model.workstation.robots if r.name == robot.name), None)
    given = None if table is None else table.acceleration_limits
    if not given or len(given) not in (1, len(robot.joints)):
        return None
    return np.array(np.broadcast_to(np.array(given, float), len(robot.joints)))


def joint_limits(model: Model, robot: Mechanism) -> tuple[Array, Array] | None:
    """Largest accelerations and speeds of joints, shape (j,); None without ``acceleration_limits``."""
    limits = _acceleration_limits(model, robot)
    if limits is None:
        return None
    return limits, np.array([np.inf if limit is None else limit.value for limit in robot.velocity_limits])
