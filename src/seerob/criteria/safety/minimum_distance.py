"""Least distance between two sets of bodies, [Weistroffer2022]_ section 2.2.2.6."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.errors import InputError
from seerob.core.snapshot import Basis, Result, Segment
from seerob.core.tolerances import Tolerance, deciding
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.body_parts import BodyPlaces, partly_seen
from seerob.criteria.criterion import Criterion, Evaluate
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.plan import Draw, Rows, Together
from seerob.distance.least import Closests, DistanceKind, Per
from seerob.model import provenance
from seerob.model.model import Gap, Model
from seerob.twin.accuracy.distance_ends import DistanceEnds
from seerob.twin.accuracy.tracking_error import tracking
from seerob.twin.spans import Falls, Points, approaching
from seerob.twin.state import State

DEEPER = " (overlap, at least this deep)"


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
        """Return the function that judges one instant: of who is partly seen, what is seen first."""

        def bind(gap: Gap) -> Evaluate:
            return self.judging(self._distance(model, gap), self._line(model, gap))

        return partly_seen(model, self._gap(model), bind)

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the distance."""
        return self._distance(model, self._gap(model))

    def one_by_one(self, model: Model) -> str:
        """Many instants are computed together."""
        return ""

    def _distance(self, model: Model, gap: Gap) -> Compute:
        ends, either = DistanceEnds(model, gap), self.uncertainty

        def compute(twin: Twin) -> Figure:
            closest = twin.closest(gap, allow_estimated=True, strayed=True)
            low, high = ends.of_sets(twin, closest.distance)
            # Crossing shapes are deeper than the figure says: never within, not even of 0.
            crossing = closest.kind == DistanceKind.DEPTH_AT_LEAST
            interval = low - gap.deviation - either, high + either
            return Figure(closest.distance, self.limit, interval, exceeded=crossing, beside=closest)

        return compute

    def _line(self, model: Model, gap: Gap) -> Present:
        places, ends = BodyPlaces(model), DistanceEnds(model, gap)

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            closest, open_ = figure.beside, ""
            distance = closest.distance
            if verdict is Verdict.UNDECIDED:
                low, high = ends.of_sets(state, distance)
                open_ = f"; {_deciding(self.uncertainty, float(high - low) / 2, gap)}"
            a_named = places.named(state, closest.body_a, closest.point_a)
            b_named = places.named(state, closest.body_b, closest.point_b)
            deeper = DEEPER if closest.kind == DistanceKind.DEPTH_AT_LEAST else ""
            draw = partial(_segment, self, closest.point_a, closest.point_b, distance, verdict)
            return Shown(f"{a_named} ↔ {b_named}{deeper}{open_}", draw)

        return present

    def planned(self, model: Model) -> Callable[[Sequence[Any], Model], Together] | None:
        """Return what computes least distances together."""
        return _Distances

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


_DEEP = int(DistanceKind.DEPTH_AT_LEAST)
"""To compare numbers with an enumeration takes longer than all the rest of their judgement."""


class _Distances:
    """Least distances of pairs of sets at one instant, of a tick's plan."""

    intervals = True

    def __init__(self, criteria: Sequence[MinimumDistance], model: Model) -> None:
        gaps = [each._gap(model) for each in criteria]
        self._criteria, self._places = criteria, BodyPlaces(model)
        self._asked = tuple((gap.query, Per.SETS) for gap in gaps)
        self._nearer = np.array([gap.deviation for gap in gaps])
        self._either = np.array([each.uncertainty for each in criteria])
        self._found: Closests | None = None
        self._rows: list[int] = []

    def compute(self, state: State, rows: Rows) -> None:
        """Write every distance, and how much nearer and farther it may be."""
        self._found, self._rows = found, at = state.nearest(self._asked)
        value, low, high, exceeded = rows
        value[:] = found.distance[at]
        np.subtract(value, self._nearer, out=low)
        np.subtract(low, self._either, out=low)
        np.add(value, self._either, out=high)
        np.equal(found.kind[at], _DEEP, out=exceeded)

    def present(
        self, state: State, k: int, value: float, verdict: Verdict | None
    ) -> tuple[str, Draw, tuple[Result, ...]]:
        """Say and draw what `MinimumDistance.present` does of one that is decided."""
        found, row, named = self._found, self._rows[k], self._places.named
        assert found is not None
        a, b = found.point_a[row], found.point_b[row]
        deeper = DEEPER if found.kind.item(row) == _DEEP else ""
        where = (
            f"{named(state, found.body_a.item(row), a)} ↔ {named(state, found.body_b.item(row), b)}{deeper}"
        )
        return where, partial(_segment, self._criteria[k], a, b, value, verdict), ()


def _segment(
    of: MinimumDistance, a: Array, b: Array, distance: float, verdict: Verdict | None
) -> tuple[Segment, ...]:
    label = figures.worded(distance, of.limit, of.unit, at_most=False)
    return (Segment(start=tuple(a.tolist()), end=tuple(b.tolist()), label=label, verdict=verdict),)
