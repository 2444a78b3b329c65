"""Whether a real protective device says what the twin sees in its field."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, cast

from msgspec import Meta

from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Basis, Input, Origin
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.sensors.sensing import Names, bodies_of, names_of
from seerob.model import provenance
from seerob.model.model import Model
from seerob.twin.spans import Fall, Falls, Points
from seerob.twin.state import State


class SensorAgreement(Criterion, frozen=True, kw_only=True):
    """How long a real device and the twin have disagreed about whether somebody is in its field."""

    unit: ClassVar[str] = "s"
    variable: str
    """Variable of the dictionary, a bool, that the device tells."""
    field: str
    """Its field in the twin: an entry of ``[[areas]]`` or ``[[sensors]]``, or ``scanner/field``."""
    of: Names
    """Who may be in it: a human, or a list of names."""
    free: bool = True
    """What the variable is while nobody is in the field."""
    limit: Annotated[float, Meta(ge=0, extra={"unit": "s"})]
    """Longest admissible disagreement [s]: the device's response, the network's delay, and its resets."""

    def subjects(self) -> tuple[str, ...]:
        """The device and who may be in its field."""
        return self.field, *names_of(self.of)

    def variables(self) -> dict[str, str]:
        """The variable, and what it must be."""
        return {**Criterion.variables(self), self.variable: "bool"}

    def _field(self, model: Model) -> int:
        known = {body.name: body.index for body in model.bodies if body.role == "area"}
        if self.field not in known:
            raise UnknownName("area or field of a sensor", self.field, known)
        return known[self.field]

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that measures a disagreement."""
        bodies = bodies_of(model, self.of)
        if not bodies:
            raise InputError.at(self.name, "of", "nothing in it has a shape", "name who may enter the field")
        gap = model.gap((self._field(model),), bodies)
        since: float | None = None
        last: float | None = None

        def compute(twin: Twin) -> Figure:
            nonlocal since, last
            state = cast("State", twin)
            if last is not None and state.t < last:
                since = None
            last = state.t
            device_sees = bool(state.signal(self.variable)) == self.free
            seen = state.closest(gap).distance > 0
            if device_sees == seen:
                since = None
            elif since is None:
                since = state.t
            lasted = 0.0 if since is None else state.t - since
            return Figure(lasted, self.limit, beside=(device_sees, seen))

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says what the device and the twin say."""

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            device_sees, seen = figure.beside
            words = {True: "free", False: "interrupted"}
            if device_sees == seen:
                return Shown()
            return Shown(f"the device says {words[device_sees]}, the twin {words[bool(seen)]}")

        return present

    def remembers(self, model: Model) -> bool:
        """Say whether the result depends on earlier instants, so that it is asked in the order of time."""
        return True

    def falls(self, model: Model, points: Points) -> Falls:
        """Return the bound between instants: a disagreement lasts as long as the span at most."""
        return lambda span, least: Fall(math.inf, span.T)

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        gap = model.gap((self._field(model),), bodies_of(model, self.of))
        variable = model.dictionary[self.variable]
        source = f"{variable.source}: {variable.address}"
        return Basis(
            formula="time since the device's output and (distance to the field > 0) were last the same",
            source="comparison of a signal with the twin; no standard",
            inputs=(
                Input(name=f"variable {self.variable}", origin=Origin.MEASURED, source=source),
                *provenance.motion(model, *gap.carriers),
                *provenance.shapes(gap),
                *provenance.limit(self.limit, "s"),
            ),
            not_modelled=(
                "beams, detection capability and blanking: the field is a body here",
                "what else than these bodies interrupts the device",
            ),
        )
