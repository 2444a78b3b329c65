"""What a light curtain sees of whoever reaches or steps through it, beam by beam."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import numpy as np
from numpy.typing import NDArray

from seerob.core import figures
from seerob.core.snapshot import Basis, Marker, Segment, Verdict
from seerob.core.transforms import Array
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
from seerob.distance.scan import Rays, met_beside
from seerob.model.model import Model
from seerob.twin.state import State
from seerob.twin.states import States
from seerob.workstation.tables.sensors import Sensor

FINER = 16
"""Times as many beams measure the height of what interrupts them."""
MOST_DRAWN = 60


class LightCurtain(InField, frozen=True, kw_only=True):
    """Whether a light curtain is interrupted, by which body, and whether one reaches through unseen."""

    sensor: str
    """An entry of ``[[sensors]]`` that is a light curtain."""
    of: Names
    """Who may reach through: a human, or a list of names."""

    def subjects(self) -> tuple[str, ...]:
        """The curtain and who may reach through."""
        return self.sensor, *names_of(self.of)

    def device(self, model: Model) -> _Curtain:
        """Look up every name in the model once."""
        return _Curtain(model, sensor_of(model, self.sensor, "light_curtain"), bodies_of(model, self.of))

    def depends(self, model: Model) -> tuple[str, ...]:
        """Whoever may stand in a beam."""
        return (*self.subjects(), *model.mechanisms)

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        curtain = self.device(model)
        return Basis(
            formula=f"{len(curtain.heights)} beams, {curtain.pitch * 1e3:.1f} mm apart; detected when what "
            "interrupts them is not lower than the detection capability",
            source="geometry of the beams; figures of the device from its data sheet",
            inputs=curtain.presence.inputs(),
            not_modelled=(
                "reflecting surfaces beside the beams, blanking and muting",
                "reaching over, under and around the curtain: device_distance asks for it",
            ),
        )


class _Curtain:
    def __init__(self, model: Model, sensor: Sensor, bodies: tuple[int, ...]) -> None:
        assert sensor.light_curtain is not None
        self.model, self.sensor = model, sensor
        self.plane = next(b.index for b in model.bodies if b.name == sensor.name)
        self.presence = Presence(model, sensor, self.plane, bodies)
        curtain = sensor.light_curtain
        self.pitch = curtain.pitch or sensor.capability or curtain.height
        count = int(np.ceil(curtain.height / self.pitch - 1e-9))
        self.heights = np.append(np.arange(count) * self.pitch, curtain.height)
        a, b = (np.array(end) for end in curtain.ends)
        self.start, self.length = a, float(np.linalg.norm(b - a))
        self.along = (b - a) / self.length
        still, moving = others(model, sensor, bodies)
        self.finer = np.linspace(0.0, curtain.height, FINER * (len(self.heights) - 1) + 1)
        self.none = np.full(len(self.heights), -1, np.int64)
        self.beside = met_beside(self.length)
        self.people = Rays(model.shapes, bodies)
        self.rest = Rays(model.shapes, (*still, *moving))
        self.concerned = (self.plane, *bodies, *still, *moving)
        self.carriers = carriers_of(model, (*bodies, *moving, self.plane))

    def cast(self, rays: Rays, rotations: Array, positions: Array, heights: Array) -> NDArray[np.int64]:
        """The body that interrupts each beam at a height above the lowest (-1: none), at one instant."""
        R, x = rotations[self.plane], positions[self.plane]
        starts = (self.start + np.outer(heights, [0.0, 0.0, 1.0])) @ R.T + x
        along = np.broadcast_to(R @ self.along, starts.shape)
        met = np.full(len(heights), -1, np.int64)
        rays.cast(rotations, positions, starts, along, np.full(len(heights), self.length), met)
        return met

    def compute(self, twin: Twin) -> Figure:
        twin.require(*self.carriers)
        found = twin.closest_per_body(self.presence.gap)
        rotations, positions = twin.placed(self.concerned)
        if twin.many:
            each = zip(rotations, positions, strict=True)
            blocked = np.array([(self.cast(self.rest, R, x, self.heights) >= 0).any() for R, x in each])
            return self.presence.of_many(cast("States", twin), found, open=blocked, beside=self.beside)
        # Nobody who is farther from the curtain interrupts a beam.
        near = bool((found.distance <= self.beside).any())
        met = self.cast(self.people, rotations, positions, self.heights) if near else self.none
        sights: dict[int, Sight] = {}
        inside = self.presence.inside(found) if near else []
        # A body behind another one in the same beam interrupts it too: whoever is inside counts.
        for i in self.presence.bodies if near else ():
            if i in inside or (met == i).any():
                alone = Rays(self.model.shapes, (i,))
                beams = self.cast(alone, rotations, positions, self.heights) == i
                on = self.finer[self.cast(alone, rotations, positions, self.finer) == i]
                sights[i] = self._seen(int(beams.sum()), float(np.ptp(on)) if len(on) else 0.0)
        met_first = self.cast(self.rest, rotations, positions, self.heights)
        who, counts = np.unique(met_first[met_first >= 0], return_counts=True)
        undecided_reasons = tuple(
            f"{count} of {len(met_first)} beams are interrupted by {self.model.bodies[i].name}"
            for i, count in zip(who.tolist(), counts.tolist(), strict=True)
        )
        plane = rotations[self.plane].copy(), positions[self.plane].copy()
        more = self.heights[met >= 0][:MOST_DRAWN], *plane
        return self.presence.of_one(
            cast("State", twin), found, sights, undecided_reasons=undecided_reasons, more=more
        )

    def _seen(self, beams: int, height: float) -> Sight:
        capability = self.sensor.capability
        if not beams:
            return Sight(Seen.MISSED, f"between two beams that are {self.pitch * 1e3:.1f} mm apart")
        where = f"{beams} of {len(self.heights)} beams"
        if capability is None:
            return Sight(Seen.MAYBE, f"{where}, detection capability not given")
        # Known to the finer beams: the true height is up to two of their steps more.
        if height < capability - 2 * self.pitch / FINER:
            shown = figures.against(height * 1e3, capability * 1e3, "mm", at_most=False)
            text = f"{where}, {shown.value} mm high, detection capability {shown.limit} mm"
            return Sight(Seen.MAYBE, text)
        return Sight(Seen.DETECTED, where)

    def shown(self, state: State, figure: Figure, verdict: Verdict | None) -> Shown:
        heights, R, x = figure.beside.more

        def beams() -> Iterator[Marker]:
            """The interrupted ones."""
            for height in heights:
                a = R @ (self.start + np.array([0.0, 0.0, height])) + x
                b = a + R @ self.along * self.length
                yield Segment(start=tuple(a.tolist()), end=tuple(b.tolist()), verdict=verdict)

        return self.presence.shown(state, figure, verdict, also=beams)
