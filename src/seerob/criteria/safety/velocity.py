r"""Speed of a point, or of the fastest point of a set of bodies, [Weistroffer2022]_ Eq. 4."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.domains import agree, at_least
from seerob.core.errors import InputError
from seerob.core.quantities import Metres3
from seerob.core.snapshot import Arrow, Basis, Input, Result
from seerob.core.transforms import Array, length
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.noisy_speeds import NOISE, others_noisy
from seerob.criteria.plan import Draw, Rows, Together
from seerob.model import provenance
from seerob.model.model import Frame, Model
from seerob.twin.moving_base import velocity_of
from seerob.twin.moving_points import Point, commanded
from seerob.twin.spans import Falls, Points, speeding
from seerob.twin.state import State

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
        error: δ of each joint, shape (..., n) [rad/s or m/s].

    Returns:
        [m/s], shape (...).
    """
    error = at_least("error", error, unit="rad/s or m/s")
    agree(n=(J.shape[-1], error.shape[-1]))
    return np.asarray(np.sqrt(((J * error[..., None, :]) ** 2).sum(axis=(-2, -1))))


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

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the speed."""
        return self._of_point(model) if self.at is not None else self._of_set(model)

    def _of_point(self, model: Model) -> Compute:
        frame = model.frame(self.at or "")
        mechanism = model.carrier(frame)
        offset = np.array(self.offset)
        others = (*model.carriers_of(mechanism.name), *mechanism.riders)

        def compute(twin: Twin) -> Figure:
            v = velocity_of(twin, frame, mechanism, offset)[..., :3]
            speed, interval = length(v), None
            error = twin.speed_error(mechanism)
            if error is not None:
                off = speed_noise(twin.jacobian(frame, mechanism, offset)[..., :3, :], error)
                interval = np.maximum(speed - off, 0.0), speed + off
            return Figure(speed, self.limit, interval, open=others_noisy(twin, others), beside=v)

        return compute

    def _bodies(self, model: Model) -> tuple[int, ...]:
        bodies = tuple(i for i in model.select(self.of or "") if model.bodies[i].carrier)
        if not bodies:
            raise InputError.at(self.name, "of", f"nothing of {self.of!r} moves", "name a robot or human")
        return bodies

    def _of_set(self, model: Model) -> Compute:
        bodies = self._bodies(model)
        movers = [model.bodies[i].carrier for i in bodies]
        rows_of = {
            name: [k for k, mover in enumerate(movers) if mover == name] for name in dict.fromkeys(movers)
        }
        moving = [(model.mechanisms[name], rows) for name, rows in rows_of.items()]
        others = tuple({above for name in rows_of for above in model.carriers_of(name)} - rows_of.keys())

        def noise(twin: Twin, points: Array) -> Array:
            """Of the fastest point of each body [m/s], shape (..., b)."""
            found = np.zeros(points.shape[:-1])
            for mechanism, rows in moving:
                error = twin.speed_error(mechanism)
                if error is None:
                    continue
                own = tuple(bodies[k] for k in rows)
                at = np.ascontiguousarray(points[..., rows, :])
                J = np.stack([twin.along(own, mechanism, at, axis + 0 * at) for axis in np.eye(3)], axis=-2)
                found[..., rows] = speed_noise(J, error[..., None, :])
            return found

        def compute(twin: Twin) -> Figure:
            fastest = speeds, points, _ = twin.fastest_points(bodies)
            interval = None
            if any(twin.speed_error(mechanism) is not None for mechanism, _ in moving):
                off = noise(twin, points)
                interval = np.maximum(speeds - off, 0.0).max(axis=-1), (speeds + off).max(axis=-1)
            open_ = others_noisy(twin, others)
            most = speeds.max(axis=-1) if twin.many else max(speeds.tolist())
            return Figure(most, self.limit, interval, open=open_, beside=fastest)

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that names the fastest body and draws the velocity."""
        point, offset = None if self.at is None else model.frame(self.at), np.array(self.offset)
        bodies = () if point is not None else self._bodies(model)

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            speed, where = figure.number, ""
            if point is not None:
                place, v = state.drawn_point(point, offset), figure.beside
            else:
                speeds, points, velocities = figure.beside
                k = int(speeds.argmax())
                where, v = model.bodies[bodies[k]].name, velocities[k]
                place = partial(points.__getitem__, k)
            if verdict is Verdict.UNDECIDED:
                where = f"{where}: {NOISE}".removeprefix(": ")

            return Shown(where, partial(_arrow, self, place, v, speed, verdict))

        return present

    def planned(self, model: Model) -> Callable[[Sequence[Any], Model], Together] | None:
        """Return what computes speeds together: of sets, and of points that the robot alone moves."""
        robot = None if self.at is None else model.carrier(model.frame(self.at))
        return _Speeds if robot is None or (robot.alone and commanded(robot)) else None

    def one_by_one(self, model: Model) -> str:
        """Say so of a point whose robot is carried by something that moves."""
        alone = self.at is None or model.carrier(model.frame(self.at)).alone
        return "" if alone else "something that moves carries the robot"

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound how much faster the bodies or the point can be between two instants."""
        if self.at is None:
            return speeding(self._bodies(model))
        frame = model.frame(self.at)
        local = frame.body_from_frame[:3, :3] @ np.array(self.offset) + frame.body_from_frame[:3, 3]
        return speeding([points.add(frame.mj, local)])

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


class _Speeds:
    """Speeds of points and of sets of bodies at one instant, of a tick's plan."""

    intervals = False
    _place: Callable[[Frame, Array], Array]

    def __init__(self, criteria: Sequence[Velocity], model: Model) -> None:
        self._criteria, self._names = criteria, [body.name for body in model.bodies]
        self._at = dict[int, tuple[Frame, Array]]()
        """Of a point its place, by which of the criteria it is."""
        points = list[Point]()
        self._sets, bodies = dict[int, slice](), list[int]()
        """Of a set, likewise: its rows among the bodies of all sets."""
        for k, each in enumerate(criteria):
            if each.at is not None:
                frame = model.frame(each.at)
                self._at[k] = frame, np.array(each.offset)
                points.append(Point(frame, model.carrier(frame), each.offset))
                continue
            own = each._bodies(model)
            self._sets[k] = slice(len(bodies), len(bodies) + len(own))
            bodies += own
        self._bodies, self._asked = tuple(bodies), tuple(points)
        self._found: list[tuple[Array, int]] = [(np.zeros(3), 0)] * len(criteria)
        """Velocity of each, and of a set the row of the fastest body."""
        self._points = np.zeros((0, 3))

    def compute(self, state: State, rows: Rows) -> None:
        """Write the speed of every point, and of every set that of its fastest point."""
        self._place = state.drawn_points()
        speeds, found = [0.0] * len(self._found), self._found
        if self._asked:
            moved, at = state.moving(self._asked)
            for k, row in zip(self._at, at, strict=True):
                v = moved.velocity[row, :3]
                speeds[k], found[k] = float(length(v)), (v, 0)
        if self._sets:
            every, self._points, velocities = state.fastest_points(self._bodies)
            for k, own in self._sets.items():
                row = own.start + int(every[own].argmax())
                speeds[k], found[k] = every.item(row), (velocities[row], row)
        rows.value[:] = speeds

    def present(
        self, state: State, k: int, value: float, verdict: Verdict | None
    ) -> tuple[str, Draw, tuple[Result, ...]]:
        """Say and draw what `Velocity.present` does of one that is decided."""
        v, row = self._found[k]
        at = self._at.get(k)
        if at is None:
            place = partial(self._points.__getitem__, row)
            where = self._names[self._bodies[row]]
        else:
            place, where = partial(self._place, *at), ""
        return where, partial(_arrow, self._criteria[k], place, v, value, verdict), ()


def _arrow(
    of: Velocity, place: Callable[[], Array], v: Array, speed: float, verdict: Verdict | None
) -> tuple[Arrow, ...]:
    label = figures.worded(speed, of.limit, of.unit, at_most=True)
    origin, vector = tuple(place().tolist()), tuple((DRAWN * v).tolist())
    return (Arrow(origin=origin, vector=vector, label=label, verdict=verdict),)
