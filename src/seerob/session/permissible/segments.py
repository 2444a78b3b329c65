"""The map by segment: what an engineer reads, where the map has a row every few millimetres.

A segment lies between two places where the robot stands or turns back (waypoints), or is one of the parts of
equal way of the tool point into which a longer stretch is cut.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.session.permissible.ceiling import Ceiling
from seerob.session.permissible.speed_map import SpeedMap, Stations

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
