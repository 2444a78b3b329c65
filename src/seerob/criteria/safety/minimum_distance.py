"""Least distance between two sets of bodies, [Weistroffer2022]_ section 2.2.2.6."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.errors import InputError
from seerob.core.markers import drawn
from seerob.core.snapshot import Basis, Result, Segment, Verdict
from seerob.core.tolerances import Tolerance, deciding
from seerob.criteria.criterion import Criterion, Evaluate, EvaluateMany, judge_interval
from seerob.criteria.partly_seen import partly_seen
from seerob.distance.least import DistanceKind
from seerob.model import provenance
from seerob.model.model import Gap, Model
from seerob.recording.answers import Answers
from seerob.twin.accuracy.distance_ends import DistanceEnds
from seerob.twin.accuracy.tracking_error import tracking
from seerob.twin.body_place import BodyPlaces
from seerob.twin.spans import Falls, Points, approaching
from seerob.twin.state import State
from seerob.twin.states import States


class MinimumDistance(Criterion, frozen=True, kw_only=True):
    """Least distance between two sets of bodies, exact on their non-convex shapes."""

    unit: ClassVar[str] = "m"
    whole: ClassVar[bool] = False
    at_most: ClassVar[bool] = False

    between: tuple[str, str]
    """Two names: robots, humans, tools, parts or links; wildcards allowed."""
    limit: Annotated[float, Meta(ge=0, extra={"unit": "m"})] | None = None
    """Least admissible distance [m]."""
    uncertainty: Annotated[float, Meta(ge=0, extra={"unit": "m"})] = 0.0
    """How much nearer or farther the two may be: bases, mounting, devices that see people [m]."""

    def subjects(self) -> tuple[str, ...]:
        """The two sets."""
        return self.between

    def _gap(self, model: Model) -> Gap:
        a, b = (model.select(name) for name in self.between)
        if set(a) & set(b):
            shared = model.bodies[min(set(a) & set(b))].name
            raise InputError.at(
                self.name, "between", f"{shared} is in both sets", "name two sets that share nothing"
            )
        return model.gap(a, b)

    def bind(self, model: Model) -> Evaluate:
        """Look up every name in the model once and return the function that judges one instant."""
        return partly_seen(model, self._gap(model), lambda gap: self._bound(model, gap))

    def _bound(self, model: Model, gap: Gap) -> Evaluate:
        places = BodyPlaces(model)
        ends = DistanceEnds(model, gap)

        def evaluate(state: State) -> Result:
            closest = state.closest(gap, allow_estimated=True, strayed=True)
            distance = closest.distance
            low, high = ends.of_sets(state, distance)
            seen = (high - low) / 2
            interval = (low - gap.deviation - self.uncertainty, high + self.uncertainty)
            verdict = judge_interval(interval, self.limit, at_most=False)
            open_ = f"; {_deciding(self.uncertainty, seen, gap)}" if verdict is Verdict.UNDECIDED else ""
            if closest.kind == DistanceKind.DEPTH_AT_LEAST and self.limit is not None:
                # Crossing shapes are deeper than the figure says: never within, not even of 0.
                verdict = Verdict.EXCEEDED
            a_named = places.named(state, closest.body_a, closest.point_a)
            b_named = places.named(state, closest.body_b, closest.point_b)
            deeper = " (overlap, at least this deep)" if closest.kind == DistanceKind.DEPTH_AT_LEAST else ""

            def draw() -> tuple[Segment, ...]:
                start, end = tuple(closest.point_a.tolist()), tuple(closest.point_b.tolist())
                label = figures.worded(distance, self.limit, self.unit, at_most=False)
                return (Segment(start=start, end=end, label=label, verdict=verdict),)

            return Result(
                name=self.name,
                value=distance,
                unit=self.unit,
                limit=self.limit,
                at_most=False,
                verdict=verdict,
                reason=f"{a_named} ↔ {b_named}{deeper}{open_}",
                interval=interval if interval[0] < interval[1] else None,
                markers=drawn(draw),
            )

        return evaluate

    def batch(self, model: Model) -> EvaluateMany:
        """Return the function that judges many instants at once, or None where there is none."""
        gap, either = self._gap(model), self.uncertainty

        def evaluate(states: States) -> Answers:
            closest = states.closest(gap)
            low, high = closest.distance - gap.deviation - either, closest.distance + either
            found = Answers.against(closest.distance, self.limit, at_most=False)
            if gap.deviation + either > 0:
                found = found.between(low, high, at_most=False)
            crossing = closest.kind == DistanceKind.DEPTH_AT_LEAST
            return found if self.limit is None else found.exceeded(crossing)

        return evaluate

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound how much nearer the two sets can come between two instants at which this is asked."""
        gap = self._gap(model)
        return approaching(gap.a, gap.b)

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        gap = model.gap(*(model.select(name) for name in self.between))
        return Basis(
            formula="least distance of the two sets' surfaces; negative when they overlap",
            source="Weistroffer et al. 2022, section 2.2.2.6",
            inputs=provenance.motion(model, *gap.carriers)
            + provenance.shapes(gap)
            + (provenance.given("uncertainty", self.uncertainty, "m"),) * (self.uncertainty > 0)
            + provenance.limit(self.limit, "m"),
            not_modelled=("clothing, hair, cables and hoses that are not in the model",),
        )


def _deciding(uncertainty: float, seen: float, gap: Gap) -> str:
    inputs = (
        Tolerance("uncertainty", uncertainty, "m"),
        tracking(seen),
        # One-sided: the real surface is never farther than the shape.
        Tolerance("surfaces that may stick out", gap.deviation / 2, "m"),
    )
    return deciding(inputs, np.array([tolerance.half for tolerance in inputs]))
