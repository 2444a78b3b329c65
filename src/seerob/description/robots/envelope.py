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

from seerob.core.shapes.geometry import Mesh, Solid
from seerob.core.transforms import Array
from seerob.description.shapes import shapes

NOTE = "envelope made by seerob, not the maker's mesh"

COLORS: Mapping[str, shapes.Color] = {
    "grey": (0.78, 0.80, 0.82, 1.0),
    "blue": (0.42, 0.62, 0.80, 1.0),
    "dark": (0.33, 0.35, 0.38, 1.0),
    "orange": (0.93, 0.50, 0.16, 1.0),
}
CAP = 0.14
"""Length of a coloured cap, relative to that of its tube."""
ROUNDING = 0.25
"""Radius of a rounded rim, relative to that of its tube."""


def shapes_for(pieces: Sequence[Mapping[str, Any]]) -> tuple[tuple[Solid, ...], tuple[Mesh, ...]]:
    """Solids and display meshes of a link's pieces."""
    solids = tuple(
        Solid(mesh=outer(piece), name=f"envelope_{i}", note=NOTE) for i, piece in enumerate(pieces)
    )
    return solids, tuple(mesh for piece in pieces for mesh in look(piece))


def outer(piece: Mapping[str, Any]) -> Mesh:
    """The convex mesh of a piece that distances see."""
    if "tube" in piece:
        start, end = piece["tube"]
        return shapes.prism_mesh(start, end, float(piece["radius"]))
    if "slot" in piece:
        tubes = zip(piece["slot"], piece["radius"], strict=True)
        return shapes.hull_mesh([shapes.prism_mesh(start, end, radius) for (start, end), radius in tubes])
    lower, upper = piece["box"]
    return shapes.box_mesh(lower, upper)


def look(piece: Mapping[str, Any]) -> list[Mesh]:
    """What the screen shows of a piece: inside its outer mesh, rounded, with coloured caps where asked."""
    color = COLORS[piece.get("color", "grey")]
    if "tube" in piece:
        start, end = (np.array(p, float) for p in piece["tube"])
        radius, length = float(piece["radius"]), float(np.linalg.norm(end - start))
        profile = shapes.rounded_profile(radius, length, ROUNDING * radius)
        if "caps" not in piece:
            return [shapes.lathe_mesh(start, end, profile, sides=48, color=color)]
        cap = COLORS[piece["caps"]]
        low, middle, high = _in_three(profile, max(CAP * length, 1.01 * profile[len(profile) // 2 - 1][1]))
        parts = ((low, cap), (middle, color), (high, cap))
        return [shapes.lathe_mesh(start, end, part, sides=48, color=c) for part, c in parts]
    if "slot" in piece:
        tubes = zip(piece["slot"], piece["radius"], strict=True)
        return [shapes.hull_mesh([look({"tube": tube, "radius": r})[0] for tube, r in tubes], color)]
    lower, upper = (np.array(p, float) for p in piece["box"])
    return [_rounded_in_box(lower, upper, color)]


def _in_three(profile: list[tuple[float, float]], cap: float) -> tuple[list[tuple[float, float]], ...]:
    """A symmetric profile cut at ``cap`` [m] from both ends, or in the middle when it is too short."""
    half = len(profile) // 2
    radius, length = profile[half - 1][0], profile[-1][1]
    cap = min(cap, 0.45 * length)
    low = [point for point in profile[:half] if point[1] < cap] + [(radius, cap)]
    high = [(radius, length - cap)] + [point for point in profile[half:] if point[1] > length - cap]
    return low, [(radius, cap), (radius, length - cap)], high


def _rounded_in_box(lower: Array, upper: Array, color: shapes.Color) -> Mesh:
    """A box with rounded corners that touches all sides of the given one."""
    size = upper - lower
    axis = int(size.argmin())
    corner = 0.35 * float(np.delete(size, axis).min())
    profile = shapes.rounded_profile(corner, float(size[axis]), ROUNDING * corner)
    inset = np.full(3, corner)
    inset[axis] = 0.0
    tubes = []
    for bits in range(4):
        start = lower + inset
        for bit, side in enumerate(np.delete(np.arange(3), axis)):
            if bits >> bit & 1:
                start[side] = upper[side] - corner
        end = start.copy()
        end[axis] = upper[axis]
        tubes.append(shapes.lathe_mesh(start, end, profile, sides=32))
    return shapes.hull_mesh(tubes, color)
