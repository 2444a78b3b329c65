r"""The area around a robot that is nearer to it than its protective separation distance now.

.. math:: A(t) = \{x : \exists i,\; d(x, B_i(t)) < S_{p,i}(t)\}

with B_i the moving parts of the robot and :math:`S_{p,i}` of the criterion of kind separation that is named:
there is no second model of the stop. It breathes with the speed of the robot. The area of a whole motion,
which stands still, is an entry of ``[[areas]]`` with ``swept.separation``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Annotated, ClassVar, NamedTuple, Protocol, cast

import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import replace

from seerob.core import figures
from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Basis, Highlight, Hull, Marker, Result, Segment, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING
from seerob.criteria.body_parts import seen_first
from seerob.criteria.criterion import Criterion, Evaluate, Follows
from seerob.criteria.figure import Compute, Figure, Parts, Present, Shown, Twin
from seerob.criteria.sensors.sensing import Names, bodies_of, names_of
from seerob.distance.least import Closests, Per
from seerob.distance.voxels import offset_shell
from seerob.model import provenance
from seerob.model.model import Gap, Model
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.spans import Fall, Falls, Points, Span, rows_of
from seerob.twin.state import State
from seerob.twin.states import States


class _Separating(Protocol):
    """What is asked of the criterion of kind separation that is named."""

    @property
    def between(self) -> tuple[str, str]:
        """A robot or machine, and a human."""

    def moving(self, model: Model) -> tuple[int, ...]: ...
    def depends(self, model: Model) -> tuple[str, ...]: ...
    def one_by_one(self, model: Model) -> str: ...
    def remembers(self, model: Model) -> bool: ...
    def bounded_once(self, model: Model) -> bool: ...
    def basis(self, model: Model) -> Basis: ...
    def unknown(self, model: Model) -> str: ...
    def at_worst(self, model: Model) -> _Separating: ...
    def required(self, model: Model) -> Callable[[State], _OfOne]: ...
    def required_of_many(self, model: Model) -> Callable[[States], Array]: ...
    def rises(self, model: Model) -> Callable[[Span], Array] | None: ...
    def lasts(self, model: Model) -> bool: ...
    def limit_follows(
        self, model: Model, points: Points, *, keeps: bool, again: Callable[[], Evaluate]
    ) -> Follows | None: ...


_OfOne = tuple[Array, Array, str]
"""S_p of each moving part, the most that it may be [m], (n,) each, and why it may be larger."""


class SeparationArea(Criterion, frozen=True, kw_only=True):
    """Whether anything is nearer to a robot than the protective separation distance of this moment."""

    unit: ClassVar[str] = "m"
    by_speed: ClassVar[bool] = True
    whole: ClassVar[bool] = False
    at_most: ClassVar[bool] = False

    separation: str
    """A criterion of kind separation, whose S_p counts, present or largest so far as its ``mode`` says."""
    of: Names
    """What must stay outside: humans, parts, other robots, or a list of names."""
    redraw: Annotated[float, Meta(gt=0, extra={"unit": "s"})] = 0.1
    """Time between two pictures of the area [s]; the verdict itself is of every tick."""

    def subjects(self) -> tuple[str, ...]:
        """What must stay outside."""
        return names_of(self.of)

    def judged(self, model: Model) -> set[int]:
        """Return the bodies that must stay outside, and the moving ones of the separation."""
        return super().judged(model) | set(self._criterion(model).moving(model))

    def depends(self, model: Model) -> tuple[str, ...]:
        """Names of what must stay outside, and of the robot that the separation is of."""
        return (*self.subjects(), *self._criterion(model).depends(model))

    def _criterion(self, model: Model) -> _Separating:
        known: dict[str, _Separating] = {
            c.name: c for c in model.workstation.safety if hasattr(c, "required")
        }
        if self.separation not in known:
            raise UnknownName("criterion of kind separation", self.separation, known)
        return known[self.separation]

    def _sides(self, model: Model) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Moving parts of the robot, and what must stay outside."""
        names = [n for n in self._criterion(model).between if model.mechanism(n).role != "human"]
        moving, outside = self._criterion(model).moving(model), bodies_of(model, self.of)
        if not outside or set(outside) & set(moving):
            what = "nothing in it has a shape" if not outside else f"{names[0]!r} cannot be outside of itself"
            raise InputError.at(self.name, "of", what, "name what must stay away from the robot")
        return moving, outside

    def bind(self, model: Model) -> Evaluate:
        """Return the function that judges one instant: of who is partly seen, what is seen first."""
        return self._bind(model, self._criterion(model))

    def _bind(self, model: Model, criterion: _Separating) -> Evaluate:
        moving, outside = self._sides(model)
        required = _Required.of(model, criterion)

        def bound(outside: tuple[int, ...]) -> Evaluate:
            gap = model.gap(moving, outside)
            return self.judging(_rooms(model, gap, required), self._shown(model, gap))

        def without(lost: tuple[int, ...]) -> Evaluate | None:
            rest = tuple(i for i in outside if i not in lost)
            return bound(rest) if rest else None

        return seen_first(outside, bound(outside), without)

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes room beyond S_p."""
        return _rooms(model, model.gap(*self._sides(model)), _Required.of(model, self._criterion(model)))

    def present(self, model: Model) -> Present:
        """Return the function that says who is inside or nearest, and draws the area."""
        return self._shown(model, model.gap(*self._sides(model)))

    def one_by_one(self, model: Model) -> str:
        """Say why S_p is; many instants are computed together where S_p is."""
        return self._criterion(model).one_by_one(model)

    def _shown(self, model: Model, gap: Gap) -> Present:
        drawn: tuple[float, Verdict | None, Callable[[], tuple[Hull, ...]]] | None = None

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            nonlocal drawn
            near: _Near = figure.beside
            name = model.bodies[near.who].name
            reason = self._unbounded_reason(model, near) if verdict is Verdict.UNDECIDED else name
            if drawn is None or not 0 <= state.t - drawn[0] < self.redraw or drawn[1] is not verdict:
                # Made once, by whoever looks first.
                drawn = state.t, verdict, cache(_shells(model, state, gap.a, near.S_p, verdict))
            shells, parts, found, where = drawn[2], figure.parts, near.found, list[str]()
            names = () if parts is None else parts.names
            for e in near.inside:
                i, _ = divmod(e, len(gap.b))
                robot = model.bodies[gap.a[i]].name
                shown = figures.against(float(found.distance[e]), float(near.S_p[i]), "m", at_most=False)
                where.append(f"{shown.value} m from {robot}, S_p {shown.limit} m")

            def draw() -> tuple[Marker, ...]:
                lit: list[Marker] = []
                for body, e in zip(names, near.inside, strict=True):
                    a, b = found.point_a[e].tolist(), found.point_b[e].tolist()
                    lit.append(Highlight(body=body, verdict=verdict))
                    lit.append(Segment(start=tuple(a), end=tuple(b), verdict=verdict))
                return *shells(), *lit

            largest = Result(name="largest S_p", value=float(near.S_p.max()), unit="m")
            return Shown(reason, draw, (largest,), where)

        return present

    @staticmethod
    def _unbounded_reason(model: Model, near: _Near) -> str:
        """Why somebody who is outside may be inside all the same."""
        if near.unknown:
            return f"{near.unknown}; the area is at least what is drawn"
        who, off = model.bodies[near.perhaps].name, figures.rounded_up(near.off * 1e3, "mm")
        return f"{who} is within {off}, what shapes, places and S_p may be off by"

    def remembers(self, model: Model) -> bool:
        """Say whether the result depends on earlier instants, so that it is asked in the order of time."""
        return self._criterion(model).remembers(model)

    def falls(self, model: Model, points: Points) -> Falls | None:
        """Bound the loss of distance between instants; None unless S_p is bounded, too."""
        criterion = self._criterion(model)
        rises, lasts = criterion.rises(model), criterion.lasts(model)
        apart = self.follows(model, points) is not None
        if rises is None and not apart:
            return None
        moving, outside = map(rows_of, self._sides(model))

        def falls(span: Span, _: Array | float) -> Fall:
            if apart:
                return Fall(span.way(outside) + span.way(moving))
            assert rises is not None
            nearer = span.fast[moving] * span.T + rises(span)
            lost = span.way(outside) + float(nearer.max(initial=0.0))
            return Fall(np.inf, lost) if lasts else Fall(lost)

        return falls

    def bounded_once(self, model: Model) -> bool:
        """Whether S_p of the separation is."""
        return self._criterion(model).bounded_once(model)

    def follows(self, model: Model, points: Points) -> Follows | None:
        """S_p is bounded apart where the largest counts, or where speeds alone do not tell how it changes."""
        criterion = self._criterion(model)
        keeps = criterion.remembers(model)
        if not keeps and criterion.rises(model) is not None:
            return None
        present = cast("_Separating", replace(cast("Criterion", criterion), mode="dynamic"))
        return criterion.limit_follows(model, points, keeps=keeps, again=lambda: self._bind(model, present))

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        found = self._criterion(model).basis(model)
        gap = model.gap(*self._sides(model))
        return Basis(
            formula="least of distance less S_p over the moving parts of the robot; 0 or less is inside, at "
            f"least as deep; {found.formula}",
            source=found.source,
            inputs=tuple(
                dict.fromkeys(
                    (*provenance.motion(model, *gap.carriers), *provenance.shapes(gap), *found.inputs)
                )
            ),
            not_modelled=found.not_modelled,
        )


class _Required(NamedTuple):
    """S_p of each moving part of a robot, by the criterion that is named."""

    now: Callable[[State], _OfOne]
    largest: Callable[[State], _OfOne] | None
    """With its tolerances at their worst; None where it has none."""
    of_many: Callable[[], Callable[[States], Array]]
    """Binds what says it of N instants."""
    unknown_ever: str
    """Why S_p may always be larger than what is computed; empty when it may not."""

    @classmethod
    def of(cls, model: Model, criterion: _Separating) -> _Required:
        worst = criterion.at_worst(model)
        largest = None if worst is criterion else worst.required(model)
        of_many = cache(partial(criterion.required_of_many, model))
        return cls(criterion.required(model), largest, of_many, criterion.unknown(model))


class _Near(Struct, frozen=True, eq=False):
    """Who is nearest to the area or inside it, by index."""

    who: int
    perhaps: int
    """Who may be nearest, shapes, places and S_p being what they are."""
    off: float
    """By how much that one may be nearer [m]."""
    inside: list[int]
    """Pairs of a moving part and who is inside, by their place in ``found``."""
    found: Closests
    """Of each moving part to each of who must stay outside."""
    S_p: Array
    """Of each moving part [m], shape (n,)."""
    unknown: str
    """Why S_p may be larger; empty where it may not."""


def _rooms(model: Model, gap: Gap, required: _Required) -> Compute:
    """How much farther than S_p everybody is from the moving parts."""
    off, columns = TrackingError(model, gap.b), np.arange(len(gap.b))

    def of_many(states: States) -> Figure:
        S_p = required.of_many()(states)
        distance = states.distances(gap.query, Per.PAIR).distance
        room = distance.reshape(len(states), len(gap.a), len(gap.b)) - S_p[..., None]
        value = room.min(axis=(1, 2))
        return Figure(value, 0.0, (value - gap.deviation, value), open=bool(required.unknown_ever))

    def compute(twin: Twin) -> Figure:
        if twin.many:
            return of_many(cast("States", twin))
        state: State = twin  # type: ignore[assignment]
        found = state.distances(gap.query, Per.PAIR)
        S_p, most, more = required.now(state)
        if required.largest is not None:
            most = np.maximum(most, required.largest(state)[1])
        unknown = "; ".join(filter(None, (required.unknown_ever, more)))
        room = found.distance.reshape(len(gap.a), len(gap.b)) - S_p[:, None]
        nearest = room.argmin(axis=0)
        least = room[nearest, columns]
        # What the robot's acceleration and tolerances may add to S_p is as much less room.
        may = off.at(state) + gap.deviation + float((most - S_p).max())
        left = least - may
        k, perhaps = int(least.argmin()), int(left.argmin())
        entered = np.flatnonzero(least <= ROUNDING).tolist()
        parts = None
        if entered:
            names = [model.bodies[gap.b[j]].name for j in entered]
            parts = Parts(names, least[entered], np.zeros(len(entered)), whole=False)
        near = _Near(
            who=gap.b[k],
            perhaps=gap.b[perhaps],
            off=float(may[perhaps]),
            inside=[int(nearest[j]) * len(gap.b) + j for j in entered],
            found=found,
            S_p=S_p,
            unknown=unknown,
        )
        value = float(least[k])
        ends = float(left[perhaps]), value
        return Figure(value, 0.0, ends, open=bool(unknown), parts=parts, beside=near)

    return compute


def _shells(
    model: Model, state: State, moving: tuple[int, ...], S_p: Array, verdict: Verdict | None
) -> Callable[[], tuple[Hull, ...]]:
    """Draws the area around each moving part, from copies of where they are."""
    rotations, positions = state.placed(moving)
    shown = [
        (model.bodies[i], rotations[i].copy(), positions[i].copy(), distance)
        for i, distance in zip(moving, S_p.tolist(), strict=True)
        if i not in state.attachments.away
    ]

    def draw() -> tuple[Hull, ...]:
        shells = []
        for body, R, at, distance in shown:
            vertices, faces = offset_shell(body.corners @ R.T + at, body.radius + max(distance, 0.0))
            rounded = tuple((x, y, z) for x, y, z in vertices.round(3).tolist())
            shells.append(Hull(vertices=rounded, faces=faces, verdict=verdict))
        return tuple(shells)

    return draw
