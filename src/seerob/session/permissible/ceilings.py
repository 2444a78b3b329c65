r"""Which criteria of a workstation limit the speed of a robot, and how each is asked.

Speed and separation monitoring permits a share of the robot's speed at a state.

With ``mode = "fixed"`` the largest :math:`S_p` of the whole run counts at every instant. It is kept when at
every place no part has an :math:`S_p` above the least distance that it has anywhere on the way,

.. math:: S_{p,i}(t) \le \min_\tau d_i(\tau)\ \text{for all } t
    \quad\Rightarrow\quad \max_{\tau \le t} S_{p,i}(\tau) \le d_i(t),

so the inverse is that of the dynamic mode with the least distance of each part instead of the present one.
That is enough, and more than is needed only before the largest :math:`S_p` has occurred.

Power and force limiting permits shares of the robot's speed at a state. The permissible speeds of every
moving surface against every body region are asked for, nothing is computed anew; of each region
the surface that permits the least share of its own speed counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from msgspec.structs import replace as changed

from seerob.core.errors import InputError, Problem, Undecided
from seerob.core.figures import rounded_down
from seerob.core.snapshot import Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import admitted
from seerob.criteria.contact.collision import Governing
from seerob.criteria.contact.limits import Judged
from seerob.criteria.contact.regions import REGIONS, without_limit
from seerob.criteria.criterion import Criterion
from seerob.criteria.question import held
from seerob.criteria.safety.kinetic_energy import KineticEnergy
from seerob.criteria.safety.power_and_force import STANDSTILL, Contacts, PowerAndForce
from seerob.criteria.safety.separation import Separation
from seerob.criteria.safety.velocity import Velocity
from seerob.model.model import Model
from seerob.twin.accuracy.distance_ends import DistanceEnds
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


ANYWHERE = 1e3
"""Horizon within which everybody is [m]: a method that permits a speed by itself has to judge everybody."""


def contact(criterion: PowerAndForce, model: Model, *, anywhere: bool) -> Answer:
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


def separation(criterion: Separation, model: Model, robot: str) -> tuple[Answer, Look | None]:
    """How to ask for the share, and for the fixed mode how to show the places on the way before that.

    Args:
        criterion: Of the workstation; one of its sides is the robot.
        model: The compiled workstation.
        robot: Whose speed is asked about.
    """
    unknown = criterion.unknown(model)
    inverse = criterion.at_worst(model).inverse(model)
    human = next(name for name in criterion.between if name != robot)
    gap = model.gap(model.select(human), model.robot(robot).moving)
    names = [model.bodies[i].name for i in gap.b]
    ends = DistanceEnds(model, gap)
    least = np.full(len(gap.b), np.inf)
    fixed = criterion.mode == "fixed"

    def distances(state: State) -> Array:
        # As the criterion has them: the least that the errors of the twin's bones leave possible.
        return ends.of_bodies(state, state.closest_per_body(gap).distance)[0]

    def look(state: State) -> None:
        # Where somebody's place is not known the map has no number either.
        with suppress(Undecided):
            np.minimum(least, distances(state), out=least)

    def ask(state: State) -> tuple[Ceiling, ...]:
        if unknown:
            raise Undecided(unknown)
        distance = distances(state)
        if fixed:
            distance = np.minimum(distance, least)
        S_p, (speed, share) = inverse(state, distance)
        k = int((distance - S_p).argmin())
        part = f"{names[k]}: {rounded_down(float(distance[k]), 'm')} from {human}"
        part += " at the nearest place of the way" if fixed else ""
        if share.value is not None:
            at = math.nan if speed.value is None else speed.value
            reason = f"too near at any speed ({part})" if share.value == 0 else ""
            return (
                Ceiling(criterion.name, share.value, at, surface=part, governs="separation", reason=reason),
            )
        # Without a share it stands still, and then the distance alone says whether it may move.
        near = share.reason.startswith("stands still") and bool((distance < S_p).any())
        reason = f"too near at standstill ({part})" if near else ""
        return (Ceiling(criterion.name, 0.0 if near else math.inf, governs="separation", reason=reason),)

    return ask, look if fixed else None


def ceilings_of(criterion: Criterion, model: Model, robot: str, *, anywhere: bool) -> Ask | None:
    """How to ask a criterion; None for one that does not limit the speed of the robot.

    Args:
        criterion: Of the workstation.
        model: The compiled workstation.
        robot: Whose speed is asked about.
        anywhere: Whether contact is asked about wherever people are, not only within its horizon.
    """
    ask: Answer | None = None
    look: Look | None = None
    method = Method.OWN
    if isinstance(criterion, Separation) and robot in criterion.between:
        ask, look = separation(criterion, model, robot)
        method = Method.SSM
    elif isinstance(criterion, PowerAndForce) and criterion.robot == robot:
        ask = contact(criterion, model, anywhere=anywhere)
        method = Method.PFL
    elif isinstance(criterion, Velocity) and criterion.limit is not None:
        ask = _power(criterion, model, robot, criterion.limit, 1)
    elif isinstance(criterion, KineticEnergy) and criterion.limit is not None and criterion.robot == robot:
        ask = _power(criterion, model, robot, criterion.limit, 2)
    if ask is None:
        return None
    inner, withheld = ask, held(criterion, model, model.findings)

    def muted(state: State) -> bool:
        return criterion.active is not None and not state.signal(criterion.active)

    def decided(state: State) -> tuple[Ceiling, ...]:
        try:
            if withheld and not muted(state):
                raise Undecided(withheld)
            found = inner(state) if not muted(state) else (_not_asked(criterion),)
        except Undecided as why:
            found = (Ceiling(criterion.name, math.nan, reason=str(why)),)
        return tuple(replace(ceiling, method=method) for ceiling in found)

    return Ask(decided, method, None if look is None else _unless(muted, look))


def _not_asked(criterion: Criterion) -> Ceiling:
    reason = f"not asked: {criterion.active} is false"
    return Ceiling(criterion.name, math.inf, reason=reason, asked=False)


def _unless(muted: Callable[[State], bool], look: Look) -> Look:
    """Shown only the places at which the criterion is asked; where nobody knows, it is shown too."""

    def shown(state: State) -> None:
        try:
            if muted(state):
                return
        except Undecided:
            pass
        look(state)

    return shown


def _power(criterion: Criterion, model: Model, robot: str, limit: float, power: int) -> Answer | None:
    """A figure that grows with a power of all the robot's speeds."""
    if isinstance(criterion, Velocity):
        names = {model.carrier(model.frame(criterion.at)).name} if criterion.at else {
            model.bodies[i].carrier for i in model.select(criterion.of or "")
        }  # fmt: skip
        if names - {""} != {robot}:
            return None
    evaluate = criterion.bind(model)
    figure = Figure(limit, criterion.unit, "workstation file")

    def ask(state: State) -> tuple[Ceiling, ...]:
        result = evaluate(state)
        # What may be off counts in full, as in the criterion's own verdict.
        value = result.value if result.interval is None else result.interval[1]
        if value is None or (result.verdict is Verdict.UNDECIDED and value <= limit):
            raise Undecided(result.reason or f"{criterion.name} says no figure")
        share = math.inf if value <= 0 else (max(0.0, admitted(limit)) / value) ** (1 / power)
        speed = limit if power == 1 else math.nan
        governs = "speed" if power == 1 else "kinetic energy"
        return (Ceiling(criterion.name, share, speed, surface=result.reason, governs=governs, limit=figure),)

    return ask


# -- methods that limit a speed, and their ceilings together --------------------------------------


class By(StrEnum):
    """Which methods count."""

    ALL = "all"
    """Every method that the workstation has; the lesser of both speeds counts."""
    SSM = "ssm"
    """Speed and separation monitoring alone."""
    PFL = "pfl"
    """Power and force limiting alone."""
    BOTH = "both"
    """The lesser of the two; both must be there."""
    EITHER = "either"
    """Whichever permits more at each place; both must be there, and about the same people."""

    def counts(self, method: Method) -> bool:
        """Whether ceilings of a method count."""
        if self is By.SSM:
            return method is not Method.PFL
        return self is not By.PFL or method is not Method.SSM

    def contact_anywhere(self, criteria: Sequence[Criterion], robot: str) -> bool:
        """Whether contact is asked about wherever people are, not only within its horizon.

        A speed that contact permits by itself holds for whoever comes near: nothing else keeps them away.
        """
        separated = any(isinstance(c, Separation) and robot in c.between for c in criteria)
        return self in (By.PFL, By.EITHER) or (self is By.ALL and not separated)


BY = {
    By.ALL: "by every criterion that limits it",
    By.SSM: "by speed and separation monitoring",
    By.PFL: "by power and force limiting",
    By.BOTH: "by speed and separation monitoring and power and force limiting, the lesser of both",
    By.EITHER: "by separation monitoring or power and force limiting, whichever permits more at each place",
}

EITHER_NEEDS = (
    "each method alone is enough; that needs a controller that monitors both at once and falls back "
    "to the speed of power and force limiting, or stops, before the separation is lost; a detection that "
    "sees everybody who can come near; and contacts that are limited all along the path, wherever they count"
)


def governing(ceilings: Sequence[Ceiling], by: By, *, below: float = 1.0) -> Ceiling | None:
    """What governs at a place: what cannot be told, else the least share; None when none is below a share."""
    counted = [c for c in ceilings if by.counts(c.method) and c.asked]
    # What is not asked there protects nobody, and no method is enough without it.
    if by is By.EITHER and all(c.asked or c.method is Method.OWN for c in ceilings):
        own = [c for c in counted if c.method is Method.OWN]
        ssm, pfl = (_least([c for c in counted if c.method is m]) for m in (Method.SSM, Method.PFL))
        # Who permits everything needs no help of the other.
        counted = own if ssm is None or pfl is None else [*own, _larger(ssm, pfl)]
    least = _least(counted)
    return least if least is not None and (least.undecided or least.share < below) else None


def _least(ceilings: Sequence[Ceiling]) -> Ceiling | None:
    """What cannot be told, else the least; None when nothing limits the speed."""
    undecided = [c for c in ceilings if c.undecided]
    least = undecided[0] if undecided else min(ceilings, key=lambda c: c.share, default=None)
    return None if least is None or least.share == math.inf else least


def _larger(a: Ceiling, b: Ceiling) -> Ceiling:
    """Of two methods that each permit a share; who is unknown only counts where the other permits none."""
    for known, other in ((a, b), (b, a)):
        if other.undecided and not known.undecided:
            return known if known.share > 0 else other
    return a if a.undecided or a.share >= b.share else b


def require(by: By, criteria: Sequence[Criterion], model: Model, robot: str) -> None:
    """Refuse a choice that the criteria of a workstation do not carry.

    Raises:
        InputError: A method that nobody asks for, or methods that do not speak of the same people; all of it.
    """
    ssm = [c for c in criteria if isinstance(c, Separation) and robot in c.between]
    pfl = [c for c in criteria if isinstance(c, PowerAndForce) and c.robot == robot]
    needed = {
        "separation": (by in (By.SSM, By.BOTH, By.EITHER), ssm),
        "power_and_force": (by in (By.PFL, By.BOTH, By.EITHER), pfl),
    }
    problems = [
        Problem(
            "permissible speed",
            "by",
            f"{by.value} needs a criterion of kind {kind} for {robot}",
            f'add [[safety]] with kind = "{kind}"',
        )
        for kind, (wanted, found) in needed.items()
        if wanted and not found
    ]
    if by is By.EITHER and ssm and pfl:
        asked = {name for c in ssm for name in c.between}
        problems += [
            Problem(
                "permissible speed",
                "by",
                f"either: separation does not ask about {human.name}, contact alone would not protect them",
                f"add a criterion of kind separation for {human.name}",
            )
            for human in model.workstation.humans
            if human.name not in asked
        ]
    if problems:
        raise InputError(problems)
