"""Least distance between two sets of bodies, [Weistroffer2022]_ section 2.2.2.6."""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Meta

from seerob import provenance
from seerob.criterion import Criterion, Evaluate, judge_interval
from seerob.distance import Reach
from seerob.errors import InputError
from seerob.model import Model
from seerob.snapshot import Basis, Result, Segment, Verdict
from seerob.state import State


class MinimumDistance(Criterion, frozen=True, kw_only=True):
    """Least distance between two sets of bodies, exact on their non-convex shapes."""

    unit: ClassVar[str] = "m"
    at_most: ClassVar[bool] = False

    between: tuple[str, str]
    """Two names: robots, humans, tools, parts or links; wildcards allowed."""
    limit: Annotated[float, Meta(ge=0, extra={"unit": "m"})] | None = None
    """Least admissible distance [m]."""

    def subjects(self) -> tuple[str, ...]:
        """The two sets."""
        return self.between

    def bind(self, model: Model) -> Evaluate:
        """See `Criterion.bind`."""
        a, b = (model.select(name) for name in self.between)
        if set(a) & set(b):
            shared = model.bodies[min(set(a) & set(b))].name
            raise InputError.at(
                self.name, "between", f"{shared} is in both sets", "name two sets that share nothing"
            )
        gap = model.gap(a, b)

        def evaluate(state: State) -> Result:
            closest = state.closest(gap)
            distance = closest.distance
            interval = (distance - gap.deviation, distance)
            verdict = judge_interval(interval, self.limit, at_most=False)
            if closest.reach == Reach.DEPTH_AT_LEAST and self.limit is not None:
                # Crossing shapes are deeper than the figure says: never within, not even of 0.
                verdict = Verdict.EXCEEDED
            names = model.bodies[closest.body_a].name, model.bodies[closest.body_b].name
            deeper = " (overlap, at least this deep)" if closest.reach == Reach.DEPTH_AT_LEAST else ""
            segment = Segment(
                start=tuple(closest.point_a.tolist()),
                end=tuple(closest.point_b.tolist()),
                label=f"{distance * 1e3:.0f} mm",
                verdict=verdict,
            )
            return Result(
                name=self.name,
                value=distance,
                unit=self.unit,
                limit=self.limit,
                at_most=False,
                verdict=verdict,
                reason=f"{names[0]} ↔ {names[1]}{deeper}",
                interval=interval if gap.deviation > 0 else None,
                markers=(segment,),
            )

        return evaluate

    def basis(self, model: Model) -> Basis:
        """See `Criterion.basis`."""
        gap = model.gap(*(model.select(name) for name in self.between))
        return Basis(
            formula="least distance of the two sets' surfaces; negative when they overlap",
            source="Weistroffer et al. 2022, section 2.2.2.6",
            inputs=provenance.motion(model, *gap.carriers)
            + provenance.shapes(gap)
            + provenance.limit(self.limit, "m"),
            not_modelled=("clothing, hair, cables and hoses that are not in the model",),
        )
