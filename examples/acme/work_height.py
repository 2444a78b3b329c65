"""Rule of a company: no part of a robot above eye height. One file, one class, one ``kind``."""

from __future__ import annotations

from typing import ClassVar

from seerob.api import Basis, Criterion, Evaluate, Falls, Model, Points, Result, State, approaching, judge


class WorkHeight(Criterion, frozen=True, kw_only=True):
    """Height of a robot's tool above the floor."""

    unit: ClassVar[str] = "m"

    at: str
    """A robot, or the full name of a link."""
    limit: float
    """Largest admissible height [m]."""

    def subjects(self) -> tuple[str, ...]:
        """What it speaks of."""
        return (self.at,)

    def bind(self, model: Model) -> Evaluate:
        """Look the name up once, and return the function that judges one instant."""
        frame = model.frame(self.at)  # a name that does not exist fails here, not in the loop

        def evaluate(state: State) -> Result:
            _, position = state.pose(frame)
            height = float(position[2])
            verdict = judge(height, self.limit)
            return Result(name=self.name, value=height, unit=self.unit, limit=self.limit, verdict=verdict)

        return evaluate

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound the change between two ticks: the height changes by no more than the point's way."""
        frame = model.frame(self.at)
        return approaching([points.add(frame.mj, frame.body_from_frame[:3, 3])], ())

    def basis(self, model: Model) -> Basis:
        """State formula and source."""
        return Basis(formula="z of the point", source="ACME works standard 12")
