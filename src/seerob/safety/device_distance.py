r"""Whether a protective device stands far enough from the hazard: ISO 13855 with the device's own figures.

.. math:: S = K\,(t_1 + t_2) + C \;(2010), \qquad S = K\,(t_1 + t_2) + D_{DS} + Z \;(2024)

with :math:`t_1` the response time of the device and :math:`t_2` the time from its output to the end of the
hazard. See `seerob.norms.iso_13855` for the editions and how sure their figures are.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from seerob import provenance
from seerob.criterion import Criterion, Evaluate, judge
from seerob.errors import InputError, Undecided, UnknownName
from seerob.floor_polygon import contains, distance_between, signed_area
from seerob.model import Model
from seerob.norms import iso_13855
from seerob.norms.iso_13855 import Approach, Edition
from seerob.sensing import Names, bodies_of, carriers_of, names_of
from seerob.sensor_tables import Sensor
from seerob.snapshot import Basis, Input, Origin, Result, Segment, Verdict
from seerob.state import State
from seerob.transforms import Array

LEVEL = 1e-3
"""Tilt below which a field lies along the floor [rad]."""

_m = Meta(ge=0, extra={"unit": "m"})


class DeviceDistance(Criterion, frozen=True, kw_only=True):
    """Distance of a hazard from the border of a protective device, against ISO 13855."""

    unit: ClassVar[str] = "m"
    at_most: ClassVar[bool] = False

    sensor: str
    """An entry of ``[[sensors]]``."""
    hazard: Names
    """What is dangerous: a robot with all it carries, or a list of names."""
    stopping: Annotated[float, Meta(gt=0, extra={"unit": "s"})]
    """From the switched output of the device to the end of the hazard [s]: signals, brakes, standstill."""
    field: str | None = None
    """Which field of a scanner; needed when it has several."""
    edges: tuple[Annotated[int, Meta(ge=0)], ...] | None = None
    """Edges of the field's polygon that a person can come across (0 begins at the first corner); all of them
    when not given."""
    approach: Literal["orthogonal", "parallel"] | None = None
    """Across the field, or along it over the floor; by the kind of device when not given."""
    edition: Literal["2010", "2024"] = "2024"
    """Of ISO 13855."""
    reach_over: Annotated[float, _m] | None = None
    """C_RO (D_DO) for reaching over the field, from the norm's table [m]; 0 where it is excluded."""
    reach_under: Annotated[float, _m] | None = None
    """D_DU for reaching or crawling under the field [m]; 0 where it is excluded."""
    supplement: Annotated[float, _m] | None = None
    """Z of the 2024 edition [m]."""

    def subjects(self) -> tuple[str, ...]:
        """The device and the hazard."""
        return self.sensor, *names_of(self.hazard)

    def _device(self, model: Model) -> tuple[Sensor, int, tuple[tuple[float, float], ...] | None]:
        """Sensor, body of its field, and its polygon (none for a curtain)."""
        sensors = {s.name: s for s in model.workstation.sensors}
        if self.sensor not in sensors:
            raise UnknownName("sensor", self.sensor, sensors)
        sensor = sensors[self.sensor]
        corners = sensor.pressure_mat.corners if sensor.pressure_mat is not None else None
        name = sensor.name
        if sensor.laser_scanner is not None:
            try:
                chosen = sensor.field(self.field)
            except ValueError as error:
                raise InputError.at(self.name, "field", str(error)) from None
            corners, name = chosen.corners, f"{sensor.name}/{chosen.name}"
        elif self.field is not None:
            raise InputError.at(self.name, "field", f"{sensor.name} has one field only", "leave it out")
        if self.edges is not None and (corners is None or not self.edges or max(self.edges) >= len(corners)):
            right = "a curtain has none" if corners is None else f"numbers from 0 to {len(corners) - 1}"
            raise InputError.at(self.name, "edges", f"{list(self.edges)} are no edges of the field", right)
        return sensor, next(b.index for b in model.bodies if b.name == name), corners

    def bind(self, model: Model) -> Evaluate:
        """See `Criterion.bind`."""
        sensor, plane, corners = self._device(model)
        hazard = bodies_of(model, self.hazard)
        carriers = carriers_of(model, (*hazard, plane))
        gap = model.gap((plane,), hazard) if corners is None else None
        ring = None if corners is None else np.asarray(corners, float)

        def evaluate(state: State) -> Result:
            state.require(*carriers)
            S = self._required(sensor, state, plane)
            if gap is not None:
                found = state.closest(gap)
                value, who = found.distance, model.bodies[found.body_b].name
                ends = found.point_a, found.point_b
            else:
                assert ring is not None
                value, body, ends = self._to_border(model, state, plane, ring, hazard)
                who = model.bodies[body].name
            deviation = max(model.bodies[i].deviation for i in hazard)
            verdict = judge(value - deviation, S, at_most=False)
            if verdict is not judge(value, S, at_most=False):
                verdict = Verdict.UNDECIDED
            line = Segment(
                start=tuple(ends[0].tolist()),
                end=tuple(ends[1].tolist()),
                label=f"{value:.2f} m, S {S:.2f} m",
                verdict=verdict,
            )
            return Result(
                name=self.name,
                value=value,
                unit="m",
                limit=S,
                at_most=False,
                verdict=verdict,
                reason=who,
                interval=(value - deviation, value) if deviation else None,
                markers=(line,),
            )

        return evaluate

    def _way(self, sensor: Sensor) -> Approach:
        if self.approach is not None:
            return Approach(self.approach)
        return Approach.ORTHOGONAL if sensor.light_curtain is not None else Approach.PARALLEL

    def _required(self, sensor: Sensor, state: State, plane: int) -> float:
        """S [m]; raises Undecided where something it needs is not known."""
        if sensor.response is None:
            raise Undecided(f"{sensor.name}: its response time is not given")
        way = self._way(sensor)
        height = None
        if way is Approach.PARALLEL:
            if state.rotations[plane, 2, 2] < np.cos(LEVEL):
                raise Undecided(f"{sensor.name}: its field is not level, so it has no height above the floor")
            height = float(state.positions[plane, 2])
        try:
            return iso_13855.minimum_distance(
                way,
                Edition(self.edition),
                sensor.response + self.stopping,
                capability=sensor.capability if sensor.pressure_mat is None else None,
                height=height,
                over=self.reach_over,
                under=self.reach_under,
                supplement=self.supplement,
            ).distance
        except InputError as error:
            raise Undecided(str(error)) from None

    def _to_border(
        self, model: Model, state: State, plane: int, ring: Array, hazard: tuple[int, ...]
    ) -> tuple[float, int, tuple[Array, Array]]:
        """Least distance in the field's plane from a hazard inside it to its border; not above 0 outside."""
        R, x = state.rotations[plane], state.positions[plane]
        best: tuple[float, int, tuple[Array, Array]] | None = None
        edges = np.arange(len(ring)) if self.edges is None else np.array(self.edges)
        for i in hazard:
            body = model.bodies[i]
            corners = body.corners @ state.rotations[i].T + state.positions[i]
            flat = _hull(((corners - x) @ R)[:, :2])
            distance, a, b = distance_between(flat, ring, edges)
            outside = self.edges is None and not contains(ring, flat).all()
            value = -distance if outside or self._beyond(ring, edges, a) else distance
            value -= body.radius
            if best is None or value < best[0]:
                level = float(corners[:, 2].min())
                ends = tuple(np.array([*((R @ [*p, 0.0]) + x)[:2], level]) for p in (b, a))
                best = value, i, (ends[0], ends[1])
        assert best is not None
        return best

    @staticmethod
    def _beyond(ring: Array, edges: NDArray[np.int64], point: Array) -> bool:
        """Whether a point lies on the outer side of the edge that it is nearest to."""
        a, b = ring[edges], np.roll(ring, -1, axis=0)[edges]
        e, r = b - a, point - a
        share = np.clip((r * e).sum(axis=1) / (e * e).sum(axis=1), 0.0, 1.0)
        k = int(np.linalg.norm(r - share[:, None] * e, axis=1).argmin())
        left = e[k, 0] * r[k, 1] - e[k, 1] * r[k, 0]
        return bool(left * np.sign(signed_area([(float(x), float(y)) for x, y in ring])) < 0)

    def basis(self, model: Model) -> Basis:
        """See `Criterion.basis`."""
        sensor, plane, _ = self._device(model)
        hazard = bodies_of(model, self.hazard)
        way = self._way(sensor)
        source = f"ISO 13855:{self.edition}, from public sources; no licensed text was opened"
        inputs: list[Input] = [*provenance.motion(model, *carriers_of(model, (*hazard, plane)))]
        for name, value, unit in (
            ("response time t_1", sensor.response, "s"),
            ("detection capability", sensor.capability, "m"),
            ("reach over", self.reach_over, "m"),
            ("reach under", self.reach_under, "m"),
            ("Z", self.supplement, "m"),
        ):
            if value is None:
                inputs.append(Input(name=name, unit=unit, origin=Origin.MISSING))
            else:
                inputs.append(provenance.given(name, value, unit))
        inputs.append(provenance.given("stopping time t_2", self.stopping, "s"))
        return Basis(
            formula=f"S = K (t_1 + t_2) + {'C' if self.edition == '2010' else 'D_DS + Z'}, {way} approach; "
            "the distance must not fall below it",
            source=source,
            inputs=tuple(inputs),
            not_modelled=(
                "ways around the device",
                "a hazard that lasts longer than the stopping time, such as what falls or runs on",
                *(("edges that are left out, which other measures must guard",) if self.edges else ()),
            ),
        )


def _hull(points: Array) -> Array:
    """Corners of the convex hull of points in the plane, in order, shape (k, 2)."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        return points
