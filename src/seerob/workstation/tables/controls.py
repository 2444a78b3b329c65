"""What hands pull and press in the twin, in the workstation file: levers, buttons, enabling switches."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Annotated

from msgspec import Meta

from seerob.core.quantities import Name, Table

SetTo = Annotated[float, Meta(ge=-1e6, le=1e6)]


class ControlKind(StrEnum):
    """What becomes of a control in a hand."""

    LEVER = "lever"
    """It stays where it was pulled, between ``lower`` and ``upper``."""
    SWITCH = "switch"
    """A press turns it over."""
    BUTTON = "button"
    """It is true while it is pressed."""
    ENABLING = "enabling"
    """It is true while it is held, and whoever holds it says so again and again: silence lets it go."""


class Control(Table, frozen=True, kw_only=True):
    """A lever, a button or an enabling switch that people pull: it sets a variable of the twin."""

    name: Name
    """Its name."""
    of: str
    """Part, machine or link that is pulled: a machine may follow the variable."""
    kind: ControlKind = ControlKind.BUTTON
    """What becomes of it in a hand."""
    sets: str
    """Variable of the dictionary that it sets, one of a source of kind ``room``."""
    lower: SetTo = 0.0
    """Of a lever: least value, in SI."""
    upper: SetTo = 1.0
    """Of a lever: greatest value, in SI."""
    start: SetTo = 0.0
    """Value before anybody pulls it, in SI; 0 and 1 of a bool."""

    def __post_init__(self) -> None:
        if self.kind is ControlKind.LEVER:
            if not self.lower < self.upper:
                raise ValueError(f"lower = {self.lower:g} is not below upper = {self.upper:g}")
            if not self.lower <= self.start <= self.upper:
                raise ValueError(f"start = {self.start:g} is not between {self.lower:g} and {self.upper:g}")
        elif (self.lower, self.upper) != (0.0, 1.0) or self.start not in (0.0, 1.0):
            raise ValueError(f"a {self.kind} is true or false: leave out lower and upper, start is 0 or 1")
        elif self.start and self.kind is not ControlKind.SWITCH:
            raise ValueError(f"a {self.kind} is false while nobody holds it: leave out start")

    @property
    def held(self) -> bool:
        """Whether it is let go when nobody holds it any more."""
        return self.kind in (ControlKind.BUTTON, ControlKind.ENABLING)

    def refusal(self, value: float) -> str:
        """Why it cannot be put to a value; empty where it can."""
        if self.kind is ControlKind.LEVER:
            # What is not a number is between no two.
            fits = math.isfinite(value) and self.lower <= value <= self.upper
            return "" if fits else f"{self.name}: {value:g} is not between {self.lower:g} and {self.upper:g}"
        return "" if value in (0.0, 1.0) else f"{self.name}: {value:g} is neither 0 nor 1"
