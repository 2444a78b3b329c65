"""A CAD file read as what its content is: one assembly, whatever its format."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from seerob.core.errors import InputError
from seerob.core.extras import edition
from seerob.core.printable import printable
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.cad import described, scene, sdf, standing, step, threedxml, usd
from seerob.description.cad.assembly import LARGEST, NOTHING, Assembly, Moving, baked
from seerob.description.cad.names import told_apart
from seerob.description.cad.recognised import recognised
from seerob.description.description import base_from_links
from seerob.description.mesh import (
    FARTHEST,
    MAX_BYTES,
    MAX_FACES,
    LoadedMeshes,
    NamedMesh,
    by_color,
    file_content,
)
from seerob.description.mesh_files import MeshSource
from seerob.description.shapes.mesh_bodies import joined

TRIANGLES = {".3dxml": "3DXML", ".usd": "USD", ".sdf": "SDF", ".urdf": "URDF", ".mjcf": "MJCF"}
"""Formats besides mesh files whose surfaces are triangles already, by the ending that `recognised` says."""
FINEST, COARSEST = 1e-3, 50.0
"""Tolerances that are taken [mm]."""
STATED = "only a mesh file does not say its unit or which axis is up", "leave it out"
"""Why a format takes no unit and no axis, and what to do."""


def read(
    file: Path,
    ending: str,
    *,
    tolerance: float | None = None,
    units: str | None = None,
    up: str | None = None,
    cache: Path | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Assembly:
    """The assembly of a CAD file, its places rigid.

    Args:
        file: The file.
        ending: Of its format, as `recognised` says.
        tolerance: How far triangles may be from a STEP or IGES surface [mm]; None for 0.1.
        units: Unit of lengths of a mesh file that does not say it.
        up: Axis of it that points up, likewise.
        cache: Folder that keeps what was read of STEP and IGES, by content.
        progress: Told how far it is.

    Raises:
        InputError: It cannot be read, or an option is none that its format has a use for.
        MissingPackage: The file needs a package of an extra.
    """
    format_ = scene.FORMATS.get(ending) or TRIANGLES.get(ending)
    if format_ is not None and tolerance is not None:
        raise InputError.at("--tolerance", "", f"a {format_} file has triangles already")
    progress(f"reading {file.name}")
    if ending in scene.FORMATS:
        return _near(scene.read(file, ending, units=units, up=up), file)
    if units or up:
        raise InputError.at("--units" if units else "--up", "", *STATED)
    source = MeshSource(file, file_content(file, MAX_BYTES), MAX_BYTES, MAX_FACES)
    source.files[file.name] = source.data
    if ending in TRIANGLES:
        known = {".3dxml": threedxml.read, ".usd": usd.read, ".sdf": sdf.read}
        return _near(known[ending](source) if ending in known else described.read(source, ending), file)
    tolerance = step.TOLERANCE * 1e3 if tolerance is None else tolerance
    if not FINEST <= tolerance <= COARSEST:
        what = f"{tolerance:g} mm"
        raise InputError.at("--tolerance", "", what, f"from {FINEST:g} to {COARSEST:g} mm")
    found = step.read(
        source, iges=ending == ".igs", tolerance=tolerance * 1e-3, cache=cache, progress=progress
    )
    return _near(found, file)


def as_one(path: Path, *, units: str | None = None, up: str | None = None) -> tuple[LoadedMeshes, float]:
    """All that a CAD file or a description holds, as one rigid thing, and its deviation [m].

    Mechanisms are as the file shows them, by the shapes that distances go by.

    Args:
        path: The file, of any format that `read` takes.
        units: As `read` takes it.
        up: As `read` takes it.

    Returns:
        Its meshes, each of them a surface that distances go by, and how far the real one may lie outside.

    Raises:
        InputError: As `read` raises it; or something of it could not be brought.
        MissingPackage: The file needs a package of an extra.
    """
    ending = recognised(path, file_content(path, MAX_BYTES))
    if (units or up) and ending not in scene.FORMATS:
        raise InputError.at(path, "units" if units else "up", *STATED)
    if ending in (".aml", ".amlx"):
        raise InputError.at(path, "", "is a plant, not one thing", "seerob import makes a workstation of it")
    assembly = read(path, ending, units=units, up=up)
    lost = [f"{name}: {why}" for name, why in assembly.left_out if not why.startswith(NOTHING)]
    links = [link for moving in assembly.mechanisms for link in moving.description.links]
    lost += [f"{link.name}: {why}" for link in links if (why := standing.unseen(link))]
    if lost:
        what = f"cannot be brought whole: {'; '.join(lost)}"
        raise InputError.at(path, "", printable(what)[:500], "export it anew, or import it: docs/import.md")
    things = [*_standing(assembly), *(thing for moving in assembly.mechanisms for thing in _linked(moving))]
    things = [thing for thing in things if len(thing.whole.faces)]
    if not things:
        raise InputError.at(path, "", "holds no surface", "export solids or surfaces")
    names = told_apart(thing.name for thing in things)
    parts = tuple(
        NamedMesh(name, thing.whole, thing.colored) for name, thing in zip(names, things, strict=True)
    )
    findings = assembly.findings
    for moving in assembly.mechanisms:
        text = "its joints do not move: it is one rigid thing, as the file shows it"
        findings += (Finding(level="note", subject=moving.description.name, text=text),)
    return LoadedMeshes(parts, findings, assembly.files), max(thing.deviation for thing in things)


def made_with() -> tuple[object, ...]:
    """What an answer of `as_one` depends on besides the file: versions of its readers, and the tolerance."""
    return step.TOLERANCE, edition(*step.PACKAGES), edition("usd-core"), edition("mujoco")


class _Rigid(NamedTuple):
    """An instance or a link, where it is."""

    name: str
    whole: Mesh
    colored: tuple[Mesh, ...]
    deviation: float

    @classmethod
    def of(cls, name: str, pieces: Iterable[Mesh], place: Array, deviation: float) -> Self:
        moved = [mesh.moved(place) for mesh in pieces]
        return cls(name, joined(moved)[0], by_color(moved), deviation)


def _standing(assembly: Assembly) -> Iterator[_Rigid]:
    for name, instance in zip(assembly.names(), assembly.instances, strict=True):
        shape = assembly.shapes[instance.shape]
        yield _Rigid.of(name, shape.pieces, instance.world_from_shape, shape.deviation)


def _linked(moving: Moving) -> Iterator[_Rigid]:
    robot = moving.description
    q = dict(zip((joint.name for joint in robot.joints()), moving.q, strict=False))
    poses = base_from_links(robot, q)
    for link in robot.links:
        pieces, deviation = standing.surface(link)
        if pieces:
            yield _Rigid.of(link.name, pieces, moving.world_from_base @ poses[link.name], deviation)


def _near(assembly: Assembly, file: Path) -> Assembly:
    """The assembly, its places rigid, where all of it is within `FARTHEST`.

    Raises:
        InputError: Something is farther away, or nowhere.
    """
    _within(assembly, file, LARGEST)
    rigid = baked(assembly)
    _within(rigid, file, FARTHEST)
    return rigid


def _within(assembly: Assembly, file: Path, most: float) -> None:
    for shape in assembly.shapes:
        for size in (shape.deviation, *(_reach(mesh) for mesh in shape.pieces)):
            _bounded(file, shape.name, size, most)
    for instance in assembly.instances:
        _bounded(file, "/".join(instance.path), float(np.abs(instance.world_from_shape).max()), most)
    for moving in assembly.mechanisms:
        for link in moving.description.links:
            meshes = (*link.visual, *(solid.mesh for solid in link.solids if solid.mesh is not None))
            for size in (float(np.abs(link.parent_from_link).max()), *map(_reach, meshes)):
                _bounded(file, link.name, size, most)


def _reach(mesh: Mesh) -> float:
    return float(np.abs(mesh.vertices).max(initial=0.0))


def _bounded(file: Path, name: str, size: float, most: float) -> None:
    if not size <= most:
        what = f"{size:.3g} m, which is beyond {most:g} m"
        raise InputError.at(file, printable(name)[:200], what, "check its unit and its transforms")
