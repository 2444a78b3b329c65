"""Lifting, lowering, pushing, pulling and carrying by the LM-MMH equations, which replace Snook and Ciriello.

Potvin, Ciriello, Snook, Maynard, Brogmus 2021: the load that people themselves find acceptable for 8 h,
normally distributed. Lengths are in m, loads in kg, frequencies per minute.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, NamedTuple, cast

from msgspec import Meta, Struct, structs

from seerob.core.domains import number
from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.snapshot import Basis, Input, Level, Origin, Result
from seerob.criteria.figure import Figure, Shown, verdict_of
from seerob.criteria.scoring.entered import EnteredMethod
from seerob.criteria.scoring.phases import Kilograms
from seerob.criteria.scoring.spans import published
from seerob.model.model import Model
from seerob.model.provenance import given, limit

Action = Literal["lift", "lower", "push_initial", "push_sustained", "pull_initial", "pull_sustained", "carry"]
Sex = Literal["female", "male"]
Meters = Annotated[float, Meta(ge=0, extra={"unit": "m"})]
Exclusion = Literal[
    "one_handed", "not_smooth", "trunk_twisted_or_bent_sideways", "unfavourable_climate", "beyond_8_hours"
]
"""Where the equations do not apply."""
FASTEST = {"lift": 11.0, "lower": 11.0, "carry": 29.0}
"""Mean speed, distance times frequency, beyond which the equations end [m/min]; 37 of pushing and pulling."""
CAUTION: dict[Sex, dict[str, float]] = {
    "female": {"lift": 3.0, "lower": 3.0, "carry": 10.0, "push": 10.0},
    "male": {"lift": 3.0, "lower": 3.0, "carry": math.inf, "push": 15.0},
}
"""Mean speed beyond which the body's endurance may be exceeded, which the equations do not know [m/min]."""
RAREST = 1 / 480
"""Once in 8 h [1/min]; what is rarer counts as that."""
NEEDS = {
    "lift": ("reach", "origin", "destination", "handles"),
    "lower": ("reach", "origin", "destination", "handles"),
}
"""What is asked of an action; of others the height of the hands and the distance."""


class Handling(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One thing that is lifted, lowered, pushed, pulled or carried."""

    action: Action
    """What is done; pushing and pulling by the force that gets the load going, or that which keeps it."""
    phase: str = ""
    """Title of one of ``[[phases]]``, whose load it is where none is given here."""
    load: Kilograms | None = None
    """Mass, or the force divided by 9.81 m/s² [kg]."""
    per_minute: Annotated[float, Meta(ge=0)] | None = None
    """How often, over 8 h."""
    reach: Meters | None = None
    """Greatest distance of the hands from the middle of the ankles, along the floor [m]; of a lift."""
    origin: Meters | None = None
    """Height of the hands where a lift begins [m]."""
    destination: Meters | None = None
    """Height of the hands where it ends [m]."""
    handles: Literal["good", "poor", "none"] | None = None
    """How well a load that is lifted or lowered can be held; ``poor`` means slippery ones, too."""
    height: Meters | None = None
    """Height of the hands while pushing, pulling or carrying [m]."""
    distance: Meters | None = None
    """How far it is pushed, pulled or carried each time [m]."""

    def missing(self) -> tuple[str, ...]:
        """What nobody entered."""
        needs = ("load", "per_minute", *NEEDS.get(self.action, ("height", "distance")))
        return tuple(name for name in needs if getattr(self, name) is None)


class Acceptable(NamedTuple):
    """What an equation says of one action for one sex."""

    load: float
    """Acceptable to half of them [kg]; 0 where the equation ends."""
    variation: float
    """Standard deviation over that."""
    outside: str
    """Why the equation does not speak of it, empty where it does."""
    caution: str
    """What it does not know of it, likewise."""


def acceptable(task: Handling, sex: Sex) -> Acceptable:
    """Load that half of the women or men find acceptable for an action of which nothing is missing.

    What lies on the easier side of a range counts as its end; on the harder side the equation ends.
    """
    table, ranges = published("manual_handling"), published("manual_handling")["ranges"][sex]
    row = table[task.action][sex]
    per_minute = max(float(number("per_minute", _known(task.per_minute), 0.0)), RAREST)
    load = row["reference"] * _factor(row["frequency"], math.log(per_minute))
    outside: list[str] = []
    manner: str

    def ends(what: str, value: float, low: float, high: float, unit: str = "m") -> None:
        if not low <= value <= high:
            outside.append(f"{what} of {value:.3g} {unit}, and not of {low:g} to {high:g} {unit}")

    if task.action in NEEDS:
        first, last = _known(task.origin), _known(task.destination)
        reach, way = max(_known(task.reach), ranges["reach"][0]), abs(last - first)
        ends("a reach", reach, *ranges["reach"])
        ends("hands at a height", max(first, last), 0.0, ranges["arm"])
        ends("a frequency", per_minute, 0.0, 20.0, "per minute")
        load *= _factor(row["reach"], reach) * _factor(row["middle"], (first + last) / 2)
        load *= _factor(row["travel"], math.log(max(way, 0.25)))
        load *= table["coupling"][cast("str", task.handles)]
        manner = task.action
    else:
        height, way = _known(task.height), _known(task.distance)
        carried = task.action == "carry"
        far = max(way, 2.1)
        ends("hands at a height", height, *ranges["carry_height" if carried else "push_height"])
        ends("a distance", far, 2.1, 10.0 if carried else 61.0)
        ends("a frequency", per_minute, 0.0, 10.0, "per minute")
        load *= _factor(row["height"], height)
        load *= (
            _factor(row["distance_ln"], math.log(far))
            if "distance_ln" in row
            else _factor(row["distance"], far)
        )
        manner = "carry" if carried else "push"
    speed = way * per_minute
    ends("a mean speed", speed, 0.0, FASTEST.get(manner, 37.0), "m/min")
    careful = CAUTION[sex][manner]
    caution = f"a mean speed of {speed:.3g} m/min is beyond {careful:g}, from where on endurance may decide"
    return Acceptable(
        max(load, 0.0), row["variation"], "; ".join(outside), caution if speed > careful else ""
    )


def share_of(load: float, half: float, variation: float) -> float:
    """Share of people to whom a load is acceptable, 0 to 1.

    Args:
        load: [kg]
        half: Acceptable to half of them [kg].
        variation: Standard deviation over that.
    """
    number("load", load, 0.0, unit="kg")
    number("half", half, 0.0, unit="kg")
    number("variation", variation, 1e-9)
    if half == 0:
        return 1.0 if load == 0 else 0.0
    return 0.5 * math.erfc((load - half) / (variation * half) / math.sqrt(2))


def _factor(terms: list[float], x: float) -> float:
    """A scale factor from its constant and divisors, at most 1, as the paper normalised them."""
    constant, linear, square = terms
    found = constant + (x / linear if linear else 0.0) + (x * x / square if square else 0.0)
    return min(max(found, 0.0), 1.0)


def _known(value: float | None) -> float:
    assert value is not None
    return value


class ManualHandling(EnteredMethod, frozen=True, kw_only=True):
    """Share of people who find a load acceptable: LM-MMH equations (2021), after Snook and Ciriello."""

    unit: ClassVar[str] = "%"
    at_most: ClassVar[bool] = False
    tasks: tuple[Handling, ...]
    """What is lifted, lowered, pushed, pulled and carried; the worst counts."""
    population: Literal["female", "male", "both"]
    """Of whom the share is; the authors design for 75 % of women."""
    exclusions: tuple[Exclusion, ...]
    """What of this is the case; the equations then do not apply. An empty list says that nothing is."""
    limit: Annotated[float, Meta(gt=0, lt=100, extra={"unit": "%"})] | None = None
    """Least admissible share [%]; the authors name 75 % of women."""

    @property
    def levels(self) -> tuple[Level, ...]:
        """Below the share that the authors name."""
        return (Level(up_to=75, name="up to 75 %"),)

    def figure(self, model: Model) -> Figure:
        """The share of what is entered.

        Raises:
            InputError: The equations do not apply.
        """
        tasks = self.entered(model)
        problems = [
            Problem(
                self.name,
                "exclusions",
                f"the LM-MMH equations do not apply: {what.replace('_', ' ')}",
                "use another method for this work",
            )
            for what in self.exclusions
        ]
        if not tasks:
            problems.append(Problem(self.name, "tasks", "there is none", "describe at least one"))
        if problems:
            raise InputError(problems)
        return self._figure(tasks)

    def entered(self, model: Model) -> tuple[Handling, ...]:
        """The tasks with the loads of the phases that they name.

        Raises:
            UnknownName: A task names a phase that does not exist.
        """
        phases = self.titled_phases(model)
        for task in self.tasks:
            if task.phase and task.phase not in phases:
                raise UnknownName("phase", task.phase, phases)
        return tuple(
            structs.replace(task, load=phases[task.phase].load) if task.phase and task.load is None else task
            for task in self.tasks
        )

    def _figure(self, tasks: tuple[Handling, ...]) -> Figure:
        absent = [f"{what} of task {i + 1}" for i, task in enumerate(tasks) for what in task.missing()]
        if absent:
            said = Shown(f"not entered: {', '.join(absent)}")
            return Figure(None, self.limit, undecided=True, beside=said)
        sexes: tuple[Sex, ...] = ("female", "male") if self.population == "both" else (self.population,)
        parts, worst, doubts, reason = [], 100.0, False, ""
        for i, task in enumerate(tasks):
            for sex in sexes:
                found = acceptable(task, sex)
                share = 100 * share_of(_known(task.load), found.load, found.variation)
                doubtful = found.outside or found.caution
                own = Figure(
                    None if found.outside else share,
                    self.limit,
                    open=bool(found.caution),
                    undecided=bool(found.outside),
                )
                text = f"half of them find {found.load:.3g} kg acceptable"
                if doubtful:
                    text = (
                        f"the equations know nothing of {found.outside}" if found.outside else found.caution
                    )
                parts.append(
                    Result(
                        name=f"task {i + 1}, {task.action.replace('_', ' ')}, {sex}",
                        value=own.value if own.value is None else float(own.number),
                        unit=self.unit,
                        limit=self.limit,
                        at_most=False,
                        verdict=verdict_of(own, at_most=False),
                        reason=text,
                    )
                )
                if found.outside:
                    doubts, reason = True, reason or f"task {i + 1}, {sex}: {text}"
                    continue
                doubts = doubts or bool(found.caution)
                if share <= worst:
                    worst, reason = share, f"task {i + 1}, {task.action.replace('_', ' ')}, {sex}: {text}"
        unknown = all(part.value is None for part in parts)
        return Figure(
            None if unknown else worst,
            self.limit,
            open=doubts,
            beside=Shown(reason, parts=tuple(parts)),
        )

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        found = [
            Input(name="population", value=self.population, origin=Origin.GIVEN, source="workstation file")
        ]
        for i, task in enumerate(self.entered(model)):
            for name in ("load", "per_minute", *NEEDS.get(task.action, ("height", "distance"))):
                value = getattr(task, name)
                what = f"{name.replace('_', ' ')} of task {i + 1}"
                unit = {"load": "kg", "per_minute": "1/min", "handles": ""}.get(name, "m")
                if value is None:
                    found.append(Input(name=what, origin=Origin.MISSING, source="not entered"))
                elif isinstance(value, str):
                    found.append(
                        Input(name=what, value=value, origin=Origin.GIVEN, source="workstation file")
                    )
                else:
                    found.append(given(what, float(value), unit))
        return Basis(
            formula="share of a normal distribution with the mean MAL = RL · scale factors and the standard "
            "deviation CV · MAL that is at the load or above",
            source="Potvin, Ciriello, Snook, Maynard, Brogmus, Ergonomics 64(8), 2021, 955-970 (two public "
            "transcriptions that agree, 2+); they replace the tables of Snook and Ciriello 1991",
            inputs=(*found, *limit(self.limit, "%")),
            not_modelled=(
                "the twin's motion: heights, distances and frequencies are those of the workstation file",
                "several tasks done in turn: the worst on its own counts",
                "endurance and loads of the back, by which the authors ask for caution at high speeds",
                "scale factors are at most 1, a choice of 0.5 % at most",
            ),
        )
