"""A mesh file made ready for a body: exact for distances, light for the screen; made once for each content.

What is made is kept while the process lives, and in a folder from start to start, by the hash of the file's
content, of how it is read and of the versions of what reads it: another content is another entry, so nothing
there can be out of date.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.files.whole_file import whole_file
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Finding
from seerob.description.cad.reading import as_one, made_with
from seerob.description.mesh import MAX_BYTES, READERS, file_content, load_meshes
from seerob.description.shapes import detail
from seerob.description.shapes.mesh_bodies import is_closed

EDITION = 2
"""Counts up where the same content would become something else, so that nothing old is taken."""
MOST_BYTES = 1 << 30
"""Memory that what is kept in the process may take [byte]; beyond it, all is forgotten."""


@dataclass(frozen=True, eq=False)
class PreparedMesh:
    """One mesh of a file [m], z up."""

    name: str
    mesh: Mesh
    """The mesh that the file has, in metres."""
    exact: detail.DerivedMesh
    """For distances."""
    drawn: tuple[Mesh, ...]
    """By colour, as the file has it."""
    shown: tuple[detail.DerivedMesh, ...]
    """Of ``drawn``, for the screen."""
    closed: bool


@dataclass(frozen=True, eq=False)
class PreparedFile:
    """What a mesh file holds."""

    meshes: tuple[PreparedMesh, ...]
    findings: tuple[Finding, ...]
    files: dict[str, bytes]
    deviation: float = 0.0
    """How far the real surface may lie outside the meshes [m], as far as the file's reader knows."""

    @property
    def size(self) -> int:
        """Memory that it takes, nearly [byte]."""
        return sum(
            mesh.vertices.nbytes + mesh.faces.nbytes
            for each in self.meshes
            for mesh in (each.mesh, each.exact, *each.drawn, *each.shown)
        ) + sum(map(len, self.files.values()))


_kept: dict[str, PreparedFile] = {}
_held = [0]


def prepared(
    path: Path,
    *,
    units: str | None = None,
    up: str | None = None,
    triangles: int = detail.SHOWN,
    cache: Path | None = None,
) -> PreparedFile:
    """A mesh file made ready.

    Args:
        path: The file.
        units: Unit of its lengths, where its format does not say.
        up: Its axis that points up, likewise.
        triangles: Most of each of its meshes on the screen.
        cache: Folder that keeps what was made from start to start.

    Raises:
        InputError: As `load_meshes` or, of other formats, `as_one` raises it.
        MissingPackage: The file needs a package of an extra.
    """
    content = file_content(path, MAX_BYTES)
    ending = path.suffix.lower()
    readers = () if ending in READERS else made_with()
    words = repr((EDITION, readers, ending, path.stem, units, up, triangles)).encode()
    key = hashlib.sha256(hashlib.sha256(content).digest() + words).hexdigest()[:40]
    found = _kept.get(key)
    if found is None and cache is not None:
        found = _read(cache / f"mesh-{key}.npz", path.name, content)
    if found is None:
        found = _made(path, units, up, triangles)
        # What names other files is not told by its own content.
        if cache is not None and len(found.files) == 1:
            _write(cache / f"mesh-{key}.npz", found)
    if len(found.files) == 1:
        if key not in _kept and _held[0] + found.size > MOST_BYTES:
            _kept.clear()
            _held[0] = 0
        if key not in _kept:
            _kept[key] = found
            _held[0] += found.size
    return found


def _made(path: Path, units: str | None, up: str | None, triangles: int) -> PreparedFile:
    deviation = 0.0
    if path.suffix.lower() in READERS:
        loaded = load_meshes(path, units=units, up=up)
    else:
        loaded, deviation = as_one(path, units=units, up=up)
    made = tuple(
        PreparedMesh(
            named.name,
            named.mesh,
            detail.physics_mesh(named.mesh),
            named.drawn,
            tuple(detail.display_mesh(mesh, max_triangles=triangles) for mesh in named.drawn),
            is_closed(named.mesh),
        )
        for named in loaded.meshes
    )
    return PreparedFile(made, loaded.findings, loaded.files, deviation)


# -- from start to start ----------------------------------------------------------------------


def _write(file: Path, found: PreparedFile) -> None:
    arrays: dict[str, Any] = {}

    def put(mesh: Mesh) -> dict[str, Any]:
        number = len(arrays) // 2
        arrays[f"v{number}"], arrays[f"f{number}"] = mesh.vertices, mesh.faces
        said: dict[str, Any] = {"number": number, "color": mesh.color}
        if isinstance(mesh, detail.DerivedMesh):
            said |= {"deviation": mesh.deviation, "method": mesh.method}
        return said

    rows = [
        {
            "name": each.name,
            "mesh": put(each.mesh),
            "exact": put(each.exact),
            "drawn": [put(mesh) for mesh in each.drawn],
            "shown": [put(mesh) for mesh in each.shown],
            "closed": each.closed,
        }
        for each in found.meshes
    ]
    said = [[f.level, f.subject, f.text, list(f.holds)] for f in found.findings]
    text = json.dumps({"meshes": rows, "findings": said, "deviation": found.deviation}).encode()
    arrays["about"] = np.frombuffer(text, np.uint8)
    with contextlib.suppress(OSError):  # a folder that is full, or may not be written
        file.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(file) as hidden, hidden.open("wb") as stream:
            np.savez(stream, **arrays)


def _read(file: Path, name: str, content: bytes) -> PreparedFile | None:
    """What was kept; None where nothing was, or it cannot be read."""
    try:
        with np.load(io.BytesIO(file.read_bytes()), allow_pickle=False) as arrays:
            about = json.loads(arrays["about"].tobytes())
            meshes = tuple(_mesh(row, arrays.__getitem__) for row in about["meshes"])
            deviation = float(about["deviation"])
    except (OSError, ValueError, LookupError, TypeError, EOFError, zipfile.BadZipFile):
        return None
    findings = tuple(
        Finding(level=level, subject=subject, text=text, holds=tuple(holds))
        for level, subject, text, holds in about["findings"]
    )
    return PreparedFile(meshes, findings, {name: content}, deviation)


def _mesh(row: dict[str, Any], array: Callable[[str], NDArray[Any]]) -> PreparedMesh:
    def get(said: dict[str, Any]) -> tuple[Any, Any, Any]:
        return array(f"v{said['number']}"), array(f"f{said['number']}"), tuple(said["color"])

    def derived(said: dict[str, Any]) -> detail.DerivedMesh:
        return detail.DerivedMesh(*get(said), said["deviation"], said["method"])

    return PreparedMesh(
        row["name"],
        Mesh(*get(row["mesh"])),
        derived(row["exact"]),
        tuple(Mesh(*get(said)) for said in row["drawn"]),
        tuple(map(derived, row["shown"])),
        row["closed"],
    )
