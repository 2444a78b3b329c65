"""Assemblies of mesh files: glTF, COLLADA, 3MF, OBJ, STL, PLY and OFF, their instances kept as such."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError
from seerob.core.files.bounded import TooLarge, unpacked
from seerob.core.files.parser_process import parsed
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.cad import collada_kinematics
from seerob.description.cad.assembly import SINGLE, Assembly, Instance, Moving, Shape
from seerob.description.cad.linked import moving
from seerob.description.mesh import MAX_BYTES, OpenedFile, by_color, file_content, opened, parts
from seerob.description.mesh_files import RawMesh
from seerob.description.shapes.mesh_bodies import joined
from seerob.description.xml_values import parse_xml

FORMATS = {
    ".glb": "glTF",
    ".gltf": "glTF",
    ".dae": "COLLADA",
    ".zae": "COLLADA",
    ".3mf": "3MF",
    ".obj": "OBJ",
    ".stl": "STL",
    ".ply": "PLY",
    ".off": "OFF",
}


def read(path: Path, ending: str, *, units: str | None = None, up: str | None = None) -> Assembly:
    """The assembly of a mesh file.

    Args:
        path: The file.
        ending: Of its format, a key of `FORMATS`.
        units: Unit of lengths, where the format does not say or is wrong.
        up: Axis that points up, likewise.

    Raises:
        InputError: It cannot be read, holds no triangles, or its unit is not known.
    """
    data = None
    if ending == ".zae":
        data, ending = _packed(path), ".dae"
    file = opened(path, ending, units=units, up=up, data=data)
    meters = float(np.linalg.norm(file.world_from_file[:, 0]))
    turned = np.eye(4)
    turned[:3, :3] = file.world_from_file / meters
    shapes: list[Shape] = []
    known: dict[tuple[str, ...], int] = {}
    instances: list[Instance] = []
    left_out: list[tuple[str, str]] = []
    groups = parts(file.meshes)
    mechanisms: tuple[Moving, ...] = ()
    if ending == ".dae" and collada_kinematics.MARK in file.source.data:
        groups, mechanisms = _kinematics(file, groups, meters, turned)
    for group in groups:
        first = group[0]
        names = tuple(filter(None, first.name.split("/"))) or (path.stem,)
        key = tuple(mesh.geometry for mesh in group)
        if not all(key) or key not in known:
            shape = _shape(group, file.world_from_file, names[-1])
            if shape is None:
                left_out.append(("/".join(names), "nothing but triangles without area"))
                continue
            known[key] = len(shapes)
            shapes.append(shape)
        world = turned @ _metric(first.file_from_mesh, meters) @ turned.T
        instances.append(Instance(names, known[key], world))
    if not instances and not mechanisms:
        file.source.fail("holds nothing but triangles without area", "export it again")
    findings = tuple(file.source.findings)
    unit = f"{meters:g} m" if units is None else units
    return Assembly(
        FORMATS[ending],
        unit,
        tuple(shapes),
        tuple(instances),
        findings,
        tuple(left_out),
        file.source.files,
        mechanisms,
    )


def _kinematics(
    file: OpenedFile, groups: list[list[RawMesh]], meters: float, turned: Array
) -> tuple[list[list[RawMesh]], tuple[Moving, ...]]:
    """Meshes that no mechanism of a COLLADA file has, and its mechanisms with those that they have."""
    source = file.source
    arguments = source.path, source.data, source.max_bytes, source.max_faces
    rows, told = parsed(collada_kinematics.plain, *arguments, file=str(source.path))
    source.findings += [Finding(level=level, subject=subject, text=text) for level, subject, text in told]
    owners = {
        link["node"]: (number, link["name"])
        for number, row in enumerate(rows)
        for link in row["links"]
        if link["node"]
    }
    free: list[list[RawMesh]] = []
    owned: dict[tuple[int, str], list[RawMesh]] = {}
    for group in groups:
        node = next((node for node in reversed(group[0].nodes) if node in owners), None)
        if node is None:
            free.append(group)
        else:
            owned.setdefault(owners[node], []).extend(group)
    mechanisms = []
    for number, row in enumerate(rows):
        for link in row["links"]:
            # From the scene's frame into the link's, in metres.
            from_world = np.array(link["link_from_world"], float)
            found = [mesh.placed() for mesh in owned.get((number, link["name"]), ())]
            link["meshes"] = tuple(
                Mesh(
                    (m.vertices @ from_world[:3, :3].T + from_world[:3, 3]) * meters,
                    m.faces.astype(np.int32),
                    m.color or Mesh.color,
                )
                for m in found
            )
        world = _metric(np.array(row["world"], float), meters)
        mechanisms.append(moving(source, row, meters, turned @ world))
    return free, tuple(mechanisms)


def _packed(path: Path) -> bytes:
    """The document of a ``.zae`` archive: the one that its manifest names, else the first."""
    whole = file_content(path, MAX_BYTES)
    try:
        with zipfile.ZipFile(io.BytesIO(whole)) as archive:
            names = [name for name in archive.namelist() if name.lower().endswith(".dae")]
            root = ""
            if "manifest.xml" in archive.namelist():
                text = unpacked(archive, "manifest.xml", MAX_BYTES)
                root = (parse_xml(text, f"{path}: manifest.xml").text or "").strip().removeprefix("./")
            return unpacked(archive, root if root in names else names[0], MAX_BYTES)
    except TooLarge as error:
        raise InputError.at(path, "", str(error), "simplify it") from None
    except (zipfile.BadZipFile, zlib.error, RuntimeError, OSError, EOFError, ValueError) as error:
        raise InputError.at(path, "", f"cannot be unpacked ({error})", "export it again") from error


def _metric(file_from_mesh: Array | None, meters: float) -> Array:
    if file_from_mesh is None:
        return np.eye(4)
    matrix = np.array(file_from_mesh, float)
    matrix[:3, 3] *= meters
    return matrix


def _shape(group: Sequence[RawMesh], world_from_file: Array, name: str) -> Shape | None:
    pieces = [
        Mesh(m.vertices @ world_from_file.T, m.faces.astype(np.int32), m.color or Mesh.color) for m in group
    ]
    whole, _ = joined(pieces)
    if not len(whole.faces):
        return None
    label = group[0].geometry.partition("#")[0] or name
    deviation = SINGLE * float(np.abs(whole.vertices).max())
    return Shape(label, by_color(pieces) or (whole,), deviation)
