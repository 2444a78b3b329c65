"""Meshes of simple shapes: boxes and bodies of revolution, closed and counter-clockwise from outside."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.shapes import Mesh, Solid, capsule
from seerob.core.transforms import Array
from seerob.description.shapes.hull import convex_hull

Color = tuple[float, float, float, float]
GREY: Color = (0.7, 0.72, 0.75, 1.0)

PRISM_SIDES = 16
"""Sides of the prism that stands for a cylinder in distances."""


def box_mesh(lower: ArrayLike, upper: ArrayLike, color: Color = GREY) -> Mesh:
    """An axis-aligned box of 12 triangles.

    Args:
        lower: Corner with the smallest coordinates [m], shape (3,).
        upper: Opposite corner [m], shape (3,).
        color: Red, green, blue, alpha.
    """
    corners = np.array([lower, upper], float)
    # Corner i has x from bit 0, y from bit 1, z from bit 2.
    vertices = np.array(
        [[corners[i & 1, 0], corners[i >> 1 & 1, 1], corners[i >> 2 & 1, 2]] for i in range(8)]
    )
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return Mesh(vertices, np.array(faces, np.int32), color)


def frame_along(axis: ArrayLike) -> Array:
    """A rotation (3, 3) whose third column is along ``axis`` (3,), of any length but zero."""
    z = np.asarray(axis, float) / np.linalg.norm(axis)
    x = np.eye(3)[int(np.abs(z).argmin())]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def lathe_mesh(
    start: ArrayLike,
    end: ArrayLike,
    profile: Sequence[tuple[float, float]],
    *,
    sides: int,
    color: Color = GREY,
) -> Mesh:
    """A closed body of revolution about the line from ``start`` to ``end``.

    Args:
        start: Point of the axis where the height is 0 [m], shape (3,).
        end: Another point of the axis, towards which the height grows [m], shape (3,).
        profile: (radius, height) [m] with heights that do not decrease; flat caps are added.
        sides: Points around.
        color: Red, green, blue, alpha.
    """
    start, end = np.asarray(start, float), np.asarray(end, float)
    rotation = frame_along(end - start)
    angles = (np.arange(sides) + 0.5) * (2 * math.pi / sides)
    rings = [np.column_stack([r * np.cos(angles), r * np.sin(angles), np.full(sides, h)]) for r, h in profile]
    centers = np.array([[0, 0, profile[0][1]], [0, 0, profile[-1][1]]])
    vertices = np.concatenate([*rings, centers]) @ rotation.T + start
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [np.column_stack([np.full(sides, len(vertices) - 2), j, i])]
    for k in range(len(profile) - 1):
        low, high = k * sides, (k + 1) * sides
        faces += [
            np.column_stack([low + i, low + j, high + j]),
            np.column_stack([low + i, high + j, high + i]),
        ]
    top = (len(profile) - 1) * sides
    faces.append(np.column_stack([np.full(sides, len(vertices) - 1), top + i, top + j]))
    return Mesh(vertices, np.concatenate(faces).astype(np.int32), color)


def cylinder_mesh(
    start: ArrayLike, end: ArrayLike, radius: float, *, sides: int = 48, color: Color = GREY
) -> Mesh:
    """A cylinder for display; its corners lie on the circle, so it is never larger than the real one."""
    length = float(np.linalg.norm(np.subtract(end, start)))
    return lathe_mesh(start, end, [(radius, 0.0), (radius, length)], sides=sides, color=color)


def prism_mesh(start: ArrayLike, end: ArrayLike, radius: float, *, sides: int = PRISM_SIDES) -> Mesh:
    """The regular prism around a cylinder: contains it, sides touch it.

    Its edges stick out by ``radius · (1 / cos(π / sides) - 1)``, 2 % of the radius for 16 sides.
    """
    outer = radius / math.cos(math.pi / sides)
    length = float(np.linalg.norm(np.subtract(end, start)))
    return lathe_mesh(start, end, [(outer, 0.0), (outer, length)], sides=sides)


def rounded_profile(
    radius: float, length: float, rounding: float, *, steps: int = 4
) -> list[tuple[float, float]]:
    """Profile for `lathe_mesh` of a cylinder with rounded rims, all lengths in metres."""
    rounding = max(min(rounding, 0.5 * length, radius), 0.0)
    arc = [(math.sin(t), 1 - math.cos(t)) for t in np.linspace(0, math.pi / 2, steps + 1)]
    rim = [(radius - rounding + rounding * s, rounding * c) for s, c in arc]
    return rim + [(r, length - h) for r, h in reversed(rim)]


def sphere_mesh(center: ArrayLike, radius: float, *, color: Color = GREY) -> Mesh:
    """A sphere for display, its corners on the sphere."""
    center = np.asarray(center, float)
    angles = np.linspace(0, math.pi, 17)[1:-1]
    profile = [(radius * math.sin(t), radius * (1 - math.cos(t))) for t in angles]
    down = np.array([0, 0, radius])
    return lathe_mesh(center - down, center + down, profile, sides=24, color=color)


def capsule_mesh(start: ArrayLike, end: ArrayLike, radius: float, *, color: Color = GREY) -> Mesh:
    """A capsule for display, its corners on the capsule."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(end - start))
    if length == 0.0:
        return sphere_mesh(start, radius, color=color)
    axis = (end - start) / length
    profile = rounded_profile(radius, length + 2 * radius, radius, steps=8)
    return lathe_mesh(start - radius * axis, end + radius * axis, profile[1:-1], sides=24, color=color)


def sphere_solid(center: ArrayLike, radius: float, *, name: str = "") -> Solid:
    """A sphere, exact: a point dilated by ``radius`` [m]."""
    center = np.asarray(center, float)
    return capsule(center, center, radius, name=name)


def cylinder_solid(start: ArrayLike, end: ArrayLike, radius: float, *, name: str = "") -> Solid:
    """A cylinder as the prism of 64 sides around it; the note says by how much it sticks out."""
    excess = radius * (1 / math.cos(math.pi / 64) - 1)
    note = f"cylinder as a circumscribed prism of 64 sides, at most {excess * 1e3:.2g} mm larger"
    return Solid(mesh=prism_mesh(start, end, radius, sides=64), name=name, note=note)


def hull_mesh(meshes: Sequence[Mesh], color: Color = GREY) -> Mesh:
    """The convex hull of meshes: closed, counter-clockwise from outside."""
    points = np.concatenate([mesh.vertices for mesh in meshes])
    faces = convex_hull(points)
    if faces is None:
        raise ValueError("these meshes are flat and have no hull")
    used, index = np.unique(faces, return_inverse=True)
    return Mesh(points[used], index.reshape(faces.shape).astype(np.int32), color)
