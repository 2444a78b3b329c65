"""What a criterion draws into the room: a closed set; a new criterion draws with these.

In a message a marker is an array: its tag, then its fields in this order; a new field goes to the end.
World frame: right-handed, z up, metres. Quaternions: unit, w first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import cast, overload

from msgspec import Struct

from seerob.core.verdict import Verdict

Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]


class Arrow(Struct, frozen=True, kw_only=True, tag="arrow", array_like=True):
    """A vector at a point."""

    origin: Vec3
    vector: Vec3
    """From tail to tip [m as drawn]."""
    label: str = ""
    verdict: Verdict | None = None


class Segment(Struct, frozen=True, kw_only=True, tag="segment", array_like=True):
    """A line between two points, such as a shortest distance."""

    start: Vec3
    end: Vec3
    label: str = ""
    verdict: Verdict | None = None


class Sphere(Struct, frozen=True, kw_only=True, tag="sphere", array_like=True):
    """A translucent ball."""

    center: Vec3
    radius: float
    label: str = ""
    verdict: Verdict | None = None


class Ellipsoid(Struct, frozen=True, kw_only=True, tag="ellipsoid", array_like=True):
    """A translucent ellipsoid."""

    center: Vec3
    wxyz: Vec4
    """Orientation of the half axes in the world."""
    radii: Vec3
    """Half axes [m as drawn]."""
    label: str = ""
    verdict: Verdict | None = None


class Box(Struct, frozen=True, kw_only=True, tag="box", array_like=True):
    """A translucent box."""

    center: Vec3
    wxyz: Vec4
    size: Vec3
    """Full edge lengths [m]."""
    label: str = ""
    verdict: Verdict | None = None


class Hull(Struct, frozen=True, kw_only=True, tag="hull", array_like=True):
    """A translucent closed surface, convex or not."""

    vertices: tuple[Vec3, ...]
    faces: tuple[tuple[int, int, int], ...]
    label: str = ""
    verdict: Verdict | None = None


class Label(Struct, frozen=True, kw_only=True, tag="label", array_like=True):
    """Text at a point."""

    position: Vec3
    text: str
    verdict: Verdict | None = None


class Highlight(Struct, frozen=True, kw_only=True, tag="highlight", array_like=True):
    """A whole body shown in the colour of a verdict."""

    body: str
    """Full name of the node."""
    verdict: Verdict | None = None


class Polyline(Struct, frozen=True, kw_only=True, tag="polyline", array_like=True):
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


class Prism(Struct, frozen=True, kw_only=True, tag="prism", array_like=True):
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


class Rays(Struct, frozen=True, kw_only=True, tag="rays", array_like=True):
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


class _Drawn(Sequence[Marker]):
    """Markers that are made when somebody looks."""

    __slots__ = ("_held",)

    def __init__(self, make: Callable[[], Sequence[Marker]]) -> None:
        self._held: Callable[[], Sequence[Marker]] | tuple[Marker, ...] = make

    def made(self) -> tuple[Marker, ...]:
        """All of them."""
        held = self._held
        if not isinstance(held, tuple):  # twice, should two threads look at once, to one result
            held = self._held = tuple(held())
        return held

    def __len__(self) -> int:
        return len(self.made())

    @overload
    def __getitem__(self, index: int) -> Marker: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Marker, ...]: ...

    def __getitem__(self, index: int | slice) -> Marker | tuple[Marker, ...]:
        return self.made()[index]

    def __iter__(self) -> Iterator[Marker]:
        return iter(self.made())

    def __eq__(self, other: object) -> bool:
        return self.made() == (other.made() if isinstance(other, _Drawn) else other)

    def __hash__(self) -> int:
        return hash(self.made())

    def __repr__(self) -> str:
        return repr(self.made())

    def __reduce__(self) -> tuple[type[tuple[Marker, ...]], tuple[tuple[Marker, ...]]]:
        return tuple, (self.made(),)


drawn = cast("Callable[[Callable[[], Sequence[Marker]]], tuple[Marker, ...]]", _Drawn)
"""Makes markers only when a page, a recorder or a report looks at them, for `Result.markers`.

They compare, iterate and pickle as the tuple that they are; encoders are told by `plain`. What is given makes
them from copies. It may run ticks later and in another thread, when the twin is elsewhere: it must not read
`State`, nor an array that is written again.
"""


def changed(markers: Sequence[Marker], change: Callable[[Marker], Marker]) -> tuple[Marker, ...]:
    """Each marker changed; when somebody looks, where they are made only then."""
    if isinstance(markers, _Drawn):
        return drawn(lambda: tuple(map(change, markers)))
    return tuple(map(change, markers))


def plain(value: object) -> object:
    """What an encoder writes of what no message has: markers, and numpy's scalars as Python's.

    Raises:
        TypeError: It is neither.
    """
    if isinstance(value, _Drawn):
        return value.made()
    item: Callable[[], object] | None = getattr(value, "item", None)
    if item is None or getattr(value, "ndim", 1) != 0:
        raise TypeError(f"{type(value).__name__} cannot be recorded")
    return item()
