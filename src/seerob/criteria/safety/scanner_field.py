"""What a laser scanner sees of whoever is in one of its fields, beam by beam, against the exact scene."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta
from msgspec.structs import replace
from numpy.typing import NDArray

from seerob.core import markers
from seerob.core.errors import InputError, Undecided
from seerob.core.shapes import contains
from seerob.core.snapshot import Basis, Result
from seerob.core.transforms import Array
from seerob.criteria.criterion import Criterion, Evaluate
from seerob.criteria.sensors.sensing import (
    Names,
    Presence,
    Seen,
    Sight,
    bodies_of,
    carriers_of,
    names_of,
    others,
    seen_in_field,
    sensor_of,
)
from seerob.distance.scan import Coverage, Rays, beam_angles, directions, outline, spans
from seerob.model.model import Model
from seerob.twin.spans import Falls, Points
from seerob.twin.state import State
from seerob.workstation.tables.sensors import MonitoredField as Field
from seerob.workstation.tables.sensors import Sensor

FINER = 64
"""Beams that a body's seen width is measured with."""


class ScannerField(Criterion, frozen=True, kw_only=True):
    """Whether a laser scanner's field is entered, by which body, and whether the scanner sees it."""

    unit: ClassVar[str] = "m"
    whole: ClassVar[bool] = False
    at_most: ClassVar[bool] = False

    sensor: str
    """An entry of ``[[sensors]]`` that is a laser scanner."""
    of: Names
    """Who may enter: a human, or a list of names."""
    field: str | None = None
    """Which of its fields; needed when it has several."""
    redraw: Annotated[float, Meta(gt=0, extra={"unit": "s"})] = 0.2
    """Time between two pictures of what it sees [s]; the verdict itself is of every tick."""

    def subjects(self) -> tuple[str, ...]:
        """The scanner and who may enter."""
        return self.sensor, *names_of(self.of)

    def _scan(self, model: Model) -> _Scan:
        sensor = sensor_of(model, self.sensor, "laser_scanner")
        try:
            chosen = sensor.field(self.field)
        except ValueError as error:
            raise InputError.at(self.name, "field", str(error)) from None
        return _Scan(model, sensor, chosen, bodies_of(model, self.of), self.redraw)

    def depends(self, model: Model) -> tuple[str, ...]:
        """Whoever may stand in a beam."""
        return (*self.subjects(), *model.mechanisms)

    def bind(self, model: Model) -> Evaluate:
        """Look up every name in the model once and return the function that judges one instant."""
        scan = self._scan(model)
        return seen_in_field(self.name, scan.presence, lambda state: scan.judge(self.name, state))

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound how far a body can move into the field between two instants at which this is asked."""
        return self._scan(model).presence.falls()

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        scan = self._scan(model)
        return Basis(
            formula="first point that each beam meets; in the field where it lies inside the polygon; "
            "detected when the width that the beams see is not below the detection capability",
            source="geometry of the beams; figures of the device from its data sheet",
            inputs=scan.presence.inputs(),
            not_modelled=(
                "reflectance, dirt, glass, sunlight and mutual interference",
                "thickness of the beam and of the plane, and its tilt by mounting tolerances",
                "what stands still inside the field would switch a real scanner for good: here the field "
                "ends at it",
            ),
        )


class _Scan:
    def __init__(
        self, model: Model, sensor: Sensor, chosen: Field, bodies: tuple[int, ...], redraw: float
    ) -> None:
        assert sensor.laser_scanner is not None
        self.model, self.sensor, self.chosen, self.redraw = model, sensor, chosen, redraw
        self.scanner = sensor.laser_scanner
        self.plane = next(b.index for b in model.bodies if b.name == f"{sensor.name}/{chosen.name}")
        self.presence = Presence(model, sensor, self.plane, bodies)
        still, moving = others(model, sensor, bodies)
        self.still, self.moving = Rays(model.shapes, still), Rays(model.shapes, (*bodies, *moving))
        self.concerned = (self.plane, *bodies, *still, *moving)
        self.carriers = carriers_of(model, (*bodies, *moving, self.plane))
        self.angles = beam_angles(self.scanner)
        self.beams = directions(self.angles)
        self.spans = spans(chosen, self.angles)
        self.coverage = Coverage(chosen, self.spans, self.scanner.resolution)
        self.watched = np.zeros(len(model.bodies) + 1, bool)
        self.watched[list(bodies)] = True
        self.fixed = not model.bodies[self.plane].carrier
        self.background: tuple[Array, NDArray[np.int64]] | None = None
        self.drawn: tuple[float, markers.Rays] | None = None
        self.blind: float
        farthest = max(float(np.hypot(x, y)) for x, y in chosen.corners)
        self.spacing = farthest * self.scanner.resolution
        capability = sensor.capability
        self.undecided_reasons: tuple[str, ...] = ()
        if capability is None:
            self.undecided_reasons = ("detection capability not given",)
        elif self.spacing > capability:
            what = f"beams are {self.spacing * 1e3:.0f} mm apart at the end of the field"
            self.undecided_reasons = (
                f"{what}, more than the detection capability of {capability * 1e3:.0f} mm",
            )

    def cast(
        self, state: State, beams: Array, before: tuple[Array, NDArray[np.int64]] | None = None
    ) -> tuple[Array, NDArray[np.int64]]:
        """How far beams get [m], and the body each meets (-1: none).

        Args:
            state: The twin.
            beams: Their directions in the scanner's plane, shape (n, 3).
            before: The same against what stands still, where that is known.
        """
        distance, met = self._against(self.still, state, beams) if before is None else before
        return self._against(self.moving, state, beams, (distance.copy(), met.copy()))

    def _against(
        self,
        rays: Rays,
        state: State,
        beams: Array,
        before: tuple[Array, NDArray[np.int64]] | None = None,
    ) -> tuple[Array, NDArray[np.int64]]:
        rotations, positions = state.placed(self.concerned)
        u = beams @ rotations[self.plane].T
        origins = np.empty_like(u)
        origins[:] = positions[self.plane]
        distance, met = before or (np.full(len(u), self.scanner.range), np.full(len(u), -1, np.int64))
        rays.cast(rotations, positions, origins, u, distance, met)
        return distance, met

    def judge(self, name: str, state: State) -> Result:
        state.require(*self.carriers)
        self._look_at_what_stands(state)
        distance, met = self.cast(state, self.beams, self.background)
        # The last one is for beams that meet nothing, -1.
        hit = self.watched[met]
        hit[hit] = contains(self.chosen.corners, self.beams[hit, :2] * distance[hit, None])
        seen = set(met[hit].tolist())
        _, inside = self.presence.inside(state)
        sights = {
            i: self._seen(state, i, np.flatnonzero(hit & (met == i)), distance)
            for k, i in enumerate(self.presence.bodies)
            if inside[k] or i in seen
        }
        assert self.background is not None
        alone = np.array_equal(distance, self.background[0])
        now = self.blind if alone else self.coverage.blind(distance)
        parts = (
            Result(
                name="blind area",
                value=self.blind,
                unit="m²",
                reason=f"of {self.coverage.whole:.3g} m², behind what stands still",
            ),
            Result(name="blind area now", value=now, unit="m²"),
        )
        result = self.presence.result(
            name, state, sights, undecided_reasons=self.undecided_reasons, parts=parts
        )
        return replace(result, markers=(*result.markers, self._picture(state, distance, hit, result)))

    def _look_at_what_stands(self, state: State) -> None:
        if self.background is not None and self.fixed:
            return
        distance, met = self._against(self.still, state, self.beams)
        if not distance.any():
            what = self.model.bodies[int(met[0])].name
            raise Undecided(f"{self.sensor.name} is inside {what}: name it in its ignores, or move it")
        self.background = distance, met
        self.blind = self.coverage.blind(distance)

    def _seen(self, state: State, body: int, beams: NDArray[np.int64], distance: Array) -> Sight:
        """What the scanner makes of a body of which some beams, or none, end on it inside the field."""
        if not len(beams):
            return Sight(Seen.MISSED, self._hidden(state, body))
        capability = self.sensor.capability
        width = self._width(state, body, beams)
        where = f"{width * 1e3:.0f} mm wide at {distance[beams].min():.2f} m"
        if capability is None:
            return Sight(Seen.MAYBE, f"{where}, detection capability not given")
        if width < capability:
            return Sight(Seen.MAYBE, f"{where}, detection capability {capability * 1e3:.0f} mm")
        return Sight(Seen.DETECTED, where)

    def _width(self, state: State, body: int, beams: NDArray[np.int64]) -> float:
        """Extent of what is seen of a body, between finer beams that still end on it [m]."""
        step = self.scanner.resolution
        low, high = self.angles[beams[0]] - step, self.angles[beams[-1]] + step
        finer = directions(np.linspace(low, high, FINER))
        distance, met = self.cast(state, finer)
        on = np.flatnonzero(met == body)
        if not len(on):
            return 0.0
        ends = finer[on] * distance[on, None]
        return float(np.linalg.norm(ends - ends[0], axis=1).max())

    def _hidden(self, state: State, body: int) -> str:
        """Why no beam ends on a body that is in the field."""
        R, x = self._plane(state)
        found, _ = self.presence.inside(state)
        at = R.T @ (found.point_b[self.presence.bodies.index(body)] - x)
        angle = float(np.arctan2(at[1], at[0]))
        if not self.angles[0] - 1e-9 <= angle <= self.angles[-1] + 1e-9:
            return "outside the angle that is scanned"
        far = float(np.hypot(at[0], at[1]))
        distance, met = self.cast(state, directions(np.array([angle])))
        blocker = int(met[0])
        if blocker >= 0 and blocker != body and distance[0] <= far:
            return f"in the shadow of {self.model.bodies[blocker].name}"
        return "between two beams" if far <= self.scanner.range else "beyond the range"

    def _plane(self, state: State) -> tuple[Array, Array]:
        rotations, positions = state.placed(self.concerned)
        return rotations[self.plane], positions[self.plane]

    def _picture(self, state: State, distance: Array, hit: NDArray[np.bool_], result: Result) -> markers.Rays:
        stale = self.drawn is None or not 0 <= state.t - self.drawn[0] < self.redraw
        if self.drawn is None or stale or not self.fixed or self.drawn[1].verdict is not result.verdict:
            R, x = self._plane(state)
            ends, beams = outline(self.spans, distance, self.angles)
            fan = markers.Rays(
                starts=(_rounded(x),),
                ends=tuple(map(_rounded, ends @ R.T + x)),
                hits=tuple(np.flatnonzero(hit[beams]).tolist()),
                filled=True,
                label=self.chosen.name,
                verdict=result.verdict,
            )
            self.drawn = state.t, fan
        return self.drawn[1]


def _rounded(point: Array) -> tuple[float, float, float]:
    x, y, z = point.round(3).tolist()
    return x, y, z
