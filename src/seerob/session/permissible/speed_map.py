r"""The permissible-speed map: how fast the robot may go at each place of its path, and why not faster.

At each of many places (stations) of the path the twin is put together: the robot there, moving along the
path with its reference speed, the largest that the speed limits of its joints allow,

.. math:: \dot s_{ref} = \min_j \dot q_{max,j} / |q'_j(s)|

everybody else where they are when the given motion is there. Every criterion says which share of that
speed it permits (`seerob.session.permissible.ceilings`). The permissible path speed is the least share times
:math:`\dot s_{ref}`; between two stations it is the lesser of theirs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.session.permissible.ceilings import By, Ceiling, Method, governing
from seerob.session.permissible.joint_limits import JointLimits
from seerob.session.permissible.path import Path, Piece


@dataclass(frozen=True, eq=False)
class Stations:
    """The map of one piece; k stations."""

    s: Array
    """Path coordinate, shape (k,)."""
    t: Array
    """When the given motion was there [s], shape (k,)."""
    reference: Array
    """Path speed at which the first joint reaches its limit, shape (k,)."""
    joint: NDArray[np.int64]
    """That joint, shape (k,)."""
    given: Array
    """Path speed of the given motion, shape (k,)."""
    ceilings: tuple[tuple[Ceiling, ...], ...]
    """Ceilings of every criterion and body region at every station."""
    by: By
    q: Array
    """Joint positions, shape (k, d) [rad or m]."""
    tool: Array
    """Where the robot's tool point is in the world [m], shape (k, 3)."""
    lever: Array
    """Speed of the tool point by path speed [m/s per rad/s or m/s], shape (k,)."""

    @cached_property
    def governing(self) -> tuple[Ceiling | None, ...]:
        """At each station what cannot be told, else the least ceiling below the joints'; None: the joints."""
        return tuple(governing(all_of_them, self.by) for all_of_them in self.ceilings)

    @cached_property
    def share(self) -> Array:
        """Permissible share of the reference speed, NaN where it cannot be told, shape (k,)."""
        return np.array([1.0 if c is None else c.share for c in self.governing])

    @cached_property
    def permissible(self) -> Array:
        """Permissible path speed, NaN where it cannot be told, shape (k,)."""
        return self.share * self.reference

    def between(self, s: Array) -> Array:
        """Permissible path speed at any coordinates: the lesser of the two stations around each."""
        known = self.permissible
        lesser = np.minimum(known[:-1], known[1:])
        k = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        found = lesser[k]
        # On a station both of its sides count.
        on = (s == self.s[k]) & (k > 0)
        return np.asarray(np.where(on, np.minimum(found, lesser[k - 1]), found))


@dataclass(frozen=True, eq=False)
class SpeedMap:
    """How fast the robot may go along its path."""

    robot: str
    path: Path
    limits: JointLimits
    stations: tuple[Stations, ...]
    """One for each piece."""
    by: By
    asked: tuple[str, ...]
    """Names of the criteria."""
    methods: Mapping[str, Method]
    """Which of them are separation monitoring, or power and force limiting, by name."""

    @property
    def undecided(self) -> tuple[tuple[float, Ceiling], ...]:
        """Where it cannot be told how fast: when the given motion is there [s], and why."""
        return self._where(math.isnan)

    @property
    def blocked(self) -> tuple[tuple[float, Ceiling], ...]:
        """Where no speed is permitted: when the given motion is there [s], and why."""
        return self._where(lambda share: share == 0.0)

    def _where(self, holds: Callable[[float], bool]) -> tuple[tuple[float, Ceiling], ...]:
        return tuple(
            (t, c)
            for stations in self.stations
            for t, c in zip(stations.t.tolist(), stations.governing, strict=True)
            if c is not None and holds(c.share)
        )


def reference_speed(piece: Piece, s: Array, limits: JointLimits) -> tuple[Array, NDArray[np.int64]]:
    """Path speed at which the first joint reaches its limit, and which joint that is."""
    with np.errstate(divide="ignore"):
        each = limits.velocity / np.abs(piece.at(s)[1])
    joint = each.argmin(axis=1)
    return each[np.arange(len(s)), joint], joint


# -- the map by segment ---------------------------------------------------------------------------

LENGTH = 0.25
"""Longest way of the tool point in one segment [m]."""
MOST = 10_000


@dataclass(frozen=True, eq=False)
class PathSegment:
    """A stretch of the path, and the least that is permitted in it."""

    piece: int
    """Counted from 1; between two pieces the robot stands or turns back."""
    number: int
    """Counted from 1, through all pieces."""
    start: float
    """When the given motion begins it [s]."""
    end: float
    way: float
    """Way of the tool point, as a chain through the stations [m]."""
    tool: tuple[Array, Array]
    """Where the tool point is at its start and end [m], world."""
    permissible: float
    """Path speed at the place where the tool point may be slowest [rad/s or m/s]; NaN where it cannot be
    told. Where any criterion governs in the segment, places that only a joint limits are left out."""
    tool_speed: float
    """Speed of the tool point there [m/s]; NaN where it cannot be told."""
    given: float
    """Largest speed of the tool point in the given motion in the segment [m/s]."""
    share: float
    """Least permissible share of the given speed in the segment: NaN where it cannot be told, inf where the
    given motion stands still throughout."""
    at: float
    """When the given motion is at that place [s]."""
    governing: Ceiling | None
    """What governs there; None: the speed limit of a joint."""
    joint: str
    """The joint whose speed limit is the first there."""


def segments(found: SpeedMap, *, length: float = LENGTH) -> tuple[PathSegment, ...]:
    """The segments of a map, in the order of the path.

    Args:
        found: The map.
        length: Longest way of the tool point in one [m].

    Raises:
        InputError: A length that is not one, or that gives too many.
    """
    ways = [_ways(stations) for stations in found.stations]
    if not length > 0 or sum(way[-1] for way in ways) / length > MOST:
        what = f"{length} m gives more than {MOST} segments"
        raise InputError.at("permissible speed", "segment", what, "give a larger length")
    return tuple(_all(found, ways, length))


def _all(found: SpeedMap, ways: list[Array], length: float) -> Iterator[PathSegment]:
    number = 0
    for piece, (stations, way) in enumerate(zip(found.stations, ways, strict=True), 1):
        count = max(1, math.ceil(float(way[-1]) / length - 1e-9))
        cuts = np.unique(np.searchsorted(way, np.linspace(0, float(way[-1]), count + 1)[1:-1]))
        for a, b in pairwise(np.unique([0, *cuts.tolist(), len(way) - 1]).tolist()):
            number += 1
            yield _segment(found, stations, way, piece, number, a, b)


def _ways(stations: Stations) -> Array:
    steps = np.linalg.norm(np.diff(stations.tool, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _segment(
    found: SpeedMap, stations: Stations, way: Array, piece: int, number: int, a: int, b: int
) -> PathSegment:
    # Both ends count: between two stations the lesser does.
    inside = range(a, b + 1)
    unknown = [i for i in inside if math.isnan(stations.permissible[i])]
    # Where a joint's own limit is lower than a criterion elsewhere, nothing has to be told the robot.
    judged = [i for i in inside if stations.governing[i] is not None] or list(inside)
    k = (unknown or [min(judged, key=lambda i: stations.permissible[i] * stations.lever[i])])[0]
    lever = float(stations.lever[k])
    return PathSegment(
        piece,
        number,
        float(stations.t[a]),
        float(stations.t[b]),
        float(way[b] - way[a]),
        (stations.tool[a], stations.tool[b]),
        float(stations.permissible[k]),
        float(stations.permissible[k]) * lever,
        float((stations.given * stations.lever)[a : b + 1].max()),
        _least_share(stations, a, b),
        float(stations.t[k]),
        stations.governing[k],
        found.limits.joints[int(stations.joint[k])],
    )


def _least_share(stations: Stations, a: int, b: int) -> float:
    """Of the permissible path speed in the given one; where both are 0 nothing is exceeded."""
    permitted, given = stations.permissible[a : b + 1], stations.given[a : b + 1]
    if np.isnan(permitted).any():
        return math.nan
    moves = given > 0
    return float((permitted[moves] / given[moves]).min()) if moves.any() else math.inf
