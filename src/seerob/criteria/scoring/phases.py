"""From the phases that every rule shares to those of one rule, and what they say of both sides."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.criteria.scoring.spans import Span, between, exactly
from seerob.model.model import Model
from seerob.recording.answers import Flags
from seerob.workstation.tables.task_phase import (
    ROUNDING,
    Borg,
    Kilograms,
    Period,
    Phase,
    Seconds,
    Sides,
    Stance,
    TaskPhase,
    Wrist,
    check_order,
    phase_at,
)

__all__ = [
    "Borg",
    "Kilograms",
    "Period",
    "Phase",
    "Seconds",
    "Sides",
    "Stance",
    "TaskPhase",
    "Wrist",
    "check_order",
    "entered_for",
    "on_sides",
    "phase_at",
    "phases_of",
    "shared_phases",
    "turns",
]

P = TypeVar("P", bound=Phase)


def shared_phases(
    model: Model, human: str, own: Sequence[P], read: Callable[[TaskPhase], P]
) -> tuple[P, ...]:
    """Phases of a rule: its own, or else those of ``[[phases]]`` that are of this person.

    Args:
        model: The compiled workstation.
        human: Who is judged.
        own: Phases in the rule's table; when there are any, the shared ones are not read.
        read: What the rule takes from a shared phase.

    Raises:
        UnknownName: A shared phase is of somebody who does not exist.
        InputError: The shared phases of the person do not follow each other.
    """
    if own:
        return tuple(own)
    shared = model.workstation.phases
    for phase in shared:
        if phase.human:
            model.human(phase.human)
    mine = [phase for phase in shared if phase.human in ("", human)]
    try:
        check_order(mine)
    except ValueError as error:
        file = next(iter(model.workstation.files), "workstation")
        raise InputError.at(file, "phases", f"of {human}: {error}") from error
    return tuple(map(read, mine))


def entered_for(model: Model, criterion: object) -> tuple[Phase, ...]:
    """Phases by which a criterion judges: its own, or the shared ones of its person; none of one without."""
    own = getattr(criterion, "phases", None)
    if own is None:
        return ()
    return shared_phases(model, getattr(criterion, "human", ""), own, lambda phase: phase)


def turns(phases: Sequence[Phase]) -> Callable[[float, float], Sequence[float]]:
    """Resolve when what is entered changes.

    Args:
        phases: In their order, of one cycle if any.

    Returns:
        From two instants of the run [s] to when it changes after the first one, up to the second [s]: of
        three changes or more the first ones.
    """
    cycle = phases[0].cycle if phases else None
    edges: list[float] = []
    for given in sorted(each for p in phases for each in (p.start, p.end) if each is not None):
        # The end of a cycle is the beginning of the next.
        edge = 0.0 if cycle is not None and given >= cycle - ROUNDING else given
        if all(abs(edge - known) > ROUNDING for known in edges):
            edges.append(edge)
    if cycle is not None and phases[-1].end is None and 0.0 not in edges:
        edges.append(0.0)  # the last phase ends with its cycle
    edges.sort()

    def between(before: float, now: float) -> list[float]:
        first, last = before + ROUNDING, now + ROUNDING
        if cycle is None:
            return edges[bisect_right(edges, first) : bisect_right(edges, last)][:3]
        k = max(math.floor(first / cycle), 0)
        every = [edge + i * cycle for i in range(k, k + 3) for edge in edges]
        return [edge for edge in every if first < edge <= last][:3]

    return between


def phases_of(phases: Sequence[P], t: Array, unknown: P) -> list[tuple[P, Flags]]:
    """Each phase that is entered at some of N instants [s], and which these are, shape (N,).

    Args:
        phases: In their order.
        t: Instants [s], shape (N,).
        unknown: The phase of instants that belong to none.
    """
    if not phases:
        return [(unknown, np.ones(len(t), bool))]
    every = [phase_at(phases, instant, unknown) for instant in t.tolist()]
    found = {id(phase): phase for phase in every}
    return [(phase, np.array([one is phase for one in every])) for phase in found.values()]


def on_sides(sides: Sides | None) -> Span:
    """1 on the named sides, shape (2,) for right and left; 0 or 1 when nobody said."""
    if sides is None:
        return between(np.zeros(2), np.ones(2))
    return exactly([sides in (side, "both") for side in ("right", "left")])
