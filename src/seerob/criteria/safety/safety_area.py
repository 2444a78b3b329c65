"""Intrusion into safety areas, [Weistroffer2022]_ section 2.2.2.7."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from seerob.core.errors import InputError, UnknownName
from seerob.core.markers import drawn
from seerob.core.snapshot import Basis, Highlight, Marker, Result, Segment, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING, keeps
from seerob.criteria.body_parts import seen_first
from seerob.criteria.criterion import Criterion, Evaluate
from seerob.distance.depth import Depth, Depths
from seerob.distance.least import Closests
from seerob.model import provenance
from seerob.model.model import Gap, Model
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.spans import Falls, Points, approaching
from seerob.twin.state import State

CELLS, FEWEST = 130, 5
"""Of the search for depths at one tick, shared by all that is inside; the interval says what it left open."""


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
        """Look up every name in the model once and return the function that judges one instant."""
        watched = self._watched(model)
        depths = Depths(model.shapes, tolerance=self.tolerance, cells=CELLS, fewest=FEWEST)

        def without(lost: tuple[int, ...]) -> Evaluate | None:
            rest = [
                _Watched(each.area, model.gap(each.gap.a, kept))
                for each in watched
                if (kept := tuple(i for i in each.gap.b if i not in lost))
            ]
            return self._bound(model, tuple(rest), depths) if rest else None

        bodies = tuple(dict.fromkeys(i for each in watched for i in each.gap.b))
        return seen_first(bodies, self._bound(model, watched, depths), without)

    def _bound(self, model: Model, watched: tuple[_Watched, ...], depths: Depths) -> Evaluate:
        several = len(_names(self.area)) > 1
        offs = [TrackingError(model, each.gap.bodies) for each in watched]
        surfaces = [np.full(len(each.gap.b), each.gap.deviation) for each in watched]
        concerned = tuple(dict.fromkeys(i for each in watched for i in each.gap.bodies))

        def evaluate(state: State) -> Result:
            nearest, perhaps = (np.inf, ""), (np.inf, "", 0.0)
            parts: list[Result] = []
            lit: list[tuple[str, Depth, Array]] = []
            asked = [state.closest_per_body(each.gap, strayed=True) for each in watched]
            entered: list[tuple[_Watched, Closests, int]] = []
            for each, found, off, still in zip(watched, asked, offs, surfaces, strict=True):
                may = still
                if not off.none(state):
                    errors, on = off.at(state), len(each.gap.a)
                    # An area that a person carries may be elsewhere, too.
                    may = errors[:on].max() + errors[on:] + each.gap.deviation
                i = int(found.distance.argmin())
                nearest = min(nearest, (float(found.distance[i]), _where(model, each, i, several)))
                # Another may be nearer than it, shapes and devices being what they are.
                room = found.distance - may
                i = int(room.argmin())
                perhaps = min(perhaps, (float(room[i]), _where(model, each, i, several), float(may[i])))
                entered += [(each, found, i) for i in np.flatnonzero(found.distance <= ROUNDING).tolist()]
            pairs = [(int(found.body_a[i]), each.gap.b[i]) for each, found, i in entered]
            deeps = depths.ask(*state.placed(concerned, strayed=True), pairs) if pairs else []
            for (each, found, i), deep in zip(entered, deeps, strict=True):
                parts.append(
                    Result(
                        name=_where(model, each, i, several),
                        value=-deep.at_least,
                        unit="m",
                        limit=0.0,
                        at_most=False,
                        verdict=Verdict.EXCEEDED,
                        interval=(-deep.at_most, -deep.at_least),
                    )
                )
                lit.append((model.bodies[each.gap.b[i]].name, deep, found.point_a[i]))
            return self._result(nearest, perhaps, parts, deeps, lit)

        return evaluate

    def _result(
        self,
        nearest: tuple[float, str],
        perhaps: tuple[float, str, float],
        parts: list[Result],
        deeps: Sequence[Depth],
        lit: Sequence[tuple[str, Depth, Array]],
    ) -> Result:
        room, who = nearest
        interval: tuple[float, float] | None
        if parts:
            deepest = max(deeps, key=lambda deep: deep.at_least)
            verdict, reason = Verdict.EXCEEDED, ", ".join(part.name for part in parts)
            room, interval = -deepest.at_least, (-deepest.at_most, -deepest.at_least)
        else:
            # The real surface may stick out of the shape, a bone be elsewhere: nearly inside is not outside.
            least, close, deviation = perhaps
            open_ = not keeps(least, 0.0, at_most=False)
            verdict = Verdict.UNDECIDED if open_ else Verdict.WITHIN
            reason = (
                f"{close} is within {deviation * 1e3:.1f} mm, what its shape and its place may be off by"
                if open_
                else who
            )
            interval = (least, room) if least < room else None

        def draw() -> tuple[Marker, ...]:
            areas = [Highlight(body=name, verdict=verdict) for name in _names(self.area)]
            inside: list[Marker] = []
            for body, deep, border in lit:
                inside += (Highlight(body=body, verdict=Verdict.EXCEEDED), *_line(deep, border))
            return *areas, *dict.fromkeys(inside)

        return Result(
            name=self.name,
            value=room,
            unit=self.unit,
            limit=0.0,
            at_most=False,
            verdict=verdict,
            reason=reason,
            interval=interval,
            parts=tuple(parts),
            markers=drawn(draw),
        )

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
    return (Segment(start=start, end=end, label=f"{deep.at_least:.3f} m deep", verdict=Verdict.EXCEEDED),)
