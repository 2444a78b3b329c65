"""A simple shape in the workstation file, instead of a mesh file."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from seerob.core.quantities import Coordinate, Corners, Table, unit
from seerob.core.shapes import check_polygon

MAX_SIZE = 1000.0
"""Largest size of a simple shape [m]."""


class Shape(Table, frozen=True, kw_only=True):
    """A simple shape instead of a mesh file, centred at the origin of its frame."""

    one_of = ((("box",), ("sphere",), ("cylinder",), ("capsule",), ("polygon", "height")),)

    box: (
        Annotated[tuple[float, float, float], unit("m", parts=("x", "y", "z"), examples=[(0.5, 0.5, 0.5)])]
        | None
    ) = None
    """Edge lengths [m]."""
    sphere: Annotated[float, unit("m", gt=0, le=1000, examples=[0.25])] | None = None
    """Radius [m]."""
    cylinder: (
        Annotated[tuple[float, float], unit("m", parts=("radius", "height"), examples=[(0.25, 0.5)])] | None
    ) = None
    """Radius and height along z [m]."""
    capsule: (
        Annotated[tuple[float, float], unit("m", parts=("radius", "length"), examples=[(0.15, 0.5)])] | None
    ) = None
    """Radius, and length along z between the centres of its two half balls [m]."""
    polygon: Annotated[Corners, Meta(examples=[[(0, 0), (1, 0), (1, 1), (0, 1)]])] | None = None
    """Corners (x, y) of a floor plan, in either sense, concave or not, extruded along z [m]; not centred."""
    height: (
        Annotated[tuple[Coordinate, Coordinate], unit("m", parts=("lower", "upper"), examples=[(0, 1)])]
        | None
    ) = None
    """Lower and upper end along z of what is extruded from ``polygon`` [m]."""

    def __post_init__(self) -> None:
        given = [x for x in (self.box, self.sphere, self.cylinder, self.capsule) if x is not None]
        if len(given) + (self.polygon is not None) != 1:
            raise ValueError("give exactly one of box, sphere, cylinder, capsule, polygon")
        if (self.polygon is None) != (self.height is None):
            raise ValueError("polygon and height = [lower, upper] belong together")
        if self.polygon is not None and self.height is not None:
            check_polygon(self.polygon)
            if self.height[0] >= self.height[1]:
                raise ValueError(f"height = {list(self.height)} is no interval: the lower end comes first")
            return
        sizes = (given[0],) if isinstance(given[0], float) else given[0]
        if min(sizes) <= 0:
            raise ValueError(f"sizes must be larger than 0 m, not {list(sizes)}")
        if max(sizes) > MAX_SIZE:
            raise ValueError(f"sizes must be at most {MAX_SIZE:g} m, not {list(sizes)}")
