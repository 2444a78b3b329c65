"""Meshes of simple shapes: none is inside the shape that it stands for, or says by how much it is."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.shapes import Mesh, Solid
from seerob.core.transforms import Array
from seerob.description.shapes import moments
from seerob.description.shapes.glb import solid_mesh
from seerob.description.shapes.moments import Moments
from seerob.description.shapes.shapes import box_mesh, capsule_mesh, lathe_mesh, sphere_mesh

SIDES = 64
"""Corners of a cylinder or a cone, outside the circle."""
_AROUND = 1 / math.cos(math.pi / SIDES)
_BALL = 1 / math.cos(math.pi / 16)
"""Of the meshes of balls and capsules, whose flat ends begin a 16th of half a turn from the pole."""


def around(solid: Solid) -> tuple[Mesh, float]:
    """A mesh of any solid, and how far the real surface may lie outside of it [m]."""
    if solid.points is None:
        assert solid.mesh is not None
        return solid.mesh, solid.deviation + solid.radius
    if len(solid.points) == 2:
        return rounded(solid.points[0], solid.points[1], solid.radius), solid.deviation
    # Its corners lie on the surface, 20 on a circle.
    sagitta = solid.radius * (1 - math.cos(math.pi / 20) ** 2)
    return solid_mesh(solid), solid.deviation + sagitta


class Contained(NamedTuple):
    """A simple shape in a mesh around it."""

    mesh: Mesh
    moments: Moments
    """Of the shape itself."""
    off: float
    """How far the mesh is outside of it, at most [m]."""


def box(half: float) -> Contained:
    """A cube about the origin, by half of its size [m]."""
    mesh = box_mesh([-half] * 3, [half] * 3)
    return Contained(mesh, moments.of_closed_mesh(mesh), 0.0)


def ball_within(radius: float) -> Contained:
    """A ball about the origin."""
    middle = np.zeros(3)
    return Contained(ball(radius), moments.of_capsule(middle, middle, radius), radius * (_BALL - 1))


def capsule_within(start: Array, end: Array, radius: float) -> Contained:
    """A capsule between two points."""
    shape = moments.of_capsule(start, end, radius)
    return Contained(rounded(start, end, radius), shape, radius * (_BALL - 1))


def cylinder_within(start: Array, end: Array, radius: float) -> Contained:
    """A cylinder between two points."""
    shape = moments.of_cylinder(start, end, radius)
    return Contained(cylinder(start, end, radius), shape, radius * (_AROUND - 1))


def cone_within(start: Array, end: Array, radius: float) -> Contained:
    """A cone from its base to its tip."""
    shape = moments.of_cone(start, end, radius)
    return Contained(cylinder(start, end, radius, 0.0), shape, radius * (_AROUND - 1))


def ball(radius: float) -> Mesh:
    """About the origin; at most 2 % of the radius larger."""
    return sphere_mesh(np.zeros(3), radius * _BALL)


def rounded(start: ArrayLike, end: ArrayLike, radius: float) -> Mesh:
    """A capsule between two points; at most 2 % of the radius larger."""
    return capsule_mesh(start, end, radius * _BALL)


def cylinder(start: ArrayLike, end: ArrayLike, radius: float, top: float | None = None) -> Mesh:
    """A cylinder, or a cone with another radius at its end; at most 0.13 % of the radius larger."""
    length = float(np.linalg.norm(np.subtract(end, start)))
    profile = [(radius * _AROUND, 0.0), ((radius if top is None else top) * _AROUND, length)]
    return lathe_mesh(start, end, profile, sides=SIDES)
