r"""The permissible-speed map: how fast the robot may go at each place of its path, and why not faster.

At each of many places (stations) of the path the twin is put together: the robot there, moving along the
path with its reference speed, the largest that the speed limits of its joints allow,

.. math:: \dot s_{ref} = \min_j \dot q_{max,j} / |q'_j(s)|

everybody else where they are when the given motion is there. Every criterion says which share of that
speed it permits (`seerob.permissible.ceilings`). The permissible path speed is the least share times
:math:`\dot s_{ref}`; between two stations it is the lesser of theirs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from seerob.criterion import Criterion
from seerob.errors import InputError
from seerob.model import Mechanism, Model
from seerob.permissible.ceilings import Ask, Ceiling, ceilings_of
from seerob.permissible.given_motion import GivenMotion
from seerob.permissible.joint_limits import JointLimits
from seerob.permissible.path import Path, Piece
from seerob.permissible.witness import Clock, Posed, Witness
from seerob.safety.power_and_force import PowerAndForce
from seerob.safety.separation import Separation
from seerob.transforms import Array

Progress = Callable[[float], None]
"""Told what share is done, 0 to 1."""

SPACING = 0.02
"""Largest way between two stations in joint space [rad or m]."""
FEWEST = 5
"""Stations of a piece."""
MOST_STATIONS = 50_000


class Permit(StrEnum):
    """Whose ceilings count."""

    ALL = "all"
    """Every criterion that limits the robot's speed."""
    SEPARATION = "separation"
    """Speed and separation monitoring alone."""
    CONTACT = "contact"
    """Power and force limiting alone."""


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
    """Of every criterion and body region at every station."""

    @cached_property
    def governing(self) -> tuple[Ceiling | None, ...]:
        """At each station what cannot be told, else the least ceiling below the joints'; None: the joints."""
        return tuple(_governing(all_of_them) for all_of_them in self.ceilings)

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


def _governing(ceilings: Sequence[Ceiling]) -> Ceiling | None:
    doubts = [c for c in ceilings if c.undecided]
    if doubts:
        return doubts[0]
    least = min(ceilings, key=lambda c: c.share, default=None)
    return least if least is not None and least.share < 1.0 else None


@dataclass(frozen=True, eq=False)
class SpeedMap:
    """How fast the robot may go along its path."""

    robot: str
    path: Path
    limits: JointLimits
    stations: tuple[Stations, ...]
    """One for each piece."""
    permit: Permit
    asked: tuple[str, ...]
    """Names of the criteria."""

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


def speed_map(
    model: Model,
    robot: Mechanism,
    motion: GivenMotion,
    path: Path,
    limits: JointLimits,
    witness: Witness,
    *,
    criteria: Sequence[Criterion],
    permit: Permit = Permit.ALL,
    spacing: float = SPACING,
    others_at: Clock = lambda t: t,
    progress: Progress = lambda _: None,
) -> SpeedMap:
    """Ask every criterion along a path.

    Args:
        model: The compiled workstation.
        robot: Whose path it is.
        motion: The motion given.
        path: Its path.
        limits: Of its joints.
        witness: Of a run of the given motion.
        criteria: Of the workstation.
        permit: Which of them count.
        spacing: Largest way between two stations in joint space [rad or m].
        others_at: When the others are to be seen.
        progress: Told the share done; what it raises stops the work.

    Raises:
        InputError: No criterion limits the speed, or so many stations that it would never end.
    """
    asks = _asks(model, robot.name, criteria, permit)
    if not spacing > 0 or sum(piece.length for piece in path.pieces) / spacing > MOST_STATIONS:
        what = f"{spacing} rad or m gives more than {MOST_STATIONS} stations"
        raise InputError.at("permissible speed", "spacing", what, "give a larger spacing")
    state = Posed(model, robot, witness)
    found = []
    whole = sum(piece.length for piece in path.pieces)
    before = 0.0
    for piece in path.pieces:
        begun, length = before, piece.length

        def told(s: float, begun: float = begun) -> None:
            progress((begun + s) / whole)

        found.append(_of_piece(state, piece, motion, limits, list(asks.values()), spacing, others_at, told))
        before += length
    return SpeedMap(robot.name, path, limits, tuple(found), permit, tuple(asks))


def _asks(model: Model, robot: str, criteria: Sequence[Criterion], permit: Permit) -> dict[str, Ask]:
    kinds: dict[Permit, tuple[type[Criterion], ...]] = {
        Permit.ALL: (Criterion,), Permit.SEPARATION: (Separation,), Permit.CONTACT: (PowerAndForce,)
    }  # fmt: skip
    wanted = [c for c in criteria if isinstance(c, kinds[permit])]
    asks = {c.name: ask for c in wanted if (ask := ceilings_of(c, model, robot)) is not None}
    if not asks:
        what = f"no criterion of the workstation limits the speed of {robot} (asked for: {permit.value})"
        remedy = 'add [[safety]] with kind = "separation" or "power_and_force"'
        raise InputError.at("permissible speed", "safety", what, remedy)
    return asks


def reference_speed(piece: Piece, s: Array, limits: JointLimits) -> tuple[Array, NDArray[np.int64]]:
    """Path speed at which the first joint reaches its limit, and which joint that is."""
    with np.errstate(divide="ignore"):
        each = limits.velocity / np.abs(piece.at(s)[1])
    joint = each.argmin(axis=1)
    return each[np.arange(len(s)), joint], joint


def _of_piece(
    state: Posed,
    piece: Piece,
    motion: GivenMotion,
    limits: JointLimits,
    asks: Sequence[Ask],
    spacing: float,
    others_at: Clock,
    progress: Progress,
) -> Stations:
    s = np.linspace(0.0, piece.length, max(FEWEST, math.ceil(piece.length / spacing) + 1))
    t = piece.when(s)
    reference, joint = reference_speed(piece, s, limits)
    q, along, _, _ = piece.at(s)
    ceilings = []
    for k in range(len(s)):
        state.place(float(t[k]), others_at(float(t[k])), q[k], along[k] * reference[k], _doubt(motion, t[k]))
        ceilings.append(tuple(ceiling for ask in asks for ceiling in ask(state)))
        progress(float(s[k]))
    given = np.interp(s, piece.s, piece.speed)
    return Stations(s, t, reference, joint, given, tuple(ceilings))


def _doubt(motion: GivenMotion, t: float) -> str:
    k = int(motion.interval(t))
    if motion.good[k : k + 2].all():
        return ""
    return f"{motion.target}: its source does not vouch for where it is at {t:.3f} s"
