"""Whether what one source says from sample to sample can be one motion: every sample, where it is heard.

A run takes the newest sample of each tick; what came between is seen here only. Positions may not go
farther than anybody could in the time between two stamps, and the velocities that a controller measures must
be the derivative of the positions that it measures: over the last `SPAN`, no joint's way may differ from the
integral of its velocity by more than noise, rounding and the lag of a filter explain. Nor may a joint get
faster more quickly than the accelerations that the file states, on which stopping distances rest: by its
velocities, or by its positions where a device gives no velocities.

A robot may stand, and say so to the last bit. It cannot stop dead: a joint that went :math:`x` in the last
interval :math:`T`, after a speed :math:`v`, and then stands to the last bit has braked within
:math:`s = v T - x`, with :math:`v^2 / 2s` at least. What no arm can is a device that hangs on its last
sample, and so is one whose velocities go on over positions that stand.

A live source is looked at by who listens to it, and the shipped readers look at their files; whoever writes a
source of their own looks at nothing. So here: what is no sample or has the wrong shape ends the run with the
name of the source; time that goes back or stands, values where no joint can be, and velocities that positions
do not follow are the sample's ``reason``, and what rests on it is UNDECIDED.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from numbers import Real
from operator import le, lt, sub
from typing import get_args

from msgspec import Struct
from msgspec.structs import replace

from seerob.core.errors import InputError, SeerobError
from seerob.core.samples import (
    NO_PLACE,
    BodySample,
    JointSample,
    PoseSample,
    Quality,
    Sample,
    SignalSample,
    key,
)
from seerob.devices.live.device_clock import HOLD
from seerob.workstation.source import Opened, Target

SPAN = 0.5
"""Over which ways and velocities are compared [s]: shorter than a motion of any program, longer than the lag
of any filter."""
ANCHORS = 10
"""Instants of it that the newest sample is compared with."""
NOISE = {"rad": 5e-3, "m": 1e-3}
"""A difference of both that is not looked at [rad or m]: encoders of arms are a hundred times better, their
velocities are noisy by up to 0.01 rad/s, which this is half a second of."""
SHARE = 0.2
"""Of the way: velocities that are rounded or filtered are off by a tenth, so is the trapezoidal rule at
10 Hz."""
SPEED_NOISE = {"rad": 0.02, "m": 0.005}
"""Of a difference of two velocities [rad/s or m/s]: twice that of `NOISE`."""
POSITION_NOISE = {"rad": 5e-4, "m": 1e-4}
"""Of a position from which speeds are derived [rad or m]: a tenth of `NOISE`."""
LAG = 0.03
"""By which a filter may delay velocities [s]: a low-pass of 5 Hz, lower than controllers have."""
FASTEST = {"rad": 30.0, "m": 10.0}
"""No joint is faster [rad/s or m/s]; as `seerob.twin.control.reference.LARGEST_SPEED`."""
TIMES_LIMIT = 2.0
"""Nor faster than so many times its speed limit, where that is known."""
LOOSE = 0.05
"""Jitter of arrivals [s]: where a device sends no time, samples may come so much closer together."""
BODY_SPEED, BODY_SLACK = 10.0, 0.2
"""Of a point of a person: faster than any hand at work [m/s], and noise of depth cameras [m]."""
MANY = 0.5
"""Share of the points of a person that do not jump together unless all of it is elsewhere."""
HARDEST = {"rad": 300.0, "m": 100.0}
"""No joint brakes harder [rad/s² or m/s²]: ten times what published stopping tables of arms come to."""
FINEST = {"rad": 1e-5, "m": 1e-6}
"""What a joint may move without being seen, where it is said more finely [rad or m]."""
ROUNDED = 1e-9
"""What is left of two equal steps by rounding alone [rad or m]."""
STEPS = 4
"""Times the step of its digits that a joint must go within an interval, for its speed to be told by it."""
HELD = 2e-3, 2.5
"""Way that velocities tell of a joint which stands to the last bit, from which on they contradict it [rad or
m]: twice the coarsest digit that controllers have; and after how many intervals what stands does not move."""
SCALE = 0.08
"""Share by which velocities may be off what positions move at over a long way: filters of 5 Hz and the
trapezoidal rule make less of it than half."""
LONG_WAY = {"rad": 1.0, "m": 0.3}
"""Of a joint, from which on that share is told [rad or m]; what was four times as long ago counts half."""
LEAST_WAY = {"rad": 0.01, "m": 2e-3}
"""Way between two anchors that tells of it [rad or m]: twice `NOISE`."""
CLOSE = 0.99
"""Share of a bound up to which rounding can hide nothing: what is nearer is not compared one by one."""
AGAIN, REMEMBERED = 10, 1 << 15
"""So many positions of a robot that moves, one after another, are not those of before to the last bit; and of
how many that is known."""
FINE = 1e-6
"""Digits no coarser than that have noise, which no robot repeats [rad or m]."""
SILENCE = 0.5
"""After it what was before says nothing of now [s]."""


class _Motion(Struct, frozen=True):
    t: float
    q: tuple[float, ...]
    qd: tuple[float, ...]
    way: tuple[float, ...]
    """Integral of the velocity [rad or m]."""
    speed: tuple[float, ...]
    """Magnitude of the velocity."""
    length: tuple[float, ...]
    """Integral of that [rad or m]."""


class _Standing:
    """Of each joint, whether it stands to the last bit.

    Lists by joint, and one loop in which what moves costs little: this runs for every packet of every source.

    Args:
        units: ``rad`` or ``m``, of each joint.
    """

    def __init__(self, units: Sequence[str]) -> None:
        many = len(units)
        self._units = units
        self._seen = -math.inf
        """When anything was said last [s]."""
        self._q, self._since = [math.nan] * many, [-math.inf] * many
        """Positions, and when they were said first."""
        self._step, self._interval = [0.0] * many, [math.inf] * many
        """Way and time to it [rad or m, s]."""
        self._step_before, self._interval_before = [0.0] * many, [math.inf] * many
        """Those of the way before."""
        self._finest = [math.inf] * many
        self._rate = [0.0] * many
        """Velocity said last."""
        self._stands = [False] * many
        self._way, self._fastest, self._window = [0.0] * many, [0.0] * many, [0.0] * many
        """What velocities come to while it stands, and the largest of them, since when [s]."""
        self._looked, self._dead = [False] * many, [""] * many

    def __len__(self) -> int:
        return len(self._q)

    @property
    def finest(self) -> float:
        """Least step of the digits of any joint that was seen [rad or m]."""
        return min(self._finest, default=math.inf)

    def add(self, t: float, q: Sequence[float], qd: Sequence[float] | None, jitter: float) -> str:
        """Why the first of those joints cannot stand that are said to; empty when each may.

        Args:
            t: [s]
            q: Positions [rad or m].
            qd: Velocities [rad/s or m/s]; None where the device measures none.
            jitter: By which the time between two samples may be off [s].
        """
        before, self._seen = self._seen, t
        rates, self._rate = self._rate, [0.0] * len(q) if qd is None else [*qd]
        places, self._q = self._q, [*q]
        steps, intervals, since, finests = self._step, self._interval, self._since, self._finest
        found = ""
        for k, (x, place) in enumerate(zip(q, places, strict=True)):
            if x == place:
                why = self._stand(k, t, before, rates[k], jitter)
                found = found or why
                continue
            last = steps[k]
            self._step_before[k], self._interval_before[k] = last, intervals[k]
            step = x - place
            if math.isnan(step):
                steps[k], intervals[k] = 0.0, math.inf
            else:
                way = abs(step)
                change = abs(way - abs(last))
                if ROUNDED < way < finests[k]:
                    finests[k] = way
                if ROUNDED < change < finests[k]:
                    finests[k] = change
                steps[k], intervals[k] = step, t - since[k]
            since[k], self._stands[k] = t, False
        return found

    def _stand(self, k: int, t: float, before: float, rate: float, jitter: float) -> str:
        """Say what `add` does, of one joint that is where it was.

        Args:
            k: Which.
            t: [s]
            before: When it was said the time before [s].
            rate: Its velocity then.
            jitter: As of `add`.
        """
        now = self._rate[k]
        if not self._stands[k]:
            self._stands[k], self._window[k], self._way[k], self._fastest[k] = True, self._since[k], 0.0, 0.0
            self._looked[k], self._dead[k] = False, ""
        if t - self._window[k] > SPAN:
            self._window[k], self._way[k], self._fastest[k] = t, 0.0, 0.0
        self._way[k] += 0.5 * (t - before) * (rate + now)
        self._fastest[k] = max(self._fastest[k], abs(rate), abs(now))
        if abs(self._way[k]) > HELD[0] + LAG * self._fastest[k]:
            said = f"{now:.3g} {self._units[k]}/s"
            what = "is not zero while the joint stands still to the last bit"
            return f"the velocity of joint {k + 1} {what}: {said}"
        longest = max(self._interval[k], self._interval_before[k])
        if not self._looked[k] and t - self._since[k] > HELD[1] * longest:
            self._looked[k], self._dead[k] = True, self._stopped_dead(k, jitter)
        return self._dead[k]

    def _stopped_dead(self, k: int, jitter: float) -> str:
        """Whether it would have had to brake harder than any joint can."""
        step, passed, unit = self._step_before[k], self._interval_before[k], self._units[k]
        told, way = step / passed if passed else math.copysign(math.inf, step), abs(self._step[k])
        speed = abs(told)
        if self._step[k] * told <= 0 or way < STEPS * self._finest[k]:
            return ""
        least = max(speed * self._interval[k] - way, 2 * self._finest[k], FINEST[unit]) + speed * jitter
        if speed * speed <= 2 * HARDEST[unit] * least:
            return ""
        return (
            f"joint {k + 1} stands to the last bit right after {speed:.3g} {unit}/s, "
            "which nothing brakes so: its last sample again and again?"
        )


class _Scale:
    """By how much the velocities of one joint are off, over ways so long that lag and noise do not matter.

    Args:
        unit: ``rad`` or ``m``.
    """

    def __init__(self, unit: str) -> None:
        self._unit = unit
        self._went = self._said = self._way = 0.0
        """Sums of the squares of ways, by positions and by velocities; and of ways."""

    def add(self, went: float, said: float) -> None:
        """Take the way between two anchors, by positions and by velocities [rad or m]."""
        if max(abs(went), abs(said)) < LEAST_WAY[self._unit]:
            return
        if self._way > 4 * LONG_WAY[self._unit]:
            self._went, self._said, self._way = 0.5 * self._went, 0.5 * self._said, 0.5 * self._way
        # Not to the power of 2, which ends in an error beyond what a float holds.
        self._went += went * went
        self._said += said * said
        self._way += abs(went)

    def off(self) -> str:
        """Why they are no velocities of these positions; empty when they may be."""
        if self._way < LONG_WAY[self._unit] or not self._said:
            return ""
        scale = math.sqrt(self._went / self._said)
        if math.isnan(scale):
            return "is off: both are beyond all bounds"
        if (1 - SCALE) <= scale <= 1 / (1 - SCALE):
            return ""
        return f"is off by a factor: positions move at {scale:.3g} × the velocity"


class _Repeats:
    """Whether a robot says again, in the same order, where it was before."""

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}
        """Places that it was at, told by their hashes, and which of all each was the last time, from 1 on."""
        self._count = self._then = self._run = 0
        self._at: tuple[float, ...] = ()

    def add(self, q: tuple[float, ...], finest: float) -> str:
        """Why it may be a recording; empty when it is none.

        Args:
            q: Where it is [rad or m].
            finest: Least step of its digits that was seen [rad or m].
        """
        if q == self._at:
            return ""
        self._at, place = q, hash(q)
        then = self._numbers.pop(place, 0)
        self._run = self._run + 1 if then == self._then + 1 else min(then, 1)
        self._then = then
        self._count += 1
        if len(self._numbers) >= REMEMBERED:
            del self._numbers[next(iter(self._numbers))]
        self._numbers[place] = self._count
        if self._run < AGAIN or finest > FINE:
            return ""
        return f"says its last {self._run} positions again, to the last bit: is a recording played to it?"


class Contradictions:
    """What one source says of one target, sample by sample.

    Args:
        target: With joint units, and limits of speed and acceleration; None where nobody knows them.
        live: Whether it measures a robot while it speaks: a motion that was planned may stop dead.
    """

    def __init__(self, target: Target | None, *, live: bool = True) -> None:
        self._live = live
        units = () if target is None else target.units
        limits = () if target is None else target.velocity
        self._units = [*units]
        self._fastest = [
            min(FASTEST[unit], FASTEST[unit] if limit is None else TIMES_LIMIT * limit)
            for unit, limit in zip(units, limits, strict=False)
        ]
        self._noise = [NOISE[unit] for unit in units]
        self._resolved = 0
        self._close: list[float] = []
        """Of each joint, a difference of way and velocity that no anchor contradicts [rad or m]."""
        self._never = 0.0, 0.0
        """Speed and noise that each joint may have [rad/s and rad, or m/s and m]."""
        stated = () if target is None else target.acceleration
        self._quickest = stated * len(units) if len(stated) == 1 else stated
        self._gains = [
            CLOSE * ((1 + SHARE) * limit * SPAN / ANCHORS + SPEED_NOISE[unit])
            for limit, unit in zip(self._quickest, units, strict=False)
        ]
        """Of a joint's speed, which no anchor contradicts that was slower by less [rad/s or m/s]."""
        self._before: Sample | None = None
        self._at = -math.inf
        self._anchors: deque[_Motion] = deque(maxlen=ANCHORS)
        self._newest: _Motion | None = None
        self._least: list[float] = []
        self._most: list[float] = []
        """Of each joint, between which its positions less the integral of its velocity lie at the anchors."""
        self._slowest: list[float] = []
        """Of each joint, least speed at an anchor [rad/s or m/s]."""
        self._off = ""
        """Whose velocities are off by a factor, as is known since the last anchor."""
        self._places: deque[tuple[float, tuple[float, ...]]] = deque(maxlen=ANCHORS + 1)
        """Instants [s] and positions of a device that gives no velocities."""
        self._standing = _Standing(())
        self._scales: list[_Scale] = []
        self._repeats = _Repeats()

    def find(self, sample: Sample) -> str:
        """Why this sample and those before it are no one motion; empty when they may be."""
        if isinstance(sample, NO_PLACE):
            return ""
        t = sample.t if sample.t_device is None else sample.t_device
        step, before = t - self._at, self._before
        if sample.t_device is None and step < LOOSE:
            step += LOOSE
        self._at, self._before = t, sample
        if not 0 < step < SILENCE or type(before) is not type(sample):
            self._anchors.clear()
            self._places.clear()
            self._newest = None
            self._standing = _Standing(())
            before = None
        if isinstance(sample, JointSample):
            self._resolve(len(sample.q))
            jump = self._leap(before, sample, step) if isinstance(before, JointSample) else ""
            # Each is told every sample: what it looks for may begin while another one has found something.
            differs, hangs = self._compare(sample, t), self._hangs(sample, t)
            again = ""
            if self._live and (sample.qd is None or sample.qd_error is not None):
                # Measured velocities say more, and simulators that tell them repeat themselves exactly.
                again = self._repeats.add(sample.q, self._standing.finest)
            return jump or differs or hangs or again
        if isinstance(sample, PoseSample):
            return _moved(before, sample, step) if isinstance(before, PoseSample) else ""
        return _flew(before, sample, step) if isinstance(before, BodySample) else ""

    def _resolve(self, joints: int) -> None:
        """Bounds of joints that the robot does not have: as those of one that turns, as fast as any."""
        if joints <= self._resolved:
            return
        self._resolved = joints
        self._units += ["rad"] * (joints - len(self._units))
        self._fastest += [FASTEST["rad"]] * (joints - len(self._fastest))
        self._noise += [NOISE["rad"]] * (joints - len(self._noise))
        self._close = [CLOSE * noise for noise in self._noise]
        self._never = min(self._fastest, default=0.0), min(self._noise, default=0.0)

    def _leap(self, before: JointSample, sample: JointSample, step: float) -> str:
        fastest, noise = self._never
        if max(map(abs, map(sub, sample.q, before.q)), default=0.0) <= fastest * step + noise:
            return ""
        bounds = zip(before.q, sample.q, self._fastest, self._noise, strict=False)
        for k, (a, b, fastest, noise) in enumerate(bounds):
            if abs(b - a) > fastest * step + noise:
                unit = self._units[k]
                return f"joint {k + 1} went {abs(b - a):.3g} {unit} within {1e3 * step:.0f} ms"
        return ""

    def _compare(self, sample: JointSample, t: float) -> str:
        """Ways and velocities over the last `SPAN`."""
        q, qd = sample.q, sample.qd
        if qd is None or len(qd) != len(q):
            self._newest = None
            return self._speeds_up(q, t, LOOSE if sample.t_device is None else 0.0)
        last = self._newest
        if last is None or len(last.q) != len(q):
            zeros = (0.0,) * len(q)
            self._anchors.clear()
            self._newest = _Motion(t, q, qd, zeros, tuple(map(abs, qd)), zeros)
            self._anchor(self._newest)
            return ""
        half, speed = 0.5 * (t - last.t), tuple(map(abs, qd))
        way = tuple([went + half * (a + b) for went, a, b in zip(last.way, last.qd, qd, strict=True)])
        length = tuple(
            [far + half * (a + b) for far, a, b in zip(last.length, last.speed, speed, strict=True)]
        )
        off = [*map(sub, q, way)]
        # What is no number is not near.
        near = all(map(lt, map(sub, off, self._least), self._close)) and all(
            map(lt, map(sub, self._most, off), self._close)
        )
        if self._gains and near:
            near = all(map(le, map(sub, speed, self._slowest), self._gains))
        now = self._newest = _Motion(t, q, qd, way, speed, length)
        found = ""
        for then in () if near else self._anchors:
            if t - then.t <= SPAN and (found := self._differ(then, now) or self._hurries(then, now)):
                break
        if t - self._anchors[-1].t >= SPAN / ANCHORS:
            self._scale(self._anchors[-1], now)
            self._anchor(now)
        return found or self._off

    def _anchor(self, now: _Motion) -> None:
        """Compare what comes with this instant, too."""
        self._anchors.append(now)
        lags = zip(
            *[[a - went for a, went in zip(then.q, then.way, strict=True)] for then in self._anchors],
            strict=True,
        )
        columns = [*lags]
        self._least, self._most = [*map(min, columns)], [*map(max, columns)]
        self._slowest = [*map(min, zip(*[then.speed for then in self._anchors], strict=True))]

    def _scale(self, then: _Motion, now: _Motion) -> None:
        if len(self._scales) != len(now.q):
            self._scales = [_Scale(unit) for unit in self._units[: len(now.q)]]
        for k, scale in enumerate(self._scales):
            scale.add(now.q[k] - then.q[k], now.way[k] - then.way[k])
        offs = ((k, scale.off()) for k, scale in enumerate(self._scales))
        self._off = next((f"the velocity of joint {k + 1} {off}" for k, off in offs if off), "")

    def _hangs(self, sample: JointSample, t: float) -> str:
        """Whether a joint that moved stands to the last bit, as nothing that brakes does."""
        if len(self._standing) != len(sample.q):
            self._standing = _Standing(self._units[: len(sample.q)])
        if sample.qd is not None and len(sample.qd) != len(sample.q):
            return ""
        jitter = LOOSE if sample.t_device is None else 0.0
        return self._standing.add(t, sample.q, sample.qd, jitter if self._live else math.inf)

    def _hurries(self, then: _Motion, now: _Motion) -> str:
        """Whether a joint gets faster more quickly than it can; one that brakes may, it is stopped."""
        dt = now.t - then.t
        if dt < SPAN / ANCHORS:
            return ""
        for k, (a, limit) in enumerate(zip(then.qd, self._quickest, strict=False)):
            gained, unit = abs(now.qd[k]) - abs(a), self._units[k]
            if gained > (1 + SHARE) * limit * dt + SPEED_NOISE[unit]:
                return (
                    f"joint {k + 1} gets faster with {gained / dt:.3g} {unit}/s², "
                    f"and acceleration_limits says {limit:g}"
                )
        return ""

    def _speeds_up(self, q: tuple[float, ...], t: float, jitter: float) -> str:
        """Say what `_hurries` does, of mean speeds in two neighbouring spans of equal numbers of instants.

        Args:
            q: Positions now [rad or m].
            t: When [s].
            jitter: By which the time between two instants may be off [s].
        """
        places = self._places
        if places and len(places[-1][1]) != len(q):
            places.clear()
        if places and t - places[-1][0] < SPAN / ANCHORS:
            return ""
        places.append((t, q))
        for n in range(1, (len(places) - 1) // 2 + 1):
            (t0, q0), (t1, q1) = places[-1 - 2 * n], places[-1 - n]
            first, second = t1 - t0, t - t1
            for k, limit in enumerate(self._quickest[: len(q)]):
                unit, way = self._units[k], q[k] - q1[k]
                steps = [places[-i][1][k] - places[-i - 1][1][k] for i in range(1, 2 * n + 1)]
                if any(step * way < 0 for step in steps):
                    continue  # It turned round, and may have braked more quickly than it gets faster.
                before, now = abs(q1[k] - q0[k]) / first, abs(way) / second
                noise = 2 * POSITION_NOISE[unit] * (1 / first + 1 / second) + SPEED_NOISE[unit]
                noise += jitter * (before / first + now / second)
                gained, dt = now - before, 0.5 * (first + second)
                if gained > (1 + SHARE) * limit * dt + noise:
                    return (
                        f"joint {k + 1} gets faster with {gained / dt:.3g} {unit}/s², by its positions, "
                        f"and acceleration_limits says {limit:g}"
                    )
        return ""

    def _differ(self, then: _Motion, now: _Motion) -> str:
        for k, (a, b) in enumerate(zip(then.q, now.q, strict=True)):
            went, said = b - a, now.way[k] - then.way[k]
            off = abs(went - said)
            unit = self._units[k]
            if off < NOISE[unit]:
                continue
            path = max(now.length[k] - then.length[k], abs(went))
            # Two samples may have come at one instant.
            lag = LAG * max(abs(now.qd[k]), abs(then.qd[k]), path / max(now.t - then.t, 1e-9))
            if off > NOISE[unit] + SHARE * path + lag:
                from seerob.files.trajectories.checks import disagreement  # numpy, which few need

                how = disagreement(went * went, said * said, went * said)
                return (
                    f"the velocity of joint {k + 1} {how or 'is not that of its positions'}: they went "
                    f"{went:.3g} {unit} in {now.t - then.t:.2g} s, the velocities say {said:.3g} {unit}"
                )
        return ""


def _moved(before: PoseSample, sample: PoseSample, step: float) -> str:
    way = math.dist(before.position, sample.position)
    dot = abs(sum(a * b for a, b in zip(before.wxyz, sample.wxyz, strict=True)))
    turn = 2 * math.acos(min(1.0, dot))
    if way > FASTEST["m"] * step + NOISE["m"] or turn > FASTEST["rad"] * step + NOISE["rad"]:
        return f"it went {way:.3g} m and turned {turn:.3g} rad within {1e3 * step:.0f} ms"
    return ""


def _flew(before: BodySample, sample: BodySample, step: float) -> str:
    """Whether most points of a person are elsewhere."""
    was = {p.name: p.position for p in before.points}
    reach = BODY_SPEED * step + BODY_SLACK
    places = [(was.get(p.name), p.position) for p in sample.points]
    ways = [math.dist(a, b) for a, b in places if a and b]
    count, far = len(ways), sum([way > reach for way in ways])
    if count and far >= MANY * count:
        return f"{far} of {count} points went farther than {reach:.2g} m within {1e3 * step:.0f} ms"
    return ""


BEYOND = 0.1
"""A controller may let a joint go so much farther than its description says [rad or m]."""


def looked_at(opened: Opened, name: str, target: Target | None) -> Opened:
    """Wrap what a source opened, so that each of its samples is looked at.

    Raises:
        InputError: It is not what a source returns.
    """
    if not isinstance(opened, Opened):
        what = f"open returns {type(opened).__name__}"
        raise InputError.at(name, "open", what, "return a seerob.workstation.source.Opened")
    if not 0 <= opened.duration < math.inf:
        what = f"the duration is {opened.duration} s"
        raise InputError.at(name, "open", what, "give the time from the first to the last sample")
    from seerob.files.trajectories.trajectory import TrajectorySamples

    if isinstance(opened.samples, TrajectorySamples):
        return opened  # a motion as a whole was looked at when it was made
    return replace(opened, samples=LookedAt(opened.samples, name, target))


class LookedAt:
    """Samples of a recorded source, each with what is wrong with it.

    Args:
        samples: In time order; iterating again starts again.
        name: Of the source, for messages.
        target: What it drives.
    """

    def __init__(self, samples: Iterable[Sample], name: str, target: Target | None) -> None:
        self._samples, self._name, self._target = samples, name, target

    def __iter__(self) -> Iterator[Sample]:
        """Yield each sample once the next one is known, which says whether its time can be.

        Raises:
            InputError: What is yielded is no sample of what it drives, or the source fails.
        """
        looks: dict[tuple[str, ...], Contradictions] = {}
        reasons: dict[tuple[str, ...], tuple[str, float]] = {}
        until: dict[tuple[str, ...], float] = {}
        clocks: dict[tuple[str, ...], float] = {}
        pending: Sample | None = None
        for sample in self._all():
            about = key(sample)
            newest = until.get(about, -math.inf)
            # What a machine says of several variables may be of one instant.
            again = isinstance(sample, SignalSample) and sample.t == newest
            if not (again or newest < sample.t < math.inf):
                # Who lies is not known, the sample whose time is ahead or the one whose time goes back,
                # nor of which instants the source speaks from then on.
                reasons[about] = f"time goes from {newest:.3f} to {sample.t:.3f} s", math.inf
                if pending is not None and key(pending) == about:
                    pending = _with_reason(pending, self._name, reasons[about][0])
                continue
            look = looks.setdefault(about, Contradictions(self._target, live=False))
            stamped = sample if sample.t_device is not None else replace(sample, t_device=sample.t)
            reason, holds = reasons.get(about, ("", -math.inf))
            found = look.find(stamped)
            if sample.t_device is not None:
                clock, clocks[about] = clocks.get(about, -math.inf), sample.t_device
                if not (again or clock < sample.t_device < math.inf):
                    # The same sample again, or an old one, that is said to be new.
                    found = f"its own time goes from {clock:.3f} to {sample.t_device:.3f} s"
            if found and holds < math.inf:
                reason, holds = reasons[about] = found, sample.t + HOLD
            reason = self._beyond(sample) or (reason if sample.t <= holds else "")
            if pending is not None:
                yield pending
            pending = _with_reason(sample, self._name, reason) if reason else sample
            until[about] = sample.t
        if pending is not None:
            yield pending

    def _all(self) -> Iterator[Sample]:
        t = -math.inf
        try:
            for sample in self._samples:
                self._check(sample)
                t = sample.t
                yield sample
        except (SeerobError, OSError):
            raise
        except Exception as error:
            when = f"after its sample of {t:.3f} s" if math.isfinite(t) else "before its first sample"
            what = f"it fails {when}: {type(error).__name__}: {error}"
            raise InputError.at(self._name, "samples", what, "mend the source") from error

    def _check(self, sample: Sample) -> None:
        if not isinstance(sample, get_args(Sample)):
            what = f"it yields {type(sample).__name__}"
            raise InputError.at(self._name, "samples", what, "yield samples of seerob.core.samples")
        if not isinstance(sample.t, Real) or not isinstance(sample.quality, Quality):
            what = f"t is {sample.t!r}, quality {sample.quality!r}"
            raise InputError.at(self._name, "samples", what, "give seconds as a number, and a seerob Quality")
        for what in ("q", "qd", "tau") if isinstance(sample, JointSample) else ():
            values = getattr(sample, what)
            if values is None and what != "q":
                continue
            if not isinstance(values, tuple) or not all(isinstance(x, Real) for x in values):
                text = f"{what} is {values!r}"
                raise InputError.at(self._name, "samples", text, "give a tuple of numbers, one per joint")

    def _beyond(self, sample: Sample) -> str:
        """Which joint is where it cannot be."""
        target = self._target
        if not isinstance(sample, JointSample) or target is None or sample.target != target.name:
            return ""
        for name, q, low, high in zip(target.joints, sample.q, target.lower, target.upper, strict=False):
            if not low - BEYOND <= q <= high + BEYOND:
                return f"{name} is said to be at {q:.4g}, its limits are {low:.4g} and {high:.4g}"
        return ""


def _with_reason(sample: Sample, name: str, reason: str) -> Sample:
    quality = Quality.DEGRADED if sample.quality is Quality.GOOD else sample.quality
    return replace(sample, quality=quality, reason=sample.reason or f"{name}: {reason}")
