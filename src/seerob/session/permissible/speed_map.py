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
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.session.permissible.ceiling import Ceiling
from seerob.session.permissible.joint_limits import JointLimits
from seerob.session.permissible.methods import By, governing
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
    methods: frozenset[str]
    """Which of them are separation monitoring, or power and force limiting."""

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
