"""Who stands on a pressure-sensitive mat, or in the field of any device that senses presence there."""

from __future__ import annotations

from typing import ClassVar

from seerob.core.snapshot import Basis, Result
from seerob.criteria.criterion import Criterion, Evaluate
from seerob.criteria.sensors.sensing import (
    Names,
    Presence,
    Seen,
    Sight,
    bodies_of,
    names_of,
    seen_in_field,
    sensor_of,
)
from seerob.model.model import Model
from seerob.twin.spans import Falls, Points
from seerob.twin.state import State


class PressureMat(Criterion, frozen=True, kw_only=True):
    """Whether somebody stands on a pressure-sensitive mat, and how far they walked on it."""

    unit: ClassVar[str] = "m"
    whole: ClassVar[bool] = False
    at_most: ClassVar[bool] = False

    sensor: str
    """An entry of ``[[sensors]]`` that is a pressure-sensitive mat."""
    of: Names
    """Who may step on it: a human, or a list of names."""

    def subjects(self) -> tuple[str, ...]:
        """The mat and who may step on it."""
        return self.sensor, *names_of(self.of)

    def _presence(self, model: Model) -> Presence:
        sensor = sensor_of(model, self.sensor, "pressure_mat")
        mat = next(b.index for b in model.bodies if b.name == sensor.name)
        return Presence(model, sensor, mat, bodies_of(model, self.of))

    def bind(self, model: Model) -> Evaluate:
        """Look up every name in the model once and return the function that judges one instant."""
        presence = self._presence(model)

        def evaluate(state: State) -> Result:
            _, inside = presence.inside(state)
            sights = {i: Sight(Seen.DETECTED) for k, i in enumerate(presence.bodies) if inside[k]}
            return presence.result(self.name, state, sights)

        return seen_in_field(self.name, presence, evaluate)

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound how far a body can move onto the mat between two instants at which this is asked."""
        return self._presence(model).falls()

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        return Basis(
            formula="a body is on the mat when it is inside the prism over its polygon",
            source="geometry; figures of the device from its data sheet",
            inputs=self._presence(model).inputs(),
            not_modelled=(
                "the weight that the mat needs, and how it is spread over the sole",
                "dead edges and joints between mats: leave them out of the corners",
                "stepping or jumping over it",
            ),
        )
