"""The forces with which things press on a person in the twin, against what body regions may take."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, ClassVar, cast

from msgspec import Meta

from seerob.core.snapshot import Basis, Highlight, Input, Origin, Result
from seerob.core.verdict import Verdict, keeps
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.description.humans.body_areas import BODY_REGION
from seerob.description.humans.skeleton import without_side
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
    most, pressure = least_limits(regions)
    found = [_against(name, force, "N", most)]
    if area is not None:
        found.append(_against(f"{name}, pressure", force / area, "Pa", pressure))
    return found


def least_limits(regions: tuple[BodyRegion, ...]) -> tuple[float, float]:
    """Least force [N] and pressure [Pa] that regions may take; infinity of none, 0 of forbidden ones."""
    if not all(region.permitted for region in regions):
        return 0.0, 0.0
    forces = (region.force.value for region in regions)
    pressures = (region.pressure.value for region in regions)
    return min(forces, default=math.inf), min(pressures, default=math.inf)


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
    adults: ClassVar[bool] = True
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

    def _regions(self, model: Model) -> dict[int, tuple[BodyRegion, ...]]:
        """Of each body of the person, by index."""
        table, own = self._table(model), f"{self.human}/"
        bodies = model.human(self.human).bodies
        return {i: regions_of(model.bodies[i].name.removeprefix(own), table) for i in bodies}

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the forces."""
        least = {i: least_limits(regions) for i, regions in self._regions(model).items()}

        def compute(twin: Twin) -> Figure:
            found = cast("State", twin).contact_forces(self.human)
            largest: tuple[float, float | None] = 0.0, None
            most, over = -1.0, False
            for i, (force, _) in found.items():
                limit, pressure = least[i]
                share = _share(force, limit)
                if not share <= most:  # also what is not a number
                    most, largest = share, (force, limit if math.isfinite(limit) else None)
                over = over or not keeps(force, limit)
                over = over or (self.area is not None and not keeps(force / self.area, pressure))
            return Figure(*largest, nothing=not over, exceeded=over, beside=found)

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says what presses where, and lights what is pressed."""
        regions, bodies = self._regions(model), model.bodies

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            parts, lit = [], []
            for i, (force, other) in figure.beside.items():
                own = pressed(f"{other} on {bodies[i].name}", force, self.area, regions[i])
                parts += own
                over = any(part.verdict is Verdict.EXCEEDED for part in own)
                lit.append((bodies[i].name, Verdict.EXCEEDED if over else None))
            worst = max(parts, key=lambda part: _share(part.value or 0.0, part.limit), default=None)

            def draw() -> tuple[Highlight, ...]:
                return tuple(Highlight(body=name, verdict=told) for name, told in lit)

            who = "nothing touches" if worst is None else worst.name
            return Shown(f"{who}; {ESTIMATE}", draw if lit else None, tuple(parts))

        return present

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


def _share(value: float, limit: float | None) -> float:
    """Of its limit; none of one that nobody knows."""
    if limit == 0.0:
        return math.inf
    return 0.0 if limit is None else value / limit
