"""Who stands on a pressure-sensitive mat, or in the field of any device that senses presence there."""

from __future__ import annotations

from typing import cast

from seerob.core.snapshot import Basis
from seerob.criteria.figure import Figure, Twin
from seerob.criteria.sensors.sensing import (
    InField,
    Names,
    Presence,
    Seen,
    Sight,
    bodies_of,
    names_of,
    sensor_of,
)
from seerob.model.model import Model
from seerob.twin.state import State
from seerob.twin.states import States


class PressureMat(InField, frozen=True, kw_only=True):
    """Whether somebody stands on a pressure-sensitive mat, and how far they walked on it."""

    sensor: str
    """An entry of ``[[sensors]]`` that is a pressure-sensitive mat."""
    of: Names
    """Who may step on it: a human, or a list of names."""

    def subjects(self) -> tuple[str, ...]:
        """The mat and who may step on it."""
        return self.sensor, *names_of(self.of)

    def device(self, model: Model) -> _Mat:
        """Look up every name in the model once."""
        sensor = sensor_of(model, self.sensor, "pressure_mat")
        mat = next(b.index for b in model.bodies if b.name == sensor.name)
        return _Mat(Presence(model, sensor, mat, bodies_of(model, self.of)))

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        return Basis(
            formula="a body is on the mat when it is inside the prism over its polygon",
            source="geometry; figures of the device from its data sheet",
            inputs=self.device(model).presence.inputs(),
            not_modelled=(
                "the weight that the mat needs, and how it is spread over the sole",
                "dead edges and joints between mats: leave them out of the corners",
                "stepping or jumping over it",
            ),
        )


class _Mat:
    def __init__(self, presence: Presence) -> None:
        self.presence, self.shown = presence, presence.shown

    def compute(self, twin: Twin) -> Figure:
        found = twin.closest_per_body(self.presence.gap)
        if twin.many:
            return self.presence.of_many(cast("States", twin), found)
        sights = dict.fromkeys(self.presence.inside(found), Sight(Seen.DETECTED))
        return self.presence.of_one(cast("State", twin), found, sights)
