"""What the twin may write, in the workstation file: one bool of a machine per trigger."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from seerob.core.quantities import Table, unit
from seerob.core.verdict import Verdict


class When(StrEnum):
    """Which verdict of a criterion makes a trigger true."""

    EXCEEDED = "exceeded"
    NOT_WITHIN = "not_within"
    """Exceeded, or undecided."""

    def holds(self, verdict: Verdict | None) -> bool:
        """Whether a verdict is one of those; no verdict is none."""
        if self is When.EXCEEDED:
            return verdict is Verdict.EXCEEDED
        return verdict in (Verdict.EXCEEDED, Verdict.UNDECIDED)


class Trigger(Table, frozen=True, kw_only=True):
    """A bool that is written to a machine when a verdict comes or goes: a lamp, a log, never a protection."""

    variable: str
    """Variable of the dictionary, a bool with ``write = true``."""
    criterion: str
    """Name of the criterion whose verdict it follows."""
    when: When = When.EXCEEDED
    every: Annotated[float, unit("s", ge=0.1, le=3600)] = 0.5
    """Least time between two writings [s]; what changes faster is written as it is then."""
