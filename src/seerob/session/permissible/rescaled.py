"""The whole motion anew: every piece with its timing, every stand as long as it was; and what it costs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.files.trajectories.trajectory import Trajectory
from seerob.session.permissible.speed_map import SpeedMap, Stations
from seerob.session.permissible.timing import CHECK, Ceiling, Timed, timed

BLOCKED = "change the path or the cell there; where contact may be permitted, power_and_force, --by either"
USED = 0.98
"""A limit that is used by this share governs."""
LEAST_GIVEN = 1e-2
"""Share of its largest speed that the given motion is taken to have everywhere, with ``not_faster``."""


@dataclass(frozen=True, eq=False)
class Rescaled:
    """A motion along the same path, from rest to rest in every piece."""

    of: SpeedMap
    pieces: tuple[Timed, ...]
    not_faster: bool
    margin: float
    """Share of the map's speeds that is not used."""

    @cached_property
    def starts(self) -> Array:
        """When each piece begins [s], shape (pieces,)."""
        lengths = np.array([piece.duration for piece in self.pieces])
        before = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
        return np.asarray(np.cumsum(self.of.path.stands[:-1]) + before)

    @property
    def duration(self) -> float:
        """Cycle time, stands included [s]."""
        return float(sum(piece.duration for piece in self.pieces) + self.of.path.stands.sum())

    @property
    def before(self) -> float:
        """Cycle time of the given motion [s]."""
        path = self.of.path
        return float(sum(p.t[-1] - p.t[0] for p in path.pieces) + path.stands.sum())

    def at(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Positions and their first three derivatives at instants [s], shape (k, d) each."""
        t = np.asarray(t, float)
        d = len(self.of.path.first)
        out = [np.zeros((len(t), d)) for _ in range(4)]
        out[0][:] = self.of.path.first
        for piece, start in zip(self.pieces, self.starts, strict=True):
            inside = t >= start
            local = np.minimum(t[inside] - start, piece.duration)
            moving = (t[inside] - start <= piece.duration)[:, None]
            for k, values in enumerate(piece.at(local)):
                out[k][inside] = values if k == 0 else values * moving
        return out[0], out[1], out[2], out[3]

    def own_instant(self, t: float) -> float:
        """When this motion is where the given one was at an instant [s]."""
        new, old = self._clock
        return float(np.interp(t, old, new))

    @cached_property
    def _clock(self) -> tuple[Array, Array]:
        """Instants of this motion, from 0, and of the given one, by its own clock, at the same places."""
        begun = float(self.of.path.pieces[0].t[0] - self.of.path.stands[0])
        new, old = [0.0], [begun]
        for piece, start in zip(self.pieces, self.starts, strict=True):
            local = np.arange(0.0, piece.duration, 10 * CHECK)
            new += [*(start + local).tolist(), start + piece.duration]
            s = piece.profile.at(np.append(local, piece.duration)).s
            old += piece.piece.when(s).tolist()
        new.append(self.duration)
        old.append(begun + self.before)
        return np.array(new), np.maximum.accumulate(np.array(old))

    def trajectory(self, period: float) -> Trajectory:
        """Sampled, the last instant included.

        Raises:
            InputError: A period that is not one.
        """
        if not 0 < period <= self.duration:
            what = f"{period} s of a motion of {self.duration:.3f} s"
            raise InputError.at("rescaled trajectory", "period", what, "give more than 0, such as 0.008")
        n = int(np.ceil(self.duration / period - 1e-9))
        t = np.append(np.arange(n) * period, self.duration)
        q, qd, _, _ = self.at(t)
        return Trajectory("rescaled trajectory", t, q, qd)


def rescale(found: SpeedMap, *, not_faster: bool, margin: float) -> Rescaled:
    """Time a path within its map.

    Args:
        found: The map.
        not_faster: Nowhere faster than the given motion.
        margin: Share of the map's speeds that is not used, 0 up to less than 1.

    Raises:
        InputError: The map does not say how fast somewhere, or permits no speed there.
    """
    if not 0 <= margin < 1:
        raise InputError.at("permissible speed", "margin", f"{margin}", "give 0 or more, and less than 1")
    for where, what, remedy in (
        (found.undecided, "cannot be told", "give what is missing, or ask fewer criteria"),
        (
            found.blocked,
            "is none",
            BLOCKED,
        ),
    ):
        if where:
            t, why = where[0]
            reason = why.reason or why.governs
            about = f"{why.criterion}{f', {why.region}' if why.region else ''}: {reason}"
            text = (
                f"permissible speed {what} at {len(where)} places of the path, first at {t:.3f} s ({about})"
            )
            raise InputError.at("permissible speed", found.robot, text, remedy)
    pieces = tuple(
        timed(piece, ceiling(stations, not_faster=not_faster, margin=margin), found.limits)
        for piece, stations in zip(found.path.pieces, found.stations, strict=True)
    )
    return Rescaled(found, pieces, not_faster, margin)


def ceiling(stations: Stations, *, not_faster: bool, margin: float) -> Ceiling:
    """The map less a margin; with ``not_faster`` no more than the largest given speed around, either."""
    given = stations.given
    around = np.maximum(given[:-1], given[1:])
    # Where the given motion rests, the timing could never begin.
    around = np.maximum(around, LEAST_GIVEN * max(float(given.max()), 1e-12))

    def top(s: Array) -> Array:
        of_map = (1 - margin) * stations.between(s)
        if not not_faster:
            return of_map
        k = np.clip(np.searchsorted(stations.s, s, side="right") - 1, 0, len(around) - 1)
        return np.minimum(of_map, around[k])

    return top


@dataclass(frozen=True)
class Spent:
    """How long what governs."""

    what: str
    time: float
    """[s]"""


@dataclass(frozen=True)
class Check:
    """How much of each limit is used at most, at 1 kHz and where the jerk jumps; 1 is all of it."""

    map: float
    velocity: float
    acceleration: float
    jerk: float


def check(motion: Rescaled) -> Check:
    """Look at every limit again, independently of how the motion came about."""
    most = np.zeros(4)
    for piece, stations in zip(motion.pieces, motion.of.stations, strict=True):
        use = piece.use(piece.instants(), stations.between, motion.of.limits)
        most = np.maximum(most, [np.max(x) for x in (use.map, use.velocity, use.acceleration, use.jerk)])
    return Check(*most.tolist())


def spent(motion: Rescaled) -> tuple[Spent, ...]:
    """Where the time goes: what governs at every millisecond, longest first."""
    names = motion.of.limits.joints
    times: dict[str, float] = {}
    stands = float(motion.of.path.stands.sum())
    if stands > 0:
        times["stands as the given motion does"] = stands
    for piece, stations in zip(motion.pieces, motion.of.stations, strict=True):
        n = max(1, round(piece.duration / CHECK))
        t = (np.arange(n) + 0.5) * piece.duration / n
        limit = ceiling(stations, not_faster=motion.not_faster, margin=motion.margin)
        use = piece.use(t, limit, motion.of.limits)
        s = piece.profile.at(t).s
        each = piece.duration / n
        for i in range(n):
            times_key = _governs(
                use.map[i], use.velocity[i], use.acceleration[i], use.jerk[i], stations, s[i], names
            )
            times[times_key] = times.get(times_key, 0.0) + each
    return tuple(Spent(what, time) for what, time in sorted(times.items(), key=lambda item: -item[1]))


def _governs(
    of_map: float, qd: Array, qdd: Array, qddd: Array, stations: Stations, s: float, names: tuple[str, ...]
) -> str:
    if of_map >= USED:
        k = int(np.clip(np.searchsorted(stations.s, s, side="right") - 1, 0, len(stations.s) - 2))
        lower = k if stations.permissible[k] <= stations.permissible[k + 1] else k + 1
        reason = stations.governing[lower]
        if reason is None:
            return "speed of the given motion, or of a joint"
        return reason.words()
    for used, what in ((qd, "speed"), (qdd, "acceleration"), (qddd, "jerk")):
        if used.max() >= USED:
            return f"{what} of {names[int(used.argmax())]}"
    return "transition between limits"
