"""A CAD file read as what its content is: one assembly, whatever its format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from seerob.core.errors import InputError
from seerob.description.cad import described, scene, sdf, step, threedxml, usd
from seerob.description.cad.assembly import Assembly, baked
from seerob.description.mesh import MAX_BYTES, MAX_FACES, file_content
from seerob.description.mesh_files import MeshSource

TRIANGLES = {".3dxml": "3DXML", ".usd": "USD", ".sdf": "SDF", ".urdf": "URDF", ".mjcf": "MJCF"}
"""Formats besides mesh files whose surfaces are triangles already, by the ending that `recognised` says."""
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
        return baked(scene.read(file, ending, units=units, up=up))
    if units or up:
        what = "only a mesh file does not say its unit or which axis is up"
        raise InputError.at("--units" if units else "--up", "", what, "leave it out")
    source = MeshSource(file, file_content(file, MAX_BYTES), MAX_BYTES, MAX_FACES)
    source.files[file.name] = source.data
    if ending in TRIANGLES:
        known = {".3dxml": threedxml.read, ".usd": usd.read, ".sdf": sdf.read}
        return baked(known[ending](source) if ending in known else described.read(source, ending))
    tolerance = step.TOLERANCE * 1e3 if tolerance is None else tolerance
    if not FINEST <= tolerance <= COARSEST:
        what = f"{tolerance:g} mm"
        raise InputError.at("--tolerance", "", what, f"from {FINEST:g} to {COARSEST:g} mm")
    found = step.read(
        source, iges=ending == ".igs", tolerance=tolerance * 1e-3, cache=cache, progress=progress
    )
    return baked(found)
