"""Shapes with one meaning each: a closed set, exact for distances.

A solid is a *core* dilated by a radius: a triangle mesh (radius 0 or a stated envelope), a
segment (capsule; a sphere when its ends coincide) or a rectangle (dilated plane).
All coordinates are in the frame of the body that carries the solid [m].
"""

from __future__ import annotations

from dataclasses import dataclass, field

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

    def __post_init__(self) -> None:
        if (self.mesh is None) == (self.points is None):
            raise ValueError("a Solid has either a mesh or the points of a segment or a rectangle")
        if self.points is not None and self.points.shape not in ((2, 3), (3, 3)):
            raise ValueError(f"points must be (2, 3) or (3, 3), not {self.points.shape}")
        if not (np.isfinite(self.radius) and self.radius >= 0):
            raise ValueError(f"radius must be finite and at least 0 m, not {self.radius}")


def capsule(start: Array, end: Array, radius: float, *, name: str = "") -> Solid:
    """A capsule; a sphere when the ends coincide. Points (3,) [m], radius [m]."""
    return Solid(points=np.array([start, end], float), radius=radius, name=name)


def dilated_rectangle(corner: Array, u: Array, v: Array, radius: float, *, name: str = "") -> Solid:
    """A rectangle with edges ``u`` and ``v`` from ``corner`` (each (3,) [m]), dilated by ``radius`` [m]."""
    corner, u, v = (np.asarray(x, float) for x in (corner, u, v))
    return Solid(points=np.array([corner, corner + u, corner + v]), radius=radius, name=name)
