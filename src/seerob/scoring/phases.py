"""What no posture shows, given for each phase of the task: load, grip, support, repetition."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Literal, TypeVar

import numpy as np
from msgspec import Meta, Struct

from seerob.scoring.spans import Span, between, exactly

Kilograms = Annotated[float, Meta(ge=0, extra={"unit": "kg"}, extra_json_schema={"x-unit": "kg"})]
Seconds = Annotated[float, Meta(ge=0, extra={"unit": "s"}, extra_json_schema={"x-unit": "s"})]
Sides = Literal["none", "left", "right", "both"]


class Phase(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of the phases of a rule; what a phase leaves out is not assessed."""

    start: Seconds = 0.0
    """When the phase begins [s]; it lasts until the next one."""


P = TypeVar("P", bound=Phase)


def check_order(phases: Sequence[Phase]) -> None:
    """Refuse phases that do not follow each other.

    Raises:
        ValueError: A phase does not begin after the one before.
    """
    for before, after in pairwise(phases):
        if after.start <= before.start:
            raise ValueError(
                f"phases: one that starts at {after.start:g} s follows one at {before.start:g} s; "
                "let each start after the one before"
            )


def phase_at(phases: Sequence[P], t: float, unknown: P) -> P:
    """The phase of an instant [s]; ``unknown`` before the first."""
    return next((phase for phase in reversed(phases) if phase.start <= t + 1e-9), unknown)


def on_sides(sides: Sides | None) -> Span:
    """1 on the named sides, shape (2,) for right and left; 0 or 1 when nobody said."""
    if sides is None:
        return between(np.zeros(2), np.ones(2))
    return exactly([sides in (side, "both") for side in ("right", "left")])
