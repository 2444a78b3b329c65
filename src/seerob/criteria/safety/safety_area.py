"""Intrusion into safety areas, [Weistroffer2022]_ section 2.2.2.7."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Annotated, Any, ClassVar, cast

import numpy as np
from msgspec import Meta, Struct

from seerob.core import figures
from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Basis, Highlight, Marker, Result, Segment
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING, Verdict
from seerob.criteria.body_parts import seen_first
from seerob.criteria.criterion import NOTHING_SHOWN, Criterion, Evaluate
from seerob.criteria.figure import Compute, Figure, Parts, Present, Shown, Twin, result_of, verdict_of
from seerob.criteria.plan import Whole
from seerob.distance.depth import Depth, Depths
from seerob.distance.least import Closests, Per, Query
from seerob.model import provenance
from seerob.model.model import Gap, Model
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.spans import Falls, Points, approaching
from seerob.twin.state import State
from seerob.twin.states import States

CELLS, FEWEST = 130, 5
"""Of the search for depths at one tick, shared by all that is inside; the interval says what it left open."""

_DEEP = attrgetter("at_least", "at_most")


class SafetyArea(Criterion, frozen=True, kw_only=True):
    """Whether anything of a set is inside a safety area, which bodies, and how deep."""

    unit: ClassVar[str] = "m"
    whole: ClassVar[bool] = False
    at_most: ClassVar[bool] = False

    area: str | tuple[str, ...]
    """An entry of ``[[areas]]`` or the field of a sensor, or a list of them."""
    of: str | tuple[str, ...]
    """What must stay outside: a robot, a human, a tool or a part, or a list of them."""
    tolerance: Annotated[float, Meta(ge=1e-4, le=0.1, extra={"unit": "m"})] = 0.005
    """Width of the interval of a depth that is enough [m]; a finer one takes longer."""

    def __post_init__(self) -> None:
        for key in ("area", "of"):
            if not getattr(self, key):
                raise ValueError(f"{key} is empty: name at least one")

    def subjects(self) -> tuple[str, ...]:
        """The areas and what must stay outside."""
        return *_names(self.area), *_names(self.of)

    def bind(self, model: Model) -> Evaluate:
        """Return the function that judges one instant: of who is partly seen, what is seen first."""
        watched, present, depths = self._watched(model), self.present(model), self._depths(model)

        def bind(watched: Sequence[_Watched]) -> Evaluate:
            return self.judging(self._distances(model, watched, depths), present)

        def without(lost: tuple[int, ...]) -> Evaluate | None:
            rest = [
                _Watched(each.area, model.gap(each.gap.a, kept))
                for each in watched
                if (kept := tuple(i for i in each.gap.b if i not in lost))
            ]
            return bind(rest) if rest else None

        bodies = tuple(dict.fromkeys(i for each in watched for i in each.gap.b))
        return seen_first(bodies, bind(watched), without)

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes distances and depths."""
        return self._distances(model, self._watched(model), self._depths(model))

    def planned(self, model: Model) -> Callable[[Sequence[Any], Model], Whole] | None:
        """Return what computes distances together; of whom is inside each is asked alone."""
        return _Outside

    def one_by_one(self, model: Model) -> str:
        """Many instants are computed together, but for those at which something is inside."""
        return ""

    def _depths(self, model: Model) -> Depths:
        return Depths(model.shapes, tolerance=self.tolerance, cells=CELLS, fewest=FEWEST)

    def _distances(self, model: Model, watched: Sequence[_Watched], depths: Depths) -> Compute:
        several = len(_names(self.area)) > 1
        offs = [TrackingError(model, each.gap.bodies) for each in watched]
        places = [[_where(model, each, i, several) for i in range(len(each.gap.b))] for each in watched]
        concerned = tuple(dict.fromkeys(i for each in watched for i in each.gap.bodies))

        def of_many(states: States, asked: list[Closests]) -> Figure:
            nearest = [found.distance.min(axis=-1) for found in asked]
            rooms = [value - each.gap.deviation for value, each in zip(nearest, watched, strict=True)]
            value, least = np.min(nearest, axis=0), np.min(rooms, axis=0)
            # How deep somebody is inside is asked of each instant.
            states.alone = states.alone | ~(value > ROUNDING)
            return Figure(value, 0.0, (np.minimum(least, value), value))

        def compute(twin: Twin) -> Figure:
            asked = [twin.closest_per_body(each.gap, strayed=True) for each in watched]
            if twin.many:
                return of_many(cast("States", twin), asked)
            state: State = twin  # type: ignore[assignment]
            nearest, perhaps = (np.inf, ""), (np.inf, "", 0.0)
            entered: list[tuple[int, int]] = []
            for k, (each, names, found, off) in enumerate(zip(watched, places, asked, offs, strict=True)):
                i, may = int(found.distance.argmin()), each.gap.deviation
                value = room = found.distance.item(i)
                nearest = min(nearest, (value, names[i]))
                if value <= ROUNDING:
                    entered += [(k, j) for j in np.flatnonzero(found.distance <= ROUNDING).tolist()]
                if not off.none(state):
                    errors, on = off.at(state), len(each.gap.a)
                    # An area that a person carries may be elsewhere, too.
                    elsewhere = errors[:on].max() + errors[on:]
                    # Another may be nearer than it, devices being what they are.
                    i = int((found.distance - (elsewhere + may)).argmin())
                    room, may = found.distance.item(i), elsewhere.item(i) + may
                perhaps = min(perhaps, (room - may, names[i], may))
            if not entered:
                # The real surface may stick out of the shape, a bone be elsewhere: nearly inside is not out.
                (value, who), (least, _, _) = nearest, perhaps
                ends = None if least >= value else (least, value)
                return Figure(value, 0.0, ends, beside=_Near(who, *perhaps[1:]))
            pairs = [(int(asked[k].body_a[i]), watched[k].gap.b[i]) for k, i in entered]
            deeps = depths.ask(*state.placed(concerned, strayed=True), pairs)
            names = [places[k][i] for k, i in entered]
            least_deep, most_deep = -np.array([*map(_DEEP, deeps)]).T
            parts = Parts(names, least_deep, np.zeros(len(deeps)), (most_deep, least_deep))
            return Figure(None, parts=parts, beside=_Near(inside=(pairs, deeps, entered, asked)))

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says who is inside or nearest, and lights areas and bodies."""

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            near: _Near = figure.beside
            pairs, deeps, entered, found = near.inside
            reason = near.who
            if figure.parts is not None:
                reason = ", ".join(figure.parts.names)
            elif verdict is Verdict.UNDECIDED:
                mm = figures.rounded_up(near.off * 1e3, "mm")
                reason = f"{near.perhaps} is within {mm}, what its shape and its place may be off by"

            def draw() -> tuple[Marker, ...]:
                areas = [Highlight(body=name, verdict=verdict) for name in _names(self.area)]
                inside: list[Marker] = []
                for (_, body), deep, (k, i) in zip(pairs, deeps, entered, strict=True):
                    name, border = model.bodies[body].name, found[k].point_a[i]
                    inside += (Highlight(body=name, verdict=Verdict.EXCEEDED), *_line(deep, border))
                return *areas, *dict.fromkeys(inside)

            return Shown(reason, draw)

        return present

    def _watched(self, model: Model) -> tuple[_Watched, ...]:
        known = {body.owner: body for body in model.bodies if body.role == "area"}
        known |= {body.name: body for body in model.bodies if body.role == "area"}
        inside = tuple(dict.fromkeys(i for name in _names(self.of) for i in model.select(name)))
        watched = []
        for name in _names(self.area):
            if name not in known:
                raise UnknownName("area", name, known)
            bodies = model.select(name)
            if set(bodies) & set(inside):
                raise InputError.at(
                    self.name, "of", f"{name!r} cannot be inside itself", "name what enters it"
                )
            watched.append(_Watched(name, model.gap(bodies, inside)))
        return tuple(watched)

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound how much nearer bodies can come to areas between two instants at which this is asked."""
        gaps = [each.gap for each in self._watched(model)]
        return approaching((i for gap in gaps for i in gap.a), (i for gap in gaps for i in gap.b))

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        gaps = [each.gap for each in self._watched(model)]
        carriers = dict.fromkeys(name for gap in gaps for name in gap.carriers)
        return Basis(
            formula="least distance of each body to the area; 0 or less is inside, then as deep as its "
            "point farthest from the area's surface",
            source="Weistroffer et al. 2022, section 2.2.2.7",
            inputs=provenance.motion(model, *carriers)
            + tuple(dict.fromkeys(given for gap in gaps for given in provenance.shapes(gap))),
            not_modelled=("the sensor that would watch the area: its resolution and response time",),
        )


@dataclass(frozen=True, eq=False)
class _Watched:
    area: str
    gap: Gap


class _Near(Struct, frozen=True, eq=False):
    """Who is nearest to an area, or inside it."""

    who: str = ""
    perhaps: str = ""
    """Who may be nearest, shapes and devices being what they are."""
    off: float = 0.0
    """By how much that one may be elsewhere [m]."""
    inside: tuple[
        Sequence[tuple[int, int]], Sequence[Depth], Sequence[tuple[int, int]], Sequence[Closests]
    ] = (), (), (), ()
    """Bodies of the area and of who is in it, how deep, and which of whose distances those are."""


def _names(given: str | tuple[str, ...]) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else given


def _where(model: Model, watched: _Watched, i: int, several: bool) -> str:
    body = model.bodies[watched.gap.b[i]].name
    return f"{body} in {watched.area}" if several else body


def _line(deep: Depth, border: Array) -> tuple[Segment, ...]:
    """From the border to the deepest point."""
    end = tuple(deep.point.tolist())
    if not all(map(math.isfinite, end)):
        return ()
    start = tuple(border.tolist())
    low, high = figures.rounded_down(deep.at_least, "m"), figures.rounded_up(deep.at_most, "m")
    label = f"{high if deep.at_most == deep.at_least else f'between {low} and {high}'} deep"
    return (Segment(start=start, end=end, label=label, verdict=Verdict.EXCEEDED),)


class _Outside:
    """Areas of which all keep out at one instant, of a tick's plan."""

    def __init__(self, criteria: Sequence[SafetyArea], model: Model) -> None:
        self._every = list[tuple[list[tuple[float, dict[int, str]]], Present, Result]]()
        """Of each: of every area how much nearer than it seems anybody may be [m], and where each body is."""
        asked = list[tuple[Query, Per]]()
        for each in criteria:
            watched, several = each._watched(model), len(_names(each.area)) > 1
            places = [[_where(model, one, i, several) for i in range(len(one.gap.b))] for one in watched]
            asked += [(one.gap.query, Per.SETS) for one in watched]
            areas = [
                (one.gap.deviation, dict(zip(one.gap.b, where, strict=True)))
                for one, where in zip(watched, places, strict=True)
            ]
            same = Result(name=each.name, unit=each.unit, at_most=each.at_most)
            self._every.append((areas, each.present(model), same))
        self._asked = tuple(asked)

    def results(self, state: State) -> list[Result | None]:
        """Say of each area that nobody is inside of, or may be, who is nearest; as `SafetyArea.bind`."""
        found, begins = state.nearest(self._asked)
        row, results = iter(begins), list[Result | None]()
        for areas, present, same in self._every:
            nearest, perhaps = (np.inf, ""), (np.inf, "", 0.0)
            for may, where in areas:
                k = next(row)
                value, who = found.distance.item(k), where[found.body_b.item(k)]
                nearest = min(nearest, (value, who))
                perhaps = min(perhaps, (value - may, who, may))
            (value, who), least = nearest, perhaps[0]
            ends = None if least >= value else (least, value)
            figure = Figure(value, 0.0, ends, beside=_Near(who, *perhaps[1:]))
            verdict = verdict_of(figure, at_most=same.at_most)
            clear = value > ROUNDING and math.isfinite(value) and verdict is not Verdict.UNDECIDED
            shown = present(state, figure, verdict) if clear else NOTHING_SHOWN
            results.append(result_of(figure, verdict, shown, same) if clear else None)
        return results
