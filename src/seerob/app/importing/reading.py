"""A CAD file read as what its content is: one assembly, whatever its format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError
from seerob.core.printable import printable
from seerob.core.shapes import Mesh
from seerob.description.cad import described, scene, sdf, step, threedxml, usd
from seerob.description.cad.assembly import Assembly, baked, without, without_numbers
from seerob.description.mesh import FARTHEST, MAX_BYTES, MAX_FACES, file_content
from seerob.description.mesh_files import MeshSource

TRIANGLES = {".3dxml": "3DXML", ".usd": "USD", ".sdf": "SDF", ".urdf": "URDF", ".mjcf": "MJCF"}
"""Formats besides mesh files whose surfaces are triangles already, by the ending that `recognised` says."""
LARGEST = 1e30
"""No number of a shape or a transform is larger before both are put together; nothing overflows then."""
FINEST, COARSEST = 1e-3, 50.0
"""Tolerances that are taken [mm]."""


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
        what = "only a mesh file does not say its unit or which axis is up"
        raise InputError.at("--units" if units else "--up", "", what, "leave it out")
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


def wanted(
    assembly: Assembly,
    *,
    patterns: Sequence[str] = (),
    smaller: float | None = None,
    unreachable: float | None = None,
    triangles: int | None = None,
) -> Assembly:
    """The assembly without what the user leaves out.

    Args:
        assembly: With rigid places.
        patterns: Full names of parts that go, with wildcards.
        smaller: Parts smaller than this in every direction go [mm].
        unreachable: Parts inside of others that nothing thicker can touch go [mm].
        triangles: Most of each part on the screen; only looked at.

    Raises:
        InputError: A pattern is nobody's name, a number is out of bounds, or nothing is left.
    """
    for key, given in (("--smaller", smaller), ("--unreachable", unreachable)):
        if given is not None and not 0 < given <= 1e4:
            raise InputError.at(key, "", f"{given:g} mm", "more than 0 and at most 10000 mm")
    if triangles is not None and not 100 <= triangles <= MAX_FACES:
        what = f"{triangles} triangles"
        raise InputError.at("--triangles", "", what, "at least 100 are needed to show a shape")
    try:
        kept = without(assembly, patterns, None if smaller is None else smaller * 1e-3)
    except ValueError as error:
        names = ", ".join(assembly.names()[:5])
        raise InputError.at("--without", "", str(error), f"full names, as {names}") from None
    if unreachable is None:
        return kept
    from seerob.app.importing.unreachable import unreachable as inside_of

    try:
        inside = inside_of(kept, unreachable * 1e-3)
    except ValueError as error:
        raise InputError.at("--unreachable", "", f"{unreachable:g} mm", str(error)) from None
    return without_numbers(kept, inside, f"--unreachable {unreachable:g}; inside of others")


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
