"""Joints of one robot out of ROS messages: by name, from one publisher or from several."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import NamedTuple

from seerob.core.samples import JointSample, Quality
from seerob.protocols import ProtocolError
from seerob.protocols.ros.ros_messages import Joints, Plan

APART = 2.0
"""Periods by which the joints of one sample may be apart before it is no longer judged."""


class _Last(NamedTuple):
    arrived: float
    stamp: float | None
    q: float
    qd: float | None
    tau: float | None


class JointGather:
    """Puts together what is said of a robot's joints.

    Several publishers may share a topic, an arm and a gripper for instance, and no message need have all
    joints: there is a sample whenever each joint was heard since the last one. It speaks of the instant of
    the oldest of them.

    Args:
        target: The robot.
        names: Its joints as ROS calls them, in the robot's order; those of the first message when empty.
        period: Expected between messages [s].
    """

    def __init__(self, target: str, names: tuple[str, ...], period: float) -> None:
        self._target, self._names, self._period = target, names, period
        self._last: dict[str, _Last] = {}
        self._others: dict[str, None] = {}

    def take(self, arrived: float, said: Joints) -> JointSample | None:
        """A sample, when a message completes one.

        Args:
            arrived: Host's monotonic time [s].
            said: The message.
        """
        if not said.position:
            return None
        names = self._names = self._names or said.names
        for k, name in enumerate(said.names):
            if name in names:
                self._last[name] = _Last(
                    arrived,
                    said.stamp,
                    said.position[k],
                    said.velocity[k] if said.velocity else None,
                    said.effort[k] if said.effort else None,
                )
            elif len(self._others) < 16:
                self._others[name] = None
        if len(self._last) < len(names):
            return None
        every = [self._last[name] for name in names]
        self._last.clear()
        stamps = [last.stamp for last in every if last.stamp is not None]
        stamped = len(stamps) == len(every)
        instants = stamps if stamped else [last.arrived for last in every]
        q = tuple(last.q for last in every)
        quality = Quality.GOOD
        if max(instants) - min(instants) > APART * self._period:
            quality = Quality.DEGRADED
        if not all(map(math.isfinite, q)):
            quality = Quality.INVALID
        return JointSample(
            source="",
            seq=0,
            t=arrived,
            t_device=min(stamps) if stamped else None,
            target=self._target,
            q=q,
            qd=_all([last.qd for last in every]),
            tau=_all([last.tau for last in every]),
            quality=quality,
        )

    def lacking(self) -> str:
        """Why there is no sample, for a message."""
        lost = [name for name in self._names if name not in self._last]
        others = ", ".join(self._others) or "none"
        return f"nothing is said of {', '.join(lost[:12]) or 'any joint'}; other joints that are: {others}"


def _all(values: list[float | None]) -> tuple[float, ...] | None:
    """None when one is not known: half of the speeds are no speeds."""
    known = tuple(v for v in values if v is not None and math.isfinite(v))
    return known if len(known) == len(values) else None


class PlayedPlan:
    """A trajectory that somebody commanded, as if a robot followed it exactly.

    Between points it is the cubic with their positions and speeds, or a straight line when there are none.

    Args:
        plan: The trajectory.
        names: The robot's joints as ROS calls them, in its order; those of the plan when empty.

    Raises:
        ProtocolError: It has no points, not all joints, or values that are not finite.
    """

    def __init__(self, plan: Plan, names: tuple[str, ...]) -> None:
        names = names or plan.names
        lost = [name for name in names if name not in plan.names]
        if lost or not plan.points:
            raise ProtocolError(f"a trajectory without {', '.join(lost[:12]) or 'points'}")
        order = [plan.names.index(name) for name in names]
        self.times = [p.t for p in plan.points]
        self._q = [tuple(p.position[k] for k in order) for p in plan.points]
        self._qd = [tuple(p.velocity[k] for k in order) if p.velocity else None for p in plan.points]
        if not all(math.isfinite(x) for row in [*self._q, *(v for v in self._qd if v)] for x in row):
            raise ProtocolError("a trajectory with values that are not finite")

    def at(self, t: float) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
        """Positions and speeds at a time since its start [s]; None before its first point."""
        if t < self.times[0]:
            return None
        if t >= self.times[-1]:
            return self._q[-1], (0.0,) * len(self._q[-1])
        k = bisect_right(self.times, t) - 1
        T = self.times[k + 1] - self.times[k]
        s = (t - self.times[k]) / T
        a, b, va, vb = self._q[k], self._q[k + 1], self._qd[k], self._qd[k + 1]
        if va is None or vb is None:
            q = tuple(x + s * (y - x) for x, y in zip(a, b, strict=True))
            return q, tuple((y - x) / T for x, y in zip(a, b, strict=True))
        # Cubic Hermite polynomial.
        h = (1 - 3 * s**2 + 2 * s**3, 3 * s**2 - 2 * s**3, T * s * (1 - s) ** 2, T * s**2 * (s - 1))
        d = (6 * s * (s - 1) / T, 6 * s * (1 - s) / T, (1 - s) * (1 - 3 * s), s * (3 * s - 2))
        rows = list(zip(a, b, va, vb, strict=True))
        return (
            tuple(sum(w * x for w, x in zip(h, row, strict=True)) for row in rows),
            tuple(sum(w * x for w, x in zip(d, row, strict=True)) for row in rows),
        )
