"""The largest speed that a criterion permits at a place, and how a criterion is asked for it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from seerob.twin.state import State


class Method(StrEnum):
    """How a criterion protects a person."""

    SSM = "ssm"
    """Speed and separation monitoring."""
    PFL = "pfl"
    """Power and force limiting."""
    OWN = "own"
    """A limit of the workstation file on speed or energy."""


@dataclass(frozen=True)
class Figure:
    """A limit that governs, with its source."""

    value: float
    unit: str
    source: str


@dataclass(frozen=True)
class Ceiling:
    """The largest speed that one criterion permits, for one body region if it has any."""

    criterion: str
    share: float
    """Largest permitted share of the speed that was asked about: inf without a limit, NaN when it cannot be
    told."""
    speed: float = math.nan
    """Largest permitted speed of the governing surface patch [m/s]; NaN where there is none."""
    region: str = ""
    """Body region; empty for criteria that know none."""
    surface: str = ""
    """Part of the robot that governs."""
    contact: str = ""
    """``free``, ``clamped`` or ``clamped on the floor``; empty without contact."""
    governs: str = ""
    """``force``, ``pressure``, ``energy``, ``separation`` …"""
    reason: str = ""
    """Why it cannot be told, or why no speed is permitted."""
    asked: bool = True
    """False where its variable says that it does not apply there: it permits nothing and forbids nothing."""
    method: Method = Method.OWN
    limit: Figure | None = None
    """The figure that governs, such as a pressure; None where it has none of its own."""

    @property
    def undecided(self) -> bool:
        """Whether it is not known."""
        return math.isnan(self.share)

    def words(self) -> str:
        """``separation: Chest, free, pressure``: who governs, and by what."""
        where = ", ".join(x for x in (self.region, self.contact, self.governs) if x)
        return f"{self.criterion}: {where}" if where else self.criterion


Answer = Callable[[State], tuple[Ceiling, ...]]
Look = Callable[[State], None]


@dataclass(frozen=True)
class Ask:
    """How to ask a criterion."""

    ceilings: Answer
    """At a state in which the robot has the speed that is asked about; never raises `Undecided`."""
    method: Method
    look: Look | None = None
    """Shown every place before the first is asked about, for a criterion that judges a run as a whole."""
