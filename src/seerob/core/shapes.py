"""Shapes with one meaning each, on the floor and in the room.

Shapes with one meaning each: a closed set, exact for distances.

A solid is a *core* dilated by a radius: a triangle mesh (radius 0 or a stated envelope), a
segment (capsule; a sphere when its ends coincide) or a rectangle (dilated plane).
All coordinates are in the frame of the body that carries the solid [m].

Polygons on a floor plan: whether one is simple, what is inside, its triangles and the prism over it.

A polygon is a ring of corners (x, y) in either sense, convex or not; the last corner joins the first.
Orientation of three points is decided in floating point where that is beyond doubt and in exact fractions
where it is not, so that a corner *on* another edge is found as such.

A way on the floor: straight pieces with arcs between them, by the length along it.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array

Faces = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh."""

    vertices: Array
    """Shape (n, 3) [m]."""
    faces: Faces
    """Vertex indices, counter-clockwise from outside, shape (m, 3)."""
    color: tuple[float, float, float, float] = (0.7, 0.72, 0.75, 1.0)
    """Red, green, blue, alpha in 0…1."""

    def __repr__(self) -> str:
        return f"<Mesh: {len(self.vertices)} vertices, {len(self.faces)} triangles>"

    def moved(self, a_from_b: Array) -> Mesh:
        """Return this mesh expressed in frame ``a``, given the transform (4, 4) from its own frame ``b``."""
        vertices = self.vertices @ a_from_b[:3, :3].T + a_from_b[:3, 3]
        return Mesh(vertices, self.faces, self.color)


@dataclass(frozen=True, eq=False)
class Solid:
    """One physics shape of a body: a core dilated by ``radius`` [m].

    Exactly one kind of core: ``mesh``; or ``points`` of shape (2, 3), a segment; or ``points`` of
    shape (3, 3): a corner of a rectangle and the two corners beside it (edges at right angles).
    """

    mesh: Mesh | None = None
    points: Array | None = None
    radius: float = 0.0
    name: str = ""
    """Distinguishes the solids of one body: a body area, a file's sub-mesh."""
    note: str = field(default="", compare=False)
    """What it is when it is not the real thing: ``envelope, not the maker's mesh``."""
    deviation: float = 0.0
    """How far the real surface may lie outside this shape, as far as known [m] (a display mesh that
    sticks out of a collision mesh); part of the uncertainty of every distance."""
    lids: tuple[Mesh, ...] = ()
    """Closed meshes that may be surface, too: what closes its openings, where nobody says that they are open
    in reality. No distance is to them (`seerob.model.model.Model.closed`)."""

    def __post_init__(self) -> None:
        if (self.mesh is None) == (self.points is None):
            raise ValueError("a Solid has either a mesh or the points of a segment or a rectangle")
        if self.points is not None and self.points.shape not in ((2, 3), (3, 3)):
            raise ValueError(f"points must be (2, 3) or (3, 3), not {self.points.shape}")
        if not (np.isfinite(self.radius) and self.radius >= 0):
            raise ValueError(f"radius must be finite and at least 0 m, not {self.radius}")

    def __repr__(self) -> str:
        core = repr(self.mesh) if self.points is None else ("segment", "rectangle")[len(self.points) - 2]
        return f"<Solid {self.name!r}: {core}, radius {self.radius:g} m>"

    @property
    def closings(self) -> tuple[Solid, ...]:
        """Its lids, as far off as it is."""
        return tuple(replace(self, mesh=lid, lids=()) for lid in self.lids)


def capsule(start: Array, end: Array, radius: float, *, name: str = "") -> Solid:
    """A capsule; a sphere when the ends coincide. Points (3,) [m], radius [m]."""
    return Solid(points=np.array([start, end], float), radius=radius, name=name)


def dilated_rectangle(corner: Array, u: Array, v: Array, radius: float, *, name: str = "") -> Solid:
    """A rectangle with edges ``u`` and ``v`` from ``corner`` (each (3,) [m]), dilated by ``radius`` [m]."""
    corner, u, v = (np.asarray(x, float) for x in (corner, u, v))
    return Solid(points=np.array([corner, corner + u, corner + v]), radius=radius, name=name)


def ear_clipping(outline: Array) -> list[tuple[int, int, int]]:
    """Triangles of a simple polygon, counter-clockwise, by cutting ears; shape (n, 2) to indices.

    What is left of an outline that crosses itself is not covered.
    """
    xy = np.asarray(outline, float)
    nxt = np.roll(xy, -1, axis=0)
    twice = float((xy[:, 0] * nxt[:, 1] - xy[:, 1] * nxt[:, 0]).sum()) if len(xy) else 0.0
    left = list(range(len(xy))) if twice > 0 else list(range(len(xy)))[::-1]
    found: list[tuple[int, int, int]] = []

    def turn(a: int, b: int, c: int) -> float:
        u, v = xy[b] - xy[a], xy[c] - xy[b]
        return float(u[0] * v[1] - u[1] * v[0])

    def is_ear(k: int) -> bool:
        a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
        others = (p for p in left if p not in (a, b, c))
        return turn(a, b, c) > 0 and not any(
            turn(a, b, p) >= 0 and turn(b, c, p) >= 0 and turn(c, a, p) >= 0 for p in others
        )

    while len(left) > 2:
        k = next((k for k in range(len(left)) if is_ear(k)), None)
        if k is None:
            return found
        found.append((left[k - 1], left[k], left[(k + 1) % len(left)]))
        del left[k]
    return found


Corner = tuple[float, float]

DOUBT = 1e-14
"""Share of its terms below which a determinant's sign is computed exactly: rounding makes 4e-16."""


def check_polygon(corners: Sequence[Corner]) -> None:
    """Refuse what is no simple polygon.

    Args:
        corners: At least 3, [m].

    Raises:
        ValueError: Too few corners, equal ones, no area, or edges that touch; says which.
    """
    n = len(corners)
    if n < 3:
        raise ValueError(f"a polygon has at least 3 corners, not {n}")
    if corners[0] == corners[-1]:
        raise ValueError("the last corner of a polygon is the first again: leave it out, it closes by itself")
    for i in range(n):
        if corners[i] == corners[(i + 1) % n]:
            raise ValueError(f"corners {i} and {(i + 1) % n} of the polygon are equal: leave one out")
    for i in range(n):
        before, at, after = corners[i - 1], corners[i], corners[(i + 1) % n]
        ahead = (at[0] - before[0]) * (after[0] - at[0]) + (at[1] - before[1]) * (after[1] - at[1])
        if turn(before, at, after) == 0 and ahead < 0:
            raise ValueError(f"the polygon turns back on itself at corner {i}: leave the spike out")
    for i in range(n):
        for j in range(i + 2, n):
            if (i == 0 and j == n - 1) or not _touch(
                corners[i], corners[i + 1], corners[j], corners[(j + 1) % n]
            ):
                continue
            raise ValueError(
                f"the polygon crosses or touches itself: edge {i} from {list(corners[i])} and edge {j} from "
                f"{list(corners[j])}; list the corners in order around it, or use two polygons"
            )


def turn(a: Corner, b: Corner, c: Corner) -> int:
    """1 when a, b, c turn left, -1 right, 0 when they lie on one line; exact."""
    left, right = (b[0] - a[0]) * (c[1] - a[1]), (b[1] - a[1]) * (c[0] - a[0])
    value = left - right
    # Differences of coordinates of up to 1000 m are themselves rounded: their error counts too.
    size = (abs(b[0]) + abs(a[0])) * (abs(c[1]) + abs(a[1])) + (abs(b[1]) + abs(a[1])) * (
        abs(c[0]) + abs(a[0])
    )
    if abs(value) <= DOUBT * size:
        (ax, ay), (bx, by), (cx, cy) = ((Fraction(x), Fraction(y)) for x, y in (a, b, c))
        exact = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        return (exact > 0) - (exact < 0)
    return (value > 0) - (value < 0)


def _touch(a: Corner, b: Corner, c: Corner, d: Corner) -> bool:
    """Whether two closed segments have a point in common."""
    if max(a[0], b[0]) < min(c[0], d[0]) or max(c[0], d[0]) < min(a[0], b[0]):
        return False
    if max(a[1], b[1]) < min(c[1], d[1]) or max(c[1], d[1]) < min(a[1], b[1]):
        return False
    return turn(a, b, c) * turn(a, b, d) <= 0 and turn(c, d, a) * turn(c, d, b) <= 0


def signed_area(corners: Sequence[Corner]) -> float:
    """Area [m²], negative when the corners go clockwise."""
    x, y = np.asarray(corners, float).T
    # About the first corner, so that far from the origin nothing cancels.
    x, y = x - x[0], y - y[0]
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def contains(corners: Sequence[Corner] | Array, points: Array) -> NDArray[np.bool_]:
    """Whether each point (n, 2) [m] lies inside a simple polygon; on its edge may be either."""
    ring = np.asarray(corners, float)
    a, b = ring, np.roll(ring, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        crosses = ((a[:, 1] > y) != (b[:, 1] > y)) & (
            x < (b[:, 0] - a[:, 0]) * (y - a[:, 1]) / (b[:, 1] - a[:, 1]) + a[:, 0]
        )
    return np.asarray(crosses.sum(axis=1) % 2 == 1)


def triangulate(corners: Sequence[Corner]) -> NDArray[np.int32]:
    """Triangles of a simple polygon by ear clipping [Meisters1975]_, counter-clockwise, shape (n - 2, 3).

    Corners on a straight edge are kept, so that the prism over it is closed.
    """
    left = list(range(len(corners)))
    if signed_area(corners) < 0:
        left.reverse()
    triangles = []
    while len(left) > 3:
        i = _next_ear(corners, left)
        triangles.append((left[i - 1], left[i], left[(i + 1) % len(left)]))
        del left[i]
    return np.array([*triangles, left], np.int32)


def _next_ear(corners: Sequence[Corner], left: Sequence[int]) -> int:
    for i in range(len(left)):
        a, b, c = (corners[left[k % len(left)]] for k in (i - 1, i, i + 1))
        if turn(a, b, c) <= 0:
            continue
        rest = (corners[k] for k in left if corners[k] not in (a, b, c))
        if not any(turn(a, b, p) >= 0 and turn(b, c, p) >= 0 and turn(c, a, p) >= 0 for p in rest):
            return i
    raise ValueError("the polygon is not simple")


def prism_mesh(
    corners: Sequence[Corner],
    low: float,
    high: float,
    color: tuple[float, float, float, float] = (0.7, 0.72, 0.75, 1.0),
) -> Mesh:
    """The closed prism over a simple polygon between two heights [m]; faces outward, exact."""
    n = len(corners)
    ring = np.asarray(corners, float)
    vertices = np.vstack([np.column_stack([ring, np.full(n, z)]) for z in (low, high)])
    top = triangulate(corners)
    i = np.arange(n)
    j = (i + 1) % n
    if signed_area(corners) < 0:
        i, j = j, i
    sides = np.vstack([np.column_stack([i, j, j + n]), np.column_stack([i, j + n, i + n])])
    return Mesh(vertices, np.vstack([top[:, ::-1], top + n, sides]).astype(np.int32), color)


SHORTEST = 1e-6
"""Pieces below it are left out [m]."""


class Piece(NamedTuple):
    """A straight piece, or an arc."""

    start: float
    """Along the way [m]."""
    length: float
    """[m]"""
    x: float
    y: float
    """Where it begins [m]."""
    heading: float
    """There, from x about z [rad]."""
    curvature: float
    """1/m, positive to the left; 0 where it is straight."""

    def at(self, s: float) -> tuple[float, float, float]:
        """x, y [m] and heading [rad] ``s`` [m] after its begin."""
        turned = self.curvature * s
        # sin(turned / 2) / (turned / 2) keeps its digits where it hardly bends.
        chord = s * float(np.sinc(turned / 2 / math.pi))
        middle = self.heading + turned / 2
        return self.x + chord * math.cos(middle), self.y + chord * math.sin(middle), self.heading + turned


class Track(NamedTuple):
    """A way whose heading does not jump."""

    pieces: tuple[Piece, ...]

    @classmethod
    def rounded(cls, points: Sequence[tuple[float, float]], radius: float, *, closed: bool) -> Self:
        """The way along points, its corners rounded.

        Args:
            points: Corners (x, y) [m].
            radius: Of the arcs [m].
            closed: Whether the last point is followed by the first.

        Raises:
            ValueError: Two points in one place, a corner without a radius, one that turns back, or arcs that
                do not fit between their neighbours.
        """
        corners = np.array(points, float)
        n = len(corners)
        if closed and n < 3:
            raise ValueError("a closed way has three points or more")
        legs = np.roll(corners, -1, axis=0) - corners if closed else np.diff(corners, axis=0)
        lengths = np.hypot(legs[:, 0], legs[:, 1])
        if (lengths < SHORTEST).any():
            k = int(np.argmin(lengths))
            raise ValueError(f"points[{k}] and the next are in one place: remove one")
        headings = np.arctan2(legs[:, 1], legs[:, 0])
        # Corner k lies between leg k - 1 and leg k.
        turns = np.array([_turn(headings[k - 1], headings[k]) for k in range(len(legs))])
        if not closed:
            turns[0] = 0.0
        if (np.abs(turns) > math.pi - 1e-3).any():
            k = int(np.argmax(np.abs(turns)))
            raise ValueError(f"the way turns back at points[{k}]: add points for a curve")
        if radius == 0 and (np.abs(turns) > 1e-9).any():
            raise ValueError("a way with corners needs a radius that rounds them")
        cut = radius * np.tan(np.abs(turns) / 2)
        after = np.append(cut[1:], cut[0] if closed else 0.0)
        left = lengths - cut - after
        if (left < -1e-9).any():
            k = int(np.argmin(left))
            raise ValueError(f"radius = {radius:g} m does not fit between points[{k}] and the next")
        pieces: list[Piece] = []

        def add(length: float, curvature: float, begin: tuple[float, float, float]) -> None:
            if length > SHORTEST:
                start = pieces[-1].start + pieces[-1].length if pieces else 0.0
                pieces.append(Piece(start, length, *begin, curvature))

        for k, heading in enumerate(headings.tolist()):
            forth = np.array([math.cos(heading), math.sin(heading)])
            begin = corners[k] + cut[k] * forth
            add(float(left[k]), 0.0, (float(begin[0]), float(begin[1]), heading))
            turn = float(turns[(k + 1) % n]) if closed or k + 1 < len(turns) else 0.0
            end = begin + left[k] * forth
            if turn:
                bend = (float(end[0]), float(end[1]), heading)
                add(radius * abs(turn), math.copysign(1 / radius, turn), bend)
        return cls(tuple(pieces))

    @property
    def length(self) -> float:
        """From its begin to its end [m]."""
        return self.pieces[-1].start + self.pieces[-1].length

    def at(self, s: float) -> tuple[Array, Array]:
        """Where something stands that has come ``s`` [m].

        Returns:
            x, y [m] and heading [rad]; and how they change per metre, shape (3,) each.
        """
        k = max(0, bisect_right([piece.start for piece in self.pieces], s) - 1)
        piece = self.pieces[k]
        x, y, heading = piece.at(min(s - piece.start, piece.length))
        return np.array([x, y, heading]), np.array([math.cos(heading), math.sin(heading), piece.curvature])


def _turn(before: float, after: float) -> float:
    """From one heading to the next, the short way [rad]."""
    return (after - before + math.pi) % math.tau - math.pi
