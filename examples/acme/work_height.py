"""Rule of a company: no part of a robot above eye height. One file, one class, one ``kind``."""

from __future__ import annotations

from typing import ClassVar

from seerob.api import Basis, Compute, Criterion, Falls, Figure, Model, Points, approaching


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

    def compute(self, model: Model) -> Compute:
        """Look the name up once, and return the function that computes the height."""
        frame = model.frame(self.at)  # a name that does not exist fails here, not in the loop
        return lambda twin: Figure(twin.pose(frame)[1][..., 2], self.limit)

    def one_by_one(self, model: Model) -> str:
        """Many instants are computed together: of these the heights have one dimension more."""
        return ""

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound the change between two ticks: the height changes by no more than the point's way."""
        frame = model.frame(self.at)
        return approaching([points.add(frame.mj, frame.body_from_frame[:3, 3])], ())

    def basis(self, model: Model) -> Basis:
        """State formula and source."""
        return Basis(formula="z of the point", source="ACME works standard 12")
