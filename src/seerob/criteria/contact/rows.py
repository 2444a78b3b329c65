"""What power and force limiting shows: of each body area, as rows for the body map, and of what governs.

Force and energy belong to a body region, pressure to each of its specific areas (ISO/TS 15066:2016
Table A.2): so there is a row per area, and each says which speed every one of the three allows.

The verdict of an area is that of its region by force and energy, and its own by pressure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from msgspec.structs import replace

from seerob.core import figures
from seerob.core.snapshot import Arrow, Aspect, Highlight, Marker, Result, Row, RowState, Sphere, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import keeps
from seerob.criteria.contact.collision import Governing, speed_at_force
from seerob.criteria.contact.limits import Judged, RegionArrays, area_verdict
from seerob.criteria.contact.measured import worse
from seerob.criteria.contact.regions import FORBIDDEN, REGIONS
from seerob.criteria.contact.shape import ContactShape, force_at_pressure
from seerob.description.humans.skeleton import SIDES
from seerob.description.norms.body_limits import BodyArea, BodyLimits, BodyRegion
from seerob.model.model import Model
from seerob.twin.state import State

NOT_MODELLED = (
    "larynx, eyes, ears and feet have no row in the table",
    "people other than adults, protective padding, clothing",
    "the contact itself: its area grows with the indentation F/k by a convention of seerob; "
    "up to the permitted force the pressure is within its limit",
    "free or clamped is decided by gaps that are not verified (M), unless thickness is given",
    "whether a moving part in a gap comes nearer to the surface or passes it: it counts as clamping",
    "surfaces that no part of the workstation shows, but for the floor",
    "parts of a tool that move without a joint of the model, as the fingers of a gripper that is one shape",
    "duration of the contact: what is free counts as transient, what is clamped as quasi-static",
    "forces that drives keep up after the impact, detection and stop of the robot",
)
"""By the limits and areas of any contact."""


def area_results(
    arrays: RegionArrays,
    pressed: Sequence[float],
    at: tuple[int, int],
    judged: Judged,
    *,
    whole: Verdict,
    unknown: str,
    v: float,
) -> tuple[Result, ...]:
    """Each specific area of a region against the surface that governs it.

    Args:
        arrays: The limits.
        pressed: Speed that the pressure of each of these areas allows the surface [m/s]; NaN where it is not
            known.
        at: The surface and the region.
        judged: What the region was judged by.
        whole: Verdict of the region.
        unknown: Why the pressure is not known, where it is not.
        v: Relative speed [m/s].
    """
    row, column = at
    speeds, region = judged.speeds, arrays.regions[column]
    others = min(float(speeds.force[row, column]), float(speeds.energy[row, column]))
    found = []
    for area, v_P in zip(region.areas, pressed, strict=True):
        open_ = math.isnan(v_P)
        limit = others if open_ else min(others, v_P)
        verdict = Verdict.EXCEEDED if not keeps(v, limit) else Verdict.UNDECIDED if open_ else Verdict.WITHIN
        verdict = area_verdict(verdict, whole, judged.ends)
        reason = "" if verdict is not Verdict.UNDECIDED else unknown or "decided as its region is"
        found.append(Result(name=area.name, value=v, unit="m/s", limit=limit, verdict=verdict, reason=reason))
    return tuple(found)


class _Place(NamedTuple):
    name: str
    areas: tuple[int, ...]
    side: str
    inputs: tuple[str, ...]


class Bound(Protocol):
    """What power and force limiting resolves once."""

    limits: BodyLimits
    arrays: RegionArrays
    """Its regions where contact is permitted."""
    forces: Array
    """That the pressure limits allow each moving body, free and clamped [N], shape (b, 2, a)."""
    unknown: list[str]
    """Why a moving body's contact area is not known, per body."""
    names: list[str]
    """Names of the moving bodies."""


class ContactRows:
    """Rows of the regions of a table, bound once.

    Args:
        bound: What is judged by.
        hand: Dominant hand of the person, ``right`` or ``left``; None without a person: then areas of the
            dominant and of the other hand have no side.
    """

    def __init__(self, bound: Bound, *, hand: str | None) -> None:
        arrays = bound.arrays
        self._arrays, self._forces, self._unknown = arrays, bound.forces, bound.unknown
        self._bodies = bound.names
        self._columns = {region.name: k for k, region in enumerate(arrays.regions)}
        self._first = np.searchsorted(arrays.owner, np.arange(len(arrays.regions))).tolist()
        self._in_regions = [REGIONS.index(region.name) for region in arrays.regions]
        self._areas = np.arange(len(arrays.owner))
        self._places = {
            region.name: tuple(_place(region, area, hand) for area in region.areas)
            for region in bound.limits.regions.values()
        }

    def of(
        self,
        found: Iterable[tuple[Result, int]],
        judged: Judged,
        bones: Callable[[str], tuple[str, ...]],
        *,
        pressed: Sequence[float],
        measured: Mapping[str, Sequence[Result]] | None = None,
    ) -> tuple[Row, ...]:
        """Rows of all areas of the regions that can be hit.

        Args:
            found: Result of a region, and the row of the moving body that governs it.
            judged: What they were made from.
            bones: Full names of the bones of a region that can be hit; none without a person.
            pressed: What `by_pressure` says.
            measured: What was measured of regions by name: of each row the worse counts.
        """
        rows: list[Row] = []
        for part, row in found:
            column = self._columns.get(part.name)
            if column is None or part.limit is None:
                rows += self._unlimited(part, bones(part.name))
            else:
                told = (measured or {}).get(part.name, ())
                for one in self._limited(part, row, column, judged, pressed, bones(part.name)):
                    verdict, reason = worse(one.verdict, one.reason, told)
                    rows.append(replace(one, verdict=verdict, reason=reason) if told else one)
        return tuple(rows)

    def areas_of(self, column: int) -> slice:
        """Where the areas of a region are among those of `by_pressure`."""
        first = self._first[column]
        return slice(first, first + len(self._arrays.regions[column].areas))

    def by_pressure(self, judged: Judged) -> list[float]:
        """At the body that governs each region: permissible speed by the pressure of each area [m/s]."""
        owner = self._arrays.owner
        row = judged.rows[self._in_regions][owner]
        clamped = judged.clamped[row, owner].astype(int)
        mu = judged.speeds.mu[row, owner]
        speeds: list[float] = speed_at_force(
            self._forces[row, clamped, self._areas], mu, self._arrays.stiffness[owner]
        ).tolist()
        return speeds

    def _limited(
        self,
        part: Result,
        row: int,
        column: int,
        judged: Judged,
        pressed: Sequence[float],
        bones: tuple[str, ...],
    ) -> Iterable[Row]:
        v_F, v_E = float(judged.speeds.force[row, column]), float(judged.speeds.energy[row, column])
        how = "clamped" if judged.clamped[row, column] else "free"
        value, unit = 0.0 if part.value is None else part.value, part.unit
        others = min(v_F, v_E)
        by_others = f"{'force' if others == v_F else 'energy'}, {how}, {self._bodies[row]}"
        shared = (Aspect(name="contact", band=how), Aspect(name="allowed by force", value=v_F, unit=unit))
        last = Aspect(name="allowed by energy", value=v_E, unit=unit)
        one_side = _side(bones)
        for i, place in enumerate(self._places[part.name], self._first[column]):
            v_P = pressed[i]
            open_ = math.isnan(v_P)
            limit = others if open_ else min(others, v_P)
            verdict = Verdict.UNDECIDED if open_ else Verdict.WITHIN
            if not keeps(value, limit):
                verdict = Verdict.EXCEEDED
            verdict = area_verdict(verdict, part.verdict, judged.ends)
            if verdict is Verdict.UNDECIDED and not open_:
                reason = part.reason
            elif verdict is Verdict.UNDECIDED:
                reason = f"contact pressure of {self._bodies[row]} ({how}): {self._unknown[row]}"
            else:
                reason = f"pressure, {how}, {self._bodies[row]}" if limit == v_P else by_others
            yield Row(
                name=place.name,
                group=part.name,
                side=place.side or one_side,
                value=value,
                unit=unit,
                limit=limit,
                verdict=verdict,
                reason=reason,
                areas=place.areas,
                bones=bones,
                aspects=(
                    *shared,
                    Aspect(name="allowed by pressure", value=None if open_ else v_P, unit=unit),
                    last,
                ),
                inputs=place.inputs,
            )

    def _unlimited(self, part: Result, bones: tuple[str, ...]) -> Iterable[Row]:
        one_side = _side(bones)
        for place in self._places.get(part.name, (_Place(part.name, (), "", ()),)):
            yield Row(
                name=place.name,
                group=part.name,
                side=place.side or one_side,
                state=_state(part),
                value=part.value,
                unit=part.unit,
                verdict=part.verdict,
                reason=part.reason,
                areas=place.areas,
                bones=bones,
                inputs=(part.name,) if part.name in self._places else (),
            )


def _state(part: Result) -> RowState:
    if part.verdict is None:
        return RowState.EXCLUDED
    return RowState.FORBIDDEN if part.name in FORBIDDEN else RowState.NO_LIMIT


def _place(region: BodyRegion, area: BodyArea, hand: str | None) -> _Place:
    side = ""
    if hand is not None and "dominant" in area.name:
        other = SIDES[1 - SIDES.index(hand)]
        side = other if "non-dominant" in area.name else hand
    inputs = tuple(f"{region.name}: {name}" for name in ("F_s", f"p_s {area.name}", "transient multiplier"))
    return _Place(area.name, (area.number,), side, inputs)


def _side(bones: Sequence[str]) -> str:
    """The one side of the body that can be hit; empty where there are more, or none."""
    sides = {side for bone in bones for side in SIDES if f"/{side}_" in bone}
    central = any(not any(f"/{side}_" in bone for side in SIDES) for bone in bones)
    return sides.pop() if len(sides) == 1 and not central else ""


ARROW = 0.3
"""Length drawn for 1 m/s [m]."""
BALL = 0.01
"""Radius of what is drawn at a patch [m]."""


class Placed(NamedTuple):
    """Where a moving body is when it is drawn."""

    point: Array
    """Its fastest one in the world [m], shape (3,)."""
    velocity: Array
    """Of that point [m/s], shape (3,)."""
    R: Array
    """World from body, shape (3, 3)."""
    x: Array
    """Its origin in the world [m], shape (3,)."""


class ContactMarkers:
    """Of the moving bodies of a robot, bound once."""

    def __init__(
        self,
        model: Model,
        bodies: Sequence[int],
        shapes: Sequence[ContactShape | None],
        arrays: RegionArrays,
        cap: float,
    ) -> None:
        """Bind.

        Args:
            model: The compiled workstation.
            bodies: By index.
            shapes: Of each; None where the file gives a radius or an area, which has no place.
            arrays: The regions.
            cap: Area above which a contact is not credited [m²].
        """
        self._model, self._arrays, self._cap = model, arrays, cap
        self._bodies, self._shapes = tuple(bodies), tuple(shapes)
        self._columns = {region.name: k for k, region in enumerate(arrays.regions)}
        self._least: dict[tuple[int, int, bool], int | None] = {}

    def place(self, state: State, row: int) -> Placed:
        """Where the moving body of a row is, in copies."""
        body = self._bodies[row]
        _, point, velocity = state.fastest_point(body)
        R, x = state.placed((body,))
        return Placed(point.copy(), velocity.copy(), R[body].copy(), x[body].copy())

    def of(self, at: Placed, part: Result, row: int, judged: Judged) -> tuple[Marker, ...]:
        """Markers of a region and the row of the moving body that governs it."""
        shown = figures.against(part.value, part.limit, part.unit, at_most=True)
        label = f"{part.name}: {shown.value} m/s" + ("" if part.limit is None else f" of {shown.limit}")
        arrow = Arrow(
            origin=tuple(at.point.tolist()),
            vector=tuple((ARROW * at.velocity).tolist()),
            label=label,
            verdict=part.verdict,
        )
        lit = Highlight(body=self._model.bodies[self._bodies[row]].name, verdict=part.verdict)
        patch = self._patch(part, row, judged)
        if patch is None:
            return arrow, lit
        point, label, verdict = patch
        center = tuple((at.x + at.R @ point).tolist())
        return arrow, lit, Sphere(center=center, radius=BALL, label=label, verdict=verdict)

    def _patch(self, part: Result, row: int, judged: Judged) -> tuple[Array, str, Verdict | None] | None:
        """Where a pressure governs, or is open because the mesh does not resolve an edge: there, in words.

        What is unknown is UNDECIDED, also where the area is exceeded by another body or a force.
        """
        shape, column = self._shapes[row], self._columns.get(part.name)
        if shape is None or column is None or part.limit is None:
            return None
        if math.isnan(judged.speeds.pressure[row, column]):
            edges = shape.unknown_at
            if edges is None or not len(edges):
                return None
            return edges[0], "edge radius unknown", Verdict.UNDECIDED
        if judged.speeds.governing[row, column] != Governing.PRESSURE:
            return None
        patch = self._least_patch(shape, row, column, bool(judged.clamped[row, column]))
        if patch is None:
            return None
        radius = float(shape.radii[patch, 0])
        return shape.points[patch], f"edge radius {figures.figure(radius * 1e3, 'mm')}", part.verdict

    def _least_patch(self, shape: ContactShape, row: int, column: int, clamped: bool) -> int | None:
        """The patch that permits the least force on any area of a region; None of a flat surface."""
        key = row, column, clamped
        if key not in self._least:
            own = np.flatnonzero(self._arrays.owner == column)
            p = self._arrays.pressures()[int(clamped), own].min()
            round_ = np.flatnonzero(np.isfinite(shape.radii[:, 0]))
            forces = force_at_pressure(shape.radii[round_], p, self._arrays.stiffness[column], self._cap)
            self._least[key] = int(round_[forces.argmin()]) if len(round_) else None
        return self._least[key]
