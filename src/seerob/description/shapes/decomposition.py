"""Concave parts cut into convex ones, for MuJoCo's contacts: it replaces every mesh by its hull.

Only contacts use these parts; distances always see the mesh itself.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.files.whole_file import whole_file
from seerob.core.shapes import Mesh
from seerob.core.transforms import Array
from seerob.description.shapes.detail import display_mesh, manifold
from seerob.description.shapes.hull import convex_hull
from seerob.description.shapes.mesh_bodies import tidied
from seerob.description.shapes.moments import signed_volume

_CONVEX = 1e-6
_VERSION = 1
"""Of the cached files; a change makes old ones unread."""


@dataclass(frozen=True, eq=False)
class ConvexParts:
    """Convex meshes that together stand for a concave one; iterates over them."""

    parts: tuple[Mesh, ...]
    excess: float
    """Volume of the parts outside the mesh over the mesh's volume; NaN when the mesh is not closed."""
    missing: float
    """Volume of the mesh outside the parts over the mesh's volume; NaN when the mesh is not closed."""

    def __iter__(self) -> Iterator[Mesh]:
        return iter(self.parts)

    def __len__(self) -> int:
        return len(self.parts)


def convex_parts(
    mesh: Mesh,
    *,
    threshold: float = 0.05,
    max_parts: int | None = None,
    max_triangles: int = 10_000,
    cache: Path | None = None,
) -> ConvexParts:
    """Approximate convex decomposition (CoACD) with how much it sticks out and leaves out.

    Args:
        mesh: Any mesh [m]; a convex one comes back as its own only part.
        threshold: Concavity that is tolerated, relative to the size: 0.01 fine and slow … 1 coarse.
        max_parts: Most parts; None for as many as the threshold needs.
        max_triangles: Larger meshes are simplified before they are cut.
        cache: Folder for results, by content; made when it does not exist.

    Returns:
        At least one part; closed convex meshes with outward normals.

    Raises:
        InputError: the mesh is flat, or the threshold is outside 0.01…1.
    """
    if not 0.01 <= threshold <= 1:
        raise InputError.at("convex decomposition", "threshold", f"{threshold!r}", "0.01 … 1")
    mesh = tidied(mesh)[0]
    hull = _hull(mesh)
    closed = manifold(mesh)
    if closed is not None and signed_volume(mesh) > signed_volume(hull) * (1 - _CONVEX):
        return ConvexParts((mesh,), 0.0, 0.0)
    file = None if cache is None else cache / f"convex_{_key(mesh, threshold, max_parts, max_triangles)}.npz"
    found = None if file is None else _read(file, mesh.color)
    if found is None:
        parts = tuple(_cut(mesh, threshold, max_parts, max_triangles)) or (hull,)
        excess, missing = _compared(closed, parts)
        found = ConvexParts(parts, excess, missing)
        if file is not None:
            _write(file, found)
    return found


def _hull(mesh: Mesh) -> Mesh:
    hull = _hull_of(mesh.vertices, mesh.color)
    if hull is None:
        raise InputError.at("convex decomposition", "", "the mesh is flat", "contacts need a volume")
    return hull


def _hull_of(points: Array, color: tuple[float, float, float, float]) -> Mesh | None:
    faces = convex_hull(points)
    return None if faces is None else tidied(Mesh(points, faces, color))[0]


def _cut(mesh: Mesh, threshold: float, max_parts: int | None, max_triangles: int) -> Iterator[Mesh]:
    need("coacd")
    import coacd

    coacd.set_log_level("error")
    light = display_mesh(mesh, max_triangles=max_triangles)
    pieces = coacd.run_coacd(
        coacd.Mesh(light.vertices, light.faces),
        threshold=threshold,
        max_convex_hull=-1 if max_parts is None else max_parts,
        seed=0,
    )
    for vertices, _ in pieces:
        part = _hull_of(np.asarray(vertices, float), mesh.color)
        if part is not None:
            yield part


def _compared(closed: Any | None, parts: tuple[Mesh, ...]) -> tuple[float, float]:
    import manifold3d

    solids = [manifold(p) for p in parts]
    if closed is None or not closed.volume() > 0 or any(s is None for s in solids):
        return float("nan"), float("nan")
    union = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    volume = closed.volume()
    return max((union - closed).volume() / volume, 0.0), max((closed - union).volume() / volume, 0.0)


def _key(mesh: Mesh, threshold: float, max_parts: int | None, max_triangles: int) -> str:
    digest = hashlib.sha256()
    for array in (mesh.vertices, mesh.faces):
        digest.update(struct.pack("<q", len(array)) + np.ascontiguousarray(array).tobytes())
    digest.update(repr((_VERSION, threshold, max_parts, max_triangles)).encode())
    return digest.hexdigest()[:32]


def _write(file: Path, found: ConvexParts) -> None:
    """All or nothing: a run that is stopped here leaves no half file behind."""
    file.parent.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, Any] = {f"v{i}": p.vertices for i, p in enumerate(found.parts)}
    arrays |= {f"f{i}": p.faces for i, p in enumerate(found.parts)}
    with whole_file(file) as hidden, hidden.open("xb") as stream:
        np.savez_compressed(stream, volumes=np.array([found.excess, found.missing]), **arrays)


def _read(file: Path, color: tuple[float, float, float, float]) -> ConvexParts | None:
    """None when there is no such file, or when it is broken: then it is made again."""
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as data:
            count = sum(name.startswith("v") and name[1:].isdigit() for name in data.files)
            parts = tuple(Mesh(data[f"v{i}"], data[f"f{i}"], color) for i in range(count))
            excess, missing = data["volumes"].tolist()
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None
    return ConvexParts(parts, excess, missing) if parts else None
