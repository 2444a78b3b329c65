r"""The area around a robot that is nearer to it than its protective separation distance now.

.. math:: A(t) = \{x : \exists i,\; d(x, B_i(t)) < S_{p,i}(t)\}

with B_i the moving parts of the robot and :math:`S_{p,i}` of the criterion of kind separation that is named:
there is no second model of the stop. It breathes with the speed of the robot. The area of a whole motion,
which stands still, is an entry of ``[[areas]]`` with ``swept.separation``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta
from msgspec.structs import replace

from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Basis, Highlight, Hull, Marker, Result, Segment, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING, keeps
from seerob.criteria.body_parts import seen_first
from seerob.criteria.criterion import Criterion, Evaluate, Follows
from seerob.criteria.sensors.sensing import Names, bodies_of, names_of
from seerob.distance.least import Per
from seerob.distance.voxels import offset_shell
from seerob.model import provenance
from seerob.model.model import Model
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.spans import Fall, Falls, Points, Span, rows_of
from seerob.twin.state import State


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

    def _criterion(self, model: Model) -> Any:
        known = {c.name: c for c in model.workstation.safety if hasattr(c, "required")}
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
        """Look up every name in the model once and return the function that judges one instant."""
        return self._bind(model, self._criterion(model))

    def _bind(self, model: Model, criterion: Any) -> Evaluate:
        moving, outside = self._sides(model)
        required = criterion.required(model)
        worst = criterion.at_worst(model)
        largest = None if worst is criterion else worst.required(model)

        def bound(outside: tuple[int, ...]) -> Evaluate:
            return self._bound(model, moving, outside, (required, largest), criterion.unknown(model))

        def without(lost: tuple[int, ...]) -> Evaluate | None:
            rest = tuple(i for i in outside if i not in lost)
            return bound(rest) if rest else None

        return seen_first(outside, bound(outside), without)

    def _bound(
        self,
        model: Model,
        moving: tuple[int, ...],
        outside: tuple[int, ...],
        required: tuple[Callable[[State], Any], Callable[[State], Any] | None],
        unknown_ever: str,
    ) -> Evaluate:
        gap = model.gap(moving, outside)
        off = TrackingError(model, outside)
        drawn: list[tuple[float, tuple[Hull, ...]]] = []

        def evaluate(state: State) -> Result:
            state.require_bodies((*moving, *outside))
            S_p, most, more = required[0](state)
            if required[1] is not None:
                most = np.maximum(most, required[1](state).most)  # with its tolerances
            unknown = "; ".join(filter(None, (unknown_ever, more)))
            found = state.distances(gap.query, Per.PAIR)
            room = found.distance.reshape(len(moving), len(outside)) - S_p[:, None]
            nearest = room.argmin(axis=0)
            least = room[nearest, np.arange(len(outside))]
            # What the robot's acceleration and tolerances may add to S_p is as much less room.
            may = off.at(state) + gap.deviation + float((most - S_p).max())
            surely = float((least - may).min())
            k, perhaps = int(least.argmin()), int((least - may).argmin())
            unbounded_reason = self._unbounded_reason(
                model, outside[perhaps], float(least[perhaps]), float(may[perhaps]), unknown
            )
            verdict = (
                Verdict.EXCEEDED
                if least[k] <= ROUNDING
                else Verdict.UNDECIDED
                if unbounded_reason
                else Verdict.WITHIN
            )
            parts: list[Result] = []
            lit: list[Marker] = []
            for j in np.flatnonzero(least <= ROUNDING).tolist():
                i, body = int(nearest[j]), model.bodies[outside[j]].name
                e = i * len(outside) + j
                parts.append(
                    Result(
                        name=body,
                        value=float(least[j]),
                        unit="m",
                        limit=0.0,
                        at_most=False,
                        verdict=Verdict.EXCEEDED,
                        reason=f"{found.distance[e]:.3f} m from {model.bodies[moving[i]].name}, "
                        f"S_p {S_p[i]:.3f} m",
                    )
                )
                a, b = found.point_a[e].tolist(), found.point_b[e].tolist()
                lit.append(Highlight(body=body, verdict=Verdict.EXCEEDED))
                lit.append(Segment(start=tuple(a), end=tuple(b), verdict=Verdict.EXCEEDED))
            if (
                not drawn
                or not 0 <= state.t - drawn[0][0] < self.redraw
                or drawn[0][1][0].verdict is not verdict
            ):
                drawn[:] = [(state.t, _shells(model, state, moving, S_p, verdict))]
            return Result(
                name=self.name,
                value=float(least[k]),
                unit="m",
                limit=0.0,
                at_most=False,
                verdict=verdict,
                reason=unbounded_reason if verdict is Verdict.UNDECIDED else model.bodies[outside[k]].name,
                interval=(surely, float(least[k])) if surely < least[k] else None,
                parts=(*parts, Result(name="largest S_p", value=float(S_p.max()), unit="m")),
                markers=(*drawn[0][1], *lit),
            )

        return evaluate

    @staticmethod
    def _unbounded_reason(model: Model, body: int, room: float, deviation: float, unknown: str) -> str:
        """Why somebody who is outside may be inside all the same."""
        if unknown:
            return f"{unknown}; the area is at least what is drawn"
        if not keeps(room - deviation, 0.0, at_most=False):
            name = model.bodies[body].name
            return f"{name} is within {deviation * 1e3:.1f} mm, what shapes, places and S_p may be off by"
        return ""

    def remembers(self, model: Model) -> bool:
        """Say whether the result depends on earlier instants, so that it is asked in the order of time."""
        return bool(self._criterion(model).remembers(model))

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
            nearer = span.fast[moving] * span.T + rises(span)
            lost = span.way(outside) + float(nearer.max(initial=0.0))
            return Fall(np.inf, lost) if lasts else Fall(lost)

        return falls

    def bounded_once(self, model: Model) -> bool:
        """Whether S_p of the separation is."""
        return bool(self._criterion(model).bounded_once(model))

    def follows(self, model: Model, points: Points) -> Follows | None:
        """S_p is bounded apart where the largest counts, or where speeds alone do not tell how it changes."""
        criterion = self._criterion(model)
        keeps = criterion.remembers(model)
        if not keeps and criterion.rises(model) is not None:
            return None
        present = replace(criterion, mode="dynamic")
        found: Follows | None = criterion.limit_follows(
            model, points, keeps=keeps, again=lambda: self._bind(model, present)
        )
        return found

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        found: Basis = self._criterion(model).basis(model)
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


def _shells(
    model: Model, state: State, moving: tuple[int, ...], S_p: Array, verdict: Verdict
) -> tuple[Hull, ...]:
    shells = []
    R, x = state.placed(moving)
    for i, distance in zip(moving, S_p.tolist(), strict=True):
        if i in state.attachments.away:
            continue
        body = model.bodies[i]
        corners = body.corners @ R[i].T + x[i]
        vertices, faces = offset_shell(corners, body.radius + max(distance, 0.0))
        rounded = tuple((x, y, z) for x, y, z in vertices.round(3).tolist())
        shells.append(Hull(vertices=rounded, faces=faces, verdict=verdict))
    return tuple(shells)
