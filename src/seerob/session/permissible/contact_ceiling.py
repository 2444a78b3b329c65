"""What power and force limiting permits at a state, as shares of the robot's speed there.

The permissible speeds of every moving surface against every body region are asked for, nothing is computed
anew; of each region the surface that permits the least share of its own speed counts.
"""

from __future__ import annotations

import math

import numpy as np
from msgspec.structs import replace as changed

from seerob.core.snapshot import Verdict
from seerob.criteria.contact.collision import Governing
from seerob.criteria.contact.limits import Judged
from seerob.criteria.contact.regions import REGIONS, without_limit
from seerob.criteria.safety.power_and_force import STANDSTILL, Contacts, PowerAndForce
from seerob.model.model import Model
from seerob.session.permissible.ceiling import Answer, Ceiling, Figure
from seerob.twin.state import State

ANYWHERE = 1e3
"""Horizon within which everybody is [m]: a method that permits a speed by itself has to judge everybody."""


def contact(criterion: PowerAndForce, model: Model, *, anywhere: bool = False) -> Answer:
    """How to ask for the shares, one for each body region that something could hit.

    Args:
        criterion: Of the workstation.
        model: The compiled workstation.
        anywhere: Whether to ask wherever people are, not only within its horizon.
    """
    contacts = Contacts(changed(criterion, horizon=ANYWHERE) if anywhere else criterion, model)

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
        within = None if contacts.people is None else f"{bodies[row]} moves {_where(spec)}"
        permitted = region is None or region.permitted
        verdict, reason = without_limit(name, permitted, within, contacts.limits.file)
        stopped = verdict is Verdict.EXCEEDED
        return Ceiling(
            spec.name, 0.0 if stopped else math.nan, 0.0 if stopped else math.nan, name, bodies[row],
            governs="no contact permitted" if stopped else "", reason=reason,
        )  # fmt: skip
    speeds = judged.speeds
    measured = contacts.measured.permits(column, judged.clamped[:, column])[rows]
    v = np.maximum(np.minimum(judged.least[rows, column], measured) - judged.v_h[k], 0.0)
    own = judged.v_r if judged.closing is None else np.maximum(judged.v_r, judged.closing[:, k])
    shares = v / np.maximum(own[rows], STANDSTILL)
    open_rows = np.isnan(speeds.pressure[rows, column]) | np.isnan(measured)
    i = int(open_rows.argmax()) if open_rows.any() else int(shares.argmin())
    row = int(rows[i])
    how = "clamped" if judged.clamped[row, column] else "free"
    if judged.on_floor is not None and judged.on_floor[row, column]:
        how = "clamped on the floor"
    if open_rows.any():
        why = f"contact pressure of {bodies[i]} ({how}): {contacts.unknown[row]}"
        if np.isnan(measured[i]):
            why = f"what was measured of {bodies[i]} permits no speed that is known"
        return Ceiling(spec.name, math.nan, math.nan, name, bodies[i], how, reason=why)
    governs = Governing(int(speeds.governing[row, column])).name.lower()
    reason = ""
    if shares[i] == 0:
        moves = judged.v_h[k] > 0
        reason = "the person alone is faster than permitted" if moves else "no speed of contact is permitted"
    limit = _limit(contacts, name, governs, row, clamped=bool(judged.clamped[row, column]))
    share, speed = float(shares[i]), float(v[i])
    if measured[i] < judged.least[row, column]:
        return Ceiling(spec.name, share, speed, name, bodies[i], how, "measurement", reason)
    return Ceiling(spec.name, share, speed, name, bodies[i], how, governs, reason, limit=limit)


def _where(spec: PowerAndForce) -> str:
    """How near to the person, in words."""
    if spec.horizon >= ANYWHERE:
        return "and nothing else keeps the person away"
    return f"within {spec.horizon:g} m"


def _limit(contacts: Contacts, region: str, governs: str, row: int, *, clamped: bool) -> Figure | None:
    """The figure of the table that governs: quasi-static when clamped, else transient."""
    arrays, column = contacts.arrays, contacts.columns[region]
    of = arrays.regions[column]
    factor = 1.0 if clamped else float(arrays.multiplier[column])
    kind = "quasi-static" if clamped else f"transient, {factor:g} times the quasi-static"
    if governs == "force":
        return Figure(factor * of.force.value, of.force.unit, f"{kind}; {of.force.source}")
    if governs == "pressure":
        own = np.flatnonzero(arrays.owner == column)
        k = int(contacts.forces[row, 0 if not clamped else 1, own].argmin())
        area = of.areas[k]
        source = f"{area.name}, {kind}; {area.pressure.source}"
        return Figure(factor * area.pressure.value, area.pressure.unit, source)
    # Only a printed energy can be below that of the force.
    return None if of.energy is None else Figure(of.energy.value, of.energy.unit, of.energy.source)
