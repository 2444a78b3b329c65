"""Kinds of values in a workstation file: quantities with their units, names, poses.

Units at the door: ``rpy_deg = [0, 0, 90]`` in a file is ``rpy`` in radians inside.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from msgspec import Meta, Struct

SUFFIXES: dict[str, tuple[str, float]] = {
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "inch": ("m", 0.0254),
    "deg": ("rad", math.pi / 180),
    "deg_s": ("rad/s", math.pi / 180),
    "mm_s": ("m/s", 1e-3),
    "ms": ("s", 1e-3),
    "g": ("kg", 1e-3),
    "mJ": ("J", 1e-3),
    "g_cm3": ("kg/m³", 1e3),
}
"""Suffix of a key → SI unit and factor."""

LENGTHS: dict[str, float] = {
    "m": 1.0,
    "dm": 0.1,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "inch": 0.0254,
    "ft": 0.3048,
}
"""Units a mesh file may be in → metres."""


def splits(key: str) -> Iterator[tuple[str, str, float]]:
    """``('rpy', 'rad', π/180)`` of ``'rpy_deg'``: every way to read a suffix, the longest first."""
    for suffix in sorted(SUFFIXES, key=len, reverse=True):
        stem = key.removesuffix("_" + suffix)
        if stem and stem != key:
            unit, factor = SUFFIXES[suffix]
            yield stem, unit, factor


def split(key: str) -> tuple[str, str, float] | None:
    """The first of `splits`; None when the key carries no known suffix."""
    return next(splits(key), None)


def unit(symbol: str, *, parts: tuple[str, ...] = (), polygon: bool = False, **limits: Any) -> Any:
    """Metadata of a quantity, for keys with a suffix, messages, documentation and the schema.

    Args:
        symbol: Its unit in SI.
        parts: What each of several numbers is, for forms.
        polygon: Whether a list is of the corners of a polygon, for forms: one more lies between two of them.
        **limits: As of ``msgspec.Meta``.
    """
    form = {
        "x-unit": symbol,
        **({"x-parts": parts} if parts else {}),
        **({"x-polygon": True} if polygon else {}),
    }
    return Meta(extra={"unit": symbol}, extra_json_schema=form, **limits)


Length = Annotated[float, unit("m", gt=0, le=1000)]
Mass = Annotated[float, unit("kg", gt=0, le=1e6)]
Density = Annotated[float, unit("kg/m³", gt=0, le=1e5)]
Inertia = Annotated[float, unit("kg·m²")]
Seconds = Annotated[float, unit("s", gt=0)]
NotBefore = Annotated[float, unit("s", ge=0, le=1e6)]
Radian = Annotated[float, unit("rad")]
Hertz = Annotated[float, unit("Hz", gt=0)]
Coordinate = Annotated[float, Meta(ge=-1000, le=1000)]
Metres3 = Annotated[tuple[Coordinate, Coordinate, Coordinate], unit("m")]
Radians3 = Annotated[tuple[float, float, float], unit("rad")]
Radians = Annotated[tuple[float, ...], unit("rad")]
Corner = Annotated[tuple[Coordinate, Coordinate], unit("m")]
Corners = Annotated[tuple[Corner, ...], unit("m", polygon=True, min_length=3, max_length=200)]
"""Corners (x, y) of a polygon [m]."""
Share = Annotated[float, Meta(ge=0, le=1)]
Tolerance = Annotated[float, Meta(ge=0, lt=1)]
"""Either way, as a share of the figure itself."""
Percentile = Annotated[
    str,
    Meta(
        pattern=r"^[a-z0-9_]+ P[0-9]{1,2}$",
        max_length=80,
        description='metres, or a population and percentile such as "germany P50"',
    ),
]
Name = Annotated[
    str,
    Meta(pattern=r"^[A-Za-z0-9_.\-]+$", max_length=80, description="letters, digits, '_', '.' and '-' only"),
]
PathName = Annotated[
    str,
    Meta(
        pattern=r"^[A-Za-z0-9_.\-]+(/[A-Za-z0-9_.\-]+)*$",
        max_length=200,
        description="letters, digits, '_', '.', '-', and '/' between them only",
    ),
]


Alternatives = tuple[tuple[tuple[str, ...], ...], ...]
"""Groups of alternatives: the keys of each."""


class Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every table."""

    one_of: ClassVar[Alternatives] = ()
    """Of which groups of alternatives a table has one."""


class Pose(Table, frozen=True, kw_only=True):
    """Where something is: a position and one way of giving an orientation."""

    position: Metres3 = (0.0, 0.0, 0.0)
    rpy: Radians3 | None = None
    """Roll, pitch, yaw about the fixed x, y, z axes [rad]; write ``rpy_deg`` for degrees."""
    wxyz: tuple[float, float, float, float] | None = None
    """Unit quaternion, w first."""

    def __post_init__(self) -> None:
        if self.rpy is not None and self.wxyz is not None:
            raise ValueError("rpy and wxyz are both given: keep one")
        if self.wxyz is not None and abs(sum(x * x for x in self.wxyz) - 1.0) > 1e-3:
            raise ValueError(f"wxyz = {list(self.wxyz)} is not a unit quaternion")
