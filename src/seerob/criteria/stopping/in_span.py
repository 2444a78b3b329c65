r"""What a stop by a joint table needs at most, whenever it begins within a span of time.

All that a stop by table rests on only grows with the speeds of the joints, with how far parts reach from the
axes, and with how far the flange is from the first one (`seerob.criteria.stopping.by_table`). So what bounds
these within a span bounds way and time of every stop that begins in it. Within half its length, joint k moves
by at most :math:`h_k`, and with that a part's lever on an axis, which only joints farther out change, is at
most

.. math:: \lambda_k = \rho_k + D_k, \qquad D_{k-1} = D_k + h_k \lambda_k

with :math:`\rho_k` the lever in the middle of the span, and D = 0 at the tip.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import mujoco
import numpy as np

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
from seerob.criteria.stopping.terms import Course, travel
from seerob.model.model import Gap, Mechanism, Model
from seerob.twin.spans import ROUNDING, Indices, Points, Span, rows_of
from seerob.twin.validity.hearing import SLACK

InSpan = Callable[[Points], Callable[[Span], Course | None]]
"""From the points of which the motion is bounded to the longest course that begins within a span; None where
nobody knows."""
Stopping = Callable[[Onset, float, Sequence[KinematicChain]], Course]
"""Course after an onset, with the flange so far from the first axis [m] and parts so far from theirs."""


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
