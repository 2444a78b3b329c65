"""Assemblies kept by the content of their files, how they were read and what read them.

Another content, option or reader is another entry, so nothing there can be out of date. Surfaces of
OpenCASCADE are slow to cut into triangles; of other formats nothing is kept.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_file
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Finding
from seerob.description.cad.assembly import Assembly, Instance, Shape, Surface
from seerob.description.mesh_files import MeshSource
from seerob.description.shapes.moments import Moments

MOST = 32
"""Assemblies that are kept; beyond it, those that were used longest ago go."""


def key(source: MeshSource, how: tuple[object, ...]) -> str:
    """What a content, the way in which it is read, and what reads it are kept under."""
    words = repr((_reader(), source.path.stem, source.max_faces, how)).encode()
    return hashlib.sha256(hashlib.sha256(source.data).digest() + words).hexdigest()[:40]


@cache
def _reader() -> str:
    """What tells the readers of this room from those of another day."""
    content = hashlib.sha256()
    for file in sorted(Path(__file__).parents[1].rglob("*.py")):
        content.update(hashlib.sha256(file.read_bytes()).digest())
    return content.hexdigest()


def write(folder: Path, name: str, assembly: Assembly) -> None:
    """Keep an assembly without mechanisms; a folder that is full, or may not be written, keeps nothing."""
    arrays: dict[str, NDArray[Any]] = {}

    def put(array: Any) -> str:
        arrays[f"a{len(arrays)}"] = np.asarray(array)
        return f"a{len(arrays) - 1}"

    shapes = [
        {
            "name": shape.name,
            "pieces": [[put(m.vertices), put(m.faces), list(m.color)] for m in shape.pieces],
            "deviation": shape.deviation,
            "solids": shape.solids,
            "material": shape.material,
            "density": shape.density,
            "solid": None
            if shape.solid is None
            else put([shape.solid.volume, *shape.solid.com, *shape.solid.inertia.ravel()]),
            "surfaces": [[s.kind, list(s.round), len(s.corners)] for s in shape.surfaces],
            "frames": put([[*s.point, *s.axis] for s in shape.surfaces]),
            "corners": put(np.vstack([np.empty((0, 3)), *(s.corners for s in shape.surfaces)])),
        }
        for shape in assembly.shapes
    ]
    about = {
        "format": assembly.format,
        "unit": assembly.unit,
        "shapes": shapes,
        "instances": [[i.path, i.shape, i.color] for i in assembly.instances],
        "places": put([i.world_from_shape for i in assembly.instances]),
        "findings": [[f.level, f.subject, f.text] for f in assembly.findings],
        "left_out": assembly.left_out,
        "files": {file: hashlib.sha256(data).hexdigest() for file, data in assembly.files.items()},
    }
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        with whole_file(_file(folder, name)) as hidden, hidden.open("wb") as stream:
            np.savez(stream, **arrays)  # type: ignore[arg-type]
        old = sorted(folder.glob("cad-*.npz"), key=lambda file: -file.stat().st_mtime_ns)[MOST:]
        for file in old:
            file.unlink(missing_ok=True)


def read(folder: Path, name: str, source: MeshSource) -> Assembly | None:
    """What was kept; None where nothing was, or a file that it names is another one now."""
    file = _file(folder, name)
    try:
        with np.load(io.BytesIO(file.read_bytes()), allow_pickle=False) as arrays:
            about = json.loads(arrays["about"].tobytes())
            if not _same(source, about["files"]):
                return None
            found = _assembly(about, arrays.__getitem__, dict(source.files))
    except (OSError, ValueError, LookupError, TypeError, EOFError, zipfile.BadZipFile):
        return None
    with contextlib.suppress(OSError):
        file.touch()
    return found


def _file(folder: Path, name: str) -> Path:
    return folder / f"cad-{name}.npz"


def _same(source: MeshSource, files: dict[str, str]) -> bool:
    """Whether the files that the first one names are what they were; the source has them then."""
    for file, digest in files.items():
        try:
            data = source.files[file] if file in source.files else source.beside(file)
        except InputError:
            return False
        if data is None or hashlib.sha256(data).hexdigest() != digest:
            return False
    return True


def _assembly(
    about: dict[str, Any], array: Callable[[str], NDArray[Any]], files: dict[str, bytes]
) -> Assembly:
    places = array(about["places"])
    instances = tuple(
        Instance(tuple(path), shape, places[k], None if color is None else tuple(color))
        for k, (path, shape, color) in enumerate(about["instances"])
    )
    return Assembly(
        about["format"],
        about["unit"],
        tuple(_shape(row, array) for row in about["shapes"]),
        instances,
        tuple(Finding(level=level, subject=subject, text=text) for level, subject, text in about["findings"]),
        tuple((name, why) for name, why in about["left_out"]),
        files,
    )


def _shape(row: dict[str, Any], array: Callable[[str], NDArray[Any]]) -> Shape:
    pieces = tuple(Mesh(array(v), array(f), tuple(color)) for v, f, color in row["pieces"])
    frames, corners = array(row["frames"]), array(row["corners"])
    ends = np.cumsum([0, *(count for *_, count in row["surfaces"])])
    surfaces = tuple(
        Surface(kind, frames[k, :3], frames[k, 3:], tuple(figures), corners[ends[k] : ends[k + 1]])
        for k, (kind, figures, _) in enumerate(row["surfaces"])
    )
    solid = None
    if row["solid"] is not None:
        volume, *rest = array(row["solid"])
        solid = Moments(float(volume), np.array(rest[:3]), np.array(rest[3:]).reshape(3, 3))
    return Shape(
        row["name"], pieces, row["deviation"], row["solids"], row["material"], surfaces, solid, row["density"]
    )
