r"""Whether a protective device stands far enough from the hazard: ISO 13855 with the device's own figures.

.. math:: S = K\,(t_1 + t_2) + C \;(2010), \qquad S = K\,(t_1 + t_2) + D_{DS} + Z \;(2024)

with :math:`t_1` the response time of the device and :math:`t_2` the time from its output to the end of the
hazard. See `seerob.description.norms.iso_13855` for the editions and how sure their figures are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, ClassVar, Literal, cast

import mujoco
import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.errors import InputError, Undecided, UnknownName
from seerob.core.snapshot import Basis, Input, Origin, Segment
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.sensors.sensing import Names, bodies_of, carriers_of, names_of
from seerob.description.norms import iso_13855
from seerob.description.norms.iso_13855 import Approach, Edition
from seerob.kernels.floor import bodies_to_border
from seerob.kernels.speed import stacked
from seerob.model import provenance
from seerob.model.model import Model
from seerob.twin.spans import Falls, Points, approaching, joints_of
from seerob.twin.state import State
from seerob.workstation.tables.sensors import Sensor

LEVEL = 1e-3
"""Tilt below which a field lies along the floor [rad]."""

STRAIGHT = 1e-9
"""Sine of the angle below which two axes are parallel."""

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
    """Edition of ISO 13855."""
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

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the distance."""
        sensor, plane, corners = self._device(model)
        hazard = bodies_of(model, self.hazard)
        carriers = carriers_of(model, (*hazard, plane))
        gap = model.gap((plane,), hazard) if corners is None else None
        border = None if corners is None else self._border(model, plane, np.asarray(corners, float), hazard)
        deviation = max(model.bodies[i].deviation for i in hazard)

        def compute(twin: Twin) -> Figure:
            state = cast("State", twin)
            state.require(*carriers)
            S = self._required(sensor, state, plane)
            if gap is not None:
                found = state.closest(gap)
                value, who = found.distance, found.body_b
                ends = found.point_a, found.point_b
            else:
                assert border is not None
                value, who, ends = border(state)
            return Figure(value, S, (value - deviation, value), beside=(model.bodies[who].name, ends))

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that names what is nearest, and draws the distance."""

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            who, (start, end) = figure.beside
            value, S = figure.number, float(cast("float", figure.limit))
            start, end = tuple(start.tolist()), tuple(end.tolist())

            def draw() -> tuple[Segment, ...]:
                shown = figures.against(value, S, self.unit, at_most=False)
                label = f"{shown.value} m, S {shown.limit} m"
                return (Segment(start=start, end=end, label=label, verdict=verdict),)

            return Shown(who, draw)

        return present

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
            R, x = state.placed((plane,))
            if R[plane, 2, 2] < np.cos(LEVEL):
                raise Undecided(f"{sensor.name}: its field is not level, so it has no height above the floor")
            height = float(x[plane, 2])
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

    def _border(
        self, model: Model, plane: int, ring: Array, hazard: tuple[int, ...]
    ) -> Callable[[State], tuple[float, int, tuple[Array, Array]]]:
        """Least distance in the field's plane from a hazard inside it to its border; not above 0 outside."""
        edges = np.arange(len(ring)) if self.edges is None else np.array(self.edges, np.int64)
        corners, start = stacked([model.bodies[i].corners for i in hazard])
        radius = np.array([model.bodies[i].radius for i in hazard])
        bodies = np.array(hazard, np.int64)
        concerned = (plane, *hazard)
        ends = np.empty(5)

        def ask(state: State) -> tuple[float, int, tuple[Array, Array]]:
            rotations, positions = state.placed(concerned)
            value, row = bodies_to_border(
                bodies, rotations, positions, corners, start, radius, plane, ring, edges,
                self.edges is None, ends,
            )  # fmt: skip
            R, x = rotations[plane], positions[plane]
            flat = [np.append((R[:, :2] @ p + x)[:2], ends[4]) for p in (ends[0:2], ends[2:4])]
            return value, hazard[row], (flat[0], flat[1])

        return ask

    def falls(self, model: Model, points: Points) -> Falls | None:
        """Bound how much nearer the hazard can come between instants; None for a device that tilts.

        None also where its height changes and S follows that.
        """
        sensor, plane, corners = self._device(model)
        along = self._way(sensor) is Approach.PARALLEL
        if (corners is not None or along) and not _stays_flat(model, plane, level=along):
            return None
        return approaching((plane,), bodies_of(model, self.hazard))

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
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


def _stays_flat(model: Model, plane: int, *, level: bool) -> bool:
    """Whether no joint that moves a field tilts it; nor, where it lies level, changes its height."""
    joints = np.array(joints_of(model.mj, model.bodies[plane].mj), np.int64)
    data = mujoco.MjData(model.mj)
    mujoco.mj_kinematics(model.mj, data)
    normal = data.xmat[model.bodies[plane].mj].reshape(3, 3)[:, 2]
    up = np.array([0.0, 0.0, 1.0])
    turns = model.mj.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE
    tilts = [np.cross(data.xaxis[joints[turns]], axis) for axis in (normal, *((up,) if level else ()))]
    lifts = data.xaxis[joints[~turns]] @ up if level else np.zeros(0)
    return bool(np.all(np.abs(tilts) < STRAIGHT) and np.all(np.abs(lifts) < STRAIGHT))
