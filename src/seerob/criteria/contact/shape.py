r"""How sharp a surface is where it could touch somebody: radii of curvature and edges of a mesh.

Coplanar triangles are joined to facets. Two facets that meet convexly at the angle :math:`\theta`,
their centroids at distances :math:`c_1, c_2` from the edge, are chords of a circle of the radius

.. math:: R = \min(c_1, c_2) / \sin(\theta / 2)

exactly, when the vertices of a cylinder lie on its surface. Where a mesh turns by more than `SMOOTH`
in one step it does not tell a rounding from a sharp edge: the radius there is unknown, between zero
and what the mesh resolves. So it is at a vertex that is the apex of such a turn, and at open borders.

The workstation file may say how parts of a robot touch instead of their meshes (`given_contacts`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core import figures
from seerob.core.domains import at_least, number
from seerob.core.errors import UnknownName
from seerob.core.shapes import Mesh, Solid
from seerob.core.transforms import Array
from seerob.description.shapes.mesh_bodies import components
from seerob.model.model import Mechanism, Model

SMOOTH = math.radians(30.0)
"""Largest turn between neighbouring facets that is taken as the sampling of a rounding [rad]."""
FLAT = 1e-6
"""Triangles that lie this near to a common plane are one facet [m]; what meshes are simplified by."""
FLAT_TURN = 1e-3
"""And whose normals turn by less than this [rad]: a fine tessellation is no plane."""
NOISE = 5e-6
"""Facets that are not wider than twice this do not tell a rounding from noise of coordinates [m]."""
TRUSTED = 1e-3
"""Radius from which on it does not matter [m]."""
REFERENCE = 1e-4
"""Largest area that counts when patches are put in order of sharpness [m²]."""
HIDDEN = 1e-3
"""A surface that may lie further outside its mesh than this can hide any edge [m]."""

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ContactShape:
    """Surface patches of one solid or body that could touch somebody, the sharpest first."""

    points: Array
    """Middle of the edge or facet that the patch is known from, in the body's frame [m], shape (k, 3)."""
    radii: Array
    """Smaller and larger radius of curvature [m], inf where flat, shape (k, 2)."""
    unknown: str = ""
    """Why the sharpest radius is not known; empty when it is."""
    resolution: float = 0.0
    """Least facet width beside an edge whose radius is unknown [m]."""
    unknown_at: Array | None = None
    """Middles of such edges in the body's frame [m], shape (m, 3)."""

    @property
    def sharpest(self) -> tuple[float, float]:
        """Radii of the known patch that gives the least area [m]."""
        return (float(self.radii[0, 0]), float(self.radii[0, 1])) if len(self.radii) else (math.inf, math.inf)


def patch_area(radii: ArrayLike, indentation: ArrayLike, cap: float) -> Array:
    r"""Contact area of rounded patches pressed into a soft body [m²].

    The ellipse with the half axes :math:`r_i = \sqrt{R_i \min(R_i, d)}`: the contact of a paraboloid at
    the indentation :math:`d` (Hertz), never larger than the projection of the rounding itself. Each half
    axis ends at that of a circle of the area ``cap``, so that a ridge is not wider than a patch is long.

    Args:
        radii: Radii of curvature [m], shape (..., 2); inf where flat.
        indentation: Of the body [m], shape (...), F/k.
        cap: Largest area [m²].
    """
    number("cap", cap, 0.0, unit="m²")
    R, d = at_least("radii", radii, unit="m"), at_least("indentation", indentation, unit="m")[..., None]
    with np.errstate(invalid="ignore"):
        half = np.minimum(np.sqrt(R * np.minimum(R, d)), math.sqrt(cap / math.pi))
    return np.asarray(math.pi * half[..., 0] * half[..., 1])


def force_at_pressure(radii: ArrayLike, pressure: ArrayLike, stiffness: ArrayLike, cap: float) -> Array:
    r"""Largest force up to which a rounded patch never presses harder than a pressure [N].

    The solution of :math:`F = p A(F/k)` with `patch_area`. Its pressure :math:`F / A(F/k)` never falls
    while the force grows: it is :math:`p_0 = k / (\pi \sqrt{R_1 R_2})` until the first half axis has grown
    to its end :math:`H`, and grows from there on. So no force holds where :math:`p_0 > p`; else the
    least of

    .. math:: k R_2 (\pi p H_1 / k)^2 \quad (\text{only } r_1 \text{ at its end}), \qquad
        \pi p H_1 H_2 \quad (\text{both})

    Args:
        radii: Radii of curvature [m], shape (..., 2); inf where flat.
        pressure: [Pa], shape (...).
        stiffness: k of the body [N/m], shape (...).
        cap: See `patch_area`.
    """
    number("cap", cap, 0.0, unit="m²")
    R = at_least("radii", radii, unit="m")
    p, k = at_least("pressure", pressure, unit="Pa"), at_least("stiffness", stiffness, unit="N/m")
    end = math.sqrt(cap / math.pi)
    H = np.minimum(R, end)
    # Indentation at which a half axis ends; the flatter one ends first wherever both exceed the cap.
    depth = np.minimum(R, end**2 / R)
    first = depth[..., 0] <= depth[..., 1]
    H_1 = np.where(first, H[..., 0], H[..., 1])
    R_2 = np.where(first, R[..., 1], R[..., 0])
    one = k * R_2 * (math.pi * p * H_1 / k) ** 2
    both = math.pi * p * H[..., 0] * H[..., 1]
    holds = k <= math.pi * p * np.sqrt(R[..., 0]) * np.sqrt(R[..., 1])
    return np.asarray(np.where(holds, np.minimum(one, both), 0.0))


def round_shape(radius: float) -> ContactShape:
    """A patch with the same radius in all directions [m]."""
    number("radius", radius, 0.0, unit="m")
    return ContactShape(np.zeros((1, 3)), np.full((1, 2), radius))


def mesh_shape(mesh: Mesh, *, dilation: float = 0.0) -> ContactShape:
    """Patches of a mesh.

    A mesh that is not closed and oriented has no outside: every crease counts as convex.

    Args:
        mesh: The surface.
        dilation: Radius of the ball that rolls over it [m].
    """
    vertices, faces = _welded(mesh)
    normals, areas, centres = _triangles(vertices, faces)
    keep = areas > 0
    faces, normals, areas, centres = faces[keep], normals[keep], areas[keep], centres[keep]
    if not len(faces):
        return ContactShape(np.zeros((0, 3)), np.zeros((0, 2)), unknown="the mesh has no surface")
    edges = _edges(vertices, faces)
    n1, n2 = normals[edges.left], normals[edges.right]
    turn = np.arctan2(np.linalg.norm(np.cross(n1, n2), axis=1), np.einsum("ij,ij->i", n1, n2))
    towards = centres[edges.right] - 0.5 * (vertices[edges.start] + vertices[edges.end])
    if edges.closed and _volume(vertices, faces) > 0:
        turn = np.where(np.einsum("ij,ij->i", n1, towards) <= 0, turn, -turn)
    facet = _facets(vertices, faces, normals, edges, turn)
    c = np.minimum(*(_reach(vertices, faces, areas, centres, facet, edges, side) for side in (0, 1)))
    middle = 0.5 * (vertices[edges.start] + vertices[edges.end])

    crease = (facet[edges.left] != facet[edges.right]) & (turn > 0)
    radius = np.full(len(c), np.inf)
    radius[crease] = c[crease] / np.sin(turn[crease] / 2)
    sharp = crease & ((turn > SMOOTH + 1e-6) | ((c < NOISE) & (radius < TRUSTED)))
    # A facet as small as noise leaves the radius as open as a turn in one step does.
    smooth = crease & ~sharp
    radius += dilation
    points, radii = _patches(vertices, edges, facet, radius, middle, smooth)
    apexes = _apexes(vertices, faces, edges, turn, sharp)
    lost = np.vstack([middle[sharp], vertices[apexes], edges.open_middles])
    if dilation > 0 and len(lost):
        points = np.vstack([lost, points])
        radii = np.vstack([np.full((len(lost), 2), dilation), radii])
        lost = lost[:0]
    order = np.argsort(patch_area(radii, np.inf, REFERENCE), kind="stable")
    unknown, resolution = "", 0.0
    if len(lost):
        widths = 2 * c[sharp]
        resolution = float(widths.min()) if len(widths) else 0.0
        what = [
            f"{int(sharp.sum())} edges turn by more than 30° in one step, or on facets as small as noise"
            if sharp.any()
            else "",
            f"{len(apexes)} pointed corners" if len(apexes) and not sharp.any() else "",
            f"{len(edges.open_middles)} open edges" if len(edges.open_middles) else "",
        ]
        unknown = "edge radius below mesh resolution"
        unknown += f" ({resolution * 1e3:.3g} mm)" if resolution else ""
        unknown += ": " + ", ".join(filter(None, what))
    return ContactShape(points[order], radii[order], unknown, resolution, lost)


def solid_shape(solid: Solid) -> ContactShape:
    """Patches of one solid: a capsule's and a dilated rectangle's ends are as round as their dilation."""
    if solid.mesh is None:
        assert solid.points is not None
        radii = np.full((len(solid.points), 2), solid.radius)
        shape = ContactShape(np.asarray(solid.points, float), radii)
        unknown = "" if solid.radius > 0 else "a shape without thickness has no edge radius"
    else:
        shape = mesh_shape(solid.mesh, dilation=solid.radius)
        unknown = shape.unknown
    if solid.note:
        unknown = f"its surface is not the real one ({solid.note})"
    elif solid.deviation > HIDDEN:
        off = figures.rounded_up(solid.deviation * 1e3, "mm")
        unknown = f"the real surface may lie {off} outside the shape that is known"
    return ContactShape(shape.points, shape.radii, unknown, shape.resolution, shape.unknown_at)


@lru_cache(maxsize=256)
def body_shape(solids: tuple[Solid, ...]) -> ContactShape:
    """Patches of all solids of a body; meshes are looked at once."""
    found = [solid_shape(solid) for solid in solids]
    points = np.vstack([np.zeros((0, 3)), *(s.points for s in found)])
    radii = np.vstack([np.zeros((0, 2)), *(s.radii for s in found)])
    lost = [s.unknown_at for s in found if s.unknown_at is not None]
    order = np.argsort(patch_area(radii, np.inf, REFERENCE), kind="stable")
    return ContactShape(
        points[order],
        radii[order],
        next((s.unknown for s in found if s.unknown), "" if found else "it has no shape"),
        min((s.resolution for s in found if s.resolution), default=0.0),
        np.vstack([np.zeros((0, 3)), *lost]),
    )


# -- from triangles to facets and edges ---------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges between two triangles."""

    start: Indices
    end: Indices
    left: Indices
    right: Indices
    open_middles: Array
    """Of edges that do not join exactly two triangles."""
    closed: bool
    """Closed, and neighbours agree on which side is out."""


def _welded(mesh: Mesh) -> tuple[Array, Indices]:
    vertices, index = np.unique(np.asarray(mesh.vertices, float), axis=0, return_inverse=True)
    return vertices, index.ravel()[np.asarray(mesh.faces, np.int64)]


def _triangles(vertices: Array, faces: Indices) -> tuple[Array, Array, Array]:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    double = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(double, 1e-300)[:, None], double / 2, (a + b + c) / 3


def _volume(vertices: Array, faces: Indices) -> float:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def _edges(vertices: Array, faces: Indices) -> _Edges:
    half = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    owner = np.tile(np.arange(len(faces)), 3)
    low, high = half.min(1), half.max(1)
    key = low * len(vertices) + high
    order = np.argsort(key, kind="stable")
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    pair = first[count == 2]
    one, two = order[pair], order[pair + 1]
    odd = order[first[count != 2]]
    opposite = bool((half[one, 0] != half[two, 0]).all())
    middles = 0.5 * (vertices[low[odd]] + vertices[high[odd]])
    return _Edges(low[one], high[one], owner[one], owner[two], middles, opposite and len(odd) == 0)


def _facets(vertices: Array, faces: Indices, normals: Array, edges: _Edges, turn: Array) -> Indices:
    """Facet of each triangle. A group that turns out to be curved stays single triangles."""
    n = len(faces)
    apex = np.zeros(len(turn))
    base = vertices[edges.start]
    for near, far in ((edges.left, edges.right), (edges.right, edges.left)):
        height = np.einsum("eij,ej->ei", vertices[faces[far]] - base[:, None], normals[near])
        apex = np.maximum(apex, np.abs(height).max(axis=1))
    same = (apex < FLAT) & (np.abs(turn) < FLAT_TURN)
    count, label = components(n, np.column_stack([edges.left[same], edges.right[same]]))
    seed = np.full(count, n)
    np.minimum.at(seed, label, np.arange(n))
    offset = np.einsum(
        "tij,tj->ti", vertices[faces] - vertices[faces[seed[label], 0]][:, None], normals[seed[label]]
    )
    bent = np.zeros(count, bool)
    np.logical_or.at(bent, label, np.abs(offset).max(axis=1) > 4 * FLAT)
    return np.asarray(np.where(bent[label], count + np.arange(n), label))


def _reach(
    vertices: Array, faces: Indices, areas: Array, centres: Array, facet: Indices, edges: _Edges, side: int
) -> Array:
    """Distance of the centroid of the facet on one side from the edge [m], shape (e,)."""
    _, dense = np.unique(facet, return_inverse=True)
    weight = np.bincount(dense, areas)
    centroid = (
        np.column_stack([np.bincount(dense, areas * centres[:, i]) for i in range(3)]) / weight[:, None]
    )
    line = vertices[edges.end] - vertices[edges.start]
    line = line / np.linalg.norm(line, axis=1)[:, None]
    arm = centroid[dense[(edges.left, edges.right)[side]]] - vertices[edges.start]
    return np.asarray(np.linalg.norm(arm - np.einsum("ij,ij->i", arm, line)[:, None] * line, axis=1))


def _patches(
    vertices: Array, edges: _Edges, facet: Indices, radius: Array, middle: Array, smooth: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """For each facet beside a rounding: the least radius, and the least across it, or flat."""
    rows = np.flatnonzero(smooth)
    if not len(rows):
        return np.zeros((0, 3)), np.zeros((0, 2))
    line = vertices[edges.end] - vertices[edges.start]
    line = line / np.linalg.norm(line, axis=1)[:, None]
    who = np.concatenate([facet[edges.left[rows]], facet[edges.right[rows]]])
    edge = np.concatenate([rows, rows])
    order = np.lexsort((radius[edge], who))
    who, edge = who[order], edge[order]
    groups, first, group = np.unique(who, return_index=True, return_inverse=True)
    sharpest = edge[first]
    # An edge at more than 45° to the sharpest one shows the curvature in the other direction.
    across = np.abs(np.einsum("ij,ij->i", line[edge], line[sharpest[group]])) < math.sqrt(0.5)
    second = np.full(len(groups), np.inf)
    np.minimum.at(second, group[across], radius[edge[across]])
    return middle[sharpest], np.column_stack([radius[sharpest], second])


def _apexes(vertices: Array, faces: Indices, edges: _Edges, turn: Array, sharp: NDArray[np.bool_]) -> Indices:
    """Convex vertices as pointed as a cone whose sides turn by more than `SMOOTH` across it."""
    total = np.zeros(len(vertices))
    for i in range(3):
        a = vertices[faces[:, (i + 1) % 3]] - vertices[faces[:, i]]
        b = vertices[faces[:, (i + 2) % 3]] - vertices[faces[:, i]]
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
        total += np.bincount(faces[:, i], angle, minlength=len(vertices))
    dented = np.zeros(len(vertices), bool)
    edged = np.zeros(len(vertices), bool)
    for ends in (edges.start, edges.end):
        dented[ends[turn < -1e-3]] = True
        edged[ends[sharp]] = True
    used = np.bincount(faces.ravel(), minlength=len(vertices)) > 0
    pointed = 2 * math.pi - total > 2 * math.pi * (1 - math.cos(SMOOTH / 2)) + 1e-6
    return np.flatnonzero(used & pointed & ~dented & ~edged)


def given_contacts(
    model: Model, robot: Mechanism, radii: Mapping[str, float], areas: Mapping[str, float]
) -> tuple[dict[int, float], dict[int, float], dict[int, str]]:
    """Radii and areas by moving body: of several names that mean it, that of the fewest bodies counts.

    Of names that mean as many an area counts before a radius, and the lesser one. The robot's name means the
    links up to its flange here, for how an arm touches says nothing of its tool.

    Args:
        model: The compiled workstation.
        robot: The robot.
        radii: Of its sharpest edges, by name [m].
        areas: Of its smallest contacts, by name [m²].

    Returns:
        Radii [m], areas [m²], and the name by which each is given.

    Raises:
        UnknownName: A part that the robot does not move.
    """
    meant: list[tuple[int, int, float, str, list[int]]] = []
    arm = {i for i in robot.bodies if model.bodies[i].mj not in robot.load}
    for kind, given in enumerate((radii, areas)):
        for name, value in given.items():
            named = {*model.select(name)}
            bodies = [i for i in robot.moving if i in (arm if name == robot.name else named)]
            if not bodies:
                known = [model.bodies[i].name for i in robot.moving]
                raise UnknownName(f"moving part of {robot.name}", name, known)
            meant.append((-len(named.intersection(robot.moving)), kind, -value, name, bodies))
    found: tuple[dict[int, float], dict[int, float]] = {}, {}
    by: dict[int, str] = {}
    for _, kind, value, name, bodies in sorted(meant):
        for body in bodies:
            found[1 - kind].pop(body, None)
            found[kind][body] = -value
            by[body] = name
    return *found, by
