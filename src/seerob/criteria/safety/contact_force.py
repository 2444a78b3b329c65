"""The forces with which things press on a person in the twin, against what body regions may take."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, ClassVar

from msgspec import Meta

from seerob.core.snapshot import Basis, Highlight, Input, Origin, Result, Verdict
from seerob.core.verdict import keeps
from seerob.criteria.criterion import Criterion, Evaluate
from seerob.description.humans.skeleton import without_side
from seerob.description.humans.skin import BODY_REGION
from seerob.description.norms import body_limits
from seerob.description.norms.body_limits import BodyLimits, BodyRegion
from seerob.description.norms.limit_inputs import table_input
from seerob.model import provenance
from seerob.model.model import Model
from seerob.twin.state import State

ESTIMATE = "an estimate of the physics, with soft contacts and controllers for muscles: measure it"


def regions_of(bone: str, limits: BodyLimits) -> tuple[BodyRegion, ...]:
    """Regions of a table that a bone belongs to, in front or behind; none of a foot.

    Args:
        bone: With its side.
        limits: The table.
    """
    names = dict.fromkeys(name for name in BODY_REGION[without_side(bone)] if name is not None)
    return tuple(region for name in names if (region := limits.region(name)) is not None)


def pressed(name: str, force: float, area: float | None, regions: tuple[BodyRegion, ...]) -> list[Result]:
    """Force, and with an area pressure, of one bone against the least limit of its regions, quasi-static.

    Never within: an estimate shows what is too much, not what is little enough.

    Args:
        name: Of the results: what presses where.
        force: [N]
        area: Contact area [m²]; None when nobody knows it.
        regions: Of the bone.
    """
    allowed = all(region.permitted for region in regions)
    least = min((region.force.value for region in regions), default=math.inf) if allowed else 0.0
    found = [_against(name, force, "N", least)]
    if area is not None:
        least = min((region.pressure.value for region in regions), default=math.inf) if allowed else 0.0
        found.append(_against(f"{name}, pressure", force / area, "Pa", least))
    return found


def _against(name: str, value: float, unit: str, limit: float) -> Result:
    known = math.isfinite(limit)
    over = not keeps(value, limit)
    return Result(
        name=name,
        value=value,
        unit=unit,
        limit=limit if known else None,
        verdict=Verdict.EXCEEDED if over else None,
        reason="" if known else "in no region of the table",
    )


class ContactForce(Criterion, frozen=True, kw_only=True):
    """Forces of contacts on a person, as the physics calculates them: an estimate, never within."""

    unit: ClassVar[str] = "N"
    whole: ClassVar[bool] = False  # where the twin is stopped is what is asked

    human: str
    """Who is touched."""
    area: Annotated[float, Meta(gt=0, le=1, extra={"unit": "m²"})] | None = None
    """Contact area that each force is spread over, for the pressure [m²]; no pressure without it."""
    limits: str | None = None
    """Own table of limits instead of the one that ships, from the folder of the workstation file."""

    def subjects(self) -> tuple[str, ...]:
        """The person."""
        return (self.human,)

    def _table(self, model: Model) -> BodyLimits:
        own = self.limits
        return body_limits.shipped() if own is None else body_limits.read(Path(model.folder, own))

    def bind(self, model: Model) -> Evaluate:
        """Look up every name in the model once and return the function that judges one instant."""
        person, table = model.human(self.human), self._table(model)
        bodies = {i: model.bodies[i].name for i in person.bodies}
        regions = {i: regions_of(name.removeprefix(f"{self.human}/"), table) for i, name in bodies.items()}

        def evaluate(state: State) -> Result:
            found = state.contact_forces(self.human)
            parts: list[Result] = []
            lit = []
            for i, (force, other) in found.items():
                own = pressed(f"{other} on {bodies[i]}", force, self.area, regions[i])
                parts += own
                over = any(part.verdict is Verdict.EXCEEDED for part in own)
                lit.append(Highlight(body=bodies[i], verdict=Verdict.EXCEEDED if over else None))
            worst = max(parts, key=_share, default=None)
            largest = max((part for part in parts if part.unit == "N"), key=_share, default=None)
            over = any(part.verdict is Verdict.EXCEEDED for part in parts)
            return Result(
                name=self.name,
                value=0.0 if largest is None else largest.value,
                unit=self.unit,
                limit=None if largest is None else largest.limit,
                verdict=Verdict.EXCEEDED if over else None,
                nothing=not over,
                reason=f"{'nothing touches' if worst is None else worst.name}; {ESTIMATE}",
                parts=tuple(parts),
                markers=tuple(lit),
            )

        return evaluate

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        table, undecided_reasons = table_input(self._table(model), "2016")
        area = () if self.area is None else (provenance.given("contact area", self.area, "m²"),)
        force = Input(
            name="contact forces",
            value="calculated",
            origin=Origin.ESTIMATED,
            source="MuJoCo at the end of a tick: soft contacts, controllers for muscles (human_bandwidth)",
        )
        return Basis(
            formula="sum of normal forces of all contacts of a bone, against the least quasi-static limit "
            "of its regions; exceeded or nothing, never within",
            source="physics of the twin; limits of the table",
            inputs=(*provenance.motion(model, self.human), force, table, *area),
            not_modelled=(
                *undecided_reasons,
                "the shape and softness of what touches, and the contact area where none is given",
                "impacts between two ticks, and transient limits",
                "contacts that no [[contacts]] asks for",
            ),
        )


def _share(part: Result) -> float:
    value = part.value or 0.0
    return value / part.limit if part.limit else (math.inf if part.limit == 0.0 else 0.0)
