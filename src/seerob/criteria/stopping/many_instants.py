"""How far the moving parts of a robot come while it stops, at many instants."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from seerob.core.transforms import Array
from seerob.criteria.stopping.models import SHARES, Stop
from seerob.criteria.stopping.onset import LARGEST_WINDOW, Onset, accelerated
from seerob.criteria.stopping.terms import Course, braking
from seerob.kernels.ahead import Reaction, part_speeds, reactions
from seerob.kernels.spans import Chains
from seerob.model.model import Gap, Mechanism, Model
from seerob.twin.spans import ROUNDING, Indices, Points, Ways, rows_of
from seerob.twin.states import Motion, States
from seerob.twin.validity.hearing import SLACK


def courses(model: Model, stop: Stop, gap: Gap) -> Callable[[States], Course] | None:
    """Courses of the moving parts at N instants, shape (N, b).

    None where the stopping time is not given or has a tolerance, or what the motion does ahead is to be asked
    instant by instant.

    Args:
        model: The workstation.
        stop: How the robot stops.
        gap: From whom to its moving parts.
    """

    def speeds(states: States) -> Array:
        return states.fastest_points(gap.b)[0]

    if stop.model not in SHARES or stop.stopping is None or stop.tolerance is not None:
        return None
    a, T_r, T_s, share = stop.acceleration, stop.reaction, stop.stopping, SHARES[stop.model]
    if a is not None:
        return lambda states: braking(accelerated(speeds(states), T_r, a, np.zeros(0)), T_s, share)
    ahead = _Ahead.of(model, gap, T_r)
    return None if ahead is None else lambda states: braking(ahead.at(states, speeds(states)), T_s, share)


class _Ahead:
    """Speeds of the parts along a motion that is known ahead, of a robot that stands on its own.

    They are bounded as by `seerob.criteria.stopping.onset.Foreseen`.
    """

    def __init__(
        self, model: Model, robot: Mechanism, gap: Gap, T_r: float, dofs: Indices, chains: Chains
    ) -> None:
        self._robot, self._parts, self._T_r, self._chains = robot, list(gap.b), T_r, chains
        self._dofs, self._period, self._home = dofs, model.workstation.engine.tick, model.mj.qpos0[dofs]

    @classmethod
    def of(cls, model: Model, gap: Gap, T_r: float) -> _Ahead | None:
        """None where more than the robot's own joints moves the parts, or the time is too long."""
        movers = {model.bodies[i].mover for i in gap.b}
        robot = model.mechanisms.get(next(iter(movers)) or "") if len(movers) == 1 else None
        if robot is None or robot.role != "robot" or robot.on or robot.riders or T_r > LARGEST_WINDOW:
            return None
        if any(model.bodies[i].holder for i in gap.b):
            return None
        ids = np.array([body.mj for body in model.bodies], np.int64)
        dofs, chains = Points(model).chains(rows_of(gap.b), ids, model.mj)
        own = dofs.tolist() == robot.v_address.tolist()
        direct = np.array_equal(robot.coupling, np.eye(len(robot.v_address))) and not robot.offset.any()
        return cls(model, robot, gap, T_r, dofs, chains) if own and direct else None

    def at(self, states: States, v_r: Array) -> Onset:
        """From each instant to the beginning of braking; what is not known ahead is left to be asked alone.

        Args:
            states: The instants.
            v_r: Speeds of the parts there [m/s], shape (N, b).
        """
        n, motion = len(states), states.motion
        whole, begin = (motion if motion.of is None else motion.of), motion.begin
        nothing = Onset(v_r, v_r * self._T_r, v_r, None, None)
        if not whole.foreseen or not isinstance(whole.ways, Ways):
            states.alone = np.ones(n, bool)
            return nothing
        period, T_r, ways = self._period, self._T_r, whole.ways
        every = np.arange(len(whole.t))
        on_time = np.flatnonzero(whole.t != period * every)
        count = int(on_time[0]) if len(on_time) else len(whole.t)
        ends = np.ceil((motion.t + T_r + period) / period - 1e-6).astype(np.int64)
        k = np.arange(begin, begin + n)
        invalid = np.cumsum([0, *(whole.invalid_reasons[self._robot.name] != "")])
        known = (k < count) & (ends < count)
        top = np.minimum(ends, len(whole.t) - 1)
        known &= invalid[top + 1] == invalid[k]
        states.alone = states.alone | ~known
        if not known.any():
            return nothing
        a, b = int(ways.first[begin]), int(ways.first[top[known][-1]])
        t, q, v = (np.ascontiguousarray(each[a : b + 1]) for each in (ways.t, ways.q, ways.v))
        own = ways.first[begin : begin + n] - a
        own = own[own < len(t)]
        others = np.setdiff1d(np.arange(len(t)), own)
        speeds = np.empty((len(t), len(self._parts)))
        speeds[own] = v_r[: len(own)]
        if len(others):
            elsewhere = states.elsewhere(Motion(t[others], q[others], v[others], whole.invalid_reasons))
            speeds[others] = elsewhere.largest_speeds()[:, self._parts]
        joint_q, joint_v = (np.ascontiguousarray(each[:, self._dofs]) for each in (q, v))
        bounds = np.empty((len(t) - 1, 2, len(self._parts)))
        part_speeds(t, joint_q, joint_v, speeds, self._home, self._chains, ROUNDING, bounds)
        S_r, v_s = nothing.S_r.copy(), v_r.copy()
        ways_there, tops = np.empty((2, int(known.sum()), len(self._parts)))
        first, last = (np.asarray(ways.first[each[known]] - a, np.int64) for each in (k, ends))
        reaction = Reaction(0.0, T_r + period, T_r, period, SLACK)
        reactions(t, bounds, first, last, v_r[known], reaction, ways_there, tops)
        S_r[known], v_s[known] = ways_there, tops
        return Onset(v_r, S_r, v_s, None, None)
