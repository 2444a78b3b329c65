"""Who stands on a pressure-sensitive mat, or in the field of any device that senses presence there."""

from __future__ import annotations

from typing import ClassVar, cast

from seerob.core.snapshot import Basis
from seerob.criteria.criterion import Criterion, Evaluate
from seerob.criteria.figure import Compute, Figure, Present, Twin
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
from seerob.twin.states import States


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
        """Return the function that judges one instant: of who is partly seen, what is seen first."""
        presence = self._presence(model)
        return seen_in_field(self, presence, _on(presence), presence.shown)

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes distances to the mat."""
        return _on(self._presence(model))

    def present(self, model: Model) -> Present:
        """Return the function that says who is on the mat, and how far they walked on it."""
        return self._presence(model).shown

    def one_by_one(self, model: Model) -> str:
        """Many instants are computed together."""
        return ""

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


def _on(presence: Presence) -> Compute:
    def compute(twin: Twin) -> Figure:
        found = twin.closest_per_body(presence.gap)
        if twin.many:
            return presence.of_many(cast("States", twin), found)
        sights = dict.fromkeys(presence.inside(found), Sight(Seen.DETECTED))
        return presence.of_one(cast("State", twin), found, sights)

    return compute
