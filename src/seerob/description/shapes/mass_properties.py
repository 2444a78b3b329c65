"""Mass, centre of mass and inertia from shape and uniform density, with method and error stated.

A closed mesh is integrated exactly; an inverted one is turned; an open one is mended, flooded or wrapped in
its hull, and the result says so with a bound; what has no volume is refused.

Where the surface is that an open mesh lacks, no mesh tells: a lid is flat, a dome, or the bottom of a bore.
So its volume has a bound only where somebody says how far it may be from what is there (``hole_depth``).
Else the bound is that of flat holes and told as such, and no more is known of what follows: nothing of a
mass by a density, and of a mass that is given that it is somewhere in the hull.

The volume inside a heap of triangles lies between two bounds, by a flood from outside. Every voxel that a
triangle touches, or that is so near to one, is *surface*; what a flood through faces cannot reach from
outside is *inside*. The true volume then lies between the inside voxels, and inside and surface voxels
together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array
from seerob.description.description import Inertial
from seerob.description.shapes import mass_bounds
from seerob.description.shapes.detail import from_manifold, manifold
from seerob.description.shapes.hull import convex_hull
from seerob.description.shapes.mesh_bodies import (
    bodies,
    components,
    flipped,
    is_closed,
    joined,
    joined_unmerged,
    outward,
)
from seerob.description.shapes.mesh_mending import Mended, mended, one_sided
from seerob.description.shapes.moments import (
    Moments,
    combined,
    of_capsule,
    of_closed_mesh,
    of_cone,
    of_cylinder,
    of_dilated_rectangle,
    of_solid,
    signed_volume,
)


class Filled(NamedTuple):
    """Moments of inside voxels plus half of the surface voxels, with the bounds of the volume [m³]."""

    moments: Moments
    low: float
    high: float
    inside: Moments
    """Of the inside voxels alone."""


def voxel_fill(
    mesh: Mesh, *, cells: int = 64, beyond: float = 0.0, rims: Sequence[Array] = ()
) -> Filled | None:
    """Flood-filled moments with ``cells`` voxels along the longest side; None when nothing is inside.

    Args:
        mesh: A heap of triangles.
        cells: How many.
        beyond: How far what it lacks may be from the convex hulls of its holes' rims, or from its triangles
            where no rim is given [m].
        rims: Corners of each [m], shape (n, 3).
    """
    low = mesh.vertices.min(axis=0)
    extent = np.ptp(mesh.vertices, axis=0)
    h = float(extent.max()) / cells
    if not h > 0:
        return None
    more = math.ceil(beyond / h - 1e-9) + bool(rims)
    if 2 * more >= cells:
        return None
    shape = np.ceil(extent / h).astype(int) + 3 + 2 * more
    # An odd offset keeps faces that lie on round coordinates off the voxels' faces.
    origin = low - (1.37 + more) * h
    surface = _touched((mesh.vertices[mesh.faces] - origin) / h, shape)
    for rim in rims:
        _fill_hull(surface, (rim - origin) / h, beyond / h + 1)
    for axis in range(3) if more and not rims else ():
        window = np.pad(surface, [(more, more) if k == axis else (0, 0) for k in range(3)])
        surface = np.asarray(sliding_window_view(window, 2 * more + 1, axis).any(axis=-1))
    inside = ~surface & ~_around(~surface)
    if not inside.any():
        return None
    low_volume = float(inside.sum()) * h**3
    high_volume = low_volume + float(surface.sum()) * h**3
    amid = _of_voxels(inside + 0.5 * surface, origin, h)
    return Filled(amid, low_volume, high_volume, _of_voxels(inside.astype(float), origin, h))


def _fill_hull(grid: NDArray[np.bool_], corners: Array, beyond: float) -> None:
    """Mark unit voxels that are within ``beyond`` − 1 of the convex hull of some corners, and some more."""
    points = (corners[:, None] + beyond * np.array(list(product((-1.0, 1.0), repeat=3)))).reshape(-1, 3)
    faces = convex_hull(points)
    assert faces is not None  # a cube about each corner has a volume
    first = np.maximum(np.floor(points.min(axis=0)).astype(int), 0)
    end = np.minimum(np.ceil(points.max(axis=0)).astype(int) + 1, grid.shape)
    box = grid[tuple(map(slice, first, end))]
    centers = first + np.moveaxis(np.indices(box.shape), 0, -1) + 0.5
    a, b, c = np.moveaxis(points[faces], 1, 0)
    normals = np.cross(b - a, c - a)
    normals *= np.sign(np.einsum("ij,ij->i", normals, a - points.mean(axis=0)))[:, None]
    within = np.ones(box.shape, bool)
    for normal, at in zip(normals, a, strict=True):
        within &= (centers - at) @ normal <= 1e-9
    box |= within


def _of_voxels(weight: Array, origin: Array, h: float) -> Moments:
    """Moments of voxels of size h [m], of which some count in part."""
    index = np.argwhere(weight > 0)
    w = weight[tuple(index.T)] * h**3
    points = origin + (index + 0.5) * h
    volume = float(w.sum())
    com = w @ points / volume
    d = points - com
    second = (d * w[:, None]).T @ d + volume * h * h / 12 * np.eye(3)
    return Moments(volume, com, np.trace(second) * np.eye(3) - second)


def _around(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The cells of a grid that are connected through their faces with its first one, which is free."""
    index = np.arange(free.size).reshape(free.shape)
    pairs = []
    for axis in range(3):
        low, high = np.moveaxis(index, axis, 0)[:-1], np.moveaxis(index, axis, 0)[1:]
        both = np.moveaxis(free, axis, 0)[:-1] & np.moveaxis(free, axis, 0)[1:]
        pairs.append(np.column_stack([low[both], high[both]]))
    _, region = components(free.size, np.concatenate(pairs))
    return np.asarray(region == region[0]).reshape(free.shape)


def _touched(corners: Array, shape: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Unit voxels that triangles (m, 3, 3) overlap: box, plane and the three projected edge tests."""
    grid = np.zeros(tuple(shape), bool)
    first = np.floor(corners.min(axis=1) - 1e-9).astype(np.int64)
    span = np.floor(corners.max(axis=1) + 1e-9).astype(np.int64) - first + 1
    counts = span.prod(axis=1)
    # In portions of bounded memory; one triangle alone may fill the grid's whole box.
    portion = np.cumsum(counts) // 2_000_000
    for p in np.unique(portion):
        chosen = np.flatnonzero(portion == p)
        repeat = np.repeat(chosen, counts[chosen])
        number = np.arange(len(repeat)) - np.repeat(
            np.cumsum(counts[chosen]) - counts[chosen], counts[chosen]
        )
        ny, nz = span[repeat, 1], span[repeat, 2]
        offset = np.column_stack([number // (ny * nz), number // nz % ny, number % nz])
        voxel = first[repeat] + offset
        hit = _overlap(corners[repeat], voxel + 0.5)
        grid[tuple(np.clip(voxel[hit], 0, shape - 1).T)] = True
    return grid


def _overlap(corners: Array, centers: Array) -> NDArray[np.bool_]:
    edges = corners[:, [1, 2, 0]] - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    distance = np.abs(np.einsum("ij,ij->i", normal, centers - corners[:, 0]))
    hit = distance <= np.abs(normal).sum(axis=1) / 2 + 1e-9
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        sign = np.where(normal[:, axis] >= 0, 1.0, -1.0)
        for e in range(3):
            # Inward normal of the projected edge; the square's corner farthest along it decides.
            ni, nj = -sign * edges[:, e, j], sign * edges[:, e, i]
            value = ni * (centers[:, i] - corners[:, e, i]) + nj * (centers[:, j] - corners[:, e, j])
            hit &= value + (np.abs(ni) + np.abs(nj)) / 2 >= -1e-9
    return np.asarray(hit)


__all__ = [
    "Moments",
    "about_its_centre",
    "anywhere",
    "boxes_meet",
    "combined",
    "from_shape",
    "of_capsule",
    "of_closed_mesh",
    "of_cone",
    "of_cylinder",
    "of_dilated_rectangle",
    "of_solid",
]

WORST = 0.5
"""Largest relative error of a volume that a mass may be computed from."""
PATCHED = 0.2
"""Largest share of the surface that may have been missing before mending stops being credible."""


OFF_CENTRE = 1e-3
"""How far a centre of mass that is given may be from that of uniform density, where that is said [m]: a
choice."""
LEAST_GYRATION = 1e-3
"""Radius of gyration that is counted at least of what may be spread anyhow [m]: a choice."""
SLITS = 1e-9
"""Share of the surface that is none: edges of unequal length that meet leave holes without an area."""


class _Estimate(NamedTuple):
    moments: Moments
    method: str
    error: float
    """Of the volume."""
    inertia: float = 0.0
    """By which share what it adds to a mass matrix may be off, in any motion."""
    notes: tuple[str, ...] = ()
    provided: str = ""
    """What the error bound rests on."""
    moved: float = 0.0
    """How far corners were moved [m]."""
    bounded: bool = True
    """Whether somebody says where the surface is that the mesh lacks."""


def from_shape(
    meshes: Sequence[Mesh],
    *,
    density: float | None = None,
    mass: float | None = None,
    deviation: float = 0.0,
    hole_depth: float | None = None,
    subject: str = "mass properties",
) -> tuple[Inertial, tuple[Finding, ...]]:
    """Mass properties of a part of uniform density.

    Args:
        meshes: Its surface, in the part's frame [m]; several are taken together.
        density: Mass per volume [kg/m³]; the mass follows from it.
        mass: Mass [kg]; the inertia is scaled to it. Exactly one of the two.
        deviation: How far the real surface may lie from the meshes, on either side [m].
        hole_depth: How far the surface that they lack may lie beyond the convex hull of each hole's rim [m],
            of a heap of triangles from these; None where nobody says so.
        subject: Full name of the part, for findings and errors.

    Returns:
        The mass properties, whose ``error`` bounds the relative error of the mass (0 of a given one) and
        ``spread_error`` that of all that they add to a mass matrix (0 for a closed mesh without a
        deviation; infinite where nobody gives the depth of holes: then nobody knows the mass, and ``error``
        is that of flat ones), and what was noticed.

    Raises:
        InputError: neither or both are given, or not positive; there is no mesh; or no volume can be had
            from it within `WORST`.
    """
    name = "density" if mass is None else "mass"
    given = density if mass is None else mass
    if given is None or (density is not None and mass is not None):
        what = "neither mass nor density is given" if given is None else "both mass and density are given"
        raise InputError.at(subject, "mass", what, "give one of them")
    if not (np.isfinite(given) and given > 0):
        raise InputError.at(subject, name, f"{given!r} is not a positive number")
    filled = tuple(m for m in meshes if len(m.faces))
    if not filled:
        raise InputError.at(subject, name, "there is no mesh to take mass properties from", "give inertia")
    mesh, dropped = joined(filled)
    if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise InputError.at(subject, name, "the mesh has no area or is not finite", "export it again")
    estimate = _estimate(mesh, subject, strict=mass is None, depth=hole_depth)
    moments = estimate.moments
    near = mass_bounds.off_by(mesh, deviation + estimate.moved, moments)
    error, everything = estimate.error + near.volume, estimate.inertia + near.inertia
    if mass is None and error > WORST:
        what = f"its surface is known within {deviation * 1e3:.3g} mm: no volume within ±{100 * WORST:.0f} %"
        raise InputError.at(subject, "density", what, "give the mass, or a mesh with a smaller deviation")
    if mass is None:
        source = f"{given:g} kg/m³ × volume of {estimate.method}"
        inertial = moments.inertial(
            mass=given * moments.volume, origin=Origin.ESTIMATED, source=source, error=error
        )
        inertial = replace(inertial, spread_error=max(everything, error) if estimate.bounded else np.inf)
    else:
        source = f"mass given; centre and inertia from uniform density over {estimate.method}"
        inertial = moments.inertial(mass=mass, origin=Origin.GIVEN, source=source)
        around = deviation + estimate.moved + (hole_depth or 0.0)
        if not estimate.bounded:
            error = everything = np.inf
        inertial = replace(inertial, spread_error=_of_given(mesh, around, moments, error, everything))
    notes = ((dropped,) if dropped else ()) + estimate.notes
    findings = [Finding(level="note", subject=subject, text=text) for text in notes]
    if error > 0 or estimate.method != _EXACT:
        figure = f"mass {inertial.mass:.4g} kg" if mass is None else "centre of mass and inertia"
        text = f"{figure} from {estimate.method}, volume {_within(error)}{estimate.provided}"
        if deviation > 0:
            text += f", as its surface lies within {deviation * 1e3:.3g} mm"
        if everything > max(error, 1e-4):
            text += f"; in a mass matrix, with centre and inertia, {_within(everything)}"
        if mass is None and not estimate.bounded:
            text += "; nobody says that (hole_depth), and what rests on its mass is undecided"
        elif not estimate.bounded:
            text = (
                f"centre of mass and inertia from {estimate.method}; what lies beyond its holes nobody says "
                "(hole_depth): the mass may be anywhere in its convex hull"
            )
        findings.append(Finding(level="warning" if error > 0.01 else "note", subject=subject, text=text))
    return inertial, tuple(findings)


def anywhere(uniform: Inertial, points: Array, beyond: float) -> Inertial:
    """Mass properties of what may be spread anyhow within its shape; told as those of uniform density.

    Args:
        uniform: At uniform density.
        points: Their convex hull, dilated by ``beyond`` [m], holds all of it, shape (n, 3) [m].
        beyond: How far.
    """
    far = float(np.linalg.norm(points - uniform.com, axis=1).max()) + beyond
    # Of a mass that is given, there is nothing else that its shape leaves open.
    return replace(uniform, within=far, spread_error=0.0 if uniform.error == 0.0 else uniform.spread_error)


def about_its_centre(
    uniform: Inertial, com: Sequence[float], points: Array, beyond: float, *, off: float = 0.0
) -> Inertial:
    """Mass properties of what has a known centre of mass and may be spread anyhow about it.

    Its moments are told as those of uniform density, and may be any that a body has that lies in the box and
    in the ball about its shape. In a ball of radius δ, the mean square distance from a centre that is d from
    the ball's is no more than δ² − d².

    Args:
        uniform: At uniform density.
        com: The centre of mass [m].
        points: Their convex hull, dilated by ``beyond`` [m], holds all of it, shape (n, 3) [m].
        beyond: How far.
        off: How far its centre may be from there, in any direction [m].
    """
    inertial = replace(uniform, com=np.array(com, float))
    reach = beyond + off
    box = points.min(axis=0) - reach, points.max(axis=0) + reach
    far = anywhere(uniform, points, beyond).within
    away = max(float(np.linalg.norm(inertial.com - uniform.com)) - off, 0.0)
    in_ball = math.sqrt(max(far**2 - away**2, 0.0))
    gyration = max(min(mass_bounds.largest_gyration(inertial.com, *box), in_ball), LEAST_GYRATION)
    # Those of uniform density may be more than any that has its centre there.
    share = min(1.0, inertial.mass * gyration**2 / float(np.linalg.eigvalsh(inertial.inertia)[-1]))
    inertial = replace(inertial, gyration=gyration, inertia=share * inertial.inertia)
    # Where mass and centre are given, the moments have a bound of their own.
    return replace(inertial, spread_error=0.0) if uniform.error == 0.0 else inertial


def _of_given(mesh: Mesh, around: float, moments: Moments, error: float, everything: float) -> float:
    """Share by which what a given mass adds to a mass matrix may be off, of a volume that may be off."""
    of_volume = (everything + error) / (1 - error) if error < 1 else np.inf
    if of_volume <= 1:
        return of_volume
    hull = convex_hull(mesh.vertices)
    assert hull is not None  # there is a volume
    # All of it may be anywhere in the hull, out to the corners of a cube about each of the hull's.
    corners = mesh.vertices[np.unique(hull)]
    cube = around * np.array(list(product((-1.0, 1.0), repeat=3)))
    points = (corners[:, None] + cube).reshape(-1, 3)
    return min(of_volume, max(1.0, mass_bounds.off_by_volume(points, moments.volume, moments) - 1))


def _within(error: float) -> str:
    return f"±{100 * error:.{0 if error > 0.1 else 2}f} %" if error > 1e-4 else "exact within 0.01 %"


_EXACT = "the closed mesh"
_NOTHING = Moments(0.0, np.zeros(3), np.zeros((3, 3)))


def _estimate(mesh: Mesh, subject: str, *, strict: bool, depth: float | None) -> _Estimate:
    """The first of: exact integral, mended mesh, voxels, hull, whose bound is good enough."""
    hull = _hull(mesh)
    if hull is None:
        raise InputError.at(
            subject, "mass", "the mesh is flat: it encloses no volume", "give mass, com and inertia by hand"
        )
    missing, rims = 0.0, tuple[Array, ...]()
    single = one_sided(mesh)
    if is_closed(mesh) and not _is_sheet(mesh, hull.volume):
        first = _of_bodies(mesh, _EXACT, ())
    elif is_closed(single) and not _is_sheet(single, hull.volume):
        first = _of_bodies(single, _EXACT, ("its triangles are double-sided: one side was used",))
    else:
        patched = mended(single, depth or 0.0)
        missing = patched.filled
        rims = patched.rims if depth is not None else ()
        first = _of_mended(patched, depth)
    credible = _is_credible(first, hull) and missing <= PATCHED
    bounded = depth is not None or missing <= SLITS
    if credible and first.error <= WORST:
        return first._replace(bounded=bounded)
    flooded = voxel_fill(mesh, beyond=depth or 0.0, rims=rims)
    if flooded is not None:
        error = (flooded.high - flooded.low) / (flooded.high + flooded.low)
        if error <= WORST:
            # Of the half of what is on the surface that may be there or not.
            off = mass_bounds.off_by_difference(flooded.moments, flooded.inside)
            method = "the mesh filled with voxels (open or tangled)"
            provided = ""
            if missing > SLITS:
                provided = f", if no surface is missing farther than {1e3 * (depth or 0.0):.3g} mm from it"
            if rims:
                provided = _in_hulls(depth)
            found = _Estimate(flooded.moments, method, error, max(off, error), provided=provided)
            return found._replace(bounded=bounded)
    if strict:
        raise InputError.at(
            subject,
            "density",
            f"the mesh is open and {100 * missing:.0f} % of a closed surface is missing: no volume within "
            f"±{100 * WORST:.0f} %",
            "give the mass, or close the mesh",
        )
    # What is there bounds a hull from inside only while most of the surface is there.
    inner = first.moments.volume * (1 - min(first.error, 1.0)) if credible else 0.0
    error = 1 - inner / hull.volume
    off = mass_bounds.off_by_difference(hull, first.moments) + first.inertia if credible else 1.0
    found = _Estimate(hull, "the convex hull of the open mesh", error, min(max(off, error), 1.0))
    return found._replace(bounded=bounded and not (depth and missing > SLITS))


def _is_sheet(mesh: Mesh, hull_volume: float) -> bool:
    return sum(abs(signed_volume(b)) for b in bodies(mesh)) <= 1e-9 * hull_volume


def _is_credible(estimate: _Estimate, hull: Moments) -> bool:
    volume, inertia = estimate.moments.volume, estimate.moments.inertia
    if not 1e-9 * hull.volume < volume <= hull.volume * (1 + 1e-9):
        return False
    a, b, c = np.linalg.eigvalsh(inertia)
    return bool(a > 0 and a + b >= c * (1 - 1e-9))


def _hull(mesh: Mesh) -> Moments | None:
    faces = convex_hull(mesh.vertices)
    if faces is None:
        return None
    moments = of_closed_mesh(Mesh(mesh.vertices, faces))
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    return moments if moments.volume > 1e-9 * size**3 else None


def _in_hulls(depth: float | None) -> str:
    """What a bound rests on where holes have rims."""
    within = f"within {1e3 * depth:.3g} mm of" if depth else "in"
    return f", if the holes' true surface lies {within} the hulls of their rims"


def _of_mended(patched: Mended, depth: float | None) -> _Estimate:
    if not np.isfinite(patched.slack):
        return _Estimate(_NOTHING, "a heap of triangles", np.inf)
    method = "the mended mesh (" + ", ".join(patched.steps) + ")"
    estimate = _of_bodies(patched.mesh, method, ())
    volume = estimate.moments.volume
    error = estimate.error + patched.slack / volume if volume > 0 else np.inf
    provided = _in_hulls(depth) if patched.filled else ""
    off = estimate.inertia
    if volume > 0 and patched.slack > 0:
        off += mass_bounds.off_by_volume(patched.within, patched.slack, estimate.moments)
    return estimate._replace(error=float(error), inertia=off, provided=provided, moved=patched.moved)


def _of_bodies(mesh: Mesh, method: str, notes: tuple[str, ...]) -> _Estimate:
    """Closed bodies together: outer surfaces turned outward, overlaps counted once."""
    parts, turned = outward(bodies(mesh))
    if turned:
        notes += (f"{turned} of {len(parts)} bodies were inside out and were turned",)
    volumes = [signed_volume(p) for p in parts]
    solid = [p for p, v in zip(parts, volumes, strict=True) if v > 0]
    total = sum(volumes)
    if not solid or not total > 0:
        return _Estimate(_NOTHING, method, np.inf, 1.0, notes)
    whole = of_closed_mesh(joined_unmerged(parts))
    if not boxes_meet(solid):
        return _Estimate(whole, method, 0.0, 0.0, notes)
    union = _union(parts, volumes)
    if union is None:
        error = 1 - max(volumes) / sum(v for v in volumes if v > 0)
        largest = of_closed_mesh(parts[int(np.argmax(volumes))])
        off = max(mass_bounds.off_by_difference(whole, largest), error)
        return _Estimate(whole, method + " (overlaps of its bodies not resolved)", error, off, notes)
    once = of_closed_mesh(union)
    if once.volume < whole.volume * (1 - 1e-9):
        notes += (f"its {len(parts)} bodies overlap; the {whole.volume - once.volume:.3g} m³ count once",)
        return _Estimate(once, method, 0.0, 0.0, notes)
    return _Estimate(whole, method, 0.0, 0.0, notes)


def boxes_meet(parts: Sequence[Mesh]) -> bool:
    """Whether the boxes of two of several meshes overlap."""
    low = np.array([p.vertices.min(axis=0) for p in parts])
    high = np.array([p.vertices.max(axis=0) for p in parts])
    order = np.argsort(low[:, 0])
    low, high = low[order], high[order]
    for i in range(len(parts) - 1):
        later = slice(i + 1, int(np.searchsorted(low[:, 0], high[i, 0])))
        if ((low[later] < high[i]) & (low[i] < high[later])).all(axis=1).any():
            return True
    return False


def _union(parts: Sequence[Mesh], volumes: Sequence[float]) -> Mesh | None:
    import manifold3d

    solids: list[object] = []
    cavities: list[object] = []
    for part, volume in zip(parts, volumes, strict=True):
        body = manifold(part if volume > 0 else flipped(part))
        if body is None:
            return None
        (solids if volume > 0 else cavities).append(body)
    whole = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    if cavities:
        whole -= manifold3d.Manifold.batch_boolean(cavities, manifold3d.OpType.Add)
    if whole.status() != manifold3d.Error.NoError or whole.is_empty():
        return None
    return from_manifold(whole)
