"""Ergonomics rule of a company: nobody bends down for long. One file, one class, one ``kind``."""

from __future__ import annotations

from typing import ClassVar

from seerob.api import Basis, Criterion, Evaluate, Model, Result, State, Verdict, beyond, bind_posture, judge

BENT = 0.7
"""The trunk counts as bent beyond this [rad]."""


class Bending(Criterion, frozen=True, kw_only=True):
    """How long a person has been bending down without a break."""

    unit: ClassVar[str] = "s"

    human: str
    """Who is judged."""
    limit: float = 10.0
    """Longest admissible bend [s]."""

    def subjects(self) -> tuple[str, ...]:
        """Who it speaks of."""
        return (self.human,)

    def bind(self, model: Model) -> Evaluate:
        """Look the person up once, and return the function that judges one instant."""
        read = bind_posture(model, self.human)  # a name that does not exist fails here, not in the loop
        since: list[float] = []

        def evaluate(state: State) -> Result:
            bent = beyond(read(state).trunk_flexion, BENT, signed=True)
            if not bent.known:  # an angle that nobody measures is not assessed
                return Result(
                    name=self.name, limit=self.limit, verdict=Verdict.UNDECIDED, reason="trunk not measured"
                )
            # Only what was before an instant counts, so that a replay finds the same.
            if not bent.low or (since and state.t < since[0]):
                since.clear()
            if bent.low and not since:
                since.append(state.t)
            held = state.t - since[0] if since else 0.0
            return Result(
                name=self.name,
                value=held,
                unit=self.unit,
                limit=self.limit,
                verdict=judge(held, self.limit),
                reason="trunk bent forward" if since else "upright",
            )

        return evaluate

    def basis(self, model: Model) -> Basis:
        """State formula and source."""
        return Basis(formula="time since the trunk was bent beyond 0.7 rad", source="ACME works standard 9")
