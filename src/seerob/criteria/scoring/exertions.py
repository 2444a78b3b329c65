"""Exertions of the hands as the phases of a cycle enter them: how hard, how often, how long.

How hard somebody grips no posture shows, and how many exertions a phase has nobody counts: both are asked.
What follows from them, exertions per minute and the share of time, is computed from the cycle.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

from msgspec import Struct

from seerob.core.errors import InputError
from seerob.core.snapshot import Input, Origin
from seerob.criteria.scoring.phases import Borg, Phase, Seconds, Wrist, shared_phases
from seerob.description.humans.skeleton import SIDES
from seerob.model.model import Model
from seerob.model.provenance import given
from seerob.workstation.tables.task_phase import ROUNDING

GIVE = {
    "exertion": "the force of the hand on Borg's CR-10 scale",
    "exertions": "how many there are in the phase",
    "exertion_time": "how long one lasts",
}
"""What is asked of a phase in which hands exert themselves, and what to give."""


class ExertionPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the hands do in a phase; what is left out is not known."""

    hand: Literal["left", "right", "both"] = "both"
    """Which hand exerts itself."""
    exertion: Borg | None = None
    """Greatest force of a hand, on Borg's CR-10 scale; 0 for none."""
    exertions: float | None = None
    """Exertions of a hand in the phase."""
    exertion_time: Seconds | None = None
    """How long one of them lasts [s]."""
    wrist: Wrist | None = None
    """Wrist in the exertions, flexion above 0 [rad], where it is not that of the twin."""

    def missing(self) -> tuple[str, ...]:
        """Fields that nobody entered and that the exertions need."""
        if self.exertion == 0 or self.exertions == 0:
            return ()
        return tuple(name for name in GIVE if getattr(self, name) is None)


class Exertion(Struct, frozen=True):
    """Exertions of one phase that are alike."""

    phase: ExertionPhase
    force: float
    """On Borg's CR-10 scale."""
    per_minute: float
    """Averaged over the cycle."""
    time: float
    """Of one [s]."""
    wrist: float | None
    """Flexion [rad], where it was entered."""

    def of(self, side: int) -> bool:
        """Whether the right hand (0) or the left one (1) makes them."""
        return self.phase.hand in (SIDES[side], "both")


class HandWork(Struct, frozen=True):
    """What is known of the exertions of a cycle."""

    exertions: tuple[Exertion, ...]
    missing: tuple[str, ...]
    """What nobody entered, in words."""

    def of(self, side: int) -> tuple[Exertion, ...]:
        """The exertions of the right hand (0) or the left one (1)."""
        return tuple(each for each in self.exertions if each.of(side))

    def said(self) -> str:
        """What is missing, in one sentence."""
        return f"not entered: {', '.join(self.missing)}"


def hand_work(model: Model, human: str, name: str) -> tuple[tuple[ExertionPhase, ...], HandWork]:
    """Exertions of a person's hands by ``[[phases]]``, and those phases.

    Args:
        model: The compiled workstation.
        human: Whose hands.
        name: Of the rule, for the message.

    Raises:
        InputError: Exertions last longer than their phase.
    """
    phases = shared_phases(model, human, (), ExertionPhase.from_task)
    if not phases:
        return phases, HandWork((), ("the exertions of the hands in each of [[phases]]",))
    cycle = phases[0].cycle
    if cycle is None:
        return phases, HandWork((), ("the cycle of [[phases]] (exertions per minute rest on it)",))
    ends = [*(each.start for each in phases[1:]), cycle]
    ends = [end if each.end is None else each.end for each, end in zip(phases, ends, strict=True)]
    missing = [f"what is done from {a:g} to {b:g} s of the cycle" for a, b in _gaps(phases, ends, cycle)]
    found = []
    for phase, end in zip(phases, ends, strict=True):
        what = phase.title or f"the phase from {phase.start:g} s on"
        if absent := phase.missing():
            missing += [f"{field} of {what} ({GIVE[field]})" for field in absent]
            continue
        if not phase.exertion or not phase.exertions:
            continue
        assert phase.exertion_time is not None
        busy, length = phase.exertions * phase.exertion_time, end - phase.start
        if busy > length + ROUNDING:
            raise InputError.at(
                name,
                "phases",
                f"{phase.exertions:g} exertions of {phase.exertion_time:g} s in {what}, "
                f"which lasts {length:g} s",
                "give the time of one exertion, and how many a hand makes in the phase",
            )
        per_minute = 60.0 * phase.exertions / cycle
        found.append(Exertion(phase, phase.exertion, per_minute, phase.exertion_time, phase.wrist))
    return phases, HandWork(tuple(found), tuple(missing))


def _gaps(phases: Sequence[ExertionPhase], ends: Sequence[float], cycle: float) -> list[tuple[float, float]]:
    """Stretches of the cycle that no phase covers [s]."""
    edges = [(0.0, phases[0].start)]
    edges += [(end, after.start) for end, (_, after) in zip(ends, pairwise(phases), strict=False)]
    edges.append((ends[-1], cycle))
    return [(a, b) for a, b in edges if b - a > ROUNDING]


def exertion_inputs(phases: Sequence[ExertionPhase], *, wrist: bool) -> tuple[Input, ...]:
    """What was entered of the exertions, for a basis; what a phase without any does not need is left out.

    Args:
        phases: In their order.
        wrist: Whether the wrist is an input, too: the twin's where none was entered.
    """
    found = []
    for phase in phases:
        where = f", {phase.title or f'from {phase.start:g} s on'}"
        idle = phase.exertion == 0 or phase.exertions == 0
        for name in ("exertion", *(() if phase.exertion == 0 else ("exertions", "exertion_time"))):
            value = getattr(phase, name)
            if value is None and idle:
                continue
            unit = "s" if name == "exertion_time" else ""
            origin, said = (Origin.MISSING, "not entered") if value is None else (Origin.GIVEN, "[[phases]]")
            label = name.replace("_", " ") + where
            found.append(Input(name=label, value=value, unit=unit, origin=origin, source=said))
        if idle:
            continue
        found.append(Input(name=f"hand{where}", value=phase.hand, origin=Origin.GIVEN, source="[[phases]]"))
        if wrist and phase.wrist is None:
            twins = Input(name=f"wrist{where}", value="as it is", origin=Origin.COMPUTED, source="the twin")
            found.append(twins)
        elif wrist:
            found.append(given(f"wrist{where}", float(phase.wrist or 0.0), "rad"))
    return tuple(found)


def hours_input(hours: float | None) -> Input:
    """How long the task is done per day, for a basis."""
    origin, said = (Origin.MISSING, "not entered") if hours is None else (Origin.GIVEN, "workstation file")
    return Input(name="task per day", value=hours, unit="s", origin=origin, source=said)
