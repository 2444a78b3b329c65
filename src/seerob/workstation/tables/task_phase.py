"""What no posture shows, given for each phase of the task: load, grip, support, repetition.

A rule has phases of its own, or reads those of ``[[phases]]``, which every rule about the person shares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Literal, Self, TypeVar

from msgspec import Meta, Struct
from msgspec.structs import fields

Kilograms = Annotated[float, Meta(ge=0, extra={"unit": "kg"}, extra_json_schema={"x-unit": "kg"})]
Seconds = Annotated[float, Meta(ge=0, extra={"unit": "s"}, extra_json_schema={"x-unit": "s"})]
Period = Annotated[float, Meta(gt=0, extra={"unit": "s"}, extra_json_schema={"x-unit": "s"})]
Borg = Annotated[float, Meta(ge=0, le=10)]
Wrist = Annotated[
    float, Meta(ge=-math.pi / 2, le=math.pi / 2, extra={"unit": "rad"}, extra_json_schema={"x-unit": "rad"})
]
Sides = Literal["none", "left", "right", "both"]
Stance = Literal[
    "sitting",
    "standing",
    "one_leg",
    "both_knees_bent",
    "one_knee_bent",
    "kneeling",
    "walking",
    "lying",
    "climbing",
    "posture",
]
ROUNDING = 1e-9
"""By so much a phase may seem to begin later than an instant that it has [s]."""


class Phase(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of the phases of a rule; what a phase leaves out is not assessed.

    Raises:
        ValueError: It ends before it begins, or lies outside its cycle; also of a phase that no rule reads.
    """

    title: str = ""
    """What the phase is called in reports."""
    start: Seconds = 0.0
    """When the phase begins [s], in run time, or in the time of the cycle."""
    end: Seconds | None = None
    """When it ends [s]; with the next phase when not given. Between phases nothing is entered."""
    cycle: Period | None = None
    """Length of a cycle that repeats from the begin of the run on [s]; the same for all phases."""

    def __post_init__(self) -> None:
        if self.end is not None and self.end <= self.start:
            raise ValueError(
                f"phases: one ends at {self.end:g} s, not after its start at {self.start:g} s; "
                "let it end later"
            )
        last = self.start if self.end is None else self.end
        if self.cycle is not None and (last > self.cycle + ROUNDING or self.start >= self.cycle):
            raise ValueError(f"phases: one reaches to {last:g} s, beyond its cycle of {self.cycle:g} s")

    @classmethod
    def from_task(cls, task: TaskPhase) -> Self:
        """What a rule takes from a phase that all rules share: every field that has the same name.

        Raises:
            TypeError: A field says something by default that no shared phase has and ``read`` does not give.
        """
        same = {name: getattr(task, name) for name in cls.__struct_fields__ if hasattr(task, name)}
        given = {**same, **cls.read(task)}
        for field in fields(cls):
            if field.name not in given and field.default is not None:
                raise TypeError(
                    f"[[phases]] has no {field.name}, which {cls.__name__} would take for {field.default!r}: "
                    "name it as there, give it in read, or let its default be None"
                )
        return cls(**given)

    @classmethod
    def read(cls, task: TaskPhase) -> Mapping[str, object]:
        """Fields that a rule takes in words of its own, by name."""
        return {}


class TaskPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is handled and how, in one phase of the work; every rule about the person reads what it needs."""

    human: str = ""
    """Whose work it is; everybody's when not given."""
    load: Kilograms | None = None
    """Handled mass, or a force divided by 9.81 m/s² [kg]; 0 for none."""
    load_use: Literal["intermittent", "static", "repeated", "shock"] | None = None
    """How the load acts; not needed for a load of 0."""
    hand: Literal["left", "right", "both"] = "both"
    """Which arm carries the load, and makes the exertions."""
    coupling: Literal["good", "fair", "poor", "unacceptable"] | None = None
    """How well the load can be held."""
    supported_arms: Sides | None = None
    """Arms whose weight is supported, or on which the person leans."""
    back_supported: bool | None = None
    """The trunk is well supported."""
    legs: Stance | None = None
    """How the legs are used; ``posture`` estimates it for somebody who stands or kneels."""
    balanced: bool | None = None
    """Legs and feet are well supported and evenly loaded, for RULA."""
    muscle_arms: bool | None = None
    """Posture of the arms mainly static, or repeated 4 times per minute or more."""
    muscle_body: bool | None = None
    """Posture of neck, trunk and legs mainly static, or repeated 4 times per minute or more."""
    static: bool | None = None
    """One or more parts of the body held longer than 1 min."""
    repeated: bool | None = None
    """Small movements repeated more than 4 times per minute."""
    rapid: bool | None = None
    """Rapid large changes of posture, or an unstable base."""
    exertion: Borg | None = None
    """Greatest force of a hand in the phase, on Borg's CR-10 scale, or a tenth of its strength in percent; 0
    for none."""
    exertions: Annotated[float, Meta(ge=0)] | None = None
    """Exertions of a hand in the phase."""
    exertion_time: Seconds | None = None
    """How long one of them lasts [s]."""
    wrist: Wrist | None = None
    """Wrist in the exertions, flexion above 0 and extension below [rad], instead of the twin's."""


P = TypeVar("P", bound=Phase)


def check_order(phases: Sequence[Phase]) -> None:
    """Refuse phases that do not follow each other.

    Raises:
        ValueError: A phase does not begin after the one before or overlaps the next one, or their cycles
            differ.
    """
    for before, after in pairwise(phases):
        if after.start <= before.start:
            raise ValueError(
                f"phases: one that starts at {after.start:g} s follows one at {before.start:g} s; "
                "let each start after the one before"
            )
        if before.end is not None and before.end > after.start + ROUNDING:
            raise ValueError(
                f"phases: one that ends at {before.end:g} s overlaps the next, from {after.start:g} s on; "
                "let it end before"
            )
    if len({phase.cycle for phase in phases}) > 1:
        raise ValueError("phases: they have different cycles; give all of them the same, or none")


def phase_at(phases: Sequence[P], t: float, unknown: P) -> P:
    """The phase of an instant of the run [s]; ``unknown`` where nothing is entered."""
    if not phases:
        return unknown
    cycle = phases[0].cycle
    at = t + ROUNDING if cycle is None else (t + ROUNDING) % cycle
    found = next((phase for phase in reversed(phases) if phase.start <= at), unknown)
    return unknown if found.end is not None and at >= found.end else found
