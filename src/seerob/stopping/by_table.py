"""A robot stops as its maker's table says: ways of the joints, carried over to the parts that they move."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from msgspec.structs import replace

from seerob.errors import InputError, Undecided
from seerob.model import Body, Gap, Mechanism, Model
from seerob.snapshot import Input, Origin
from seerob.state import State
from seerob.stopping.table import JointStop, SpeedStop, StoppingTable, interpolate, joint_stop
from seerob.stopping.terms import At, Course, course, travel
from seerob.transforms import Array

Bound = tuple[Callable[[State], At], tuple[Input, ...]]


def not_its_own(table: StoppingTable, model: Model, robot: Mechanism) -> str:
    """Why it is not known that a table is of a robot; empty when it is."""
    entry = next(r for r in model.workstation.robots if r.name == robot.name)
    if table.robot == robot.name or entry.model in table.models:
        return ""
    return (
        f"the stopping table is that of {table.robot}, and whether {robot.name} ({entry.model}) is one is "
        "not known: say so with stop.table_for"
    )


def bind_table(
    table: StoppingTable,
    T_r: float,
    others: float | None,
    model: Model,
    robot: Mechanism,
    gap: Gap,
    *,
    rated_payload: float | None = None,
) -> Bound:
    """Course of a robot's moving parts by its stopping table, and the inputs that it needs.

    Both kinds of tables are undecided above their largest payload, and where the payload is not known.

    Args:
        table: The maker's figures.
        T_r: Reaction time [s].
        others: Stopping time of joints that the table does not have [s], None when nobody gave one.
        model: The workstation.
        robot: Who stops.
        gap: Its second set are the moving parts.
        rated_payload: Payload at which the figures hold [kg], of a table that does not say.

    Raises:
        InputError: The table speaks of joints that the robot does not have.
    """
    beyond = [entry.joint for entry in table.joints if entry.joint >= len(robot.joints)]
    if beyond:
        raise InputError.at(
            "stop",
            "table",
            f"{table.robot} has joint {beyond[0]}, {robot.name} has {len(robot.joints)} joints",
            "the table of this robot",
        )
    said = Origin.MISSING if table.rated_payload is None else Origin.STATED
    source = f"{table.source} ({table.confidence})"
    if rated_payload is not None:
        table = replace(table, rated_payload=rated_payload)
        said, source = Origin.GIVEN, "workstation file"
    load = _payload(model, robot)
    inputs = (
        Input(
            name=f"payload of {robot.name}",
            value=load if np.isfinite(load) else None,
            unit="kg",
            origin=Origin.COMPUTED if np.isfinite(load) else Origin.MISSING,
            source="masses of tools and workpieces",
        ),
        Input(
            name="rated payload of the stopping table",
            value=table.rated_payload,
            unit="kg",
            origin=said,
            source=source,
        ),
    )
    if table.tool is not None:
        return _by_tool_speed(table, table.tool, T_r, robot, gap, load), inputs
    return _by_joint(table, T_r, others, model, robot, gap, load), inputs


def _by_tool_speed(
    table: StoppingTable, tool: SpeedStop, T_r: float, robot: Mechanism, gap: Gap, load: float
) -> Callable[[State], At]:
    def courses(state: State) -> At:
        share = _payload_share(table, robot, load)
        if not share <= 1 + 1e-9:
            raise Undecided(f"payload is {share:.3g} of the rated payload, at which the stopping table ends")
        v = state.fastest_points(gap.b)[0]
        # Any point counts as the tool's: the fastest decides for all.
        top = float(v.max())
        return lambda scale: course(
            scale * v, T_r, interpolate([tool.speed], np.array(tool.time), [scale * top])
        )

    return courses


def _by_joint(
    table: StoppingTable,
    T_r: float,
    others: float | None,
    model: Model,
    robot: Mechanism,
    gap: Gap,
    load: float,
) -> Callable[[State], At]:
    entries = {entry.joint: entry for entry in table.joints}
    full = [_full_speed(entries.get(j), robot, j) for j in range(len(robot.joints))]
    chains = [_chain(model, robot, model.bodies[i]) for i in gap.b]
    kinds = model.mj.jnt_type[model.mj.dof_jntid[robot.v_address]]
    turns = kinds == mujoco.mjtJoint.mjJNT_HINGE

    def joint(j: int, speed: float, extension: float) -> tuple[float, float]:
        name = robot.joints[j].name
        if speed == 0.0:
            return 0.0, 0.0
        if j not in entries:
            if others is None:
                raise Undecided(f"{name}: not in the stopping table, and stop.stopping is not given")
            return speed * others, others
        whole = full[j]
        if not whole:
            raise Undecided(f"{name}: neither the stopping table nor the robot says what full speed is")
        share = _payload_share(table, robot, load)
        way, time = joint_stop(entries[j], speed / whole, share, extension)
        return min(way, speed * time), time

    def courses(state: State) -> At:
        speeds = np.abs(state.qd(robot))
        v = state.fastest_points(gap.b)[0]
        levers = [_levers(state, robot, chain, index) for chain, index in zip(chains, gap.b, strict=True)]
        extension = _extension(state, robot) / table.reach if table.reach is not None else 1.0

        def at(scale: float) -> Course:
            stops = [joint(j, float(scale * speed), extension) for j, speed in enumerate(speeds)]
            ways = T_r * scale * speeds + np.array([way for way, _ in stops])
            every = np.abs(robot.coupling) @ ways
            total = np.array(
                [travel(turns[c], every[c], arms) for c, arms in zip(chains, levers, strict=True)]
            )
            # What the way of both exceeds the reaction's by; the lever may grow during the reaction.
            S_r = scale * v * T_r
            return Course(scale * v, S_r, np.maximum(total - S_r, 0.0), max(time for _, time in stops))

        return at

    return courses


def _payload_share(table: StoppingTable, robot: Mechanism, load: float) -> float:
    if table.rated_payload is None:
        raise Undecided(
            f"the stopping table of {table.robot} does not say for which payload it holds: give "
            "stop.rated_payload, from the robot's data sheet"
        )
    if not np.isfinite(load):
        raise Undecided("; ".join(robot.unknown_masses))
    return load / table.rated_payload


def _full_speed(entry: JointStop | None, robot: Mechanism, j: int) -> float | None:
    if entry is not None and entry.full_speed is not None:
        return entry.full_speed
    limit = robot.velocity_limits[j]
    return None if limit is None else limit.value


def _payload(model: Model, robot: Mechanism) -> float:
    """Mass of tools and workpieces on a robot [kg]; NaN when nobody gave one."""
    if robot.unknown_masses:
        return float("nan")
    bodies = [model.mj.body(int(i)) for i in robot.mj_bodies]
    return float(sum(body.mass[0] for body in bodies if body.name not in robot.links))


def _chain(model: Model, robot: Mechanism, body: Body) -> Array:
    """Joints of a robot that move a body, from the base outward, as rows of its coupling, shape (k,)."""
    found: list[int] = []
    at = body.mj
    while at:
        here = [row for row, dof in enumerate(robot.v_address) if model.mj.dof_bodyid[dof] == at]
        found = here + found
        at = int(model.mj.body_parentid[at])
    return np.array(found, np.int64)


def _levers(state: State, robot: Mechanism, chain: Array, index: int) -> Array:
    """Largest distance of a body from each axis of its chain [m], shape (k,)."""
    body = state.model.bodies[index]
    if index in state.bearers.away:
        return np.zeros(len(chain))
    joints = state.model.mj.dof_jntid[robot.v_address[chain]]
    R, x = state.placed((index,))
    data = state.data_of(robot.name)
    corners = x[index] + body.corners @ R[index].T
    arms = corners[None] - data.xanchor[joints][:, None]
    along = np.einsum("kci,ki->kc", arms, data.xaxis[joints])
    squares = np.einsum("kci,kci->kc", arms, arms) - along**2
    return np.asarray(np.sqrt(np.maximum(squares, 0.0).max(axis=1)) + body.radius + body.deviation)


def _extension(state: State, robot: Mechanism) -> float:
    """Distance of the flange from the first axis [m]."""
    joint = int(state.model.mj.dof_jntid[robot.v_address[0]])
    flange = state.model.frames[f"{robot.name}/{robot.description.tip}"]
    data = state.data_of(robot.name)
    arm = state.pose(flange)[1] - data.xanchor[joint]
    if state.model.mj.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
        return float(np.linalg.norm(arm))
    return float(np.linalg.norm(np.cross(data.xaxis[joint], arm)))
