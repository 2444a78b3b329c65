"""Rule of a company: a tool keeps its distance from the floor. A limit from below."""

from __future__ import annotations

from typing import ClassVar

from seerob.api import Basis, Compute, Criterion, Falls, Figure, Model, Points, approaching


class ToolClearance(Criterion, frozen=True, kw_only=True):
    """Height of a robot's tool above the floor, which it may not fall below."""

    unit: ClassVar[str] = "m"
    at_most: ClassVar[bool] = False  # the page draws the limit below, and the smallest value is the worst

    at: str
    """A robot, or the full name of a link."""
    limit: float
    """Least admissible height [m]."""

    def subjects(self) -> tuple[str, ...]:
        """Name whom it speaks of."""
        return (self.at,)

    def compute(self, model: Model) -> Compute:
        """Look the name up once, and return the function that computes the height."""
        frame = model.frame(self.at)
        return lambda twin: Figure(twin.pose(frame)[1][..., 2], self.limit)

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound the change between two ticks by the point's way."""
        frame = model.frame(self.at)
        return approaching([points.add(frame.mj, frame.body_from_frame[:3, 3])], ())

    def basis(self, model: Model) -> Basis:
        """State formula and source."""
        return Basis(formula="z of the point", source="ACME works standard 12")
