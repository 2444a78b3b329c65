"""Where everybody is at every tick, of files that are known whole: all ticks in a few array operations.

What `seerob.twin.engine.Engine` does with sample after sample, for joint positions with velocities that
nothing interrupts. What is in doubt at a tick is worded by `seerob.twin.validity.hearing.Hearing`, from what
it would have heard by then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter

import numpy as np

from seerob.core.samples import REPEATED, JointSample, Quality, Sample
from seerob.core.transforms import Array
from seerob.devices.live.listening import LiveSource
from seerob.files.trajectories.trajectory import QUIET
from seerob.kernels.pull import SLACK, along
from seerob.model.model import Mechanism, Model
from seerob.recording.answers import Flags
from seerob.twin.control.reference import MAX_KEPT
from seerob.twin.control.sample_values import LARGEST, largest_speed
from seerob.twin.engine import Engine, last_tick, together
from seerob.twin.spans import Indices, Ways
from seerob.twin.states import Motion, Reasons
from seerob.twin.validity.hearing import STANDS, Heard, Hearing

_NUMBERS = attrgetter("t", "q", "qd", "qd_error", "tau")


def known_motion(engine: Engine, feed: Sequence[tuple[Sample, ...]], end: float) -> Motion | None:
    """Where everybody is at every tick of a feed; None where that has to be found tick by tick.

    Args:
        engine: That would play it, without physics; its hearings are used up.
        feed: Samples per tick.
        end: When the motion ends, and the last tick with it [s].
    """
    model = engine.model
    if not feed or not _is_plain(model):
        return None
    heard: dict[str, list[JointSample]] = {name: [] for name in model.mechanisms}
    received: dict[str, list[int]] = {name: [] for name in model.mechanisms}
    machines = {machine.name for machine in model.workstation.machines}
    for samples in feed:
        for sample in samples:
            if type(sample) is not JointSample or sample.target not in heard or sample.target in machines:
                return None
            heard[sample.target].append(sample)
        for name, counts in received.items():
            counts.append(len(heard[name]))
    ticks = _ticks(len(feed), model.workstation.engine.tick, end)
    tracks: dict[str, _Track] = {}
    for name, samples_of in heard.items():
        if samples_of:
            track = _Track.of(model.mechanisms[name], samples_of, np.array(received[name]), ticks)
            if track is None:
                return None
            tracks[name] = track
    ways = _ways(model, tracks, ticks)
    invalid_reasons = _invalid_reasons(engine, tracks, ticks)
    noise = {
        name: error for name, track in tracks.items() if (error := track.speed_errors(ticks)) is not None
    }
    first = ways.first
    return Motion(ticks, ways.q[first], ways.v[first], invalid_reasons, True, ways, noise)


def _is_plain(model: Model) -> bool:
    """Whether nothing but joint samples of recorded sources moves anybody."""
    station = model.workstation
    follows = any(machine.motion.variables() for machine in station.machines)
    return not follows and not any(isinstance(source, LiveSource) for source in station.sources)


def _ticks(count: int, period: float, end: float) -> Array:
    """Instants of ticks [s], shape (count,), as the engine counts them."""
    ticks: Array = np.asarray(period * np.arange(count), float)
    last = last_tick(end, period) if end < math.inf else count
    if 0 < last < count and abs(end - ticks[last]) > SLACK:
        ticks[last] = end
    return ticks


@dataclass(frozen=True, eq=False)
class _Track:
    """All samples of one robot or person, of whom each tick knows those before it and the next."""

    t: Array
    q: Array
    v: Array
    reasons: list[str]
    """Why each may not be relied on."""
    older: Array
    """How much older than its instant each may be [s]."""
    errors: Array | None
    """How far velocities may be off, -inf where nobody says so, shape (k, n)."""
    received: Indices
    """How many were heard by each tick."""
    past: Indices
    """How many lie at or before each tick."""

    @classmethod
    def of(
        cls, mechanism: Mechanism, samples: Sequence[JointSample], received: Indices, ticks: Array
    ) -> _Track | None:
        """What was heard of a mechanism; None where the engine has to look at samples one by one."""
        n, total = len(mechanism.joints), len(samples)
        said = list(map(_NUMBERS, samples))
        if any(
            len(q) != n or qd is None or len(qd) != n or (tau is not None and len(tau) != n)
            for _, q, qd, _, tau in said
        ) or any(sample.payload is not None or not sample.placed for sample in samples):
            return None
        t = np.array([each[0] for each in said], float)
        q, v = (
            np.fromiter(chain.from_iterable(each[i] for each in said), float, total * n).reshape(total, n)
            for i in (1, 2)
        )
        if not (np.isfinite(t).all() and (np.abs(q) <= LARGEST).all() and (np.abs(v) <= LARGEST).all()):
            return None
        T = np.diff(t)
        if (T < 2 * REPEATED).any():
            return None
        largest = largest_speed(mechanism)
        if (np.abs(np.diff(q, axis=0) / T[:, None]) > largest).any() or (np.abs(v) > largest).any():
            return None  # a jump
        past = np.searchsorted(t, ticks + SLACK, side="right")
        # A sample that is heard at its own instant, a rounding away, is the newest then.
        just = (received == past) & (np.abs(ticks - t[np.maximum(past - 1, 0)]) <= SLACK)
        if ((received < np.minimum(past + 1, total)) & ~just).any():
            return None
        if (received[1:] - past[:-1] >= MAX_KEPT).any():
            return None
        errors = None
        if any(each[3] is not None for each in said):
            nothing = (-np.inf,) * n
            errors = np.array([nothing if each[3] is None else each[3] for each in said], float)
        good = Quality.GOOD
        reasons = [
            "" if s.quality is good and not s.reason else s.invalid_reason("its source") for s in samples
        ]
        older = np.array([s.late if s.t_device is None else 0.0 for s in samples], float)
        return cls(t, q, v, reasons, older, errors, received, past)

    @property
    def _following(self) -> Indices:
        """The sample after each tick where it is known then, and else the newest."""
        return np.minimum(self.past, self.received - 1)

    def course(self, t: Array, ticks: Array, places: Indices) -> tuple[Array, Array]:
        """Positions and velocities at instants in order [s], shape (m, n) each; ``places`` are the ticks."""
        q, v, a = np.empty((3, len(t), self.q.shape[1]))
        along(self.t, self.q, self.v, np.zeros(len(self.t), bool), 0.0, t, q, v, a)
        last = (self.past == self.received) & (self.past > 0) & (self.past < len(self.t))
        newest = self.past[last] - 1
        since = np.minimum(ticks[last] - self.t[newest], 0.0)
        q[places[last]] = self.q[newest] + since[:, None] * self.v[newest]
        v[places[last]] = self.v[newest]
        return q, v

    def may_be_invalid(self, hearing: Hearing, ticks: Array, *, stands: bool) -> Flags:
        """At which ticks what was heard is to be looked at: at no other is there a doubt, shape (N,)."""
        k, last = self.past, np.maximum(self.past - 1, 0)
        following = self._following
        longest, since = hearing.timeout + SLACK, ticks - self.t[last]
        found = (k == 0) | (since + self.older[self.received - 1] > longest)
        found |= self.t[following] - self.t[last] > longest
        if any(self.reasons):
            invalid = np.array([bool(reason) for reason in self.reasons])
            found |= invalid[last] | invalid[following]
        if stands and np.abs(self.v[-1]).max(initial=0.0) > STANDS:
            found |= (k == self.received) & (since > hearing.grace + SLACK)
        return np.asarray(found)

    def hear(self, hearing: Hearing, i: int, *, stands: bool) -> None:
        """Make a hearing what it is at a tick."""
        newest = int(self.received[i]) - 1
        known = range(max(int(self.past[i]) - 1, 0), newest + 1)
        hearing.heard = [Heard(float(self.t[j]), self.reasons[j]) for j in known]
        hearing.older = float(self.older[newest])
        hearing.leaves_at = float(np.abs(self.v[newest]).max(initial=0.0)) if stands else 0.0

    def speed_errors(self, ticks: Array) -> Array | None:
        """How far velocities may be off at each tick, shape (N, n); None where nobody says so.

        As `seerob.twin.validity.hearing.Hearing.speed_error`: what samples around say of theirs, or how far
        the slope between two of them is from the velocities that they say.
        """
        found = self._unlike(ticks)
        if self.errors is not None:
            worse = np.maximum(self.errors[np.maximum(self.past - 1, 0)], self.errors[self._following])
            found = np.where(np.isneginf(worse), found, worse)
        return found if found.any() else None

    def _unlike(self, ticks: Array) -> Array:
        before, after = np.maximum(self.past - 1, 0), self._following
        inside = (self.past > 0) & (self.past < self.received)
        q, v, a = np.empty((3, len(ticks), self.q.shape[1]))
        along(self.t, self.q, self.v, np.zeros(len(self.t), bool), 0.0, ticks, q, v, a)
        share = (ticks - self.t[before]) / np.where(inside, self.t[after] - self.t[before], 1.0)
        off = np.abs(v - (self.v[before] + share[:, None] * (self.v[after] - self.v[before])))
        off[~(inside & (off.max(axis=1, initial=0.0) > QUIET))] = 0.0
        return together(off)


def _ways(model: Model, tracks: dict[str, _Track], ticks: Array) -> Ways:
    """Where all joints are at ticks and at the samples between them."""
    inside = [np.zeros(0)]
    for track in tracks.values():
        k = np.searchsorted(ticks, track.t)
        between = (k > 0) & (k < len(ticks))
        t, k = track.t[between], k[between]
        inside.append(t[(t > ticks[k - 1] + SLACK) & (t < ticks[k] - SLACK)])
    knots = np.sort(np.concatenate([ticks, np.unique(np.concatenate(inside))]))
    q, v = np.tile(model.mj.qpos0, (len(knots), 1)), np.zeros((len(knots), model.mj.nv))
    first = np.searchsorted(knots, ticks)
    for name, mechanism in model.mechanisms.items():
        if name not in tracks:
            q[:, mechanism.q_address] = mechanism.coupling @ mechanism.home + mechanism.offset
            continue
        found, speed = tracks[name].course(knots, ticks, first)
        q[:, mechanism.q_address] = found @ mechanism.coupling.T + mechanism.offset
        v[:, mechanism.v_address] = speed @ mechanism.coupling.T
    return Ways(knots, q, v, first)


def _invalid_reasons(engine: Engine, tracks: dict[str, _Track], ticks: Array) -> dict[str, Reasons]:
    """Why each robot, person and machine may not be where it is found, shape (N,) of texts each."""
    state = engine.state
    reasons: dict[str, Reasons] = {name: np.full(len(ticks), "", object) for name in engine.model.mechanisms}
    look = np.zeros(len(ticks), bool)
    for name, hearing in state.hearings.items():
        if name in tracks:
            hearing.driven = True
            look |= tracks[name].may_be_invalid(hearing, ticks, stands=name in engine.ahead)
        elif hearing.driven or not hearing.given:
            look[:] = True
    for i in np.flatnonzero(look).tolist():
        for name, track in tracks.items():
            track.hear(state.hearings[name], i, stands=name in engine.ahead)
        state.t = float(ticks[i])
        state.heard()
        for name, found in reasons.items():
            found[i] = state.invalid_reason(name)
    return reasons
