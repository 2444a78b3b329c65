r"""A robot stops as its maker's table says: ways of the joints, carried over to the parts that they move.

What such a stop needs at most, whenever it begins within a span of time: all that it rests on only grows
with the speeds of the joints, with how far parts reach from the axes, and with how far the flange is from the
first one. So what bounds these within a span bounds way and time of every stop that begins in it. Within half
its length, joint k moves by at most :math:`h_k`, and with that a part's lever on an axis, which only joints
farther out change, is at most

.. math:: \lambda_k = \rho_k + D_k, \qquad D_{k-1} = D_k + h_k \lambda_k

with :math:`\rho_k` the lever in the middle of the span, and D = 0 at the tip.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import mujoco
import numpy as np
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.core.snapshot import Input, Origin
from seerob.core.transforms import Array
from seerob.criteria.stopping.onset import (
    LARGEST_WINDOW,
    KinematicChain,
    Levers,
    Onset,
    by_joints,
    largest_between,
    with_knots,
)
from seerob.criteria.stopping.table import JointStop, SpeedStop, StoppingTable, along_axis, joint_stop
from seerob.criteria.stopping.terms import Braking, Course, braking, travel
from seerob.model.model import Gap, Mechanism, Model
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.spans import ROUNDING, Indices, Points, Span, rows_of
from seerob.twin.state import State
from seerob.twin.validity.hearing import SLACK

InSpan = Callable[[Points], Callable[[Span], Course | None]]
"""From the points of which the motion is bounded to the longest course that begins within a span; None where
nobody knows."""
Stopping = Callable[[Onset, float, Sequence[KinematicChain]], Course]
"""Course after an onset, with the flange so far from the first axis [m] and parts so far from theirs."""
Bound = tuple[Braking, Callable[[Onset], Course] | None, tuple[Input, ...], InSpan | None]


def other_robot_reason(table: StoppingTable, model: Model, robot: Mechanism) -> str:
    """Why it is not known that a table is of a robot; empty when it is."""
    entry = next(r for r in model.workstation.robots if r.name == robot.name)
    if table.robot == robot.name or (entry.model in table.models and entry.scale == 1):
        return ""
    which = entry.model if entry.scale == 1 else f"{entry.model}, × {entry.scale:g}"
    return (
        f"the stopping table is that of {table.robot}, and whether {robot.name} ({which}) is one is "
        "not known: say so with stop.table_for"
    )


ROUNDED = 1.02
"""Share of speed times time up to which a way may be so far by the rounding of what is published."""


def impossible(table: StoppingTable, robot: Mechanism) -> Iterator[str]:
    """Why figures of a table cannot be those of one robot: ways of what does not only brake."""
    for entry in table.joints:
        full = _full_speed(entry, robot, entry.joint) if entry.joint < len(robot.joints) else None
        most = max(entry.shares(full)) if full else 0.0
        if most > ROUNDED:
            yield (
                f"the stopping table contradicts itself: joint {entry.joint} goes {most:.3g} times as far as "
                "at its speed for all of its time (way in rad or m, time in s, full_speed in rad/s or m/s?)"
            )


def bind_table(
    table: StoppingTable,
    others: float | None,
    model: Model,
    robot: Mechanism,
    gap: Gap,
    *,
    rated_payload: float | None = None,
    bind: Callable[[Stopping], InSpan | None],
) -> Bound:
    """How a robot's moving parts brake by its stopping table, and the inputs that it needs.

    Beyond a table, and where the payload is not known, what the table has at its end is a bound from below:
    figures that fall along an axis are not used, so none is less farther on. The course says so.

    Args:
        table: The maker's figures.
        others: Stopping time of joints that the table does not have [s], None when nobody gave one.
        model: The workstation.
        robot: Who stops.
        gap: Its second set are the moving parts.
        rated_payload: Payload at which the figures hold [kg], of a table that does not say.
        bind: Makes of how joints stop what bounds it within a span.

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
        by_onset = _by_tool_speed(table, table.tool, robot, load)
        return lambda state: lambda onset, scale: by_onset(onset), by_onset, inputs, None
    braking, stopping = _by_joint(table, others, model, robot, gap, load)
    return braking, None, inputs, bind(stopping)


def _by_tool_speed(
    table: StoppingTable, tool: SpeedStop, robot: Mechanism, load: float
) -> Callable[[Onset], Course]:
    share, unknown = _payload_share(table, robot, load)
    # The worse corner, as of `interpolate`.
    times = np.maximum.accumulate(np.array(tool.time)).tolist()
    if share > 1 + 1e-9:
        unknown = f"payload is {share:.3g} of the rated payload, at which the stopping table ends"

    def after(onset: Onset) -> Course:
        # Any point counts as the tool's: the fastest decides for all.
        top, end = float(np.maximum.reduce(onset.v_s)), tool.speed[-1]
        T_s, beyond = along_axis(tool.speed, times, min(top, end)), ""
        if top > end * (1 + 1e-9):
            beyond = f"{top:.3g} m/s is beyond the stopping table, which ends at {end:g} m/s"
        if unknown or beyond:
            reasons = filter(None, (onset.unbounded_reason, unknown, beyond))
            onset = replace(onset, unbounded_reason="; ".join(reasons))
        return braking(onset, T_s)

    return after


def _by_joint(
    table: StoppingTable,
    others: float | None,
    model: Model,
    robot: Mechanism,
    gap: Gap,
    load: float,
) -> tuple[Braking, Stopping]:
    entries = {entry.joint: entry for entry in table.joints}
    full = [_full_speed(entries.get(j), robot, j) for j in range(len(robot.joints))]
    levers = Levers(model, robot, gap)
    share, unknown = _payload_share(table, robot, load)

    def joint(j: int, speed: float, extension: float) -> tuple[float, float, str]:
        """Way, time, and why both may be more."""
        name = robot.joints[j].name
        if speed == 0.0:
            return 0.0, 0.0, ""
        if j not in entries:
            if others is None:
                return 0.0, 0.0, f"{name}: not in the stopping table, and stop.stopping is not given"
            return speed * others, others, ""
        entry, whole = entries[j], full[j]
        if not whole:
            return 0.0, 0.0, f"{name}: neither the stopping table nor the robot says what full speed is"
        asked = (speed / whole, share, extension)
        axes = (entry.speed, entry.payload, entry.extension)
        within = tuple(min(x, axis[-1]) for x, axis in zip(asked, axes, strict=True))
        beyond = next(
            (
                f"{name}: {what} is {x:.3g} of the full figure, the stopping table ends at {axis[-1]:g}"
                for what, x, axis in zip(("speed", "payload", "extension"), asked, axes, strict=True)
                if x > axis[-1] * (1 + 1e-9)
            ),
            "",
        )
        way, time = joint_stop(entry, *within)
        return min(way, speed * time), time, beyond or unknown

    def after(onset: Onset, far: float, chains: Sequence[KinematicChain]) -> Course:
        speeds, ways = onset.speeds, onset.ways
        assert speeds is not None
        assert ways is not None
        extension = far / table.reach if table.reach is not None else 1.0
        stops = [joint(j, float(speed), extension) for j, speed in enumerate(speeds)]
        every = np.abs(robot.coupling) @ (ways + np.array([way for way, _, _ in stops]))
        total = np.array([travel(turns.tolist(), every[rows], arms) for turns, rows, arms in chains])
        # What the way of both exceeds the reaction's by; the lever may grow during the reaction.
        beside = np.maximum(total - onset.S_r, 0.0)
        unbounded_reasons = dict.fromkeys((onset.unbounded_reason, *(why for _, _, why in stops)))
        longest = max(time for _, time, _ in stops)
        return Course(onset.v_r, onset.S_r, beside, longest, "; ".join(filter(None, unbounded_reasons)))

    def bound(state: State) -> Callable[[Onset, float], Course]:
        chains = levers.at(state)
        far = reach_of(state.data_of(robot.name), state.model, robot)

        def at(onset: Onset, scale: float) -> Course:
            if onset.speeds is None or onset.ways is None:
                speeds, ways = scale * np.abs(state.qd(robot)), np.zeros(len(robot.joints))
                unbounded_reason = (
                    "an acceleration of points says nothing of joints, and the stopping table is by joints: "
                    f"give acceleration_limits of {robot.name} instead of stop.acceleration"
                )
                onset = replace(onset, speeds=speeds, ways=ways, unbounded_reason=unbounded_reason)
            return after(onset, far, chains)

        return at

    return bound, after


def _payload_share(table: StoppingTable, robot: Mechanism, load: float) -> tuple[float, str]:
    """Share of the rated payload, and why it is not known: then 0, where a robot stops soonest."""
    if table.rated_payload is None:
        return 0.0, (
            f"the stopping table of {table.robot} does not say for which payload it holds: give "
            "stop.rated_payload, from the robot's data sheet"
        )
    if not np.isfinite(load):
        return 0.0, "; ".join(robot.unknown_masses)
    return load / table.rated_payload, ""


def _full_speed(entry: JointStop | None, robot: Mechanism, j: int) -> float | None:
    if entry is not None and entry.full_speed is not None:
        return entry.full_speed
    limit = robot.velocity_limits[j]
    return None if limit is None else limit.value


def _payload(model: Model, robot: Mechanism) -> float:
    """Mass of all that a robot carries, the most that tolerances allow [kg]; NaN when nobody gave one."""
    if robot.unknown_masses:
        return float("nan")
    return MassTolerances(model, robot).heaviest_load()


def reach_of(data: mujoco.MjData, model: Model, robot: Mechanism) -> float:
    """Distance of a robot's flange from its first axis [m], of data with kinematics."""
    joint = int(model.mj.dof_jntid[robot.v_address[0]])
    flange = model.frames[f"{robot.name}/{robot.description.tip}"]
    at = data.xpos[flange.mj] + data.xmat[flange.mj].reshape(3, 3) @ flange.body_from_frame[:3, 3]
    arm = at - data.xanchor[joint]
    if model.mj.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
        return float(np.linalg.norm(arm))
    return float(np.linalg.norm(np.cross(data.xaxis[joint], arm)))


def grown(chain: KinematicChain, half: Array) -> KinematicChain:
    """Replace the levers of a chain, given in the middle of a span, by their largest within it.

    Args:
        chain: Of a part.
        half: Bound on the way of each of its joints within half the span [rad or m], shape (k,).
    """
    levers, outward = chain.levers.copy(), 0.0
    for k in range(len(levers) - 1, -1, -1):
        levers[k] += outward
        outward += float(half[k] * levers[k]) if chain.turns[k] else float(half[k])
    return chain._replace(levers=levers)


def bind_in_span(
    model: Model,
    robot: Mechanism,
    gap: Gap,
    after: Stopping,
    *,
    T_r: float,
    held: bool,
    limits: tuple[Array, Array] | None,
) -> InSpan | None:
    """Resolve what bounds the stops of a robot that begin within a span.

    Args:
        model: The workstation.
        robot: Who stops.
        gap: Its second set are the moving parts.
        after: How it brakes.
        T_r: Reaction time [s].
        held: Whether nothing gets faster during that time.
        limits: Largest accelerations and speeds of its joints, where they are known.

    Returns:
        None where others move with it, or its parts change hands: then nothing is bounded.
    """
    if robot.on or robot.riders or T_r > LARGEST_WINDOW or any(model.bodies[i].holder for i in gap.b):
        return None
    levers, parts = Levers(model, robot, gap), rows_of(gap.b)
    own_q, own_v = robot.q_address[robot.own], robot.v_address[robot.own]
    flange = model.frames[f"{robot.name}/{robot.description.tip}"]
    tip, period = flange.body_from_frame[:3, 3], model.workstation.engine.tick
    data = mujoco.MjData(model.mj)

    def bind(points: Points) -> Callable[[Span], Course | None]:
        row = points.add(flange.mj, tip)

        def at_most(span: Span) -> Course | None:
            noise = span.joint_noise[own_v]
            speeds, v = span.qd[own_v] + noise, (span.fast + span.noise)[parts]
            if not (np.isfinite(speeds).all() and np.isfinite(v).all()):
                return None
            middle = span.path.at((span.begin + span.end) / 2)[0]
            data.qpos[:] = middle
            mujoco.mj_kinematics(model.mj, data)
            half = span.qd[robot.v_address] * span.T / 2 + ROUNDING
            chains = [grown(chain, half[chain.rows]) for chain in levers.placed(data)]
            onset = None
            if held:
                onset = Onset(v, v * T_r, v, speeds * T_r, speeds)
            elif (known := known_in_span(span, robot.name, T_r, period, own_v)) is not None:
                u, ways, whole, q = known
                u, ways, whole = u + noise, ways + noise * T_r, whole + noise * T_r
                moved = np.maximum(whole, np.abs(q - middle[own_q]).max(axis=0)) + ROUNDING
                every = np.abs(robot.coupling) @ moved
                far = [travel(turns.tolist(), every[rows], arms) for turns, rows, arms in chains]
                onset = Onset(v, np.maximum(far, v * T_r), v, ways, u)
            elif limits is not None and span.foresee(robot.name, np.zeros(0)) is None:
                onset = by_joints(v, T_r, speeds, *limits, robot.coupling, chains, period)
            if onset is None:
                return None
            extension = reach_of(data, model, robot) + float(span.fast[row]) * span.T + ROUNDING
            course = after(onset, extension, chains)
            return None if course.unbounded_reason else course

        return at_most

    return bind


def known_in_span(
    span: Span, name: str, T_r: float, period: float, own_v: Indices
) -> tuple[Array, Array, Array, Array] | None:
    """Of a motion that is known ahead, bounds for reactions that begin in a span, see `onset.Foreseen`.

    Returns:
        Largest speeds of the joints, their ways within T_r, and within that and a tick, shape (j,), and where
        they are at the ticks [rad or m], shape (m, j); None where nobody knows.
    """
    path, lead = span.path, period
    b = float(path.t[-1])
    k, end = math.floor(b / period + 1e-6), span.end + T_r + lead
    t, _ = with_knots(span.knots, name, b, k, math.ceil(end / period - 1e-6), period)
    foreseen = span.foresee(name, t)
    if foreseen is None or foreseen[2]:
        return None
    q, qd, _ = foreseen
    now, least = span.qd[own_v], np.abs(path.at(b)[1][own_v])
    between = largest_between(t, q, qd)
    between[0] = np.maximum(between[0], least)
    t = np.minimum(np.concatenate([[span.begin], t]), end)
    most = np.vstack([np.maximum(now, least), between])
    whole = np.diff(t) @ most
    most[0] = least
    ends = most[(t[:-1] < span.end + lead - SLACK) | (t[1:] > span.begin + T_r + SLACK)].min(axis=0)
    ways = np.maximum(whole - lead * ends, now * T_r)
    return np.maximum(now, between.max(axis=0)), ways, whole, q
