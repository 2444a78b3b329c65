"""Envelopes of the library's robots: convex pieces that contain the maker's shape, and a look inside them.

A piece is a ``box = [[min], [max]]``, a ``tube = [[start], [end]]`` with a ``radius``, or a
``slot = [[[start], [end]], [[start], [end]]]`` with two radii, the convex hull of two parallel tubes; all
in metres in the link's frame. Distances see the box, the 16-sided prism around the tube, or the
hull of two prisms; the screen sees a rounded body that never leaves it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from seerob.geometry import Mesh, Solid
from seerob.model_io import shapes
from seerob.transforms import Array

NOTE = "envelope made by seerob, not the maker's mesh"

COLORS: Mapping[str, shapes.Color] = {
    "body": (0.80, 0.82, 0.84, 1.0),
    "cap": (0.45, 0.62, 0.78, 1.0),
    "dark": (0.35, 0.37, 0.40, 1.0),
    "orange": (0.93, 0.50, 0.16, 1.0),
}


def shapes_of(piece: Mapping[str, Any]) -> tuple[Mesh, Mesh]:
    """Mesh for distances and mesh for the screen of one piece; the second lies inside the first."""
    color = COLORS[piece.get("color", "body")]
    if "tube" in piece:
        start, end = piece["tube"]
        radius = float(piece["radius"])
        return shapes.prism_mesh(start, end, radius), _rounded_tube(start, end, radius, color)
    if "slot" in piece:
        ends, radii = piece["slot"], piece["radius"]
        prisms = [shapes.prism_mesh(*end, radius) for end, radius in zip(ends, radii, strict=True)]
        looks = [_rounded_tube(*end, radius, color) for end, radius in zip(ends, radii, strict=True)]
        return shapes.hull_mesh(prisms, color), shapes.hull_mesh(looks, color)
    lower, upper = (np.array(p, float) for p in piece["box"])
    return shapes.box_mesh(lower, upper), _rounded_in_box(lower, upper, color)


def shapes_for(pieces: Sequence[Mapping[str, Any]]) -> tuple[tuple[Solid, ...], tuple[Mesh, ...]]:
    """Solids and display meshes of a link's pieces."""
    made = [shapes_of(piece) for piece in pieces]
    solids = tuple(Solid(mesh=mesh, name=f"envelope_{i}", note=NOTE) for i, (mesh, _) in enumerate(made))
    return solids, tuple(visual for _, visual in made)


def _rounded_tube(start: Sequence[float], end: Sequence[float], radius: float, color: shapes.Color) -> Mesh:
    length = float(np.linalg.norm(np.subtract(end, start)))
    profile = shapes.rounded_profile(radius, length, 0.25 * radius)
    return shapes.lathe_mesh(start, end, profile, sides=48, color=color)


def _rounded_in_box(lower: Array, upper: Array, color: shapes.Color) -> Mesh:
    """An elliptical cylinder with rounded rims along the longest edge of a box, touching its sides."""
    size = upper - lower
    axis = int(size.argmax())
    rotation = np.roll(np.eye(3), 2 - axis, axis=1)
    half = 0.5 * size
    a, b = float(rotation[:, 0] @ half), float(rotation[:, 1] @ half)
    start, end = 0.5 * (lower + upper), 0.5 * (lower + upper)
    start[axis], end[axis] = lower[axis], upper[axis]
    profile = shapes.rounded_profile(1.0, float(size[axis]), 0.2 * min(a, b))
    return shapes.lathe_mesh(start, end, profile, sides=48, color=color, squeeze=(rotation, a, b))
