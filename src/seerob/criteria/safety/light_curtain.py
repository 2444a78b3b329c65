"""What a light curtain sees of whoever reaches or steps through it, beam by beam."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from seerob.core.snapshot import Basis, Marker, Result, Segment, Verdict
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
from seerob.distance.scan import Rays
from seerob.model.model import Model
from seerob.twin.spans import Falls, Points
from seerob.twin.state import State
from seerob.workstation.tables.sensors import Sensor

FINER = 16
"""Times as many beams measure the height of what interrupts them."""
MOST_DRAWN = 60


class LightCurtain(Criterion, frozen=True, kw_only=True):
    """Whether a light curtain is interrupted, by which body, and whether one reaches through unseen."""

    unit: ClassVar[str] = "m"
    whole: ClassVar[bool] = False
    at_most: ClassVar[bool] = False

    sensor: str
    """An entry of ``[[sensors]]`` that is a light curtain."""
    of: Names
    """Who may reach through: a human, or a list of names."""

    def subjects(self) -> tuple[str, ...]:
        """The curtain and who may reach through."""
        return self.sensor, *names_of(self.of)

    def _curtain(self, model: Model) -> _Curtain:
        return _Curtain(model, sensor_of(model, self.sensor, "light_curtain"), bodies_of(model, self.of))

    def depends(self, model: Model) -> tuple[str, ...]:
        """Whoever may stand in a beam."""
        return (*self.subjects(), *model.mechanisms)

    def bind(self, model: Model) -> Evaluate:
        """Look up every name in the model once and return the function that judges one instant."""
        curtain = self._curtain(model)
        return seen_in_field(self.name, curtain.presence, lambda state: curtain.judge(self.name, state))

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound how far a body can move into the field between two instants at which this is asked."""
        return self._curtain(model).presence.falls()

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        curtain = self._curtain(model)
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
        self.people = Rays(model.shapes, bodies)
        self.rest = Rays(model.shapes, (*still, *moving))
        self.concerned = (self.plane, *bodies, *still, *moving)
        self.carriers = carriers_of(model, (*bodies, *moving, self.plane))

    def cast(self, rays: Rays, state: State, heights: Array) -> NDArray[np.int64]:
        """The body that interrupts each beam at a height above the lowest (-1: none)."""
        rotations, positions = state.placed(self.concerned)
        R, x = rotations[self.plane], positions[self.plane]
        starts = (self.start + np.outer(heights, [0.0, 0.0, 1.0])) @ R.T + x
        along = np.broadcast_to(R @ self.along, starts.shape)
        met = np.full(len(heights), -1, np.int64)
        rays.cast(rotations, positions, starts, along, np.full(len(heights), self.length), met)
        return met

    def judge(self, name: str, state: State) -> Result:
        state.require(*self.carriers)
        _, inside = self.presence.inside(state)
        met = self.cast(self.people, state, self.heights)
        finer = np.linspace(0.0, self.heights[-1], FINER * (len(self.heights) - 1) + 1)
        sights: dict[int, Sight] = {}
        # A body behind another one in the same beam interrupts it too: whoever is inside counts.
        for k, i in enumerate(self.presence.bodies):
            if inside[k] or (met == i).any():
                alone = Rays(self.model.shapes, (i,))
                beams = self.cast(alone, state, self.heights) == i
                on = finer[self.cast(alone, state, finer) == i]
                sights[i] = self._seen(int(beams.sum()), float(np.ptp(on)) if len(on) else 0.0)
        blocked = self.cast(self.rest, state, self.heights)
        found, counts = np.unique(blocked[blocked >= 0], return_counts=True)
        undecided_reasons = tuple(
            f"{count} of {len(blocked)} beams are interrupted by {self.model.bodies[i].name}"
            for i, count in zip(found.tolist(), counts.tolist(), strict=True)
        )
        markers = self._beams(state, met)
        return self.presence.result(name, state, sights, undecided_reasons=undecided_reasons, markers=markers)

    def _seen(self, beams: int, height: float) -> Sight:
        capability = self.sensor.capability
        if not beams:
            return Sight(Seen.MISSED, f"between two beams that are {self.pitch * 1e3:.1f} mm apart")
        where = f"{beams} of {len(self.heights)} beams"
        if capability is None:
            return Sight(Seen.MAYBE, f"{where}, detection capability not given")
        # Known to the finer beams: the true height is up to two of their steps more.
        if height < capability - 2 * self.pitch / FINER:
            text = f"{where}, {height * 1e3:.0f} mm high, detection capability {capability * 1e3:.0f} mm"
            return Sight(Seen.MAYBE, text)
        return Sight(Seen.DETECTED, where)

    def _beams(self, state: State, met: NDArray[np.int64]) -> tuple[Marker, ...]:
        """The interrupted beams."""
        rotations, positions = state.placed(self.concerned)
        R, x = rotations[self.plane], positions[self.plane]
        drawn: list[Marker] = []
        for height in self.heights[met >= 0][:MOST_DRAWN]:
            a = R @ (self.start + np.array([0.0, 0.0, height])) + x
            b = a + R @ self.along * self.length
            drawn.append(Segment(start=tuple(a.tolist()), end=tuple(b.tolist()), verdict=Verdict.EXCEEDED))
        return tuple(drawn)
