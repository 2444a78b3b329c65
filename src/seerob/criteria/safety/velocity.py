r"""Speed of a point, or of the fastest point of a set of bodies, [Weistroffer2022]_ Eq. 4."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.domains import agree, at_least
from seerob.core.errors import InputError
from seerob.core.markers import drawn
from seerob.core.quantities import Metres3
from seerob.core.snapshot import Arrow, Basis, Input, Result, Verdict
from seerob.core.transforms import Array
from seerob.criteria.criterion import Criterion, Evaluate, EvaluateMany, judge, judge_interval
from seerob.criteria.noisy_speeds import NOISE
from seerob.model import provenance
from seerob.model.model import Model
from seerob.recording.answers import Answers
from seerob.twin.moving_base import velocity_of
from seerob.twin.spans import Falls, Points, speeding
from seerob.twin.state import State
from seerob.twin.states import States

NO_NOISE = np.zeros(0)
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


def speed_noise(J: Array, error: Array) -> Array:
    r"""How far speeds of points may be off, :math:`\sqrt{\sum_j |J_j|^2 \delta_j^2}`.

    Errors of joints are independent: each is that of its own encoder.

    Args:
        J: Linear rows, shape (..., 3, n) [m/rad or 1].
        error: δ of each joint, shape (n,) [rad/s or m/s].

    Returns:
        [m/s], shape (...).
    """
    error = at_least("error", error, unit="rad/s or m/s")
    agree(n=(J.shape[-1], *error.shape))
    return np.asarray(np.sqrt(((J * error) ** 2).sum(axis=(-2, -1))))


class Velocity(Criterion, frozen=True, kw_only=True):
    """Speed of a point of a robot or person, or of the fastest point of a set of bodies."""

    unit: ClassVar[str] = "m/s"
    by_speed: ClassVar[bool] = True

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
        """Return the bodies of the set; for a point, the body it is fixed to."""
        if self.of is not None:
            return super().judged(model)
        at = model.frame(self.at or "").mj
        return {body.index for body in model.bodies if body.mj == at}

    def unshaped(self, model: Model) -> str:
        """Say what no shape shows of the robots; a point needs no shape."""
        return super().unshaped(model) if self.of else ""

    def bind(self, model: Model) -> Evaluate:
        """Look up every name in the model once and return the function that judges one instant."""
        return self._bind_point(model) if self.at is not None else self._bind_set(model)

    def _bind_point(self, model: Model) -> Evaluate:
        frame = model.frame(self.at or "")
        mechanism = model.carrier(frame)
        offset = np.array(self.offset)

        def evaluate(state: State) -> Result:
            v = velocity_of(state, frame, mechanism, offset)[:3]
            place = state.drawn_point(frame, offset)
            speed, interval = math.sqrt(float(v @ v)), None
            error = state.speed_error(mechanism)
            if error is not None:
                off = float(speed_noise(state.jacobian(frame, mechanism, offset)[:3], error))
                interval = max(speed - off, 0.0), speed + off
            return self._result(speed, place, v, interval=interval)

        return evaluate

    def _bodies(self, model: Model) -> tuple[int, ...]:
        bodies = tuple(i for i in model.select(self.of or "") if model.bodies[i].carrier)
        if not bodies:
            raise InputError.at(self.name, "of", f"nothing of {self.of!r} moves", "name a robot or human")
        return bodies

    def _bind_set(self, model: Model) -> Evaluate:
        bodies = self._bodies(model)
        movers = [model.bodies[i].carrier for i in bodies]
        rows_of = {
            name: [k for k, mover in enumerate(movers) if mover == name] for name in dict.fromkeys(movers)
        }
        moving = [(model.mechanisms[name], rows) for name, rows in rows_of.items()]

        def noise(state: State, points: Array) -> Array:
            """Of the fastest point of each body [m/s], shape (b,); of none where nobody says how far."""
            errors = [state.speed_error(mechanism) for mechanism, _ in moving]
            if not any(error is not None for error in errors):
                return NO_NOISE
            found = np.zeros(len(bodies))
            for (mechanism, rows), error in zip(moving, errors, strict=True):
                if error is None:
                    continue
                own = tuple(bodies[k] for k in rows)
                axes = (np.tile(axis, (len(rows), 1)) for axis in np.eye(3))
                J = np.stack([state.along(own, mechanism, points[rows], u) for u in axes], axis=-2)
                found[rows] = speed_noise(J, error)
            return found

        def evaluate(state: State) -> Result:
            speeds, points, velocities = state.fastest_points(bodies)
            k = int(speeds.argmax())
            interval = None
            off = noise(state, points)
            if off is not NO_NOISE and off.any():
                low, high = np.maximum(speeds - off, 0.0), speeds + off
                interval = float(low.max()), float(high.max())
            where = model.bodies[bodies[k]].name
            point, v = points[k], velocities[k]
            return self._result(float(speeds[k]), lambda: point, v, where, interval=interval)

        return evaluate

    def _result(
        self,
        speed: float,
        place: Callable[[], Array],
        v: Array,
        where: str = "",
        *,
        interval: tuple[float, float] | None = None,
    ) -> Result:
        verdict = judge(speed, self.limit) if interval is None else judge_interval(interval, self.limit)
        if interval is not None and verdict is Verdict.UNDECIDED:
            where = f"{where}: {NOISE}".removeprefix(": ")

        def draw() -> tuple[Arrow, ...]:
            label = figures.worded(speed, self.limit, self.unit, at_most=True)
            origin, vector = tuple(place().tolist()), tuple((DRAWN * v).tolist())
            return (Arrow(origin=origin, vector=vector, label=label, verdict=verdict),)

        return Result(
            name=self.name,
            value=speed,
            unit=self.unit,
            limit=self.limit,
            verdict=verdict,
            reason=where,
            interval=interval,
            markers=drawn(draw),
        )

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound how much faster the bodies or the point can be between two instants."""
        if self.at is None:
            return speeding(self._bodies(model))
        frame = model.frame(self.at)
        local = frame.body_from_frame[:3, :3] @ np.array(self.offset) + frame.body_from_frame[:3, 3]
        return speeding([points.add(frame.mj, local)])

    def batch(self, model: Model) -> EvaluateMany | None:
        """Judge many instants at once; None for a point when something that moves carries its robot."""
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
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
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
