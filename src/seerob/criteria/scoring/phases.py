"""From the phases that every rule shares to those of one rule, and what they say of both sides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from seerob.core.errors import InputError
from seerob.criteria.scoring.spans import Span, between, exactly
from seerob.model.model import Model
from seerob.workstation.tables.task_phase import (
    Kilograms,
    Period,
    Phase,
    Seconds,
    Sides,
    Stance,
    TaskPhase,
    check_order,
    phase_at,
)

__all__ = [
    "Kilograms",
    "Period",
    "Phase",
    "Seconds",
    "Sides",
    "Stance",
    "TaskPhase",
    "check_order",
    "on_sides",
    "phase_at",
    "shared_phases",
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


def on_sides(sides: Sides | None) -> Span:
    """1 on the named sides, shape (2,) for right and left; 0 or 1 when nobody said."""
    if sides is None:
        return between(np.zeros(2), np.ones(2))
    return exactly([sides in (side, "both") for side in ("right", "left")])
