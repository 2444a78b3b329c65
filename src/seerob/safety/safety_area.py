"""Intrusion into a safety area, [Weistroffer2022]_ section 2.2.2.7."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from seerob import provenance
from seerob.criterion import Criterion, Evaluate
from seerob.errors import UnknownName
from seerob.model import Model
from seerob.snapshot import Basis, Highlight, Result, Verdict
from seerob.state import State


class SafetyArea(Criterion, frozen=True, kw_only=True):
    """Whether anything of a set is inside a safety area, which bodies, and how deep at least."""

    unit: ClassVar[str] = "m"
    at_most: ClassVar[bool] = False

    area: str
    """An entry of ``[[areas]]``."""
    of: str
    """What must stay outside: a robot, a human, a tool or a part."""

    def subjects(self) -> tuple[str, ...]:
        """The area and what must stay outside."""
        return self.area, self.of

    def bind(self, model: Model) -> Evaluate:
        """See `Criterion.bind`."""
        areas = {body.owner for body in model.bodies if body.role == "area"}
        if self.area not in areas:
            raise UnknownName("area", self.area, areas)
        gap = model.gap(model.select(self.area), model.select(self.of))

        def evaluate(state: State) -> Result:
            found = state.closest_per_body(gap)
            nearest = int(found.distance.argmin())
            inside = np.flatnonzero(found.distance <= 0)
            # The real surface may stick out of the shape: nearly inside is not outside.
            close = found.distance[nearest] - gap.deviation <= 0
            verdict = Verdict.EXCEEDED if len(inside) else Verdict.UNDECIDED if close else Verdict.WITHIN
            names = [model.bodies[gap.b[i]].name for i in inside]
            parts = tuple(
                Result(
                    name=name,
                    value=float(found.distance[i]),
                    unit="m",
                    limit=0.0,
                    at_most=False,
                    verdict=Verdict.EXCEEDED,
                )
                for i, name in zip(inside, names, strict=True)
            )
            reason = ", ".join(names) if names else model.bodies[gap.b[nearest]].name
            if verdict is Verdict.UNDECIDED:
                reason += f" is within {gap.deviation * 1e3:.1f} mm, what its shape may be off by"
            return Result(
                name=self.name,
                value=float(found.distance[nearest]),
                unit=self.unit,
                limit=0.0,
                at_most=False,
                verdict=verdict,
                reason=reason,
                parts=parts,
                markers=tuple(Highlight(body=name, verdict=verdict) for name in (self.area, *names)),
            )

        return evaluate

    def basis(self, model: Model) -> Basis:
        """See `Criterion.basis`."""
        gap = model.gap(model.select(self.area), model.select(self.of))
        return Basis(
            formula="least distance of each body to the area; 0 or less is inside, at least that deep",
            source="Weistroffer et al. 2022, section 2.2.2.7",
            inputs=provenance.motion(model, *gap.carriers) + provenance.shapes(gap),
            not_modelled=("the sensor that would watch the area: its resolution and response time",),
        )
