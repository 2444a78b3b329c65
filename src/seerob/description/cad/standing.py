"""A link that does not move as a part: the shapes that distances go by, in the colours of what is shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from seerob.core.shapes import Mesh
from seerob.description.cad.containing import around
from seerob.description.description import Link
from seerob.description.lint import FRAME
from seerob.description.shapes.mesh_bodies import is_closed, joined
from seerob.description.shapes.moments import signed_volume

SAME = 1e-6
"""Corners of two surfaces are one within this [m]; areas and volumes within this share."""


def surface(link: Link) -> tuple[tuple[Mesh, ...], float]:
    """Meshes of a link in its frame, and how far its real surface may lie outside of them [m].

    Where what is shown sticks out of what is measured, as far as it does.
    """
    if not link.solids:
        return link.visual, 0.0
    measured = [around(solid) for solid in link.solids]
    meshes = tuple(mesh for mesh, _ in measured)
    deviation = max(far for _, far in measured)
    if not link.visual:
        return meshes, deviation
    if _one(link.visual, meshes):
        return link.visual, deviation
    # Numba is imported only where it is needed.
    from seerob.description.robots.maker_geometry import outside_distances

    colors = [mesh.color for mesh in link.visual]
    if len(colors) != len(meshes):
        colors = colors[:1] * len(meshes)
    meshes = tuple(replace(mesh, color=color) for mesh, color in zip(meshes, colors, strict=True))
    return meshes, max(deviation, float(outside_distances(link).max(initial=0.0)))


def unseen(link: Link) -> str:
    """Why a link is something that no distance sees; empty where it has a shape, or no mass."""
    if link.solids or link.visual:
        return ""
    mass = 0.0 if link.inertial is None else link.inertial.mass
    if mass > FRAME:
        return f"has a mass of {mass:g} kg but no shape"
    return f"has no shape, and its mass cannot be used: {link.refused_mass}" if link.refused_mass else ""


def _one(shown: Sequence[Mesh], measured: Sequence[Mesh]) -> bool:
    """Whether nothing of what is measured is anywhere but in what is shown."""
    pieces = {_key(mesh) for mesh in shown}
    if all(_key(mesh) in pieces for mesh in measured):
        return True
    first, second = joined(shown)[0], joined(measured)[0]
    if not len(first.faces) or not len(second.faces):
        return False
    # Fewer corners on flat faces: still the same surface.
    if not _corners(second) <= _corners(first) or is_closed(first) != is_closed(second):
        return False
    volumes = (signed_volume(first), signed_volume(second)) if is_closed(first) else (0.0, 0.0)
    return bool(np.isclose(_area(first), _area(second), rtol=SAME)) and bool(
        np.isclose(*volumes, rtol=SAME, atol=0.0)
    )


def _key(mesh: Mesh) -> tuple[bytes, bytes]:
    return mesh.vertices.round(9).tobytes(), mesh.faces.astype(np.int32).tobytes()


def _corners(mesh: Mesh) -> set[tuple[int, ...]]:
    return set(map(tuple, (mesh.vertices[mesh.faces.ravel()] / SAME).round().astype(np.int64).tolist()))


def _area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
