"""What a criterion draws into the room: a closed set; a new criterion draws with these.

World frame: right-handed, z up, metres. Quaternions: unit, w first.
"""

from __future__ import annotations

from itertools import pairwise

from msgspec import Struct

from seerob.core.verdict import Verdict

Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]


class Arrow(Struct, frozen=True, kw_only=True, tag="arrow"):
    """A vector at a point."""

    origin: Vec3
    vector: Vec3
    """From tail to tip [m as drawn]."""
    label: str = ""
    verdict: Verdict | None = None


class Segment(Struct, frozen=True, kw_only=True, tag="segment"):
    """A line between two points, such as a shortest distance."""

    start: Vec3
    end: Vec3
    label: str = ""
    verdict: Verdict | None = None


class Sphere(Struct, frozen=True, kw_only=True, tag="sphere"):
    """A translucent ball."""

    center: Vec3
    radius: float
    label: str = ""
    verdict: Verdict | None = None


class Ellipsoid(Struct, frozen=True, kw_only=True, tag="ellipsoid"):
    """A translucent ellipsoid."""

    center: Vec3
    wxyz: Vec4
    """Orientation of the half axes in the world."""
    radii: Vec3
    """Half axes [m as drawn]."""
    label: str = ""
    verdict: Verdict | None = None


class Box(Struct, frozen=True, kw_only=True, tag="box"):
    """A translucent box."""

    center: Vec3
    wxyz: Vec4
    size: Vec3
    """Full edge lengths [m]."""
    label: str = ""
    verdict: Verdict | None = None


class Hull(Struct, frozen=True, kw_only=True, tag="hull"):
    """A translucent closed surface, convex or not."""

    vertices: tuple[Vec3, ...]
    faces: tuple[tuple[int, int, int], ...]
    label: str = ""
    verdict: Verdict | None = None


class Label(Struct, frozen=True, kw_only=True, tag="label"):
    """Text at a point."""

    position: Vec3
    text: str
    verdict: Verdict | None = None


class Highlight(Struct, frozen=True, kw_only=True, tag="highlight"):
    """A whole body shown in the colour of a verdict."""

    body: str
    """Full name of the node."""
    verdict: Verdict | None = None


class Polyline(Struct, frozen=True, kw_only=True, tag="polyline"):
    """A line through points, such as the edge of a field on the floor or a path."""

    points: tuple[Vec3, ...]
    closed: bool = False
    """Whether the last point is joined to the first."""
    label: str = ""
    verdict: Verdict | None = None

    def legs(self) -> list[tuple[Vec3, Vec3]]:
        """Start and end of each straight piece."""
        points = (*self.points, *self.points[:1]) if self.closed else self.points
        return list(pairwise(points))


class Prism(Struct, frozen=True, kw_only=True, tag="prism"):
    """A translucent extruded polygon, convex or not, such as a floor area with a height."""

    outline: tuple[tuple[float, float], ...]
    """Corners x, y in its frame [m], either way round, without crossing itself."""
    lower: float
    upper: float
    """Between which z of its frame it reaches [m]."""
    position: Vec3 = (0.0, 0.0, 0.0)
    wxyz: Vec4 = (1.0, 0.0, 0.0, 0.0)
    """Its frame in the world."""
    label: str = ""
    verdict: Verdict | None = None


class Rays(Struct, frozen=True, kw_only=True, tag="rays"):
    """What a sensor sees: beams that end where something is in their way, or at their range."""

    starts: tuple[Vec3, ...]
    """One for all of them, such as a scanner's, or one each, such as a light curtain's."""
    ends: tuple[Vec3, ...]
    hits: tuple[int, ...] = ()
    """Indices of those that end on something that is to be detected; drawn solid, the others faint."""
    filled: bool = False
    """Whether the surface between neighbouring beams is filled: a fan, or a sheet."""
    label: str = ""
    verdict: Verdict | None = None

    def beams(self) -> list[tuple[Vec3, Vec3]]:
        """Start and end of each beam."""
        starts = self.starts if len(self.starts) == len(self.ends) else self.starts[:1] * len(self.ends)
        return list(zip(starts, self.ends, strict=False))


Marker = Arrow | Segment | Sphere | Ellipsoid | Box | Hull | Polyline | Prism | Rays | Label | Highlight
