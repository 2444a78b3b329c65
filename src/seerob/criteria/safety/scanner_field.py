"""What a laser scanner sees of whoever is in one of its fields, beam by beam, against the exact scene."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Annotated, cast

import numpy as np
from msgspec import Meta, Struct
from numpy.typing import NDArray

from seerob.core import figures, markers
from seerob.core.errors import InputError, Undecided
from seerob.core.shapes import contains
from seerob.core.snapshot import Basis, Result
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.figure import Figure, Shown, Twin
from seerob.criteria.sensors.sensing import (
    InField,
    Names,
    Presence,
    Seen,
    Sight,
    bodies_of,
    carriers_of,
    names_of,
    others,
    sensor_of,
)
from seerob.distance.scan import Coverage, Rays, beam_angles, directions, met_beside, outline, spans
from seerob.model.model import Model
from seerob.twin.state import State
from seerob.twin.states import States
from seerob.workstation.tables.sensors import MonitoredField as Field
from seerob.workstation.tables.sensors import Sensor

FINER = 64
"""Beams that a body's seen width is measured with."""
_Placed = tuple[Array, Array]
"""Rotations and positions [m] of all bodies."""
_Beams = tuple[Array, NDArray[np.int64]]
"""How far each beam gets [m], and the body that it meets (-1: none)."""


class ScannerField(InField, frozen=True, kw_only=True):
    """Whether a laser scanner's field is entered, by which body, and whether the scanner sees it."""

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

    def device(self, model: Model) -> _Scan:
        """Look up every name in the model once."""
        sensor = sensor_of(model, self.sensor, "laser_scanner")
        try:
            chosen = sensor.field(self.field)
        except ValueError as error:
            raise InputError.at(self.name, "field", str(error)) from None
        return _Scan(model, sensor, chosen, bodies_of(model, self.of), self.redraw)

    def depends(self, model: Model) -> tuple[str, ...]:
        """Whoever may stand in a beam."""
        return (*self.subjects(), *model.mechanisms)

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        scan = self.device(model)
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
        self.background: _Beams | None = None
        self.drawn: tuple[float, Verdict | None, Callable[[], markers.Rays]] | None = None
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

    def cast(self, placed: _Placed, beams: Array, before: _Beams | None = None) -> _Beams:
        """How far beams get [m], and the body each meets (-1: none).

        Args:
            placed: Where everybody is, at one instant.
            beams: Their directions in the scanner's plane, shape (n, 3).
            before: The same against what stands still, where that is known.
        """
        distance, met = self._against(self.still, placed, beams) if before is None else before
        return self._against(self.moving, placed, beams, (distance.copy(), met.copy()))

    def _against(self, rays: Rays, placed: _Placed, beams: Array, before: _Beams | None = None) -> _Beams:
        rotations, positions = placed
        u = beams @ rotations[self.plane].T
        origins = np.empty_like(u)
        origins[:] = positions[self.plane]
        distance, met = before or (np.full(len(u), self.scanner.range), np.full(len(u), -1, np.int64))
        rays.cast(rotations, positions, origins, u, distance, met)
        return distance, met

    def compute(self, twin: Twin) -> Figure:
        twin.require(*self.carriers)
        placed = twin.placed(self.concerned)
        if twin.many:
            return self._of_many(cast("States", twin), placed)
        background = self._background(placed)
        distance, met = self.cast(placed, self.beams, background)
        # The last one is for beams that meet nothing, -1.
        hit = self.watched[met]
        hit[hit] = contains(self.chosen.corners, self.beams[hit, :2] * distance[hit, None])
        seen = set(met[hit].tolist())
        found = twin.closest_per_body(self.presence.gap)
        inside = self.presence.inside(found)
        sights = {
            i: self._seen(placed, i, found.point_b[k], np.flatnonzero(hit & (met == i)), distance)
            for k, i in enumerate(self.presence.bodies)
            if i in inside or i in seen
        }
        alone = np.array_equal(distance, background[0])
        now = self.blind if alone else self.coverage.blind(distance)
        R, x = placed[0][self.plane], placed[1][self.plane]
        view = _View(distance, hit, R.copy(), x.copy(), self.blind, now)
        return self.presence.of_one(
            cast("State", twin), found, sights, undecided_reasons=self.undecided_reasons, more=view
        )

    def _of_many(self, states: States, placed: _Placed) -> Figure:
        """Who is in the field is seen or should be: rays say nothing of it."""
        if self.fixed:
            self._background((placed[0][0], placed[1][0]))
        else:
            # What stands about a scanner that is carried may be about it at some instants only.
            each = (self._against(self.still, one, self.beams) for one in zip(*placed, strict=True))
            states.alone = states.alone | np.array([not distance.any() for distance, _ in each])
        found = states.closest_per_body(self.presence.gap)
        return self.presence.of_many(
            states, found, open=bool(self.undecided_reasons), beside=met_beside(self.scanner.range)
        )

    def _background(self, placed: _Placed) -> _Beams:
        """Against what stands still."""
        if self.background is not None and self.fixed:
            return self.background
        distance, met = self._against(self.still, placed, self.beams)
        if not distance.any():
            what = self.model.bodies[int(met[0])].name
            raise Undecided(f"{self.sensor.name} is inside {what}: name it in its ignores, or move it")
        self.blind = self.coverage.blind(distance)
        self.background = distance, met
        return distance, met

    def _seen(
        self, placed: _Placed, body: int, nearest: Array, beams: NDArray[np.int64], distance: Array
    ) -> Sight:
        """What the scanner makes of a body of which some beams, or none, end on it inside the field.

        Args:
            placed: Where everybody is.
            body: By index.
            nearest: Its point nearest to the field, in the world [m], shape (3,).
            beams: Those that end on it.
            distance: How far all beams get [m].
        """
        if not len(beams):
            return Sight(Seen.MISSED, self._hidden(placed, body, nearest))
        capability = self.sensor.capability
        width = self._width(placed, body, beams)
        limit = None if capability is None else capability * 1e3
        shown = figures.against(width * 1e3, limit, "mm", at_most=False)
        where = f"{shown.value} mm wide at {distance[beams].min():.2f} m"
        if capability is None:
            return Sight(Seen.MAYBE, f"{where}, detection capability not given")
        if width < capability:
            return Sight(Seen.MAYBE, f"{where}, detection capability {shown.limit} mm")
        return Sight(Seen.DETECTED, where)

    def _width(self, placed: _Placed, body: int, beams: NDArray[np.int64]) -> float:
        """Extent of what is seen of a body, between finer beams that still end on it [m]."""
        step = self.scanner.resolution
        low, high = self.angles[beams[0]] - step, self.angles[beams[-1]] + step
        finer = directions(np.linspace(low, high, FINER))
        distance, met = self.cast(placed, finer)
        on = np.flatnonzero(met == body)
        if not len(on):
            return 0.0
        ends = finer[on] * distance[on, None]
        return float(np.linalg.norm(ends - ends[0], axis=1).max())

    def _hidden(self, placed: _Placed, body: int, nearest: Array) -> str:
        """Why no beam ends on a body that is in the field."""
        at = placed[0][self.plane].T @ (nearest - placed[1][self.plane])
        angle = float(np.arctan2(at[1], at[0]))
        if not self.angles[0] - 1e-9 <= angle <= self.angles[-1] + 1e-9:
            return "outside the angle that is scanned"
        far = float(np.hypot(at[0], at[1]))
        distance, met = self.cast(placed, directions(np.array([angle])))
        blocker = int(met[0])
        if blocker >= 0 and blocker != body and distance[0] <= far:
            return f"in the shadow of {self.model.bodies[blocker].name}"
        return "between two beams" if far <= self.scanner.range else "beyond the range"

    def shown(self, state: State, figure: Figure, verdict: Verdict | None) -> Shown:
        view: _View = figure.beside.more
        whole = f"of {self.coverage.whole:.3g} m², behind what stands still"
        parts = (
            Result(name="blind area", value=view.blind, unit="m²", reason=whole),
            Result(name="blind area now", value=view.blind_now, unit="m²"),
        )
        drawn = self.drawn
        stale = drawn is None or not 0 <= state.t - drawn[0] < self.redraw
        if drawn is None or stale or not self.fixed or drawn[1] is not verdict:
            # Made once, by whoever looks first.
            drawn = self.drawn = state.t, verdict, cache(partial(self._fan, view, verdict))
        fan = drawn[2]
        return self.presence.shown(state, figure, verdict, parts=parts, also=lambda: (fan(),))

    def _fan(self, view: _View, verdict: Verdict | None) -> markers.Rays:
        ends, beams = outline(self.spans, view.distance, self.angles)
        return markers.Rays(
            starts=(_rounded(view.position),),
            ends=tuple(map(_rounded, ends @ view.rotation.T + view.position)),
            hits=tuple(np.flatnonzero(view.hit[beams]).tolist()),
            filled=True,
            label=self.chosen.name,
            verdict=verdict,
        )


class _View(Struct, frozen=True, eq=False):
    """What the scanner sees at an instant."""

    distance: Array
    """How far each beam gets [m]."""
    hit: NDArray[np.bool_]
    """Which end in the field on who may not be there."""
    rotation: Array
    """World from the scanner's plane."""
    position: Array
    """Of the scanner, in the world [m]."""
    blind: float
    """Area of the field behind what stands still [m²]."""
    blind_now: float
    """Area of the field that no beam reaches [m²]."""


def _rounded(point: Array) -> tuple[float, float, float]:
    x, y, z = point.round(3).tolist()
    return x, y, z
