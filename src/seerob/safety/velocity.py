r"""Speed of a point, or of the fastest point of a set of bodies, [Weistroffer2022]_ Eq. 4."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from seerob import figures, provenance
from seerob.answers import Answers
from seerob.criterion import Criterion, Evaluate, EvaluateMany, judge
from seerob.errors import InputError
from seerob.model import Model
from seerob.moving_base import velocity_of
from seerob.quantities import Metres3
from seerob.snapshot import Arrow, Basis, Input, Result
from seerob.spans import Falls, Points, speeding
from seerob.state import State
from seerob.states import States
from seerob.transforms import Array

DRAWN = 0.5
"""Length of the arrow of a speed of 1 m/s [m]."""


def point_velocity(J: Array, qd: Array) -> Array:
    r"""Velocity of a point :math:`\dot x = J(q) \dot q`.

    Args:
        J: Jacobian, linear rows first, shape (..., 6, n) [m/rad or 1] and [1].
        qd: Joint velocities [rad/s or m/s], shape (..., n).

    Returns:
        Twist (v, ω) at the point [m/s, rad/s], world axes, shape (..., 6).
    """
    return np.asarray((J @ qd[..., None])[..., 0])


class Velocity(Criterion, frozen=True, kw_only=True):
    """Speed of a point of a robot or person, or of the fastest point of a set of bodies."""

    unit: ClassVar[str] = "m/s"

    at: str | None = None
    """Point: a robot (its tool's working point) or the full name of a link."""
    offset: Metres3 = (0.0, 0.0, 0.0)
    """The point in that frame [m]."""
    of: str | None = None
    """Instead of a point: everything that this name means, judged by its fastest point."""
    limit: Annotated[float, Meta(gt=0, extra={"unit": "m/s"})] | None = None
    """Largest admissible speed [m/s]."""

    def __post_init__(self) -> None:
        if (self.at is None) == (self.of is None):
            raise ValueError("give either at, a point, or of, a set of bodies")

    def subjects(self) -> tuple[str, ...]:
        """The point or the set."""
        return (self.at or self.of or "",)

    def judged(self, model: Model) -> set[int]:
        """See `Criterion.judged`; of a point the body that it is of."""
        if self.of is not None:
            return super().judged(model)
        at = model.frame(self.at or "").mj
        return {body.index for body in model.bodies if body.mj == at}

    def unseen(self, model: Model) -> str:
        """See `Criterion.unseen`; a point needs no shape."""
        return super().unseen(model) if self.of else ""

    def bind(self, model: Model) -> Evaluate:
        """See `Criterion.bind`."""
        return self._bind_point(model) if self.at is not None else self._bind_set(model)

    def _bind_point(self, model: Model) -> Evaluate:
        frame = model.frame(self.at or "")
        mechanism = model.carrier(frame)
        offset = np.array(self.offset)

        def evaluate(state: State) -> Result:
            v = velocity_of(state, frame, mechanism, offset)[:3]
            rotation, position = state.pose(frame)
            return self._result(math.sqrt(float(v @ v)), position + rotation @ offset, v)

        return evaluate

    def _bodies(self, model: Model) -> tuple[int, ...]:
        bodies = tuple(i for i in model.select(self.of or "") if model.bodies[i].carrier)
        if not bodies:
            raise InputError.at(self.name, "of", f"nothing of {self.of!r} moves", "name a robot or human")
        return bodies

    def _bind_set(self, model: Model) -> Evaluate:
        bodies = self._bodies(model)

        def evaluate(state: State) -> Result:
            speeds, points, velocities = state.fastest_points(bodies)
            k = int(speeds.argmax())
            return self._result(float(speeds[k]), points[k], velocities[k], model.bodies[bodies[k]].name)

        return evaluate

    def _result(self, speed: float, point: Array, v: Array, where: str = "") -> Result:
        verdict = judge(speed, self.limit)
        arrow = Arrow(
            origin=tuple(point.tolist()),
            vector=tuple((DRAWN * v).tolist()),
            label=figures.told(speed, self.limit, self.unit, at_most=True),
            verdict=verdict,
        )
        return Result(
            name=self.name,
            value=speed,
            unit=self.unit,
            limit=self.limit,
            verdict=verdict,
            reason=where,
            markers=(arrow,),
        )

    def falls(self, model: Model, points: Points) -> Falls:
        """See `Criterion.falls`."""
        if self.at is None:
            return speeding(self._bodies(model))
        frame = model.frame(self.at)
        local = frame.body_from_frame[:3, :3] @ np.array(self.offset) + frame.body_from_frame[:3, 3]
        return speeding([points.add(frame.mj, local)])

    def batch(self, model: Model) -> EvaluateMany | None:
        """See `Criterion.batch`; of a point, where nothing moves that carries its robot."""
        if self.at is None:
            bodies = self._bodies(model)
            return lambda states: self._answers(states.fastest_points(bodies)[0].max(axis=1))
        frame, offset = model.frame(self.at), np.array(self.offset)
        mechanism = model.carrier(frame)
        if not mechanism.alone:
            return None

        def evaluate(states: States) -> Answers:
            v = point_velocity(states.jacobian(frame, mechanism, offset), states.qd(mechanism))[:, :3]
            return self._answers(np.sqrt(np.einsum("ij,ij->i", v, v)))

        return evaluate

    def _answers(self, speed: Array) -> Answers:
        return Answers.against(speed, self.limit, at_most=self.at_most)

    def basis(self, model: Model) -> Basis:
        """See `Criterion.basis`."""
        points: tuple[Input, ...]
        if self.at is not None:
            carriers = [model.carrier(model.frame(self.at)).name]
            formula = "|v|, v = J_v(q) q̇"
            points = (provenance.point(model, self.at, self.offset),)
        else:
            carriers = [model.bodies[i].carrier for i in model.select(self.of or "")]
            formula = "max over all points of |v + ω × r|"
            points = ()
        return Basis(
            formula=formula,
            source="Weistroffer et al. 2022, Eq. 4",
            inputs=points
            + provenance.motion(model, *filter(None, carriers))
            + provenance.limit(self.limit, "m/s"),
        )
