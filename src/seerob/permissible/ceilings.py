"""What a criterion permits at a state of the twin, as a share of the robot's speed there.

The criteria are asked, nothing is computed anew: the share of the speed of separation monitoring, and the
permissible speeds of every moving surface against every body region of power and force limiting.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from seerob.collision import Governing
from seerob.contact_limits import Judged
from seerob.contact_regions import REGIONS, without_limit
from seerob.criterion import Criterion
from seerob.errors import Undecided
from seerob.model import Model
from seerob.safety.kinetic_energy import KineticEnergy
from seerob.safety.power_and_force import STANDSTILL, Contacts, PowerAndForce
from seerob.safety.separation import Separation
from seerob.safety.velocity import Velocity
from seerob.snapshot import Verdict
from seerob.state import State


@dataclass(frozen=True)
class Ceiling:
    """The largest speed that one criterion permits, for one body region if it has any."""

    criterion: str
    share: float
    """Of the speed that was asked about: inf without a limit, NaN when it cannot be told."""
    speed: float = math.nan
    """The same of the governing surface patch [m/s]; NaN where there is none."""
    region: str = ""
    """Body region; empty for criteria that know none."""
    surface: str = ""
    """Part of the robot that governs."""
    contact: str = ""
    """``free`` or ``clamped``; empty without contact."""
    governs: str = ""
    """``force``, ``pressure``, ``energy``, ``separation`` …"""
    reason: str = ""
    """Why it cannot be told, or why no speed is permitted."""

    @property
    def undecided(self) -> bool:
        """Whether it is not known."""
        return math.isnan(self.share)


Ask = Callable[[State], tuple[Ceiling, ...]]
"""Ceilings at a state in which the robot has the speed that is asked about; never raises `Undecided`."""


def ceilings_of(criterion: Criterion, model: Model, robot: str) -> Ask | None:
    """How to ask a criterion; None for one that does not limit the speed of the robot.

    Args:
        criterion: Of the workstation.
        model: The compiled workstation.
        robot: Whose speed is asked about.
    """
    ask: Ask | None = None
    if isinstance(criterion, Separation) and robot in criterion.between:
        ask = _separation(criterion, model)
    elif isinstance(criterion, PowerAndForce) and criterion.robot == robot:
        ask = _contact(criterion, model)
    elif isinstance(criterion, Velocity) and criterion.limit is not None:
        ask = _power(criterion, model, robot, criterion.limit, 1)
    elif isinstance(criterion, KineticEnergy) and criterion.limit is not None and criterion.robot == robot:
        ask = _power(criterion, model, robot, criterion.limit, 2)
    if ask is None:
        return None
    inner = ask

    def decided(state: State) -> tuple[Ceiling, ...]:
        try:
            return inner(state)
        except Undecided as why:
            return (Ceiling(criterion.name, math.nan, reason=str(why)),)

    return decided


def _power(criterion: Criterion, model: Model, robot: str, limit: float, power: int) -> Ask | None:
    """A figure that grows with a power of all the robot's speeds."""
    if isinstance(criterion, Velocity):
        names = {model.carrier(model.frame(criterion.at)).name} if criterion.at else {
            model.bodies[i].carrier for i in model.select(criterion.of or "")
        }  # fmt: skip
        if names - {""} != {robot}:
            return None
    evaluate = criterion.bind(model)

    def ask(state: State) -> tuple[Ceiling, ...]:
        result = evaluate(state)
        value = 0.0 if result.value is None else result.value
        share = math.inf if value <= 0 else (limit / value) ** (1 / power)
        speed = limit if power == 1 else math.nan
        governs = "speed" if power == 1 else "kinetic energy"
        return (Ceiling(criterion.name, share, speed, surface=result.reason, governs=governs),)

    return ask


def _separation(criterion: Separation, model: Model) -> Ask:
    evaluate, unknown = criterion.bind(model), criterion.unknown(model)
    if criterion.mode == "fixed":
        unknown = 'mode = "fixed" depends on the whole run; ask with mode = "dynamic"'

    def ask(state: State) -> tuple[Ceiling, ...]:
        if unknown:
            raise Undecided(unknown)
        result = evaluate(state)
        parts = {part.name: part for part in result.parts}
        speed, share = parts["largest permissible speed"], parts["share of the present speed"]
        if share.value is not None:
            at = math.nan if speed.value is None else speed.value
            return (
                Ceiling(
                    criterion.name,
                    share.value,
                    at,
                    surface=result.reason,
                    governs="separation",
                    reason="too near at any speed" if share.value == 0 else "",
                ),
            )
        # Without a share it stands still, and then the distance alone says whether it may move.
        near = result.verdict is Verdict.EXCEEDED and share.reason.startswith("stands still")
        reason = "too near at standstill" if near else ""
        return (Ceiling(criterion.name, 0.0 if near else math.inf, governs="separation", reason=reason),)

    return ask


def _contact(criterion: PowerAndForce, model: Model) -> Ask:
    contacts = Contacts(criterion, model)

    def ask(state: State) -> tuple[Ceiling, ...]:
        judged = contacts.judge(state)
        regions = np.flatnonzero(judged.near.any(axis=0)).tolist()
        return tuple(
            ceiling for k in regions if (ceiling := _of_region(contacts, judged, int(k))) is not None
        )

    return ask


def _of_region(contacts: Contacts, judged: Judged, k: int) -> Ceiling | None:
    """Of one of `REGIONS` that something could hit; None for one that other measures keep from contact."""
    spec, model, name = contacts.spec, contacts.model, REGIONS[k]
    if name in spec.excluded:
        return None
    rows = np.flatnonzero(judged.near[:, k])
    bodies = [model.bodies[contacts.moving[row]].name for row in rows]
    column = contacts.columns.get(name)
    if column is None:
        region = contacts.limits.region(name)
        row = int(judged.v_r[rows].argmax())
        within = None if contacts.people is None else f"{bodies[row]} moves within {spec.horizon:g} m"
        permitted = region is None or region.permitted
        verdict, reason = without_limit(name, permitted, within, contacts.limits.file)
        stopped = verdict is Verdict.EXCEEDED
        return Ceiling(
            spec.name, 0.0 if stopped else math.nan, 0.0 if stopped else math.nan, name, bodies[row],
            governs="no contact permitted" if stopped else "", reason=reason,
        )  # fmt: skip
    speeds = judged.speeds
    v = np.maximum(speeds.permissible[rows, column] - judged.v_h[k], 0.0)
    shares = v / np.maximum(judged.v_r[rows], STANDSTILL)
    open_rows = np.isnan(speeds.pressure[rows, column])
    i = int(open_rows.argmax()) if open_rows.any() else int(shares.argmin())
    row = int(rows[i])
    contact = "clamped" if judged.clamped[row, column] else "free"
    if open_rows.any():
        why = f"contact pressure of {bodies[i]} ({contact}): {contacts.unknown[row]}"
        return Ceiling(spec.name, math.nan, math.nan, name, bodies[i], contact, reason=why)
    governs = Governing(int(speeds.governing[row, column])).name.lower()
    reason = ""
    if shares[i] == 0:
        moves = judged.v_h[k] > 0
        reason = "the person alone is faster than permitted" if moves else "no speed of contact is permitted"
    return Ceiling(spec.name, float(shares[i]), float(v[i]), name, bodies[i], contact, governs, reason)
