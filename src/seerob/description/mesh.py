"""Mesh files in: every format becomes named triangle meshes in metres, z up."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from seerob.core.errors import InputError, suggestion
from seerob.core.files.bounded import TooLarge, content, missing_file
from seerob.core.printable import printable
from seerob.core.quantities import LENGTHS
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.mesh_files import MeshSource, RawFile, RawMesh, in_parser_process
from seerob.description.meshes import collada, gltf, obj, off, ply, stl, threemf
from seerob.description.shapes.mesh_bodies import joined
from seerob.description.shapes.mesh_mending import sided

MAX_BYTES = 512 * 2**20
"""Largest mesh file that is read unless the caller says otherwise [bytes]."""
MAX_FACES = 20_000_000
"""Most triangles that are read unless the caller says otherwise."""
FARTHEST = 1e6
"""No part reaches beyond [m]."""

READERS: dict[str, Callable[[MeshSource], RawFile]] = {
    ".stl": stl.read,
    ".obj": obj.read,
    ".ply": in_parser_process(ply.read),
    ".off": off.read,
    ".glb": gltf.read,
    ".gltf": gltf.read,
    ".dae": in_parser_process(collada.read),
    ".3mf": threemf.read,
}
"""File name ending → reader."""

_IMPORTED = {
    **dict.fromkeys((".sldprt", ".sldasm"), "SolidWorks"),
    **dict.fromkeys((".catpart", ".catproduct", ".cgr", ".3dxml"), "CATIA"),
    **dict.fromkeys((".ipt", ".iam"), "Inventor"),
    **dict.fromkeys((".prt", ".asm"), "NX or Creo"),
    **dict.fromkeys((".jt",), "JT"),
    **dict.fromkeys((".step", ".stp", ".iges", ".igs"), "STEP/IGES"),
    **dict.fromkeys((".fbx", ".blend", ".max", ".skp"), "FBX, Blender, 3ds Max or SketchUp"),
}

Z_FROM = {
    "z": np.eye(3),
    "y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "x": np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]),
}
"""Rotation (3, 3) from the axes of a file to z up, by the axis that points up in it."""


@dataclass(frozen=True, eq=False)
class NamedMesh:
    """A mesh with its name in the file it came from."""

    name: str
    """Unique within the file; the path in its scene graph joined with ``/``."""
    mesh: Mesh
    colored: tuple[Mesh, ...] = ()
    """Its surface by colour; empty when it has one."""

    @property
    def drawn(self) -> tuple[Mesh, ...]:
        """What is shown of it."""
        return self.colored or (self.mesh,)


@dataclass(frozen=True, eq=False)
class LoadedMeshes:
    """Everything one mesh file holds, in metres, z up, instance transforms applied."""

    meshes: tuple[NamedMesh, ...]
    findings: tuple[Finding, ...] = ()
    """Units and axes that were assumed, faces that were dropped, files that were missing."""
    files: dict[str, bytes] = field(default_factory=dict)
    """Every file that was read, by its path relative to the mesh file's folder."""

    def plain(self) -> tuple[Mesh, ...]:
        """The meshes without their names."""
        return tuple(named.mesh for named in self.meshes)

    def drawn(self) -> tuple[Mesh, ...]:
        """What is shown of them, by colour."""
        return tuple(mesh for named in self.meshes for mesh in named.drawn)

    def hashes(self) -> dict[str, str]:
        """SHA-256, hexadecimal, of every file that was read."""
        return {name: hashlib.sha256(data).hexdigest() for name, data in self.files.items()}


def load_meshes(
    path: Path | str,
    *,
    units: str | None = None,
    up: str | None = None,
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
    max_bytes: int = MAX_BYTES,
    max_faces: int = MAX_FACES,
) -> LoadedMeshes:
    """Read a mesh file: STL, OBJ, PLY, OFF, glTF, COLLADA or 3MF.

    Args:
        path: The file; its name's ending decides the format.
        units: Unit of the file's lengths, a key of `seerob.core.quantities.LENGTHS`. Required for STL, OBJ,
            PLY and OFF, which do not say; overrules what the other formats say.
        up: ``x``, ``y`` or ``z``: the file's axis that points up. Overrules what the file says; formats
            that do not say are taken as z up, with a finding.
        scale: Factors along x, y, z of the result; negative ones mirror.
        max_bytes: Largest file, with those it refers to [bytes].
        max_faces: Most triangles.

    Returns:
        At least one mesh, each with at least one triangle.

    Raises:
        InputError: the file is missing, too large, broken, empty, in a format that cannot be read,
            refers to a file outside its folder, or its unit is not known.
    """
    path = Path(path)
    _check_options(path, units, up, scale)
    file = opened(path, _ending(path), units=units, up=up, max_bytes=max_bytes, max_faces=max_faces)
    raws = [raw.placed() for raw in file.meshes]
    matrix = np.diag(scale) @ file.world_from_file
    _check_reach(file.source, raws, float(np.abs(matrix).max()))
    meshes = _finished(file.source, raws, matrix)
    return LoadedMeshes(meshes, tuple(file.source.findings), file.source.files)


class OpenedFile(NamedTuple):
    """A mesh file that was read and not yet brought into metres."""

    source: MeshSource
    meshes: tuple[RawMesh, ...]
    """Those that have triangles, where their instances are or with their places beside them."""
    world_from_file: Array
    """Shape (3, 3): to metres, z up."""


def opened(
    path: Path,
    ending: str,
    *,
    units: str | None = None,
    up: str | None = None,
    max_bytes: int = MAX_BYTES,
    max_faces: int = MAX_FACES,
    data: bytes | None = None,
) -> OpenedFile:
    """What a mesh file holds, finite and no larger than a site.

    Args:
        path: The file.
        ending: Which of `READERS` reads it.
        units: As `load_meshes` takes it.
        up: As `load_meshes` takes it.
        max_bytes: Largest file, with those it refers to [bytes].
        max_faces: Most triangles.
        data: What is read instead of the file's own content, as a member of an archive.

    Raises:
        InputError: As `load_meshes` raises it.
    """
    _check_options(path, units, up, (1.0, 1.0, 1.0))
    whole = file_content(path, max_bytes)
    source = MeshSource(path, whole if data is None else data, max_bytes, max_faces)
    source.files[path.name] = whole
    raw = READERS[ending](source)
    meshes = tuple(m for m in raw.meshes if len(m.faces))
    if not meshes:
        source.fail("holds no triangles", "export surfaces, not only points, lines or a B-rep")
    raws = [m.placed() for m in meshes]
    _check(source, raws)
    _check_reach(source, raws, min(LENGTHS.values()))
    matrix = Z_FROM[_up(source, raw, up)] * _meters(source, raw, raws, units)
    _check_reach(source, raws, float(np.abs(matrix).max()))
    return OpenedFile(source, meshes, matrix)


def _check_options(path: Path, units: str | None, up: str | None, scale: tuple[float, ...]) -> None:
    if units is not None and units not in LENGTHS:
        raise InputError.at(path, "units", f"{units!r} is not a unit of length", suggestion(units, LENGTHS))
    if up is not None and up not in Z_FROM:
        raise InputError.at(path, "up", f"{up!r} is not an axis", "x, y or z")
    if len(scale) != 3 or not np.all(np.isfinite(scale)) or np.any(np.asarray(scale) == 0):
        raise InputError.at(path, "scale", f"{scale!r}", "three finite factors, none of them zero")


def _ending(path: Path) -> str:
    ending = path.suffix.lower()
    if ending in READERS:
        return ending
    known = "STL, OBJ, PLY, OFF, GLB, glTF, COLLADA (.dae) or 3MF"
    if maker := _IMPORTED.get(ending):
        what = f"{maker} files ({ending}) are no meshes"
        remedy = (
            f"seerob import {path.name[:80]} FOLDER reads it or says what to export; {known} are read here"
        )
        raise InputError.at(path, "", what, remedy)
    raise InputError.at(path, "", f"{ending or 'no ending'!r} is not a mesh format", f"{known} are read")


def file_content(path: Path, max_bytes: int) -> bytes:
    """A file whole.

    Raises:
        InputError: It is missing, empty, too large, or a web page that was saved instead.
    """
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "there is no such file"
        raise InputError.at(path, "", what, missing_file(path, "name a mesh file"))
    try:
        held = content(path, max_bytes)
    except TooLarge as error:
        raise InputError.at(path, "", str(error), "simplify it or raise max_bytes") from None
    except OSError as error:
        raise InputError.at(path, "", f"cannot be read: {error.strerror}", "check its permissions") from error
    if not held:
        raise InputError.at(path, "", "is empty", "export it again")
    if held[:512].lstrip(b"\xef\xbb\xbf \t\r\n")[:14].lower().startswith((b"<!doctype html", b"<html")):
        what = "is a web page, not a mesh: a link was saved instead of the file"
        raise InputError.at(path, "", what, "download the file itself")
    return held


def _check(source: MeshSource, raws: list[RawMesh]) -> None:
    total = sum(len(m.faces) for m in raws)
    if total > source.max_faces:
        source.fail(f"has {total} triangles, more than {source.max_faces}", "simplify it or raise max_faces")
    for m in raws:
        if len(m.vertices) == 0 or m.faces.min() < 0 or m.faces.max() >= len(m.vertices):
            source.fail("a face names a vertex that does not exist", "export it again", m.name)
        used = m.vertices[m.faces.ravel()]
        if not np.isfinite(used).all():
            bad = used[~np.isfinite(used).all(axis=1)][0]
            source.fail(f"a vertex is not finite: {bad.tolist()}", "export it again", m.name)


def _check_reach(source: MeshSource, raws: list[RawMesh], meters: float) -> None:
    for m in raws:
        farthest = float(np.abs(m.vertices[m.faces.ravel()]).max())
        if not farthest <= FARTHEST / meters:
            what = f"a coordinate is {farthest:g}, which is beyond {FARTHEST:g} m"
            source.fail(what, "check its coordinates, units and scale", m.name)


def _extent(raws: list[RawMesh]) -> Array:
    low = np.min([m.vertices[m.faces.ravel()].min(axis=0) for m in raws], axis=0)
    high = np.max([m.vertices[m.faces.ravel()].max(axis=0) for m in raws], axis=0)
    return np.asarray(high - low)


def _meters(source: MeshSource, raw: RawFile, raws: list[RawMesh], units: str | None) -> float:
    if units is not None:
        meters = LENGTHS[units]
        if raw.meters is not None and not np.isclose(raw.meters, meters, rtol=1e-9):
            source.note(f"read in {units} as asked, though the file says {raw.meters:g} m", level="warning")
        return meters
    if raw.meters is not None:
        return raw.meters
    extent = _extent(raws)
    shown = " × ".join(f"{e:.4g}" for e in extent)
    largest = float(extent.max())
    plausible = [u for u in ("m", "mm", "inch", "cm", "um") if 0.01 <= largest * LENGTHS[u] <= 10.0]
    remedy = f"extent {shown}: " + (
        f'units = "{plausible[0]}" would make it {largest * LENGTHS[plausible[0]]:.4g} m'
        if plausible
        else "say units, one of " + ", ".join(LENGTHS)
    )
    source.fail("the file does not say its unit of length", remedy, "units")


def _up(source: MeshSource, raw: RawFile, up: str | None) -> str:
    if up is not None:
        if raw.up is not None and raw.up != up:
            source.note(f"read with {up} up as asked, though the file says {raw.up} up", level="warning")
        return up
    if raw.up is not None:
        return raw.up
    source.note("the file does not say which axis points up: taken as z", level="assumed")
    return "z"


def _finished(source: MeshSource, raws: list[RawMesh], matrix: Array) -> tuple[NamedMesh, ...]:
    mirrored = np.linalg.det(matrix) < 0
    taken: set[str] = set()
    meshes = []
    for group in parts(raws):
        name = _unique(printable(group[0].name) or source.path.stem, taken)
        pieces = []
        for raw in group:
            faces = raw.faces[:, ::-1] if mirrored else raw.faces
            with np.errstate(all="ignore"):  # a vertex that no face uses may be anything
                vertices = raw.vertices @ matrix.T
            pieces.append(Mesh(vertices, faces.astype(np.int32), raw.color or Mesh.color))
        mesh, said = joined(pieces)
        if said:
            source.note(f"{name}: {said}")
        if len(mesh.faces):
            mesh, turned = sided(mesh)
            if turned:
                source.note(f"{name}: {turned}")
            meshes.append(NamedMesh(name, mesh, by_color(pieces)))
        else:
            source.note(f"{name}: nothing but triangles without area; left out", level="warning")
    if not meshes:
        source.fail("holds nothing but triangles without area", "export it again")
    return tuple(meshes)


def parts(raws: Sequence[RawMesh]) -> list[list[RawMesh]]:
    """Meshes that are one part together, in the file's order."""
    groups: dict[object, list[RawMesh]] = {}
    for number, raw in enumerate(raws):
        groups.setdefault(("alone", number) if raw.part is None else raw.part, []).append(raw)
    return list(groups.values())


def by_color(pieces: Sequence[Mesh]) -> tuple[Mesh, ...]:
    """One mesh per colour; empty when there is one colour."""
    groups: dict[object, list[Mesh]] = {}
    for piece in pieces:
        groups.setdefault(piece.color, []).append(piece)
    if len(groups) < 2:
        return ()
    return tuple(mesh for group in groups.values() if len((mesh := joined(group)[0]).faces))


def _unique(name: str, taken: set[str]) -> str:
    number, unique = 1, name
    while unique in taken:
        number += 1
        unique = f"{name}_{number}"
    taken.add(unique)
    return unique
