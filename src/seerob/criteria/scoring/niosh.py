r"""The revised NIOSH lifting equation: Waters et al. 1993; DHHS (NIOSH) 94-110, revised September 2021.

:math:`RWL = LC \cdot HM \cdot VM \cdot DM \cdot AM \cdot FM \cdot CM` and :math:`LI = L / RWL`, for lifts
of one person with both hands. Lengths are in m, angles in rad, masses in kg, frequencies in lifts per minute.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.domains import number
from seerob.core.transforms import Array
from seerob.criteria.scoring.published import published

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
