"""Machines that follow variables: what was said becomes where the machine is, and whether that is known."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from seerob.core.samples import SignalSample
from seerob.core.transforms import Array
from seerob.twin.signals import Signals
from seerob.workstation.tables.machines import AtEnd, Belt, Fingers, Motion, Route, Slide, Turn, Vehicle
from seerob.workstation.variables import Value
from seerob.workstation.workstation import Machine

SETTLE = 0.3
"""Time in which a part that its belt's speed carried takes on the place that its position tells [s]."""
FAR = 0.1
"""Off by more than this [m], it is put there at once."""
LONGEST_STEP = 0.5
"""Between two pictures that a belt's speed is summed up over [s]; longer is a silence."""

HOLD = 0.5
"""After a place that nothing brought it to, nothing is relied on for so long [s]: as of live robots, see
`seerob.devices.live.device_clock.HOLD`. What is wrong once may be wrong again."""

ON_ITS_WAY = "on its way since"
"""Begin of the doubt about a machine that is between the two ends that it tells of."""


class Moved(NamedTuple):
    """Where a machine is at an instant."""

    machine: str
    t: float
    """[s]"""
    q: Array
    """Joint positions [m or rad]."""
    qd: Array | None
    """Joint velocities [m/s or rad/s]; None to be derived."""
    invalid_reason: str
    """Why it may be elsewhere; empty when it is known."""
    anew: bool = False
    """It was put there, and did not move there."""
    age: float = 0.0
    """How much older than ``t`` what is known of it may be [s]."""


class Place(NamedTuple):
    """What a motion makes of its variables."""

    q: Array
    qd: Array | None = None
    invalid_reason: str = ""
    anew: bool = False


Follow = Callable[[float, Mapping[str, Value]], Place]
"""Tells where a machine is, given an instant [s] and values by variable."""


class Machines:
    """The machines of a workstation that follow variables.

    Args:
        machines: Tables of the workstation file.
        signals: What is known of the variables.
    """

    def __init__(self, machines: tuple[Machine, ...], signals: Signals) -> None:
        self._signals = signals
        self._followers: dict[str, list[_Follower]] = {}
        for machine in machines:
            names = tuple(machine.motion.variables())
            sources = {signals.dictionary[name].source for name in names}
            follower = _Follower(machine, names)
            for source in sources:
                self._followers.setdefault(source, []).append(follower)

    def hear(self, sample: SignalSample) -> Iterator[Moved]:
        """Where the machines are that follow the variables of a picture, which `Signals` has taken."""
        for follower in self._followers.get(sample.source, ()):
            moved = follower.at(sample.t, self._signals, sample.ages)
            if moved is not None:
                yield moved


class _Follower:
    def __init__(self, machine: Machine, names: tuple[str, ...]) -> None:
        self._name, self._names = machine.name, names
        self._follow = follow(machine.motion)
        self._lose = getattr(self._follow, "lose", lambda reason: None)
        self._last: Array | None = None
        self._t = -math.inf

    def at(self, t: float, signals: Signals, ages: Mapping[str, float]) -> Moved | None:
        """Where it is at an instant; None when that is not newer, or when nothing was heard yet."""
        if t <= self._t:
            return None
        known = {name: signals.at(name, t) for name in self._names}
        invalid_reason = next((k.invalid_reason for k in known.values() if k.invalid_reason), "")
        values = {name: k.value for name, k in known.items() if k.value is not None}
        if invalid_reason:
            self._lose(invalid_reason)
            if self._last is None:
                return None
            self._t = t
            return Moved(self._name, t, self._last, np.zeros_like(self._last), invalid_reason)
        place = self._follow(t, values)
        self._last, self._t = place.q, t
        invalid_reason = next((signals.untimed[name] for name in self._names if name in signals.untimed), "")
        age = max((ages.get(name, 0.0) for name in self._names), default=0.0)
        return Moved(
            self._name, t, place.q, place.qd, place.invalid_reason or invalid_reason, place.anew, age
        )


def follow(motion: Motion) -> Follow:
    """How a motion follows its variables, from its begin on."""
    if isinstance(motion, Belt):
        return _Carried(motion, length=motion.length, at_end=motion.at_end)
    if isinstance(motion, Vehicle):
        return _Driven(motion)
    if isinstance(motion, Route):
        return _Routed(motion)
    if isinstance(motion, Fingers):
        return _Gripping(motion)
    if motion.open is not None:
        return _Ends(motion, motion.open)
    if isinstance(motion, Slide):
        return lambda t, values: Place(np.array([_number(values, motion.position)]))
    return _Turned(motion)


def _number(values: Mapping[str, Value], name: str | None) -> float:
    return float(values[name or ""])


class _Turned:
    """An angle that may start again after a turn."""

    def __init__(self, motion: Turn) -> None:
        self._angle, self._endless = motion.angle, motion.lower is None and motion.upper is None
        self._last: float | None = None

    def __call__(self, t: float, values: Mapping[str, Value]) -> Place:
        self._last = nearest_turn(_number(values, self._angle), self._last if self._endless else None)
        return Place(np.array([self._last]))


class _Driven:
    """A pose on the floor."""

    def __init__(self, motion: Vehicle) -> None:
        self._motion = motion
        self._heading: float | None = None

    def __call__(self, t: float, values: Mapping[str, Value]) -> Place:
        m = self._motion
        self._heading = nearest_turn(_number(values, m.heading), self._heading)
        return Place(np.array([_number(values, m.x), _number(values, m.y), self._heading]))


class _Gripping:
    """Two fingers, of which each goes half the way."""

    def __init__(self, motion: Fingers) -> None:
        self._ends = None if motion.open is None else _Ends(motion, motion.open)
        self._opening = motion.opening

    def __call__(self, t: float, values: Mapping[str, Value]) -> Place:
        if self._ends is None:
            return Place(np.array([0.5 * _number(values, self._opening)]))
        place = self._ends(t, values)
        return place._replace(q=0.5 * place.q)


class _Routed:
    """A pose on the floor from a way along a track."""

    def __init__(self, motion: Route) -> None:
        self._track = motion.track
        at_end = AtEnd.LOOP if motion.closed else AtEnd.STOP
        self._way = _Carried(motion, length=self._track.length, at_end=at_end)
        self._heading: float | None = None

    def lose(self, reason: str) -> None:
        """Not heard."""
        self._way.lose(reason)

    def __call__(self, t: float, values: Mapping[str, Value]) -> Place:
        way = self._way(t, values)
        q, per_metre = self._track.at(float(way.q[0]))
        self._heading = q[2] = nearest_turn(float(q[2]), self._heading)
        # Once around is no jump.
        anew = way.anew and self._way.jumped
        return Place(q, None if way.qd is None else per_metre * way.qd[0], way.invalid_reason, anew)


def nearest_turn(angle: float, last: float | None) -> float:
    """The angle [rad] plus that many turns which brings it nearest to the last one."""
    return angle if last is None else angle + math.tau * round((last - angle) / math.tau)


class _Ends:
    """One of two ends; on the way it is shown where it would be at an even speed, and not relied on."""

    def __init__(self, motion: Slide | Turn | Fingers, name: str) -> None:
        assert motion.lower is not None
        assert motion.upper is not None
        assert motion.travel is not None
        self._name, self._ends = name, (motion.lower, motion.upper)
        self._rate = (motion.upper - motion.lower) / motion.travel
        self._q: float | None = None
        self._t = 0.0

    def __call__(self, t: float, values: Mapping[str, Value]) -> Place:
        wanted = self._ends[bool(values[self._name])]
        step = self._rate * max(0.0, t - self._t)
        self._t = t
        q = wanted if self._q is None else self._q + float(np.clip(wanted - self._q, -step, step))
        self._q = q
        invalid_reason = f"on its way since {self._name} changed: between its ends nobody says where"
        return Place(np.array([q]), invalid_reason="" if q == wanted else invalid_reason)


class _Carried:
    """On a belt or a track: by how far that is told, or by its speed summed up."""

    def __init__(self, motion: Belt | Route, *, length: float, at_end: AtEnd) -> None:
        self._motion, self._length, self._at_end = motion, length, at_end
        self._way = motion.start
        """Of the part since it first lay at the begin of the belt [m], ends not counted."""
        self._zero = -motion.start
        """How far the belt had run when the part was at its begin [m]."""
        self._t = -math.inf
        self._speed = 0.0
        """Of the belt, told last [m/s]."""
        self._placed = False
        self._leapt, self._until = "", -math.inf
        self.jumped = False
        """Whether it was put elsewhere just now, once around not counted."""
        self._lost = ""

    def __call__(self, t: float, values: Mapping[str, Value]) -> Place:
        m, last = self._motion, self._way
        placed = m.placed is not None and bool(values[m.placed])
        anew = placed and not self._placed
        self._placed, self.jumped = placed, anew
        speed = None if m.speed is None else np.array([_number(values, m.speed)])
        summed = None if speed is None else self._sum(t, float(speed[0]))
        if m.position is not None:
            run = _number(values, m.position)
            self._zero = run - m.start if anew else self._zero
            position = run - self._zero
            # A place that the speed cannot have brought about is no motion: a counter that began again.
            off = 0.0 if summed is None else position - summed
            self.jumped = anew or abs(off) > FAR
            if self._at_end is AtEnd.LOOP:
                off -= self._length * round(off / self._length)  # a count of one round begins again
            if abs(off) > FAR and not anew:
                self._leapt = (
                    f"its position leapt by {off:.3g} m at {t:.3f} s, which its speed does not explain"
                )
                self._until = t + HOLD
            self._way = nearing(position, summed, t - self._t)
        elif anew:
            self._way, self._lost = m.start, ""
        elif summed is not None:
            self._way = summed
        self._t = t
        q = carried(self._way, self._length, self._at_end)
        if self._at_end is AtEnd.STOP and q != self._way:
            # It lies at the end; when the belt turns back, it is taken along from there.
            self._zero += self._way - q
            self._way, speed = q, None if speed is None else np.zeros(1)
        around = self._way // self._length != last // self._length and self._at_end is AtEnd.LOOP
        self._until = -math.inf if anew else self._until
        invalid_reason = self._lost or (self._leapt if t <= self._until else "")
        return Place(np.array([q]), speed, invalid_reason, self.jumped or around)

    def _sum(self, t: float, speed: float) -> float | None:
        """How far it was carried since it was heard last; None when that is too long ago."""
        before, self._speed = self._speed, speed
        step = t - self._t
        if step > LONGEST_STEP and math.isfinite(step):
            self.lose(f"the speed of the belt was not heard for {step:.2f} s")
        if self._motion.position is not None and step > LONGEST_STEP:
            return None
        return self._way + (before * step if math.isfinite(step) else 0.0)

    def lose(self, reason: str) -> None:
        """Not heard: a count goes on where it is, a sum does not."""
        if self._motion.position is None and math.isfinite(self._t):
            self._lost = f"its place on the way is not known since: {reason}; placed tells it anew"


def nearing(position: float, summed: float | None, step: float) -> float:
    """Where a part is whose belt tells its position and, maybe, its speed.

    What arrives late or early would make the speed of the part jump; summed up, the speed that was told
    does not, and the position takes it back to where it is told within `SETTLE`.

    Args:
        position: As its belt gives it [m].
        summed: By the speed since the last picture [m]; None where there is none.
        step: Time since then [s].
    """
    if summed is None or abs(position - summed) > FAR:
        return position
    return summed + min(1.0, step / SETTLE) * (position - summed)


def carried(way: float, length: float, at_end: AtEnd) -> float:
    """Where on its belt something is that would be ``way`` [m] along an endless one, 0 to ``length`` [m]."""
    return way % length if at_end is AtEnd.LOOP else min(max(way, 0.0), length)
