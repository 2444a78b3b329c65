r"""Volume, centre and second moments of shapes of uniform density 1: closed forms and exact integrals.

A dilated rectangle with edges :math:`a, b` and radius :math:`r` is a slab, two pairs of half cylinders
and four quarter balls, so that with :math:`x` along :math:`a`

.. math::
    V = 2abr + \pi r^2 (a + b) + \tfrac43 \pi r^3

    \int x^2 = \tfrac{a^2}{12}(2abr + \pi r^2 a) + b\left(\tfrac{\pi r^2 a^2}{4} + \tfrac43 a r^3
    + \tfrac{\pi r^4}{4}\right) + \tfrac{\pi r^3 a^2}{3} + \tfrac{\pi r^4 a}{2} + \tfrac{4 \pi r^5}{15}

    \int z^2 = \tfrac23 a b r^3 + \tfrac{\pi r^4}{4}(a + b) + \tfrac{4 \pi r^5}{15}

and a capsule is the case :math:`b = 0`, a ball :math:`a = b = 0`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import pi

import numpy as np

from seerob.core.shapes import Mesh, Solid
from seerob.core.snapshot import Origin
from seerob.core.transforms import Array
from seerob.description.description import Inertial


@dataclass(frozen=True, eq=False)
class Moments:
    """What the mass properties of a shape of uniform density follow from."""

    volume: float
    """[m³]"""
    com: Array
    """Centre of volume [m], shape (3,)."""
    inertia: Array
    """About the centre, at density 1 [m⁵], shape (3, 3)."""

    @property
    def second(self) -> Array:
        """Second moments about the centre, at density 1 [m⁵], shape (3, 3)."""
        return np.asarray(np.trace(self.inertia) / 2 * np.eye(3) - self.inertia)

    def moved(self, matrix: Array) -> Moments:
        """Moments of the shape under an affine map (4, 4), which may stretch or mirror it."""
        linear = matrix[:3, :3]
        share = abs(float(np.linalg.det(linear)))
        second = share * linear @ self.second @ linear.T
        com = linear @ self.com + matrix[:3, 3]
        return Moments(share * self.volume, com, np.trace(second) * np.eye(3) - second)

    def inertial(self, *, mass: float, origin: Origin, source: str, error: float = 0.0) -> Inertial:
        """Mass properties of this shape when it has this mass [kg]."""
        return Inertial(mass, self.com, self.inertia * (mass / self.volume), origin, source, error)


def combined(shapes: Iterable[Moments]) -> Moments:
    """Moments of several shapes of equal density together; what overlaps counts twice."""
    shapes = tuple(shapes)
    volume = sum(s.volume for s in shapes)
    com = sum((s.volume * s.com for s in shapes), np.zeros(3)) / volume
    inertia = np.zeros((3, 3))
    for s in shapes:
        d = s.com - com
        inertia += s.inertia + s.volume * (d @ d * np.eye(3) - np.outer(d, d))
    return Moments(volume, com, inertia)


def of_solid(solid: Solid) -> Moments:
    """Moments of a solid; of a mesh those of `of_closed_mesh`, whatever its envelope.

    Raises:
        ValueError: the solid has no volume.
    """
    if solid.mesh is not None:
        return of_closed_mesh(solid.mesh)
    assert solid.points is not None
    if len(solid.points) == 2:
        return of_capsule(solid.points[0], solid.points[1], solid.radius)
    corner, u, v = solid.points[0], solid.points[1] - solid.points[0], solid.points[2] - solid.points[0]
    return of_dilated_rectangle(corner, u, v, solid.radius)


def of_capsule(start: Array, end: Array, radius: float) -> Moments:
    """Moments of a capsule between two points (3,) [m], or of a ball when they coincide.

    Raises:
        ValueError: the radius is not positive.
    """
    start, end = np.asarray(start, float), np.asarray(end, float)
    return of_dilated_rectangle(start, end - start, np.zeros(3), radius)


def of_cylinder(start: Array, end: Array, radius: float) -> Moments:
    """Moments of a cylinder between two points (3,) [m]."""
    return _about_axis(start, end, lambda h: (pi * radius**2 * h, h / 2, radius**2 / 4, h**2 / 12))


def of_cone(start: Array, end: Array, radius: float) -> Moments:
    """Moments of a cone with its base at one point and its tip at another, (3,) each [m]."""
    return _about_axis(
        start, end, lambda h: (pi * radius**2 * h / 3, h / 4, 3 * radius**2 / 20, 3 * h**2 / 80)
    )


def _about_axis(
    start: Array, end: Array, figures: Callable[[float], tuple[float, float, float, float]]
) -> Moments:
    """Moments of a body about an axis: volume, centre, and second moments per volume, across and along."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    axis = end - start
    length = float(np.linalg.norm(axis))
    volume, center, across, along = figures(length)
    axis /= length
    second = volume * (across * np.eye(3) + (along - across) * np.outer(axis, axis))
    return Moments(volume, start + center * axis, np.trace(second) * np.eye(3) - second)


def of_dilated_rectangle(corner: Array, u: Array, v: Array, radius: float) -> Moments:
    """Moments of a rectangle with edges ``u`` and ``v`` from ``corner`` (each (3,) [m]), dilated.

    Raises:
        ValueError: the radius is not positive.
    """
    corner, u, v = (np.asarray(x, float) for x in (corner, u, v))
    r = float(radius)
    if not r > 0:
        raise ValueError(f"a solid of radius {r} m has no volume of its own")
    a, b = float(np.linalg.norm(u)), float(np.linalg.norm(v))
    volume = 2 * a * b * r + pi * r**2 * (a + b) + 4 / 3 * pi * r**3
    xx, yy = _along(a, b, r), _along(b, a, r)
    zz = 2 / 3 * a * b * r**3 + pi * r**4 / 4 * (a + b) + 4 * pi * r**5 / 15
    frame = _axes(u, v)
    inertia = frame @ np.diag([yy + zz, xx + zz, xx + yy]) @ frame.T
    return Moments(volume, corner + (u + v) / 2, (inertia + inertia.T) / 2)


def _axes(u: Array, v: Array) -> Array:
    """Rotation (3, 3) whose first columns point along ``u`` and ``v``, or across where one is zero."""
    if not u.any():
        u = _across(v) if v.any() else np.array([1.0, 0.0, 0.0])
    if not v.any():
        v = _across(u)
    x = u / np.linalg.norm(u)
    y = v - (v @ x) * x
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def _across(axis: Array) -> Array:
    return np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])


def _along(a: float, b: float, r: float) -> float:
    slab_and_ends = a**2 / 12 * (2 * a * b * r + pi * r**2 * a)
    sides = b * (pi * r**2 * a**2 / 4 + 4 / 3 * a * r**3 + pi * r**4 / 4)
    corners = pi * r**3 * a**2 / 3 + pi * r**4 * a / 2 + 4 * pi * r**5 / 15
    return slab_and_ends + sides + corners


def signed_volume(mesh: Mesh) -> float:
    """Volume of a closed mesh [m³], negative when it is inside out."""
    corners = mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0)
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


def of_closed_mesh(mesh: Mesh) -> Moments:
    """Exact moments of what a closed mesh with outward normals encloses: a sum over tetrahedra.

    Raises:
        ValueError: the enclosed volume is not positive.
    """
    # From a point of the mesh, not from a far origin, so that the tetrahedra do not cancel.
    origin = mesh.vertices.mean(axis=0)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces] - origin, 1, 0)
    six = np.einsum("ij,ij->i", a, np.cross(b, c))
    volume = float(six.sum() / 6)
    if not volume > 0:
        raise ValueError(f"the mesh encloses {volume} m³: open, flat or inside out")
    total = a + b + c
    com = six @ total / 24 / volume
    # Over a tetrahedron with one corner at the origin: ∫ x xᵀ = det / 120 (Σ pᵢ pᵢᵀ + s sᵀ), s = Σ pᵢ.
    second = sum(np.einsum("i,ij,ik->jk", six, p, p) for p in (a, b, c, total)) / 120
    second = second - volume * np.outer(com, com)
    return Moments(volume, origin + com, np.trace(second) * np.eye(3) - second)
