r"""The revised NIOSH lifting equation, and the rule about lifts that the workstation file describes.

Waters et al. 1993; DHHS (NIOSH) 94-110, revised September 2021.
:math:`RWL = LC \cdot HM \cdot VM \cdot DM \cdot AM \cdot FM \cdot CM` and :math:`LI = L / RWL`, for lifts
of one person with both hands. Lengths are in m, angles in rad, masses in kg, frequencies in lifts per minute.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct, structs
from numpy.typing import ArrayLike

from seerob.core import figures
from seerob.core.domains import number
from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.snapshot import Basis, Input, Origin, Result
from seerob.core.transforms import Array
from seerob.criteria.figure import Figure, Shown, verdict_of
from seerob.criteria.scoring.entered import EnteredMethod
from seerob.criteria.scoring.phases import Kilograms, Seconds
from seerob.criteria.scoring.spans import published
from seerob.model.model import Model
from seerob.model.provenance import given, limit

MIDDLE = 0.75
"""Height at which the tables of frequency and coupling change [m]."""
_ROUNDING = 1e-9


class Grip(StrEnum):
    """How well the object can be held."""

    GOOD = "good"
    FAIR = "fair"
    POOR = "poor"


class Duration(StrEnum):
    """Column of the frequency table."""

    SHORT = "short"
    """Up to 1 h, then recovery at least as long as the work."""
    MODERATE = "moderate"
    """Up to 2 h, then recovery of at least 0.3 times the work."""
    LONG = "long"
    """Up to 8 h."""


def duration(work: float, recovery: float) -> Duration:
    """Class of a stretch of lifting.

    Args:
        work: Lifting [s], all spells together between which the recovery was shorter than asked.
        recovery: Light work or rest that follows [s].

    Raises:
        ValueError: More than 8 h, to which the equation does not apply.
    """
    if not 0 <= work <= 8 * 3600:
        raise ValueError(f"{work / 3600:g} h of lifting: the equation applies to 0 to 8 h")
    number("recovery", recovery, 0, unit="s")
    if work <= 3600 and recovery >= work:
        return Duration.SHORT
    return Duration.MODERATE if work <= 7200 and recovery >= 0.3 * work else Duration.LONG


def horizontal_multiplier(H: ArrayLike) -> Array:
    """HM = 0.25/H of the distance from the ankles' middle to the hands [m]; 0 beyond 0.63 m."""
    distance = number("H", H, 0, unit="m")
    return np.where(distance > 0.63 + _ROUNDING, 0.0, 0.25 / np.maximum(distance, 0.25))


def vertical_multiplier(V: ArrayLike) -> Array:
    """VM = 1 - 0.3 |V - 0.75| of the height of the hands [m]; 0 beyond 1.75 m."""
    height = number("V, the height of the hands above the floor,", V, 0, unit="m")
    return np.where(height > 1.75 + _ROUNDING, 0.0, 1 - 0.3 * np.abs(height - MIDDLE))


def distance_multiplier(D: ArrayLike) -> Array:
    """DM = 0.82 + 0.045/D of the vertical travel [m]; 0 beyond 1.75 m."""
    travel = number("D", D, 0, unit="m")
    return np.where(travel > 1.75 + _ROUNDING, 0.0, 0.82 + 0.045 / np.maximum(travel, 0.25))


def asymmetry_multiplier(A: ArrayLike) -> Array:
    """AM = 1 - 0.0032 A/1° of the turn of the trunk [rad]; 0 beyond 135°."""
    angle = np.degrees(np.abs(number("A", A, -2 * math.pi, 2 * math.pi, "rad")))
    return np.where(angle > 135 + _ROUNDING, 0.0, 1 - 0.0032 * angle)


def frequency_multiplier(F: float, V: float, spell: Duration) -> float:
    """FM of the table, linear between its rows; 0 from a row of 0 on, also just before it.

    Args:
        F: Lifts per minute.
        V: Height of the hands at the origin [m].
        spell: How long the lifting lasts.
    """
    number("F", F, 0, unit="per minute")
    number("V", V, 0, unit="m")
    table = published("niosh")
    rows = table["frequencies"]
    column = 2 * list(Duration).index(Duration(spell)) + int(V >= MIDDLE - _ROUNDING)
    values = [row[column] for row in table["frequency_multiplier"]]
    if rows[-1] < F:
        return 0.0
    after = int(np.searchsorted(rows, F))
    return 0.0 if values[after] == 0 else float(np.interp(F, rows, values))


def coupling_multiplier(grip: Grip, V: float) -> float:
    """CM of the table, V being where the multiplier is taken [m]."""
    number("V", V, 0, unit="m")
    return float(published("niosh")["coupling"][Grip(grip).value][int(V >= MIDDLE - _ROUNDING)])


@dataclass(frozen=True, kw_only=True)
class End:
    """Where the hands are at the origin or the destination of a lift."""

    H: float
    """From the middle between the ankles, horizontally [m]."""
    V: float
    """Above the floor [m]."""
    A: float = 0.0
    """Turn of the trunk out of the sagittal plane [rad]."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """One lifting task."""

    average: float
    """Mass lifted on average [kg]."""
    heaviest: float
    """Greatest mass lifted [kg]."""
    origin: End
    destination: End
    control: bool
    """Significant control at the destination: it is judged as well."""
    frequency: float
    """Lifts per minute."""
    grip: Grip

    def __post_init__(self) -> None:
        number("average", self.average, 0, unit="kg")
        number("heaviest", self.heaviest, self.average, unit="kg")


def frequency_independent(task: Task, end: End) -> float:
    """FIRWL: the recommended weight at one end for rare lifts [kg]."""
    travel = abs(task.destination.V - task.origin.V)
    return float(
        published("niosh")["load_constant"]
        * horizontal_multiplier(end.H)
        * vertical_multiplier(end.V)
        * distance_multiplier(travel)
        * asymmetry_multiplier(end.A)
        * coupling_multiplier(task.grip, end.V)
    )


def governing(task: Task) -> tuple[float, str]:
    """The lower FIRWL of the ends that count [kg], and which end it is."""
    ends = {"origin": task.origin, **({"destination": task.destination} if task.control else {})}
    limits = {name: frequency_independent(task, end) for name, end in ends.items()}
    name = min(limits, key=lambda key: limits[key])
    return limits[name], name


def recommended_weight(task: Task, spell: Duration) -> float:
    """RWL of a task on its own, of the end that governs [kg]."""
    return governing(task)[0] * frequency_multiplier(task.frequency, task.origin.V, spell)


def composite_index(tasks: Sequence[Task], spell: Duration) -> float:
    r"""Composite lifting index; of one task with one mass its lifting index L/RWL.

    :math:`CLI = STLI_1 + \sum_n FILI_n (1/FM_{1..n} - 1/FM_{1..n-1})`, tasks in falling order of STLI,
    of equal ones the more frequent first; :math:`FM_{1..n}` at the sum of the first n frequencies, in the
    column of task n.

    Args:
        tasks: At least one, else a `ValueError`.
        spell: How long all of them last together.

    Returns:
        The index, infinite where a recommended weight is 0.
    """
    if not tasks:
        raise ValueError("no lifting task, an index is of at least one")
    rated = sorted(
        tasks, key=lambda task: (-_ratio(task.average, recommended_weight(task, spell)), -task.frequency)
    )
    first = rated[0]
    total = _ratio(first.average, recommended_weight(first, spell))
    summed = first.frequency
    for task in rated[1:]:
        before, summed = summed, summed + task.frequency
        steps = [_ratio(1.0, frequency_multiplier(F, task.origin.V, spell)) for F in (before, summed)]
        if math.isinf(steps[1]):
            return math.inf
        total += _ratio(task.heaviest, governing(task)[0]) * (steps[1] - steps[0])
    return total


def _ratio(load: float, weight: float) -> float:
    return load / weight if weight > 0 else math.inf


Height = Annotated[float, Meta(ge=0, extra={"unit": "m"})]
Distance = Annotated[float, Meta(ge=0, extra={"unit": "m"})]
Turn = Annotated[float, Meta(ge=-math.pi, le=math.pi, extra={"unit": "rad"})]

Exclusion = Literal[
    "one_handed",
    "seated_or_kneeling",
    "restricted_space",
    "unstable_load",
    "carrying_pushing_or_pulling",
    "wheelbarrow_or_shovel",
    "fast_lifting",
    "slippery_floor",
    "unfavourable_climate",
]
"""Where the equation does not apply. Fast: above 0.76 m/s. Slippery: friction below 0.4. Climate: outside
19 to 26 °C or 35 to 50 % relative humidity."""


class LiftEnd(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the hands are at one end of a lift."""

    horizontal: Distance
    """H: from the middle between the ankles to the middle between the hands, along the floor [m]."""
    vertical: Height
    """V: hands above the floor [m]."""
    asymmetry: Turn
    """A: turn of the load out of the sagittal plane [rad]."""


class Lift(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One lifting task."""

    phase: str = ""
    """Title of one of ``[[phases]]``: load and coupling are taken from it where they are not given here."""
    load: Kilograms | None = None
    """Mass on average [kg]."""
    heaviest: Kilograms | None = None
    """Greatest mass [kg]; the average when not given. A lift on its own is judged by it."""
    origin: LiftEnd
    """Where the lift begins."""
    destination: LiftEnd
    """Where it ends."""
    control: bool
    """The load is held back or placed with care at the destination: both ends count."""
    per_minute: Annotated[float, Meta(ge=0)]
    """Lifts per minute, averaged over 15 min."""
    coupling: Grip | None = None
    """How well the object can be held."""

    def missing(self) -> tuple[str, ...]:
        """What nobody entered."""
        return tuple(name for name in ("load", "coupling") if getattr(self, name) is None)

    def task(self) -> Task:
        """Return the task of the equation, of a lift of which nothing is missing."""
        assert self.load is not None
        assert self.coupling is not None
        ends = [End(H=e.horizontal, V=e.vertical, A=e.asymmetry) for e in (self.origin, self.destination)]
        return Task(
            average=self.load,
            heaviest=self.load if self.heaviest is None else self.heaviest,
            origin=ends[0],
            destination=ends[1],
            control=self.control,
            frequency=self.per_minute,
            grip=self.coupling,
        )


class Niosh(EnteredMethod, frozen=True, kw_only=True):
    """Lifting index of the revised NIOSH equation, composite when there are several lifts."""

    lifts: tuple[Lift, ...]
    """The lifting tasks; several are alternated by the same person."""
    work: Annotated[float, Meta(gt=0, le=28800, extra={"unit": "s"})]
    """How long they last, spells with too short a recovery in between added up [s]."""
    recovery: Seconds
    """Light work or rest that follows [s]."""
    exclusions: tuple[Exclusion, ...]
    """What of this is the case; the equation then does not apply. An empty list says that nothing is."""
    limit: Annotated[float, Meta(gt=0)] | None = None
    """Greatest admissible lifting index; the equation's authors aim at 1."""

    def figure(self, model: Model) -> Figure:
        """The index of what is entered.

        Raises:
            InputError: The equation does not apply.
        """
        lifts = self.entered(model)
        self._refuse(lifts)
        return self._index(lifts)

    def entered(self, model: Model) -> tuple[Lift, ...]:
        """The lifts with what they take from the phases that every rule shares.

        Raises:
            UnknownName: A lift names a phase that does not exist.
        """
        phases = self.titled_phases(model)
        found = []
        for lift in self.lifts:
            if not lift.phase:
                found.append(lift)
                continue
            if lift.phase not in phases:
                raise UnknownName("phase", lift.phase, phases)
            phase = phases[lift.phase]
            grip = next((grip for grip in Grip if grip == phase.coupling), None)
            load = phase.load if lift.load is None else lift.load
            coupling = grip if lift.coupling is None else lift.coupling
            found.append(structs.replace(lift, load=load, coupling=coupling))
        return tuple(found)

    def _refuse(self, lifts: tuple[Lift, ...]) -> None:
        problems = [
            Problem(
                self.name,
                "exclusions",
                f"the revised NIOSH equation does not apply: {what.replace('_', ' ')}",
                "use another method for this lift",
            )
            for what in self.exclusions
        ]
        if not lifts:
            problems.append(Problem(self.name, "lifts", "there is none", "describe at least one lift"))
        for i, lift in enumerate(lifts):
            if lift.heaviest is not None and lift.load is not None and lift.heaviest < lift.load:
                what = f"{lift.heaviest:g} kg is less than the average of {lift.load:g} kg"
                problems.append(Problem(self.name, f"lifts[{i}].heaviest", what, "give the greatest mass"))
        if problems:
            raise InputError(problems)

    def _tasks(self, lifts: tuple[Lift, ...]) -> list[Task]:
        """The lifts as the equation takes them; none where something of them is not entered."""
        if any(lift.missing() for lift in lifts):
            return []
        tasks = [lift.task() for lift in lifts]
        if len(tasks) == 1:
            # The composite index takes the greatest mass only from the second task on.
            tasks = [replace(tasks[0], average=tasks[0].heaviest)]
        return tasks

    def _index(self, lifts: tuple[Lift, ...]) -> Figure:
        tasks = self._tasks(lifts)
        index = composite_index(tasks, duration(self.work, self.recovery)) if tasks else math.nan
        # An infinite index exceeds each limit, but is no figure.
        unknown = math.isnan(index) or (math.isinf(index) and self.limit is None)
        return Figure(None if unknown else index, self.limit, beside=self._shown(lifts, index))

    def _shown(self, lifts: tuple[Lift, ...], index: float) -> Shown:
        if absent := [f"{what} of lift {i + 1}" for i, lift in enumerate(lifts) for what in lift.missing()]:
            return Shown(f"not entered: {', '.join(absent)}")
        spell = duration(self.work, self.recovery)
        parts, zero = [], []
        for i, task in enumerate(self._tasks(lifts)):
            weight, end = recommended_weight(task, spell), governing(task)[1]
            own = composite_index([task], spell)
            if weight == 0:
                zero.append(f"lift {i + 1}")
            parts.append(
                Result(
                    name=f"lift {i + 1}",
                    value=own if math.isfinite(own) else None,
                    limit=self.limit,
                    verdict=verdict_of(Figure(own, self.limit), at_most=True),
                    reason=f"recommended weight {figures.rounded_down(weight, 'kg')}, governed by the {end}",
                )
            )
        if math.isinf(index):
            why = f"of {', '.join(zero)} " if zero else "at the frequency of all lifts together "
            reason = f"the recommended weight {why}is 0: beyond the reach of the equation's tables"
            return Shown(reason, parts=tuple(parts))
        if len(parts) == 1:
            return Shown(parts[0].reason)
        return Shown(f"composite index of {len(parts)} lifts", parts=tuple(parts))

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        spell = duration(self.work, self.recovery)
        found = [
            Input(
                name="duration class",
                value=spell.value,
                origin=Origin.COMPUTED,
                source=f"{self.work / 60:g} min of lifting, {self.recovery / 60:g} min of recovery",
            ),
            Input(
                name="load constant",
                value=23.0,
                unit="kg",
                origin=Origin.STATED,
                source="DHHS (NIOSH) 94-110, revised 9/2021, public sources that agree (2+)",
            ),
        ]
        for i, lift in enumerate(self.entered(model)):
            of = f" of lift {i + 1}" if len(self.lifts) > 1 else ""
            origin = f"phase {lift.phase!r}" if lift.phase else "workstation file"
            heaviest = lift.load if lift.heaviest is None else lift.heaviest
            for name, value, unit in (
                ("load", lift.load, "kg"),
                ("heaviest", heaviest, "kg"),
                ("coupling", None if lift.coupling is None else lift.coupling.value, ""),
            ):
                known = Origin.MISSING if value is None else Origin.GIVEN
                found.append(Input(name=name + of, value=value, unit=unit, origin=known, source=origin))
            for name, end in (("origin", lift.origin), ("destination", lift.destination)):
                found += [
                    given(f"H at the {name}{of}", end.horizontal, "m"),
                    given(f"V at the {name}{of}", end.vertical, "m"),
                    given(f"A at the {name}{of}", end.asymmetry, "rad"),
                ]
            found.append(given(f"lifts per minute{of}", lift.per_minute, "1/min"))
        return Basis(
            formula="LI = L/RWL, RWL = 23 kg · HM · VM · DM · AM · FM · CM; CLI = STLI_1 + Σ FILI_n "
            "(1/FM_1..n - 1/FM_1..n-1)",
            source="Waters et al. 1993; DHHS (NIOSH) 94-110, revised 9/2021 (public sources that agree, 2+)",
            inputs=(*found, *limit(self.limit, "")),
            not_modelled=(
                "the twin's motion: heights, distances and frequencies are those of the workstation file",
                "next to a 0 of the frequency table the multiplier is 0, a choice",
                "for summed frequencies the table's column is that of the task that is added, a choice",
            ),
        )
