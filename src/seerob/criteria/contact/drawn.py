"""What is drawn of the contact that governs: the part, its motion, and the surface patch that presses."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from seerob.core import figures
from seerob.core.snapshot import Arrow, Highlight, Marker, Result, Sphere, Verdict
from seerob.core.transforms import Array
from seerob.criteria.contact.collision import Governing
from seerob.criteria.contact.limits import Judged, RegionArrays
from seerob.criteria.contact.shape import ContactShape, force_at_pressure
from seerob.model.model import Model
from seerob.twin.state import State

ARROW = 0.3
"""Length drawn for 1 m/s [m]."""
BALL = 0.01
"""Radius of what is drawn at a patch [m]."""


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

    def of(self, state: State, part: Result, row: int, judged: Judged) -> tuple[Marker, ...]:
        """Markers of a region and the row of the moving body that governs it."""
        body = self._bodies[row]
        _, point, velocity = state.fastest_point(body)
        shown = figures.against(part.value, part.limit, part.unit, at_most=True)
        label = f"{part.name}: {shown.value} m/s" + ("" if part.limit is None else f" of {shown.limit}")
        arrow = Arrow(
            origin=tuple(point.tolist()),
            vector=tuple((ARROW * velocity).tolist()),
            label=label,
            verdict=part.verdict,
        )
        lit = Highlight(body=self._model.bodies[body].name, verdict=part.verdict)
        return arrow, lit, *self._patch(state, part, row, judged)

    def _patch(self, state: State, part: Result, row: int, judged: Judged) -> tuple[Sphere, ...]:
        """Where a pressure governs, or is open because the mesh does not resolve an edge: there."""
        shape, column = self._shapes[row], self._columns.get(part.name)
        if shape is None or column is None or part.limit is None:
            return ()
        if math.isnan(judged.speeds.pressure[row, column]):
            edges = shape.unknown_at
            if edges is None or not len(edges):
                return ()
            return (self._ball(state, row, edges[0], "edge radius unknown", part.verdict),)
        if judged.speeds.governing[row, column] != Governing.PRESSURE:
            return ()
        patch = self._least_patch(shape, row, column, bool(judged.clamped[row, column]))
        if patch is None:
            return ()
        radius = float(shape.radii[patch, 0])
        label = f"edge radius {figures.figure(radius * 1e3, 'mm')}"
        return (self._ball(state, row, shape.points[patch], label, part.verdict),)

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

    def _ball(self, state: State, row: int, point: Array, label: str, verdict: Verdict | None) -> Sphere:
        body = self._bodies[row]
        R, x = state.placed((body,))
        center = x[body] + R[body] @ point
        return Sphere(center=tuple(center.tolist()), radius=BALL, label=label, verdict=verdict)
